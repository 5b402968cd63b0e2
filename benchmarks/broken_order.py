"""What defects make of the frames of a clip: they stop, repeat, are missing, or are in another order.

Functions as those of `benchmarks.broken_clips`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.broken_clips import Broken, Span
from posekit.validators.motion import MotionClip


def _rearranged(clip: MotionClip, order: NDArray[np.intp], *, with_time: bool = False) -> MotionClip:
    time = clip.time[order] if with_time else np.arange(len(order)) * clip.step + clip.time[0]
    return replace(clip, joints=clip.joints[order], head=clip.head[order], feet=clip.feet[order], time=time)


def frozen(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Hold the frame before a span of so many frames, and go on where the motion is by then."""
    del rng
    last = span[0] + round(size) - 1
    order = np.arange(len(clip))
    order[span[0] : last + 1] = span[0] - 1
    return Broken(clip=_rearranged(clip, order), span=(span[0], last))


def repeated(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Say a frame so many times again, and go on from it."""
    del rng
    order = np.insert(np.arange(len(clip)), span[0], [span[0] - 1] * round(size))
    return Broken(clip=_rearranged(clip, order), span=(span[0], span[0] + round(size) - 1))


def missing(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Leave out so many frames; the others keep their times."""
    del rng
    order = np.delete(np.arange(len(clip)), slice(span[0], span[0] + round(size)))
    return Broken(clip=_rearranged(clip, order, with_time=True), span=(span[0], span[0]))


def out_of_order(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken:
    """Put so many frames in another order; they keep their times."""
    last = span[0] + round(size) - 1
    order = _shuffled(len(clip), (span[0], last), rng)
    return Broken(clip=_rearranged(clip, order, with_time=True), span=(span[0], last))


def shuffled(clip: MotionClip, span: Span, size: float, rng: np.random.Generator) -> Broken | None:
    """Put the frames of a span in another order, under even times; in motion of more metres a frame than its size."""
    steps = np.linalg.norm(np.diff(clip.joints[span[0] : span[1] + 1], axis=0), axis=-1).max(axis=1)
    if np.median(steps) < size:
        return None
    return Broken(clip=_rearranged(clip, _shuffled(len(clip), span, rng)), span=span)


def _shuffled(count: int, span: Span, rng: np.random.Generator) -> NDArray[np.intp]:
    """Permute a span so that its first and its last frame are others."""
    order, rows = np.arange(count), np.arange(span[0], span[1] + 1)
    drawn = rng.permutation(rows)
    while drawn[0] == rows[0] or drawn[-1] == rows[-1]:
        drawn = rng.permutation(rows)
    order[rows] = drawn
    return order
