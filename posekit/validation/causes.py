"""Which findings follow from others: exchanged labels break joint ranges, and what breaks those seems to tremble."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.report_clips import Span

CAUSING_CHECKS: Final = ("timing", "frozen", "repeated", "swap")
"""Checks that name what all others reject, too, there."""

FOLLOWING_CHECKS: Final = ("speed", "acceleration", "jerk", "jitter", "joint_velocity")
"""Checks that reject what a change from frame to frame breaks: where another one does so, they follow from it."""

NEAR_FRAMES: Final = 15
"""By which a finding may be off its cause: trembling is measured over so many."""


def rank_of(check: str) -> int:
    """Return 0 of what causes others, 2 of what follows from others, 1 of the rest."""
    return 0 if check in CAUSING_CHECKS else 2 if check in FOLLOWING_CHECKS else 1


def follows(spans: Sequence[Span]) -> NDArray[np.bool_]:
    """Say which spans of a clip follow from another of them, which rejects frames there or near.

    Parameters
    ----------
    spans : sequence of Span
        What rejects frames of one clip.
    """
    ranks = np.array([rank_of(span.check) for span in spans], dtype=np.intp)
    first, last = (
        np.array([getattr(span, end) for span in spans], dtype=np.intp) for end in ("first", "last")
    )
    invalid = np.array([span.verdict == "invalid" for span in spans], dtype=np.bool_)
    found = np.zeros(len(spans), dtype=np.bool_)
    for rank in (1, 2):
        causes = np.flatnonzero((ranks < rank) & invalid)
        causes = causes[np.argsort(first[causes])]
        if not len(causes):
            continue
        until = np.maximum.accumulate(last[causes])
        before = np.searchsorted(first[causes], last + NEAR_FRAMES, side="right")
        touched = (before > 0) & (until[before - 1] >= first - NEAR_FRAMES)
        found |= touched & (ranks == rank)
    return found
