"""Answers of frames that say which postures stand for all, and nothing of where joints are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posekit.formats.own.frame_answer import FrameAnswer


def bare_answer(rows: Sequence[int]) -> FrameAnswer:
    """Return an answer of some postures, each as likely as the next: together 95 %."""
    return FrameAnswer(
        representatives=np.array(rows),
        probability=np.full(len(rows), 0.95 / len(rows)),
        near=np.full(11, np.nan),
        far=np.full(11, np.nan),
        region_mean=np.empty((0, 14, 3)),
        region_covariance=np.empty((0, 14, 3, 3)),
        region_probability=np.empty((0, 14)),
        region_level=np.full(14, np.nan),
    )
