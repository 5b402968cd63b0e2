"""MOT: tables of joint angles, as OpenSim writes and plots them; see *Motion (.mot) Files* in its documentation.

A header (name, ``version=1``, ``nRows=``, ``nColumns=``, ``inDegrees=yes``, comments, ``endheader``), a line of column
names, then a row a frame, separated by tabs. Columns: ``time``; the place of the torso's origin, the neck, as
``torso_tx``, ``torso_ty``, ``torso_tz`` in metres; its rotation as ``torso_rz``, ``torso_ry``, ``torso_rx``; the 22
angles by the names of the figure's URDF joints. All angles are in degrees.

The torso's rotation is intrinsic z-y'-x'', yaw, pitch and roll of a body with x forward, y left and z up:

.. math:: R = R_z(r_z) R_y(r_y) R_x(r_x)

with :math:`r_y` in [-90, 90] and the other two unwrapped along the frames, so that they do not jump by a turn. At
:math:`|r_y| = 90` (the chest straight up or down) the two others turn about one axis, and :math:`r_x` is set to 0: the
rotation itself is kept in every case. Angles that are not known are ``nan``. The frame is that of q, the figure's
lengths are not in the file: keep its URDF beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.formats.motion.motion_checks import check_time, check_turns
from posekit.formats.motion.motion_format import MotionFormat
from posekit.formats.motion.number_rows import numbers_of
from posekit.geometry import Array, coordinate_rotation, quaternion_from_rotation, rotation_from_quaternion
from posekit.safe_io import nearest, one_line, read_text, refusal, shown, write_text

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.formats.motion.motion import Motion

MAX_BYTES: Final = 500_000_000
PLACE_COLUMNS: Final = ("torso_tx", "torso_ty", "torso_tz")
ROTATION_COLUMNS: Final = ("torso_rz", "torso_ry", "torso_rx")
_CHUNK: Final = 4096


def write_mot(path: str | Path, figure: Figure, q: Array, time: Array) -> None:
    """Write joint angles.

    Parameters
    ----------
    path : path
        The file to write, whole or not at all.
    figure : Figure
        The figure whose configurations they are.
    q : array (T, nq)
        In Pinocchio's order, metres, unit quaternions, radians; NaN where an angle is not known.
    time : array (T,)
        Seconds, ascending.

    Raises
    ------
    InputError
        Where shapes do not fit, a number is infinite, a quaternion is not of unit length, times do not ascend, or the
        file cannot be written.
    """
    q, time = checked_configurations(path, figure, q, time)
    names = ["time", *PLACE_COLUMNS, *ROTATION_COLUMNS, *figure.configuration_names[7:]]
    values = np.concatenate(
        [time[:, None], q[:, :3], np.degrees(_unwrapped(yaw_pitch_roll(q[:, 3:7]))), np.degrees(q[:, 7:])],
        axis=1,
    )
    write_text(path, _pieces(Path(path).stem, names, values))


def read_mot(path: str | Path, figure: Figure) -> tuple[Array, Array]:
    """Read joint angles that `write_mot` wrote, as q (T, nq) and the frames' times (T,), seconds.

    Parameters
    ----------
    path : path
        The file to read.
    figure : Figure
        Whose joints they are.

    Raises
    ------
    InputError
        Where the file is no MOT, is cut off, or has not all of the figure's angles.
    """
    names, values, degrees = _read_table(path)
    wanted = ["time", *PLACE_COLUMNS, *ROTATION_COLUMNS, *figure.configuration_names[7:]]
    missing = [name for name in wanted if name not in names]
    if missing:
        hint = nearest(missing[0], names)[:200]
        raise refusal(path, "columns", f"no {missing[0]}", f"the {len(wanted)} columns of the figure", hint)
    columns = values[:, [names.index(name) for name in wanted]]
    if degrees:
        columns[:, 4:] = np.radians(columns[:, 4:])
    q = np.concatenate([columns[:, 1:4], quaternions_of(columns[:, 4:7]), columns[:, 7:]], axis=1)
    return checked_configurations(path, figure, q, columns[:, 0])


def read_mot_motion(path: Path, unit: str | None = None) -> Motion:
    """Read joint angles as the motion of the built-in figure's points, z up: the file says angles and no lengths.

    Parameters
    ----------
    path : Path
        The file.
    unit : str, optional
        The place of the torso is in metres: any other is refused.

    Raises
    ------
    InputError
        Where the file is no MOT, is cut off, or has not all of the figure's angles.
    """
    from posekit.body import load_figure
    from posekit.formats.motion.figure_motion import figure_motion

    figure = load_figure()
    q, time = read_mot(path, figure)
    return figure_motion(path, figure, q, time, unit=unit, up="+z")


def yaw_pitch_roll(quaternions: Array) -> Array:
    """Turn unit quaternions (T, 4), x, y, z, w, into angles (T, 3) of R = R_z R_y R_x, radians."""
    R = rotation_from_quaternion(quaternions)
    forward, left_x, left_y, above_x, above_y = R[:, :, 0], R[:, 0, 1], R[:, 1, 1], R[:, 0, 2], R[:, 1, 2]
    level = np.hypot(forward[:, 0], forward[:, 1])
    # Straight up or down the first column says nothing of the yaw: all the turning about that axis counts as yaw.
    yaw = np.where(level < 1e-9, np.arctan2(-left_x, left_y), np.arctan2(forward[:, 1], forward[:, 0]))
    pitch = np.arctan2(-forward[:, 2], level)
    # The roll is what is left after that yaw, so that the three together are the rotation wherever the yaw is vague.
    cos, sin = np.cos(yaw), np.sin(yaw)
    roll = np.arctan2(sin * above_x - cos * above_y, cos * left_y - sin * left_x)
    return np.stack([yaw, pitch, roll], axis=-1)


def quaternions_of(angles: Array) -> Array:
    """Turn angles (T, 3) of R = R_z R_y R_x, radians, into unit quaternions (T, 4), x, y, z, w, with w >= 0."""
    yaw, pitch, roll = (coordinate_rotation(2 - k, angles[:, k]) for k in range(3))
    return quaternion_from_rotation(yaw @ pitch @ roll)


def checked_configurations(path: str | Path, figure: Figure, q: Array, time: Array) -> tuple[Array, Array]:
    """Refuse configurations that are none: shapes, infinite numbers, quaternions, times out of order."""
    q, time = np.asarray(q, dtype=np.float64), np.asarray(time, dtype=np.float64)
    if q.ndim != 2 or q.shape[1] != figure.model.nq or time.shape != (len(q),) or len(q) == 0:
        got = f"q of shape {q.shape}, time of shape {time.shape}"
        raise refusal(path, "q", got, f"(T, {figure.model.nq}) and (T,), T of one or more", "reshape them")
    if np.isinf(q).any():
        raise refusal(path, "q", "an infinite number", "finite numbers")
    check_turns(path, q)
    check_time(path, time, len(q))
    q = q.copy()
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1)[:, None]
    return q, time


def _unwrapped(angles: Array) -> Array:
    """Take out the jumps by a turn between known frames."""
    found = angles.copy()
    known = np.isfinite(angles).all(axis=1)
    found[known] = np.unwrap(angles[known], axis=0)
    return found


def _pieces(name: str, names: Sequence[str], values: Array) -> Iterator[str]:
    yield f"{one_line(name)}\nversion=1\nnRows={len(values)}\nnColumns={len(names)}\ninDegrees=yes\n\n"
    yield "Lengths are in metres, angles in degrees.\n"
    yield "The rotation of the torso is intrinsic z-y'-x'': R = Rz(torso_rz) Ry(torso_ry) Rx(torso_rx).\n"
    yield "\nendheader\n"
    yield "\t".join(names) + "\n"
    row = "\t".join(["%.12g"] * len(names)) + "\n"
    for start in range(0, len(values), _CHUNK):
        yield "".join(row % tuple(one) for one in values[start : start + _CHUNK].tolist())


def _read_table(path: str | Path) -> tuple[list[str], Array, bool]:
    """Return column names, values, and whether angles are in degrees."""
    lines = read_text(path, limit=MAX_BYTES, too_large="split it by frames").splitlines()
    end = next((k for k, line in enumerate(lines) if line.strip().casefold() == "endheader"), None)
    if end is None or end + 1 >= len(lines):
        raise refusal(
            path, "", "no endheader", "a MOT file, with endheader before its columns", "check the format"
        )
    fields = dict(line.replace(" ", "").split("=", 1) for line in lines[:end] if "=" in line)
    header = {name.casefold(): value.strip() for name, value in fields.items()}
    names = lines[end + 1].split("\t")
    names = [name.strip() for name in (names if len(names) > 1 else lines[end + 1].split())]
    body = [(k, line) for k, line in enumerate(lines[end + 2 :], end + 3) if line.strip()]
    for field, count in (("nrows", len(body)), ("ncolumns", len(names))):
        if field in header and header[field] != str(count):
            got = f"{count}, but the header says {shown(header[field])}"
            raise refusal(
                path, field, got, "as many as the header says", "the file is cut off, or correct it"
            )
    expected = f"{len(names)}, as there are names"
    values = numbers_of(path, body, lambda _, line: line.split(), len(names), expected)
    return names, values, header.get("indegrees", "yes").casefold() != "no"


MOT_FORMAT: Final = MotionFormat(
    name="mot",
    title="MOT, joint angles of OpenSim; read as those of the built-in figure",
    suffixes=(".mot", ".sto"),
    read=read_mot_motion,
    write_configurations=write_mot,
    looks_like=lambda given: b"endheader" in given.start,
)
