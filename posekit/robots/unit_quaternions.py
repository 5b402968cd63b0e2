"""Configurations of a robot from outside: finite, as wide as q, with rotations of unit length."""

from __future__ import annotations

import warnings
from typing import Final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from posekit.geometry import Array
from posekit.safe_io import refusal

SILENT_ERROR: Final = 1e-6
"""How far from 1 the length of a quaternion may be without a word."""
MAX_ROUNDING_ERROR: Final = 1e-2
"""How far it may be for a file that was written with few digits: then it is normalised, with a warning."""
_ROTATIONS: Final = {
    "JointModelFreeFlyer": (3, 7),
    "JointModelSpherical": (0, 4),
    "JointModelPlanar": (2, 4),
    "JointModelRUBX": (0, 2),
    "JointModelRUBY": (0, 2),
    "JointModelRUBZ": (0, 2),
    "JointModelRevoluteUnboundedUnaligned": (0, 2),
}
"""Where in a joint's entries of q its quaternion, or cosine and sine, stands."""


class QuaternionWarning(UserWarning):
    """Quaternions of a file were not of unit length, and were normalised."""


def check_configurations(model: pin.Model, q: ArrayLike, source: str = "q") -> Array:
    """Check configurations before Pinocchio makes non-rotations of them without a word.

    Parameters
    ----------
    model : pinocchio.Model
        The robot's.
    q : array (N, nq)
        Configurations in Pinocchio's order.
    source : str
        What to call them in errors.

    Returns
    -------
    array (N, nq)
        The same, as float64, with quaternions, and the cosine and sine of continuous and planar joints, of unit
        length.

    Raises
    ------
    InputError
        Where the shape is another, a number is not finite, or a quaternion's length is more than 1e-2 from 1.

    Warns
    -----
    QuaternionWarning
        Where a length is more than 1e-6 from 1: a file was written with few digits.
    """
    try:
        q = np.array(q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise refusal(source, "", "no array of numbers", f"shape (N, {model.nq})", "correct it") from error
    if q.ndim != 2 or q.shape[1] != model.nq:
        remedy = "give one row a configuration, in the order of the robot's configuration_names"
        raise refusal(source, "", f"shape {q.shape}", f"shape (N, {model.nq})", remedy)
    if not np.isfinite(q).all():
        row, column = np.argwhere(~np.isfinite(q))[0]
        got = f"{q[row, column]:g}"
        raise refusal(source, f"[{row}, {column}]", got, "finite numbers", "leave out what is not known")
    worst = 0.0
    for joint in range(1, model.njoints):
        start, end = _ROTATIONS.get(model.joints[joint].shortname(), (0, 0))
        if end:
            index = model.idx_qs[joint]
            worst = max(worst, _normalise(q[:, index + start : index + end], source, model.names[joint]))
    if worst > SILENT_ERROR:
        warnings.warn(
            f"{source}: quaternions were up to {worst:.1g} from unit length; they were normalised",
            QuaternionWarning,
            stacklevel=2,
        )
    return q


def _normalise(rotations: Array, source: str, joint: str) -> float:
    """Normalise rows (N, k) in place where they need it, and return how far the farthest was from unit length."""
    norm = np.linalg.norm(rotations, axis=1)
    apart = np.abs(norm - 1.0)
    worst = float(apart.max(initial=0.0))
    if not worst <= MAX_ROUNDING_ERROR:
        row = int(np.argmax(apart))
        what = "the quaternion" if rotations.shape[1] == 4 else "cosine and sine"
        got = f"{what} of {joint!r} of length {norm[row]:g} in row {row}"
        raise refusal(source, "", got, "length 1", "check the order of q, and normalise it")
    rounded = apart > SILENT_ERROR
    rotations[rounded] /= norm[rounded, None]
    return worst
