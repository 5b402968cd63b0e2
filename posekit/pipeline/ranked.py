"""Survivors of some frames, the likeliest first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from posekit.cameras import Array
from posekit.pipeline.tolerance import EXACT, MEASURED, PHOTOGRAPH
from posekit.ranking import Ranking, Up, deviation_of_tolerance, rank


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


def ranked(frames: Sequence[Survivors], lengths: Mapping[str, float], rigid: ArrayLike) -> Ranking:
    """Give every survivor of some frames a probability (`posekit.ranking.rank`), of a camera held level.

    Parameters
    ----------
    frames : sequence of F
        Of one person.
    lengths : mapping
        The person's, by segment name, metres.
    rigid : float or array (F,)
        The tolerance of rigid distances that each frame was judged with, metres.
    """
    joints = [frame.joints for frame in frames]
    return rank(
        np.concatenate(joints),
        lengths,
        frame=np.repeat(np.arange(len(joints)), [len(each) for each in joints]),
        length_residual=np.concatenate([frame.length_residual for frame in frames]),
        deviation=deviation_of_tolerance(np.broadcast_to(rigid, (len(joints),))),
        up=Up.level(),
    )


def rigid_of(settings: Mapping[str, Any], count: int) -> Array:
    """Return the tolerance of rigid distances that a result's frames were judged with (F,), metres."""
    judged = settings.get("judged")
    kinds = judged if isinstance(judged, list) and len(judged) == count else [None] * count
    known = {"exact": EXACT.rigid, "measured": MEASURED.rigid, "photograph": PHOTOGRAPH.rigid}
    for kind, field in (("noisy", "noisy"), ("given", "tolerance")):
        said = settings.get(field)
        if isinstance(said, Mapping) and isinstance(said.get("rigid"), int | float):
            known[kind] = float(said["rigid"])
    return np.array([known.get(str(kind), EXACT.rigid) for kind in kinds])
