"""The answer of each frame that was recovered, or read from a result."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from posekit.answers import Answer, ListedBodies, ListedFrame, answers_of, written_answer
from posekit.formats.own import Result
from posekit.geometry import Array
from posekit.ranking import deviation_of_tolerance
from posekit.recovery.judged import rigid_of


def answered(
    frames: Sequence[ListedFrame], probability: Sequence[Array], deviation: ArrayLike
) -> list[Answer]:
    """Make the answer of each frame (`posekit.answers.answers_of`).

    Parameters
    ----------
    frames : sequence of F frames
        Of a recovery, or of a result.
    probability : sequence of F arrays (N,)
        Of the survivors of each frame.
    deviation : array (F,)
        Metres that the survivors of a frame are off which was not refined.
    """
    off = np.broadcast_to(np.asarray(deviation, dtype=np.float64), (len(frames),))
    return answers_of(
        [ListedBodies.of(frame, p, d) for frame, p, d in zip(frames, probability, off.tolist(), strict=True)]
    )


def result_answers(result: Result) -> list[Answer]:
    """Return the answer of each frame of a result, as `Recovery.answers` has it of a recovery.

    Raises
    ------
    InputError
        Where the result does not say how probable its survivors are.
    """
    off = deviation_of_tolerance(rigid_of(result.settings, len(result.frames)))
    return [written_answer(frame, d) for frame, d in zip(result.frames, off.tolist(), strict=True)]
