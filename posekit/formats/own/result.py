"""What was recovered, in memory: survivors frame by frame, in metres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posekit.display.pictured import Pictured
from posekit.display.plural import plural
from posekit.display.stick_drawing import posture_drawing
from posekit.formats.own.digits import Precision
from posekit.formats.own.family import Family
from posekit.formats.own.frame_answer import FrameAnswer
from posekit.formats.own.paths import FollowedPaths
from posekit.formats.own.posture_set import PostureSet
from posekit.formats.own.root import Root
from posekit.formats.own.survivor_columns import SURVIVOR_COLUMNS, SurvivorColumns
from posekit.formats.own.units import Unit
from posekit.geometry import Array
from posekit.safe_io.refusal import refusal
from posekit.skeleton import JOINTS

if TYPE_CHECKING:
    from posekit.formats.own.camera_model import OpenCVModel

CAMERA_FIELDS: Final = ("f", "rotation", "position", "residual")
LEVEL_FIELDS: Final = ("joint", "physical", "motion")
EVERYWHERE_COLUMNS: Final = tuple(name for name, column in SURVIVOR_COLUMNS.items() if column.everywhere)
"""Columns that all frames of a result have, or none."""

RESULT_SCHEMA: Final = "posekit.result/2"
"""What a result's file says it is."""
EARLIER_RESULT_SCHEMA: Final = "posekit.result/1"
"""What one of an earlier version says, which is read as well: it has no sets and no answers, and lists everything."""
RESULT_SCHEMAS: Final = (RESULT_SCHEMA, EARLIER_RESULT_SCHEMA)


NOT_LISTED: Final = "noise/unlisted"
"""What branches are counted by that nothing rejected: they are possible, but with the least probability."""

BASE_QUATERNION: Final = slice(3, 7)
"""Where a configuration has the rotation of its base, after its place."""

ROUNDED_QUATERNION: Final = 1e-3
"""How far from one the length of a quaternion may be whose numbers were rounded."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ResultFrame(SurvivorColumns):
    """The survivors of one frame: their columns (`SurvivorColumns`), and what is said of the frame.

    Parameters
    ----------
    time : float
        Seconds.
    camera : mapping
        What was recovered of the camera, each None (or NaN) where it is not known: ``f`` (metres; Lee &
        Chen's camera alone, whose f is a length), ``rotation`` (3, 3), ``position`` (3,) in metres,
        ``residual`` (in the unit of the image: metres where there is an f, else pixels).
    levels : mapping
        Survivors per level of the tree: ``joint`` names, ``physical`` and ``motion`` counts, of one length.
    rejected : mapping of str to int
        Pruned branches by the finding that killed them.
    pruned : sequence of mappings, optional
        Detail on each pruned branch, of plain values.
    family : Family, optional
        The scales that an uncalibrated frame can have.
    root : Root, optional
        How the neck's depth was found, where the frame is calibrated and it was not given.
    posture_set : PostureSet, optional
        All that the frame can be.
    unlisted : int
        How many bodies that were not ruled out are not among the survivors here.
    unlisted_probability : float
        What these hold of the probability of all.
    answer : FrameAnswer, optional
        What is to be said of the frame first.
    """

    time: float
    camera: Mapping[str, Any]
    levels: Mapping[str, Sequence[Any]]
    rejected: Mapping[str, int]
    pruned: Sequence[Mapping[str, Any]] | None = None
    family: Family | None = None
    root: Root | None = None
    posture_set: PostureSet | None = None
    unlisted: int = 0
    unlisted_probability: float = 0.0
    answer: FrameAnswer | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "camera", _camera(self.camera))
        if (
            set(self.levels) != set(LEVEL_FIELDS)
            or len({len(self.levels[name]) for name in LEVEL_FIELDS}) != 1
        ):
            raise _refused("levels", ", ".join(self.levels), "joint, physical and motion, of one length")
        levels = {
            "joint": tuple(str(name) for name in self.levels["joint"]),
            "physical": tuple(int(number) for number in self.levels["physical"]),
            "motion": tuple(int(number) for number in self.levels["motion"]),
        }
        object.__setattr__(self, "levels", levels)
        object.__setattr__(self, "rejected", {str(name): int(n) for name, n in self.rejected.items()})
        if not np.isfinite(self.time):
            raise _refused("time", str(self.time), "a finite number of seconds")
        if self.unlisted < 0 or not 0 <= self.unlisted_probability <= 1:
            got = f"{self.unlisted} with {self.unlisted_probability:g}"
            raise _refused("unlisted", got, "a count from 0, with a probability")
        if self.answer is not None:
            self.answer.check_against(len(self.joints))
        if self.refined is not None:
            object.__setattr__(self, "q", _with_unit_quaternions(self.q))

    @property
    def rejecting(self) -> dict[str, int]:
        """Pruned branches by what rejected them: without those that are possible and only not listed."""
        return {reason: count for reason, count in self.rejected.items() if reason != NOT_LISTED}

    @cached_property
    def precision(self) -> Precision | None:
        """The digits that its numbers have; None where they have all, as its noise is not known."""
        return None if self.refined is None else Precision.of(self.refined.covariance)


@dataclass(frozen=True, kw_only=True, eq=False)
class Result(Pictured):
    """A recovery, as it is written and read.

    Parameters
    ----------
    unit : "m", "cm" or "mm"
        The unit of lengths in the file; in memory they are metres.
    joint_names : sequence of 14 str
        The joints, in tree order.
    configuration_names : sequence of nq str
        The entries of q, in Pinocchio's order.
    settings : mapping
        Everything that decided the result, of plain values.
    frames : sequence of ResultFrame
        All with the same margins; all with groups or none, and with probabilities or none.
    paths : FollowedPaths, optional
        The person through all frames, where they were followed.
    decimals : int, optional
        Of a result that was read: how many decimals of metres positions have in frames whose noise is known.
    """

    unit: Unit
    joint_names: Sequence[str] = JOINTS
    configuration_names: Sequence[str]
    settings: Mapping[str, Any]
    frames: Sequence[ResultFrame]
    paths: FollowedPaths | None = None
    decimals: int | None = None

    def _facts(self) -> list[str]:
        count = sum(len(frame.joints) for frame in self.frames)
        paths = [] if self.paths is None else [plural(len(self.paths.joints), "path")]
        return [
            plural(len(self.frames), "frame"),
            plural(count, "posture"),
            *paths,
            f"unit={self.unit!r}",
        ]

    def _drawing(self) -> str:
        frame = next((one for one in self.frames if len(one.joints)), None)
        return "" if frame is None else posture_drawing(frame.joints[:8], np.array([0.0, -1.0, 0.0]))

    def __post_init__(self) -> None:
        for name in ("joint_names", "configuration_names", "frames"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.frames:
            raise _refused("frames", "no frame", "at least one")
        if self.joint_names != JOINTS:
            raise _refused("joint_names", ", ".join(self.joint_names)[:60], "the 14 joints in tree order")
        if self.paths is not None:
            self.paths.check_against([len(frame.joints) for frame in self.frames])
        first = self.frames[0]
        for index, frame in enumerate(self.frames):
            where = f"frames[{index}]"
            if frame.q.shape[1] != len(self.configuration_names):
                raise _refused(
                    f"{where}.q",
                    f"{frame.q.shape[1]} columns",
                    f"{len(self.configuration_names)}, as there are configuration_names",
                )
            if set(frame.margins) != set(first.margins):
                raise _refused(
                    f"{where}.margins",
                    ", ".join(frame.margins) or "none",
                    f"those of frames[0]: {', '.join(first.margins)}",
                )
            for name in EVERYWHERE_COLUMNS:
                if (getattr(frame, name) is None) != (getattr(first, name) is None):
                    raise _refused(f"{where}.{name}", f"{name} in some frames", "all frames or none with it")

    @cached_property
    def camera(self) -> OpenCVModel | None:
        """The calibrated camera that it was recovered with; None where it holds none.

        Raises
        ------
        InputError
            Where its settings hold what is no camera.
        """
        from posekit.formats.own.view_file import camera_of

        return camera_of(self.settings)

    @property
    def pictures(self) -> tuple[str, ...]:
        """The names of the pictures that its frames were detected in; none where it does not say."""
        names = self.settings.get("pictures")
        if not isinstance(names, Sequence) or isinstance(names, str) or len(names) != len(self.frames):
            return ()
        return tuple(str(name) for name in names)

    @property
    def written_decimals(self) -> int | None:
        """How many decimals of metres positions of frames whose noise is known are written with."""
        return min((one.precision.decimals for one in self.frames if one.precision), default=None)


def _array(name: str, values: Array, shape: tuple[int, ...]) -> Array:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise _refused(name, f"shape {array.shape}", f"shape {shape}")
    if np.isinf(array).any():
        raise _refused(name, "an infinite number", "finite numbers, or NaN where undecided")
    array.flags.writeable = False
    return array


def _with_unit_quaternions(q: Array) -> Array:
    """Give the base's quaternion of configurations (N, nq) its length back where few digits were written."""
    length = np.linalg.norm(q[:, BASE_QUATERNION], axis=1, keepdims=True)
    rounded = (np.abs(length - 1) > 1e-9) & (np.abs(length - 1) < ROUNDED_QUATERNION)
    if not rounded.any():
        return q
    mended = q.copy()
    mended[:, BASE_QUATERNION] = np.where(rounded, q[:, BASE_QUATERNION] / length, q[:, BASE_QUATERNION])
    mended.flags.writeable = False
    return mended


def _camera(given: Mapping[str, Any]) -> dict[str, Any]:
    """Normalise what is known of the camera: floats, read-only arrays and None."""
    unknown = set(given) - set(CAMERA_FIELDS)
    if unknown:
        raise _refused("camera", ", ".join(sorted(unknown)), f"fields among {', '.join(CAMERA_FIELDS)}")
    camera: dict[str, Any] = {}
    for name, shape in zip(CAMERA_FIELDS, ((), (3, 3), (3,), ()), strict=True):
        value = given.get(name)
        if value is not None:
            array = _array(f"camera.{name}", value, shape)
            known = not np.isnan(array).any()
            value = (array if shape else float(array)) if known else None
        camera[name] = value
    return camera


def _refused(field: str, got: str, expected: str) -> Exception:
    return refusal("result", field, got, expected, "correct what made the result")
