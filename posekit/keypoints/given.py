"""What was given to be read: a file or a folder, opened once for all formats that look at it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from posekit.intake import parse_json, read_bytes, refusal
from posekit.intake.text_file import decode

MAX_BYTES = 500_000_000
"""The largest file that is read whole: twice COCO's largest annotations."""
MAX_FILES = 1_000_000
"""Files in a folder."""


@dataclass(frozen=True)
class Given:
    """A file, or a folder of one JSON file a picture.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        By each property where the file cannot be read, is larger than `MAX_BYTES`, or is malformed.
    """

    path: Path

    @cached_property
    def is_folder(self) -> bool:
        """Whether it is a folder."""
        return self.path.is_dir()

    @cached_property
    def files(self) -> tuple[Path, ...]:
        """The JSON files of a folder in the order of the numbers in their names; the file itself else."""
        if not self.is_folder:
            return (self.path,)
        found = sorted((one for one in self.path.iterdir() if one.suffix.lower() == ".json"), key=counted)
        if not found:
            raise refusal(
                self.path, "", "a folder without JSON files", "one JSON file a picture", "give that folder"
            )
        if len(found) > MAX_FILES:
            raise refusal(
                self.path, "", f"{len(found):,} files", f"at most {MAX_FILES:,}", "split the folder"
            )
        return tuple(found)

    @cached_property
    def suffix(self) -> str:
        """The file's ending in lower case, as ``.json``; empty for a folder."""
        return "" if self.is_folder else self.path.suffix.lower()

    @cached_property
    def text(self) -> str:
        """The file as text, UTF-8."""
        return decode(self.path, self._bytes)

    @cached_property
    def document(self) -> Any:
        """What the (first) JSON file holds; None where the file is no JSON by its ending."""
        if self.is_folder:
            return parse_json(self.files[0], read_bytes(self.files[0], limit=MAX_BYTES, too_large=TOO_LARGE))
        return parse_json(self.path, self._bytes) if self.suffix == ".json" else None

    @cached_property
    def _bytes(self) -> bytes:
        return read_bytes(self.path, limit=MAX_BYTES, too_large=TOO_LARGE)


TOO_LARGE = "split it by pictures"


def counted(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Order names by the numbers in them: ``cam.2.json`` before ``cam.10.json``."""
    parts = re.findall(r"\d+|\D+", path.name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts], path.name
