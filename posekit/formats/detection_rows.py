"""Conversion of a detector's rows to `Detections`: layout of points, missing points, and order of pictures."""

from __future__ import annotations

import math
import re
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import cut, refusal
from posekit.following.detections import FARTHEST_PIXEL, FRACTIONS_UP_TO, Detections
from posekit.formats.layout import Layout, by_names, by_order, load_layout
from posekit.formats.options import Options
from posekit.formats.tables import seconds
from posekit.geometry import Array, Ints
from posekit.skeleton import HEAD_POINTS

#: Minimum share of a film's pictures that a detector lists, with picture numbers divided by their common divisor. The
#: numbers of unrelated pictures are far apart.
DENSE: Final = 0.5
#: Largest ratio of the range of picture numbers to the number of pictures; above it the numbers are not frame numbers.
MOST_SPREAD: Final = 20
#: Largest median motion of a person between pictures of a film, as a multiple of the square root of the body's area;
#: between unrelated photographs it is about 1 or more.
FILM_MOTION: Final = 0.5
#: Largest number of pictures in which people's motion is measured.
MOST_COMPARED: Final = 200
#: Width and height of a picture whose size is unknown.
UNKNOWN: Final = (math.nan, math.nan)
#: Size of the head (nose, eyes and ears) relative to the body, assumed for layouts without head points, such as
#: Human3.6M's. If points include a head, its size is smaller in the correct layout, larger in a wrong one.
HEADLESS_SHARE: Final = 0.385
#: Minimum ratio of the head's size in a wrong layout to its size in the correct layout.
CLEAR_RATIO: Final = 1.17


class Rows:
    """Detected people of a file in any order; each person has the label of a picture.

    Attributes
    ----------
    source, kind : str
        Path of the file, and name of its format.
    names : tuple of str
        Names of the points; empty for points without names.
    film : bool or None
        Whether the pictures are of one film; None to decide by the picture numbers and the people's motion.
    in_folder : bool
        Whether each picture has its own file.
    by_camera : bool
        Whether a person's number is the number of a camera; all cameras show the same person.
    pictures : dict
        For each label: time (s), width and height, NaN where unknown.
    people : list of (str, array, int)
        Label of the picture, points, and number of the person, -1 where unknown.
    """

    def __init__(self, source: str) -> None:
        self.source, self.kind = source, ""
        self.names: tuple[str, ...] = ()
        self.film: bool | None = True
        self.in_folder = self.by_camera = False
        self.pictures: dict[str, tuple[float, ...]] = {}
        self.people: list[tuple[str, Array, int]] = []

    def picture(self, label: Any, *, time: float = math.nan, size: tuple[float, float] = UNKNOWN) -> str:
        """Add a picture, with or without people; return its label as text."""
        name = str(label)
        known, stated = self.pictures.get(name, (math.nan,) * 3), (float(time), *size)
        self.pictures[name] = tuple(b if math.isnan(a) else a for a, b in zip(known, stated, strict=True))
        return name

    def add(self, label: Any, points: Array, person: Any = None) -> None:
        """Add a person in a picture.

        Parameters
        ----------
        label : object
            Label of the picture.
        points : array (K, 3)
            Coordinates in pixels or as fractions of the picture, and confidences (NaN if unknown). A point is missing
            if its confidence is 0, if it is at the origin or at (-1, -1), or if a coordinate is unknown.
        person : object
            Number of the person in the file; values other than numbers mean unknown.
        """
        whole = isinstance(person, int | float) and not isinstance(person, bool) and 0 <= person < 2**31
        self.people.append((self.picture(label), points, int(person) if whole else -1))

    def seen(self) -> tuple[list[str], Array, Ints]:
        """Return picture label, points (N, K, 3; NaN if missing) and number (N,) of each person with a known point.

        Raises
        ------
        InputError
            If people have different numbers of points, or coordinates are too large for any picture.
        """
        counts = [len(points) for _, points, _ in self.people]
        odd = next((k for k, count in enumerate(counts) if count != counts[0]), None)
        if odd is not None:
            got = f"a person of {counts[odd]} points after one of {counts[0]}"
            where = f"picture {cut(self.people[odd][0])}"
            raise refusal(self.source, where, got, "the same number for all", "split the file")
        points = np.array([points for _, points, _ in self.people]).reshape(
            len(counts), max(counts, default=0), 3
        )
        xy = points[..., :2]
        nowhere = (xy == 0).all(axis=-1) | (xy == -1).all(axis=-1) | (points[..., 2] == 0)
        missing = np.isnan(xy).any(axis=-1) | nowhere
        beyond = np.argwhere(~missing & ~(np.abs(xy) <= FARTHEST_PIXEL).all(axis=-1))
        if len(beyond):
            who, k = beyond[0]
            where = f"picture {cut(self.people[who][0])}"
            raise refusal(
                self.source, where, str(xy[who, k].tolist()), f"numbers up to {FARTHEST_PIXEL:,.0f}"
            )
        kept = np.flatnonzero(~missing.all(axis=1))
        points[missing] = np.nan
        person = np.array([self.people[k][2] for k in kept], dtype=np.intp)
        return [self.people[k][0] for k in kept], points[kept], person


def detections_of(rows: Rows, options: Options) -> Detections:
    """Convert all rows to detections.

    Raises
    ------
    InputError
        If the layout of the points is unknown, or a folder contains files of several cameras.
    """
    held, values, person = rows.seen()
    layout = _layout(rows, values[..., :2], options)
    width = len(rows.names or layout.points)
    if not len(values):
        values = np.empty((0, width, 3))
    elif (rows.names or options.layout) and values.shape[1] != width:
        got = f"{values.shape[1]} points a person"
        raise refusal(rows.source, "points", got, f"{width} of {layout.name}", "change the layout")
    names, placed, derived = layout.seen(rows.names, _in_pixels(rows, held, values[..., :2], options))
    confidence = layout.seen(rows.names, values[..., 2:])[1][..., 0]
    sizes = {size[1:] for size in rows.pictures.values()}
    size = sizes.pop() if len(sizes) == 1 else UNKNOWN
    film, place = _places(rows, held, placed, options)
    frame = np.array([place[label] for label in held], dtype=np.intp)
    order = np.argsort(frame, kind="stable")
    pictures = [""] * (max(place.values(), default=-1) + 1)
    stamps = np.full(len(pictures), np.nan)
    for label, index in place.items():
        pictures[index], stamps[index] = label, rows.pictures[label][0]
    time = _times(stamps, film, options)
    options.note(f"{len(placed)} detections in {len(place)} pictures, {rows.kind}, {layout.name}")
    return Detections(
        points=placed[order],
        confidence=confidence[order],
        names=names,
        frame=frame[order],
        person=person[order],
        pictures=tuple(pictures),
        size=None if math.isnan(size[0]) else (int(size[0]), int(size[1])),
        time=time,
        rate=options.rate if time is None else None,
        film=film,
        by_camera=rows.by_camera,
        layout=layout.name,
        source=rows.source,
        notes=tuple(options.notes),
        warnings=tuple(options.warnings),
        derived=derived,
    )


def _layout(rows: Rows, points: Array, options: Options) -> Layout:
    """Find the layout: stated by the user, by the points' names, or by the number of points and the head's size."""
    if options.layout:
        return load_layout(options.layout)
    if rows.names:
        return by_names(rows.names, rows.source)
    if not len(points):
        return load_layout("coco_17")
    found = [one for one in by_order(points.shape[1]) if one.kind == "points"]
    share = {one.name: _head_share(points, one) for one in found}
    found.sort(key=lambda one: share[one.name])
    clear = len(found) == 1 or (found and share[found[1].name] >= CLEAR_RATIO * share[found[0].name])
    if clear:
        return found[0]
    if found and rows.kind in ("coco", "results"):  # COCO's own formats
        return load_layout("coco_17")
    known = " or ".join(one.name for one in found) or "17, 18, 25, 26, 33, 133 or 136 points"
    got = f"{points.shape[1]} points without names"
    raise refusal(rows.source, "points", got, known, "give it with --layout")


def _head_share(points: Array, layout: Layout) -> float:
    """Return the head's size relative to the whole body in a layout; median over people with points (N, K, 2)."""
    head = [
        layout.points.index(layout.landmarks[name][0]) for name in HEAD_POINTS if name in layout.landmarks
    ]
    known = ~np.isnan(points[..., 0])
    seen = known[:, head].sum(axis=1)
    enough = (seen >= 2) & (known.sum(axis=1) >= seen + 2)
    if not enough.any():
        return HEADLESS_SHARE
    small, whole = (
        np.linalg.norm(np.nanmax(part, axis=1) - np.nanmin(part, axis=1), axis=-1)
        for part in (points[enough][:, head], points[enough])
    )
    return float(np.median(small / np.maximum(whole, 1e-9)))


def _in_pixels(rows: Rows, held: list[str], points: Array, options: Options) -> Array:
    """Convert fractions of the picture to pixels; if the picture's size is unknown they remain fractions."""
    known = points[~np.isnan(points[..., 0])]
    if rows.kind == "openpose" and len(known) and np.abs(known).max() <= 1 and known.min() < 0:
        points, known = (points + 1) / 2, (known + 1) / 2  # --keypoint_scale 4: from -1 to 1
    if not len(known) or float(np.median(np.abs(known))) > FRACTIONS_UP_TO:
        return points
    sizes = np.array([rows.pictures[label][1:] for label in held])
    if np.isnan(sizes).any():
        options.note("points are fractions of the picture; the file does not state its size")
        return points
    return np.asarray(points * sizes[:, None])


def _places(rows: Rows, held: list[str], points: Array, options: Options) -> tuple[bool, dict[str, int]]:
    """Return whether the pictures form a film, and each picture's frame number by label; numbers may have gaps."""
    labels = list(rows.pictures)
    numbers = _numbers(rows, labels)
    if numbers is None:
        film = bool(rows.film) or (rows.film is None and len(labels) == 1)
        ordered = labels if rows.film is not None and not rows.in_folder else sorted(labels)
        return film, {label: k for k, label in enumerate(ordered)}
    first = int(numbers.min())
    step = int(np.gcd.reduce(numbers - first)) or 1
    place = (numbers - first) // step
    frame_of = dict(zip(labels, place.tolist(), strict=True))
    dense = len(labels) >= DENSE * (int(place.max()) + 1)
    sizes = {size[1:] for size in rows.pictures.values() if not math.isnan(size[1])}
    film = rows.film is True or (
        dense
        and len(labels) > 1
        and len(sizes) <= 1
        and _moves_little(np.array([frame_of[label] for label in held]), points)
    )
    if not film or int(place.max()) + 1 > MOST_SPREAD * len(labels):
        place = np.argsort(np.argsort(numbers, kind="stable"))
    if step > 1 and film:
        options.note(f"pictures are numbered in steps of {step}")
    if not film and len(labels) > 1:
        options.note("pictures are unrelated photographs: people are not followed from picture to picture")
    return film, dict(zip(labels, map(int, place), strict=True))


def _numbers(rows: Rows, labels: list[str]) -> NDArray[np.int64] | None:
    """Return the number in each picture's label; None if labels have no number, or numbers are not unique."""
    found = [[int(one) for one in re.findall(r"\d{1,15}", label)] for label in labels]
    widths = {len(one) for one in found}
    if len(widths) == 1 and widths != {0}:
        for column in reversed(range(widths.pop())):
            numbers = np.array([one[column] for one in found], dtype=np.int64)
            if len(np.unique(numbers)) == len(labels):
                return numbers
        if rows.in_folder:
            got = "the same picture numbers twice: more than one series of pictures"
            raise refusal(rows.source, "", got, "pictures of one camera", "give each camera a folder")
    return None


def _moves_little(frame: Ints, points: Array) -> bool:
    """Return whether, in most pictures, a person is near the position of a person in the previous picture."""
    moved = []
    for number in np.unique(frame)[1 : MOST_COMPARED + 1]:
        before, now = points[frame == number - 1], points[frame == number]
        if len(before) and len(now):
            apart = np.linalg.norm(before[:, None] - now[None], axis=-1)
            known = ~np.isnan(apart).all(axis=-1)
            spans = np.nanmax(now, axis=1) - np.nanmin(now, axis=1)
            scale = np.sqrt(np.maximum(spans.prod(axis=-1), 1.0))
            if known.any():
                middle = np.nanmedian(np.where(known[..., None], apart, np.inf), axis=-1)
                moved.append(float(np.nanmin(middle / scale[None])))
    return not moved or float(np.median(moved)) <= FILM_MOTION


def _times(stated: Array, film: bool, options: Options) -> Array | None:
    """Return the times of all pictures (F,), seconds, interpolated for absent pictures; None without times."""
    known = np.isfinite(stated)
    if not known.any() or not film:
        return None
    time = stated.copy()
    time[known] = seconds("timestamp", stated[known])
    steps = np.diff(time[known]) / np.diff(np.flatnonzero(known))
    if (steps <= 0).any():
        options.warn("times of the pictures do not ascend: they are not used")
        return None
    time = np.interp(np.arange(len(time)), np.flatnonzero(known), time[known]) - time[known][0]
    rate = 1 / float(np.median(steps)) if len(steps) else None
    if rate and options.rate and abs(rate / options.rate - 1) > 0.05:
        contradiction = f"the file's times are {rate:.3g} frames per second, not {options.rate:g}"
        options.warn(f"{contradiction}: its times are used")
    return np.asarray(time)
