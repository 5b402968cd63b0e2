"""Everything that is asked of a recovery."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Final, Literal, Protocol, get_args

from posekit.errors import InputError
from posekit.settings.check import CheckSettings, check_settings
from posekit.settings.rooting import Rooting
from posekit.settings.scale import Scale, parse_scale
from posekit.settings.tolerance import PartialTolerance, Tolerance

Proportions = Literal["figure", "taylor"]

DEFAULT_CHECKS: Final = tuple(
    CheckSettings(name=name) for name in ("rigid-parts", "joint-range", "collision")
)
"""The checks of a posture by itself; ``walking`` needs a person who walks."""

DEFAULT_RULES: Final = (1, 2)
"""Rules of walking that are asked where ``walking`` is."""

WALKING_RULES: Final = (1, 2, 3, 4, 5)
WALKERS_NAMES: Final = ("paper", "people")


class RangeTable(Protocol):
    """A table of joint ranges that is loaded by now: `posekit.validators.Ranges`."""

    @property
    def name(self) -> str:
        """What results call it."""
        ...

    @property
    def limits(self) -> Mapping[str, tuple[float, float]]:
        """The ranges, degrees."""
        ...


@dataclass(frozen=True, kw_only=True)
class RecoverSettings:
    """Everything that is asked of a recovery; the view, the figure and the computer come from elsewhere.

    Command line, Python, batch and evaluation make one each in their own way, and hand it down whole.

    Parameters
    ----------
    checks : sequence of str, CheckSettings or check
        What postures are judged by: some of ``rigid-parts``, ``joint-range``, ``collision``, ``walking``, and checks of
        your own. By default the first three.
    ranges : str or Ranges
        Joint ranges: ``urdf`` (the default), ``table1``, ``anatomical``, the path of a TOML table, or loaded ranges.
    rules : sequence of int
        Rules of walking, 1 to 5, used where ``walking`` is among the checks. By default 1 and 2.
    walkers : {"paper", "people"}
        Whose thresholds those have: by the paper's word (the default), or as real walkers keep them.
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
        posture near it (`posekit.refinement`). By default where the noise is known: from `rooting`, from the view, or
        because a detector saw the points; and no tolerance is given.
    length_deviation : float, optional
        Relative standard deviation of lengths, for that; by default what bodies give (`posekit.refinement`).

    Raises
    ------
    InputError
        Where one of them is impossible, whatever the view.

    Examples
    --------
    >>> RecoverSettings(contact_margin=-0.01).changed(ranges="table1").ranges
    'table1'
    """

    checks: Sequence[Any] = DEFAULT_CHECKS  # a tuple of CheckSettings, once they are made
    ranges: str | RangeTable = "urdf"
    rules: Sequence[int] = DEFAULT_RULES
    walkers: str = "paper"
    tolerance: Tolerance | PartialTolerance | None = None
    contact_margin: float = 0.0
    group: float | None = None
    scale: Scale | str | None = None
    proportions: str = "figure"
    nearer: Sequence[Mapping[str, str]] | None = None
    infer: bool = True
    rooting: Rooting = field(default_factory=Rooting)
    refine: bool | None = None
    length_deviation: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "checks", tuple(map(check_settings, self.checks)))
        object.__setattr__(self, "rules", checked_rules(self.rules))
        object.__setattr__(self, "rooting", self.rooting or Rooting())
        object.__setattr__(self, "scale", self.scale or None)
        check_walkers(self.walkers)
        if self.group is not None and not (math.isfinite(self.group) and self.group >= 0):
            raise InputError(f"--group: {self.group!r} m; expected zero or a positive length")
        if not math.isfinite(self.contact_margin):
            raise InputError(f"the contact margin is {self.contact_margin!r} m; expected a finite length")
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

    @property
    def check_names(self) -> tuple[str, ...]:
        """The names of the checks."""
        return tuple(check.name for check in self.checks)

    def changed(self, **changes: Any) -> RecoverSettings:
        """Return the same settings with some of them changed, by the names of the fields."""
        return replace(self, **changes) if changes else self

    def tolerance_for(self, usual: Tolerance) -> Tolerance | None:
        """Return the tolerance that is given, with gaps filled from the `usual` one of the view; None where none is."""
        return (
            self.tolerance.filled(usual) if isinstance(self.tolerance, PartialTolerance) else self.tolerance
        )

    def scale_for(self, per_metre: float) -> Scale | None:
        """Return how the scale is found, for a view that has `per_metre` units in a metre; None where nobody says."""
        return parse_scale(self.scale, per_unit=per_metre) if isinstance(self.scale, str) else self.scale

    def to_json(self) -> dict[str, Any]:
        """Return the settings as values that JSON has, which `from_json` reads again.

        A table of ranges is given by its name, or the path that it was read from.
        """
        document = {one.name: getattr(self, one.name) for one in fields(self)}
        for name in ("tolerance", "scale", "rooting"):
            if document[name] is not None and not isinstance(document[name], str):
                document[name] = asdict(document[name])
        return document | {
            "checks": [check.name if not check.parameters else check.to_json() for check in self.checks],
            "ranges": self.ranges if isinstance(self.ranges, str) else self.ranges.name,
            "rules": list(self.rules),
            "nearer": None if self.nearer is None else [dict(one) for one in self.nearer],
        }

    @staticmethod
    def from_json(document: Mapping[str, Any]) -> RecoverSettings:
        """Read settings that `to_json` wrote; what is not said is as it is by default.

        Raises
        ------
        InputError
            Where a setting is unknown or impossible.
        """
        known = [one.name for one in fields(RecoverSettings)]
        unknown = sorted(set(document) - set(known))
        if unknown:
            raise InputError(f"settings: {unknown[0]!r} is no setting; expected some of {', '.join(known)}")
        said = dict(document)
        try:
            if said.get("tolerance") is not None:
                whole = Tolerance if "placement" in said["tolerance"] else PartialTolerance
                said["tolerance"] = whole(**said["tolerance"])
            if isinstance(said.get("scale"), Mapping):
                said["scale"] = Scale(**said["scale"])
            if isinstance(said.get("rooting"), Mapping):
                said["rooting"] = Rooting(**said["rooting"])
            return RecoverSettings(**said)
        except TypeError as error:
            raise InputError(f"settings: {error}; expected what `RecoverSettings.to_json` writes") from None


MAX_LENGTH_DEVIATION: Final = 0.3
"""The largest relative deviation of lengths that is taken for one."""


def check_walkers(walkers: str) -> None:
    """Refuse a name that is none of walkers'."""
    if walkers not in WALKERS_NAMES:
        raise InputError(f"--walkers: {walkers!r}; expected {' or '.join(WALKERS_NAMES)}")


def checked_rules(rules: Iterable[int]) -> tuple[int, ...]:
    """Return rules of walking, or refuse one that there is not."""
    chosen = tuple(rules)
    unknown = [rule for rule in chosen if rule not in WALKING_RULES]
    if unknown:
        raise InputError(f"--rules: {unknown[0]} is not a rule; expected some of 1, 2, 3, 4, 5")
    return chosen
