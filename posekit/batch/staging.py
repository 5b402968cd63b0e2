"""From an input to tables of image points: what any worker can take a part of without reading the rest.

A table with camera and person is taken where it is. Everything else is opened once, as `posekit recover` opens it, and
laid down as such a table: a person's pictures that cannot be recovered are in it too, so that none is lost.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.batch import digests
from posekit.batch.durable import PARTS_FOLDER, whole, write_document
from posekit.batch.image_rows import ImageRows, first_usable, head_text, nothing_seen, read_head
from posekit.batch.recipe import Recipe
from posekit.batch.view_arrays import is_view_arrays, read_view_arrays
from posekit.batch.view_table import (
    AT_ONCE,
    is_view_table,
    open_view_table,
    read_column,
    read_rows,
    write_rows,
)
from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.keypoints import KeyPoints, swap
from posekit.formats.own import CameraModel, ScaledOrthographicModel, View, read_view
from posekit.formats.recognising import recognise
from posekit.formats.skeleton_maps import LANDMARK_INDEX, SkeletonMap
from posekit.safe_io import read_json, refusal
from posekit.skeleton import JOINTS, POINTS
from posekit.views.camera import in_pixels, sighting
from posekit.views.given_views import OF_VIEWS, given_views
from posekit.views.opening import open_views, read_detections
from posekit.views.person import person
from posekit.views.person_view import person_view, times
from posekit.views.source import Source

STAGED_FOLDER: Final = ".staged"
"""The folder beside the results that holds the tables."""
STAGED_SCHEMA: Final = "posekit.batch_input/1"
VIEWS_FORMAT: Final = "views"
"""What inputs are called that say camera and person themselves."""
MIDDLE_POINTS: Final = {f"mid_{part}s": (f"right_{part}", f"left_{part}") for part in ("shoulder", "hip")}
NECK_POINTS: Final = (LANDMARK_INDEX["neck"], LANDMARK_INDEX["mid_shoulders"])
MAX_STAGED_WARNINGS: Final = 20
"""Warnings that are kept of one input."""


@dataclass(frozen=True, kw_only=True)
class Staging:
    """An input that is to be opened.

    Parameters
    ----------
    name : str
        What results call it.
    path : Path
        Where it is.
    folder : Path
        Of the run.
    recipe : Recipe
        How inputs are read.
    reading : str
        Hash of `Recipe.reading`.
    again : bool
        Whether to lay the tables down even where it was done: they were removed.
    """

    name: str
    path: Path
    folder: Path
    recipe: Recipe
    reading: str
    again: bool = False


@dataclass(frozen=True, kw_only=True)
class StagedTable:
    """One person's frames.

    Parameters
    ----------
    person : int
        The number to choose them by; 0 in a view.
    path : str
        The table.
    frames : int
        Its rows.
    head : str
        Camera and person: a ``posekit.view/1`` document of one frame.
    """

    person: int
    path: str
    frames: int
    head: str


@dataclass(frozen=True, kw_only=True)
class Staged:
    """An input that was opened.

    Parameters
    ----------
    name : str
        The input's name.
    digest : str
        SHA-256 of its content.
    kind : str
        What it is: `VIEWS_FORMAT`, or the format and layout of its key points.
    tables : tuple of StagedTable
        One for each person.
    warnings : tuple of str
        What was warned of while it was read.
    """

    name: str
    digest: str
    kind: str
    tables: tuple[StagedTable, ...]
    warnings: tuple[str, ...] = ()

    @property
    def frames(self) -> int:
        """Count the frames, of all persons."""
        return sum(table.frames for table in self.tables)


def stage(job: Staging) -> Staged:
    """Open an input, or find that it was opened before.

    Raises
    ------
    InputError
        Where it cannot be read, is neither a view nor key points, or options say nothing about it.
    OutputError
        Where a table cannot be written.
    """
    job.recipe.check_versions()
    digest = digests.of_input(job.path)
    key = digests.of_values(job.name, str(job.path.resolve()), digest, job.reading)
    base = job.folder / STAGED_FOLDER / f"{stem_of(job.name)}.{key}"
    index = base.with_name(f"{base.name}.json")
    # The key has the content in it: an input that was changed is opened anew, under another name.
    known = None if job.again else _known(index, digest)
    if known is not None:
        return known
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        kind, tables = _opened(job, base)
    says = [str(one.message) for one in caught if issubclass(one.category, UserWarning)]
    for table in tables:
        job.recipe.check_view(read_head(table.head))
    staged = Staged(
        name=job.name,
        digest=digest,
        kind=kind,
        tables=tuple(tables),
        warnings=tuple(dict.fromkeys(says))[:MAX_STAGED_WARNINGS],
    )
    # Written last: where it is there, the tables that it names are whole.
    write_document(index, {"schema": STAGED_SCHEMA, **asdict(staged)}, job.folder / PARTS_FOLDER)
    return staged


def stem_of(name: str) -> str:
    """Make of an input's name what may be part of a file's name."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", Path(name).stem)[:60] or "input"


def _known(index: Path, digest: str) -> Staged | None:
    """Read what an earlier run noted; None where it did not, or the note is damaged."""
    if not index.is_file():
        return None
    try:
        document: Any = read_json(index)
        tables = tuple(StagedTable(**table) for table in document.pop("tables"))
        schema = document.pop("schema")
        found = Staged(**{**document, "tables": tables, "warnings": tuple(document["warnings"])})
    except (InputError, TypeError, KeyError, AttributeError):
        return None
    texts = [
        found.name,
        found.kind,
        *found.warnings,
        *(text for one in tables for text in (one.path, one.head)),
    ]
    if not all(isinstance(text, str) for text in texts):
        return None
    if not all(isinstance(number, int) for one in tables for number in (one.person, one.frames)):
        return None
    return found if schema == STAGED_SCHEMA and found.digest == digest else None


def _opened(job: Staging, base: Path) -> tuple[str, list[StagedTable]]:
    """Open an input of whatever kind."""
    path, source = job.path, job.recipe.source
    if path.suffix.lower() in (".parquet", ".pq") and path.is_file():
        table = open_view_table(path)
        if is_view_table(table.names):
            _check_order(path, table.names)
            if table.head:
                _refuse_told(path, source)
                told = StagedTable(
                    person=0, path=str(path.resolve()), frames=table.rows, head=_head(path, table.head)
                )
                return VIEWS_FORMAT, [told]
            pieces = read_rows(path, 0, table.rows, source.rate)
            return f"key points: {path.suffix.lower()[1:]}", [_of_rows(job, base, pieces)]
    elif is_view_arrays(path):
        rows, head = read_view_arrays(path, source.rate)
        _check_numbers(path, rows.frame, None)
        if head:
            _refuse_told(path, source)
            return VIEWS_FORMAT, [_laid_down(job, base, 0, _head(path, head), [rows])]
        return "key points: npz", [_of_rows(job, base, iter([rows]))]
    what = recognise(path, source.format)
    if what.holds is Content.VIEW:
        _refuse_told(path, source)
        view = read_view(path)
        return VIEWS_FORMAT, [_laid_down(job, base, 0, head_text(view), [ImageRows.of_view(view)])]
    if what.holds is not Content.KEY_POINTS:
        given_views(path, source)  # refuses it in its own words
    return _of_detections(job, base)


def _of_detections(job: Staging, base: Path) -> tuple[str, list[StagedTable]]:
    """Lay down the people of a detector's file; the views' times are made their pictures' numbers on the way."""
    source = job.recipe.source
    found = read_detections(job.path, source)
    pictures = np.arange(len(found.pictures))
    time = times(found, source.rate)
    tables = []
    for one in open_views(job.path, replace(source, rate=1.0)):
        number = np.round(one.view.time).astype(np.int64)
        rows = replace(ImageRows.of_view(one.view, number), time=time[number])
        rows = rows.laid_out(pictures, time) if found.sequence else rows
        tables.append(_laid_down(job, base, one.person, head_text(one.view), [rows]))
    return f"key points: {found.format}, {found.layout.name}", tables


def _of_rows(job: Staging, base: Path, pieces: Iterator[ImageRows]) -> StagedTable:
    """Lay down image points whose camera and person the options say, piece by piece."""
    seen: list[View] = []
    table = _laid_down(job, base, 0, "", _as_views(job, pieces, seen))
    if not seen:
        raise InputError(
            f"{job.path}: both shoulders, between which the neck is, are seen in none of "
            f"{plural(table.frames, 'frame')}; "
            "expected at least one; choose a smaller --min-confidence"
        )
    derived = tuple(dict.fromkeys(name for view in seen for name in view.derived))
    return replace(table, head=head_text(replace(seen[0], derived=derived)))


def _as_views(job: Staging, pieces: Iterator[ImageRows], seen: list[View]) -> Iterator[ImageRows]:
    """Complete pieces as views of the person, and keep a frame of each in `seen`: what is derived may differ."""
    source, figure, length_deviation = job.recipe.source, None, None
    if source.skeleton:
        raise InputError(
            f"--skeleton: {job.path} names its points itself; expected a detector's file; leave it out"
        )
    for rows in pieces:
        given = _keypoints(job.path, rows)
        sighted = sighting(in_pixels(swap(given) if source.swap_sides else given, source.size), source)
        if figure is None:
            figure, _, length_deviation = person(source, sighted.camera, given.layout, job.path)
        if not _shows_somebody(sighted.keypoints, sighted.camera, source.minimum_confidence):
            yield nothing_seen(rows.frame, rows.time)
            continue
        view = person_view(
            sighted.keypoints,
            sighted.camera,
            figure,
            minimum_confidence=source.minimum_confidence,
            deviation=source.deviation,
            length_deviation=length_deviation,
        )
        if not seen or view.derived not in [one.derived for one in seen]:
            seen.append(first_usable(view))
        yield replace(ImageRows.of_view(view, rows.frame), time=rows.time, root=rows.root)


def _shows_somebody(found: KeyPoints, camera: CameraModel, minimum_confidence: float) -> bool:
    """Tell whether any picture can be recovered: it shows a neck or both shoulders; uncalibrated, any joint."""
    known = np.isfinite(found.landmarks[..., 0]) & ~(found.landmark_confidence < minimum_confidence)
    needed = range(len(JOINTS)) if isinstance(camera, ScaledOrthographicModel) else NECK_POINTS
    return bool(known[:, list(needed)].any())


def _keypoints(path: Path, rows: ImageRows) -> KeyPoints:
    """Take rows for what a detector saw; points that are nowhere in them are no points of its layout."""
    there = {name: (name,) for k, name in enumerate(POINTS) if np.isfinite(rows.points[:, k, 0]).any()}
    middles = {name: sides for name, sides in MIDDLE_POINTS.items() if there.keys() >= set(sides)}
    return KeyPoints(
        format=path.suffix.lower()[1:],
        source=str(path),
        layout=SkeletonMap(name="posekit's points", points=POINTS, landmarks={**there, **middles}),
        pictures=tuple(str(number) for number in rows.frame.tolist()),
        frame=np.arange(len(rows)),
        person=np.zeros(len(rows), dtype=np.intp),
        points=rows.points,
        confidence=rows.confidence,
        sequence=True,
    )


def _laid_down(job: Staging, base: Path, who: int, head: str, pieces: Any) -> StagedTable:
    """Write a table, whole or not at all."""
    path = base.with_name(f"{base.name}.p{who}.parquet")
    count = 0

    def counted() -> Iterator[ImageRows]:
        nonlocal count
        for rows in pieces:
            count += len(rows)
            yield rows

    path.parent.mkdir(exist_ok=True)
    with whole(path, job.folder / PARTS_FOLDER) as file:
        write_rows(file, head, counted(), group=min(job.recipe.shard_frames, AT_ONCE))
    return StagedTable(person=who, path=str(path.resolve()), frames=count, head=head)


def _head(path: Path, text: str) -> str:
    """Check the camera and person that a table names."""
    try:
        read_head(text)
    except InputError as error:
        _, _, reason = str(error).partition("head.json: ")
        raise InputError(f"{path}: posekit.view: {reason or error}") from None
    return text


def _refuse_told(path: Path, source: Source) -> None:
    """Refuse options that a view says itself."""
    said = [name for name, given in source.given.items() if given and name not in (*OF_VIEWS, "--fps")]
    if said:
        raise InputError(
            f"{said[0]}: {path} is a view, which says camera, person and lengths itself; expected a detector's file; "
            "leave it out"
        )
    if source.proportions not in ("figure", "taylor"):
        raise InputError(
            f"--proportions: {source.proportions!r}; expected figure or taylor: a view says lengths itself"
        )


def _check_order(path: Path, names: tuple[str, ...]) -> None:
    """Refuse frames out of order: every frame is known by its number."""
    last = None
    for values in read_column(path, "frame") if "frame" in names else ():
        if np.isnan(values).any():
            raise refusal(path, "frame", "null", "a number in every row", "number the frames")
        numbers = values.astype(np.int64)
        _check_numbers(path, numbers, last)
        last = int(numbers[-1])
    for values in read_column(path, "time") if "time" in names else ():
        if np.isnan(values).any():
            raise refusal(path, "time", "null", "seconds in every row", "leave the column out, or give all")


def _check_numbers(path: Path, numbers: NDArray[np.int64], last: int | None) -> None:
    before = numbers if last is None else np.concatenate([[last], numbers])
    if (np.diff(before) <= 0).any() or numbers[0] < 0:
        row = int(np.argmax(np.diff(before) <= 0))
        raise refusal(
            path,
            "frame",
            f"{before[min(row + 1, len(before) - 1)]} after {before[row]}",
            "ascending numbers from 0, each once: one film of one person",
            "sort the rows, or write a file a film and person",
        )
