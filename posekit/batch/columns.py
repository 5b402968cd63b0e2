"""From recovered frames to the rows of a shard: a row a survivor, and one for a frame that has none."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.batch.image_rows import N_IMAGE_POINTS, ImageRows
from posekit.batch.recipe import Recipe
from posekit.body import load_figure
from posekit.formats.motion.survivors import COORDINATE_COLUMNS
from posekit.formats.own.column import Column, columns_in
from posekit.formats.own.survivor_columns import Likelihoods, SurvivorColumns
from posekit.geometry import Array
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.recovery.trees import Batch
from posekit.safe_io import extra
from posekit.skeleton import JOINTS

TEXT_COLUMNS: Final = ("input", "judged", "reason", "inferred", "rejected")
"""Columns of few different texts."""
NO_SURVIVOR: Final = -1
NOT_GROWN: Final = "root/not_known"
N_LEAVES: Final = 8192

BATCH_COLUMNS: Final = sorted(
    (
        column
        for table in (SurvivorColumns, Likelihoods)
        for column in columns_in(table).values()
        if column.batch_place
    ),
    key=lambda column: column.batch_place,
)
"""The columns of a survivor that are numbers in a shard, in their order there."""

Letters = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True, eq=False)
class ShardFrames:
    """F frames and their N survivors, in the frames' order.

    Parameters
    ----------
    frame : int array (F,)
        The number of each in its recording.
    time : array (F,)
        Seconds.
    count : int array (F,)
        Survivors of each.
    judged, reason, inferred, rejected : tuple of str (F,)
        With which tolerances it was judged; why nothing was grown; which joints were not seen and put in by commas;
        how many leaves were lost to what, as JSON.
    branches : byte array (N, B)
        Survivors' branches: a letter a joint from the second, 0 or 1.
    joints : array (N, 14, 3)
        The survivors, camera frame, metres.
    values : mapping of str to array (N,)
        Every other number of a survivor, by the name of its column.
    """

    frame: NDArray[np.int64]
    time: Array
    count: NDArray[np.int64]
    judged: tuple[str, ...]
    reason: tuple[str, ...]
    inferred: tuple[str, ...]
    rejected: tuple[str, ...]
    branches: Letters = field(default_factory=lambda: np.empty((0, len(JOINTS) - 1), dtype=np.uint8))
    joints: Array = field(default_factory=lambda: np.empty((0, len(JOINTS), 3)))
    values: dict[str, Array] = field(default_factory=dict)

    def with_part(self, rows: NDArray[np.intp], part: ShardFrames) -> ShardFrames:
        """Put frames that were recovered in the place of some that were not."""
        texts: dict[str, Any] = {}
        for name in ("judged", "reason", "inferred", "rejected"):
            all_of = list(getattr(self, name))
            for row, text in zip(rows.tolist(), getattr(part, name), strict=True):
                all_of[row] = text
            texts[name] = tuple(all_of)
        count = self.count.copy()
        count[rows] = part.count
        return replace(
            self, count=count, branches=part.branches, joints=part.joints, values=part.values, **texts
        )

    def followed_by(self, other: ShardFrames) -> ShardFrames:
        """Lay other frames behind these."""
        names = dict.fromkeys([*self.values, *other.values])
        sizes = len(self.joints), len(other.joints)
        return ShardFrames(
            frame=np.concatenate([self.frame, other.frame]),
            time=np.concatenate([self.time, other.time]),
            count=np.concatenate([self.count, other.count]),
            judged=self.judged + other.judged,
            reason=self.reason + other.reason,
            inferred=self.inferred + other.inferred,
            rejected=self.rejected + other.rejected,
            branches=np.concatenate([self.branches, other.branches]),
            joints=np.concatenate([self.joints, other.joints]),
            values={
                name: np.concatenate(
                    [
                        one.values.get(name, np.full(size, np.nan))
                        for one, size in zip((self, other), sizes, strict=True)
                    ]
                )
                for name in names
            },
        )


def unrecovered(rows: ImageRows, reason: str) -> ShardFrames:
    """Make frames in which nothing was grown, and say why."""
    count = len(rows)
    return ShardFrames(
        frame=rows.frame,
        time=rows.time,
        count=np.zeros(count, dtype=np.int64),
        judged=("",) * count,
        reason=(reason,) * count,
        inferred=("",) * count,
        rejected=(json.dumps({NOT_GROWN: N_LEAVES}),) * count,
    )


def frames_of(rows: ImageRows, recovery: Recovery, recipe: Recipe) -> ShardFrames:
    """Gather what a recovery of these rows found."""
    frames = recovery.frames
    joints, branches, values = _survivors(frames, recipe)
    if recipe.rank and len(joints):
        values["probability"] = np.concatenate(recovery.probability)
    unseen = np.isnan(rows.points[:, :N_IMAGE_POINTS, 0])
    inferred = [
        ",".join(name for name, lacks in zip(JOINTS, row, strict=True) if lacks)
        if recipe.settings.infer and any(row)
        else ""
        for row in unseen.tolist()
    ]
    return ShardFrames(
        frame=rows.frame,
        time=rows.time,
        count=np.array([len(frame) for frame in frames], dtype=np.int64),
        judged=tuple(frame.judged or "" for frame in frames),
        reason=tuple(re.sub(r"^frames\[\d+\]: ", "", frame.reason) for frame in frames),
        inferred=tuple(inferred),
        rejected=tuple(map(_spelled, frames)),
        branches=branches,
        joints=joints,
        values=values,
    )


def _asked(column: Column, recipe: Recipe) -> bool:
    """Tell whether a recipe asks for a column."""
    return not column.asked_by or bool(getattr(recipe, column.asked_by))


def value_columns(recipe: Recipe) -> tuple[str, ...]:
    """List the numbers of a survivor that a recipe asks for."""
    parts = {
        "margins": [check.replace("-", "_") for check in recipe.settings.check_names],
        "q": load_figure().configuration_names,
    }
    return tuple(
        name
        for column in BATCH_COLUMNS
        if _asked(column, recipe)
        for name in column.flat_names(parts.get(column.name, ()))
    )


def schema_of(recipe: Recipe) -> Any:
    """Return the columns of every shard of a recipe, whatever its inputs."""
    pa = extra("pyarrow", "parquet", "writing Parquet")
    text = pa.dictionary(pa.int32(), pa.string())
    return pa.schema(
        [
            ("input", text),
            ("person", pa.int32()),
            ("frame", pa.int64()),
            ("time", pa.float64()),
            ("survivors", pa.int32()),
            ("survivor", pa.int32()),
            ("branches", pa.string()),
            *((name, pa.float64()) for name in (*COORDINATE_COLUMNS, *value_columns(recipe))),
            *((name, text) for name in TEXT_COLUMNS if name != "input"),
        ]
    )


def table_of(frames: ShardFrames, input: str, person: int, schema: Any) -> Any:
    """Lay frames out as rows of a pyarrow table."""
    pa = extra("pyarrow", "parquet", "writing Parquet")
    repeated = np.maximum(frames.count, 1)  # a frame without survivors has one row, to say that it has none
    of_row = np.repeat(np.arange(len(frames.frame)), repeated)
    filled = frames.count[of_row] > 0
    starts = np.cumsum(repeated) - repeated
    survivor = np.where(filled, np.arange(len(of_row)) - starts[of_row], NO_SURVIVOR)
    flat = frames.joints.reshape(-1, len(COORDINATE_COLUMNS))
    columns: dict[str, Any] = {
        "input": _dictionary(pa, (input,), np.zeros(len(of_row), dtype=np.int32)),
        "person": np.full(len(of_row), person, dtype=np.int32),
        "frame": frames.frame[of_row],
        "time": frames.time[of_row],
        "survivors": frames.count[of_row].astype(np.int32),
        "survivor": survivor.astype(np.int32),
        "branches": _strings(pa, frames.branches, filled),
        **{name: _scattered(flat[:, k], filled) for k, name in enumerate(COORDINATE_COLUMNS)},
        **{name: _dictionary(pa, getattr(frames, name), of_row) for name in TEXT_COLUMNS if name != "input"},
    }
    for name in schema.names:
        if name not in columns:
            columns[name] = _scattered(frames.values.get(name, np.full(len(flat), np.nan)), filled)
    arrays = [
        columns[field.name]
        if isinstance(columns[field.name], pa.Array)
        else pa.array(columns[field.name], field.type, from_pandas=True)
        for field in schema
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def _scattered(values: Array, filled: NDArray[np.bool_]) -> Array:
    """Put the survivors' numbers into their rows; the rows of frames without any hold NaN."""
    if filled.all():
        return values
    column = np.full(len(filled), np.nan)
    column[filled] = values
    return column


def _strings(pa: Any, letters: Letters, filled: NDArray[np.bool_]) -> Any:
    """Make a column of the survivors' branches from their bytes; of a frame without any it is empty."""
    ends = np.concatenate([[0], np.cumsum(filled * letters.shape[1])]).astype(np.int32)
    content = pa.py_buffer(np.ascontiguousarray(letters))
    return pa.StringArray.from_buffers(len(filled), pa.py_buffer(ends), content)


def _dictionary(pa: Any, texts: Sequence[str], of_row: NDArray[Any]) -> Any:
    """Make a column of texts that are repeated."""
    words = {text: k for k, text in enumerate(dict.fromkeys(texts))}
    codes = np.array([words[text] for text in texts], dtype=np.int32)
    return pa.DictionaryArray.from_arrays(pa.array(codes[of_row]), pa.array(list(words), pa.string()))


def _spelled(frame: FrameRecovery) -> str:
    """Write how many leaves were lost to what as JSON."""
    return "{" + ", ".join(f"{_quoted(reason)}: {count}" for reason, count in frame.rejected.items()) + "}"


@lru_cache(maxsize=4096)
def _quoted(text: str) -> str:
    return json.dumps(text)


def _survivors(frames: Sequence[FrameRecovery], recipe: Recipe) -> tuple[Array, Letters, dict[str, Array]]:
    """Gather all survivors, in the order of the frames, batch by batch: frames of one batch are grown together."""
    grown: dict[int, tuple[Batch, list[int]]] = {}
    for k, frame in enumerate(frames):
        if frame.batch is not None and len(frame):
            grown.setdefault(id(frame.batch), (frame.batch, []))[1].append(k)
    if not grown:
        return np.empty((0, len(JOINTS), 3)), np.empty((0, len(JOINTS) - 1), dtype=np.uint8), {}
    owner, joints, branches = [], [], []
    values: list[dict[str, Array]] = []
    for batch, members in grown.values():
        rows, of_frame = _rows(batch, [frames[k] for k in members])
        owner.append(np.array(members)[of_frame])
        joints.append(batch.points[rows, : len(JOINTS)])
        branches.append(_codes(batch, rows))
        values.append(_values(batch, [frames[k] for k in members], rows, recipe))
    if len(grown) == 1:
        return joints[0], branches[0], values[0]
    names = dict.fromkeys(name for each in values for name in each)
    # Frames of one batch may have what those of another have not: chi2, of which an exact frame knows nothing.
    columns = {
        name: [each.get(name, np.full(len(part), np.nan)) for each, part in zip(values, joints, strict=True)]
        for name in names
    }
    order = np.argsort(np.concatenate(owner), kind="stable")
    return (
        np.concatenate(joints)[order],
        np.concatenate(branches)[order],
        {name: np.concatenate(parts)[order] for name, parts in columns.items()},
    )


def _rows(batch: Batch, members: Sequence[FrameRecovery]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows in a batch of some frames' survivors, and whose each is."""
    first = batch.offsets[[frame.index for frame in members]]
    counts = np.array([len(frame) for frame in members])
    of_frame = np.repeat(np.arange(len(members)), counts)
    within = np.arange(len(of_frame)) - (np.cumsum(counts) - counts)[of_frame]
    return (first[of_frame] + within).astype(np.intp), of_frame


def _codes(batch: Batch, rows: NDArray[np.intp]) -> Letters:
    """Spell branch codes as the letters 0 and 1, one a joint from the second."""
    levels = np.arange(batch.leaves.level)[::-1]
    return (((batch.leaves.code[rows, None] >> levels) & 1) + ord("0")).astype(np.uint8)


def _values(
    batch: Batch, members: Sequence[FrameRecovery], rows: NDArray[np.intp], recipe: Recipe
) -> dict[str, Array]:
    """Return the numbers of some survivors by column."""
    columns: dict[str, Array] = {}
    for column in BATCH_COLUMNS:
        if not _asked(column, recipe):
            continue
        holder = next((one for one in (batch, batch.refined) if hasattr(one, column.name)), None)
        if column.by_check:
            margins = {name: margin[rows] for name, margin in batch.margins.items()}
            values = [np.where(np.isinf(margin), np.nan, margin) for margin in margins.values()]
            columns |= zip(column.flat_names(list(margins)), values, strict=True)
        elif column.flat_prefix:
            names = column.flat_names(batch.body.figure.configuration_names)
            columns |= zip(names, getattr(holder, column.name)[rows].T, strict=True)
        elif holder is not None:
            columns[column.key] = getattr(holder, column.name)[rows]
        elif getattr(members[0], column.name, None) is not None:  # scales: of each frame, not of the batch
            columns[column.key] = np.concatenate([getattr(frame, column.name) for frame in members])
    return columns
