"""Survivors of some frames, the likeliest first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.formats.own import CameraModel, OpenCVModel, Result
from posekit.geometry import Array
from posekit.ranking import Ranking, RankingEvidence, Up, deviation_of_tolerance, rank
from posekit.recovery.judged import rigid_of


class Survivors(Protocol):
    """The survivors of one frame: of a recovery, or of a result."""

    @property
    def joints(self) -> Array:
        """Camera frame (N, 14, 3), metres."""
        ...

    @property
    def length_residual(self) -> Array:
        """How much too short each one's worst segment was (N,), metres."""
        ...

    @property
    def chi2(self) -> Array | None:
        """How badly each one fits what was seen (N,), where they were refined."""
        ...


def up_of(camera: CameraModel) -> Up:
    """Return which way is up in a camera's frame: as its calibration says, else as if it were held level."""
    if isinstance(camera, OpenCVModel) and camera.R is not None and camera.up:
        axis = np.eye(3)["xyz".index(camera.up[1])] * (-1.0 if camera.up[0] == "-" else 1.0)
        return Up.of_camera(camera.R, axis, says=f"{camera.up}, as the calibration says")
    return Up.level()


def ranked(
    frames: Sequence[Survivors],
    lengths: Mapping[str, float],
    deviation: ArrayLike,
    up: Up | None = None,
) -> Ranking:
    """Give every survivor of some frames a probability (`posekit.ranking.rank`).

    Parameters
    ----------
    frames : sequence of F
        Of one person.
    lengths : mapping
        The person's, by segment name, metres.
    deviation : float or array (F,)
        How far off the survivors of each frame are, metres.
    up : Up, optional
        Which way is up in the camera's frame (`up_of`); that of a camera held level if not given.
    """
    up = up or Up.level()
    counts = [len(frame.joints) for frame in frames]
    frame = np.repeat(np.arange(len(frames)), counts)
    off = np.broadcast_to(np.asarray(deviation, dtype=np.float64), (len(frames),))
    refined = np.array([each.chi2 is not None for each in frames], dtype=np.bool_)[frame]
    joints = np.concatenate([each.joints for each in frames])
    residual = np.concatenate([each.length_residual for each in frames])
    chi2 = np.concatenate(
        [
            np.full(n, np.nan) if each.chi2 is None else each.chi2
            for n, each in zip(counts, frames, strict=True)
        ]
    )
    parts = [
        (
            rows,
            rank_postures(
                joints[rows], lengths, frame[rows], residual[rows], chi2[rows] if known else None, off, up
            ),
        )
        for known in sorted(set(refined.tolist()) or {False})
        if len(rows := np.flatnonzero(refined == known)) or not len(joints)
    ]
    probability = np.empty(len(joints))
    terms: dict[str, Array] = {name: np.zeros(len(joints)) for _, part in parts for name in part.terms}
    for rows, part in parts:
        probability[rows] = part.probability
        for name, values in part.terms.items():
            terms[name][rows] = values
    return Ranking(probability=probability, frame=frame, terms=terms, up=parts[0][1].up)


def rank_postures(
    joints: Array,
    lengths: Mapping[str, float],
    frame: NDArray[np.intp],
    length_residual: Array | None,
    chi2: Array | None,
    deviation: Array,
    up: Up,
) -> Ranking:
    """Rank postures (N, 14, 3) of frames (N,), with what `RankingEvidence.of` takes."""
    return rank(
        RankingEvidence.of(
            joints,
            lengths,
            frame=frame,
            length_residual=length_residual,
            chi2=chi2,
            deviation=deviation,
            up=up,
        )
    )


def probabilities(result: Result, lengths: Mapping[str, float]) -> list[Array]:
    """Return the probability of every survivor of a result, by frame: as it says, or as they are ranked now."""
    told = [frame.probability for frame in result.frames if frame.probability is not None]
    if len(told) == len(result.frames):
        return told
    rigid = rigid_of(result.settings, len(result.frames))
    ranking = ranked(result.frames, lengths, deviation_of_tolerance(rigid))
    return np.split(ranking.probability, np.cumsum([len(frame.joints) for frame in result.frames])[:-1])
