"""Kinds of screens: what a check says to name its own, without loading the loops."""

from __future__ import annotations

from typing import Final

OF_DISTANCE: Final = 0
OF_PLACEMENT: Final = 1
OF_PELVIS: Final = 2
OF_NECK: Final = 3
OF_LIMB: Final = 4
OF_CAPSULES: Final = 5
OF_ANATOMICAL_LIMB: Final = 6
OF_PROJECTED_BALL: Final = 7
OF_PROJECTED_HINGE: Final = 8
OF_HIP_PLANE: Final = 9
OF_HEAD_PLANE: Final = 10
OF_SIDE: Final = 11
OF_NOISY: Final = 12
OF_TURNED_BALL: Final = 13
OF_TURNED_HINGE: Final = 14
"""Kinds of screens."""

CAPSULE_NUMBERS: Final = 14
"""Numbers that say where two capsules are."""
