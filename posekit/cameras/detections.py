"""`Detections`: key points of people over the pictures of one camera, and the view of one of them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from posekit.cameras.picking import chosen, view_of
from posekit.cameras.scaled_orthographic import ScaledOrthographicCamera
from posekit.cameras.view import CameraModel, View
from posekit.errors import refusal, shown
from posekit.geometry import Array, Flags, Ints, Record
from posekit.skeleton import FEET_POINTS, POINTS

#: Largest accepted coordinate of a key point, pixels.
FARTHEST_PIXEL: Final = 1e6


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Detections(Record):
    """Key points of people; a row is one person in one picture.

    Parameters
    ----------
    points : array (N, P, 2)
        Pixels, x right, y down, the centre of the first pixel at (0, 0); NaN if unseen.
    confidence : array (N, P), optional
        Confidence as the detector gives it, mostly 0 to 1; NaN if unknown.
    names : tuple of P str
        Names of the points: `posekit.skeleton.JOINTS`, `HEAD_POINTS`, `FEET_POINTS`.
    frame : int array (N,)
        Number of the picture, ascending; pictures that a detector left out keep their number.
    person : int array (N,), optional
        Track of the person, from 0; -1 if unknown.
    pictures : tuple of str
        Names of the pictures by frame number; empty if they have none.
    size : (int, int), optional
        Width and height of the pictures, pixels.
    time : array (pictures,), optional
        Seconds of each picture.
    rate : float, optional
        Pictures per second.
    film : bool
        Whether the pictures follow each other in time; nobody is followed through unrelated photographs.
    by_camera : bool
        Whether rows of one picture are one person seen by several cameras: `person` is then the camera's number.
    layout : str
        Name of the detector's layout.
    source : str
        File or folder.
    notes, warnings : tuple of str
        Assumptions made while reading, and contradictions that a user must see.
    derived : tuple of str
        Joints that the detector does not have: they were placed between others.

    Raises
    ------
    InputError
        If shapes do not fit, a name is unknown, rows are not in order, or a coordinate is infinite, too large or
        known in part.

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
        for name, shape, empty in (
            ("points", (count, width, 2), np.nan),
            ("confidence", (count, width), np.nan),
            ("frame", (count,), 0),
            ("person", (count,), -1),
        ):
            kind = np.intp if name in ("frame", "person") else np.float64
            given = np.array(getattr(self, name), dtype=kind)
            values = np.full(shape, empty, dtype=kind) if given.size == 0 else given
            if values.shape != shape:
                raise refusal(self.source, name, f"shape {values.shape}", f"{shape}", "give one row a person")
            self._set(name, values)
        unknown = [name for name in self.names if name not in (*POINTS, *FEET_POINTS)]
        if unknown:
            raise refusal(self.source, "names", shown(unknown[0]), "names of joints, head or feet points")
        if count and ((np.diff(self.frame) < 0).any() or self.frame[0] < 0):
            raise refusal(self.source, "frame", "unsorted numbers", "ascending ones from 0", "sort the rows")
        if self.pictures and count and self.frame[-1] >= len(self.pictures):
            got = f"{len(self.pictures)} names and picture {self.frame[-1]}"
            raise refusal(self.source, "pictures", got, "a name for every picture")
        if self.time is not None:
            self._set("time", np.array(self.time, dtype=np.float64))
        missing = np.isnan(self.points)
        bad = (np.abs(self.points) > FARTHEST_PIXEL) | (missing ^ missing.all(axis=-1, keepdims=True))
        if bad.any():
            row, point, _ = (int(k) for k in np.argwhere(bad)[0])
            place = f"{self.picture(int(self.frame[row]))}: {self.names[point]}"
            expected = f"two numbers up to {FARTHEST_PIXEL:,.0f}, or a missing point"
            raise refusal(self.source, place, shown(self.points[row, point].tolist()), expected)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.frame)

    def picture(self, frame: int) -> str:
        """Return the name of a picture, or its number."""
        return self.pictures[frame] if self.pictures else f"picture {frame}"

    def take(self, rows: Ints | Flags) -> Detections:
        """Return some of the rows, by index or mask."""
        index = np.arange(len(self))[rows]
        taken = {name: getattr(self, name)[index] for name in ("points", "confidence", "frame", "person")}
        return replace(self, **taken)

    def person_rows(self, which: int | str = "") -> Ints:
        """Return the rows of one person, at most one a picture.

        Parameters
        ----------
        which : int or str
            Number of a track, the file's own or that of `posekit.cameras.tracking.track`. Or ``largest``, the default:
            the person with the largest share of the pictures, summed over them; ``surest``: with the largest sum of
            confidences; ``first``: the first in the first picture. Among unrelated photographs a rule chooses in each
            picture.

        Raises
        ------
        InputError
            If nobody has that number.
        """
        return chosen(self, str(which))

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

        Parameters
        ----------
        camera : PinholeCamera or ScaledOrthographicCamera, optional
            The camera; scaled orthographic of unknown scale by default.
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
            Of all pictures of a film, also of those without the person: frames are pictures, in number and in
            time. Of unrelated photographs, those that show any joint of the person.

        Raises
        ------
        InputError
            If no picture shows the person, or none the neck with a calibrated camera.
        """
        camera = camera or ScaledOrthographicCamera(scale=None)
        known = {"stature": stature, "deviation": deviation, "length_deviation": length_deviation}
        return view_of(self, camera, str(person), rate, min_confidence, known)
