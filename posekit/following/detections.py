"""`Detections`: key points of people in the pictures of one camera; `Detections.view` is the view of one person."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from posekit.cameras import CameraModel, PinholeCamera, ScaledOrthographicCamera, View
from posekit.errors import refusal, shown
from posekit.following.calibration import check_pictures, contradictions
from posekit.following.tracking import areas, track
from posekit.geometry import Array, Ints, Record
from posekit.skeleton import FEET_POINTS, HEAD, JOINT, JOINTS, POINTS

#: Largest accepted coordinate of a key point, pixels.
FARTHEST_PIXEL: Final = 1e6
#: Frames per second of a film if neither the file nor the user states them.
ASSUMED_RATE: Final = 30.0
#: Largest median coordinate of points that are fractions of the picture instead of pixels.
FRACTIONS_UP_TO: Final = 3.0
#: Confidence below which a point outside the picture counts as unseen: MediaPipe reports all 33 landmarks, seen or not.
INVENTED_BELOW: Final = 0.3


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Detections(Record):
    """Key points of people; a row is one person in one picture.

    Parameters
    ----------
    points : array (N, P, 2)
        Pixels, x right, y down, the centre of the first pixel at (0, 0); NaN if unseen.
    confidence : array (N, P), optional
        Confidence as reported by the detector, usually 0 to 1; NaN if unknown.
    names : tuple of P str
        Names of the points: `posekit.skeleton.JOINTS`, `HEAD_POINTS`, `FEET_POINTS`.
    frame : int array (N,)
        Number of the picture, ascending; pictures that a detector left out keep their number.
    person : int array (N,), optional
        Track of the person, from 0; -1 if unknown.
    pictures : tuple of str
        Names of the pictures by frame number; empty if they have no names.
    size : (int, int), optional
        Width and height of the pictures, pixels.
    time : array (pictures,), optional
        Seconds of each picture.
    rate : float, optional
        Pictures per second.
    film : bool
        Whether the pictures follow each other in time; people are tracked in films only.
    by_camera : bool
        Whether rows of one picture are one person seen by several cameras: `person` is then the camera's number.
    layout : str
        Name of the detector's layout.
    source : str
        File or folder.
    notes, warnings : tuple of str
        Assumptions made while reading, and contradictions that a user must see.
    derived : tuple of str
        Joints that the detector does not report: they were placed between joints that it reports.

    Raises
    ------
    InputError
        If shapes do not fit, a name is unknown, rows are not in order, or a coordinate is infinite or too large, or
        only one coordinate of a point is known.

    Examples
    --------
    >>> seen = Detections(points=np.full((1, 1, 2), 4.0), names=("left_wrist",), frame=np.zeros(1, dtype=np.intp))
    >>> len(seen)
    1
    """

    points: Array
    names: tuple[str, ...]
    frame: Ints
    confidence: Array = field(default_factory=lambda: np.empty(0))
    person: Ints = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    pictures: tuple[str, ...] = ()
    size: tuple[int, int] | None = None
    time: Array | None = None
    rate: float | None = None
    film: bool = True
    by_camera: bool = False
    layout: str = ""
    source: str = ""
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self._set("names", tuple(self.names))
        count, width = len(self.frame), len(self.names)
        for name, shape, unknown in (
            ("points", (count, width, 2), np.nan),
            ("confidence", (count, width), np.nan),
            ("frame", (count,), 0),
            ("person", (count,), -1),
        ):
            given = np.array(getattr(self, name), dtype=type(unknown))
            values = given if given.size else np.full(shape, unknown)
            if values.shape != shape:
                raise refusal(self.source, name, f"shape {values.shape}", f"{shape}", "give a row per person")
            self._set(name, values)
        if other := set(self.names) - {*POINTS, *FEET_POINTS}:
            raise refusal(self.source, "names", shown(min(other)), "names of joints, head or feet points")
        if (np.diff(self.frame, prepend=0) < 0).any():
            raise refusal(self.source, "frame", "unsorted numbers", "ascending from 0", "sort the rows")
        if self.pictures and count and self.frame[-1] >= len(self.pictures):
            got = f"{len(self.pictures)} names and picture {self.frame[-1]}"
            raise refusal(self.source, "pictures", got, "a name for every picture")
        if self.time is not None:
            self._set("time", np.array(self.time, dtype=np.float64))
        missing = np.isnan(self.points)
        bad = (np.abs(self.points) > FARTHEST_PIXEL) | (missing ^ missing.all(axis=-1, keepdims=True))
        if bad.any():
            row, point, _ = np.argwhere(bad)[0].tolist()
            frame = int(self.frame[row])
            picture = self.pictures[frame] if self.pictures else f"picture {frame}"
            got = shown(self.points[row, point].tolist())
            expected = f"two numbers up to {FARTHEST_PIXEL:,.0f}, or a missing point"
            raise refusal(self.source, f"{picture}: {self.names[point]}", got, expected)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.frame)

    def people(self) -> Ints:
        """Return the number of the person in each row (N,): from the file, or found by `posekit.following.tracking`.

        If the pictures are not a film, each row counts as a different person.
        """
        person = np.array(self.person)
        unknown = np.flatnonzero(person < 0)
        found = np.arange(len(unknown))
        if self.film:
            points, frame = self._in_order(self.points)[unknown], self.frame[unknown]
            found = track(points, frame, self.source, self.time)
        person[unknown] = person.max(initial=-1) + 1 + found
        return person

    def person_rows(self, which: int | str = "", camera: str = "") -> Ints:
        """Return the rows of one person, at most one per picture.

        Parameters
        ----------
        which : int or str
            Number of a person (see `people`), or a rule: ``largest``, the default, is the person with the largest size
            in the pictures, summed over pictures; ``surest`` is the person with the largest sum of confidences;
            ``first`` is the first person in the first picture. If the pictures are not a film, the rule is applied to
            each picture separately.
        camera : str
            Name of the camera; the number in it selects the camera in a file of several cameras.

        Raises
        ------
        InputError
            If no person has this number.
        """
        numbers, rule = self.people(), str(which) or "largest"
        people, index = np.unique(numbers, return_inverse=True)
        if not len(people):
            raise refusal(self.source, "person", "nobody in any picture", "a person", "give another file")
        if self.by_camera and not rule.isdecimal():
            ending = re.search(r"\d+\Z", camera)
            if ending is None or int(ending[0]) not in people:
                got = f"points of cameras {', '.join(map(str, people))}"
                remedy = f"give --camera FILE:cam_{people[0]}, or --person"
                raise refusal(self.source, "person", got, "one of them", remedy)
            rule = ending[0]
        sure = np.where(np.isnan(self.points[..., 0]), 0.0, np.nan_to_num(self.confidence, nan=1.0))
        worths = {
            "largest": np.sqrt(np.nan_to_num(areas(self._in_order(self.points)))),
            "surest": sure.sum(axis=1),
            "first": (np.arange(len(self)) == 0).astype(np.float64),
        }
        worth = worths.get(rule, worths["surest"])
        if rule in worths:
            best = people[np.bincount(index, weights=worth).argmax()]
            rows = np.flatnonzero((numbers == best) | (not self.film))
        elif rule.isdecimal() and int(rule) in people:
            rows = np.flatnonzero(numbers == int(rule))
        else:
            expected = f"{', '.join(worths)}, or a person's number: {', '.join(map(str, people[:10]))}"
            remedy = "see who they are with posekit inspect"
            raise refusal(self.source, "person", shown(rule), expected, remedy)
        rows = rows[np.lexsort((-worth[rows], self.frame[rows]))]
        return np.asarray(rows[np.diff(self.frame[rows], prepend=-1) > 0])

    def view(
        self,
        camera: CameraModel | None = None,
        *,
        person: int | str = "",
        rate: float | None = None,
        stature: float | None = None,
        deviation: float | None = None,
        length_deviation: float | None = None,
        min_confidence: float = 0.0,
    ) -> View:
        """Make the view of one person.

        A warning is issued if the person contradicts the calibration, for example is upside down. A point outside the
        picture counts as unseen if its confidence is below 0.3.

        Parameters
        ----------
        camera : PinholeCamera or ScaledOrthographicCamera, optional
            The camera; by default a scaled orthographic camera of unknown scale.
        person : int or str
            See `person_rows`.
        rate : float, optional
            Pictures per second, in place of the file's times.
        stature : float, optional
            Height of the person, metres.
        deviation : float, optional
            Standard deviation of each coordinate of the points, pixels.
        length_deviation : float, optional
            Relative standard deviation of the person's lengths.
        min_confidence : float
            Points of lower confidence count as unseen; points without a confidence are kept.

        Returns
        -------
        View
            The view of a film has a frame for every picture, including pictures without the person. The view of
            unrelated photographs has a frame for each photograph that shows a joint of the person.

        Raises
        ------
        InputError
            If no picture shows the person or, with a calibrated camera, the neck; if points are fractions of a picture
            of unknown size; or if the calibration belongs to other pictures.
        """
        camera = camera or ScaledOrthographicCamera(scale=None)
        pinhole = camera if isinstance(camera, PinholeCamera) else None
        size = pinhole.size if pinhole and pinhole.size else self.size
        rows = self.person_rows(person, pinhole.name if pinhole else "")
        points, sure = self._in_order(self.points)[rows], self._in_order(self.confidence)[rows]
        known = np.abs(points[np.isfinite(points)])
        if known.size and np.median(known) <= FRACTIONS_UP_TO:
            if size is None:
                got = "points that are fractions of the picture"
                raise refusal(self.source, "size", got, "the picture's size", "give the size")
            points *= size
        if pinhole:
            check_pictures(pinhole, points, self.size)
        unseen = sure < min_confidence
        if size is not None:
            unseen |= ((points < -0.5) | (points > np.array(size) - 0.5)).any(axis=-1) & (
                sure < INVENTED_BELOW
            )
        points[unseen] = np.nan
        sure[np.isnan(points[..., 0])] = np.nan
        frame = self.frame[rows]
        count = max(len(self.pictures), int(frame.max()) + 1)
        image, confidence = np.full((count, len(POINTS), 2), np.nan), np.full((count, len(POINTS)), np.nan)
        image[frame], confidence[frame] = points, sure
        seen = ~np.isnan(image[:, : len(JOINTS), 0])
        if not (seen if isinstance(camera, ScaledOrthographicCamera) else seen[:, JOINT["neck"]]).any():
            got = f"no shoulders in any of {count} pictures"
            remedy = "choose another --person or --min-confidence"
            raise refusal(self.source, "person", got, "both shoulders", remedy)
        assumed = self.film and count > 1 and self.time is None and not (rate or self.rate)
        doubts = [f"{ASSUMED_RATE:g} pictures a second are assumed; state the rate (--rate)"] * assumed
        for line in (*self.warnings, *contradictions(camera, points), *doubts):
            warnings.warn(f"{self.source}: {line}", UserWarning, stacklevel=2)
        kept = seen.any(axis=1) | self.film
        even = np.arange(count) / (rate or self.rate or ASSUMED_RATE)
        return View(
            camera=camera,
            time=(even if self.time is None else self.time)[kept],
            image=image[kept, : len(JOINTS)],
            head_image=image[kept][:, HEAD],
            confidence=confidence[kept],
            stature=stature,
            deviation=deviation,
            length_deviation=length_deviation,
            derived=tuple(name for name in self.derived if name in JOINTS and seen[:, JOINT[name]].any()),
            source=self.source,
            pictures=tuple(np.array(self.pictures)[kept]) if len(self.pictures) == count else (),
            layout=self.layout,
        )

    def _in_order(self, values: Array) -> Array:
        """Reorder values (N, P, ...) to joints and head points (N, 19, ...); NaN for points without a value."""
        found = np.full((len(values), len(POINTS), *values.shape[2:]), np.nan)
        place = {name: k for k, name in enumerate(self.names)}
        have = [k for k, name in enumerate(POINTS) if name in place]
        found[:, have] = values[:, [place[POINTS[k]] for k in have]]
        return found
