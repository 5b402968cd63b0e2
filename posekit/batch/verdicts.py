"""Archives of motion validated: some files a part, each part a table of verdicts and its report, by several processes.

A part is a pure function of its files and of what is asked, and its name tells both. Its report is written last: where
it is there, the table is whole, and the part is not judged again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from posekit.batch import digests
from posekit.batch.run import Workers
from posekit.errors import InputError
from posekit.formats.own import ValidationReport, read_report, write_report
from posekit.safe_io import extra, refusal
from posekit.safe_io.writing import make_folder
from posekit.validation import AskedValidation, WantedDetail, validate_files
from posekit.validation.files import none_judged

PART_BYTES: Final = 64_000_000
PART_FILES: Final = 500
"""Of a part, at most: some hundred thousand frames, so that a process holds one's verdicts in little memory."""


@dataclass(frozen=True, kw_only=True)
class VerdictPart:
    """Files that are judged together.

    Parameters
    ----------
    files : tuple of Path
        The files.
    asked : AskedValidation
        By what they are judged.
    folder : Path
        Where verdicts are written.
    hash : str
        Of the files and of what is asked.
    """

    files: tuple[Path, ...]
    asked: AskedValidation
    folder: Path
    hash: str

    @property
    def report(self) -> Path:
        """The report: counts, clips and their spans."""
        return self.folder / f"{self.hash}.json"

    @property
    def table(self) -> Path:
        """The table of verdicts, a row a frame."""
        return self.folder / f"{self.hash}.parquet"


@dataclass(kw_only=True)
class VerdictTotals:
    """What is known of all parts.

    Parameters
    ----------
    parts, skipped : int
        Parts, and how many of them were there before.
    clips : Counter
        Clips by verdict.
    frames : Counter
        Frames by verdict.
    rejected : Counter
        Frames that each check rejects.
    refused : list of str
        Files that could not be judged, each with why.
    """

    parts: int = 0
    skipped: int = 0
    clips: Counter[str] = field(default_factory=Counter)
    frames: Counter[str] = field(default_factory=Counter)
    rejected: Counter[str] = field(default_factory=Counter)
    refused: list[str] = field(default_factory=list)

    def add(self, report: ValidationReport) -> None:
        """Add what a part's report says."""
        self.frames.update(report.settings.get("frames", {}))
        self.clips.update(clip.verdict for clip in report.clips or ())
        self.rejected.update({name: count.rejected for name, count in (report.checks or {}).items()})
        self.refused += report.refused


def validate_archive(
    files: Sequence[Path],
    output: Path,
    asked: AskedValidation,
    workers: Workers | None = None,
    *,
    progress: Callable[[int], None] | None = None,
) -> VerdictTotals:
    """Judge an archive into a folder; what an earlier run has done is not done again.

    Parameters
    ----------
    files : sequence of Path
        The files.
    output : Path
        The folder of verdicts: a Parquet table and a JSON report a part.
    asked : AskedValidation
        By what they are judged.
    workers : Workers, optional
        Who does it: a process a core if not given.
    progress : callable, optional
        Told the number of files of each part that is done.

    Raises
    ------
    InputError
        Where the folder cannot be written, no file can be judged, or what is asked is impossible.
    """
    extra("pyarrow.parquet", "parquet", "verdicts in a folder")
    if output.exists() and not output.is_dir():
        raise refusal(output, "", "a file", "a folder of verdicts", "choose another name")
    made = not output.exists()
    make_folder(output)
    try:
        parts = list(parts_of(files, output, asked))
        totals = _judge_parts(parts, workers or Workers(), progress)
        if totals.refused and not totals.frames.total():
            for part in parts:
                part.report.unlink()
                part.table.unlink()
            raise none_judged(len(files), totals.refused[0])
        return totals
    except BaseException:
        if made and not any(output.iterdir()):  # what is impossible leaves nothing behind
            output.rmdir()
        raise


def _judge_parts(
    parts: Sequence[VerdictPart], workers: Workers, progress: Callable[[int], None] | None
) -> VerdictTotals:
    """Judge the parts that have no verdicts, and count all."""
    totals = VerdictTotals()
    missing = []
    for part in parts:
        totals.parts += 1
        if part.report.is_file():
            totals.skipped += 1
            totals.add(read_report(part.report))
            _tell(progress, part)
        else:
            missing.append(part)
    with workers.pool() as pool:
        for outcome in pool.run(judge_part, missing):
            if outcome.error:
                raise InputError(outcome.error)
            totals.add(read_report(outcome.item.report))
            _tell(progress, outcome.item)
    return totals


def parts_of(files: Sequence[Path], folder: Path, asked: AskedValidation) -> Iterator[VerdictPart]:
    """Cut files into parts, in order.

    Parameters
    ----------
    files : sequence of Path
        The files.
    folder : Path
        Where verdicts are written.
    asked : AskedValidation
        By what they are judged: a part of other settings has another name.
    """
    some: list[Path] = []
    states: list[str] = []
    size = 0
    for file in files:
        state = file.stat()
        if some and (size + state.st_size > PART_BYTES or len(some) == PART_FILES):
            yield _part(some, states, folder, asked)
            some, states, size = [], [], 0
        some.append(file)
        states.append(f"{file} {state.st_size} {state.st_mtime_ns}")
        size += state.st_size
    if some:
        yield _part(some, states, folder, asked)


def judge_part(part: VerdictPart) -> int:
    """Judge a part and write its verdicts, the report last; return the number of its frames.

    Raises
    ------
    InputError
        Where it cannot be written.
    """
    report = validate_files(part.files, part.asked, wanted=WantedDetail(detail="margins"), strict=False)
    write_report(part.table, report)
    told = {**report.settings, "frames": report.summary, "table": part.table.name}
    told = {name: value for name, value in told.items() if name != "people"}
    short = replace(report, settings=told, postures=(), verdicts=None, listed="none: see the table")
    write_report(part.report, short)
    return len(report)


def _part(files: Sequence[Path], states: list[str], folder: Path, asked: AskedValidation) -> VerdictPart:
    hash = digests.of_values(states, repr(asked))
    return VerdictPart(files=tuple(files), asked=asked, folder=folder, hash=hash)


def _tell(progress: Callable[[int], Any] | None, part: VerdictPart) -> None:
    if progress is not None:
        progress(len(part.files))
