"""What is said of a whole frame in columns of different lengths, as its set and its answer are: JSON and NPZ.

Each is a dataclass whose fields are columns (`posekit.formats.own.column`). In JSON each column is a list; in an NPZ
the columns of all frames are padded arrays, with how long each is in ``counts`` (F frames, a column each), -1 in frames
that lack it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.column import columns_in
from posekit.formats.own.digits import Precision
from posekit.formats.own.npz import Ragged
from posekit.formats.own.survivor_json import column_lists, values_of
from posekit.formats.own.survivor_npz import Precisions, column_rows, padded_column
from posekit.formats.own.units import Unit
from posekit.geometry import Array
from posekit.safe_io.npz_file import Archive
from posekit.safe_io.refusal import refusal


def table_fields(table: Any, unit: Unit, *, precision: Precision | None) -> dict[str, Any]:
    """Write a table as JSON has it, in the unit of the file."""
    columns = columns_in(table.__class__)
    return {
        column.key: getattr(table, name)
        if column.once
        else column_lists(column, getattr(table, name), unit, precision=precision)
        for name, column in columns.items()
    }


def table_of(kind: Any, given: Any, unit: Unit) -> Any:
    """Make a table of a kind of what JSON says, as its model has it."""
    return kind(
        **{
            name: getattr(given, column.key)
            if column.once
            else values_of(column, getattr(given, column.key), unit)
            for name, column in columns_in(kind).items()
        }
    )


def table_arrays(
    kind: Any, tables: Sequence[Any], unit: Unit, *, within: str, precision: Precisions
) -> dict[str, Any]:
    """Write the tables of all frames, None where there is none, as the arrays of an NPZ.

    Parameters
    ----------
    kind : type
        Of the tables.
    tables : sequence of F tables or None
        One a frame.
    unit : {"m", "cm", "mm"}
        The unit of lengths in the file.
    within : str
        What the arrays' names begin with: ``set/``.
    precision : sequence of Precision or None
        The digits of the numbers of frames whose noise is known.
    """
    known = [table for table in tables if table is not None]
    if not known:
        return {}
    columns = columns_in(kind)
    any_known = next((one for one in precision if one is not None), None)
    short = [any_known if table is None else one for one, table in zip(precision, tables, strict=True)]
    there = np.array([table is not None for table in tables])
    counts, arrays = [], {}
    for name, column in columns.items():
        none = np.atleast_1d(getattr(known[0], name))[:0]
        rows = [none if table is None else np.atleast_1d(getattr(table, name)) for table in tables]
        counts.append(np.where(there, [len(row) for row in rows], -1))
        written = padded_column(column, rows, unit, short)
        if column.kind == "int":
            # A signed type that holds the largest, whose negative alone would fit into one that is too small.
            least = np.min_scalar_type(-max(int(row.max(initial=1)) for row in rows) - 1)
            written = Ragged(rows=[row.astype(least) for row in rows], fill=-1)
        arrays[within + name] = written
    return {f"{within}counts": np.stack(counts, axis=1), **arrays}


def tables_in(archive: Archive, kind: Any, frames: int, unit: Unit, *, within: str) -> list[Any] | None:
    """Read the tables of all frames from an NPZ; None where it has none of this kind."""
    if f"{within}counts" not in archive.names:
        return None
    columns = columns_in(kind)
    counts = archive.array(f"{within}counts", "iu", (frames, len(columns))).astype(np.int64)
    there: NDArray[np.bool_] = np.asarray((counts >= 0).all(axis=1))
    if not (there | np.asarray((counts < 0).all(axis=1))).all():
        raise refusal(
            archive.path, f"{within}counts", "some columns of a frame", "all or none", "write the file again"
        )
    found: dict[str, list[Array]] = {}
    for place, (name, column) in enumerate(columns.items()):
        count = np.maximum(counts[:, place], 0)
        found[name] = column_rows(archive, within + name, column, count, column.shape)
    return [
        kind(
            **{
                name: _one(archive, within + name, rows[k])
                if columns[name].once
                else columns[name].in_memory(rows[k], unit)
                for name, rows in found.items()
            }
        )
        if there[k]
        else None
        for k in range(frames)
    ]


def _one(archive: Archive, name: str, row: Array) -> Any:
    """Return the one value of a frame."""
    if len(row) != 1:
        raise refusal(archive.path, name, f"{len(row)} values", "one a frame", "write the file again")
    return row[0].item()
