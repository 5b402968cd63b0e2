"""Files that are there whole and on the disk, or not at all: what a run writes while it may be killed."""

from __future__ import annotations

import errno
import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final

from posekit.errors import PosekitError
from posekit.safe_io import cut, refusal

PARTS_FOLDER: Final = ".parts"
"""The folder beside the results in which files grow before they are renamed."""

DISK_FULL_ERRORS: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class OutputError(PosekitError):
    """What was computed cannot be written: the rest of a run could not be either."""


@contextmanager
def whole(path: Path, parts: Path) -> Iterator[BinaryIO]:
    """Open a file that takes the place of `path` when the block ends well, on the disk before it has its name.

    It grows in `parts`, a folder of the same file system, where a process that is killed leaves what it had: nothing
    that has the name of a result is ever half written.

    Raises
    ------
    OutputError
        Where it cannot be written: no space is left, or the folder is gone.
    """
    part = parts / f"{secrets.token_hex(8)}.part"
    with writing(path):
        part.parent.mkdir(exist_ok=True)
        file = part.open("xb")
    try:
        yield file
        with writing(path):
            file.flush()
            os.fsync(file.fileno())
            file.close()
            part.replace(path)
            _sync_folder(path.parent)
    except BaseException as error:
        with suppress(OSError):  # it tries once more to write what the disk refused
            file.close()
        part.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in DISK_FULL_ERRORS:
            raise _refused(path, error) from None
        raise


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say in one line what the operating system refused."""
    try:
        yield
    except OSError as error:
        raise _refused(path, error) from None


def _refused(path: Path, error: OSError) -> OutputError:
    reason = cut(error.strerror or str(error))
    remedy = "make space" if error.errno in DISK_FULL_ERRORS else "check the folder and its permissions"
    return OutputError(
        str(refusal(path, "", reason, "a file that can be written", f"{remedy}, and run it again"))
    )


def write_document(path: Path, document: object, parts: Path) -> None:
    """Write a small document as JSON."""
    text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
    with whole(path, parts) as file, writing(path):
        file.write(text.encode("utf-8", "surrogateescape") + b"\n")


def clear(parts: Path) -> None:
    """Remove what killed processes left."""
    for part in parts.glob("*.part"):
        part.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Put the new name on the disk too."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
