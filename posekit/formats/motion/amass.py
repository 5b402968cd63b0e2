"""AMASS and its like: the angles of a body model over time, of SMPL, SMPL+H or SMPL-X, as NPZ.

Keys: ``poses`` (T, 3 K), rotation vectors of the joints in the model's order (or ``root_orient`` (T, 3) and
``pose_body`` (T, 63)); ``trans`` (T, 3), metres; ``betas`` (B,); ``mocap_framerate``, ``mocap_frame_rate`` or ``fps``
(Mahmood et al. 2019, *AMASS: Archive of Motion Capture as Surface Shapes*; amass.is.tue.mpg.de). Positions need the
model's joints at rest: see `posekit.formats.motion.body_model`. z is up by custom.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.motion.array_names import RATE_NAMES, holds_body_angles
from posekit.formats.motion.body_model import BODY_JOINTS, BODY_PARENTS, BodyModel, read_body_model
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_format import MotionFormat
from posekit.formats.own.units import FARTHEST_COORDINATE
from posekit.geometry import Array
from posekit.geometry.rotations import rotation_from_vector
from posekit.safe_io import open_npz, refusal

MAX_BYTES: Final = 2_000_000_000
FRAME_RATES: Final = ("mocap_framerate", "mocap_frame_rate", *RATE_NAMES)
SMPL_NAMES: Final = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle"),
    *("right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head"),
    *("left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
"""The joints of the body in the order of SMPL, SMPL+H and SMPL-X."""
Arrays = Mapping[str, NDArray[Any]]
_KEYS: Final = ("poses", "root_orient", "pose_body", "trans", "betas", *FRAME_RATES)


def read_amass(path: str | Path, body_model: str | Path | None = None) -> Motion:
    """Read a body model's angles, and place its 22 joints of the body.

    Parameters
    ----------
    path : path
        The file to read.
    body_model : path
        The model's NPZ, which is the user's own.

    Raises
    ------
    InputError
        Where there is no body model, or arrays are missing, pickled, infinite or of other shapes.
    """
    if body_model is None:
        got = "angles of a body model, without its lengths"
        remedy = "give the model: --body-model SMPLH.npz (J_regressor, v_template, shapedirs, kintree_table)"
        raise refusal(path, "poses", got, "the body model's NPZ too", remedy)
    with open_npz(path, limit=MAX_BYTES) as archive:
        arrays: Arrays = {name: archive.array(name, "iuf", None) for name in _KEYS if name in archive.names}
    poses, trans, betas = _poses(path, arrays), _trans(path, arrays), _betas(path, arrays)
    if len(poses) != len(trans) or not len(poses):
        raise refusal(path, "trans", f"{len(trans)} frames", f"{len(poses)}, as of poses, one or more")
    model = read_body_model(body_model)
    rate, said = _rate(arrays), []
    used = min(len(betas), model.directions.shape[-1])
    if used < len(betas) and betas[used:].any():
        said.append(f"the body model has {used} of the {len(betas)} shape coefficients")
    if "betas" not in arrays:
        said.append("the file says no shape (betas): the person is the body model's mean")
    return Motion(
        names=SMPL_NAMES,
        points=placed_joints(model, poses, trans, betas),
        time=np.arange(len(poses)) / rate,
        rate=rate,
        up="+z",
        source=str(path),
        as_recorded=True,
        told=("unit",),
        said=tuple(said),
    )


def placed_joints(model: BodyModel, poses: Array, trans: Array, betas: Array) -> Array:
    """Place the joints of the body by forward kinematics (Loper et al. 2015, eq. 3 and 4).

    Parameters
    ----------
    model : BodyModel
        Whose joints.
    poses : array (T, 22, 3)
        Rotation vectors, the root's in the world, the others' in their parent's frame.
    trans : array (T, 3)
        Metres.
    betas : array (B,)
        Shape coefficients.

    Returns
    -------
    array (T, 22, 3)
        Metres, in the world.
    """
    rest = model.at_rest(betas)
    turned = rotation_from_vector(poses)
    places = np.empty((len(poses), BODY_JOINTS, 3))
    places[:, 0] = rest[0] + trans
    for joint in range(1, BODY_JOINTS):
        parent = BODY_PARENTS[joint]
        places[:, joint] = places[:, parent] + turned[:, parent] @ (rest[joint] - rest[parent])
        turned[:, joint] = turned[:, parent] @ turned[:, joint]
    return places


def _poses(path: str | Path, arrays: Arrays) -> Array:
    """Return the rotation vectors of the body's joints (T, 22, 3)."""
    if "poses" in arrays:
        poses = arrays["poses"]
        width = 3 * poses.shape[2] if poses.ndim == 3 and poses.shape[2] == 3 else 0
        poses = poses.reshape(len(poses), -1) if poses.ndim == 3 and width else poses
    elif {"root_orient", "pose_body"} <= set(arrays):
        parts = arrays["root_orient"], arrays["pose_body"]
        if any(part.ndim != 2 or len(part) != len(parts[0]) for part in parts):
            shapes = " and ".join(str(part.shape) for part in parts)
            raise refusal(path, "pose_body", f"shapes {shapes}", "(T, 3) and (T, 63)", "correct the file")
        poses = np.concatenate(parts, axis=1)
    else:
        raise refusal(path, "poses", "nothing", "rotation vectors (T, 3 K)", "correct the file")
    if poses.ndim != 2 or poses.shape[1] % 3 or poses.shape[1] < 3 * BODY_JOINTS:
        expected = f"numbers (T, 3 K), K of {BODY_JOINTS} or more"
        raise refusal(path, "poses", f"shape {poses.shape}", expected, "correct the file")
    return _finite(path, "poses", poses[:, : 3 * BODY_JOINTS]).reshape(len(poses), BODY_JOINTS, 3)


def _trans(path: str | Path, arrays: Arrays) -> Array:
    trans = arrays.get("trans", np.empty(0))
    if trans.ndim != 2 or trans.shape[1] != 3:
        raise refusal(path, "trans", f"shape {trans.shape}", "numbers (T, 3), metres", "correct the file")
    return _finite(path, "trans", trans)


def _betas(path: str | Path, arrays: Arrays) -> Array:
    """Return the shape (B,); of one a frame the median."""
    betas = arrays.get("betas", np.zeros(0))
    if betas.ndim not in (1, 2):
        raise refusal(path, "betas", f"shape {betas.shape}", "numbers (B,)", "correct the file")
    return _finite(path, "betas", betas if betas.ndim == 1 else np.median(betas, axis=0))


def _rate(arrays: Arrays) -> float:
    """Return the frames a second; NaN where the file says none that is above 0."""
    found = next((arrays[name] for name in FRAME_RATES if name in arrays), np.empty(0))
    rate = float(found.reshape(-1)[0]) if found.size == 1 else np.nan
    return rate if 0 < rate < np.inf else float("nan")


def _finite(path: str | Path, name: str, values: NDArray[Any]) -> Array:
    sane = np.abs(values) < FARTHEST_COORDINATE
    if not sane.all():
        place = tuple(int(k) for k in np.argwhere(~sane)[0])
        got = f"{values[place]:g}"
        where = ", ".join(map(str, place))
        raise refusal(
            path, f"{name}[{where}]", got, f"finite numbers below {FARTHEST_COORDINATE:g}", "correct it"
        )
    return values.astype(np.float64)


def _read(path: Path, unit: str | None = None) -> Motion:
    del unit  # a body model is in metres
    return read_amass(path)


AMASS_FORMAT: Final = MotionFormat(
    name="amass",
    title="AMASS: angles of SMPL, SMPL+H or SMPL-X over time (poses, betas, trans); needs --body-model",
    suffixes=(".npz",),
    looks_like=lambda given: holds_body_angles(given.arrays),
    read=_read,
)
