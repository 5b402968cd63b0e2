"""What is chosen through a sequence: a survivor a frame, and what bridges frames that have none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.errors import InputError
from posekit.pipeline.evaluation.ranking import Ranking
from posekit.pipeline.following import follow_frames
from posekit.pipeline.recovery import FrameRecovery
from posekit.skeleton import JOINTS


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """One posture a frame.

    Parameters
    ----------
    survivor : int array (F,)
        The index of a survivor of each frame, -1 where none is chosen.
    joints : array (F, 14, 3), optional
        What stands for the frames of which none is: camera frame, metres; NaN where nothing does.
    """

    survivor: NDArray[np.intp]
    joints: Array | None = None


class Chooser(Protocol):
    """Follows one person through the frames of one camera that stands still."""

    def __call__(self, frames: Sequence[FrameRecovery], rankings: Sequence[Ranking]) -> Choice:
        """Choose a posture for each frame; the frames are in order, each with the ranking of its survivors."""
        ...


def by_path(frames: Sequence[FrameRecovery], rankings: Sequence[Ranking]) -> Choice:
    """Choose the cheapest path (`posekit.pipeline.follow`); probabilities count where the ranking states them."""
    if not any(map(len, frames)):
        return Choice(survivor=np.full(len(frames), -1, dtype=np.intp))
    stated = [one.probability for one in rankings]
    log_probability = None
    if all(each is not None for each in stated):
        with np.errstate(divide="ignore"):
            log_probability = [np.log(np.asarray(each, dtype=np.float64)) for each in stated]
    found = follow_frames(frames, log_probability=log_probability, k=1)
    return Choice(survivor=found.survivor[0], joints=found.joints[0])


def chosen_by(
    chooser: Chooser, frames: Sequence[FrameRecovery], rankings: Sequence[Ranking]
) -> tuple[NDArray[np.intp], Array]:
    """Return what a chooser chooses, checked: survivors (F,), and the joints (F, 14, 3) of frames without; else NaN.

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
    bridged = np.full((len(counts), len(JOINTS), 3), np.nan)
    if choice.joints is not None:
        if np.shape(choice.joints) != bridged.shape:
            raise InputError(
                f"the joints chosen through the sequence have shape {np.shape(choice.joints)}; expected {bridged.shape}"
            )
        bridged[chosen < 0] = np.asarray(choice.joints)[chosen < 0]
    return chosen.astype(np.intp), bridged
