"""Some frames of a motion file as a file of its own format.

Text (BVH, TRC, MOT, tables in CSV) keeps its header and the lines of those frames as they are, but for the number of
frames that the header says; NPZ and Parquet keep what they hold besides. C3D is written again from its points; what
posekit cannot write becomes an NPZ of its points.
"""

from __future__ import annotations

import csv
import re
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.formats.motion.npz import MAX_BYTES, write_npz
from posekit.formats.motion.reading import format_of, read_motion, write_motion
from posekit.safe_io import extra, open_npz, read_text, refusal, replacing

MAX_TEXT_BYTES: Final = 500_000_000

CLIP_KEYS: Final = frozenset(
    ("betas", "clip_fps", "rate", "fps", "framerate", "mocap_framerate", "trans_offset")
)
"""Numbers in an NPZ that are of a whole clip, however many there are."""

FRAME_COLUMNS: Final = ("frame", "sync_index", "time")
"""Columns that say which frame a row of a table is of, the first that there is."""

FALLBACK_SUFFIX: Final = ".npz"


class _TextTable(NamedTuple):
    """Where the rows of a kind of text begin, and what of the header says how many there are."""

    head: re.Pattern[str]
    counts: re.Pattern[str] | None


_TEXT_TABLES: Final[Mapping[str, _TextTable]] = {
    ".bvh": _TextTable(
        re.compile(
            r"(?is)^.*?^[ \t]*MOTION[ \t]*\r?\n\s*Frames\s*:\s*\S+\s+Frame\s*Time\s*:\s*\S+[^\n]*\n",
            re.MULTILINE,
        ),
        re.compile(r"(?i)(?<=\n)([ \t]*Frames\s*:\s*)(\d+)"),
    ),
    ".mot": _TextTable(
        re.compile(r"(?is)^.*?^endheader[^\n]*\n[^\n]*\n", re.MULTILINE),
        re.compile(r"(?i)^((?:nRows|datarows)[ \t]*=?[ \t]*)(\d+)", re.MULTILINE),
    ),
    ".trc": _TextTable(re.compile(r"^(?:[^\n]*\n){5}"), None),
    ".csv": _TextTable(re.compile(r"^[^\n]*\n"), None),
}


def cut_name(path: Path) -> Path:
    """Return the name of a file that frames of this one are written to: its own, or with ``.npz`` after it."""
    known = {*_TEXT_TABLES, ".npz", ".parquet", ".pq", ".c3d"}
    return path if path.suffix.lower() in known else path.with_name(f"{path.name}{FALLBACK_SUFFIX}")


def cut_motion(source: str | Path, target: str | Path, rows: NDArray[np.intp], count: int) -> None:
    """Write some frames of a file to another, whole or not at all.

    Parameters
    ----------
    source : path
        A file of motion, in any format that is read.
    target : path
        The file to write, named as `cut_name` says.
    rows : int array
        Which of its frames, in rising order.
    count : int
        How many it has.

    Raises
    ------
    InputError
        Where the source cannot be read or the target cannot be written.
    """
    kind = Path(target).suffix.lower()
    cutters: Mapping[str, Callable[..., bool]] = {
        **dict.fromkeys(_TEXT_TABLES, _cut_text),
        ".npz": _cut_arrays,
        ".parquet": _cut_parquet,
        ".pq": _cut_parquet,
    }
    same = Path(source).suffix.lower() == kind
    if not (same and kind in cutters and cutters[kind](Path(source), target, rows, count)):
        _cut_points(source, target, rows)


def _cut_text(source: Path, target: str | Path, rows: NDArray[np.intp], count: int) -> bool:
    """Keep lines; False where they are not one a frame."""
    table = _TEXT_TABLES[source.suffix.lower()]
    text = read_text(source, limit=MAX_TEXT_BYTES)
    head = table.head.match(text)
    if head is None:
        return False
    start = head.group()
    lines = _filled(text[head.end() :])
    if len(lines) == count - 1 and source.suffix.lower() == ".csv":  # a table without names
        start, lines = "", _filled(text)
    if len(lines) != count and source.suffix.lower() == ".csv":
        lines = _frames_of_rows(start, lines)
    if len(lines) != count:
        return False
    if table.counts is not None:
        start = table.counts.sub(lambda found: f"{found[1]}{len(rows)}", start)
    elif source.suffix.lower() == ".trc":
        start = _counted_trc(start, len(rows))
    with replacing(target) as file:
        file.write(start.encode("utf-8"))
        for row in rows.tolist():
            file.write(f"{lines[row]}\n".encode())
    return True


def _filled(text: str) -> list[str]:
    """Part text into its lines, but for empty ones."""
    return [line for line in text.split("\n") if line.strip()]


def _frames_of_rows(head: str, lines: list[str]) -> list[str]:
    """Join the rows of a frame, of a table with a row a frame and point: neighbours of one frame and clip."""
    delimiter = max(",;\t", key=head.count)
    names = [name.strip() for name in next(csv.reader([head], delimiter=delimiter), [])]
    frame = next((name for name in FRAME_COLUMNS if name in names), None)
    if frame is None:
        return lines
    keys = [names.index(name) for name in (frame, "clip") if name in names]
    frames: list[str] = []
    last: list[str] = []
    for line, cells in zip(lines, csv.reader(lines, delimiter=delimiter), strict=False):
        key = [cells[k] for k in keys if k < len(cells)]
        if frames and key == last:
            frames[-1] += f"\n{line}"
        else:
            frames.append(line)
        last = key
    return frames


def _counted_trc(head: str, count: int) -> str:
    """Say in a TRC's third line how many frames there are."""
    lines = head.split("\n")
    names, values = lines[1].split("\t"), lines[2].split("\t")
    for k, name in enumerate(names[: len(values)]):
        if name.strip() in ("NumFrames", "OrigNumFrames"):
            values[k] = f"{count}{values[k][len(values[k].rstrip()) :]}"
    return "\n".join([*lines[:2], "\t".join(values), *lines[3:]])


def _cut_arrays(source: Path, target: str | Path, rows: NDArray[np.intp], count: int) -> bool:
    """Keep of each array with a row a frame those rows; the others as they are, to the byte."""
    with open_npz(source, limit=MAX_BYTES) as archive, replacing(target) as file:
        cut_any = False
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
            for member in archive.zip.infolist():
                name = member.filename.removesuffix(".npy")
                array = None if name in CLIP_KEYS else _numbers(archive, name)
                if array is None or array.ndim == 0 or len(array) != count:
                    made.writestr(member.filename, archive.zip.read(member))
                    continue
                cut_any = True
                with made.open(f"{name}.npy", "w", force_zip64=True) as entry:
                    np.lib.format.write_array(entry, np.ascontiguousarray(array[rows]), allow_pickle=False)
        if not cut_any:
            raise refusal(source, "", "no array with a row a frame", f"one of {count} rows", "cut it by hand")
    return True


def _numbers(archive: Any, name: str) -> NDArray[Any] | None:
    """Return an array of numbers; None for what is none."""
    try:
        found: NDArray[Any] = archive.array(name, "iuf", None)
    except InputError:
        return None
    return found


def _cut_parquet(source: Path, target: str | Path, rows: NDArray[np.intp], count: int) -> bool:
    """Keep rows with all columns and the file's metadata; False where they are not one a frame."""
    from posekit.formats.motion.parquet import opened

    pq = extra("pyarrow.parquet", "parquet", "writing Parquet")
    with opened(source) as file:
        if file.metadata.num_rows != count:
            return False
        table = file.read(use_threads=False).take(rows)
    with replacing(target) as written:
        pq.write_table(table, written)
    return True


def _cut_points(source: str | Path, target: str | Path, rows: NDArray[np.intp]) -> None:
    """Read points and write some of them."""
    motion = read_motion(source, format_of(source).name)
    used, clip = np.unique(motion.clip[rows], return_inverse=True)
    part = replace(
        motion,
        points=motion.points[rows],
        time=motion.time[rows],
        clip=clip.astype(np.intp),
        clips=tuple(motion.clips[k] for k in used.tolist()),
        actions=tuple(motion.actions[k] for k in used.tolist()),
        rates=motion.rates[used],
        rate=float(motion.rates[used[0]]),
    )
    if Path(target).suffix.lower() == FALLBACK_SUFFIX:
        write_npz(target, part)
    else:
        write_motion(target, part)
