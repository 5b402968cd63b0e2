"""From a detector's rows to `Detections`: which point is which, which are missing, and where each picture belongs."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, cut, refusal
from posekit.following.detections import FARTHEST_PIXEL, FRACTIONS_UP_TO, Detections
from posekit.formats.layout import LIMBS, Layout, by_names, by_order, layout_names, load_layout
from posekit.formats.options import Options
from posekit.geometry import Array

Names = tuple[str, ...]

#: Share of the numbers of a film's pictures that a detector lists at least, in steps of their common divisor; pictures
#: of a collection have numbers far apart.
DENSE: Final = 0.5
#: Numbers a listed picture of a film over which its numbers may spread; beyond, they are no picture numbers.
MOST_SPREAD: Final = 20
#: Median motion of a person between pictures of a film, in units of the square root of the body's area; between
#: unrelated photographs it is about 1 and more.
FILM_MOTION: Final = 0.5
#: Pictures in which the motion is measured.
MOST_COMPARED: Final = 200
#: Detections of a file whose people are listed: telling them apart takes some time.
MOST_TRACKED: Final = 2000
#: People that a note lists.
MOST_LISTED: Final = 20
#: Landmarks that a layout must place to be used for points that are a part of a body.
LEAST_LANDMARKS: Final = 4
#: A picture whose size is not known.
UNKNOWN: Final = (math.nan, math.nan)
HEAD_SHARE_COCO: Final = 0.33
#: Size of the first five of 17 points against all: in COCO's order they are the head, in Human3.6M's a leg and more.
HEAD_SHARE_H36M: Final = 0.45
#: Ratio of the mean segment lengths of two readings of 25 points, from which the shorter one is right: of 3,000
#: projected postures with 8 px of noise 0.23 % were misread, of 253 detections in photographs and videos none.
CLEAR_LENGTH_RATIO: Final = 1.28
#: Segments of a body by the names of OpenPose's points.
COMPARED_SEGMENTS: Final = [
    (side + segment.split("-")[0], side + segment.split("-")[1])
    for side in "RL"
    for segment in "Shoulder-Elbow Elbow-Wrist Hip-Knee Knee-Ankle Shoulder-Hip Ear-Shoulder Eye-Ear "
    "Ankle-Heel Ankle-BigToe".split()
] + [("Nose", "REye"), ("Nose", "LEye"), ("LShoulder", "RShoulder"), ("LHip", "RHip")]


class Rows:
    """People as a file lists them: in any order, of pictures with labels.

    Attributes
    ----------
    source, kind : str
        The file, and the name of its format.
    names : tuple of str
        Names of the points; empty if the file has none.
    film : bool or None
        Whether the pictures are of one film; None if their numbers and the people's motion tell.
    in_folder : bool
        Whether there is one file a picture.
    by_camera : bool
        Whether the numbers of people are those of the cameras that saw one person.
    pictures : dict
        By label: time (s), width and height, NaN where unknown.
    """

    def __init__(self, source: str) -> None:
        self.source, self.kind = source, ""
        self.names: tuple[str, ...] = ()
        self.film: bool | None = True
        self.in_folder = self.by_camera = False
        self.pictures: dict[str, tuple[float, float, float]] = {}
        self.labels: list[str] = []
        self.points: list[Array] = []
        self.sure: list[Array] = []
        self.person: list[int] = []

    def picture(self, label: Any, *, time: float = math.nan, size: tuple[float, float] = UNKNOWN) -> str:
        """Note a picture, with or without people; return its label as text."""
        name = str(label)
        known = self.pictures.get(name, (math.nan, math.nan, math.nan))
        stated = (float(time), *size)
        self.pictures[name] = tuple(b if math.isnan(a) else a for a, b in zip(known, stated, strict=True))  # type: ignore[assignment]
        return name

    def add(self, label: Any, points: Array, sure: Array, *, person: Any = None) -> None:
        """Note a person in a picture.

        Parameters
        ----------
        label : object
            The picture.
        points : array (K, 2)
            Pixels, or fractions of the picture.
        sure : array (K,)
            Confidences, NaN where there is none. A point with confidence 0 is missing wherever it lies; so is one at
            the origin or at (-1, -1), and one that is known in part.
        person : object
            The file's number of the person; anything else is unknown.
        """
        count = len(self.points[0]) if self.points else len(points)
        if len(points) != count:
            got = f"a person of {len(points)} points after one of {count}"
            where = f"picture {cut(str(label))}"
            raise refusal(self.source, where, got, "the same number for all", "split the file")
        with np.errstate(invalid="ignore"):
            nowhere = (points == 0).all(axis=-1) | (points == -1).all(axis=-1)
            missing = np.isnan(points).any(axis=-1) | (sure == 0) | nowhere
            beyond = ~missing & ~(np.abs(points) <= FARTHEST_PIXEL).all(axis=-1)
        if beyond.any():
            got, where = str(points[beyond][0].tolist()), f"picture {cut(str(label))}"
            raise refusal(self.source, where, got, f"numbers up to {FARTHEST_PIXEL:,.0f}")
        name = self.picture(label)
        if missing.all():
            return
        self.labels.append(name)
        self.points.append(np.where(missing[:, None], np.nan, points))
        self.sure.append(np.where(missing, np.nan, sure))
        whole = isinstance(person, int | float) and not isinstance(person, bool) and 0 <= person < 2**31
        self.person.append(int(person) if whole else -1)


def detections_of(rows: Rows, options: Options) -> Detections:
    """Make detections of all rows.

    Raises
    ------
    InputError
        If it is not clear which points the points are, or files of several cameras are in one folder.
    """
    points, sure = np.array(rows.points), np.array(rows.sure)
    if rows.names and len(points) and points.shape[1] != len(rows.names):
        got = f"{points.shape[1]} points with {len(rows.names)} names"
        raise refusal(rows.source, "points", got, "a name for each point", "correct the names")
    layout = _layout(rows, points, options)
    if not len(points):
        width = len(rows.names or layout.points)
        points, sure = np.empty((0, width, 2)), np.empty((0, width))
    notes: list[str] = []
    points = _in_pixels(rows, points, layout, notes)
    names, placed, derived = layout.seen(rows.names, points)
    confidence = layout.seen(rows.names, sure[..., None])[1][..., 0]
    labels = list(rows.pictures)
    film, place = _places(rows, labels, placed, notes)
    frame = np.array([place[label] for label in rows.labels], dtype=np.intp)
    order = np.argsort(frame, kind="stable")
    count = max(place.values(), default=-1) + 1
    pictures, described = [""] * count, np.full((count, 3), np.nan)
    for label, index in place.items():
        pictures[index], described[index] = label, rows.pictures[label]
    sizes = {tuple(size) for size in described[[place[label] for label in labels], 1:].tolist()}
    size = sizes.pop() if len(sizes) == 1 else (np.nan, np.nan)
    time, warnings = _times(described[:, 0], film, options, notes)
    notes.append(f"{len(placed)} detections in {len(labels)} pictures, {rows.kind}, {layout.name}")
    found = Detections(
        points=placed[order],
        confidence=confidence[order],
        names=names,
        frame=frame[order],
        person=np.array(rows.person, dtype=np.intp)[order],
        pictures=tuple(pictures),
        size=None if np.isnan(size).any() else (int(size[0]), int(size[1])),
        time=time,
        rate=options.rate if time is None else None,
        film=film,
        by_camera=rows.by_camera,
        layout=layout.name,
        source=rows.source,
        notes=tuple(notes),
        warnings=tuple(warnings),
        derived=derived,
    )
    if film and len(np.unique(found.frame)) < len(found) <= MOST_TRACKED:
        numbers, counts = np.unique(found.people(), return_counts=True)
        listed = ", ".join(f"{who} in {n}" for who, n in zip(numbers[:MOST_LISTED], counts, strict=False))
        found = replace(found, notes=(f"people by number, and their pictures: {listed}", *notes))
    return found


def _layout(rows: Rows, points: Array, options: Options) -> Layout:
    """Find the layout: the user's, by the names in the file, or by the number of points."""
    if options.layout:
        given = load_layout(options.layout)
        if rows.names:
            return given.over(rows.names)
        if len(points) and points.shape[1] != len(given.points):
            got = f"{points.shape[1]} points a person"
            raise refusal(rows.source, "points", got, f"{len(given.points)} of {given.name}", "change it")
        return given
    if rows.names:
        try:
            return by_names(rows.names, rows.source)
        except InputError:
            return _in_part(rows)
    if not len(points):
        return load_layout("coco_17")
    count = points.shape[1]
    if count == 17:
        return load_layout(_of_17(rows, points))
    if count == 25:
        return load_layout(_of_25(rows, points))
    found = [one for one in by_order(count) if one.kind == "points"]
    if len(found) == 1:
        return found[0]
    known = ", ".join(one.name for one in found) or "17, 18, 25, 26, 33, 133 or 136 points"
    raise refusal(rows.source, "points", f"{count} points without names", known, "give it with --layout")


def _in_part(rows: Rows) -> Layout:
    """Find the layout that places most of the landmarks of a part of a body: legs alone, or one side."""
    fitting = [load_layout(name).over(rows.names) for name in layout_names()]
    best = max(fitting, key=lambda one: len(one.landmarks))
    if len(set(best.landmarks) & set(LIMBS)) < LEAST_LANDMARKS:
        return by_names(rows.names, rows.source)  # raises the error that names the nearest layout
    return best


def _of_17(rows: Rows, points: Array) -> str:
    """Tell COCO's order of 17 points from Human3.6M's by what is at the places of the head."""
    known = ~np.isnan(points[..., 0])
    enough = (known[:, :5].sum(axis=1) >= 2) & (known[:, 5:].sum(axis=1) >= 2)
    if rows.kind == "coco" or not enough.any():
        return "coco_17"
    first, whole = (_diagonal(points[enough][:, part]) for part in (slice(0, 5), slice(None)))
    share = float(np.median(first / np.maximum(whole, 1e-9)))
    if HEAD_SHARE_COCO < share < HEAD_SHARE_H36M and rows.kind == "mmpose":
        remedy = "give --layout coco_17 or --layout h36m_17"
        raise refusal(rows.source, "points", "17 points without names", "points of one layout", remedy)
    return "h36m_17" if share >= HEAD_SHARE_H36M else "coco_17"


def _diagonal(points: Array) -> Array:
    spans = np.nanmax(points, axis=1) - np.nanmin(points, axis=1)
    return np.asarray(np.hypot(spans[:, 0], spans[:, 1]))


def _of_25(rows: Rows, points: Array) -> str:
    """Tell OpenPose's BODY_25 from BODY_25B: in the right order the segments of a body are short."""
    names = ("body_25", "body_25b")
    lengths = []
    for name in names:
        place = {point: k for k, point in enumerate(load_layout(name).points)}
        ends = np.array([[place[one] for one in segment] for segment in COMPARED_SEGMENTS])
        lengths.append(np.linalg.norm(points[:, ends[:, 0]] - points[:, ends[:, 1]], axis=-1))
    enough = np.min([(~np.isnan(one)).sum(axis=1) for one in lengths], axis=0) >= 6
    if enough.any():
        means = [np.maximum(np.nanmean(one[enough], axis=1), 1e-9) for one in lengths]
        ratio = float(np.median(np.log(means[0] / means[1])))
        if abs(ratio) > math.log(CLEAR_LENGTH_RATIO):
            return names[0] if ratio < 0 else names[1]
    remedy = "give --layout body_25 or --layout body_25b"
    raise refusal(rows.source, "points", "25 points that fit both orders", " or ".join(names), remedy)


def _in_pixels(rows: Rows, points: Array, layout: Layout, notes: list[str]) -> Array:
    """Turn fractions of the picture into pixels where its size is known; leave them where it is not."""
    known = points[~np.isnan(points[..., 0])]
    if rows.kind == "openpose" and len(known) and np.abs(known).max() <= 1 and known.min() < 0:
        points, known = (points + 1) / 2, (known + 1) / 2  # --keypoint_scale 4: from -1 to 1
    if not len(known) or float(np.median(np.abs(known))) > FRACTIONS_UP_TO:
        return points
    if rows.kind == "mediapipe":
        middle = np.nanmean(layout.gather(points).get("mid_hips", points), axis=0)
        if float(np.abs(middle).max()) < 0.02:
            got = "landmarks around the middle of the hips: world landmarks, metres"
            raise refusal(rows.source, "", got, "landmarks in the picture", "save pose_landmarks")
    sizes = np.array([rows.pictures[label][1:] for label in rows.labels])
    if np.isnan(sizes).any():
        notes.append("points are fractions of the picture, whose size the file does not have")
        return points
    return np.asarray(points * sizes[:, None])


def _places(rows: Rows, labels: list[str], points: Array, notes: list[str]) -> tuple[bool, dict[str, int]]:
    """Tell whether the pictures are of a film, and give each its frame; left-out pictures keep their place."""
    numbers = _numbers(rows, labels)
    if numbers is None:
        film = bool(rows.film) or (rows.film is None and len(labels) == 1)
        ordered = labels if rows.film is not None and not rows.in_folder else sorted(labels, key=str)
        return film, {label: k for k, label in enumerate(ordered)}
    first = int(numbers.min())
    step = int(np.gcd.reduce(numbers - first)) or 1
    place = (numbers - first) // step
    dense = len(labels) >= DENSE * (int(place.max()) + 1)
    film = rows.film is True or (
        dense and len(labels) > 1 and _one_size(rows) and _moves_little(rows, labels, place, points)
    )
    if not film or int(place.max()) + 1 > MOST_SPREAD * len(labels):
        place = np.argsort(np.argsort(numbers, kind="stable"))
    if step > 1 and film:
        notes.append(f"pictures are numbered in steps of {step}")
    if not film and len(labels) > 1:
        notes.append("pictures are unrelated photographs: people are not followed through them")
    return film, dict(zip(labels, map(int, place), strict=True))


def _numbers(rows: Rows, labels: list[str]) -> NDArray[np.int64] | None:
    """Return the number in each picture's label that tells all apart; None if there is none."""
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


def _one_size(rows: Rows) -> bool:
    return len({size[1:] for size in rows.pictures.values() if not math.isnan(size[1])}) <= 1


def _moves_little(rows: Rows, labels: list[str], place: NDArray[np.int64], points: Array) -> bool:
    """Tell whether somebody is about where somebody was in the picture before, in the median over pictures."""
    frame_of = dict(zip(labels, place.tolist(), strict=True))
    frame = np.array([frame_of[label] for label in rows.labels])
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


def _times(stated: Array, film: bool, options: Options, notes: list[str]) -> tuple[Array | None, list[str]]:
    """Return the times of all pictures (F,), those left out put between the others; None if the file has none."""
    known = np.isfinite(stated)
    if not known.any() or not film:
        if film and options.rate is None and len(stated) > 1:
            notes.append("the frame rate is not known; give it with --rate")
        return None, []
    steps = np.diff(stated[known]) / np.diff(np.flatnonzero(known))
    time = stated.copy()
    if len(steps) and float(np.median(steps)) > 2:  # a "timestamp" in milliseconds
        time, steps = time * 1e-3, steps * 1e-3
    if (steps <= 0).any():
        return None, ["times of the pictures do not ascend: they are not used"]
    time = np.interp(np.arange(len(time)), np.flatnonzero(known), time[known]) - time[known][0]
    rate = 1 / float(np.median(steps)) if len(steps) else None
    if rate and options.rate and abs(rate / options.rate - 1) > 0.05:
        contradiction = f"the file's times are {rate:.3g} frames a second, not {options.rate:g}"
        return time, [f"{contradiction}: its times are used"]
    return time, []
