"""Uncertainty of a body's segment lengths: one scale error of all lengths, and one independent error per segment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from posekit.errors import refusal, shown
from posekit.geometry import Array, Record
from posekit.settings import MAX_LENGTH_DEVIATION
from posekit.skeleton import SEGMENT_NAMES

#: Segments whose length varies within one person, because the spine bends and the clavicles move.
NON_RIGID_SEGMENTS: Final = ("right_shoulder-pelvis", "left_shoulder-pelvis")

#: Relative standard deviations of trunk lengths within one person, because the spine bends and the clavicles move.
#:
#: Measured against each clip's medians on 20 DeepMimic clips, whose skeleton has a bending spine. In 16 CMU clips the
#: deviations are smaller: 0.2 % from neck to pelvis, 0.9 % from shoulders to pelvis.
TRUNK_BENDS: Final = {"neck-pelvis": 0.017, "right_shoulder-pelvis": 0.027, "left_shoulder-pelvis": 0.027}


@dataclass(frozen=True, kw_only=True, repr=False)
class LengthUncertainty(Record):
    r"""Standard deviations of the logarithms of a body's 17 lengths; small values are relative standard deviations.

    A true length is :math:`l_i = e^{s + t_i} \bar l_i`: :math:`\bar l_i` is the assumed length, s the common error of
    all lengths, and :math:`t_i` the independent error of segment i. With their standard deviations :math:`\sigma_s` and
    :math:`\sigma_i`, the covariance of the logarithms is :math:`\sigma_s^2\,1 1^T + \mathrm{diag}(\sigma_i^2)`.

    Parameters
    ----------
    common : float
        Standard deviation of the common error s.
    own : mapping of str to float
        Standard deviation of each segment's independent error, by name of `posekit.skeleton.SEGMENT_NAMES`; 0 if a
        segment is not named.

    Raises
    ------
    InputError
        If a deviation is negative or more than `MAX_LENGTH_DEVIATION`, or a segment is unknown.

    Examples
    --------
    >>> LengthUncertainty.uniform(0.05).total("neck-pelvis") > 0.07
    True
    """

    common: float = 0.0
    own: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value in {"common": self.common, **self.own}.items():
            if name not in ("common", *SEGMENT_NAMES):
                raise refusal(
                    "length_deviation", "", shown(name), f"a segment's name: {', '.join(SEGMENT_NAMES)}"
                )
            if not 0 <= value <= MAX_LENGTH_DEVIATION:
                expected = f"a fraction of the length, 0 to {MAX_LENGTH_DEVIATION:g}"
                raise refusal("length_deviation", name, f"{value:g}", expected)
        own = {name: float(self.own.get(name, 0.0)) for name in SEGMENT_NAMES}
        self._set("own", MappingProxyType(own))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the numbers: a read-only mapping cannot be pickled."""
        return partial(LengthUncertainty, common=self.common, own=dict(self.own)), ()

    def __hash__(self) -> int:
        """Hash the numbers."""
        return hash((self.common, tuple(self.own.values())))

    @staticmethod
    def uniform(deviation: float) -> LengthUncertainty:
        """Return an uncertainty with the same deviation of the common error and of every independent error.

        Trunk lengths also have the deviations `TRUNK_BENDS`, limited to three times `deviation`; zero means exact
        lengths.
        """
        own = dict.fromkeys(SEGMENT_NAMES, deviation)
        for name, bend in TRUNK_BENDS.items():
            own[name] = min(math.hypot(deviation, min(bend, 3.0 * deviation)), MAX_LENGTH_DEVIATION)
        return LengthUncertainty(common=deviation, own=own)

    def widened(self, times: float) -> LengthUncertainty:
        """Return the uncertainty with all deviations multiplied by `times`, but at most `MAX_LENGTH_DEVIATION`."""
        own = {name: min(times * one, MAX_LENGTH_DEVIATION) for name, one in self.own.items()}
        return LengthUncertainty(common=min(times * self.common, MAX_LENGTH_DEVIATION), own=own)

    @property
    def exact(self) -> bool:
        """Whether all lengths are known exactly."""
        return not self.common and not any(self.own.values())

    @property
    def deviations(self) -> Array:
        """Standard deviations of the independent errors (17,), in the order of `posekit.skeleton.SEGMENT_NAMES`."""
        return np.array([self.own[name] for name in SEGMENT_NAMES])

    @property
    def covariance(self) -> Array:
        """Covariance of the logarithms of the lengths (17, 17), in the order of `posekit.skeleton.SEGMENT_NAMES`."""
        return np.asarray(self.common**2 + np.diag(self.deviations**2))

    def total(self, segment: str) -> float:
        """Return the standard deviation of the logarithm of one segment's length."""
        return math.hypot(self.common, self.own[segment])


def _varying(deviation: float, non_rigid: float) -> dict[str, float]:
    """Return `non_rigid` for each of `NON_RIGID_SEGMENTS`, and `deviation` for all other segments."""
    return {name: non_rigid if name in NON_RIGID_SEGMENTS else deviation for name in SEGMENT_NAMES}


#: Uncertainty of lengths measured by a calibration or over a clip: 2 % from shoulders to pelvis, 1 % elsewhere.
#:
#: In motion capture (16 CMU clips), lengths deviate from each clip's medians by 1.0 % from shoulders to pelvis (2.1 %
#: in the worst clip) and by up to 0.4 % from neck to pelvis. Other segments are rigid there; their 1 % is the error of
#: a tape.
MEASURED_LENGTHS: Final = LengthUncertainty(own=_varying(0.01, 0.02))

#: Uncertainty of given lengths of a person if their accuracy is unknown.
#:
#: The lengths may be from a tape, another detector or another day: 3 % is the error that all lengths share. 4 % is the
#: difference between taped lengths and distances of joint centres, which also vary in time. With these deviations, 94
#: to 97 % of the joints of 14 bodies whose lengths are 2 % off are inside their 95 % regions (`benchmarks.people`).
#: Lengths estimated from a stature have `KNOWN_STATURE`.
STATED_LENGTHS: Final = LengthUncertainty(common=0.03, own=_varying(0.04, 0.06))

#: Uncertainty of the figure's lengths for an adult of unknown size.
#:
#: Mean (standard deviation) of stature is 1756 (68.6) mm for 4082 men and 1629 (64.2) mm for 1986 women (Gordon et al.
#: 2014, "2012 Anthropometric Survey of U.S. Army Personnel", NATICK/TR-15/007). The standard deviation of both together
#: is 5.5 %, and other people vary more than soldiers. In the same survey, the ratio of a limb's length to stature
#: varies by 3.5 % (upper arm) to 5.7 % (thigh).
UNKNOWN_ADULT: Final = LengthUncertainty(common=0.07, own=_varying(0.05, 0.05))

#: Uncertainty of lengths estimated from a known stature: proportions vary, and the stature may include shoes and hair.
KNOWN_STATURE: Final = LengthUncertainty(common=0.02, own=_varying(0.05, 0.05))
