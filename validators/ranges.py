"""Tables of joint ranges, read from TOML of schema ``posekit.ranges/1``.

There are four kinds of table. ``anatomical``: mean and standard deviation over people of the lower and upper limit of
each angle, and how limits depend on other angles. ``rotation``: limits of the angles of Lee & Chen 1985, §3.2.A,
defined as rotations from standing. ``projected``: limits of the same angles, defined by projections as in the paper.
``joints``: limits of a robot's joints.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Final

import numpy as np

from posekit.body import Figure
from posekit.errors import nearest, refusal, shown
from posekit.files import read_table
from posekit.geometry import perpendicular, unit
from posekit.skeleton import DOFS, HIPS, JOINT
from posekit.solver import Limits

RANGES_SCHEMA: Final = "posekit.ranges/1"
KINDS: Final = ("anatomical", "rotation", "projected", "joints")
#: Names of the built-in tables; ``urdf`` stands for the URDF's own limits.
NAMED: Final = ("urdf", "anatomical", "table1", "table1-printed", "human_as_stick_figure")

#: Standard deviation over recordings of the median angle between pelvis and trunk, degrees. It is 8 degrees in 16
#: recordings of one skeleton that walks, runs, jumps and crouches.
MOSTLY_HELD_DEGREES: Final = 10.0

#: Height of the figure's pelvis joint above the line between its hips, metres.
USUAL_PELVIS_METRES: Final = 0.1


@lru_cache(maxsize=32)
def load_ranges(name: str) -> Mapping[str, Any] | None:
    """Load a table of joint ranges by name, or from a TOML file.

    Returns
    -------
    mapping or None
        The parsed table; None for ``urdf``.

    Raises
    ------
    InputError
        If there is no such table, or it does not follow the schema.
    """
    if name == "urdf":
        return None
    if name == "table1-printed":
        return {**(load_ranges("table1") or {}), "kind": "projected"}
    table = read_table("anatomical" if name == "auto" else name, "ranges", NAMED, RANGES_SCHEMA, "ranges")
    kind = table.get("kind")
    if kind not in KINDS:
        raise refusal(name, "kind", shown(kind), f"one of {', '.join(KINDS)}", "state it")
    if kind == "anatomical":
        _check_anatomical(table, name)
    elif kind == "joints":
        for joint, limits in table.get("limits", {}).items():
            _check_limits(limits, name, f"limits.{joint}")
    elif name != "table1":
        given, known = _angles(table), _angles(load_ranges("table1") or {})
        for angle in [*given, *known]:
            if angle not in known:
                raise refusal(name, angle, "an unknown angle", "a known one", nearest(angle, known))
            _check_limits(given.get(angle), name, angle)
    return table


def _angles(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the limits in a table, by names of the form ``joint.angle``."""
    joints = {joint: angles for joint, angles in table.items() if isinstance(angles, dict)}
    return {f"{joint}.{angle}": ends for joint, angles in joints.items() for angle, ends in angles.items()}


def _check_limits(limits: Any, source: str, field: str) -> None:
    numbers = isinstance(limits, list) and len(limits) == 2 and all(map(_is_number, limits))
    if not numbers or limits[0] > limits[1]:
        raise refusal(source, field, shown(limits), "[lower, upper] in degrees", "give the lower first")


def _check_anatomical(table: Mapping[str, Any], source: str) -> None:
    numbers, angles = {"spreads": table.get("spreads")}, _angles(table)
    for dof in dict.fromkeys(dof.removeprefix("right_").removeprefix("left_") for dof in DOFS):
        for end in ("lower", "upper"):
            ends = angles.get(dof)
            one = ends.get(end, {}) if isinstance(ends, dict) else {}
            numbers |= {f"{dof}.{end}.{name}": one.get(name) for name in ("mean", "spread")}
    for field, number in numbers.items():
        if not _is_number(number):
            raise refusal(source, field, shown(number), "a number", "add it")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def limits_of(figure: Figure, table: Mapping[str, Any] | None) -> Limits:
    """Return the ranges of pelvis and limbs from a table of kind ``anatomical``, or else from the figure's URDF."""
    pelvis, right, left = (figure.neutral_points[JOINT[joint]] for joint in HIPS)
    return Limits.of(
        table if table and table["kind"] == "anatomical" else None,
        np.degrees(np.stack([figure.limits.lower, figure.limits.upper], axis=1)),
        above_hips=float(np.linalg.norm(perpendicular(right - pelvis, unit(left - right)))),
        pelvis_between_hips=figure.pelvis_between_hips,
    )


def of_person(table: Mapping[str, Any], forward: float, outward: float) -> Mapping[str, Any]:
    """Widen anatomical ranges for a person whose median hip angles are unusual.

    Unusual median angles have two possible causes. The skeleton may define its pelvis joint at another position, which
    shifts the zero angles of pelvis and hips. Or the person usually stands in an unusual posture. A recording does not
    separate the causes. Therefore ranges only widen: one limit moves outward, and the opposite limit stays unchanged.

    Parameters
    ----------
    table : mapping
        Ranges of kind ``anatomical``.
    forward : float
        Median angle by which the hips lie in front of the line from neck to pelvis, degrees.
    outward : float
        Inward lean of straight thighs, degrees; positive if the hips are wider apart than the built-in figure's.
    """
    moved = copy.deepcopy(dict(table))
    ways = [(moved["hip"]["abduction"], -outward)]
    for one in (moved["pelvis"]["flexion"], moved["hip"]["flexion"]):
        zero = one.get("zero", {})
        if zero.get("pelvis", 0.0) > 0:
            own = math.hypot(zero["spread"], math.degrees(math.atan(zero["pelvis"] / USUAL_PELVIS_METRES)))
            share = own**2 / (own**2 + MOSTLY_HELD_DEGREES**2)
            ways.append((one, share * (forward - abs(zero["mean"])) * (1 if zero["mean"] > 0 else -1)))
    for one, degrees in ways:
        one["lower" if degrees < 0 else "upper"]["mean"] += degrees
    return moved
