"""Write files whole or not at all: beside the target first, then renamed over it."""

from __future__ import annotations

import gzip
import json
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, Final

from posekit.errors import InputError, TooLargeError
from posekit.safe_io.json_file import MAX_BYTES
from posekit.safe_io.refusal import cut, refusal
from posekit.safe_io.regular_file import is_packed

MAX_STEM: Final = 80
"""Letters of a file's name that is made of a clip's."""


@contextmanager
def replacing(path: str | Path, *, sync: bool = False) -> Iterator[BinaryIO]:
    """Open a file that takes the place of `path` when the block ends well, and vanishes when it does not.

    Parameters
    ----------
    path : path
        The target. An existing regular file is replaced and its permissions are kept; a symbolic link is
        followed.
    sync : bool
        Whether to wait until the content is on the disk before the rename.

    Yields
    ------
    binary file
        Seekable, in the target's directory.

    Raises
    ------
    InputError
        Where the directory does not exist or may not be written, where the target is a directory or a
        device, and where the disk refuses (full, for instance).
    """
    done = False
    beside = None
    try:
        target = _target(path)
        beside = target.with_name(f".{secrets.token_hex(8)}.part")
        with beside.open("xb") as file:
            yield file
            file.flush()
            if sync:
                os.fsync(file.fileno())
        # The new file takes the old one's permissions: a rename would set those of a file just made.
        if target.exists():
            shutil.copymode(target, beside)
        beside.replace(target)
        done = True
    except OSError as error:
        raise _refused_by_disk(path, error, "a file") from None
    finally:
        if beside is not None and not done:
            with suppress(OSError):  # where nothing can be written, there is nothing to take away
                beside.unlink()


def _refused_by_disk(path: str | Path, error: OSError, what: str) -> InputError:
    """Word that a file or a folder cannot be written."""
    reason = cut(error.strerror or str(error))
    return refusal(path, "", reason, f"{what} that can be written", "check permissions and free space")


def _target(path: str | Path) -> Path:
    """Follow links and refuse what may not be replaced: a device that is renamed over is gone."""
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise refusal(path, "", "a directory", "the name of a file", "add a file name")
    if target.exists() and not target.is_file():
        raise refusal(path, "", "a device or a pipe", "the name of a file", "choose another name")
    if not target.parent.is_dir():
        raise refusal(path, "", "a directory that does not exist", "an existing one", "create it first")
    return target


def check_target(path: str | Path) -> None:
    """Refuse a name that cannot be written: a folder, or one in a folder that is not there."""
    try:
        _target(path)
    except OSError as error:
        raise refusal(
            path, "", error.strerror or str(error), "the name of a file", "choose another"
        ) from None


def write_text(path: str | Path, pieces: Iterable[str]) -> None:
    """Write pieces of text as one UTF-8 file of at most 1e8 bytes, whole or not at all; packed if named ``.json.gz``.

    The bound is that of `posekit.safe_io.read_json`: what is written can be read again.
    """
    written = 0
    with replacing(path) as file, _packing(path, file) as stream:
        for piece in pieces:
            written += stream.write(piece.encode("utf-8"))
            if written > MAX_BYTES:
                raise too_large_to_read(path)


@contextmanager
def _packing(path: str | Path, file: BinaryIO) -> Iterator[BinaryIO | gzip.GzipFile]:
    """Pack what is written where the name says so; the same content is the same file."""
    if not is_packed(path):
        yield file
        return
    with gzip.GzipFile(filename="", fileobj=file, mode="wb", mtime=0) as packed:
        yield packed


def write_lines(path: str | Path, lines: Iterable[str]) -> None:
    """Write lines of text."""
    write_text(path, (f"{line}\n" for line in lines))


def write_json(path: str | Path, document: object) -> None:
    """Write a small document of plain values as JSON, indented."""
    write_text(path, [json.dumps(document, indent=1, allow_nan=False), "\n"])


def make_folder(path: str | Path) -> None:
    """Make a folder for results, and those above it.

    Raises
    ------
    InputError
        Where it cannot be made.
    """
    with _a_folder(path):
        Path(path).mkdir(parents=True, exist_ok=True)


def check_folder(path: str | Path) -> None:
    """Refuse a folder for results that cannot be made: what is there of its path is no folder."""
    place = Path(path).absolute()
    with _a_folder(path):
        os.scandir(next(one for one in (place, *place.parents) if one.is_symlink() or one.exists())).close()


@contextmanager
def _a_folder(path: str | Path) -> Iterator[None]:
    """Word that a folder for results cannot be made."""
    try:
        yield
    except OSError as error:
        raise refusal(
            path, "", error.strerror or str(error), "a folder for results", "choose another name"
        ) from None


@contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """Give a folder beside the target, which takes its place, or whose entries do, when the block ends well.

    Raises
    ------
    InputError
        Where it cannot be written; errors of the block that name it name the target instead.
    """
    beside = path.absolute().with_name(f".{secrets.token_hex(8)}.part")
    try:
        beside.mkdir()
        yield beside
        if path.exists():  # it may be the one that the command was called in
            for entry in beside.iterdir():
                entry.replace(path / entry.name)
        else:
            beside.replace(path)
    except InputError as error:
        raise InputError(str(error).replace(str(beside), str(path))) from None
    except OSError as error:
        raise _refused_by_disk(path, error, "a folder") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


@contextmanager
def results_folder(path: Path) -> Iterator[None]:
    """Make a folder for several results; where one cannot be written, say that those before it stay.

    Raises
    ------
    InputError
        Where the folder cannot be made, or as the block raised it.
    """
    there = set(path.iterdir()) if path.is_dir() else None
    make_folder(path)
    try:
        yield
    except InputError as error:
        if set(path.iterdir()) - (there or set()):
            raise InputError(f"{error}; what was finished before stays in {cut(str(path))}") from None
        if there is None:
            path.rmdir()
        raise


def safe_stem(name: str) -> str:
    """Make a file's name, without its suffix, of any text: letters that every system takes, and not too many."""
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)[:MAX_STEM]


def too_large_to_read(path: str | Path) -> TooLargeError:
    """Word why a JSON file that could not be read again is not written."""
    refused = refusal(
        path,
        "",
        f"more than {MAX_BYTES / 1e6:.0f} MB of JSON",
        "a file that can be read again",
        "name it .npz where the command writes that, or split the input",
    )
    return TooLargeError(str(refused))


def json_pieces(head: dict[str, Any], name: str, items: Iterable[Any]) -> Iterator[str]:
    """Spell ``{**head, name: [items]}`` as JSON, one entry and one item a line, without holding it whole.

    Raises
    ------
    ValueError
        Where a number is not finite: what may be unknown is to be given as None.
    """
    yield "{\n"
    for key, value in head.items():
        yield f" {_spell(key)}: {_spell(value)},\n"
    yield f" {_spell(name)}: ["
    separator = "\n"
    for item in items:
        yield f"{separator}  {_spell(item)}"
        separator = ",\n"
    yield "\n ]\n}\n"


def _spell(value: Any) -> str:
    return json.dumps(value, allow_nan=False, separators=(",", ":"))
