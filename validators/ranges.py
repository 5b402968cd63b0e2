"""Tables of joint ranges, read from TOML of schema ``posekit.ranges/1``.

There are four kinds of table. ``anatomical``: mean and spread over people of both ends of each angle, and couplings
between angles. ``rotation`` and ``projected``: limits of the angles of Lee & Chen 1985, §3.2.A, as rotations from
standing and as printed. ``joints``: limits of a robot's joints.
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
#: Tables by name; ``urdf`` stands for the URDF's own limits.
NAMED: Final = ("urdf", "anatomical", "table1", "table1-printed", "human_as_stick_figure")

#: Standard deviation between recordings of the median angle between pelvis and trunk, degrees. In 16 recordings of one
#: skeleton that walks, runs, jumps and crouches it is 8.
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
        If there is no such table, or it breaks the schema.
    """
    if name == "urdf":
        return None
    if name == "table1-printed":
        return {**(load_ranges("table1") or {}), "kind": "projected"}
    table = read_table("anatomical" if name == "auto" else name, "ranges", NAMED, RANGES_SCHEMA, "--ranges")
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
    """Return the limits of a table by the names of joint and angle."""
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
    """Return the ranges of pelvis and limbs: from a table of kind ``anatomical``, else from the figure's URDF."""
    pelvis, right, left = (figure.neutral_points[JOINT[joint]] for joint in HIPS)
    return Limits.of(
        table if table and table["kind"] == "anatomical" else None,
        np.degrees(np.stack([figure.limits.lower, figure.limits.upper], axis=1)),
        above_hips=float(np.linalg.norm(perpendicular(right - pelvis, unit(left - right)))),
        pelvis_between_hips=figure.pelvis_between_hips,
    )


def of_person(table: Mapping[str, Any], forward: float, outward: float) -> Mapping[str, Any]:
    """Return anatomical ranges of a person whose hips lie before the line of the trunk in the median frame.

    An unusual angle of the hips has two causes: the place of the pelvis joint in the skeleton, which moves the zeros of
    pelvis and hips, and the person's usual posture. A recording does not separate the causes. So the ranges only
    widen: an end moves if a moved zero takes it outward, and the opposite end stays.

    Parameters
    ----------
    table : mapping
        Ranges of kind ``anatomical``.
    forward : float
        Angle of the hips before the trunk's line, degrees.
    outward : float
        Inward lean of straight thighs, degrees, because the hips are wider apart than usual.
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
