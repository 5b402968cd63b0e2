"""Everything that is asked of a recovery."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, get_args

from posekit.display.short_repr import ShortRepr
from posekit.errors import InputError
from posekit.settings.check import CheckSettings
from posekit.settings.judging import JudgingSettings
from posekit.settings.rooting import Rooting
from posekit.settings.scale import Scale, parse_scale
from posekit.settings.tolerance import PartialTolerance, Tolerance

Proportions = Literal["figure", "taylor"]

DEFAULT_CHECKS: Final = tuple(
    CheckSettings(name=name) for name in ("rigid-parts", "joint-range", "collision")
)
"""The checks of a posture by itself; ``walking`` needs a person who walks."""


@dataclass(frozen=True, kw_only=True)
class RecoverSettings(JudgingSettings, ShortRepr):
    """Everything that is asked of a recovery; the view, the figure and the computer come from elsewhere.

    Command line, Python, batch and evaluation make one each in their own way, and hand it down whole.

    Parameters
    ----------
    checks : sequence of str, CheckSettings or check
        What postures are judged by: some of ``rigid-parts``, ``joint-range``, ``collision``, ``walking``, and checks of
        your own. By default the first three.
    ranges : str or Ranges
        Joint ranges: ``anatomical`` (the default), ``urdf``, ``table1``, the path of a TOML table, or loaded ranges.
    rules : sequence of int
        Rules of walking, 1 to 5, used where ``walking`` is among the checks. By default 1 and 2.
    walkers : {"paper", "people", "paper-printed"}
        Whose thresholds those have: by the paper's word (the default), as real walkers keep them, or as printed.
    tolerance : Tolerance or PartialTolerance, optional
        What may be off. By default each frame is judged as exact where distances inside torso or hips show that it is,
        else as measured, or as a photograph where the view is uncalibrated.
    contact_margin : float
        Metres that bodies must keep from each other; negative allows penetration. By default 0.
    group : float, optional
        Metres within which similar survivors are grouped; by default they are not.
    scale : Scale or str, optional
        How the scale of an uncalibrated view is found: a `Scale`, or what ``--scale`` takes, where a number is in
        pixels a unit of the view. By default the view's own, or the least that the lengths allow.
    proportions : {"figure", "taylor"}
        Whose relative lengths an uncalibrated view is lifted with: the figure's (the default), or Taylor's Table 1
        (12 points, no neck and pelvis).
    nearer : sequence of mapping, optional
        Flips given by hand: segment to the name of its nearer end, one mapping for all frames or one a frame.
    infer : bool
        Whether joints that were not seen are completed (the default): each posture then has a feasible position for
        them, and says which joints were inferred and what else they can be. Otherwise they are NaN.
    rooting : Rooting
        How the neck is found in a calibrated view that neither gives it nor shows a head of six points.
    refine : bool, optional
        Whether frames that are not exact are grown as their noise demands, and every survivor becomes the likeliest
        posture near it (`posekit.refinement`). By default wherever frames are not exact and no tolerance is given, of
        lengths that are not said to be exact or points whose noise is known.
    length_deviation : float, optional
        Relative standard deviation of the body's size, and of each length beside it; 0 says that lengths are exact. By
        default what the view says, else what is known of the person (`posekit.body.uncertainty`).
    coverage : float
        Which share of the probability the listed postures of a refined frame hold at least, likeliest first; what is
        not listed is counted and weighed. By default 0.99; 1 lists all. Frames that are exact list all.

    Raises
    ------
    InputError
        Where one of them is impossible, whatever the view.

    Examples
    --------
    >>> RecoverSettings(contact_margin=-0.01).changed(ranges="table1").ranges
    'table1'
    """

    checks: Sequence[Any] = DEFAULT_CHECKS
    tolerance: Tolerance | PartialTolerance | None = None
    group: float | None = None
    scale: Scale | str | None = None
    proportions: str = "figure"
    nearer: Sequence[Mapping[str, str]] | None = None
    infer: bool = True
    rooting: Rooting = field(default_factory=Rooting)
    refine: bool | None = None
    length_deviation: float | None = None
    coverage: float = 0.99

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "rooting", self.rooting or Rooting())
        object.__setattr__(self, "scale", self.scale or None)
        if self.group is not None and not (math.isfinite(self.group) and self.group >= 0):
            raise InputError(f"--group: {self.group!r} m; expected zero or a positive length")
        if self.proportions not in get_args(Proportions):
            raise InputError(
                f"--proportions: {self.proportions!r}; expected {' or '.join(get_args(Proportions))}"
            )
        if isinstance(self.scale, str):
            parse_scale(self.scale)
        if self.length_deviation is not None and not (
            math.isfinite(self.length_deviation) and 0 <= self.length_deviation <= MAX_LENGTH_DEVIATION
        ):
            raise InputError(
                f"--length-deviation: {self.length_deviation!r}; expected a fraction of the length, 0 to "
                f"{MAX_LENGTH_DEVIATION:g}"
            )
        if not (math.isfinite(self.coverage) and 0 < self.coverage <= 1):
            raise InputError(
                f"--coverage: {self.coverage!r}; expected a share of the probability, above 0, up to 1"
            )

    def tolerance_for(self, usual: Tolerance) -> Tolerance | None:
        """Return the tolerance that is given, with gaps filled from the `usual` one of the view; None where none is."""
        return (
            self.tolerance.filled(usual) if isinstance(self.tolerance, PartialTolerance) else self.tolerance
        )

    def scale_for(self, per_metre: float) -> Scale | None:
        """Return how the scale is found, for a view that has `per_metre` units in a metre; None where nobody says."""
        return parse_scale(self.scale, per_unit=per_metre) if isinstance(self.scale, str) else self.scale

    @classmethod
    def _made(cls, said: dict[str, Any]) -> dict[str, Any]:
        if said.get("tolerance") is not None:
            whole = Tolerance if "placement" in said["tolerance"] else PartialTolerance
            said["tolerance"] = whole(**said["tolerance"])
        for name, kind in (("scale", Scale), ("rooting", Rooting)):
            if isinstance(said.get(name), Mapping):
                said[name] = kind(**said[name])
        return said


MAX_LENGTH_DEVIATION: Final = 0.3
"""The largest relative deviation of lengths that is taken for one."""
