"""Read and write ``posekit.postures/1``, JSON or NPZ; results are read as the postures they hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.display.pictured import Pictured
from posekit.display.stick_drawing import posture_drawing
from posekit.formats.own.npz import suffix, write_npz
from posekit.formats.own.postures_schema import POSTURES_SCHEMA, PosturesFile
from posekit.formats.own.result import RESULT_SCHEMAS, Result
from posekit.formats.own.result_json import result_of
from posekit.formats.own.result_npz import MAX_PADDED, result_in
from posekit.formats.own.units import FARTHEST_COORDINATE, Unit, from_metres, to_metres
from posekit.safe_io.json_file import read_json
from posekit.safe_io.npz_file import MAX_ARRAYS, Archive, not_finite, open_npz
from posekit.safe_io.refusal import nearest, refusal, shown
from posekit.safe_io.writing import json_pieces, replacing, write_text
from posekit.skeleton import HEAD_POINTS, JOINTS, POINT, POINTS
from posekit.tables.file_model import validated

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Postures(Pictured):
    """Postures to be judged, drawn or converted.

    Parameters
    ----------
    joints : array (N, 14, 3)
        In tree order, metres; NaN where a joint is not known.
    head : array (N, 5, 3), optional
        The head's points in the order of `posekit.skeleton.HEAD_POINTS`, metres.
    """

    joints: Array
    head: Array | None = None

    def __post_init__(self) -> None:
        for name, given, points in (("joints", self.joints, JOINTS), ("head", self.head, HEAD_POINTS)):
            if given is None:
                continue
            values = np.array(given, dtype=np.float64)
            shape = (len(self.joints), len(points), 3)
            if values.shape != shape:
                raise refusal("postures", name, f"shape {values.shape}", f"shape {shape}", "reshape it")
            check_points("postures", name, values)
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def _drawing(self) -> str:
        return posture_drawing(self.joints[:1], np.array([0.0, 0.0, 1.0]))


def read_postures(path: str | Path) -> Postures:
    """Read postures.

    Parameters
    ----------
    path : path
        JSON of schema ``posekit.postures/1``; or an NPZ with ``joints`` (N, K, 3) in metres, ``joint_names``
        (K,) where they are not the 14 in tree order, and ``head`` (N, 5, 3) where it is known; or a result,
        JSON or NPZ, whose survivors of all frames are read.

    Returns
    -------
    Postures
        In tree order whatever the file's order; a joint that the file does not name is NaN.

    Raises
    ------
    InputError
        Where the file breaks its schema, is damaged, or would take more than 1 GB of memory.
    """
    if suffix(path, ".json", ".npz") == ".npz":
        return _read_npz(path)
    document = read_json(path)
    if isinstance(document, dict) and document.get("schema") in RESULT_SCHEMAS:
        return _survivors(result_of(document, path))
    file = validated(PosturesFile, document, path)
    names = file.joint_names
    for index, posture in enumerate(file.postures):
        if len(posture) != len(names):
            raise refusal(
                path,
                f"postures[{index}]",
                f"{len(posture)} points",
                f"{len(names)}, as there are joint_names",
                "write null for a joint that is not known",
            )
    unknown = [None] * 3
    rows = [[unknown if point is None else point for point in posture] for posture in file.postures]
    values = to_metres(rows, file.unit).reshape(len(rows), len(names), 3)
    check_points(path, "postures", values)
    return _in_tree_order(values, names)


def write_postures(path: str | Path, postures: Postures | Array, unit: Unit = "m") -> None:
    """Write postures, whole or not at all.

    Parameters
    ----------
    path : path
        ``.json`` or ``.npz``.
    postures : Postures or array (N, 14, 3)
        Metres; NaN where a joint is not known.
    unit : "m", "cm" or "mm"
        The unit of a JSON file; an NPZ is in metres always.

    Raises
    ------
    InputError
        Where a shape is wrong, a number infinite, or the file cannot be written.
    """
    given = postures if isinstance(postures, Postures) else Postures(joints=postures)
    if suffix(path, ".json", ".npz") == ".npz":
        arrays = {
            "schema": np.array(POSTURES_SCHEMA),
            "joint_names": np.array(JOINTS),
            "joints": given.joints,
        }
        with replacing(path) as file:
            write_npz(file, arrays if given.head is None else {**arrays, "head": given.head})
        return
    names = JOINTS if given.head is None else POINTS
    head = {"schema": POSTURES_SCHEMA, "unit": unit, "joint_names": list(names)}
    points = given.joints if given.head is None else np.concatenate([given.joints, given.head], axis=1)
    write_text(path, json_pieces(head, "postures", _listed(from_metres(points, unit))))


def check_points(source: str | Path, name: str, values: NDArray[Any]) -> None:
    """Refuse coordinates that are infinite or too far, and points (..., 3) of which only a part is known."""
    if np.isinf(values).any():
        raise not_finite(source, name, values)
    far = values[np.abs(values) > FARTHEST_COORDINATE]
    if len(far):
        raise refusal(
            source,
            name,
            f"{float(far[0]):.3g} m",
            f"coordinates within {FARTHEST_COORDINATE:g} m",
            "check the unit",
        )
    unknown = np.isnan(values)
    partly = unknown.any(axis=-1) & ~unknown.all(axis=-1)
    if partly.any():
        where = ", ".join(str(int(index)) for index in np.argwhere(partly)[0])
        raise refusal(
            source,
            f"{name}[{where}]",
            "a point that is known in part",
            "three coordinates",
            "make the whole point null (NaN in NPZ) where it is not known",
        )


def _read_npz(path: str | Path) -> Postures:
    with open_npz(path, limit=MAX_PADDED) as archive:
        if "schema" in archive.names:
            schema = str(archive.array("schema", "U", ()))
            if schema in RESULT_SCHEMAS:
                return _survivors(result_in(archive))
            if schema != POSTURES_SCHEMA:
                raise refusal(
                    path, "schema", shown(schema), f'"{POSTURES_SCHEMA}"', "give a file of this schema"
                )
        archive.check_held(MAX_ARRAYS)
        names = _names(archive)
        joints = _coordinates(archive, "joints", len(names))
        postures = _in_tree_order(joints, names)
        if "head" not in archive.names:
            return postures
        if postures.head is not None:
            raise refusal(path, "head", "the head twice", "it in head or in joints", "remove one of the two")
        head = _coordinates(archive, "head", len(HEAD_POINTS))
        if len(head) != len(joints):
            raise refusal(
                path, "head", f"{len(head)} postures", f"{len(joints)}, as in joints", "write both again"
            )
        return Postures(joints=postures.joints, head=head)


def _names(archive: Archive) -> list[str]:
    if "joint_names" not in archive.names:
        return list(JOINTS)
    names: list[str] = archive.array("joint_names", "U", (None,)).tolist()
    for index, name in enumerate(names):
        if name not in POINTS:
            where = f"joint_names[{index}]"
            raise refusal(archive.path, where, shown(name), "the name of a joint", nearest(name, POINTS))
    if len(set(names)) != len(names):
        raise refusal(archive.path, "joint_names", "a name twice", "each joint once", "remove one of the two")
    return names


def _coordinates(archive: Archive, name: str, points: int) -> Array:
    values = archive.array(name, "f", (None, points, 3)).astype(np.float64)
    check_points(archive.path, name, values)
    return values


def _in_tree_order(values: Array, names: Sequence[str]) -> Postures:
    """Put points (N, K, 3) into their places; the others are NaN."""
    points = np.full((len(values), len(POINTS), 3), np.nan)
    points[:, [POINT[name] for name in names]] = values
    joints, head = points[:, : len(JOINTS)], points[:, len(JOINTS) :]
    return Postures(joints=joints, head=head if set(names) & set(HEAD_POINTS) else None)


def _survivors(result: Result) -> Postures:
    return Postures(joints=np.concatenate([frame.joints for frame in result.frames]))


def _listed(points: Array) -> Iterator[list[Any]]:
    """Yield postures as lists, with null for a point that is not known."""
    for posture in points:
        yield [None if point[0] != point[0] else point for point in posture.tolist()]
