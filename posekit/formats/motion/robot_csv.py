"""Configurations of a robot over time as CSV: a row a frame, with a row of names or without.

With names: the root's position ``root_pos_x``, ``root_pos_y``, ``root_pos_z`` (or ``x``, ``y``, ``z``), its quaternion
``root_rot_x`` … ``root_rot_w`` (or ``qx`` … ``qw``), a column a joint, and perhaps ``time`` and ``frame``. Without:
three numbers of the root's position, its quaternion x, y, z, w, and the joints in the robot's own order, as the motions
of LaFAN1 that were retargeted to Unitree's robots are; they say no rate. Metres and radians.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.motion.configuration_format import ConfigurationFormat
from posekit.formats.motion.csv_table import MAX_BYTES, read_columns
from posekit.formats.motion.number_rows import numbers_of
from posekit.formats.motion.robot_columns import IN_DEGREES, robot_roles
from posekit.formats.motion.robot_table import RobotColumns, configurations_of_columns, joint_name
from posekit.formats.own.postures_q import NamedConfigurations
from posekit.geometry import Array
from posekit.safe_io import cut, read_text, refusal, shown

MOST_JOINTS: Final = 1000
LEAST_COLUMNS: Final = 8
"""Numbers of a root and one joint."""


def read_robot_csv(path: Path) -> NamedConfigurations:
    """Read a CSV of a robot's configurations.

    Parameters
    ----------
    path : Path
        The file to read.

    Raises
    ------
    InputError
        Where a row is short, a cell is no number, or columns of the root are missing or of angles in degrees.
    """
    text = read_text(path, limit=MAX_BYTES, too_large="split it by frames")
    first = _cells(text.partition("\n")[0])
    columns = _of_names(path, first) if not _are_numbers(first) else _of_rows(path, text, len(first))
    return configurations_of_columns(columns, str(path))


def _of_rows(path: Path, text: str, width: int) -> RobotColumns:
    body = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    values = numbers_of(path, body, lambda number, line: _cells(line), width, f"{width}, as in the first row")
    if np.isnan(values).any():
        row = int(np.argmax(np.isnan(values).any(axis=1)))
        raise refusal(path, f"line {body[row][0]}", "an empty cell", "a number", "complete the row")
    time = np.full(len(values), np.nan)
    return RobotColumns(
        values[:, :3], values[:, 3:7], "xyzw", "the root's quaternion", values[:, 7:], (), time
    )


def _of_names(path: Path, names: Sequence[str]) -> RobotColumns:
    roles = robot_roles(names)
    turned = next((name for name in names if IN_DEGREES.fullmatch(name)), None)
    if len(roles["turn"]) < 4 or len(roles["place"]) < 3:
        got = f"{shown(turned)}: angles in degrees" if turned is not None else "a root without quaternion"
        expected = "root_pos_x … root_pos_z in metres, root_rot_x … root_rot_w, joints in radians"
        raise refusal(path, "columns", got, expected, "convert it")
    columns = read_columns(path, lambda named: named)
    time = next((columns[name] for name in roles["time"].values()), np.full(len(columns[names[0]]), np.nan))
    joints = list(roles["joint"].values())
    called = tuple(joint_name(name) for name in joints)
    if not joints or len(joints) > MOST_JOINTS or len(set(called)) != len(called):
        got = f"{len(joints)} columns of joints, {len(set(called))} different"
        raise refusal(path, "columns", got, f"1 to {MOST_JOINTS}, each joint once", "correct the names")
    return RobotColumns(
        _stacked(columns, [roles["place"][axis] for axis in "xyz"]),
        _stacked(columns, [roles["turn"][axis] for axis in "xyzw"]),
        "xyzw",
        cut(roles["turn"]["w"]),
        _stacked(columns, joints),
        called,
        np.asarray(time, dtype=np.float64),
    )


def _stacked(columns: Mapping[str, Array], names: Sequence[str]) -> Array:
    return np.stack([np.asarray(columns[name], dtype=np.float64) for name in names], axis=1)


def _cells(line: str) -> list[str]:
    delimiter = max(",;\t", key=line.count)
    try:
        found = next(csv.reader(io.StringIO(line, newline=""), delimiter=delimiter), [])
    except csv.Error:  # a row that is none: its cells are not counted on
        found = line.split(delimiter)
    return [cell.strip() for cell in found]


def _are_numbers(cells: Sequence[str]) -> bool:
    try:
        return all(np.isfinite(float(cell)) for cell in cells) and bool(cells)
    except ValueError:
        return False


def is_robot_table(cells: Sequence[str]) -> bool:
    """Tell whether a table is a robot's by its first row: numbers alone, or names with a root's turn and joints."""
    if _are_numbers(cells):
        return len(cells) >= LEAST_COLUMNS
    roles = robot_roles(cells)
    degrees = sum(IN_DEGREES.fullmatch(name) is not None for name in cells) >= 3
    return bool(roles["joint"]) and (len(roles["turn"]) == 4 or degrees) and "survivor" not in cells


def _looks_like(given: GivenFile) -> bool:
    first = given.start.partition(b"\n")[0].decode("utf-8", "replace").lstrip("\ufeff")
    return is_robot_table(_cells(first))


ROBOT_CSV_FORMAT: Final = ConfigurationFormat(
    name="robot-csv",
    title="CSV of a robot's motion: the root's position and quaternion, and joints, with names or without",
    suffixes=(".csv",),
    looks_like=_looks_like,
    read=read_robot_csv,
)
