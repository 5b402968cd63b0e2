"""``posekit.result/2`` as NPZ, and ``/1`` to read: what JSON holds as arrays, padded to the most survivors of a frame.

Arrays (F frames, at most N survivors, L levels): ``schema``, ``unit``, ``settings`` (JSON text) and, where
there is detail, ``pruned`` (JSON text); ``joint_names``, ``configuration_names``; ``time`` (F,); ``count``
(F,); ``camera/f``, ``camera/rotation``, ``camera/position``, ``camera/residual``; ``levels/joint``,
``levels/physical``, ``levels/motion`` (F, L); ``joints`` (F, N, 14, 3), ``fk_distance`` and
``length_residual`` (F, N) in ``unit``; ``q`` (F, N, nq) in metres and radians; ``branches`` (F, N);
``groups`` (F, N); ``margins/<name>`` (F, N); ``rejected/names`` (R,), ``rejected/counts`` (F, R). Padding and
what is not known are NaN, -1 or an empty text. Uncalibrated: ``scales`` (F, N) and ``families`` (JSON text); with
joints that were not seen: ``inferred`` (JSON text). ``probability`` (F, N). Refined: ``refined/chi2``,
``refined/dof``, ``refined/p``, ``refined/merged`` (F, N), ``refined/covariance`` (F, N, 14, 6) in square units.
Sets (`posekit.formats.own.posture_set`) and answers (`posekit.formats.own.frame_answer`): an array a column, padded as
well, ``set/trunks`` (F, T, 6, 3), ``answer/representatives`` (F, K), …, and how long each is in ``set/counts`` and
``answer/counts``, a column each; ``unlisted``, ``unlisted_probability`` (F,).
Followed: ``paths/survivor``, ``paths/scale`` (K, F), ``paths/joints``, ``paths/smoothed`` (K, F, 14, 3),
``paths/interpolated``, ``paths/deviation`` (K, F, 14), ``paths/cost``, ``paths/share`` (K,), ``paths/told`` (text).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from posekit.formats.own.digits import shortened
from posekit.formats.own.family import Family
from posekit.formats.own.frame_answer import ANSWER_PRECISION, FrameAnswer
from posekit.formats.own.frame_tables import table_arrays, tables_in
from posekit.formats.own.inferred import Inferred
from posekit.formats.own.npz import COMPACT_LEVEL, COMPRESSION_LEVEL, Ragged, write_npz
from posekit.formats.own.paths import FollowedPaths, path_shapes
from posekit.formats.own.posture_set import PostureSet
from posekit.formats.own.result import (
    CAMERA_FIELDS,
    LEVEL_FIELDS,
    RESULT_SCHEMA,
    RESULT_SCHEMAS,
    Result,
    ResultFrame,
)
from posekit.formats.own.result_schema import ResultDetails, ResultPathsTold
from posekit.formats.own.root import Root
from posekit.formats.own.survivor_columns import SURVIVOR_COLUMNS, SurvivorColumns
from posekit.formats.own.survivor_npz import PADDED_PREFIXES, survivor_arrays, survivors_in
from posekit.formats.own.units import UNIT_NAMES, Unit, from_metres, to_metres
from posekit.safe_io.json_file import parse_json
from posekit.safe_io.npz_file import MAX_ARRAYS, Archive, not_finite, open_npz
from posekit.safe_io.refusal import refusal, shown
from posekit.safe_io.writing import replacing
from posekit.skeleton import JOINTS

Array = NDArray[Any]

MAX_PADDED: Final = 16_000_000_000
"""Bytes that a result may declare with its padding, which is passed over and never held."""
_MARGIN = "margins/"
_SET = "set/"
_ANSWER = "answer/"
_PATHS = "paths/"


def write_result_npz(path: str | Path, result: Result) -> None:
    """Write a result as NPZ; see `posekit.formats.own.write_result`."""
    with replacing(path) as file:
        pack_result(file, result)


def pack_result(file: BinaryIO, result: Result) -> None:
    """Write a result as NPZ into an open file."""
    frames, unit = result.frames, result.unit
    precision = [
        None if frame.precision is None else replace(frame.precision, binary=True) for frame in frames
    ]
    arrays: dict[str, Array | Ragged] = {
        "schema": np.array(RESULT_SCHEMA),
        "unit": np.array(unit),
        "settings": np.array(json.dumps(dict(result.settings), allow_nan=False)),
        "joint_names": np.array(result.joint_names),
        "configuration_names": np.array(result.configuration_names, dtype=np.str_),
        "time": np.array([frame.time for frame in frames], dtype=np.float64),
        "count": np.array([len(frame.joints) for frame in frames], dtype=np.int64),
        **_camera_arrays(frames, unit),
        **_level_arrays(frames),
        **_rejected_arrays(frames),
        **survivor_arrays(SurvivorColumns, frames, unit, carried=_carried(frames), precision=precision),
        **table_arrays(
            PostureSet, [one.posture_set for one in frames], unit, within=_SET, precision=precision
        ),
        **table_arrays(
            FrameAnswer,
            [one.answer for one in frames],
            unit,
            within=_ANSWER,
            precision=[one or replace(ANSWER_PRECISION, binary=True) for one in precision],
        ),
        **({} if result.written_decimals is None else {"decimals": np.array(result.written_decimals)}),
        "unlisted": np.array([frame.unlisted for frame in frames], dtype=np.int64),
        "unlisted_probability": np.array([frame.unlisted_probability for frame in frames]),
    }
    if any(frame.pruned is not None for frame in frames):
        pruned = [
            None if frame.pruned is None else [dict(entry) for entry in frame.pruned] for frame in frames
        ]
        arrays["pruned"] = np.array(json.dumps(pruned, allow_nan=False))
    if any(frame.family is not None for frame in frames):
        families = [None if frame.family is None else frame.family.fields(unit) for frame in frames]
        arrays["families"] = np.array(json.dumps(families, allow_nan=False))
    if any(frame.root is not None for frame in frames):
        roots = [None if frame.root is None else frame.root.fields(unit) for frame in frames]
        roots = [shortened(root) if few else root for root, few in zip(roots, precision, strict=True)]
        arrays["roots"] = np.array(json.dumps(roots, allow_nan=False))
    if result.paths is not None:
        arrays |= {_PATHS + name: values for name, values in result.paths.in_unit(unit).items()}
        arrays[_PATHS + "told"] = np.array(json.dumps(result.paths.told(unit), allow_nan=False))
    write_npz(file, arrays, level=COMPACT_LEVEL if any(precision) else COMPRESSION_LEVEL)


def read_result_npz(path: str | Path) -> Result:
    """Read a result from NPZ; see `posekit.formats.own.read_result`."""
    with open_npz(path, limit=MAX_PADDED) as archive:
        return result_in(archive)


def result_in(archive: Archive) -> Result:
    """Make a result of an open archive."""
    path = archive.path
    # Padding is passed over in pieces: what it declares may be large, what else is there may not.
    archive.check_held(MAX_ARRAYS, but=(*PADDED_PREFIXES, _SET, _ANSWER))
    _expect(archive, "schema", RESULT_SCHEMAS)
    unit: Unit = _expect(archive, "unit", UNIT_NAMES)  # type: ignore[assignment]
    names = tuple(archive.array("joint_names", "U", (None,)).tolist())
    if names != JOINTS:
        raise refusal(
            path, "joint_names", shown(names), "the 14 joints in tree order", "write the file again"
        )
    configuration_names = archive.array("configuration_names", "U", (None,)).tolist()
    time = _floats(archive, "time", (None,))
    count = archive.array("count", "iu", (len(time),)).astype(np.int64)
    margins = [name.removeprefix(_MARGIN) for name in archive.names if name.startswith(_MARGIN)]
    nq = len(configuration_names)
    held = float(count.sum(dtype=np.float64)) * 8 * (len(JOINTS) * 3 + nq + len(margins) + 10)
    if (count < 0).any() or held > MAX_ARRAYS:
        most = f"counts from 0, at most {MAX_ARRAYS / 1e6:,.0f} MB of survivors"
        raise refusal(path, "count", f"counts that need {held / 1e6:,.0f} MB", most, "split the result")
    # From here on sizes are bounded by `count`, whatever the headers of the arrays say.
    survivors: dict[str, Any] = survivors_in(
        archive, SurvivorColumns, count, unit, extents={"q": nq, "margins": margins}
    )
    cameras = _cameras(archive, len(time), unit)
    levels = _levels(archive, len(time))
    rejected = _rejected(archive, len(time))
    pruned = _json(archive, "pruned") if "pruned" in archive.names else [None] * len(time)
    families, roots, survivors["inferred"] = _details(archive, count, unit)
    scales = survivors["scales"]
    if families is None:
        survivors["scales"] = None
    elif scales is None:
        raise archive.lacks("scales")
    else:
        survivors["scales"] = [
            None if family is None else scale for family, scale in zip(families, scales, strict=True)
        ]
    sets = _of_sets(archive, len(time), unit)
    settings = _json(archive, "settings")
    if not isinstance(settings, dict):
        raise refusal(path, "settings", shown(settings), "an object", "write the file again")
    if not isinstance(pruned, list) or len(pruned) != len(time):
        raise refusal(path, "pruned", shown(pruned), f"a list of {len(time)} entries", "write the file again")
    rows: list[dict[str, Any]] = [
        {name: None if values is None else values[k] for name, values in survivors.items()}
        for k in range(len(time))
    ]
    return Result(
        unit=unit,
        configuration_names=configuration_names,
        settings=settings,
        frames=[
            ResultFrame(
                time=float(time[index]),
                camera=cameras[index],
                levels=levels[index],
                rejected=rejected[index],
                pruned=pruned[index],
                family=None if families is None else families[index],
                root=None if roots is None else roots[index],
                **sets[index],
                **own,
            )
            for index, own in enumerate(rows)
        ],
        paths=_followed(archive, len(time), unit),
        decimals=int(archive.array("decimals", "iu", ())) if "decimals" in archive.names else None,
    )


def _of_sets(archive: Archive, frames: int, unit: Unit) -> list[dict[str, Any]]:
    """Read what the first version did not have."""
    rows: list[dict[str, Any]] = [{} for _ in range(frames)]
    sets = tables_in(archive, PostureSet, frames, unit, within=_SET) or [None] * frames
    answers = tables_in(archive, FrameAnswer, frames, unit, within=_ANSWER) or [None] * frames
    for row, one, answer in zip(rows, sets, answers, strict=True):
        row |= {"posture_set": one, "answer": answer}
    if "unlisted" in archive.names:
        unlisted = archive.array("unlisted", "iu", (frames,))
        held = _floats(archive, "unlisted_probability", (frames,))
        for row, count, share in zip(rows, unlisted.tolist(), held.tolist(), strict=True):
            row |= {"unlisted": count, "unlisted_probability": share}
    return rows


def _followed(archive: Archive, frames: int, unit: Unit) -> FollowedPaths | None:
    """Read the paths, where there are some."""
    if _PATHS + "survivor" not in archive.names:
        return None
    survivor = archive.array(_PATHS + "survivor", "iu", (None, frames))
    shapes = path_shapes(len(survivor), frames)
    arrays: dict[str, Any] = {
        name: _floats(archive, _PATHS + name, shapes[name])
        for name in shapes
        if name not in ("survivor", "interpolated")
    }
    arrays["interpolated"] = archive.array(_PATHS + "interpolated", "b", shapes["interpolated"])
    try:
        told = ResultPathsTold.model_validate(_json(archive, _PATHS + "told"))
    except ValidationError:
        raise refusal(
            archive.path, _PATHS + "told", "another text", "what posekit writes", "write the file again"
        ) from None
    return FollowedPaths.of({**arrays, "survivor": survivor}, told.model_dump(), unit)


def _floats(archive: Archive, name: str, shape: tuple[int | None, ...]) -> Array:
    values = archive.array(name, "f", shape)
    if np.isinf(values).any():
        raise not_finite(archive.path, name, values)
    return values


def _expect(archive: Archive, name: str, accepted: Sequence[str]) -> str:
    found = str(archive.array(name, "U", ()))
    if found not in accepted:
        raise refusal(archive.path, name, shown(found), " or ".join(accepted), "give a file of this schema")
    return found


def _json(archive: Archive, name: str) -> Any:
    text = str(archive.array(name, "U", ()))
    return parse_json(f"{archive.path}: {name}", text.encode("utf-8", "surrogatepass"))


def _details(
    archive: Archive, count: Array, unit: Unit
) -> tuple[
    list[Family | None] | None, list[Root | None] | None, list[list[dict[str, Inferred]] | None] | None
]:
    """Read families, roots and inferred joints, which are kept as JSON text."""
    kept = ("families", "roots", "inferred")
    given = {name: _json(archive, name) for name in kept if name in archive.names}
    try:
        details = ResultDetails.model_validate(given)
    except ValidationError as error:
        where = error.errors(include_url=False)[0]["loc"]
        raise refusal(
            archive.path, str(where[0]), shown(where), "what posekit writes", "write the file again"
        ) from None
    families, roots, inferred = details.families, details.roots, details.inferred
    for name, entries in (("families", families), ("roots", roots), ("inferred", inferred)):
        if entries is not None and len(entries) != len(count):
            raise refusal(
                archive.path, name, f"{len(entries)} entries", f"{len(count)}, one a frame", "write it again"
            )
    return (
        None
        if families is None
        else [None if family is None else Family.of(family.model_dump(), unit) for family in families],
        None
        if roots is None
        else [None if root is None else Root.of(root.model_dump(), unit) for root in roots],
        None
        if inferred is None
        else [
            None
            if rows is None
            else [
                {name: Inferred.of(one.model_dump(), unit) for name, one in joints.items()} for joints in rows
            ]
            for rows in inferred
        ],
    )


def _carried(frames: Sequence[ResultFrame]) -> frozenset[str]:
    """Return the optional columns that some frame has; scales where some frame has a family of them."""
    names = {name for name in SURVIVOR_COLUMNS for frame in frames if getattr(frame, name) is not None}
    return frozenset(names | ({"scales"} if any(frame.family is not None for frame in frames) else set()))


def _camera_arrays(frames: Sequence[ResultFrame], unit: Unit) -> dict[str, Array]:
    """Stack what is known of the cameras, NaN where it is not."""
    unknown = {
        "f": np.nan,
        "rotation": np.full((3, 3), np.nan),
        "position": np.full(3, np.nan),
        "residual": np.nan,
    }
    stacked = {
        name: np.array(
            [unknown[name] if frame.camera[name] is None else frame.camera[name] for frame in frames],
            dtype=np.float64,
        )
        for name in CAMERA_FIELDS
    }
    # A camera with an f in metres has its image in metres, and so the residual; else it is in pixels.
    plane = ~np.isnan(stacked["f"])
    residual = np.where(plane, from_metres(stacked["residual"], unit), stacked["residual"])
    return {
        "camera/f": from_metres(stacked["f"], unit),
        "camera/rotation": stacked["rotation"],
        "camera/position": from_metres(stacked["position"], unit),
        "camera/residual": residual,
    }


def _cameras(archive: Archive, frames: int, unit: Unit) -> list[dict[str, Any]]:
    f = to_metres(_floats(archive, "camera/f", (frames,)), unit)
    rotation = _floats(archive, "camera/rotation", (frames, 3, 3))
    position = to_metres(_floats(archive, "camera/position", (frames, 3)), unit)
    residual = _floats(archive, "camera/residual", (frames,))
    residual = np.where(np.isnan(f), residual, to_metres(residual, unit))
    return [
        dict(zip(CAMERA_FIELDS, row, strict=True))
        for row in zip(f, rotation, position, residual, strict=True)
    ]


def _level_arrays(frames: Sequence[ResultFrame]) -> dict[str, Array]:
    fills = {"joint": "", "physical": -1, "motion": -1}
    longest = max(len(frame.levels["joint"]) for frame in frames)
    arrays = {}
    for name in LEVEL_FIELDS:
        rows = [
            [*frame.levels[name], *[fills[name]] * (longest - len(frame.levels[name]))] for frame in frames
        ]
        arrays[f"levels/{name}"] = np.array(rows, dtype=np.str_ if name == "joint" else np.int64)
    return arrays


def _levels(archive: Archive, frames: int) -> list[dict[str, Any]]:
    joint = archive.array("levels/joint", "U", (frames, None))
    physical = archive.array("levels/physical", "iu", joint.shape)
    motion = archive.array("levels/motion", "iu", joint.shape)
    return [
        {
            name: values[index][joint[index] != ""].tolist()
            for name, values in zip(LEVEL_FIELDS, (joint, physical, motion), strict=True)
        }
        for index in range(frames)
    ]


def _rejected_arrays(frames: Sequence[ResultFrame]) -> dict[str, Array]:
    names = list(dict.fromkeys(name for frame in frames for name in frame.rejected))
    counts = [[frame.rejected.get(name, -1) for name in names] for frame in frames]
    return {
        "rejected/names": np.array(names, dtype=np.str_),
        "rejected/counts": np.array(counts, dtype=np.int64).reshape(len(frames), len(names)),
    }


def _rejected(archive: Archive, frames: int) -> list[dict[str, int]]:
    names = archive.array("rejected/names", "U", (None,)).tolist()
    counts = archive.array("rejected/counts", "iu", (frames, len(names))).tolist()
    return [{name: n for name, n in zip(names, row, strict=True) if n >= 0} for row in counts]
