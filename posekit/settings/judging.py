"""What settings of recoveries and of validations have in common."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Final, Protocol, Self

from posekit.errors import InputError
from posekit.settings.check import CheckSettings, check_settings

DEFAULT_RULES: Final = (1, 2)
"""Rules of walking that are asked where ``walking`` is."""

DEFAULT_RANGES: Final = "anatomical"
"""The table of joint ranges by which people are judged unless told otherwise (docs, "Anatomical ranges")."""

WALKING_RULES: Final = (1, 2, 3, 4, 5)
WALKERS_NAMES: Final = ("paper", "people", "paper-printed")


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
class JudgingSettings:
    """By what postures are judged; settings are changed, and written as JSON, by the names of their fields.

    Parameters
    ----------
    checks : sequence of str, CheckSettings or check, optional
        What postures are judged by; the usual where they are not given.
    ranges : str or Ranges
        Joint ranges: ``anatomical`` (the default), ``urdf``, ``table1``, the path of a TOML table, or loaded ranges.
    rules : sequence of int
        Rules of walking, 1 to 5, used where ``walking`` is among the checks. By default 1 and 2.
    walkers : {"paper", "people", "paper-printed"}
        Whose thresholds those have: by the paper's word (the default), as real walkers keep them, or by its word with
        the head for the body's direction, which a turned head breaks.
    contact_margin : float
        Metres that bodies must keep from each other; negative allows penetration. By default 0.

    Raises
    ------
    InputError
        Where one of them is impossible, whatever is judged.
    """

    checks: Sequence[Any] | None = None  # a tuple of CheckSettings, once they are made
    ranges: str | RangeTable = DEFAULT_RANGES
    rules: Sequence[int] = DEFAULT_RULES
    walkers: str = "paper"
    contact_margin: float = 0.0

    def __post_init__(self) -> None:
        if self.checks is not None:
            object.__setattr__(self, "checks", tuple(map(check_settings, self.checks)))
        object.__setattr__(self, "rules", checked_rules(self.rules))
        check_walkers(self.walkers)
        if not math.isfinite(self.contact_margin):
            raise InputError(f"the contact margin is {self.contact_margin!r} m; expected a finite length")

    @property
    def check_names(self) -> tuple[str, ...]:
        """The names of the checks that are given."""
        return tuple(check.name for check in self.checks or ())

    def changed(self, **changes: Any) -> Self:
        """Return the same settings with some of them changed, by the names of the fields."""
        return replace(self, **changes) if changes else self

    def to_json(self) -> dict[str, Any]:
        """Return the settings as values that JSON has, which `from_json` reads again.

        A table of ranges is given by its name, or the path that it was read from; so is a joint map.
        """
        return {one.name: _plain(getattr(self, one.name)) for one in fields(self)}

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Self:
        """Read settings that `to_json` wrote; what is not said is as it is by default.

        Raises
        ------
        InputError
            Where a setting is unknown or impossible.
        """
        known = [one.name for one in fields(cls)]
        unknown = sorted(set(document) - set(known))
        if unknown:
            raise InputError(f"settings: {unknown[0]!r} is no setting; expected some of {', '.join(known)}")
        try:
            return cls(**cls._made(dict(document)))
        except TypeError as error:
            raise InputError(f"settings: {error}; expected what `{cls.__name__}.to_json` writes") from None

    @classmethod
    def _made(cls, said: dict[str, Any]) -> dict[str, Any]:
        """Make objects of the settings that are some."""
        return said


def _plain(value: Any) -> Any:
    """Turn a setting into what JSON has."""
    if isinstance(value, CheckSettings):
        return value.to_json() if value.parameters else value.name
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "name"):
        return value.name
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else value


def check_walkers(walkers: str) -> None:
    """Refuse a name that is none of walkers'."""
    if walkers not in WALKERS_NAMES:
        raise InputError(f"--walkers: {walkers!r}; expected one of {', '.join(WALKERS_NAMES)}")


def checked_rules(rules: Iterable[int]) -> tuple[int, ...]:
    """Return rules of walking, or refuse one that there is not."""
    chosen = tuple(rules)
    unknown = [rule for rule in chosen if rule not in WALKING_RULES]
    if unknown:
        raise InputError(f"--rules: {unknown[0]} is not a rule; expected some of 1, 2, 3, 4, 5")
    return chosen
