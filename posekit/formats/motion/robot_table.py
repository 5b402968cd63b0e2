"""Configurations of a robot over time as curators keep them in NPZ: the root's place and turn, and joints.

NPZ, by the names of its arrays: the root's position ``root_pos``, ``root_trans`` and the like (T, 3); its quaternion
``root_rot``, ``root_ori``, ``root_quat`` (T, 4), x, y, z, w or w, x, y, z as its name says (``root_rot_wxyz``) or as
the robot stands; joints ``dof_pos``, ``dof``, ``joint_pos`` (T, K), with their names in ``dof_names`` or
``joint_names``; ``fps`` or ``time``. Or as simulators record it, ``body_positions`` and ``body_rotations`` (T, B, ...)
with ``body_names``, whose first is the root and whose quaternions are w, x, y, z (Isaac Lab's motion files). Or
``qpos`` (T, 7 + K), MuJoCo's, w first.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.formats.motion.array_names import (
    BODY_ARRAYS,
    JOINT_ANGLES,
    JOINT_NAMES,
    RATE_NAMES,
    ROOT_PLACES,
    ROOT_TURNS_IN_ORDER,
    holds_robot,
)
from posekit.formats.motion.configuration_format import ConfigurationFormat
from posekit.formats.motion.root_turn import QUATERNION_ORDERS, root_turn
from posekit.formats.own.postures_q import ROOT_NAMES, NamedConfigurations
from posekit.formats.own.units import FARTHEST_COORDINATE
from posekit.geometry import Array
from posekit.safe_io import cut, open_npz, refusal

MAX_BYTES: Final = 1_000_000_000


class RobotColumns(NamedTuple):
    """A table as it is read: places (T, 3), turns (T, 4) and their order and name, joints (T, K), names, times."""

    place: Array
    turn: Array
    order: str
    turn_name: str
    joints: Array
    names: tuple[str, ...]
    time: Array
    said: tuple[str, ...] = ()


def read_robot_npz(path: Path) -> NamedConfigurations:
    """Read an NPZ of a robot's configurations.

    Parameters
    ----------
    path : Path
        The file to read.

    Raises
    ------
    InputError
        Where arrays are missing or of other shapes, hold pickles or infinite numbers, or the order of quaternions or
        joints cannot be told.
    """
    wanted = (
        *ROOT_PLACES,
        *ROOT_TURNS_IN_ORDER,
        *JOINT_ANGLES,
        *JOINT_NAMES,
        *RATE_NAMES,
        "time",
        "qpos",
        "body_names",
    )
    with open_npz(path, limit=MAX_BYTES) as archive:
        names = [*wanted, *(name for pair in BODY_ARRAYS for name in pair)]
        arrays = {name: archive.array(name, "iufU", None) for name in names if name in archive.names}
    return configurations_of_columns(_of_arrays(path, arrays), str(path))


def configurations_of_columns(columns: RobotColumns, source: str) -> NamedConfigurations:
    """Lay a table's columns into configurations.

    Parameters
    ----------
    columns : RobotColumns
        As they were read.
    source : str
        What to call them in errors.

    Raises
    ------
    InputError
        Where a number is infinite, or a quaternion is none.
    """
    for name, values in (
        ("root", columns.place),
        (columns.turn_name, columns.turn),
        ("joints", columns.joints),
        ("time", columns.time),
    ):
        if (np.abs(values) > FARTHEST_COORDINATE).any():
            got = f"{float(values[np.abs(values) > FARTHEST_COORDINATE][0]):g}"
            raise refusal(source, name, got, f"finite numbers below {FARTHEST_COORDINATE:g}", "correct it")
    turn = root_turn(columns.turn, columns.order, source, columns.turn_name)
    said = [*columns.said, turn.said]
    if not columns.names:
        said.append("joints are taken in the robot's own order, for the file does not name them")
    if not np.isfinite(columns.time).any():
        said.append("the file says no times, and no frame rate that is above 0 (--rate)")
    return NamedConfigurations(
        q=np.concatenate([columns.place, turn.quaternion, columns.joints], axis=1),
        names=(*ROOT_NAMES, *columns.names) if columns.names else None,
        source=source,
        time=columns.time,
        said=tuple(filter(None, said)),
    )


def _of_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> RobotColumns:
    names = _names(path, arrays)
    if "qpos" in arrays:
        qpos = _numbers(path, arrays, "qpos", (None, None))
        if qpos.shape[1] < len(ROOT_NAMES):
            raise _wrong(path, "qpos", f"{qpos.shape[1]} numbers a frame", "7 of the root, then the joints")
        place, turn, joints = qpos[:, :3], qpos[:, 3:7], qpos[:, 7:]
        order, turn_name = "wxyz", "qpos[3:7]"
    else:
        joints = _numbers(path, arrays, _first(path, arrays, JOINT_ANGLES), (None, None))
        place, turn, order, turn_name = _root(path, arrays, len(joints), bool(names))
    if names and len(names) != joints.shape[1]:
        raise _wrong(path, "joint names", f"{len(names)} names", f"{joints.shape[1]}, one a joint")
    return RobotColumns(place, turn, order, turn_name, joints, names, _time(path, arrays, len(joints)))


def _root(
    path: Path, arrays: Mapping[str, NDArray[Any]], frames: int, named: bool
) -> tuple[Array, Array, str, str]:
    """Return the root's place and turn, the turn's order, and its name."""
    for places, turns in BODY_ARRAYS:
        if places in arrays and turns in arrays:
            if not named:
                got = "joints without names, in the order of a simulator"
                raise _wrong(path, "joint_names", got, "a name a joint: joint_names or dof_names")
            place = _numbers(path, arrays, places, (frames, None, 3))
            turn = _numbers(path, arrays, turns, (frames, place.shape[1], 4))
            if not place.shape[1]:
                raise _wrong(path, places, "no body", "the root first")
            return place[:, 0], turn[:, 0], "wxyz", turns
    place = _numbers(path, arrays, _first(path, arrays, ROOT_PLACES), (frames, 3))
    turn_name = _first(path, arrays, ROOT_TURNS_IN_ORDER)
    order = next((one for one in QUATERNION_ORDERS if turn_name.endswith(one)), "")
    return place, _numbers(path, arrays, turn_name, (frames, 4)), order, turn_name


def _names(path: Path, arrays: Mapping[str, NDArray[Any]]) -> tuple[str, ...]:
    found = next((arrays[name] for name in JOINT_NAMES if name in arrays), None)
    if found is None:
        return ()
    if found.dtype.kind != "U" or found.ndim != 1 or len(set(found.tolist())) != len(found):
        raise _wrong(
            path, "joint names", f"{found.dtype} of shape {found.shape}", "text (K,), each name once"
        )
    return tuple(joint_name(str(name)) for name in found)


def _time(path: Path, arrays: Mapping[str, NDArray[Any]], frames: int) -> Array:
    if "time" in arrays:
        return _numbers(path, arrays, "time", (frames,))
    key = next((name for name in RATE_NAMES if name in arrays), None)
    if key is None:
        return np.full(frames, np.nan)
    if arrays[key].dtype.kind not in "iuf" or arrays[key].size != 1:
        raise _wrong(path, key, f"{arrays[key].dtype} of shape {arrays[key].shape}", "one number")
    rate = float(arrays[key].reshape(-1)[0])
    return np.arange(frames) / rate if 0 < rate < np.inf else np.full(frames, np.nan)


def _first(path: Path, arrays: Mapping[str, NDArray[Any]], names: tuple[str, ...]) -> str:
    found = [name for name in names if name in arrays]
    if len(found) != 1:
        got = f"{' and '.join(found)}, two of one thing" if found else "nothing"
        raise _wrong(path, names[0], got, f"one of {', '.join(names)}")
    return found[0]


def _numbers(
    path: Path, arrays: Mapping[str, NDArray[Any]], name: str, shape: tuple[int | None, ...]
) -> Array:
    found = arrays[name]
    fits = len(found.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, found.shape, strict=True)
    )
    if not fits or found.dtype.kind not in "iuf":
        wanted = ", ".join("any" if extent is None else str(extent) for extent in shape)
        raise _wrong(path, name, f"{found.dtype} of shape {found.shape}", f"numbers ({wanted})")
    return found.astype(np.float64)


def joint_name(name: str) -> str:
    """Take from a column's name what is no part of the joint's: ``dof_elbow(rad)``, ``elbow_dof`` are ``elbow``."""
    return re.sub(r"^dof_|\s*[(\[]rad[)\]]$|_dof$|_pos$", "", re.sub(r"\s*[(\[]rad[)\]]$", "", name.strip()))


def _wrong(path: Path, field: str, got: str, expected: str) -> InputError:
    return refusal(path, field, cut(got), expected, "correct the file")


ROBOT_NPZ_FORMAT: Final = ConfigurationFormat(
    name="robot-npz",
    title="NPZ of a robot's motion: root_pos, root_rot, dof_pos, fps, and the like",
    suffixes=(".npz",),
    looks_like=lambda given: holds_robot(given.arrays),
    read=read_robot_npz,
)
