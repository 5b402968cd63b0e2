"""How much the lengths of real bodies vary: relative standard deviations for `ObservedFrames.length_deviation`."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from posekit.skeleton import SEGMENT_NAMES

MEASURED_LENGTH_DEVIATIONS: Final[Mapping[str, float]] = MappingProxyType(
    {
        name: 0.02 if name in ("right_shoulder-pelvis", "left_shoulder-pelvis") else 0.01
        for name in SEGMENT_NAMES
    }
)
"""Of a body whose lengths were measured: 2 % from shoulders to pelvis, 1 % elsewhere.

Motion capture (CMU, 16 clips) has 1.0 % from shoulders to pelvis against each clip's medians, 2.1 % in the clip where
it is most, up to 0.4 % from neck to pelvis, and nothing elsewhere, since its bones are rigid: 1 % is left for what a
tape is off.
"""
