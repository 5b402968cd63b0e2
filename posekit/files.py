"""Read files once, with a size limit and gzip decompression, and write files completely or not at all."""

from __future__ import annotations

import gzip
import os
import stat
import tomllib
import zlib
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from posekit.errors import InputError, TooLargeError, cut, nearest, refusal, shown

#: Folder of the data that comes with posekit: the figure, layouts, ranges, priors, profiles.
DATA: Final = Path(__file__).resolve().parent / "urdf"

#: Largest size of a file, packed and unpacked, bytes; a larger recording must be cut into clips.
MAX_BYTES: Final = 2_000_000_000


def read_bytes(path: str | Path) -> bytes:
    """Read a regular file, and decompress it if it is gzipped.

    Raises
    ------
    InputError
        If the file does not exist, cannot be read or decompressed, or is larger than `MAX_BYTES`.
    """
    try:
        with Path(path).open("rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise refusal(path, "", "no regular file", "a file", "give the path of a file")
            if status.st_size > MAX_BYTES:
                raise _too_large(path)
            data = file.read()
    except IsADirectoryError:
        raise refusal(path, "", "a folder", "a file", "give one of its files") from None
    except OSError as error:
        remedy = nearest(Path(path).name, _names_beside(Path(path)), "check the path")
        raise refusal(path, "", error.strerror or "an error", "a file that can be read", remedy) from None
    except ValueError:  # a null character in the path
        raise refusal("", "", repr(str(path)), "the path of a file", "check the path") from None
    if data[:2] != b"\x1f\x8b":
        return data
    try:
        with gzip.GzipFile(fileobj=BytesIO(data)) as packed:
            data = packed.read(MAX_BYTES + 1)
    except (OSError, EOFError, zlib.error):
        raise refusal(path, "", "a damaged gzip file", "a complete file", "copy it again") from None
    if len(data) > MAX_BYTES:
        raise _too_large(path)
    return data


def read_table(name: str, folder: str, built_in: Sequence[str], schema: str, option: str) -> dict[str, Any]:
    """Read a TOML file, and raise an error if it does not state the given schema.

    Parameters
    ----------
    name : str
        A name of `built_in`, or the path of a file.
    folder, schema, option : str
        Folder of the built-in tables; schema that the table must state; name of the option that selects the table, for
        error messages.

    Raises
    ------
    InputError
        If the table does not exist, or is not a TOML table of the schema.
    """
    path = DATA / folder / f"{name}.toml" if name in built_in else Path(name)
    if not name or not path.is_file():
        raise refusal(option, "", cut(name), "a name or a TOML file", nearest(name, built_in))
    table = parse_toml(read_bytes(path), name)
    if table.get("schema") != schema:
        raise refusal(name, "schema", shown(table.get("schema")), schema, "state it")
    return table


def parse_toml(data: bytes, source: str) -> dict[str, Any]:
    """Parse TOML.

    Raises
    ------
    InputError
        If the text is not valid TOML; the error names the line.
    """
    try:
        return tomllib.loads(text(data, source))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise refusal(source, "", str(error), "a TOML file", "correct the line") from None


def _names_beside(path: Path) -> list[str]:
    """List the names of files in the folder of a missing file."""
    try:
        return [one.name for one in path.parent.iterdir()]
    except OSError:
        return []


def text(data: bytes, source: str) -> str:
    """Decode a text file: UTF-8, UTF-16 with a byte-order mark, or otherwise Latin-1."""
    if b"\x00" in data[:1000] and data[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        raise refusal(source, "", "a binary file", "a text file", "check the file's name")
    for encoding in ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "latin-1"):
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise refusal(source, "", "a damaged text", "UTF-8", "save it as UTF-8")


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file completely or not at all, by renaming a temporary file; gzip it if its name ends in ``.gz``."""
    path = Path(path)
    if len(data) > MAX_BYTES:
        raise _too_large(path)
    if path.suffix.lower() == ".gz":
        data = gzip.compress(data, mtime=0)
    new = path.with_name(f".{path.name}.{os.urandom(4).hex()}")
    try:
        if path.exists() and not path.is_file():  # a device or a pipe must not be replaced
            path.write_bytes(data)
            return
        new.write_bytes(data)
        new.replace(path)
    except OSError as error:
        new.unlink(missing_ok=True)
        why = error.strerror or "an error"
        raise refusal(path, "", why, "a place to write", "check folder and rights") from None


def _too_large(path: str | Path) -> InputError:
    got = f"more than {MAX_BYTES:,} bytes"
    return refusal(path, "", got, "a smaller file", "cut it into clips", error=TooLargeError)
