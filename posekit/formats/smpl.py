"""Motion of the SMPL family, such as AMASS: angles of a body model over time (NPZ, pickle, PyTorch).

Keys: ``poses`` (T, 3 K), rotation vectors of the joints in the model's order, or ``root_orient`` (T, 3) and
``pose_body`` (T, 63), or ``global_orient`` and ``body_pose``; ``trans`` or ``transl`` (T, 3), metres; ``betas`` (B,); a
frame rate (Mahmood et al. 2019, *AMASS: Archive of Motion Capture as Surface Shapes*). By convention z is up.

The rest positions of joints are from the file or else from the mean shape of the neutral SMPL model. Shapes (``betas``)
are ignored, because they need the model's files, which may not be redistributed. A shape changes lengths by a few per
cent, but no angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posekit.errors import refusal
from posekit.formats.body_checks import points_motion
from posekit.formats.layout import load_layout
from posekit.formats.options import Options
from posekit.formats.robot_tables import time_and_rate
from posekit.geometry import FARTHEST_COORDINATE, Array, rotation_from_vector

if TYPE_CHECKING:
    from posekit.motion import Motion

#: Number of body joints, which are the first joints of SMPL, SMPL+H and SMPL-X.
N_JOINTS: Final = 22
#: Names of the arrays of angles and of the root's position; WHAM's arrays without ``world`` are in the camera frame.
_ANGLES: Final = (
    "pose_world poses pose root_orient+pose_body global_orient+body_pose fullpose smpl_poses".split()
)
_PLACES: Final = ("trans_world", "trans", "transl", "translation", "Th", "smpl_trans")


def looks_like(document: Any) -> bool:
    """Return whether a document contains the angles of a body model."""
    return bool(_angles(document)[1])


def _angles(document: Any) -> tuple[Mapping[str, Any], tuple[str, ...]]:
    """Return the arrays of a body model, at the top level or in an inner dict, and the keys of its joint angles."""
    inner = document.values() if isinstance(document, Mapping) else ()
    for arrays in (document, *inner):
        if isinstance(arrays, Mapping) and any(name in arrays for name in _PLACES):
            for keys in (names.split("+") for names in _ANGLES):
                if all(isinstance(arrays.get(k), np.ndarray) and arrays[k].ndim in (2, 3) for k in keys):
                    return arrays, tuple(keys)
    return {}, ()


def read(document: Mapping[str, Any], path: str, options: Options) -> Motion:
    """Compute the 22 body joints from the model's angles (Loper et al. 2015, *SMPL*, eq. 3 and 4).

    Raises
    ------
    InputError
        If arrays are missing, are not finite, or have wrong shapes.
    """
    outer, (document, keys) = document, _angles(document)
    parts = [np.asarray(document[key], dtype=np.float64).reshape(len(document[key]), -1) for key in keys]
    if len({len(part) for part in parts}) > 1 or sum(part.shape[1] for part in parts) < 3 * N_JOINTS:
        got = f"{' and '.join(keys)} of shapes {', '.join(str(part.shape) for part in parts)}"
        expected = f"{3 * N_JOINTS} numbers per frame or more: rotation vectors of {N_JOINTS} joints"
        raise refusal(path, keys[0], got, expected, "correct the file")
    poses = np.concatenate(parts, axis=1)
    place = np.asarray(document[next(name for name in _PLACES if name in document)], dtype=np.float64)
    place = place / document.get("smpl_scaling", 1.0)  # AIST++: units of the position per metre
    if place.shape != (len(poses), 3) or not len(poses):
        raise refusal(path, "trans", f"shape {place.shape}", f"({len(poses)}, 3)", "correct the file")
    used = poses[:, : 3 * N_JOINTS].reshape(len(poses), N_JOINTS, 3)
    if not (np.abs(used) < FARTHEST_COORDINATE).all() or not (np.abs(place) < FARTHEST_COORDINATE).all():
        raise refusal(path, keys[0], "a number that is not finite", "finite numbers", "correct the file")
    rest = _rest(document, options)
    return points_motion(
        placed(rest, used, place),
        (),
        path,
        options,
        layout=load_layout("smpl_22"),
        rate=time_and_rate({**outer, **document})[1],
        unit="m",
        up_by_custom="+z",
        in_world=True,
    )


def _rest(document: Mapping[str, Any], options: Options) -> Array:
    """Return the rest positions of joints (22, 3), metres, from the file or else of the mean shape."""
    own = np.asarray(document.get("J", document.get("joints_rest", ())))
    if own.ndim == 2 and own.shape[0] >= N_JOINTS and own.shape[1] == 3:
        options.note("rest positions of joints are those of the file")
        return own[:N_JOINTS].astype(np.float64)
    layout = load_layout("smpl_22").fields
    rest = np.array(layout["rest"])
    for k in range(1, N_JOINTS):
        rest[k] += rest[layout["parents"][k]]
    betas = np.ravel(document.get("betas", ()))
    shape = "; the file's shape (betas) needs the model and is ignored" if np.any(betas) else ""
    options.note(f"limbs have the lengths of SMPL's mean shape{shape}")
    return rest


def placed(rest: Array, poses: Array, place: Array) -> Array:
    """Compute joint positions (T, 22, 3) by forward kinematics.

    Parameters
    ----------
    rest : array (22, 3)
        Rest positions of joints, metres.
    poses : array (T, 22, 3)
        Rotation vectors: of the root in the world, of other joints in the parent's frame.
    place : array (T, 3)
        Translation of the root, metres.
    """
    turned = rotation_from_vector(poses)
    joints, parents = np.empty((len(poses), N_JOINTS, 3)), load_layout("smpl_22").fields["parents"]
    joints[:, 0] = rest[0] + place
    for k in range(1, N_JOINTS):
        parent = parents[k]
        joints[:, k] = joints[:, parent] + turned[:, parent] @ (rest[k] - rest[parent])
        turned[:, k] = turned[:, parent] @ turned[:, k]
    return joints
