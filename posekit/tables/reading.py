"""Read a table: TOML of a schema, validated whole."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Final, TypeVar

from posekit.safe_io.refusal import nearest, refusal, shown
from posekit.safe_io.toml_file import read_toml
from posekit.tables.built_in import built_in_document
from posekit.tables.file_model import FileModel, validated

MAX_TABLE_BYTES: Final = 1_000_000

Table = TypeVar("Table", bound=FileModel)
Made = TypeVar("Made")


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


@cache
def built_in_names(folder: str) -> tuple[str, ...]:
    """Return the names of the tables in a folder of `posekit.urdf`."""
    files = (resources.files("posekit.urdf") / folder).iterdir()
    return tuple(sorted(one.name.removesuffix(".toml") for one in files if one.name.endswith(".toml")))


def named_table(
    name: str | Path, model: type[Table], make: Callable[[Table, str], Made], *, folder: str, what: str
) -> Made:
    """Make something of a table that comes with the package, or of a TOML file.

    Parameters
    ----------
    name : str or path
        One of `built_in_names`, or the file.
    model : type
        What the table is to hold.
    make : callable
        Makes the thing of the table, and of what errors are to call it.
    folder : str
        Where the tables of that kind are, in `posekit.urdf`.
    what : str
        What it is, for errors: ``"linkage"``.

    Raises
    ------
    InputError
        Where there is neither, or the file is not what the model says.
    """
    known, text = built_in_names(folder), str(name)
    if text in known:
        built_in: Made = _built_in(folder, text, model, make)
        return built_in
    try:
        there = bool(text) and (Path(name).suffix.lower() == ".toml" or Path(name).exists())
    except (OSError, ValueError):  # too long for a path, or a NUL in it
        there = False
    if not there:
        raise refusal("", what, shown(text), f"{', '.join(known)} or a TOML file", nearest(text, known))
    return make(read_table(name, model), text)


@cache
def _built_in(folder: str, name: str, model: type[Table], make: Callable[[Table, str], Made]) -> Made:
    return make(read_built_in(folder, name, model), name)
