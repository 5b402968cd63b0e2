"""A body model's joints: where they are at rest for a person's shape, and which hangs on which.

The user's own NPZ of SMPL (Loper et al. 2015), SMPL+H or SMPL-X: joints at rest are
``J = J_regressor (v_template + shapedirs betas)`` (their eq. 8 to 10); ``kintree_table`` has each joint's parent in its
first row. Or of joints alone: ``J`` (K, 3) with, for shapes, ``J_shapedirs`` (K, 3, B). Nothing is skinned.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.formats.own.units import FARTHEST_COORDINATE
from posekit.geometry import Array
from posekit.safe_io import open_npz, refusal
from posekit.safe_io.npz_file import Archive

MAX_BYTES: Final = 2_000_000_000
"""What the arrays of one model may take, unpacked: SMPL-X has 0.4 GB."""
BODY_JOINTS: Final = 22
"""Joints of the body, which all of these models have alike and first; hands and faces follow."""
BODY_PARENTS: Final = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
"""On which joint each of them hangs."""
_SPARSE: Final = ("J_regressor.data", "J_regressor_data")


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyModel:
    """The joints of a body model.

    Parameters
    ----------
    joints : array (22, 3)
        At rest, of the mean shape, metres.
    directions : array (22, 3, B)
        How they move with each of B shape coefficients.
    source : str
        What to call it in errors.
    """

    joints: Array
    directions: Array
    source: str

    def at_rest(self, betas: Array) -> Array:
        """Place the joints (22, 3) of a shape: as many of its coefficients as the model has.

        Parameters
        ----------
        betas : array (n,)
            Shape coefficients.
        """
        used = min(len(betas), self.directions.shape[-1])
        return np.asarray(self.joints + self.directions[..., :used] @ betas[:used])


def read_body_model(path: str | Path) -> BodyModel:
    """Read the joints of a body model.

    Parameters
    ----------
    path : path
        An NPZ without pickles.

    Raises
    ------
    InputError
        Where arrays are missing, pickled or of other shapes, or the joints hang on one another in another way.
    """
    if Path(path).suffix.lower() != ".npz":
        remedy = "save its arrays with numpy.savez: v_template, shapedirs, J_regressor, kintree_table"
        raise refusal(path, "", f"{Path(path).suffix or 'no suffix'}", ".npz; pickles are not read", remedy)
    with open_npz(path, limit=MAX_BYTES) as archive:
        _check_tree(archive)
        joints, directions = _joints(archive)
    return BodyModel(joints=joints[:BODY_JOINTS], directions=directions[:BODY_JOINTS], source=str(path))


def _joints(archive: Archive) -> tuple[Array, Array]:
    """Return the joints at rest (K, 3) and how they move with the shape (K, 3, B)."""
    if {"J_regressor", "v_template"} <= set(archive.names):
        template = _numbers(archive, "v_template", (None, 3))
        try:
            regressor = _numbers(archive, "J_regressor", (None, len(template)))
        except InputError as error:
            if "object" not in str(error):
                raise
            remedy = "save it as an array: J_regressor.toarray()"
            raise refusal(
                archive.path, "J_regressor", "a pickled sparse matrix", "numbers (K, V)", remedy
            ) from None
        joints = regressor @ template
        if "shapedirs" not in archive.names:
            return joints, np.zeros((*joints.shape, 0))
        directions = _numbers(archive, "shapedirs", (len(template), 3, None))
        return joints, np.einsum("kv,vib->kib", regressor, directions, optimize=True)
    if "J" not in archive.names:
        got = "no J_regressor with v_template, and no J"
        if any(name in archive.names for name in _SPARSE):
            got = "J_regressor in parts, as SciPy saves a sparse matrix"
        expected = "joints at rest: J (K, 3), or J_regressor (K, V) and v_template (V, 3)"
        raise refusal(archive.path, "J", got, expected, "give a body model's NPZ")
    joints = _numbers(archive, "J", (None, 3))
    name = next((one for one in ("J_shapedirs", "joint_shapedirs") if one in archive.names), "")
    return joints, _numbers(archive, name, (len(joints), 3, None)) if name else np.zeros((*joints.shape, 0))


def _check_tree(archive: Archive) -> None:
    """Refuse joints that hang on one another in another way than those of SMPL."""
    if "kintree_table" in archive.names:
        parents: NDArray[np.int64] = archive.array("kintree_table", "iu", (2, None))[0].astype(np.int64)
    elif "parents" in archive.names:
        parents = archive.array("parents", "iu", (None,)).astype(np.int64)
    else:
        raise archive.lacks("kintree_table")
    if len(parents) < BODY_JOINTS or tuple(parents[1:BODY_JOINTS]) != BODY_PARENTS[1:]:
        got = f"{len(parents)} joints that hang on {parents[1:6].tolist()} …"
        expected = f"{BODY_JOINTS} joints or more, the first on {list(BODY_PARENTS[1:6])} …, as of SMPL"
        raise refusal(archive.path, "kintree_table", got, expected, "give SMPL, SMPL+H or SMPL-X")


def _numbers(archive: Archive, name: str, shape: tuple[int | None, ...]) -> Array:
    values: Array = archive.array(name, "iuf", shape).astype(np.float64)
    if not (np.abs(values) < FARTHEST_COORDINATE).all():
        got = "a number that is not finite, or beyond all bodies"
        raise refusal(archive.path, name, got, f"numbers below {FARTHEST_COORDINATE:g}", "save it again")
    if name in ("J", "J_regressor") and len(values) < BODY_JOINTS:
        raise refusal(
            archive.path, name, f"{len(values)} joints", f"{BODY_JOINTS} or more", "give a whole body"
        )
    return values
