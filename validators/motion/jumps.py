"""How far joints, and the body, are from where the frames before and after them say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.motion.displaced_body import displaced_by, middle
from posekit.validators.motion.timeline import centred, filtered, norm

LEAST_JUMP: Final = 0.06
"""Metres by which a frame must jump to be left out of what is judged as motion."""

DISPLACED_SHARE: Final = 0.5
"""Of a displacement for good near it, that a jump of one frame is more than."""

SIDE_FRAMES: Final = 3
"""Frames on either side that a jump is told by."""

JOINT_MISFITS, END_MISFITS = 3.0, 5.0
"""Times by which the neighbours' own misfit is taken off a jump: of a joint or body that comes back, and at an end of
the clip. Fast motion at few frames a second fits no smooth curve, and is no jump."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Jumps:
    """Metres of (T,) frames, above what the neighbours' own misfit explains; NaN where they are not known.

    Parameters
    ----------
    joint : array (T, 14)
        Of single joints, beside the body's.
    body : array (T,)
        Of the body: the median joint.
    """

    joint: Array
    body: Array


class _Filter(NamedTuple):
    """Weights of a jump (K,), and of what neighbours are off from a smooth curve (2, K), a unit of length each."""

    jump: Array
    misfit: Array


def _filter(times: Array, degree: int, jumped: NDArray[np.bool_]) -> _Filter:
    """Fit a polynomial and a jump of some of the frames by least squares: two degrees of freedom are left."""
    design = np.column_stack([np.vander(times, degree + 1, increasing=True), jumped])
    return _Filter(
        jump=np.linalg.pinv(design)[-1],
        misfit=np.linalg.svd(design)[0][:, design.shape[1] :].T / np.sqrt(2.0),
    )


_ONE_FRAME: Final = _filter(np.arange(-3.0, 4.0), 3, np.arange(-3, 4) == 0)
_NEAR_END: Final = {at: _filter(np.arange(7.0) - at, 3, np.arange(7) == at) for at in (1, 2)}
_THIRD_DIFFERENCE: Final = np.array([1.0, -3.0, 3.0, -1.0])


def jumps_of(joints: Array, step: float) -> Jumps:
    """Measure the jumps of joints in slots of even time (S, 14, 3), so many seconds each (NaN where not known).

    Notes
    -----
    A jump of one frame is how far it is from the cubic through three frames on either side; at an end it is the third
    difference. All less some times the misfit of the neighbours themselves. A body that stays moved is for
    `posekit.validators.motion.displaced_body`.
    """
    count = len(joints)
    offset, misfit = _measured(joints, _ONE_FRAME, count)
    body = middle(offset)
    alone = norm(body) - JOINT_MISFITS * middle(misfit)
    moved = alone > 0
    displaced = displaced_by(joints, step)
    if (alone > LEAST_JUMP).any():
        # Beside a body that goes aside, what is off from a curve is off from where it went.
        beside = sliding_window_view(np.pad(np.nan_to_num(displaced), SIDE_FRAMES), 2 * SIDE_FRAMES + 1)
        alone[alone < DISPLACED_SHARE * beside.max(axis=1)] = np.nan
        if (alone > LEAST_JUMP).any():
            displaced = displaced_by(np.where((alone > LEAST_JUMP)[:, None, None], np.nan, joints), step)
    joint = norm(offset) - JOINT_MISFITS * misfit
    beside = norm(offset - body[:, None]) - JOINT_MISFITS * misfit
    joint = np.where(moved[:, None], np.minimum(beside, joint), joint)
    if count > 2 * SIDE_FRAMES:
        third = norm(filtered(joints, _THIRD_DIFFERENCE))
        joint[0] = third[0] - END_MISFITS * third[1:3].max(axis=0)
        joint[-1] = third[-1] - END_MISFITS * third[-3:-1].max(axis=0)
        for at, by in _NEAR_END.items():
            for end, frame, window in ((0, at, joints[:7]), (-1, -1 - at, joints[:-8:-1])):
                jump = _near_end(window, by)
                # A last frame that jumps is off from the curve of those next to it, not they.
                joint[frame] = np.where((joint[end] > 0) & (joint[end] > jump), np.nan, jump)
    return Jumps(joint=joint, body=np.fmax(alone, displaced))


def _near_end(window: Array, by: _Filter) -> Array:
    """Return the jumps (14,) of one of seven frames (7, 14, 3): the farther it is from their middle, the less sure."""
    misfit = np.sqrt((norm(np.tensordot(by.misfit, window, axes=1)) ** 2).sum(axis=0))
    unsure = np.sqrt((by.jump**2).sum() / (_ONE_FRAME.jump**2).sum())
    return np.asarray(norm(np.tensordot(by.jump, window, axes=1)) - JOINT_MISFITS * unsure * misfit)


def _measured(joints: Array, by: _Filter, count: int) -> tuple[Array, Array]:
    """Return jumps (S, 14, 3) and misfits (S, 14), said of the fourth frame of the filter."""
    parts = [filtered(joints, weights) for weights in by.misfit]
    misfit = np.sqrt(sum(np.einsum("tji,tji->tj", part, part) for part in parts))
    return centred(filtered(joints, by.jump), count, SIDE_FRAMES), centred(misfit, count, SIDE_FRAMES)
