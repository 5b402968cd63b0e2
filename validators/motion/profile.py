"""Profiles: TOML tables that select checks of motion and set their thresholds."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from posekit.errors import cut, nearest, refusal, shown
from posekit.files import read_table
from posekit.validators.check import FunctionCheck
from posekit.validators.motion import frames, orientation, published, sliding, speed, standing

PROFILE_SCHEMA: Final = "posekit.profile/1"

#: Names of the built-in profiles.
BUILT_IN: Final = ("posekit", "phuma", "protomotions", "holomotion", "skating")

#: Modules with checks of motion, in the order of reports.
_MODULES: Final = (orientation, frames, speed, standing, sliding, published)

#: Checks of motion by name.
MOTION_CHECKS: Final[dict[str, FunctionCheck]] = {
    one.name: one
    for module in _MODULES
    for one in vars(module).values()
    if isinstance(one, FunctionCheck) and one.over_time
}


@lru_cache(maxsize=16)
def load_profile(name: str) -> tuple[FunctionCheck, ...]:
    """Return the checks of a profile, with its thresholds, in the order of `MOTION_CHECKS`.

    The profile is the name of a built-in profile, or the path of a TOML file of schema ``posekit.profile/1``.

    Raises
    ------
    InputError
        If there is no such profile, or it does not follow the schema.
    """
    asked = read_table(name, "profiles", BUILT_IN, PROFILE_SCHEMA, "profile").get("checks", {})
    for check, thresholds in asked.items():
        if check not in MOTION_CHECKS:
            raise refusal(name, "checks", cut(check), "a check over time", nearest(check, MOTION_CHECKS))
        known, field = MOTION_CHECKS[check].defaults, f"checks.{check}"
        for key, value in thresholds.items():
            if key not in known:
                raise refusal(name, field, cut(key), f"some of {', '.join(known)}", nearest(key, known))
            kind = type(known[key])
            if type(value) is not kind and (kind is not float or type(value) is not int):
                raise refusal(name, f"{field}.{key}", shown(value), f"a {kind.__name__}", "correct it")
    return tuple(one.with_thresholds(**asked[key]) for key, one in MOTION_CHECKS.items() if key in asked)
