"""Tables of survivors as CSV, Parquet and NPZ; Parquet also in pieces."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.motion.csv_table import read_columns, write_columns
from posekit.formats.motion.parquet import columns_of, opened, write_tables
from posekit.formats.motion.survivors import (
    COORDINATE_COLUMNS,
    KEY_COLUMNS,
    TEXT_COLUMNS,
    SurvivorTable,
    number_columns,
)
from posekit.safe_io import open_npz, refusal, replacing, shown
from posekit.safe_io.npz_file import Archive
from posekit.skeleton import JOINTS

SURVIVORS_SCHEMA: Final = "posekit.survivors/1"
MAX_BYTES: Final = 1_000_000_000
_VALUE: Final = "values/"
_SUFFIXES: Final = {".csv": "csv", ".parquet": "parquet", ".pq": "parquet", ".npz": "npz"}


def write_survivors(path: str | Path, table: SurvivorTable) -> None:
    """Write a table of survivors as CSV, Parquet or NPZ by the end of the name, whole or not at all.

    An NPZ holds ``joints`` (N, 14, 3), ``joint_names``, ``frame``, ``time``, ``survivor``, ``values/<name>``,
    ``branches``, ``picture``, and ``schema``.

    Raises
    ------
    InputError
        Where the name ends otherwise, pyarrow is not installed, or the file cannot be written.
    """
    kind = _kind(path)
    if kind == "csv":
        write_columns(path, table.columns)
    elif kind == "parquet":
        write_survivor_pieces(path, (table,))
    else:
        arrays = {
            "schema": np.array(SURVIVORS_SCHEMA),
            "joint_names": np.array(JOINTS),
            "frame": table.frame,
            "time": table.time,
            "survivor": table.survivor,
            "joints": table.joints,
            **{_VALUE + name: values for name, values in table.values.items()},
        }
        arrays |= {name: values for name, values in table.columns.items() if name in TEXT_COLUMNS}
        with replacing(path) as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)


def read_survivors(path: str | Path) -> SurvivorTable:
    """Read a table of survivors that `write_survivors` wrote, or that pandas wrote with the same columns.

    Raises
    ------
    InputError
        Where it is no such table, or cannot be read.
    """
    kind = _kind(path)
    if kind == "csv":
        return SurvivorTable.of_columns(read_columns(path, number_columns), str(path))
    if kind == "parquet":
        with opened(path) as file:
            return SurvivorTable.of_columns(columns_of(path, file), str(path))
    with open_npz(path, limit=MAX_BYTES) as archive:
        schema = str(archive.array("schema", "U", ()))
        names = tuple(archive.array("joint_names", "U", (None,)).tolist())
        if schema != SURVIVORS_SCHEMA or names != JOINTS:
            raise refusal(
                path, "schema", shown(schema), f'"{SURVIVORS_SCHEMA}" with the 14 joints', "give such a file"
            )
        return SurvivorTable(
            frame=archive.array("frame", "iu", (None,)),
            time=archive.array("time", "f", (None,)),
            survivor=archive.array("survivor", "iu", (None,)),
            joints=archive.array("joints", "f", (None, len(JOINTS), 3)),
            values={
                name.removeprefix(_VALUE): archive.array(name, "f", (None,))
                for name in archive.names
                if name.startswith(_VALUE)
            },
            branches=_texts(archive, "branches"),
            pictures=_texts(archive, "picture"),
            source=str(path),
        )


def write_survivor_pieces(
    path: str | Path, tables: Iterable[SurvivorTable], told: Mapping[str, str] | None = None
) -> None:
    """Write tables of the same columns one after the other into one Parquet file: a batch need not be held whole.

    What else is `told` stands in the file's metadata.
    """
    write_tables(path, ((table.columns, {}) for table in tables), told)


def read_survivor_pieces(path: str | Path) -> Iterator[SurvivorTable]:
    """Read a Parquet file of survivors one row group after the other."""
    with opened(path) as file:
        for index in range(file.metadata.num_row_groups):
            yield SurvivorTable.of_columns(columns_of(path, file, index), str(path))


def _texts(archive: Archive, name: str) -> tuple[str, ...]:
    return tuple(archive.array(name, "U", (None,)).tolist()) if name in archive.names else ()


def _kind(path: str | Path) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in _SUFFIXES:
        raise refusal(path, "format", shown(suffix), f"one of {', '.join(_SUFFIXES)}", "name the file so")
    return _SUFFIXES[suffix]


def is_survivors(given: GivenFile) -> bool:
    """Tell whether a table has all the columns of a table of survivors, or an NPZ its schema.

    Parameters
    ----------
    given : GivenFile
        A file whose name ends as those of tables do.
    """
    if given.suffix == ".npz":
        return given.schema == SURVIVORS_SCHEMA
    if given.suffix == ".csv":
        return {*KEY_COLUMNS, *COORDINATE_COLUMNS} <= given.columns
    if not given.start.startswith(b"PAR1"):
        return False
    with opened(given.path) as file:
        return {*KEY_COLUMNS, *COORDINATE_COLUMNS} <= set(file.schema_arrow.names)
