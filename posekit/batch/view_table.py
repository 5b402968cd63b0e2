"""Views as Parquet: image points in columns, a row a frame, read in pieces. What an archive is best kept in.

Columns: ``frame`` (its number, ascending; the row's if absent), ``time`` (s; by the rate if absent), then for each of
the 19 points, as ``neck`` or ``left_ear``, and head points of the user's own: ``neck_u``, ``neck_v`` (as in
``posekit.view/1``'s memory: pixels, y down)
and ``neck_confidence``; then ``root_x``, ``root_y``, ``root_z`` (m, the neck in the camera's frame, where it is known).
Null is what is not seen. The file's metadata may have camera and person under ``posekit.view``: a ``posekit.view/1``
document whose only frame is the first.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from posekit.batch.digests import MAX_INPUT_BYTES
from posekit.batch.image_rows import ImageRows, head_text
from posekit.errors import InputError
from posekit.formats.motion.parquet import opened
from posekit.formats.own import View
from posekit.formats.own.view import own_names
from posekit.geometry import Array
from posekit.safe_io import extra, refusal, replacing
from posekit.skeleton import POINTS
from posekit.views.person_view import ASSUMED_VIEW_RATE

HEAD_KEY: Final = b"posekit.view"
CONFIDENCE_COLUMNS: Final = tuple(f"{point}_confidence" for point in POINTS)
UV_COLUMNS: Final = tuple(f"{point}_{axis}" for point in POINTS for axis in "uv")
ROOT_COLUMNS: Final = ("root_x", "root_y", "root_z")
AT_ONCE: Final = 4096
"""Rows that are decoded together."""
BUFFER_BYTES: Final = 1 << 18
"""Bytes read at once of a column: row groups may be larger than memory."""
MAX_ROWS: Final = 1 << 40
FEWEST_POINTS: Final = 4
"""Points below which a table is none of image points."""


@dataclass(frozen=True, kw_only=True)
class ViewTable:
    """What a file's footer says.

    Parameters
    ----------
    path : Path
        The file.
    rows : int
        How many frames it has.
    head : str
        Camera and person, a ``posekit.view/1`` document; empty where the file has none.
    names : tuple of str
        Its columns.
    """

    path: Path
    rows: int
    head: str
    names: tuple[str, ...]


def is_view_table(names: Iterable[str]) -> bool:
    """Tell whether columns are those of image points."""
    there = set(names)
    return sum(f"{point}_u" in there and f"{point}_v" in there for point in POINTS) >= FEWEST_POINTS


def open_view_table(path: Path) -> ViewTable:
    """Read a table's footer.

    Raises
    ------
    InputError
        Where it is damaged, empty, or a column is no number.
    """
    pa = extra("pyarrow", "parquet", "reading Parquet")
    with opened(path, limit=MAX_INPUT_BYTES, buffer_bytes=BUFFER_BYTES) as file:
        schema, rows = file.schema_arrow, file.metadata.num_rows
        head = _head_of(schema)
        for name in {*uv_columns(head), *CONFIDENCE_COLUMNS, *ROOT_COLUMNS, "frame", "time"} & set(
            schema.names
        ):
            kind = schema.field(name).type
            if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
                raise refusal(path, name, str(kind)[:60], "numbers", "write the column as numbers")
        if not 1 <= rows <= MAX_ROWS:
            raise refusal(path, "", f"{rows:,} rows", "a row a frame, at least one", "give another file")
        if len(set(schema.names)) < len(schema.names):
            raise refusal(path, "columns", "a name twice", "each once", "rename one of the two")
        return ViewTable(path=path, rows=rows, head=head, names=tuple(schema.names))


def uv_columns(head: str) -> tuple[str, ...]:
    """Name the columns of image points: of the 19, then of the head points of the user's own that `head` tells."""
    figure = parsed.get("figure") if isinstance(parsed := _parsed(head), dict) else None
    points = figure.get("head_points") if isinstance(figure, dict) else None
    own = own_names(points if isinstance(points, dict) else ())
    return UV_COLUMNS + tuple(f"{point}_{axis}" for point in own for axis in "uv")


def _parsed(text: str) -> Any:
    try:
        return json.loads(text or "null")
    except (ValueError, RecursionError):  # refused where the document is read
        return None


def _head_of(schema: Any) -> str:
    return str((schema.metadata or {}).get(HEAD_KEY, b"").decode("utf-8", "replace"))


def read_rows(path: Path, start: int, stop: int, rate: float | None = None) -> Iterator[ImageRows]:
    """Read the rows from `start` to before `stop`, `AT_ONCE` at a time: the rest of the file is not held.

    Parameters
    ----------
    rate : float, optional
        Frames a second, where the table has no times.

    Raises
    ------
    InputError
        Where the file is damaged, has fewer rows, or a number is infinite.
    """
    with opened(path, limit=MAX_INPUT_BYTES, buffer_bytes=BUFFER_BYTES) as file:
        there = set(file.schema_arrow.names)
        uv = uv_columns(_head_of(file.schema_arrow))
        wanted = [
            name for name in (*uv, *CONFIDENCE_COLUMNS, *ROOT_COLUMNS, "frame", "time") if name in there
        ]
        found = start
        for columns, first in _pieces(path, file, wanted, start, stop):
            rows = _rows(columns, first, rate, uv)
            found += len(rows)
            yield rows
    if found < stop:
        raise refusal(path, "", f"{found:,} rows", f"{stop:,}", "do not change inputs during a run")


def read_column(path: Path, name: str) -> Iterator[Array]:
    """Read one column of numbers in pieces."""
    with opened(path, limit=MAX_INPUT_BYTES, buffer_bytes=BUFFER_BYTES) as file:
        for columns, _ in _pieces(path, file, [name], 0, file.metadata.num_rows):
            yield columns[name]


def write_view_table(path: str | Path, views: View | Iterable[View], *, group: int = AT_ONCE) -> None:
    """Write a view, or the pieces of one, as Parquet: whole or not at all.

    Parameters
    ----------
    path : path
        The file to write.
    views : View or iterable of View
        The first one's camera and person hold for all.
    group : int
        Rows of a row group: about a shard's frames.

    Raises
    ------
    InputError
        Where pyarrow is not installed, or the file cannot be written.

    Examples
    --------
    >>> import posekit, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_view_table(f"{folder}/walk.parquet", posekit.builtin_view("seq1"))
    ...     open_view_table(Path(folder) / "walk.parquet").rows
    5
    """
    pieces = iter((views,) if isinstance(views, View) else views)
    first = next(pieces, None)
    if first is None:
        raise InputError(f"{path}: no view is to be written; give at least one")

    def rows() -> Iterator[ImageRows]:
        start = 0
        for view in (first, *()) if isinstance(views, View) else _chained(first, pieces):
            yield ImageRows.of_view(view, np.arange(start, start + len(view)))
            start += len(view)

    with replacing(path) as file:
        write_rows(file, head_text(first), rows(), group=group)


def write_rows(file: BinaryIO, head: str, pieces: Iterable[ImageRows], *, group: int = AT_ONCE) -> None:
    """Write rows into an open file, with camera and person."""
    pa = extra("pyarrow", "parquet", "writing Parquet")
    pq = extra("pyarrow.parquet", "parquet", "writing Parquet")
    uv = uv_columns(head)
    kinds = {
        "frame": pa.int64(),
        **dict.fromkeys(("time", *uv, *CONFIDENCE_COLUMNS, *ROOT_COLUMNS), pa.float64()),
    }
    schema = pa.schema(list(kinds.items()), metadata={HEAD_KEY: head.encode()})
    with pq.ParquetWriter(file, schema, compression="zstd", use_dictionary=False) as writer:
        for rows in pieces:
            count = len(rows)
            flat = {
                "frame": rows.frame,
                "time": rows.time,
                **dict(zip(uv, rows.points.reshape(count, -1).T, strict=True)),
                **dict(zip(CONFIDENCE_COLUMNS, rows.confidence.T, strict=True)),
                **dict(zip(ROOT_COLUMNS, rows.root.T, strict=True)),
            }
            arrays = [pa.array(flat[name], kind, from_pandas=True) for name, kind in kinds.items()]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema), row_group_size=group)


def _chained(first: View, rest: Iterator[View]) -> Iterator[View]:
    yield first
    yield from rest


def _pieces(
    path: Path, file: Any, names: Sequence[str], start: int, stop: int
) -> Iterator[tuple[dict[str, Array], int]]:
    """Yield columns of rows from `start` to `stop`, and the number of the first of them."""
    pa = extra("pyarrow", "parquet", "reading Parquet")
    at = 0
    for group in range(file.metadata.num_row_groups):
        rows = file.metadata.row_group(group).num_rows
        if at + rows <= start or at >= stop:
            at += rows
            continue
        for batch in file.iter_batches(
            batch_size=AT_ONCE, row_groups=[group], columns=list(names), use_threads=False
        ):
            lower, upper = max(start - at, 0), min(stop - at, batch.num_rows)
            if lower < upper:
                part = batch.slice(lower, upper - lower)
                columns = {
                    name: np.asarray(
                        part.column(name).cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64
                    )
                    for name in names
                }
                _check_finite(path, columns, at + lower)
                yield columns, at + lower
            at += batch.num_rows
            if at >= stop:
                return


def _check_finite(path: Path, columns: dict[str, Array], first: int) -> None:
    for name, values in columns.items():
        if np.isinf(values).any():
            row = first + int(np.argmax(np.isinf(values)))
            raise refusal(path, f"{name}[{row}]", "an infinite number", "a number, or null", "correct it")


def _rows(columns: dict[str, Array], first: int, rate: float | None, uv: tuple[str, ...]) -> ImageRows:
    count = len(next(iter(columns.values())))
    unknown = np.full(count, np.nan)
    frame = columns.get("frame", np.arange(first, first + count, dtype=np.float64))
    numbers: NDArray[np.int64] = frame.astype(np.int64)
    timed = "time" in columns and rate is None
    points = np.stack([columns.get(name, unknown) for name in uv], axis=-1).reshape(count, -1, 2)
    sure = np.stack([columns.get(name, unknown) for name in CONFIDENCE_COLUMNS], axis=-1)
    points = np.where(np.isnan(points).any(axis=-1, keepdims=True), np.nan, points)
    return ImageRows(
        frame=numbers,
        time=columns["time"] if timed else numbers / (rate or ASSUMED_VIEW_RATE),
        points=points,
        confidence=np.where(np.isnan(points[:, : len(POINTS), 0]), np.nan, sure),
        root=np.stack([columns.get(name, unknown) for name in ROOT_COLUMNS], axis=-1),
    )
