"""``posekit.result/1`` as JSON: NaN becomes null, lengths are in the file's unit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.family import Family
from posekit.formats.own.inferred import Inferred
from posekit.formats.own.likelihoods import Likelihoods
from posekit.formats.own.paths import FollowedPaths
from posekit.formats.own.reading import read_json
from posekit.formats.own.result import Result, ResultFrame
from posekit.formats.own.result_schema import (
    SCHEMA,
    ResultFile,
    ResultFrameFields,
    ResultPaths,
    ResultPosture,
)
from posekit.formats.own.root import Root
from posekit.formats.own.units import PER_METRE, Unit, from_metres, to_metres
from posekit.formats.own.validation import validated
from posekit.safe_io.refusal import refusal
from posekit.safe_io.writing import json_pieces, write_text

Array = NDArray[np.float64]

_KINDS: Final = {"survivor": int, "interpolated": bool}


def read_result_json(path: str | Path) -> Result:
    """Read a result from JSON; see `posekit.formats.own.read_result`."""
    return result_of(read_json(path), path)


def result_of(document: object, path: str | Path) -> Result:
    """Make a result of a parsed document that came from `path`."""
    file = validated(ResultFile, document, path)
    nq = len(file.configuration_names)
    for index, frame in enumerate(file.frames):
        _check_frame(path, f"frames[{index}]", frame, nq)
    postures = [posture for frame in file.frames for posture in frame.postures]
    margins = list(dict.fromkeys(name for posture in postures for name in posture.margins))
    grouped = {posture.group is not None for posture in postures}
    told = {posture.probability is not None for posture in postures}
    inferred = any(posture.inferred is not None for posture in postures)
    if len(grouped) > 1:
        raise refusal(path, "frames", "postures with and without a group", "all or none", "group all or none")
    if len(told) > 1:
        raise refusal(
            path, "frames", "postures with and without a probability", "all or none", "write it again"
        )
    return Result(
        unit=file.unit,
        configuration_names=file.configuration_names,
        settings=file.settings,
        frames=[
            _frame(
                frame,
                file.unit,
                nq,
                margins,
                grouped=True in grouped,
                inferred=inferred,
                told=True in told,
            )
            for frame in file.frames
        ],
        paths=None if file.paths is None else _paths(path, file.paths, file.unit),
    )


def _paths(path: str | Path, given: ResultPaths, unit: Unit) -> FollowedPaths:
    rows = [one.model_dump() for one in given.paths]
    try:
        arrays: dict[str, NDArray[Any]] = {
            name: np.array([row[name] for row in rows], dtype=_KINDS.get(name, float)) for name in rows[0]
        }
    except ValueError:
        raise refusal(
            path, "paths", "lists of different lengths", "one entry a frame in every path", "follow it again"
        ) from None
    return FollowedPaths.of(arrays, given.model_dump(), unit)


def write_result_json(path: str | Path, result: Result) -> None:
    """Write a result as JSON; see `posekit.formats.own.write_result`."""
    head = {
        "schema": SCHEMA,
        "unit": result.unit,
        "joint_names": list(result.joint_names),
        "configuration_names": list(result.configuration_names),
        "settings": dict(result.settings),
    }
    if result.paths is not None:
        head["paths"] = result.paths.fields(result.unit)
    write_text(path, json_pieces(head, "frames", _frames(result)))


def _frames(result: Result) -> Iterator[dict[str, Any]]:
    unit = result.unit
    for frame in result.frames:
        camera = frame.camera
        columns: dict[str, list[Any]] = {
            "joints": _nullable(from_metres(frame.joints, unit)),
            "q": _nullable(frame.q),
            "branches": list(frame.branches),
        }
        if frame.groups is not None:
            columns["group"] = frame.groups.tolist()
        margins = [_nullable(values) for values in frame.margins.values()]
        columns["margins"] = [
            dict(zip(frame.margins, row, strict=True)) for row in zip(*margins, strict=True)
        ]
        if not margins:
            columns["margins"] = [{} for _ in frame.branches]
        columns["fk_distance"] = _nullable(from_metres(frame.fk_distance, unit))
        columns["length_residual"] = _nullable(from_metres(frame.length_residual, unit))
        if frame.scales is not None:
            columns["scale"] = _nullable(frame.scales / PER_METRE[unit])
        if frame.inferred is not None:
            columns["inferred"] = [
                {name: one.fields(unit) for name, one in joints.items()} for joints in frame.inferred
            ]
        if frame.probability is not None:
            columns["probability"] = frame.probability.tolist()
        if frame.refined is not None:
            columns["refined"] = frame.refined.rows(unit)
        fields: dict[str, Any] = {
            "time": float(frame.time),
            "camera": {
                "f": _length(camera["f"], unit),
                "rotation": None if camera["rotation"] is None else camera["rotation"].tolist(),
                "position": _length(camera["position"], unit),
                "residual": camera["residual"] if camera["f"] is None else _length(camera["residual"], unit),
            },
            "levels": {name: list(values) for name, values in frame.levels.items()},
            "postures": [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)],
            "rejected": dict(frame.rejected),
        }
        if frame.family is not None:
            fields["family"] = frame.family.fields(unit)
        if frame.root is not None:
            fields["root"] = frame.root.fields(unit)
        if frame.pruned is not None:
            fields["pruned"] = [dict(entry) for entry in frame.pruned]
        yield fields


def _nullable(values: Array) -> list[Any]:
    """Turn an array into lists with None for NaN."""
    unknown = np.isnan(values)
    if unknown.any():
        boxed = values.astype(object)
        boxed[unknown] = None
        return list(boxed.tolist())
    return list(values.tolist())


def _length(value: Any, unit: Unit) -> Any:
    return None if value is None else from_metres(value, unit).tolist()


def _check_frame(path: str | Path, where: str, frame: ResultFrameFields, nq: int) -> None:
    """Check what ties fields together, which the schema cannot say."""
    levels = frame.levels
    if not len(levels.joint) == len(levels.physical) == len(levels.motion):
        counts = f"{len(levels.joint)}, {len(levels.physical)} and {len(levels.motion)} entries"
        raise refusal(path, f"{where}.levels", counts, "one of each a level", "add what is missing")
    for index, posture in enumerate(frame.postures):
        if len(posture.q) != nq:
            raise refusal(
                path,
                f"{where}.postures[{index}].q",
                f"{len(posture.q)} entries",
                f"{nq}, as there are configuration_names",
                "correct one of the two",
            )


def _frame(
    frame: ResultFrameFields,
    unit: Unit,
    nq: int,
    margins: list[str],
    *,
    grouped: bool,
    inferred: bool,
    told: bool,
) -> ResultFrame:
    postures, camera = frame.postures, frame.camera
    count = len(postures)
    residual = camera.residual
    if residual is not None and camera.f is not None:
        residual = float(to_metres(residual, unit))
    return ResultFrame(
        time=frame.time,
        camera={
            "f": None if camera.f is None else to_metres(camera.f, unit),
            "rotation": camera.rotation,
            "position": None if camera.position is None else to_metres(camera.position, unit),
            "residual": residual,
        },
        levels={name: getattr(frame.levels, name) for name in ("joint", "physical", "motion")},
        joints=to_metres([posture.joints for posture in postures], unit).reshape(count, 14, 3),
        q=np.array([posture.q for posture in postures], dtype=np.float64).reshape(count, nq),
        branches=[posture.branches for posture in postures],
        groups=np.array([posture.group for posture in postures], dtype=np.int64) if grouped else None,
        margins={
            name: np.array([posture.margins.get(name) for posture in postures], dtype=np.float64)
            for name in margins
        },
        fk_distance=to_metres([posture.fk_distance for posture in postures], unit),
        length_residual=to_metres([posture.length_residual for posture in postures], unit),
        rejected=frame.rejected,
        pruned=frame.pruned,
        family=None if frame.family is None else Family.of(frame.family.model_dump(), unit),
        scales=_scales(postures, unit) if frame.family is not None else None,
        root=None if frame.root is None else Root.of(frame.root.model_dump(), unit),
        inferred=[_inferred(posture, unit) for posture in postures] if inferred else None,
        probability=np.array([posture.probability for posture in postures], dtype=np.float64)
        if told
        else None,
        refined=_refined(postures, unit),
    )


def _scales(postures: list[ResultPosture], unit: Unit) -> Array:
    return np.array([posture.scale for posture in postures], dtype=np.float64) * PER_METRE[unit]


def _refined(postures: list[ResultPosture], unit: Unit) -> Likelihoods | None:
    """Gather what is said of refined survivors: of all of a frame, or of none."""
    rows = [posture.refined for posture in postures]
    known = [row.model_dump() for row in rows if row is not None]
    return Likelihoods.of(known, unit) if known and len(known) == len(rows) else None


def _inferred(posture: ResultPosture, unit: Unit) -> dict[str, Inferred]:
    joints = posture.inferred or {}
    return {name: Inferred.of(one.model_dump(), unit) for name, one in joints.items()}
