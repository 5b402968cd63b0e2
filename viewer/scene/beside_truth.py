"""The truth beside the likeliest posture: two figures a step apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from posekit.body import with_head
from posekit.geometry import Array
from posekit.viewer.scene.drawn_subject import Shown

BESIDE_METRES: Final = 1.1
"""From a figure to its truth, to the right as the camera sees it; the same in all frames of a film."""


def beside_truth(shown: Shown, joints: Array) -> Shown:
    """Return the first posture of a frame with its truth on its right.

    Parameters
    ----------
    shown : Shown
        One posture or more.
    joints : array (14, 3)
        The true joints, camera frame, metres; of an uncalibrated view wherever they are: its depth is relative.
    """
    if not len(shown) or not np.isfinite(joints).any():
        return replace(shown, caption=f"{shown.caption}\ntruth: not known".strip())
    first = shown.chosen([0])
    truth = with_head(joints[None])
    if shown.scales is not None:
        known = np.isfinite(truth[0]).all(axis=1) & np.isfinite(first.points[0]).all(axis=1)
        truth = truth + (first.points[0, known] - truth[0, known]).mean(axis=0)
    return replace(
        first,
        points=np.concatenate([first.points, truth + np.array([BESIDE_METRES, 0.0, 0.0])]),
        q=None,
        groups=None,
        scales=None if first.scales is None else np.repeat(first.scales, 2),
        inferred=[*first.inferred, {}] if first.inferred else (),
        probability=None,
        caption=f"left: {shown.caption or 'recovered'}\nright: truth",
    )
