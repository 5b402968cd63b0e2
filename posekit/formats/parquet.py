"""Parquet: tables of columns, read and written by pyarrow (the extra ``parquet``)."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from posekit.errors import PosekitError, one_line, refusal
from posekit.formats.tables import Table

MAX_VALUES: Final = 100_000_000
ROWS_A_GROUP: Final = 100_000


def _arrow() -> tuple[Any, Any]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise PosekitError("Parquet needs pyarrow: install posekit[parquet]") from None
    return pa, pq


def parse(data: bytes, source: str) -> Table:
    """Read the columns of a Parquet file, numbers or text; null becomes NaN or empty. `Table.about` is the metadata.

    Raises
    ------
    InputError
        If the file is damaged or too large.
    PosekitError
        If pyarrow is not installed.
    """
    pa, pq = _arrow()
    try:
        with pq.ParquetFile(io.BytesIO(data), pre_buffer=False, page_checksum_verification=True) as file:
            rows, count = file.metadata.num_rows, file.metadata.num_columns
            if rows * count > MAX_VALUES:
                got = f"{rows:,} rows of {count:,} columns"
                raise refusal(source, "", got, f"at most {MAX_VALUES:,} values", "cut it into clips")
            table = file.read(use_threads=False)
            named = zip(table.column_names, table.columns, strict=True)
            columns = {name: _column(pa, values) for name, values in named}
            metadata = {**(file.schema_arrow.metadata or {}), **(file.metadata.metadata or {})}
    except (pa.ArrowException, OSError, MemoryError, UnicodeDecodeError, ValueError) as error:
        reason = one_line(str(error))[:100] or type(error).__name__
        raise refusal(source, "", f"a damaged file ({reason})", "a Parquet file", "write it again") from None
    about = {
        key.decode("utf-8", "replace"): value.decode("utf-8", "replace")
        for key, value in metadata.items()
        if not key.startswith((b"ARROW:", b"pandas"))
    }
    return Table.of_columns(columns, about, source)


def _column(pa: Any, values: Any) -> Any:
    kind = values.type
    if pa.types.is_integer(kind) and not values.null_count:
        return values.to_numpy()
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
        return np.asarray(values.cast(pa.float64()).to_numpy(), dtype=np.float64)
    return np.array(["" if one is None else str(one) for one in values.to_pylist()], dtype=np.str_)


def packed_table(columns: Mapping[str, Any], about: Mapping[str, str]) -> bytes:
    """Return columns of equal length as bytes of Parquet, with metadata that pandas and pyarrow do not change."""
    pa, pq = _arrow()
    arrays = {}
    for name, values in columns.items():
        array = np.asarray(values)
        text = array.dtype.kind in "US"
        arrays[name] = pa.array(array.tolist(), pa.string()).dictionary_encode() if text else pa.array(array)
    table = pa.table(arrays).replace_schema_metadata({key: value for key, value in about.items() if value})
    file = io.BytesIO()
    pq.write_table(table, file, row_group_size=ROWS_A_GROUP, write_page_checksum=True)
    return file.getvalue()
