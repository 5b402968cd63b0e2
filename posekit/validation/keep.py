"""A folder of the clips that pass, or of their longest good spans, each in its file's own format."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats.listing import MANIFEST_NAME
from posekit.formats.motion.cutting import cut_motion, cut_name
from posekit.formats.own.report_clips import ClipVerdict
from posekit.formats.own.report_frames import ReportFrames
from posekit.formats.own.report_rows import csv_line
from posekit.formats.own.report_table import said_of_span
from posekit.safe_io import refusal, write_lines
from posekit.safe_io.writing import check_folder, make_folder, replacing_folder

ROUNDING_SECONDS: Final = 1e-6
"""Seconds that the difference of two times may be off."""

_NONE: Final = np.zeros(0, dtype=np.intp)


class KeptClip(NamedTuple):
    """A clip in the manifest: frames `first` to `last` of it are in `written`; nothing is, where that is empty."""

    file: str
    clip: str
    verdict: str
    frames: int
    first: int | None
    last: int | None
    written: str
    why: str


@dataclass(frozen=True, kw_only=True)
class Kept:
    """What was kept.

    Parameters
    ----------
    clips : sequence of KeptClip
        The manifest: every clip that was judged.
    """

    clips: Sequence[KeptClip]

    @property
    def said(self) -> str:
        """How many clips were kept, in a sentence."""
        kept = [clip for clip in self.clips if clip.written]
        spans = sum(clip.verdict != "valid" for clip in kept)
        cut_down = f", {spans} of them cut to their longest good span" if spans else ""
        return f"{len(kept)} of {plural(len(self.clips), 'clip')} kept{cut_down}"


def check_keep_folder(folder: Path, *written: Path) -> None:
    """Refuse a folder that holds anything, or will hold something else, before the work that it is for is done."""
    for path in written:
        if path.resolve().is_relative_to(folder.resolve()):
            raise refusal(path, "", f"a name in {folder}", "clips alone in it", "choose another name")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise refusal(
            folder, "", "something that is there already", "a folder that is new or empty", "name another"
        )
    check_folder(folder)


def keep_clips(
    folder: Path, clips: Sequence[ClipVerdict], frames: ReportFrames, *, spans: float | None = None
) -> Kept:
    """Write the clips that pass into a new folder, whole or not at all, with a manifest.

    Parameters
    ----------
    folder : Path
        New or empty.
    clips : sequence of ClipVerdict
        The verdicts, in the order of `frames.clips`; `file` is the path of each.
    frames : ReportFrames
        Which posture is of which clip.
    spans : float, optional
        Of clips that do not pass, the longest good span is kept where it takes as many seconds.

    Raises
    ------
    InputError
        Where the folder holds something, or a file cannot be read or written.
    """
    check_keep_folder(folder)
    make_folder(folder.parent)
    with replacing_folder(folder) as beside:
        kept = Kept(clips=tuple(_written(beside, clips, frames, spans)))
        write_lines(beside / MANIFEST_NAME, map(csv_line, [KeptClip._fields, *kept.clips]))
    return kept


def _written(
    folder: Path, clips: Sequence[ClipVerdict], frames: ReportFrames, spans: float | None
) -> Iterator[KeptClip]:
    """Write file by file, and tell of each clip what became of it."""
    files: dict[str, list[int]] = {}
    for k, clip in enumerate(clips):
        files.setdefault(clip.file, []).append(k)
    names = names_below({file: Path(file) for file in files})
    for file, indices in files.items():
        chosen = {k: _chosen(clips[k], frames, k, spans) for k in indices}
        first = min(int(frames.rows(k)[0]) for k in indices)
        count = sum(clips[k].frames for k in indices)
        rows = np.sort(np.concatenate([part for part, _ in chosen.values()]))
        name, failed = names[file], ""
        if len(rows):
            whole = len(rows) == count and Path(file).is_file()
            name = name if whole else cut_name(name)
            make_folder((folder / name).parent)
            try:
                if whole:
                    shutil.copyfile(file, folder / name)
                else:
                    cut_motion(file, folder / name, rows - first, count)
            except InputError as error:
                failed = f"frames of this file cannot be written: {error}"
        for k in indices:
            part, why = (_NONE, failed) if failed else chosen[k]
            yield KeptClip(
                file,
                clips[k].clip,
                clips[k].verdict,
                clips[k].frames,
                int(frames.frame[part[0]]) if len(part) else None,
                int(frames.frame[part[-1]]) if len(part) else None,
                name.as_posix() if len(part) else "",
                why,
            )


def _chosen(
    clip: ClipVerdict, frames: ReportFrames, index: int, spans: float | None
) -> tuple[NDArray[np.intp], str]:
    """Return which postures of a clip are kept, and why not all of them."""
    rows = frames.rows(index)
    if clip.verdict == "valid":
        return rows, ""
    why = said_of_span(clip.spans[0]) if clip.spans else f"{clip.verdict}"
    if spans is not None and clip.good:
        first, last = (int(np.flatnonzero(frames.frame[rows] == frame)[0]) for frame in clip.good)
        part = rows[first : last + 1]
        seconds = float(frames.time[part[-1]] - frames.time[part[0]])
        if not seconds < spans - ROUNDING_SECONDS:  # also where no times are known
            return part, why
        why = f"longest good span {seconds:.3g} s, below {spans:g} s; {why}"
    return rows[:0], why


def names_below(paths: dict[str, Path]) -> dict[str, Path]:
    """Return the name of each file below the folder that all of them are in."""
    absolute = {name: Path(os.path.normpath(path.absolute())) for name, path in paths.items()}
    common = os.path.commonpath([path.parent for path in absolute.values()]) if absolute else ""
    return {name: path.relative_to(common) for name, path in absolute.items()}
