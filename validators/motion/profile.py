"""Profiles: which checks over time are asked, with which thresholds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from posekit.errors import InputError
from posekit.safe_io import cut, nearest, one_line, perhaps, read_toml, refusal
from posekit.settings import ValidateSettings
from posekit.tables.built_in import built_in_document
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.motion.registry import MOTION_CHECKS
from posekit.validators.motion.walking_phases import RULES_OVER_STRIDES, WalkingPhases

BUILT_IN_PROFILES: Final = ("posekit", "phuma")
"""Profiles that come with the package."""


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Checks over time with their thresholds.

    Parameters
    ----------
    name : str
        What reports call it.
    checks : tuple of MotionCheck
        In the order of `MOTION_CHECKS`.
    """

    name: str
    checks: tuple[MotionCheck, ...]

    def only(self, names: Iterable[str]) -> Profile:
        """Take some of the checks: those that it lacks with their own thresholds."""
        mine = {check.name: check for check in self.checks}
        wanted = set(names)
        chosen = tuple(mine.get(name) or kind() for name, kind in MOTION_CHECKS.items() if name in wanted)
        return Profile(name=self.name, checks=chosen)


def load_profile(name: str) -> Profile:
    """Load a profile by its name, or from a TOML file of schema ``posekit.profile/1``.

    Raises
    ------
    InputError
        Where there is no such profile, or it is not what the schema says.
    """
    if name in BUILT_IN_PROFILES:
        return _named(name)
    if not name or not Path(name).is_file():
        raise InputError(
            one_line(
                f"--profile {cut(name)}: no such profile or file; expected {', '.join(BUILT_IN_PROFILES)} or the "
                f"path of a TOML file{perhaps(name, BUILT_IN_PROFILES)}"
            )
        )
    return _profile(read_toml(name), name)


@cache
def _named(name: str) -> Profile:
    return _profile(built_in_document("profiles", name), name)


def _profile(document: dict[str, Any], source: str) -> Profile:
    from posekit.tables.file_model import validated
    from posekit.tables.profile import ProfileTable

    table = validated(ProfileTable, document, source)
    for name in table.checks:
        if name not in MOTION_CHECKS:
            known = tuple(MOTION_CHECKS)
            raise refusal(source, "checks", cut(name), f"some of {', '.join(known)}", nearest(name, known))
    return Profile(
        name=source,
        checks=tuple(
            _check(kind, table.checks[name], source)
            for name, kind in MOTION_CHECKS.items()
            if name in table.checks
        ),
    )


def _check(kind: type[MotionCheck], thresholds: Mapping[str, float | str], source: str) -> MotionCheck:
    known: Sequence[str] = [one.name for one in fields(kind)] if is_dataclass(kind) else []
    for name in thresholds:
        if name not in known:
            raise refusal(
                source, f"checks.{kind.name}", cut(name), f"some of {', '.join(known)}", nearest(name, known)
            )
    try:
        return kind(**thresholds)
    except InputError as error:
        raise refusal(source, f"checks.{kind.name}", str(error), "a threshold that is possible") from None


class ProfiledSettings(NamedTuple):
    """Settings whose checks are those of postures alone, and the checks over time."""

    settings: ValidateSettings
    profile: Profile


def with_profile(asked: ValidateSettings) -> ProfiledSettings:
    """Take the checks over time out of what is asked: all of the profile's where no check is named.

    Rules of walking that speak of motion are judged over strides, too, unless they are asked for as printed.

    Parameters
    ----------
    asked : ValidateSettings
        Its checks may name both kinds.
    """
    profile = load_profile(asked.profile)
    if asked.checks is None:
        return ProfiledSettings(asked, profile)
    over_time = [check for check in asked.checks if check.name in MOTION_CHECKS]
    chosen = profile.only(check.name for check in over_time)
    names = {check.name for check in asked.checks}
    rules = ",".join(str(rule) for rule in asked.rules if rule in RULES_OVER_STRIDES)
    if "walking" in names and WalkingPhases.name not in names and asked.walkers != "paper-printed" and rules:
        chosen = replace(chosen, checks=(*chosen.checks, WalkingPhases(rules=rules)))
    return ProfiledSettings(
        asked.changed(checks=[check for check in asked.checks if check not in over_time]), chosen
    )
