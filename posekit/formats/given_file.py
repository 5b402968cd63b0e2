"""A file or folder that was given to be read, opened once for all formats that look at it."""

from __future__ import annotations

import gzip
import re
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from posekit.errors import InputError
from posekit.safe_io import cut, open_file, open_npz, parse_json, read_bytes, read_toml, refusal
from posekit.safe_io.regular_file import is_packed, plain_suffix
from posekit.safe_io.text_file import decode

MAX_BYTES = 500_000_000
"""The largest file that is read whole: twice COCO's largest annotations."""
MAX_FILES = 1_000_000
"""The largest number of files in a folder."""
MAX_DECLARED = 16_000_000_000
"""Bytes that an NPZ may declare when the names of its arrays are read: what is too large is for its reader to say."""
ANY_SIZE = 1 << 62
"""Bytes: how large a file may be is for its reader to say."""
FIRST_BYTES = 4096
"""Bytes of a file by which binary formats are told."""
FIRST_LINE_BYTES = 100_000
"""Bytes of a table in which its first line is looked for."""


@dataclass(frozen=True)
class GivenFile:
    """A file, or a folder of one JSON file a picture.

    Parameters
    ----------
    path : Path
        Where it is; whether it is there is found out by reading it.

    Raises
    ------
    InputError
        By each property where the file cannot be read, is larger than `MAX_BYTES`, or is malformed.
    """

    path: Path

    @cached_property
    def is_folder(self) -> bool:
        """Whether it is a folder."""
        try:
            return self.path.is_dir()
        except (OSError, ValueError):  # a name that is no name: opening it says so
            return False

    @cached_property
    def files(self) -> tuple[Path, ...]:
        """The JSON files of a folder in the order of the numbers in their names; the file itself else."""
        if not self.is_folder:
            return (self.path,)
        try:
            entries = list(self.path.iterdir())
        except OSError as error:
            reason = cut(error.strerror or str(error))
            raise refusal(self.path, "", reason, "a readable folder", "check its permissions") from None
        found = sorted((one for one in entries if is_json_name(one.name)), key=counted)
        if not found:
            inside = [one.name for one in sorted(entries) if one.is_dir() and holds_json(one)]
            raise refusal(
                self.path,
                "",
                f"a folder without JSON files; {', '.join(inside[:4])} in it have some"
                if inside
                else "a folder without JSON files",
                "one JSON file a picture, of one camera",
                f"give {inside[0]}" if inside else "give that folder",
            )
        if len(found) > MAX_FILES:
            raise refusal(
                self.path, "", f"{len(found):,} files", f"at most {MAX_FILES:,}", "split the folder"
            )
        return tuple(found)

    @property
    def alone(self) -> GivenFile | None:
        """The one JSON file of a folder that has no other; None else."""
        return GivenFile(self.files[0]) if self.is_folder and len(self.files) == 1 else None

    @cached_property
    def suffix(self) -> str:
        """The file's ending in lower case, as ``.json``, packed or not; empty for a folder."""
        return "" if self.is_folder else plain_suffix(self.path)

    @cached_property
    def text(self) -> str:
        """The file as text, UTF-8."""
        return decode(self.path, self._bytes)

    @cached_property
    def is_json(self) -> bool:
        """Whether the (first) file is JSON: by its ending, or because it begins like it."""
        first = self.files[0]
        if is_packed(first):
            return True
        with open_file(first, limit=MAX_BYTES, too_large=TOO_LARGE) as file:
            start = file.read(64).removeprefix(b"\xef\xbb\xbf")
        return first.suffix.lower() == ".json" or _JSON.match(start) is not None

    @cached_property
    def document(self) -> Any:
        """What the (first) JSON file holds; None where the file is no JSON."""
        return _parsed(self.files[0]) if self.is_json else None

    def documents(self) -> Iterator[tuple[Path, Any]]:
        """Go through the JSON files of a folder in their order, or the one file: each with what it holds."""
        for index, path in enumerate(self.files):
            yield path, self.document if index == 0 else _parsed(path)

    @cached_property
    def start(self) -> bytes:
        """The first bytes of the file; none of a folder, or where it cannot be read."""
        return first_bytes(self.path)

    @cached_property
    def columns(self) -> frozenset[str]:
        """The names in the first line of a table of text."""
        with open_file(self.path, limit=ANY_SIZE) as file:
            line = file.read(FIRST_LINE_BYTES).partition(b"\n")[0].decode("utf-8", "replace").lstrip("\ufeff")
        return frozenset(name.strip().strip('"') for name in re.split("[,;\t]", line))

    @cached_property
    def arrays(self) -> frozenset[str]:
        """The names of the arrays in an NPZ; none where the file is no archive."""
        if not self._is_archive:
            return frozenset()
        with open_npz(self.path, limit=MAX_DECLARED) as archive:
            return frozenset(archive.names)

    @cached_property
    def schema(self) -> str:
        """The schema that a JSON, NPZ, TOML or Parquet file names, as ``posekit.view/1``; empty where it names none."""
        if self.suffix == ".npz" and "schema" in self.arrays:
            with open_npz(self.path, limit=MAX_DECLARED) as archive:
                return str(archive.array("schema", "U", ()))
        if self.suffix == ".parquet" and self.start.startswith(b"PAR1"):
            from posekit.formats.own.result_parquet import packed_schema

            return packed_schema(self.path)
        if self.suffix == ".toml":
            return str(read_toml(self.path, limit=MAX_TOML_BYTES).get("schema", ""))
        if self.suffix == ".json":
            if said := _SCHEMA_FIRST.match(self.start):  # as posekit writes it: its reader parses it, once
                return said[1].decode()
            return str(self.document.get("schema", "")) if isinstance(self.document, dict) else ""
        return ""

    @cached_property
    def _is_archive(self) -> bool:
        return self.suffix == ".npz" and zipfile.is_zipfile(self.path)

    @cached_property
    def _bytes(self) -> bytes:
        return read_bytes(self.path, limit=MAX_BYTES, too_large=TOO_LARGE)


def first_bytes(path: Path) -> bytes:
    """Return the first bytes of a file; none where it cannot be read.

    Parameters
    ----------
    path : Path
        A file or folder.
    """
    try:
        with open_file(path, limit=ANY_SIZE) as file:
            if not is_packed(path):
                return file.read(FIRST_BYTES)
            with gzip.GzipFile(fileobj=file) as packed:
                return packed.read(FIRST_BYTES)
    except (InputError, OSError, EOFError, zlib.error):
        return b""


TOO_LARGE = "split it by pictures"
MAX_TOML_BYTES = 10_000_000
"""The largest TOML file whose schema is looked for."""
_JSON = re.compile(rb'\s*(\{\s*["}]|\[\s*(\{|\]|\[\s*[\[{\d-]))')
"""How JSON begins, and TOML, whose tables have names in brackets, does not."""


_SCHEMA_FIRST = re.compile(rb'(?:\xef\xbb\xbf)?\s*\{\s*"schema"\s*:\s*"(posekit\.[a-z_]+/\d+)"\s*[,}]')
"""How JSON begins that names its schema first."""


def _parsed(path: Path) -> Any:
    return parse_json(path, read_bytes(path, limit=MAX_BYTES, too_large=TOO_LARGE))


def is_json_name(name: str) -> bool:
    """Tell whether a name in a folder is a JSON file's; hidden ones are other programs' business."""
    return name.lower().endswith(".json") and not name.startswith(".")


def holds_json(folder: Path) -> bool:
    """Tell whether a folder has a JSON file in it."""
    try:
        return any(is_json_name(one.name) for one in folder.iterdir())
    except OSError:
        return False


def counted(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Order names by the numbers in them: ``cam.2.json`` before ``cam.10.json``."""
    parts = re.findall(r"[0-9]+|[^0-9]+", path.name)
    return [(int(part), "") if part[0] in "0123456789" else (-1, part) for part in parts], path.name
