"""`View`: the image points of one person in one camera, over one or more frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from posekit.cameras.lee_chen import LeeChenCamera
from posekit.cameras.pinhole import PinholeCamera
from posekit.cameras.scaled_orthographic import ScaledOrthographicCamera
from posekit.errors import nearest, refusal, shown
from posekit.geometry import FARTHEST_COORDINATE, Array, Ints, Record, read_only
from posekit.settings import MAX_LENGTH_DEVIATION
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS, SEGMENT_NAMES

CameraModel = LeeChenCamera | PinholeCamera | ScaledOrthographicCamera

#: The standard points of the rigid head; a view may have other head points with other names.
HEAD_NAMES: Final = ("neck", *HEAD_POINTS)

#: Largest number of characters in the name of a user's own head point.
MAX_NAME_CHARACTERS: Final = 60

#: Fields with one row per frame.
FRAME_ARRAYS: Final = ("time", "image", "head_image", "own_head_image", "confidence", "root", "truth")


def _no_frames() -> Array:
    return np.empty((0,))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class View(Record):
    """A view of one person in one or more frames. NaN marks an unknown value.

    Parameters
    ----------
    camera : PinholeCamera, ScaledOrthographicCamera or LeeChenCamera
        The camera; its unknown parameters are None.
    time : array (F,)
        Seconds.
    image : array (F, 14, 2)
        Image points of the joints, in the order of `posekit.skeleton.JOINTS`, y down. The unit is pixels, or metres on
        the image plane for Lee & Chen's camera. At least one joint is known in at least one frame.
    head_image : array (F, 5, 2), optional
        Image points of the head, in the order of `posekit.skeleton.HEAD_POINTS`.
    own_head_image : array (F, K, 2), optional
        Image points of the user's own head points, in the order of `own_head_names`.
    confidence : array (F, 19), optional
        Confidence of the image points of joints and head points, as reported by the detector, usually 0 to 1.
    root : array (F, 3), optional
        Position of the neck, OpenCV camera frame, metres.
    truth : array (F, 14, 3), optional
        True joint positions, OpenCV camera frame, metres.
    lengths : mapping of str to float, optional
        Segment lengths, metres, by name (`posekit.skeleton.SEGMENT_NAMES`). A segment without an entry has the figure's
        length.
    shoulders : {"front", "behind"}, optional
        Whether the shoulders lie in front of or behind the line from neck to pelvis. Segment lengths do not determine
        this.
    stature : float, optional
        Height of the person, metres.
    deviation : float, optional
        Standard deviation of each coordinate of the image points, pixels.
    length_deviation : float, optional
        Relative standard deviation of the person's segment lengths, 0 to 0.3; 0 if the lengths are exact.
    derived : tuple of str
        Joints of `image` that were computed from other joints, because the detector does not report them.
    head_points : mapping of str to array (3,), optional
        Points of the rigid head in the head's frame, metres: the neck, some or all of `HEAD_POINTS`, and any number of
        points with other names (Lee & Chen 1985, §2.1, recommend more than six points).
    unit : {"m", "cm", "mm"}
        Unit of lengths in the view's file; in memory all lengths are in metres.
    source : str
        File that the view was read from; empty if there is none.
    pictures : tuple of str
        Names of the pictures, one per frame; empty if there are none.
    layout : str
        Name of the key-point layout that the image points came from.

    Raises
    ------
    InputError
        If a shape is wrong, a number is infinite, only some coordinates of a point are NaN, a name is unknown, a length
        is not positive, or no frame has a known joint.

    Notes
    -----
    Arrays are copied and set read-only; arrays that are left out are filled with NaN.

    Examples
    --------
    >>> from posekit.cameras import ScaledOrthographicCamera
    >>> image = np.random.default_rng(0).normal(size=(1, 14, 2))
    >>> len(View(camera=ScaledOrthographicCamera(scale=None), time=np.zeros(1), image=image))
    1
    """

    camera: CameraModel
    time: Array
    image: Array
    head_image: Array = field(default_factory=_no_frames)
    own_head_image: Array = field(default_factory=_no_frames)
    confidence: Array = field(default_factory=_no_frames)
    root: Array = field(default_factory=_no_frames)
    truth: Array = field(default_factory=_no_frames)
    lengths: Mapping[str, float] = field(default_factory=dict)
    shoulders: Literal["front", "behind"] | None = None
    stature: float | None = None
    deviation: float | None = None
    length_deviation: float | None = None
    derived: tuple[str, ...] = ()
    head_points: Mapping[str, Array] | None = None
    unit: str = "m"
    source: str = ""
    pictures: tuple[str, ...] = ()
    layout: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.camera, CameraModel):
            raise refusal(
                "view", "camera", shown(type(self.camera).__name__), "a camera", "open a calibration file"
            )
        frames = len(self.time)
        shapes = {
            "time": (frames,),
            "image": (frames, len(JOINTS), 2),
            "head_image": (frames, len(HEAD_POINTS), 2),
            "own_head_image": (frames, len(self.own_head_names), 2),
            "confidence": (frames, len(POINTS)),
            "root": (frames, 3),
            "truth": (frames, len(JOINTS), 3),
        }
        if frames == 0:
            raise refusal("view", "time", "no frame", "at least one", "give every frame its time")
        for name, shape in shapes.items():
            given = np.array(getattr(self, name), dtype=np.float64)
            # `replace` passes on the empty array of a view without own head points.
            absent = given.shape == (0,) or (name == "own_head_image" and not given.size)
            values = np.full(shape, np.nan) if absent else given
            if values.shape != shape:
                raise refusal("view", name, f"shape {values.shape}", f"{shape}", "give one row per frame")
            _check_points(name, values)
            self._set(name, values)
        if np.isnan(self.time).any():
            raise refusal("view", "time", "NaN", "a time for every frame", "give times or frame numbers")
        if np.isnan(self.image[..., 0]).all():
            raise refusal("view", "image", "only NaN", "a joint in at least one frame", "add a joint")
        if self.pictures and len(self.pictures) != frames:
            raise refusal("view", "pictures", f"{len(self.pictures)} names", f"{frames}", "name every frame")
        self._check_figure()

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    @property
    def own_head_names(self) -> tuple[str, ...]:
        """Names of the head points other than neck, nose, eyes and ears."""
        return own_names(self.head_points or ())

    def take(self, rows: Ints | Sequence[int] | slice) -> View:
        """Return the view of the selected frames, by index or slice."""
        index = np.arange(len(self))[rows]
        taken = {name: getattr(self, name)[index] for name in FRAME_ARRAYS}
        pictures = tuple(self.pictures[k] for k in index) if self.pictures else ()
        return replace(self, camera=self.camera.take(index), pictures=pictures, **taken)

    def _facts(self) -> list[str]:
        known = [name for name in ("root", "truth") if np.isfinite(getattr(self, name)).any()]
        return [
            f"{len(self)} frame{'s' if len(self) > 1 else ''}",
            f"{self.time[0]:g} to {self.time[-1]:g} s",
            f"camera={type(self.camera).__name__}",
            f"{np.isfinite(self.image).all(axis=2).mean():.0%} of joints seen",
            *[f"with {name}" for name in known],
        ]

    def _check_figure(self) -> None:
        for name in self.lengths:
            _check_name("lengths", name, SEGMENT_NAMES)
        sizes = {f"lengths.{name}": length for name, length in self.lengths.items()}
        for name, size in (*sizes.items(), ("stature", self.stature), ("deviation", self.deviation)):
            if size is not None and not (np.isfinite(size) and size > 0):
                unit = "number of pixels" if name == "deviation" else "length in metres"
                raise refusal("view", name, shown(float(size)), f"a positive {unit}")
        self._set("lengths", {name: float(length) for name, length in self.lengths.items()})
        if self.length_deviation is not None and not 0 <= self.length_deviation <= MAX_LENGTH_DEVIATION:
            got, expected = shown(self.length_deviation), f"a fraction, 0 to {MAX_LENGTH_DEVIATION:g}"
            raise refusal("view", "length_deviation", got, expected, "correct it, or leave it out")
        for name in self.derived:
            _check_name("derived", name, JOINTS)
        self._set("derived", tuple(self.derived))
        if self.head_points is None:
            return
        points = {}
        for name, value in self.head_points.items():
            if not is_head_name(name):
                expected = f"a name of up to {MAX_NAME_CHARACTERS} characters that no joint has"
                raise refusal("view", "head_points", shown(name), expected, "give another name")
            points[name] = point = read_only(value)
            if point.shape != (3,) or not np.isfinite(point).all():
                raise refusal("view", f"head_points.{name}", shown(point.tolist()), "three finite numbers")
        self._set("head_points", points)


def own_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of head points other than neck, nose, eyes and ears."""
    return tuple(name for name in names if name not in HEAD_NAMES)


def is_head_name(name: str) -> bool:
    """Return whether a head point may have this name: short, printable, and not the name of a joint but the neck."""
    short_enough = 0 < len(name.strip()) <= len(name) <= MAX_NAME_CHARACTERS
    return name in HEAD_NAMES or (short_enough and name.isprintable() and name not in JOINTS)


def _check_points(name: str, values: Array) -> None:
    """Raise if a number is infinite or too large, or if only some coordinates of a point are NaN."""
    unknown, bad = np.isnan(values), np.isinf(values)
    if name in ("root", "truth"):  # metres; image points may have any unit
        bad |= np.abs(values) > FARTHEST_COORDINATE
    if name == "confidence":
        bad |= values < 0
    elif values.ndim > 1:
        bad |= unknown ^ unknown.all(axis=-1, keepdims=True)
    if bad.any():
        where = tuple(int(index) for index in np.argwhere(bad)[0])
        kind = "confidences of 0 or more" if name == "confidence" else "finite points"
        place, remedy = f"{name}[{', '.join(map(str, where))}]", "set an unknown point to NaN as a whole"
        raise refusal("view", place, shown(float(values[where])), f"{kind}, or NaN", remedy)


def _check_name(field_name: str, name: str, names: tuple[str, ...]) -> None:
    if name not in names:
        raise refusal("view", field_name, shown(name), "a known name", nearest(name, names))
