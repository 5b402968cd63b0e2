"""The folder of a run: what was asked, what is done and what failed; one run at a time writes there."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from posekit.batch.durable import PARTS_FOLDER, clear, write_document, writing
from posekit.batch.intact import MANIFEST_FILE
from posekit.batch.shard import SHARDS_FOLDER
from posekit.batch.staging import STAGED_FOLDER
from posekit.errors import InputError
from posekit.safe_io import read_json, refusal
from posekit.safe_io.writing import make_folder

RUN_SCHEMA: Final = "posekit.batch/1"
MANIFEST_SCHEMA: Final = "posekit.batch_manifest/1"
ASKED_FILE: Final = "batch.json"
LOCK_FILE: Final = ".lock"
OWN_ENTRIES: Final = (ASKED_FILE, MANIFEST_FILE, LOCK_FILE, PARTS_FOLDER, STAGED_FOLDER, SHARDS_FOLDER)


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A shard, or an input, of which nothing came.

    Parameters
    ----------
    shard : str
        The name of the file that is not there; empty where the input could not be opened.
    input : str
        The input that it is of.
    person, start, stop : int or None
        Whose frames: rows from `start` to before `stop`.
    error : str
        Why, in one line.
    attempts : int
        How often it was tried.
    died : bool
        Whether a process died of it each time: poison.
    """

    shard: str
    input: str
    person: int | None
    start: int | None
    stop: int | None
    error: str
    attempts: int
    died: bool

    def document(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {
            "shard": self.shard,
            "input": self.input,
            "person": self.person,
            "frames": None if self.start is None else [self.start, self.stop],
            "error": self.error,
            "attempts": self.attempts,
            "killed_its_process": self.died,
        }


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is asked of a run.

    Parameters
    ----------
    hash : str
        Of the settings.
    settings : mapping
        Plain values: everything that decides the results but the inputs.
    inputs : mapping of str to str
        SHA-256 of each input's content, by name.
    root : Path
        From where they are named.
    """

    hash: str
    settings: Mapping[str, Any]
    inputs: Mapping[str, str]
    root: Path


@dataclass(frozen=True, kw_only=True)
class RunFolder:
    """An open folder, held against other runs; made by `run_folder`.

    Parameters
    ----------
    path : Path
        Where it is.
    """

    path: Path

    @property
    def parts(self) -> Path:
        """Where files grow."""
        return self.path / PARTS_FOLDER

    def write_asked(self, asked: Asked) -> None:
        """Note what is asked, of which contents."""
        document = {"schema": RUN_SCHEMA, **asdict(asked), "root": str(asked.root)}
        write_document(self.path / ASKED_FILE, document, self.parts)

    def asked(self) -> Asked | None:
        """Return what was asked of the run that was here; None where there was none.

        Raises
        ------
        InputError
            Where the note is not one of a run's.
        """
        file = self.path / ASKED_FILE
        if not file.is_file():
            return None
        document = read_json(file)
        try:
            if document["schema"] == RUN_SCHEMA:
                inputs = {str(name): str(digest) for name, digest in document["inputs"].items()}
                root, settings = Path(document["root"]), dict(document["settings"])
                return Asked(hash=str(document["hash"]), settings=settings, inputs=inputs, root=root)
        except (KeyError, TypeError, ValueError, AttributeError):
            pass
        raise refusal(
            file, "", "a damaged note", f'"{RUN_SCHEMA}"', "choose another folder, or give --overwrite"
        )

    def write_manifest(
        self, totals: Mapping[str, Any], failures: Sequence[Failure], digests: Mapping[str, str]
    ) -> None:
        """Note how far the run is, what failed, and the SHA-256 of each shard."""
        document = {
            "schema": MANIFEST_SCHEMA,
            **totals,
            "failed": [one.document() for one in failures],
            "digests": dict(digests),
        }
        write_document(self.path / MANIFEST_FILE, document, self.parts)

    def remove_others(self, names: set[str]) -> int:
        """Remove results that are not among these, and say how many there were."""
        others = self._others(names)
        for one in others:
            with writing(one):
                one.unlink()
        return len(others)

    def check_others(self, names: set[str]) -> None:
        """Refuse results of another run, of which nothing else is known: its frames would stand beside this one's.

        Raises
        ------
        InputError
            Where a shard has not one of these names.
        """
        others = self._others(names)
        if others:
            raise refusal(
                self.path,
                "",
                f"{len(others)} shards of another run, without its {ASKED_FILE}",
                "a run's own results",
                "choose another folder, or give --overwrite",
            )

    def _others(self, names: set[str]) -> list[Path]:
        return [one for one in (self.path / SHARDS_FOLDER).iterdir() if one.name not in names]

    def remove_staged(self) -> None:
        """Remove the tables of image points; what they held is done."""
        for one in (self.path / STAGED_FOLDER).glob("*.parquet"):
            one.unlink(missing_ok=True)


@contextmanager
def run_folder(path: Path) -> Iterator[RunFolder]:
    """Make or open a run's folder, and keep other runs out of it until the block ends or the process dies.

    Raises
    ------
    InputError
        Where it cannot be made, holds something else, or another run is writing there.
    """
    if path.exists() and not path.is_dir():
        raise refusal(path, "", "a file", "a folder", "choose another name")
    made = not path.exists()
    make_folder(path)
    try:
        strange = sorted(one.name for one in path.iterdir() if one.name not in OWN_ENTRIES)
    except OSError as error:
        raise refusal(
            path, "", error.strerror or str(error), "a folder that can be read", "choose another"
        ) from None
    if strange and not (path / ASKED_FILE).is_file():
        raise refusal(
            path,
            "",
            f"a folder that holds {strange[0]}",
            "a new or empty one, or a run's own",
            "choose another name",
        )
    with writing(path / LOCK_FILE):
        handle = os.open(path / LOCK_FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(
                f"{path}: another run is writing there; expected none; wait for it, or choose another folder"
            ) from None
        folder = RunFolder(path=path.resolve())
        for name in (PARTS_FOLDER, STAGED_FOLDER, SHARDS_FOLDER):
            with writing(path / name):
                (path / name).mkdir(exist_ok=True)
        clear(folder.parts)
        try:
            yield folder
        finally:
            clear(folder.parts)
            _leave_nothing(path, made)
    finally:
        os.close(handle)


def _leave_nothing(path: Path, made: bool) -> None:
    """Take away what a run has in its folder, and the folder where it was made, if nothing was opened or asked."""
    asked = path / ASKED_FILE, path / MANIFEST_FILE
    if any(one.exists() for one in asked) or any((path / SHARDS_FOLDER).iterdir()):
        return
    if not any((path / STAGED_FOLDER).glob("*.json")):  # what was opened is not opened again by the next run
        for name in (PARTS_FOLDER, STAGED_FOLDER, SHARDS_FOLDER):
            shutil.rmtree(path / name, ignore_errors=True)
        (path / LOCK_FILE).unlink()
        if made:
            path.rmdir()


def differing(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Name the first setting in which two runs differ, with both values."""
    for name in sorted({*before, *now}):
        if before.get(name) != now.get(name):
            old, new = before.get(name), now.get(name)
            if isinstance(old, dict) and isinstance(new, dict):
                return f"{name}.{differing(old, new)}"
            return f"{name}: {json.dumps(old)} there, {json.dumps(new)} now"
    return "settings"
