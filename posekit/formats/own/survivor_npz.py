"""Tables of survivors as the arrays of an NPZ: a padded array a column, ``refined/chi2`` for a table in the table."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.column import Column, columns_in
from posekit.formats.own.digits import Precision
from posekit.formats.own.npz import Ragged
from posekit.formats.own.survivor_columns import SURVIVOR_COLUMNS
from posekit.formats.own.survivor_json import column_lists
from posekit.formats.own.units import Unit
from posekit.geometry import Array
from posekit.safe_io.npz_file import Archive, not_finite

PADDED_PREFIXES: Final = tuple(
    f"{name}/" if column.by_check or column.kind == "table" else name
    for name, column in SURVIVOR_COLUMNS.items()
    if column.kind != "objects"
)
"""What the names of padded arrays begin with."""

Precisions = Sequence[Precision | None]


def survivor_arrays(
    table: type,
    frames: Sequence[Any],
    unit: Unit,
    *,
    carried: frozenset[str],
    within: str = "",
    precision: Precisions = (),
) -> dict[str, NDArray[Any] | Ragged]:
    """Write the columns of some frames' survivors as arrays, in the unit of the file.

    Parameters
    ----------
    table : type
        Which columns: a dataclass of them.
    frames : sequence of such tables
        One a frame.
    unit : {"m", "cm", "mm"}
        The unit of lengths in the file.
    carried : frozenset of str
        Optional columns that are written: where a frame lacks one, as not known.
    within : str
        What the arrays' names begin with.
    precision : sequence of Precision or None
        The digits of the numbers of frames whose noise is known; where that is of all, they take half the bytes.
    """
    precision = precision or [None] * len(frames)
    arrays: dict[str, NDArray[Any] | Ragged] = {}
    for name, column in columns_in(table).items():
        if column.optional and name not in carried:
            continue
        values = [getattr(frame, name) for frame in frames]
        if column.kind == "table":
            known = [
                column.of.unknown(len(frame.joints)) if each is None else each
                for each, frame in zip(values, frames, strict=True)
            ]
            arrays |= survivor_arrays(
                column.of, known, unit, carried=frozenset(), within=f"{name}/", precision=precision
            )
        elif column.kind == "objects":
            texts = [
                None if each is None else column_lists(column, each, unit, precision=short)
                for each, short in zip(values, precision, strict=True)
            ]
            arrays[name] = np.array(json.dumps(texts, allow_nan=False))
        elif column.by_check:
            for check in values[0]:
                rows = [each[check] for each in values]
                arrays[f"{name}/{check}"] = padded_column(column, rows, unit, precision)
        else:
            rows = [
                np.full(len(frame.joints), column.fill) if each is None else each
                for each, frame in zip(values, frames, strict=True)
            ]
            arrays[within + name] = padded_column(column, rows, unit, precision)
    return arrays


def padded_column(column: Column, rows: Sequence[Any], unit: Unit, precision: Precisions) -> Ragged:
    """Write one column of some frames' survivors as one array; see `survivor_arrays`."""
    if column.kind == "str":
        return Ragged(rows=[np.array(row, dtype=np.str_) for row in rows], fill=column.fill)
    if column.kind == "int":
        return Ragged(rows=rows, fill=column.fill)
    short = all(one is not None or not len(row) for one, row in zip(precision, rows, strict=True))
    written = [column.in_file(row, unit, one) for row, one in zip(rows, precision, strict=True)]
    return Ragged(rows=[row.astype(np.float32) for row in written] if short else written, fill=column.fill)


def survivors_in(
    archive: Archive,
    table: type,
    count: NDArray[np.int64],
    unit: Unit,
    *,
    extents: Mapping[str, Any],
    within: str = "",
) -> dict[str, Any]:
    """Read the columns of all frames' survivors, but for those that are JSON text.

    Parameters
    ----------
    archive : Archive
        The open NPZ.
    table : type
        Which columns: a dataclass of them.
    count : int array (F,)
        Survivors of each frame.
    unit : {"m", "cm", "mm"}
        The file's.
    extents : mapping
        How many numbers ``q`` has, and which names ``margins``.
    within : str
        What the arrays' names begin with.

    Returns
    -------
    dict
        By column one entry a frame; None for an optional column that the archive does not have.
    """
    found: dict[str, list[Any] | None] = {}
    for name, column in columns_in(table).items():
        if column.kind == "table":
            found[name] = _tables(archive, column, count, unit)
        elif column.kind == "objects" or (column.optional and within + name not in archive.names):
            found[name] = None
        elif column.by_check:
            each = {
                check: column_rows(archive, f"{name}/{check}", column, count, ()) for check in extents[name]
            }
            found[name] = [{check: rows[k] for check, rows in each.items()} for k in range(len(count))]
        else:
            shape = tuple(extents[name] if extent is None else extent for extent in column.shape)
            rows = column_rows(archive, within + name, column, count, shape)
            found[name] = (
                [each.tolist() for each in rows]
                if column.kind == "str"
                else [column.in_memory(each, unit) for each in rows]
            )
    return found


def _tables(archive: Archive, column: Column, count: NDArray[np.int64], unit: Unit) -> list[Any] | None:
    """Read a table in the table; None in frames of which some survivor has a first column that is not known."""
    names = list(columns_in(column.of))
    if f"{column.name}/{names[0]}" not in archive.names:
        return None
    found = survivors_in(archive, column.of, count, unit, extents={}, within=f"{column.name}/")
    told = [name for name in names if found[name] is not None]
    rows = [{name: found[name][k] for name in told} for k in range(len(count))]
    return [None if np.isnan(row[names[0]]).any() else column.of(**row) for row in rows]


def column_rows(
    archive: Archive, name: str, column: Column, count: NDArray[np.int64], shape: tuple[int | None, ...]
) -> list[Array]:
    """Read one column of all frames' survivors as the file has it."""
    kinds = {"str": "U", "int": "iu"}.get(column.kind, "f")
    rows = archive.ragged(name, kinds, count, shape)
    for row in rows if kinds == "f" else ():
        if np.isinf(row).any():
            raise not_finite(archive.path, name, row)
    return rows
