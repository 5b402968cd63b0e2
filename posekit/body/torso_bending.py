r"""What a bending spine changes of distances inside the torso.

A spine of length h that bends evenly by an angle :math:`\varphi` has a chord of
:math:`c = h \sin(\varphi/2) / (\varphi/2)`, which leans by half the angle against both ends. Bent to the side, a
shoulder at w beside the neck is then at

.. math:: d = \sqrt{c^2 + w^2 \pm 2 c w \sin(\varphi/2)}

from the pelvis, where it is :math:`\sqrt{h^2 + w^2}` upright. People bend to the side by 38.2 degrees (mean of 20 to 29
years: Fitzgerald et al. 1983, Phys Ther 63:1776), and forward by 74.7 (137 adults: Patel & Parmar 2022, Int J Health
Sci 6(S4):1564): for a torso of 50 cm a shoulder comes 6.7 cm nearer to the pelvis, and the neck 3.4 cm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

SIDE_BENDING_DEGREES: Final = 38.2
"""Degrees: the mean of `pelvis.bending` in the anatomical ranges."""


def bending_gives(lengths: Mapping[str, float]) -> float:
    """Return by how much bending to the side brings a shoulder nearer to the pelvis, metres.

    Parameters
    ----------
    lengths : mapping
        Of a body that stands upright, metres, by segment name.
    """
    half = math.radians(SIDE_BENDING_DEGREES) / 2
    h, w = lengths["neck-pelvis"], lengths["right_shoulder-left_shoulder"] / 2
    c = h * math.sin(half) / half
    return math.hypot(h, w) - math.sqrt(c * c + w * w - 2 * c * w * math.sin(half))
