"""What is chosen through a sequence: a survivor a frame, and what bridges frames that have none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.evaluate.survivor_order import SurvivorOrder
from posekit.geometry import Array
from posekit.recovery.recovery import FrameRecovery
from posekit.recovery.sequences import follow_frames
from posekit.skeleton import JOINTS


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """One posture a frame.

    Parameters
    ----------
    survivor : int array (F,)
        The index of a survivor of each frame, -1 where none is chosen.
    joints : array (F, 14, 3), optional
        Where the person is then, camera frame, metres: smoothed, or bridged where none is chosen. NaN for the chosen
        survivor's own.
    """

    survivor: NDArray[np.intp]
    joints: Array | None = None


class Chooser(Protocol):
    """Follows one person through the frames of one camera that stands still."""

    def __call__(self, frames: Sequence[FrameRecovery], rankings: Sequence[SurvivorOrder]) -> Choice:
        """Choose a posture for each frame; the frames are in order, each with the ranking of its survivors."""
        ...


def by_path(frames: Sequence[FrameRecovery], rankings: Sequence[SurvivorOrder]) -> Choice:
    """Choose the cheapest path (`posekit.recovery.sequences.follow`), smoothed where the camera is known.

    Probabilities count where the ranking states them.
    """
    if not any(map(len, frames)):
        return Choice(survivor=np.full(len(frames), -1, dtype=np.intp))
    stated = [one.probability for one in rankings]
    log_probability = None
    if all(each is not None for each in stated):
        with np.errstate(divide="ignore"):
            log_probability = [np.log(np.asarray(each, dtype=np.float64)) for each in stated]
    found = follow_frames(frames, log_probability=log_probability, k=1)
    joints = found.joints[0] if found.scale is not None else found.smoothed()
    return Choice(survivor=found.survivor[0], joints=joints)


def chosen_by(
    chooser: Chooser, frames: Sequence[FrameRecovery], rankings: Sequence[SurvivorOrder]
) -> tuple[NDArray[np.intp], Array]:
    """Return what a chooser chooses, checked: survivors (F,), and joints (F, 14, 3) of its own, NaN without.

    Raises
    ------
    InputError
        Where it is not one of each frame's survivors, or -1, or its joints have another shape.
    """
    choice = chooser(frames, rankings)
    if not isinstance(choice, Choice):
        raise InputError(f"the choice through the sequence is a {type(choice).__name__}; expected a Choice")
    chosen = np.asarray(choice.survivor)
    counts = np.array([len(frame) for frame in frames])
    if chosen.shape != counts.shape or chosen.dtype.kind not in "iu":
        raise InputError(
            f"the choice through the sequence is {chosen.dtype} of shape {chosen.shape}; expected one whole number a "
            f"frame, ({len(counts)},)"
        )
    if ((chosen < -1) | (chosen >= counts)).any():
        k = int(np.argmax((chosen < -1) | (chosen >= counts)))
        raise InputError(
            f"frame {k} of the sequence: survivor {chosen[k]} was chosen; expected -1 to {counts[k] - 1}"
        )
    shape = (len(counts), len(JOINTS), 3)
    joints = np.full(shape, np.nan) if choice.joints is None else np.asarray(choice.joints, dtype=np.float64)
    if joints.shape != shape:
        raise InputError(
            f"the joints chosen through the sequence have shape {joints.shape}; expected {shape}"
        )
    return chosen.astype(np.intp), joints
