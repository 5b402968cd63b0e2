"""What decides a result, in a few letters: hashes of files, folders and settings."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from posekit.formats.given_file import GivenFile
from posekit.safe_io import open_file
from posekit.safe_io.regular_file import unreadable

DIGEST_LETTERS: Final = 16
"""Of a hash that is part of a name: 64 bits."""

AT_ONCE: Final = 1 << 20
"""Bytes."""

MAX_INPUT_BYTES: Final = 1 << 62
"""Bytes: how large a file may be is for its reader to say."""


def of_file(path: Path) -> str:
    """Return the SHA-256 of a file's content.

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    content = hashlib.sha256()
    with open_file(path, limit=MAX_INPUT_BYTES) as file:
        try:
            while piece := file.read(AT_ONCE):
                content.update(piece)
        except OSError as error:
            raise unreadable(path, error) from None
    return content.hexdigest()


def of_input(path: Path) -> str:
    """Return the SHA-256 of a file, or of the names and contents of a folder's JSON files."""
    if not path.is_dir():
        return of_file(path)
    content = hashlib.sha256()
    for file in GivenFile(path).files:
        content.update(json.dumps([file.name, of_file(file)]).encode())
    return content.hexdigest()


def of_values(*values: Mapping[str, Any] | list[Any] | str | int) -> str:
    """Return a short hash of plain values: the same for equal ones, in whichever order mappings hold them."""
    text = json.dumps(values, sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()[:DIGEST_LETTERS]
