"""``posekit.result/2`` as JSON, and ``/1`` to read: NaN becomes null, lengths are in the file's unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.digits import shortened, whole_as_integers
from posekit.formats.own.family import Family
from posekit.formats.own.frame_answer import ANSWER_PRECISION, FrameAnswer
from posekit.formats.own.frame_tables import table_fields, table_of
from posekit.formats.own.paths import FollowedPaths
from posekit.formats.own.posture_set import PostureSet
from posekit.formats.own.result import EARLIER_RESULT_SCHEMA, RESULT_SCHEMA, Result, ResultFrame
from posekit.formats.own.root import Root
from posekit.formats.own.survivor_columns import SURVIVOR_COLUMNS, SurvivorColumns
from posekit.formats.own.survivor_json import survivor_columns, survivor_rows
from posekit.formats.own.units import Unit, from_metres, to_metres
from posekit.safe_io.json_file import read_json
from posekit.safe_io.refusal import refusal
from posekit.safe_io.writing import json_pieces, write_text

if TYPE_CHECKING:
    from posekit.formats.own.result_schema import EarlierFrameFields, ResultPaths

_KINDS: Final = {"survivor": int, "interpolated": bool}


def read_result_json(path: str | Path) -> Result:
    """Read a result from JSON; see `posekit.formats.own.read_result`."""
    return result_of(read_json(path), path)


def result_of(document: object, path: str | Path) -> Result:
    """Make a result of a parsed document that came from `path`."""
    # What checks a file takes as long to load as a result to write: who only writes one does without.
    from posekit.formats.own.result_schema import EarlierResultFile, ResultFile
    from posekit.tables.file_model import validated

    earlier = isinstance(document, dict) and document.get("schema") == EARLIER_RESULT_SCHEMA
    file = validated(EarlierResultFile if earlier else ResultFile, document, path)
    nq = len(file.configuration_names)
    for index, frame in enumerate(file.frames):
        _check_frame(path, f"frames[{index}]", frame, nq)
    postures = [posture for frame in file.frames for posture in frame.postures]
    extents = {
        "q": nq,
        "margins": list(dict.fromkeys(name for one in postures for name in one.margins or ())),
    }
    carried = set()
    for name, column in SURVIVOR_COLUMNS.items():
        told = (
            {getattr(posture, column.key) is not None for posture in postures} if column.optional else set()
        )
        if column.everywhere and len(told) > 1:
            got = f"postures with and without a {column.key}"
            raise refusal(path, "frames", got, "all or none", "write the result again")
        if True in told:
            carried.add(name)
    return Result(
        unit=file.unit,
        configuration_names=file.configuration_names,
        settings=file.settings,
        frames=[_frame(frame, file.unit, extents, carried) for frame in file.frames],
        paths=None if file.paths is None else _paths(path, file.paths, file.unit),
        decimals=file.decimals if isinstance(file, ResultFile) else None,
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
    head: dict[str, Any] = {
        "schema": RESULT_SCHEMA,
        "unit": result.unit,
        "joint_names": list(result.joint_names),
        "configuration_names": list(result.configuration_names),
        "settings": dict(result.settings),
    }
    if result.written_decimals is not None:
        head["decimals"] = result.written_decimals
    if result.paths is not None:
        head["paths"] = result.paths.fields(result.unit)
    write_text(path, json_pieces(head, "frames", _frames(result)))


def _frames(result: Result) -> Iterator[dict[str, Any]]:
    unit = result.unit
    for frame in result.frames:
        camera, precision = frame.camera, frame.precision
        fields: dict[str, Any] = {
            "time": float(frame.time),
            "camera": {
                "f": _length(camera["f"], unit),
                "rotation": None if camera["rotation"] is None else camera["rotation"].tolist(),
                "position": _length(camera["position"], unit),
                "residual": camera["residual"] if camera["f"] is None else _length(camera["residual"], unit),
            },
            "levels": {name: list(values) for name, values in frame.levels.items()},
            "postures": survivor_rows(frame, unit, precision=precision),
            "rejected": dict(frame.rejected),
        }
        if frame.posture_set is not None:
            fields["set"] = table_fields(frame.posture_set, unit, precision=precision)
            fields["unlisted"] = int(frame.unlisted)
            fields["unlisted_probability"] = float(frame.unlisted_probability)
        if frame.answer is not None:
            fields["answer"] = table_fields(frame.answer, unit, precision=precision or ANSWER_PRECISION)
        if frame.family is not None:
            fields["family"] = frame.family.fields(unit)
        if frame.root is not None:
            root = frame.root.fields(unit)
            fields["root"] = shortened(root) if precision else root
        if frame.pruned is not None:
            fields["pruned"] = [dict(entry) for entry in frame.pruned]
        yield whole_as_integers(fields) if precision else fields


def _length(value: Any, unit: Unit) -> Any:
    return None if value is None else from_metres(value, unit).tolist()


def _check_frame(path: str | Path, where: str, frame: EarlierFrameFields, nq: int) -> None:
    """Check what ties fields together, which the schema cannot say."""
    levels = frame.levels
    if not len(levels.joint) == len(levels.physical) == len(levels.motion):
        counts = f"{len(levels.joint)}, {len(levels.physical)} and {len(levels.motion)} entries"
        raise refusal(path, f"{where}.levels", counts, "one of each a level", "add what is missing")
    for index, posture in enumerate(frame.postures):
        if posture.q is not None and len(posture.q) != nq:
            raise refusal(
                path,
                f"{where}.postures[{index}].q",
                f"{len(posture.q)} entries",
                f"{nq}, as there are configuration_names",
                "correct one of the two",
            )


def _frame(
    frame: EarlierFrameFields, unit: Unit, extents: Mapping[str, Any], in_file: set[str]
) -> ResultFrame:
    camera = frame.camera
    # Of these two frames decide one by one; of all other columns the whole file has them, or none of it.
    carried = in_file - {"scales", "refined"}
    if frame.family is not None:  # scales are of uncalibrated frames, even where none is known
        carried.add("scales")
    if frame.postures and all(posture.refined is not None for posture in frame.postures):
        carried.add("refined")
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
        rejected=frame.rejected,
        pruned=frame.pruned,
        family=None if frame.family is None else Family.of(frame.family.model_dump(), unit),
        root=None if frame.root is None else Root.of(frame.root.model_dump(), unit),
        **_of_set(frame, unit),
        **survivor_columns(
            SurvivorColumns, frame.postures, unit, extents=extents, carried=frozenset(carried)
        ),
    )


def _of_set(frame: EarlierFrameFields, unit: Unit) -> dict[str, Any]:
    """Read what the first version did not have."""
    from posekit.formats.own.result_schema import ResultFrameFields

    if not isinstance(frame, ResultFrameFields):
        return {}
    return {
        "posture_set": None if frame.set is None else table_of(PostureSet, frame.set, unit),
        "unlisted": frame.unlisted,
        "unlisted_probability": frame.unlisted_probability,
        "answer": None if frame.answer is None else table_of(FrameAnswer, frame.answer, unit),
    }
