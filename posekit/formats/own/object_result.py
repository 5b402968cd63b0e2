"""What was recovered of an articulated object, in memory, and its file ``posekit.object/1``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.formats.own.family import Family
from posekit.formats.own.npz import suffix
from posekit.formats.own.object_result_schema import OBJECT_SCHEMA, ObjectFile, ObjectFrameRecord
from posekit.formats.own.units import PER_METRE, Unit
from posekit.safe_io.json_file import read_json
from posekit.safe_io.refusal import refusal
from posekit.safe_io.writing import check_target, json_pieces, write_text
from posekit.tables.file_model import validated

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectFrame:
    """The survivors of one frame. Lengths are metres, or the linkage's relative unit.

    Parameters
    ----------
    time : float
        Seconds.
    judged : str or None
        ``exact``, ``closed``, ``measured`` or ``given``.
    reason : str
        Why nothing was grown.
    levels : tuple of (str, int)
        The tree's points and how many survivors each level has.
    points : array (N, P, 3)
        Camera frame; NaN where a point was not seen.
    branches : tuple of N str
        The near (0) or far (1) choice at each of the tree's points.
    flips : int array (N, S)
        1 where the first end of a segment is nearer, -1 where its second is, 0 where they are level or not seen.
    scales : array (N,)
        Pixels a metre, or a relative unit.
    margins : mapping of str to array (N,)
        By check; NaN where undecided.
    q : array (N, nq), optional
        NaN where none was looked for.
    fk_distance : array (N,), optional
        Metres.
    certified : tuple of N (bool or None)
        Whether the robot of the URDF reaches the posture within its limits; None without a URDF.
    reasons : tuple of N str
        Why each is not certified.
    rejected : mapping of str to int
        Pruned branches by what killed them.
    family : Family, optional
        The scales that the frame can have.
    """

    time: float
    judged: str | None
    reason: str = ""
    levels: tuple[tuple[str, int], ...]
    points: Array
    branches: tuple[str, ...]
    flips: NDArray[np.int8]
    scales: Array
    margins: Mapping[str, Array]
    q: Array | None = None
    fk_distance: Array | None = None
    certified: tuple[bool | None, ...]
    reasons: tuple[str, ...]
    rejected: Mapping[str, int]
    family: Family | None = None

    def __post_init__(self) -> None:
        count = len(self.points)
        sizes = {
            "branches": len(self.branches),
            "flips": len(self.flips),
            "scales": len(self.scales),
            "certified": len(self.certified),
            "reasons": len(self.reasons),
            **{f"margins.{name}": len(values) for name, values in self.margins.items()},
        }
        for name in ("q", "fk_distance"):
            if getattr(self, name) is not None:
                sizes[name] = len(getattr(self, name))
        for name, size in sizes.items():
            if size != count:
                raise refusal("object", name, f"{size} entries", f"{count}, one a posture", "write it again")
        for name in ("points", "flips", "scales", "q", "fk_distance"):
            if getattr(self, name) is not None:
                values = np.array(getattr(self, name))
                values.flags.writeable = False
                object.__setattr__(self, name, values)

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.points)


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectResult(ShortRepr):
    """Every survivor of every frame of a view of an object.

    Parameters
    ----------
    unit : {"m", "cm", "mm"} or None
        Of lengths in the file; None where they are relative.
    linkage : str
        Its name.
    points : tuple of str (P,)
        The object's points.
    segments : tuple of (str, str) (S,)
        Its rigid segments, each by the names of its ends.
    lengths : array (S,)
        Metres, or relative.
    configuration_names : tuple of str
        Empty without a URDF.
    settings : mapping
        Everything that decided the result.
    frames : sequence of ObjectFrame
        What was recovered, frame by frame.
    """

    unit: Unit | None
    linkage: str
    points: tuple[str, ...]
    segments: tuple[tuple[str, str], ...]
    lengths: Array
    configuration_names: tuple[str, ...]
    settings: Mapping[str, Any]
    frames: Sequence[ObjectFrame]


def check_object_path(path: str | Path) -> None:
    """Refuse a result's name before the work that it is for is done."""
    suffix(path, ".json")
    check_target(path)


def write_object(path: str | Path, result: ObjectResult) -> None:
    """Write a result as JSON, whole or not at all; lengths are turned into ``result.unit``.

    Raises
    ------
    InputError
        Where the file cannot be written, or would be larger than can be read again.
    """
    check_object_path(path)
    per = _per(result.unit)
    head = {
        "schema": OBJECT_SCHEMA,
        "unit": result.unit,
        "linkage": result.linkage,
        "points": list(result.points),
        "segments": [list(ends) for ends in result.segments],
        "lengths": (np.asarray(result.lengths) * per).tolist(),
        "configuration_names": list(result.configuration_names),
        "settings": dict(result.settings),
    }
    write_text(path, json_pieces(head, "frames", (_record(frame, result) for frame in result.frames)))


def read_object(path: str | Path) -> ObjectResult:
    """Read a result, in metres or relative lengths.

    Raises
    ------
    InputError
        Where the file breaks the schema ``posekit.object/1``.
    """
    file = validated(ObjectFile, read_json(path), path)
    segments = tuple((a, b) for a, b in file.segments)
    if len(file.lengths) != len(segments):
        got = f"{len(file.lengths)} entries"
        raise refusal(path, "lengths", got, f"{len(segments)}, one a segment", "add what is missing")
    return ObjectResult(
        unit=file.unit,
        linkage=file.linkage,
        points=tuple(file.points),
        segments=segments,
        lengths=np.array(file.lengths) / _per(file.unit),
        configuration_names=tuple(file.configuration_names),
        settings=file.settings,
        frames=[_frame(path, k, record, file) for k, record in enumerate(file.frames)],
    )


def _per(unit: Unit | None) -> float:
    return 1.0 if unit is None else PER_METRE[unit]


def _record(frame: ObjectFrame, result: ObjectResult) -> dict[str, Any]:
    """Return what the file says of a frame."""
    per = _per(result.unit)
    names = [f"{a}-{b}" for a, b in result.segments]
    postures = []
    points, scales = _nullable(frame.points * per), (frame.scales / per).tolist()
    margins = {name: _nullable(values * per) for name, values in frame.margins.items()}
    for k in range(len(frame)):
        flips = zip(names, result.segments, frame.flips[k].tolist(), strict=True)
        posture: dict[str, Any] = {
            "points": points[k],
            "branches": frame.branches[k],
            "flips": {name: {1: ends[0], -1: ends[1]}.get(flip) for name, ends, flip in flips},
            "scale": scales[k],
            "margins": {name: values[k] for name, values in margins.items()},
            "certified": frame.certified[k],
        }
        if frame.q is not None and frame.fk_distance is not None:
            distance = frame.fk_distance[k : k + 1] * per
            found = bool(np.isfinite(frame.q[k]).all())
            posture |= {"q": _nullable(frame.q[k]) if found else None, "fk_distance": _nullable(distance)[0]}
        if frame.reasons[k]:
            posture["reason"] = frame.reasons[k]
        postures.append(posture)
    record: dict[str, Any] = {
        "time": float(frame.time),
        "judged": frame.judged,
        "levels": {
            "point": [name for name, _ in frame.levels],
            "survivors": [count for _, count in frame.levels],
        },
        "postures": postures,
        "rejected": dict(frame.rejected),
    }
    if frame.reason:
        record["reason"] = frame.reason
    if frame.family is not None:
        record["family"] = frame.family.fields(result.unit or "m")
    return record


def _nullable(values: Array) -> list[Any]:
    """Turn an array into lists with None for what is not known or not finite: JSON has neither."""
    boxed = np.asarray(values).astype(object)
    boxed[~np.isfinite(values)] = None
    return list(boxed.tolist())


def _frame(path: str | Path, index: int, record: ObjectFrameRecord, file: ObjectFile) -> ObjectFrame:
    per, where = _per(file.unit), f"frames[{index}]"
    if len(record.levels.point) != len(record.levels.survivors):
        raise refusal(
            path, f"{where}.levels", "lists of two lengths", "one entry a level", "add what is missing"
        )
    postures = record.postures
    count, P, nq = len(postures), len(file.points), len(file.configuration_names)
    for k, posture in enumerate(postures):
        for name, size, expected in (
            ("points", len(posture.points), P),
            ("q", nq if posture.q is None else len(posture.q), nq),
        ):
            if size != expected:
                place = f"{where}.postures[{k}].{name}"
                raise refusal(path, place, f"{size} entries", f"{expected}", "correct it")
    names = [f"{a}-{b}" for a, b in file.segments]
    flips = np.zeros((count, len(names)), dtype=np.int8)
    for k, posture in enumerate(postures):
        for column, (name, ends) in enumerate(zip(names, file.segments, strict=True)):
            end = posture.flips.get(name)
            flips[k, column] = 0 if end is None else 1 if end == ends[0] else -1
    solved = any(posture.q is not None for posture in postures)
    unknown = [np.nan] * nq
    margins = dict.fromkeys(name for posture in postures for name in posture.margins)
    return ObjectFrame(
        time=record.time,
        judged=record.judged,
        reason=record.reason,
        levels=tuple(zip(record.levels.point, record.levels.survivors, strict=True)),
        points=np.array([p.points for p in postures], dtype=np.float64).reshape(count, P, 3) / per,
        branches=tuple(posture.branches for posture in postures),
        flips=flips,
        scales=np.array([posture.scale for posture in postures]) * per,
        margins={
            name: np.array([posture.margins.get(name) for posture in postures], dtype=np.float64) / per
            for name in margins
        },
        q=np.array([p.q or unknown for p in postures], dtype=np.float64).reshape(count, nq)
        if solved
        else None,
        fk_distance=np.array([p.fk_distance for p in postures], dtype=np.float64) / per if solved else None,
        certified=tuple(posture.certified for posture in postures),
        reasons=tuple(posture.reason for posture in postures),
        rejected=record.rejected,
        family=None if record.family is None else Family.of(record.family.model_dump(), file.unit or "m"),
    )
