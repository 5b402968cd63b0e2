"""Mimicking joints, and configurations from tables with named columns."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import nearest, shown
from posekit.geometry import Array
from posekit.robots.kinematics import entries_of
from posekit.robots.urdf import FREEDOM, Element, need, numbers

if TYPE_CHECKING:
    from posekit.robots.robot import Robot

#: Largest number of names that a note lists.
MOST_LISTED: Final = 12


class Mimic(NamedTuple):
    """A joint that follows a target joint: value = multiplier * (value of the target) + offset, rad or m."""

    joint: str
    target: str
    multiplier: float
    offset: float


def mimics_of(robot: Element) -> tuple[Mimic, ...]:
    """List the mimicking joints of a checked URDF. A mimicking joint is listed before the joints that mimic it."""
    found: dict[str, Mimic] = {}
    for joint in robot.findall("joint"):
        mimic, name = joint.find("mimic"), joint.get("name", "")
        if mimic is not None and FREEDOM[joint.get("type", "")] == 1:
            factor, offset = (numbers(mimic, *one)[0] for one in (("multiplier", "1"), ("offset", "0")))
            found[name] = Mimic(name, mimic.get("joint", ""), factor, offset)

    def depth(mimic: Mimic) -> int:
        return 1 + depth(found[mimic.target]) if mimic.target in found else 0

    return tuple(sorted(found.values(), key=depth))


def from_columns(robot: Robot, names: Sequence[str], values: ArrayLike) -> tuple[Array, tuple[str, ...]]:
    """Convert a table with named columns to configurations q: see `Robot.q_from_columns`."""
    table, check = np.asarray(values, dtype=np.float64), partial(need, "")
    ok = table.ndim == 2 and table.shape[1] == len(names)
    check(ok, "values", f"shape {table.shape}", f"(N, {len(names)})", "give each column a name")
    entries = {_key(name): k for k, name in enumerate(robot.configuration_names)}
    columns, ignored = dict[str, Array](), list[str]()
    for name, column in zip(names, table.T, strict=True):
        key, found = _key(name), {_key(name): column}
        if f"{key}.sin" in entries and f"{key}.x" not in entries:  # a continuous joint as one angle
            found = {f"{key}.cos": np.cos(column), f"{key}.sin": np.sin(column)}
        if entries.keys() >= found.keys():
            check(not found.keys() & columns, "columns", f"{shown(name)} twice", "each once", "remove one")
            columns |= found
        else:
            ignored.append(str(name))
    remedy = nearest(ignored[0], robot.configuration_names) if ignored else "name the columns"
    ok = bool(columns) and len(ignored) <= len(names) / 2
    check(ok, "columns", shown(ignored), f"joints of {robot.name}", remedy)
    q = np.tile(robot.neutral, (len(table), 1))
    at, given = [entries[key] for key in columns], np.array(list(columns.values())).T
    q[:, at] = given
    q = robot.with_mimics(q)
    q[:, at] = given  # columns of mimicking joints keep their values
    following = {mimic.joint for mimic in robot.mimics}
    left = [
        entry.name
        for entry in entries_of(robot.model)
        if _key(entry.name) not in columns and robot.model.names[entry.joint] not in following
    ]
    notes = {
        f"{len(left)} of {len(entries)} entries have no column and are neutral": left,
        f"Columns that are not a joint of {robot.name} are ignored": ignored,
    }
    listed = {
        note: [*some[:MOST_LISTED], *(["…"] if some[MOST_LISTED:] else [])] for note, some in notes.items()
    }
    return q, tuple(f"{note}: {', '.join(some)}." for note, some in listed.items() if some)


def _key(name: str) -> str:
    """Return a column's name in lower case, without ``_joint`` at the end of the joint's name."""
    return str(name).strip().lower().replace("_joint.", ".").removesuffix("_joint")
