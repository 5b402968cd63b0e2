"""Which columns of a table are a robot's root, by their names, and which its joints."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

_ROOT: Final = r"(?:root|base|pelvis|floating_base)?_?"
_PLACE: Final = re.compile(
    rf"{_ROOT}(?:pos|position|trans|translation|translate)?_?([xyz])(?:[(\[]m[)\]])?", re.IGNORECASE
)
_TURN: Final = re.compile(
    rf"{_ROOT}(?:(?:rot|ori|orientation|quat|quaternion)_?(?:q)?|q)([xyzw])", re.IGNORECASE
)
_TIME: Final = ("time", "t", "timestamp", "time_s")
_COUNTS: Final = ("frame", "index", "")
IN_DEGREES: Final = re.compile(r"(?:root|base|pelvis)_?(?:rotate|rot|euler)_?[xyz]|.*\(deg\)", re.IGNORECASE)
"""Angles that are no quaternion and no radians."""


def robot_roles(names: Sequence[str]) -> dict[str, dict[str, str]]:
    """Tell which columns are the root's place and turn by axis, the time, and the joints."""
    roles: dict[str, dict[str, str]] = {"place": {}, "turn": {}, "time": {}, "joint": {}}
    for name in names:
        if place := _PLACE.fullmatch(name):
            roles["place"].setdefault(place[1].lower(), name)
        elif turn := _TURN.fullmatch(name):
            roles["turn"].setdefault(turn[1].lower(), name)
        elif name.lower() in _TIME:
            roles["time"][name] = name
        elif name.lower() not in _COUNTS:
            roles["joint"][name] = name
    return roles


def has_root_turn(names: Sequence[str]) -> bool:
    """Tell whether columns have a root's quaternion."""
    return len(robot_roles(names)["turn"]) == 4
