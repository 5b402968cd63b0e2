"""`Motion`: the frames of one body, as named points, as configurations of a robot, or as both."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, refusal, shown
from posekit.geometry import UP_AXES, UP_WORDS, Array, Record, numbers, rotation_between, up_vector
from posekit.skeleton import FEET_POINTS, HEAD_POINTS, JOINTS, NAMES

PER_FRAME: Final = ("joints", "q", "time", "frame", "clip")
"""Fields with one row per frame."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Motion(Record):
    """Motion of one body: T frames in one recording or several. A posture is a motion of one frame.

    Parameters
    ----------
    joints : array (T, J, 3), optional
        Positions of named points, metres. All frames share one world frame, unless `in_world` is False. NaN marks an
        unknown point.
    joint_names : sequence of J str
        Names of the points: `posekit.skeleton.JOINTS`, `HEAD_POINTS`, `FEET_POINTS`. The 14 joints by default.
    q : array (T, nq), optional
        Configurations of `robot` in Pinocchio's convention: metres, quaternion x, y, z, w, radians.
    q_names : sequence of nq str
        Name of each entry of `q`, from `posekit.robots.Robot.configuration_names`; empty for the robot's order.
    robot : str
        Name or path of the robot's URDF; ``figure`` for the built-in figure; empty if unknown.
    time : array (T,), optional
        Time of each frame, seconds; NaN if unknown. By default all times are unknown.
    frame : int array (T,), optional
        Number of each row's frame within its recording, from 0. Rows with the same number are alternative postures of
        one frame. By default rows are numbered consecutively.
    clip : int array (T,), optional
        Recording of each row, from 0.
    clips : sequence of str
        Names of the recordings; empty if they have none.
    up : str
        Axis that points up: ``+x`` … ``-z``; empty if unknown.
    unit : str
        Unit of length in the file.
    in_world : bool
        Whether all frames share one origin. False if each frame has its own origin, such as the middle of the hips:
        then neither the ground nor the path of the body is known.
    source : str
        File from which the motion was read; empty if there is none.
    layout : str
        Name of the layout that maps the file's names to points or joints.
    notes : sequence of str
        Facts about the file that the reader found or assumed, one sentence each.
    warnings : sequence of str
        Contradictions in the file, for the user to check, one sentence each.
    document : object, optional
        The parsed file. If the motion is saved in the same file format, the writer keeps the user's hierarchy, names
        and channels.

    Raises
    ------
    InputError
        If a shape, a name or an axis is wrong, or a number is infinite.

    Notes
    -----
    Arrays are copied and set read-only.

    Examples
    --------
    >>> import numpy as np
    >>> motion = Motion(joints=np.zeros((90, 14, 3)), time=np.arange(90) / 30, up="+z")
    >>> len(motion), motion.rate
    (90, 30.0)
    """

    joints: Array | None = None
    joint_names: Sequence[str] = JOINTS
    q: Array | None = None
    q_names: Sequence[str] = ()
    robot: str = ""
    time: Array | None = None
    frame: NDArray[np.intp] | None = None
    clip: NDArray[np.intp] | None = None
    clips: Sequence[str] = ()
    up: str = ""
    unit: str = "m"
    in_world: bool = True
    source: str = ""
    layout: str = ""
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    document: Any = field(default=None)

    def __post_init__(self) -> None:
        for name in ("joint_names", "q_names", "clips", "notes", "warnings"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if self.joints is None and self.q is None:
            raise self._refused("joints", "neither joints nor q", "one of them", "give positions or q")
        rows = len(self.joints) if self.joints is not None else len(self.q)  # type: ignore[arg-type]
        self._store("joints", self.joints, (rows, len(self.joint_names), 3))
        self._store("q", self.q, (rows, len(self.q_names) or None))
        self._store("time", np.full(rows, np.nan) if self.time is None else self.time, (rows,))
        clip = np.zeros(rows, dtype=np.intp) if self.clip is None else self.clip
        self._store("clip", clip, (rows,), np.intp)
        frame = self._counted() if self.frame is None else self.frame
        self._store("frame", frame, (rows,), np.intp)
        unknown = [name for name in self.joint_names if name not in NAMES]
        if unknown or len(set(self.joint_names)) != len(self.joint_names):
            got = unknown[0] if unknown else "a name twice"
            raise self._refused("joint_names", got, f"each once of {', '.join(NAMES)}", "name the points so")
        self._set("up", UP_WORDS.get(self.up.lower(), self.up))
        if self.up and self.up not in UP_AXES:
            raise self._refused("up", repr(self.up), f"one of {', '.join(UP_AXES)}", "give it with --up")

    def _refused(self, field_name: str, got: str, expected: str, remedy: str = "correct it") -> InputError:
        return refusal(self.source or "motion", field_name, got, expected, remedy)

    def _store(self, name: str, given: Any, shape: tuple[int | None, ...], dtype: Any = np.float64) -> None:
        """Store a read-only copy of an array after checking its shape; None is stored unchanged."""
        if given is None:
            return
        values = numbers(given, self.source or "motion", name, remedy="give one row per frame")
        fits = values.ndim == len(shape) and all(
            want in (None, have) for want, have in zip(shape, values.shape, strict=False)
        )
        if not fits:
            wanted = " x ".join("any" if extent is None else str(extent) for extent in shape)
            got = " x ".join(map(str, values.shape))
            raise self._refused(name, f"shape {got}", f"shape {wanted}", "name them, one row per frame")
        if (wrong := np.isinf(values) if dtype is np.float64 else ~np.isfinite(values)).any():
            where = [int(index) for index in np.argwhere(wrong)[0]]
            raise self._refused(
                f"{name}{where}", shown(float(values[*where])), "a finite number", "correct it"
            )
        self._set(name, values.astype(dtype))

    def _counted(self) -> NDArray[np.intp]:
        """Return the number of each row within its recording, from 0."""
        clip = np.asarray(self.clip)
        frame = np.zeros(len(clip), dtype=np.intp)
        for index in np.unique(clip):
            frame[clip == index] = np.arange((clip == index).sum())
        return frame

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(np.asarray(self.time))

    def _facts(self) -> list[str]:
        return [
            f"{len(self)} frames",
            *([f"{len(self.clips)} clips"] if len(self.clips) > 1 else []),
            *([f"{len(self.joint_names)} points"] if self.joints is not None else []),
            *([f"q of {self.robot or 'a robot'} ({self.q.shape[1]})"] if self.q is not None else []),
            *([f"{self.rate:g} Hz"] if self.rate else []),
            *([f"up {self.up}"] if self.up else []),
        ]

    @property
    def rate(self) -> float | None:
        """Frames per second, from the median step of time; None if unknown."""
        step = np.diff(np.asarray(self.time))[np.diff(np.asarray(self.clip)) == 0]
        step = step[np.isfinite(step) & (step > 0)]
        return float(np.round(1.0 / np.median(step), 6)) if len(step) else None

    @property
    def in_time(self) -> bool:
        """Whether the frames are successive in time: there are several frames, each with only one posture."""
        clip, frame = np.asarray(self.clip), np.asarray(self.frame)
        return len(self) > 1 and len(np.unique(clip * (frame.max() + 1) + frame)) == len(self)

    def points(self, names: Sequence[str]) -> Array:
        """Return positions (T, len(names), 3) of named points, metres; NaN for points that the motion lacks."""
        found = np.full((len(self), len(names), 3), np.nan)
        if self.joints is not None:
            place = {name: index for index, name in enumerate(self.joint_names)}
            have = [index for index, name in enumerate(names) if name in place]
            found[:, have] = self.joints[:, [place[names[index]] for index in have]]
        return found

    @property
    def figure_joints(self) -> Array:
        """Positions (T, 14, 3) of the joints in tree order, metres."""
        return self.points(JOINTS)

    @property
    def head(self) -> Array:
        """Positions (T, 5, 3) of nose, eyes and ears, metres."""
        return self.points(HEAD_POINTS)

    @property
    def feet(self) -> Array:
        """Positions (T, 4, 3) of toes and heels, metres."""
        return self.points(FEET_POINTS)

    @property
    def up_vector(self) -> Array | None:
        """Unit vector (3,) that points up; None if unknown."""
        return up_vector(self.up) if self.up else None

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_] | slice | Sequence[int]) -> Motion:
        """Return the motion of the selected frames."""
        kept = {name: getattr(self, name) for name in PER_FRAME if getattr(self, name) is not None}
        return replace(self, document=None, **{name: values[rows] for name, values in kept.items()})

    def recordings(self) -> Iterator[tuple[str, Motion]]:
        """Yield the name and the motion of each recording."""
        for index in np.unique(np.asarray(self.clip)):
            name = self.clips[index] if index < len(self.clips) else ""
            rows = self.clip == index
            yield name, self if np.all(rows) else replace(self.take(rows), clip=None, clips=(name,))

    def rotated(self, up: str) -> Motion:
        """Return the motion rotated so that the axis `up` points up; the result has no configurations.

        Raises
        ------
        InputError
            If `up` is not an axis, or the up axis of the motion is unknown.
        """
        if up == self.up or self.joints is None:
            return self
        if not self.up or up not in UP_AXES:
            raise self._refused("up", f"{self.up!r} to {up!r}", "known axes", "give it with --up")
        R = rotation_between(up_vector(self.up), up_vector(up))
        return replace(self, joints=self.joints @ R.T, up=up, q=None, q_names=(), robot="", document=None)
