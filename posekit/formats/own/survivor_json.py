"""Tables of survivors as JSON: an object a survivor, with a field a column; null for what is not known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.column import Column, columns_in
from posekit.formats.own.digits import Precision, shortened
from posekit.formats.own.survivor_columns import Likelihoods, SurvivorColumns
from posekit.formats.own.units import Unit
from posekit.geometry import Array


def survivor_rows(
    table: SurvivorColumns | Likelihoods, unit: Unit, *, precision: Precision | None = None
) -> list[dict[str, Any]]:
    """Write a table of survivors as objects, in the unit of the file.

    Parameters
    ----------
    table : SurvivorColumns or Likelihoods
        A dataclass of columns; those that are None are left out.
    unit : {"m", "cm", "mm"}
        The unit of lengths in the file.
    precision : Precision, optional
        Where the noise is known: the digits of numbers; details that a survivor lacks are left out.
    """
    lists: dict[str, list[Any]] = {}
    kind: Any = type(table)
    for name, column in columns_in(kind).items():
        values = getattr(table, name)
        if values is not None:
            lists[column.key] = column_lists(column, values, unit, precision=precision)
            if column.by_check and not values:  # no check was asked for: nothing of each survivor
                lists[column.key] = [{} for _ in range(len(table))]
            if precision and column.detail:
                lists[column.key] = [None if _unknown(one) else one for one in lists[column.key]]
    rows = [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]
    if precision is None:
        return rows
    details = {column.key for column in columns_in(kind).values() if column.detail}
    return [{key: one for key, one in row.items() if one is not None or key not in details} for row in rows]


def _unknown(value: Any) -> bool:
    """Say whether there is no number in a plain value."""
    if isinstance(value, dict):
        return all(map(_unknown, value.values()))
    return all(map(_unknown, value)) if isinstance(value, list) else value is None


def nullable(values: NDArray[Any]) -> list[Any]:
    """Turn an array into lists, with None for NaN."""
    unknown = np.isnan(values) if values.dtype.kind == "f" else np.zeros(1, dtype=np.bool_)
    if not unknown.any():
        return list(values.tolist())
    boxed = values.astype(object)
    boxed[unknown] = None
    return list(boxed.tolist())


def survivor_columns(
    table: type, rows: Sequence[Any], unit: Unit, *, extents: Mapping[str, Any], carried: frozenset[str]
) -> dict[str, Any]:
    """Gather the columns of survivors that were read from JSON.

    Parameters
    ----------
    table : type
        Which columns: a dataclass of them.
    rows : sequence of N models
        What the file says of each survivor.
    unit : {"m", "cm", "mm"}
        The file's.
    extents : mapping
        What a frame without survivors does not tell: how many numbers ``q`` has, which names ``margins``.
    carried : frozenset of str
        Optional columns that the frame has.

    Returns
    -------
    dict
        Values by column, None for optional ones that are not carried: what `table` is made of.
    """
    return {
        name: None
        if column.optional and name not in carried
        else values_of(column, [getattr(row, column.key) for row in rows], unit, extents.get(name))
        for name, column in columns_in(table).items()
    }


def column_lists(column: Column, values: Any, unit: Unit, *, precision: Precision | None = None) -> list[Any]:
    """Write a column as a list with an entry a survivor, in the unit of the file; see `survivor_rows`."""
    if column.kind == "str":
        return list(values)
    if column.kind == "table":
        return survivor_rows(values, unit, precision=precision)
    if column.kind == "objects":
        found = [{name: one.fields(unit) for name, one in row.items()} for row in values]
        return [shortened(one) for one in found] if precision else found
    if column.by_check:
        lists = [nullable(column.in_file(each, unit, precision)) for each in values.values()]
        return [dict(zip(values, row, strict=True)) for row in zip(*lists, strict=True)]
    numbers = column.in_file(values, unit, precision)
    if column.null == "row":
        return [[None if np.isnan(row).any() else row.tolist() for row in matrix] for matrix in numbers]
    return list(numbers.astype(np.int64).tolist()) if column.whole else nullable(numbers)


def values_of(column: Column, found: list[Any], unit: Unit, extent: Any = None) -> Any:
    """Make a column of what a file says of each survivor; `extent` is what no column tells."""
    if column.kind == "str":
        return found
    if column.kind == "table":
        columns = columns_in(column.of).items()
        told = {name for name, one in columns if any(getattr(row, one.key) is not None for row in found)}
        return column.of(**survivor_columns(column.of, found, unit, extents={}, carried=frozenset(told)))
    if column.kind == "objects":
        return [
            {name: column.of.of(one.model_dump(), unit) for name, one in (each or {}).items()}
            for each in found
        ]
    if column.by_check:
        return {
            check: np.array([(each or {}).get(check) for each in found], dtype=np.float64) for check in extent
        }
    shape = tuple(extent if one is None else one for one in column.shape)
    if column.null == "row":
        unknown = [np.nan] * (column.shape[-1] or 0)
        found = [
            None if each is None else [unknown if row is None else row for row in each] for each in found
        ]
    if shape and column.detail:
        nothing = np.full(shape, np.nan).tolist()
        found = [nothing if each is None else each for each in found]
    values: Array = np.array(found, dtype=np.int64 if column.kind == "int" else np.float64)
    return column.in_memory(values.reshape(len(found), *shape), unit)
