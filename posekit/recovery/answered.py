"""The answer of each frame that was recovered, or read from a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from posekit.answers import Answer, ListedBodies, answers_of
from posekit.errors import InputError
from posekit.formats.own import Inferred, Result
from posekit.geometry import Array
from posekit.ranking import deviation_of_tolerance
from posekit.recovery.judged import rigid_of
from posekit.skeleton import JOINT


class UncertainSurvivors(Protocol):
    """Survivors that were refined."""

    @property
    def covariance(self) -> Array:
        """Of every joint (N, 14, 3, 3), square metres; NaN where it is not known."""
        ...


class ListedFrame(Protocol):
    """What a frame lists: of a recovery, or of a result."""

    @property
    def joints(self) -> Array:
        """Camera frame (N, 14, 3), metres."""
        ...

    @property
    def refined(self) -> UncertainSurvivors | None:
        """How sure each survivor is, where the frame was refined."""
        ...

    @property
    def inferred(self) -> Sequence[Mapping[str, Inferred]] | None:
        """Joints that were not seen, by survivor."""
        ...


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
        [
            ListedBodies(joints=frame.joints, probability=p, uncertainty=_uncertainty(frame, d))
            for frame, p, d in zip(frames, probability, off.tolist(), strict=True)
        ]
    )


def result_answers(result: Result) -> list[Answer]:
    """Make the answer of each frame of a result, as `Recovery.answers` does of a recovery.

    Raises
    ------
    InputError
        Where the result does not say how probable its survivors are.
    """
    told = [frame.probability for frame in result.frames if frame.probability is not None]
    if len(told) < len(result.frames):
        raise InputError(
            "result: survivors without probabilities; expected them of all frames; recover the view again"
        )
    return answered(
        result.frames, told, deviation_of_tolerance(rigid_of(result.settings, len(result.frames)))
    )


def _uncertainty(frame: ListedFrame, deviation: float) -> Array | float:
    """Return the covariances of a frame's survivors, NaN of joints that were not seen; one deviation if all were."""
    if frame.refined is not None:
        return frame.refined.covariance
    if frame.inferred is None:
        return deviation
    covariance = np.tile(np.eye(3) * deviation**2, (len(frame.joints), 14, 1, 1))
    for row, joints in enumerate(frame.inferred):
        covariance[row, [JOINT[name] for name in joints]] = np.nan
    return covariance
