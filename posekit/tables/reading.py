"""Read a table: TOML of a schema, validated whole."""

from __future__ import annotations

from pathlib import Path
from typing import Final, TypeVar

from posekit.safe_io.toml_file import read_toml
from posekit.tables.built_in import built_in_document
from posekit.tables.file_model import FileModel, validated

MAX_TABLE_BYTES: Final = 1_000_000

Table = TypeVar("Table", bound=FileModel)


def read_table(path: str | Path, model: type[Table], *, limit: int = MAX_TABLE_BYTES) -> Table:
    """Read a TOML file and validate it.

    Parameters
    ----------
    path : path
        A regular file of at most `limit` bytes.
    model : type
        What it is to hold.
    limit : int
        Bytes.

    Raises
    ------
    InputError
        Where it cannot be read, is no TOML, or is not what the model says: the first error, in one line.
    """
    return validated(model, read_toml(path, limit=limit), path)


def read_built_in(folder: str, name: str, model: type[Table]) -> Table:
    """Read a table that comes with the package: ``<name>.toml`` in a folder of `posekit.urdf`."""
    return validated(model, built_in_document(folder, name), name)
