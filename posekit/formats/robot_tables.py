"""Configurations of a robot over time, from arrays and tables of root position, root rotation and joint positions.

The layouts of kind ``robot-file`` in ``urdf/layouts`` define the meaning of arrays and columns. Configurations follow
Pinocchio's convention: x, y, z in metres, the unit quaternion qx, qy, qz, qw, joints in radians.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from posekit.errors import refusal, shown
from posekit.formats.body_checks import METRES, times
from posekit.formats.layout import Layout, by_order, load_layout
from posekit.formats.options import Options
from posekit.formats.tables import TIMES, Table, seconds
from posekit.geometry import (
    Array,
    coordinate_rotation,
    median_lean,
    quaternion_from_rotation,
    quaternion_rotate,
)
from posekit.geometry.units import FARTHEST_COORDINATE
from posekit.motion import Motion

X, Y, Z = np.eye(3)
ROOT_NAMES: Final = ("x", "y", "z", "qx", "qy", "qz", "qw")
RATES: Final = ("fps", "rate", "frame_rate", "framerate", "frequency", "mocap_framerate", "mocap_frame_rate")
COUNTS: Final = ("frame", "index", "frame#", "")
#: Layouts in the order in which they are tried; a simulator's file may also have arrays of the root.
LAYOUTS: Final = tuple(
    f"robot_{kind}" for kind in "pinocchio simulator arrays qpos loco_mujoco bones_seed columns rows".split()
)

#: Minimum difference between the median leans in two orders of a quaternion, degrees, for one order to be wrong.
LEAN_DEGREES: Final = 20.0
#: Difference between the median leans, degrees, below which the robot stands equally upright in both orders.
SAME_LEAN_DEGREES: Final = 1.0
#: Minimum length of the root's path along the ground, metres, for a comparison of path and heading.
TRAVEL_METRES: Final = 0.3
#: Minimum difference between the angles of heading and path in two orders, degrees, for one order to be chosen.
HEADING_DEGREES: Final = 60.0
#: Median lean in degrees above which a robot does not stand.
STANDING_DEGREES: Final = 60.0
#: Length below which a quaternion is unknown; deviations from length 1 above which there is a warning and an error.
ZERO_LENGTH, UNIT_LENGTH_ERROR, NO_QUATERNION = 1e-6, 0.01, 0.25
#: Number that 1 % of angles must exceed to be read as degrees; it is more than a full turn in radians.
DEGREES_FROM: Final = 7.0
#: For each unit, the median height of a root below which its position has this unit.
HEIGHTS: Final = {"m": 10.0, "cm": 300.0, "mm": np.inf}


def looks_like(document: Any) -> bool:
    """Return whether arrays or a table contain a robot's motion."""
    return _layout_of(_columns(document)) is not None


def _columns(document: Any) -> Mapping[str, Any]:
    """Return the arrays, or the columns of a table, by name; numbers without names have the key ``""``."""
    if not isinstance(document, Table):
        both = isinstance(document, Mapping) and getattr(document.get("joints"), "ndim", 0) == 3
        return document if isinstance(document, Mapping) and not both else {}
    if "schema" in document.about or document.names:
        return {} if "schema" in document.about else dict.fromkeys(document.names, document)
    wide = bool(document.lines) and len(document.parted(document.lines[0])) > len(ROOT_NAMES)
    return {"": document.numbers} if wide else {}


def _layout_of(columns: Mapping[str, Any]) -> Layout | None:
    return next((one for one in map(load_layout, LAYOUTS) if _fits(one.fields, columns)), None)


def _fits(parts: Mapping[str, Any], columns: Mapping[str, Any]) -> bool:
    if "whole" in parts:
        return _whole(parts, columns) is not None
    joints = parts["joints"]
    found = [_names(parts[part], columns) for part in ("position", "rotation")]
    return all(found) and ("arrays" not in joints or bool(_names(joints, columns)))


def _names(part: Mapping[str, Any], columns: Mapping[str, Any]) -> list[str]:
    """Return the names of the arrays or columns of a part (position, rotation or joints); empty if one is missing."""
    if "arrays" in part:  # the first known name
        return [name for name in part["arrays"] if getattr(columns.get(name), "ndim", 0) > 1][:1]
    if "each" in part:  # a name per coordinate
        return list(part["each"]) if set(part["each"]) <= set(columns) else []
    by_axis: dict[str, str] = {}
    for name in columns:
        if match := re.fullmatch(part["pattern"], name, re.IGNORECASE):
            by_axis.setdefault(match[1].lower(), name)
    return [by_axis[axis] for axis in part["axes"]] if set(part["axes"]) <= set(by_axis) else []


def _labels(parts: Mapping[str, Any], columns: Mapping[str, Any]) -> tuple[str, ...]:
    names = next((columns[one] for one in parts["joints"].get("labels", ()) if one in columns), ())
    return tuple(_joint_name(str(one)) for one in np.ravel(names))


def _whole(parts: Mapping[str, Any], columns: Mapping[str, Any]) -> str | None:
    """Return the name of the array with root and joints; it has 7 columns more than the file has joint names."""
    wide = len(_labels(parts, columns)) + len(ROOT_NAMES)
    for name in parts["whole"]["arrays"]:
        values: Any = columns.get(name)
        posture = np.shape(values)[1:] == (3,) and by_order(len(values))  # the joints of one posture
        sure = name in parts["whole"].get("sure", ("",)) and not posture
        if isinstance(values, np.ndarray) and values.ndim == 2 and (sure or values.shape[1] == wide):
            return str(name)
    return None


def read(document: Any, path: str, options: Options) -> Motion:
    """Read a robot's motion.

    Raises
    ------
    InputError
        If arrays are missing or have wrong shapes, or a quaternion is not a unit quaternion.
    """
    columns = _columns(document)
    if isinstance(document, Table) and "" in columns:
        columns = _without_counter(columns[""], options)
    if options.urdf and isinstance(document, Table) and _layout_of(columns) is None:
        columns = _joints_alone(document)
    about = document.about if isinstance(document, Table) else columns
    layout, order = _stated_layout(columns, path, options)
    time, rate = time_and_rate(columns)
    parts = layout.fields
    whole = "whole" in parts
    place, turn, joints, labels = (
        _of_whole(parts, columns) if whole else _of_parts(parts, columns, path, options)
    )
    if labels and len(labels) != joints.shape[1]:
        got = f"{len(labels)} names"
        raise refusal(path, "joint names", got, f"{joints.shape[1]}, one per joint", "correct the file")
    if any((np.abs(values) > FARTHEST_COORDINATE).any() for values in (place, turn, joints)):
        raise refusal(path, "", "a number too large", f"numbers below {FARTHEST_COORDINATE:g}")
    up = options.up or str(about.get("up", ""))
    if place.shape[1]:
        joints = _radians(joints, parts["joints"].get("unit", ""), options)
        how = parts.get("rotation", parts.get("whole", {}))
        if turn.shape[1] == 3:
            turn, how = _euler(turn, how), {"order": "xyzw"}
        turn, up = root_quaternion(turn, how.get("order", ""), place, up, path, options)
        place = _metres(place, options.unit or parts.get("position", {}).get("unit", ""), up, options)
    labels = _named(labels, joints.shape[1], order or _order(parts, columns, joints.shape[1]), options)
    robot = options.urdf or str(about.get("robot", "")) or _robot_of(labels)
    if not robot:
        options.note("the file does not name the robot (--urdf)")
    return Motion(
        q=np.hstack([place, turn, joints]),
        q_names=(*(ROOT_NAMES if place.shape[1] else ()), *labels) if labels else (),
        robot=robot,
        time=times(len(joints), time, rate, options),
        up=up,
        source=path,
        layout=layout.name,
        notes=options.notes,
        warnings=options.warnings,
    )


def _stated_layout(columns: Mapping[str, Any], path: str, options: Options) -> tuple[Layout, str]:
    """Return the layout of the file's arrays, and the name of the joint order that the user states."""
    stated = load_layout(options.layout) if options.layout else None
    if stated is not None and stated.kind not in ("robot-file", "robot"):
        raise refusal(path, "layout", shown(options.layout), "a layout of a robot", "choose another layout")
    own = stated if stated is not None and stated.kind == "robot-file" else _layout_of(columns)
    if own is None or not _fits(own.fields, columns):
        expected = "a root's place and rotation, and joints"
        raise refusal(path, "", "no robot's motion", expected, "check the file")
    return own, options.layout if stated is not None and stated is not own else ""


def _joints_alone(table: Table) -> dict[str, Any]:
    """Return the columns of a robot on a fixed base: its joints q (T, K), their names, and the times."""
    times = {name: table for name in table.names if name.lower() in TIMES}
    joints = [name for name in table.names if name.lower() not in (*TIMES, *COUNTS)]
    q = np.stack([table.checked(name) for name in joints], axis=1) if joints else table.numbers
    return {"q": q, "q_names": [_joint_name(name) for name in joints], **times}


def _without_counter(values: Array, options: Options) -> dict[str, Array]:
    """Return rows of position, quaternion and joints without the leading column of frame numbers or seconds."""
    first, whole = values[:, 0], values[np.isfinite(values).all(axis=1)]
    even = len(first) > 2 and first[0] == 0 and np.allclose(np.diff(first), first[1], rtol=1e-3, atol=2e-6)
    if not even or not first[1] > 0 or not len(whole):
        return {"": values}
    off = [np.median(np.abs(np.linalg.norm(whole[:, k : k + 4], axis=1) - 1)) for k in (3, 4)]
    if off[0] <= UNIT_LENGTH_ERROR or off[1] >= NO_QUATERNION:
        return {"": values}
    counts = first[1] % 1 == 0
    options.note(f"the first column is {'frame numbers' if counts else 'seconds'}")
    return {"": values[:, 1:]} if counts else {"": values[:, 1:], "time": first}


def _of_whole(
    parts: Mapping[str, Any], columns: Mapping[str, Any]
) -> tuple[Array, Array, Array, tuple[str, ...]]:
    """Split rows into position, quaternion, joints and joint names; rows of a fixed base are joints only."""
    labels, root = _labels(parts, columns), len(ROOT_NAMES)
    values = np.asarray(columns[_whole(parts, columns) or ""], dtype=np.float64)
    if labels[:root] == ROOT_NAMES:
        labels = labels[root:]
    elif values.shape[1] <= root or ("" not in parts["whole"]["arrays"] and "q" in columns):
        return values[:, :0], values[:, :0], values, labels
    return values[:, :3], values[:, 3:root], values[:, root:], labels


def _of_parts(
    parts: Mapping[str, Any], columns: Mapping[str, Any], path: str, options: Options
) -> tuple[Array, Array, Array, tuple[str, ...]]:
    """Return the root's position (T, 3), its rotation (T, 3 or 4), the joints (T, K) and their names."""
    joint_part, labels = parts["joints"], _labels(parts, columns)
    names = {part: _names(parts[part], columns) for part in ("position", "rotation")}
    if "arrays" in joint_part:
        joints = _stacked(columns, _names(joint_part, columns))
    else:
        prefix, used = joint_part.get("prefix", ""), {*names["position"], *names["rotation"]}
        own = [one for one in columns if one.startswith(prefix) and one not in used]
        own = [one for one in own if one.lower() not in (*TIMES, *COUNTS)]
        stripped = [_joint_name(one.removeprefix(prefix)) for one in own]
        signs = [joint_part.get("signs", {}).get(one, 1.0) for one in stripped]
        joints = _stacked(columns, own) * np.array(signs)
        labels = tuple(joint_part.get("renamed", {}).get(one, one) for one in stripped)
    place, turn = (_stacked(columns, names[part]) for part in ("position", "rotation"))
    if place.ndim == turn.ndim == 3:  # poses of all bodies, the root first
        root = int([str(one) for one in np.ravel(columns.get("body_names", ()))][:1] == ["world"])
        place, turn = place[:, root], turn[:, root]
    if labels and len(labels) + len(ROOT_NAMES) == joints.shape[-1]:
        options.note("the array of joints starts with the root's position and quaternion")
        place, turn, joints = joints[:, :3], joints[:, 3:7], joints[:, 7:]
    count = len(joints)
    fits = joints.ndim == 2 and place.shape == (count, 3) and turn.shape in ((count, 4), (count, 3))
    if not fits:
        got = f"shapes {place.shape}, {turn.shape}, {joints.shape}"
        raise refusal(path, "root and joints", got, "(T, 3), (T, 4), (T, K)", "correct the file")
    return place + np.array(parts["position"].get("offset", 0.0)), turn, joints, labels


def _stacked(columns: Mapping[str, Any], names: Sequence[str]) -> Array:
    """Return one array, or columns concatenated to an array (T, K)."""
    found = [_value(columns, name) for name in names]
    return found[0] if len(found) == 1 and found[0].ndim > 1 else np.stack(found, axis=1)


def _value(columns: Mapping[str, Any], name: str) -> Array:
    values = columns[name]
    with np.errstate(invalid="ignore"):
        return values.checked(name) if isinstance(values, Table) else np.asarray(values, dtype=np.float64)


def _joint_name(name: str) -> str:
    """Remove prefix, suffix and unit from a column's name: ``dof_elbow(rad)`` and ``elbow_dof`` become ``elbow``."""
    return re.sub(r"^dof_|_dof$|_pos$", "", re.sub(r"\s*[(\[](rad|deg)[)\]]$", "", name.strip()))


def time_and_rate(columns: Mapping[str, Any]) -> tuple[Array | None, float | None]:
    """Return the file's times (T,) and rate; None for a missing value."""
    name = next((name for name in columns if name.lower() in TIMES), None)
    key = next((name for name in RATES if name in columns), None)
    rate = np.empty(0) if key is None else np.ravel(_value(columns, key))
    time = None if name is None else seconds(name, np.ravel(_value(columns, name)))
    return time, float(rate[0]) if rate.size else None


def _order(parts: Mapping[str, Any], columns: Mapping[str, Any], count: int) -> str:
    """Return the name of the layout that orders unnamed joints: breadth-first, as in simulators, or depth-first.

    In breadth-first order, the two bodies after the root are the left and right hip, equally far from the root.
    """
    order = str(parts["joints"].get("orders", {}).get(str(count), ""))
    bodies = np.asarray(columns.get("body_pos_w", ()))
    if order.endswith("_isaac") and bodies.ndim == 3 and bodies.shape[1] > 2:
        first, second = (np.median(np.linalg.norm(bodies[:, k] - bodies[:, 0], axis=1)) for k in (1, 2))
        if first > 0 and abs(first - second) > 0.05 * first:
            return order.removesuffix("_isaac")
    return order


def _named(labels: tuple[str, ...], count: int, order: str, options: Options) -> tuple[str, ...]:
    """Return the names of the joints: from the file, or else from the layout that states their order."""
    names = load_layout(order).fields["joints"] if order and not labels else ()
    if len(names) == count and (not options.urdf or "g1" in options.urdf.lower() or options.layout):
        options.note(f"{len(names)} joints are in the order of {order}, unnamed in the file (--layout)")
        return tuple(names)
    if not labels:
        options.note("joints are in the robot's own order: the file does not name them")
    return labels


def _robot_of(labels: Sequence[str]) -> str:
    known = load_layout("g1_29").fields["joints"]
    return "g1" if labels and set(labels) <= set(known) else ""


def _radians(joints: Array, unit: str, options: Options) -> Array:
    known = np.abs(joints[np.isfinite(joints)])
    if not unit and len(known) and np.percentile(known, 99) > DEGREES_FROM:
        options.note(f"joints are in degrees: values reach {known.max():.4g}")
        unit = "deg"
    return np.radians(joints) if unit == "deg" else joints


def _metres(place: Array, unit: str, up: str, options: Options) -> Array:
    """Convert the root's position to metres; its height shows whether the file's unit is centimetres or millimetres."""
    heights = np.abs(place[:, "xyz".index(up[1])])
    height = float(np.nanmedian(heights)) if np.isfinite(heights).any() else 0.0
    found = next(name for name, most in HEIGHTS.items() if height < most or name == "mm")
    if not unit and found != "m":
        options.note(f"the root's position is in {found}: its height is {height:.4g}")
    return place * METRES[unit or found]


def _euler(angles: Array, part: Mapping[str, Any]) -> Array:
    """Return quaternions (T, 4) from intrinsic Euler angles (T, 3) about the axes that a layout names."""
    angles = angles * np.array(part.get("signs", (1.0, 1.0, 1.0)))
    angles = np.radians(angles) if part.get("unit") == "deg" else angles
    R = np.eye(3)
    for k, axis in enumerate(part["euler"]):
        R = R @ coordinate_rotation("xyz".index(axis), angles[:, k])
    return quaternion_from_rotation(R)


def root_quaternion(
    values: Array, order: str, place: Array, up: str, source: str, options: Options
) -> tuple[Array, str]:
    """Convert quaternions to the order x, y, z, w, and find the axis along which the robot stands.

    If no order is stated, both orders are compared: first by how upright the robot stands, then by whether it heads in
    its direction of travel (its x axis points forward). If neither decides, the order is x, y, z, w by convention.
    Continuity over time cannot decide, because rotations between frames have the same angles in both orders.

    Parameters
    ----------
    values : array (T, 4)
        Quaternions in the order of the file.
    order : str
        ``xyzw`` or ``wxyz``; empty if the file does not state it.
    place : array (T, 3)
        Position of the root in the world.
    up : str
        Axis that points up, if stated.

    Returns
    -------
    q : array (T, 4)
        Unit quaternions x, y, z, w; NaN where the file has zeros.
    up : str
        Stated up axis, or else the axis along which the robot stands.
    """
    length = np.linalg.norm(values, axis=1)
    zero = length <= ZERO_LENGTH
    off = np.where(zero | np.isnan(length), 0.0, np.abs(length - 1))
    if off.max(initial=0.0) > NO_QUATERNION:
        frame = int(np.argmax(off))
        got = f"a quaternion of length {length[frame]:.4g}"
        raise refusal(source, f"rotation[{frame}]", got, "1", "give quaternions x, y, z, w or w, x, y, z")
    if off.max(initial=0.0) > UNIT_LENGTH_ERROR:
        options.warn(f"lengths of quaternions differ from 1 by up to {off.max():.1%}: they are normalized")
    if zero.any():
        options.warn(f"the quaternion is zero in {zero.sum()} of {len(zero)} frames: no rotation is known")
    values = values / np.where(zero, np.nan, length)[:, None]
    known = np.isfinite(values).all(axis=1)
    if not known.any():
        return values, up or "+z"
    both = {"xyzw": values, "wxyz": values[:, [1, 2, 3, 0]]}
    order = order or _likely({name: q[known] for name, q in both.items()}, place[known], options)
    return both[order], _standing(both[order][known], up, options)


def _likely(both: Mapping[str, Array], place: Array, options: Options) -> str:
    """Return the order of quaternions in which the robot leans less or, if that is equal, heads along its path."""
    lean = {name: min(median_lean(q, Z), median_lean(q, Y)) for name, q in both.items()}
    first, second = sorted(lean, key=lambda name: (lean[name], name != "xyzw"))
    off = {name: _off_heading(q, place) for name, q in both.items()}
    ahead, other = sorted(off, key=lambda name: off[name])
    reading = "the root's quaternion is read as"
    if lean[second] - lean[first] <= LEAN_DEGREES and off[other] - off[ahead] > HEADING_DEGREES:
        (options.note if ahead == first else options.warn)(
            f"{reading} {', '.join(ahead)}: the robot stands in both orders; it heads {off[ahead]:.0f} degrees off "
            f"its path in this order, {off[other]:.0f} in the other"
        )
        return ahead
    if lean[second] - lean[first] > SAME_LEAN_DEGREES:
        by = f"the robot leans {lean[first]:.0f} degrees in this order, {lean[second]:.0f} in the other"
        options.note(f"{reading} {', '.join(first)}: {by}")
        return first
    options.note(f"{reading} x, y, z, w, by convention: the robot stands upright with both orders")
    return "xyzw"


def _off_heading(q: Array, place: Array) -> float:
    """Return the median angle between heading and direction of travel, degrees; 0 if the robot hardly travels."""
    steps = np.diff(place[:, :2], axis=0)
    moved = np.linalg.norm(steps, axis=1)
    if not np.nansum(moved) > TRAVEL_METRES:
        return 0.0
    heading = quaternion_rotate(q, np.tile([1.0, 0.0, 0.0], (len(q), 1)))[:-1, :2]
    cosine = (heading * steps).sum(axis=1) / np.maximum(moved * np.linalg.norm(heading, axis=1), 1e-12)
    return float(np.degrees(np.arccos(np.clip(np.median(cosine[moved > 0.2 * np.nanmax(moved)]), -1, 1))))


def _standing(q: Array, stated: str, options: Options) -> str:
    """Return the stated up axis, or the axis along which the robot stands in most frames; +z if it does not stand."""
    for axis, name in ((Z, "+z"), (Y, "+y"), (X, "+x")):
        if median_lean(q, axis) < STANDING_DEGREES:
            if name != (stated or "+z"):
                options.warn(f"the robot stands along {name}: this axis is up, or the robot lies (--up)")
            return stated or name
    how = "upside down" if median_lean(q, Z) > 180 - STANDING_DEGREES else "lying"
    options.warn(f"the robot is {how} in most frames: check the quaternion's order and the up axis")
    return stated or "+z"
