"""A view in memory: what one camera saw of one person, in metres and OpenCV's image convention."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from posekit.display.pictured import Pictured
from posekit.display.plural import plural
from posekit.display.short_repr import short
from posekit.display.stick_drawing import image_drawing
from posekit.formats.own.camera_model import CameraModel, ScaledOrthographicModel
from posekit.formats.own.units import FARTHEST_COORDINATE, Unit
from posekit.formats.own.view_schema import HEAD_NAMES, is_head_name
from posekit.safe_io.refusal import nearest, refusal, shown
from posekit.settings.recover import MAX_LENGTH_DEVIATION
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS, SEGMENT_NAMES

Array = NDArray[np.float64]

FRAME_ARRAYS: Final = ("time", "image", "head_image", "own_head_image", "confidence", "root", "truth")
"""What a view has of each frame."""


def _no_frames() -> Array:
    return np.empty((0,))


@dataclass(frozen=True, kw_only=True, eq=False)
class View(Pictured):
    """One view, a frame or a sequence. NaN marks what is not known.

    Parameters
    ----------
    camera : LeeChenModel, OpenCVModel or ScaledOrthographicModel
        The camera, as far as it is known; lengths in metres.
    time : array (F,)
        Seconds.
    image : array (F, 14, 2)
        Joints as seen, in tree order. OpenCV's convention, y down, always: pixels, or metres on the image
        plane where the camera is Lee & Chen's. The neck is seen in one frame at least, unless the camera is
        scaled orthographic: postures hang on it.
    head_image : array (F, 5, 2), optional
        Head points as seen, in the order of `posekit.skeleton.HEAD_POINTS`.
    own_head_image : array (F, K, 2), optional
        Head points of the user's own as seen, in the order of `own_head_names`.
    confidence : array (F, 19), optional
        How sure the image points are, joints and head points, as the detector says it: mostly 0 to 1.
    root : array (F, 3), optional
        The neck, OpenCV camera frame, metres.
    truth : array (F, 14, 3), optional
        The true joints, OpenCV camera frame, metres.
    lengths : mapping of str to float, optional
        Lengths in metres of the segments that differ from the figure's, by `posekit.skeleton.SEGMENT_NAMES`.
    shoulders : {"front", "behind"}, optional
        On which side of the line from neck to pelvis the shoulders lie: lengths do not tell it.
    stature : float, optional
        Height of the person, metres.
    deviation : float, optional
        Standard deviation of each coordinate of the image points, pixels.
    length_deviation : float, optional
        Relative standard deviation of the person's lengths, 0 to 0.3; 0 says that they are exact.
    derived : tuple of str
        Joints of `image` that no detector saw: they were put between others that it saw.
    head_points : mapping of str to array (3,), optional
        The rigid head's points in the head's frame, metres: the neck and `HEAD_POINTS`, or some of them,
        and any number of others under names of their own (Lee & Chen 1985, §2.1, recommend more than six).
    unit : {"m", "cm", "mm"}
        The unit of its file; in memory all is metres.

    Raises
    ------
    InputError
        Where a shape is wrong, a number is infinite, a point is known in part, a name is unknown, a length is
        not positive, or no frame shows the neck.

    Notes
    -----
    Arrays are copied and set read-only; those that are left out are filled with NaN.
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
    unit: Unit = "m"

    def __post_init__(self) -> None:
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
            # No points of its own, of other frames: what a view is replaced from has them so.
            absent = given.shape == (0,) or (name == "own_head_image" and not given.size)
            values = np.full(shape, np.nan) if absent else given
            if values.shape != shape:
                raise refusal("view", name, f"shape {values.shape}", f"{shape}", "give one row a frame")
            _check_points(name, values)
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if np.isnan(self.time).any():
            raise refusal("view", "time", "NaN", "a time for every frame", "number the frames if need be")
        if not isinstance(self.camera, ScaledOrthographicModel) and np.isnan(self.image[:, 0, 0]).all():
            raise refusal("view", "image[:, 0]", "NaN", "the neck in one frame at least", "add it")
        self._check_figure()

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    @property
    def own_head_names(self) -> tuple[str, ...]:
        """The head points beyond neck, nose, eyes and ears."""
        return own_names(self.head_points or ())

    def own_head(self) -> Array:
        """Return those points (K, 3) from the neck, the head's frame, metres."""
        given = self.head_points or {}
        neck = given.get("neck", np.zeros(3))
        return np.array([given[name] - neck for name in self.own_head_names]).reshape(-1, 3)

    def take(self, rows: NDArray[np.intp] | Sequence[int] | slice) -> View:
        """Return some of its frames."""
        return replace(self, **{name: getattr(self, name)[rows] for name in FRAME_ARRAYS})

    def _facts(self) -> list[str]:
        known = [name for name in ("root", "truth") if np.isfinite(getattr(self, name)).any()]
        seen = np.isfinite(self.image).all(axis=2)
        return [
            plural(len(self), "frame"),
            f"{self.time[0]:g} to {self.time[-1]:g} s",
            f"camera={type(self.camera).__name__}",
            f"{seen.mean():.0%} of joints seen",
            *[f"with {name}" for name in known],
            *[
                f"{name}={short(getattr(self, name))}"
                for name in ("stature", "deviation")
                if getattr(self, name)
            ],
        ]

    def _drawing(self) -> str:
        most = int(np.isfinite(self.image).all(axis=2).sum(axis=1).argmax())
        return image_drawing(self.image[most])

    def _check_figure(self) -> None:
        for name, length in self.lengths.items():
            _check_name("lengths", name, SEGMENT_NAMES)
            _check_length(f"lengths.{name}", length)
        object.__setattr__(self, "lengths", {name: float(length) for name, length in self.lengths.items()})
        if self.deviation is not None:
            _check_length("deviation", self.deviation, "a positive number of pixels")
        if self.length_deviation is not None and not 0 <= self.length_deviation <= MAX_LENGTH_DEVIATION:
            raise refusal(
                "view",
                "length_deviation",
                shown(self.length_deviation),
                f"a fraction of the length, 0 to {MAX_LENGTH_DEVIATION:g}",
                "correct it, or leave it out",
            )
        for name in self.derived:
            _check_name("derived", name, JOINTS)
        object.__setattr__(self, "derived", tuple(self.derived))
        if self.stature is not None:
            _check_length("stature", self.stature)
        if self.head_points is None:
            return
        points = {}
        for name, value in self.head_points.items():
            if not is_head_name(name):
                raise refusal(
                    "view", "head_points", shown(name), "the name of a head point", "give another name"
                )
            points[name] = point = np.array(value, dtype=np.float64)
            if point.shape != (3,) or not np.isfinite(point).all():
                raise refusal(
                    "view", f"head_points.{name}", shown(point.tolist()), "three finite numbers", "correct it"
                )
            point.flags.writeable = False
        object.__setattr__(self, "head_points", points)


def own_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of head points that are the user's own."""
    return tuple(name for name in names if name not in HEAD_NAMES)


def _check_points(name: str, values: Array) -> None:
    """Refuse numbers that are infinite or too far, and points of which only a part is known."""
    unknown = np.isnan(values)
    bad = np.isinf(values)
    if name in ("root", "truth"):  # metres; image points may have any unit
        bad |= np.abs(values) > FARTHEST_COORDINATE
    if name == "confidence":
        bad |= values < 0
    elif values.ndim > 1:
        bad |= unknown ^ unknown.all(axis=-1, keepdims=True)
    if bad.any():
        where = tuple(int(index) for index in np.argwhere(bad)[0])
        raise refusal(
            "view",
            f"{name}[{', '.join(map(str, where))}]",
            shown(float(values[where])),
            "finite points, or NaN in all of a point",
            "set the whole point to NaN where it is not known",
        )


def _check_name(field_name: str, name: str, names: tuple[str, ...]) -> None:
    if name not in names:
        raise refusal("view", field_name, shown(name), "a known name", nearest(name, names))


def _check_length(field_name: str, value: float, expected: str = "a positive length in metres") -> None:
    if not (np.isfinite(value) and value > 0):
        raise refusal("view", field_name, shown(float(value)), expected, "correct it")
