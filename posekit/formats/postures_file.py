"""Files of ``posekit.postures/1`` (postures as named points) and ``posekit.configurations/1`` (of a robot)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import refusal
from posekit.formats import json_file
from posekit.formats.json_file import nullable
from posekit.formats.node import Node, schema_of
from posekit.formats.options import Options
from posekit.formats.view_file import check_schema
from posekit.geometry import PER_METRE, UP_AXES, Array, from_metres, to_metres
from posekit.motion import Motion
from posekit.skeleton import HEAD_POINTS, JOINTS

POSTURES_SCHEMA: Final = "posekit.postures/1"
CONFIGURATIONS_SCHEMA: Final = "posekit.configurations/1"
FIELDS: Final = ("schema", "unit", "joint_names", "postures", "time", "up")
CONFIGURATION_FIELDS: Final = ("schema", "configuration_names", "q", "robot", "time", "up")


def looks_like(document: Any) -> bool:
    """Return whether a JSON document or NPZ arrays state one of the schemas."""
    return schema_of(document).startswith(("posekit.postures/", "posekit.configurations/"))


def read(document: Any, path: str | Path, options: Options) -> Motion:
    """Read postures. If neither times nor a rate are known, the postures are not successive in time.

    Parameters
    ----------
    document : dict
        JSON with ``postures`` (N x K x 3, null for an unknown point) and ``joint_names``, or with ``q`` (N x K) and
        ``configuration_names``; or NPZ with ``joints`` (N, K, 3) in metres and ``head`` (N, 5, 3), or with ``q``.
    path : path
        Path of the file.
    options : Options
        Options with the `rate` of a file without times, the axis `up`, and the robot (`urdf`) of configurations.

    Raises
    ------
    InputError
        If the document does not follow its schema.
    """
    root = Node(document, path)
    schema = check_schema(root, POSTURES_SCHEMA, CONFIGURATIONS_SCHEMA)
    shared: dict[str, Any] = {"source": str(path), "layout": schema, "up": options.up}
    if not options.up and root.has("up"):
        shared["up"] = root.at("up").text(UP_AXES)
    if schema == CONFIGURATIONS_SCHEMA:
        if isinstance(document.get("q"), list):
            root.object(CONFIGURATION_FIELDS)
        q = root.at("q").array(None, None, unknown=True)
        names = root.at("configuration_names", ()).texts()
        robot = options.urdf or root.at("robot", "").text()
        return Motion(q=q, q_names=names, robot=robot, time=_times(root, len(q), options), **shared)
    points, names = _arrays(root) if "joints" in root.object() else _postures(root)
    points[np.isnan(points).any(axis=-1)] = np.nan
    unit = root.at("unit").text(PER_METRE) if root.has("unit") and "postures" in root.value else "m"
    time = _times(root, len(points), options)
    return Motion(joints=points, joint_names=names, unit=unit, time=time, **shared)


def _times(root: Node, count: int, options: Options) -> Array | None:
    if root.has("time"):
        return root.at("time").array(count, unknown=True)
    rate = options.rate or (root.at("rate").positive() if root.has("rate") else None)
    return None if rate is None else np.arange(count) / rate


def _postures(root: Node) -> tuple[Array, tuple[str, ...]]:
    """Return the points of a JSON document, metres, and their names."""
    root.object(FIELDS)
    names, unit = root.at("joint_names").texts(), root.at("unit").text(PER_METRE)
    rows = list(root.at("postures").list())
    for row in rows:
        points = list(row.list())
        if len(points) != len(names):
            remedy = "write null for a joint that is not known"
            raise row.refused(f"{len(names)}, as there are joint_names", remedy, f"{len(points)} points")
    known = [[[np.nan] * 3 if point is None else point for point in row.value] for row in rows]
    values = Node(known, root.source, "postures").array(len(rows), len(names), 3, unknown=True)
    return to_metres(values, unit), names


def _arrays(root: Node) -> tuple[Array, tuple[str, ...]]:
    """Return the points of NPZ arrays, metres, and their names."""
    names = root.at("joint_names", JOINTS).texts()
    points = root.at("joints").array(None, len(names), 3, unknown=True)
    if root.has("head"):
        head = root.at("head").array(len(points), len(HEAD_POINTS), 3, unknown=True)
        points, names = np.concatenate([points, head], axis=1), (*names, *HEAD_POINTS)
    return points, names


def write(path: str | Path, motion: Motion, unit: str | None = None) -> None:
    """Write postures as JSON: named points, or the configurations of a motion that has no points.

    Parameters
    ----------
    path : path
        Path that ends in ``.json`` or ``.json.gz``.
    motion : Motion
        The postures.
    unit : "m", "cm" or "mm", optional
        Unit of length in the file; by default that of the motion's file.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    if len(motion.clips) > 1:
        remedy = "write csv or npz, or choose one"
        raise refusal(path, "", f"{len(motion.clips)} recordings", "one for JSON", remedy)
    shared: dict[str, Any] = {"up": motion.up} if motion.up else {}
    if np.isfinite(motion.time).any():  # type: ignore[arg-type]
        shared["time"] = nullable(motion.time)  # type: ignore[arg-type]
    if motion.joints is None:
        head: dict[str, Any] = {"schema": CONFIGURATIONS_SCHEMA, "robot": motion.robot}
        head |= {"configuration_names": list(motion.q_names)}
        kept = {name: value for name, value in head.items() if value}
        json_file.write(path, {**kept, **shared}, "q", nullable(np.asarray(motion.q)))
        return
    unit = unit or (motion.unit if motion.unit in PER_METRE else "m")
    head = {"schema": POSTURES_SCHEMA, "unit": unit, "joint_names": list(motion.joint_names), **shared}
    json_file.write(path, head, "postures", _rows(from_metres(motion.joints, unit)))


def _rows(points: Array) -> Iterator[list[Any]]:
    """Yield postures as lists, with null for an unknown point."""
    for posture in points:
        yield [None if np.isnan(point[0]) else point for point in posture.tolist()]
