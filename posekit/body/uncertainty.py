"""How well a body's lengths are known: one common size, and each segment's own deviation beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.settings.recover import MAX_LENGTH_DEVIATION
from posekit.skeleton import SEGMENT_NAMES

NON_RIGID_SEGMENTS: Final = ("right_shoulder-pelvis", "left_shoulder-pelvis")
"""What a bending spine and moving clavicles change in one person."""

TRUNK_BENDS: Final = {"neck-pelvis": 0.017, "right_shoulder-pelvis": 0.027, "left_shoulder-pelvis": 0.027}
"""Relative deviations by which a bending spine and moving clavicles change one person's trunk.

What DeepMimic's motion, whose spine bends, has against each clip's medians (20 clips). In CMU's (16) it hardly does:
0.2 % from neck to pelvis, 0.9 % from shoulders to pelvis.
"""


@dataclass(frozen=True, kw_only=True)
class LengthUncertainty:
    r"""Standard deviations of the logarithms of a body's 17 lengths, which for small ones are relative deviations.

    With the body's one size s and each segment's own part :math:`t_i`, a length is
    :math:`l_i = e^{s + t_i} \bar l_i`, and the covariance of the logarithms
    :math:`\sigma_s^2\,1 1^T + \mathrm{diag}(\sigma_i^2)`.

    Parameters
    ----------
    common : float
        Of the one size that all lengths share.
    own : mapping of str to float
        Of each segment beside that, by `posekit.skeleton.SEGMENT_NAMES`; a segment that is not named has none.

    Raises
    ------
    InputError
        Where a deviation is negative or more than `MAX_LENGTH_DEVIATION`, or a segment is unknown.

    Examples
    --------
    >>> LengthUncertainty.uniform(0.05).total("neck-pelvis") > 0.07
    True
    """

    common: float = 0.0
    own: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        unknown = [name for name in self.own if name not in SEGMENT_NAMES]
        if unknown:
            raise InputError(
                f"length_deviation: {unknown[0]!r} is not a segment; expected some of {', '.join(SEGMENT_NAMES)}"
            )
        for name, value in {"the common size": self.common, **self.own}.items():
            if not (math.isfinite(value) and 0 <= value <= MAX_LENGTH_DEVIATION):
                raise InputError(
                    f"length_deviation: {name} is {value!r}; expected a fraction of the length, 0 to "
                    f"{MAX_LENGTH_DEVIATION:g}"
                )
        own = {name: float(self.own.get(name, 0.0)) for name in SEGMENT_NAMES}
        object.__setattr__(self, "own", MappingProxyType(own))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the numbers: a read-only mapping cannot be."""
        return _uncertainty, (self.common, dict(self.own))

    def __hash__(self) -> int:
        """Hash the numbers."""
        return hash((self.common, tuple(self.own.values())))

    @staticmethod
    def uniform(deviation: float) -> LengthUncertainty:
        """Say of a body that its size, and each length beside it, are off by the same relative deviation.

        The trunk bends beside that by `TRUNK_BENDS`, but by no more than thrice the deviation: exact lengths are those
        of a stiff body.
        """
        own = dict.fromkeys(SEGMENT_NAMES, deviation)
        for name, bend in TRUNK_BENDS.items():
            own[name] = min(math.hypot(deviation, min(bend, 3.0 * deviation)), MAX_LENGTH_DEVIATION)
        return LengthUncertainty(common=deviation, own=own)

    def widened(self, times: float) -> LengthUncertainty:
        """Return the same with deviations that are so many times as large, as far as they are taken for one."""
        own = {name: min(times * one, MAX_LENGTH_DEVIATION) for name, one in self.own.items()}
        return LengthUncertainty(common=min(times * self.common, MAX_LENGTH_DEVIATION), own=own)

    @property
    def exact(self) -> bool:
        """Whether all lengths are known exactly."""
        return not self.common and not any(self.own.values())

    @property
    def covariance(self) -> Array:
        """The covariance of the logarithms (17, 17), in the order of `posekit.skeleton.SEGMENT_NAMES`."""
        return np.asarray(self.common**2 + np.diag([self.own[name] ** 2 for name in SEGMENT_NAMES]))

    def total(self, segment: str) -> float:
        """Return the standard deviation of one length's logarithm."""
        return math.hypot(self.common, self.own[segment])


def _uncertainty(common: float, own: Mapping[str, float]) -> LengthUncertainty:
    return LengthUncertainty(common=common, own=own)


def _varying(deviation: float, non_rigid: float) -> dict[str, float]:
    """Give every segment one deviation, and those that one person's posture changes another."""
    return {name: non_rigid if name in NON_RIGID_SEGMENTS else deviation for name in SEGMENT_NAMES}


MEASURED_LENGTHS: Final = LengthUncertainty(own=_varying(0.01, 0.02))
"""Of a body whose lengths were measured, by a calibration or over a clip: 2 % from shoulders to pelvis, 1 % elsewhere.

Motion capture (CMU, 16 clips) has 1.0 % from shoulders to pelvis against each clip's medians, 2.1 % in the clip where
it is most, up to 0.4 % from neck to pelvis, and nothing elsewhere, since its bones are rigid: 1 % is left for what a
tape is off.
"""

STATED_LENGTHS: Final = LengthUncertainty(common=0.05, own=_varying(0.03, 0.04))
"""Of a person's lengths that are given, when nobody says how well they are known.

They come from a stature, another detector or another day: 5 % of the size is what adults of one sex differ by (stature,
3.9 %: Gordon et al. 2014, ANSUR II), and 3 % of each length what a tape and a joint centre differ by.
"""

UNKNOWN_ADULT: Final = LengthUncertainty(common=0.07, own=_varying(0.05, 0.05))
"""Of an adult of whom nothing is known, when the figure's own lengths are taken.

Statures of 4082 men are 1756 (68.6) mm, of 1986 women 1629 (64.2) mm (Gordon et al. 2014, "2012 Anthropometric Survey
of U.S. Army Personnel", NATICK/TR-15/007): both together deviate by 5.5 %, and soldiers less than people. What a limb
differs beside stature is 3.5 % (upper arm) to 5.7 % (thigh) in the same survey.
"""

KNOWN_STATURE: Final = LengthUncertainty(common=0.02, own=_varying(0.05, 0.05))
"""Of a person whose stature is known: trunk and limbs share it out differently, and shoes and hair are in it."""
