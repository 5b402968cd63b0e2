"""The pydantic models of survivors, made from the table of their columns."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, Final

from pydantic import FailFast, Field, create_model

from posekit.formats.own.column import Column, columns_in
from posekit.skeleton import JOINTS
from posekit.tables.file_model import FEW_ENTRIES, FileModel, named

Count = Annotated[int, Field(ge=0, le=2**53)]
MAX_EXTENT: Final = 1000
"""Numbers of an array whose extent no schema says, as that of q."""


MAX_ROWS: Final = 1_000_000
"""Rows of a table of a frame."""


@cache
def model_of(table: Any, *, whole: bool = False) -> type[FileModel]:
    """Make the model of the objects that hold one row of a table each.

    Parameters
    ----------
    table : type
        A dataclass of columns, with its name and description in schemas as `schema_title`.
    whole : bool
        Whether no detail may be left out.
    """
    fields: dict[str, Any] = {}
    for column in columns_in(table).values():
        kind = annotation_of(column, whole=whole)
        fields[column.key] = (
            (kind | None, Field(default=None, description=column.meaning))
            if column.optional
            else (kind, Field(default=None, description=column.meaning))
            if column.detail and not whole
            else (kind, Field(description=column.meaning))
        )
    name, doc = table.schema_title
    return create_model(name, __base__=FileModel, __doc__=doc, **fields)


@cache
def table_model_of(table: Any) -> type[FileModel]:
    """Make the model of an object that holds a table whole: a list for each column (`frame_tables`)."""
    fields: dict[str, Any] = {}
    for column in columns_in(table).values():
        kind: Any = annotation_of(column)
        if not column.once:
            kind = Annotated[list[kind], Field(max_length=MAX_ROWS), FailFast()]
        fields[column.key] = (kind, Field(description=column.meaning))
    name, doc = table.schema_title
    return create_model(name, __base__=FileModel, __doc__=doc, **fields)


def annotation_of(column: Column, *, whole: bool = False) -> Any:
    """Return the type of one survivor's value in JSON."""
    if column.kind == "str":
        return str if column.longest is None else Annotated[str, Field(max_length=column.longest)]
    if column.kind == "table":
        return model_of(column.of, whole=whole)
    if column.kind == "objects":
        model: Any = model_of(column.of)
        return Annotated[dict[str, model], named(JOINTS, "joint")]
    number: Any = Count if column.kind == "int" or column.whole else float
    if column.lower is not None or column.upper is not None:
        number = Annotated[number, Field(ge=column.lower, le=column.upper)]
    kind: Any = number | None if column.null == "number" else number
    if column.by_check:
        return Annotated[dict[str, kind], FEW_ENTRIES]
    for depth, extent in enumerate(reversed(column.shape)):
        inner: Any = kind | None if depth == 1 and column.null == "row" else kind
        kind = (
            Annotated[list[inner], Field(max_length=MAX_EXTENT), FailFast()]
            if extent is None
            else Annotated[list[inner], Field(min_length=extent, max_length=extent)]
        )
    return kind
