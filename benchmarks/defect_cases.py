"""Clean clips with one defect each: `draw` puts a kind of `DEFECTS` into a span of a clip, or into all of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.broken_clips import Span
from benchmarks.clean_clips import CleanClip, standing
from benchmarks.defects import WHOLE, Defect
from posekit.validators.motion import MotionClip

MARGIN_FRAMES: Final = 6
"""Between a span and the ends of its clip: what is at an end has no neighbours to tell it by."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DefectCase:
    """A clip with one defect.

    Parameters
    ----------
    kind : str
        Of `DEFECTS`.
    size : float
        In the kind's unit.
    clip : MotionClip
        With the defect.
    span : tuple of int
        The first and the last frame that are wrong.
    place : str
        Where on the body; empty where all of it.
    source : str
        The name of the clean clip.
    """

    kind: str
    size: float
    clip: MotionClip
    span: Span
    place: str
    source: str


def draw(
    clips: Sequence[CleanClip], kind: Defect, size: float, rng: np.random.Generator, *, tries: int = 200
) -> DefectCase | None:
    """Put one defect into a span of one of the clips; None where none of them has a span that fits it."""
    for _ in range(tries):
        clean = clips[int(rng.integers(len(clips)))]
        span = _span(clean.clip, kind, rng)
        broken = None if span is None else kind.put(clean.clip, span, size, rng)
        if broken is not None:
            return DefectCase(
                kind=kind.name,
                size=size,
                clip=broken.clip,
                span=broken.span,
                place=broken.place,
                source=clean.name,
            )
    return None


def _span(clip: MotionClip, kind: Defect, rng: np.random.Generator) -> Span | None:
    if kind.frames == WHOLE:
        return 0, len(clip) - 1
    if clip.rate < kind.rate:
        return None
    room = len(clip) - 2 * MARGIN_FRAMES
    least, most = kind.frames
    if room < least:
        return None
    count = int(rng.integers(least, min(most, room) + 1))
    if count > kind.share * len(clip):
        return None
    first = MARGIN_FRAMES + int(rng.integers(room - count + 1))
    if kind.grounded and not standing(clip)[first : first + count].all():
        return None
    return first, first + count - 1
