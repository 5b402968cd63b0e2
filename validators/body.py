"""`Body`: the data of one recording that checks read. Values that several checks need are cached."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, wraps
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np

from posekit.body import Figure, load_figure
from posekit.body.lengths import lengths_in_frames
from posekit.body.measured import Person, figure_of, person_of
from posekit.geometry import Array, Record
from posekit.motion.motion import Motion
from posekit.settings import EXACT, MEASURED, Tolerance, ValidateSettings
from posekit.skeleton import (
    FEET_POINTS,
    HEAD_POINTS,
    JOINT,
    JOINTS,
    LIMB_SEGMENTS,
    RIGID_SEGMENTS,
    SEGMENTS,
    segment_name,
)

if TYPE_CHECKING:
    from posekit.robots import Robot

Found = TypeVar("Found")

#: Tolerance for measurement noise, in standard deviations; 0.27 % of a normal distribution exceed it.
ALLOWED_DEVIATIONS: Final = 3.0

#: Allowed overlap between capsules that are scaled to a person, metres. Flesh is soft, and the radii are scaled from
#: the built-in figure instead of measured.
MADE_UP_METRES: Final = 0.01

#: Largest side bending of the spine, degrees (mean at 20 to 29 years: Fitzgerald et al. 1983, Phys Ther 63:1776).
SIDE_BENDING_DEGREES: Final = 38.2

#: Length of a clavicle, as a share of the distance from the body's midline to the shoulder.
CLAVICLE_SHARE: Final = 0.8

#: Largest rotation of a clavicle about its inner end, forward or upward with the shoulder, degrees (Inman, Saunders &
#: Abbott 1944, J Bone Joint Surg 26:1; Kapandji, The Physiology of the Joints, vol. 1).
CLAVICLE_DEGREES: Final = 30.0

#: Indices of the limb segments in `posekit.skeleton.SEGMENTS`.
LIMB_ROWS: Final = [SEGMENTS.index(one) for one in LIMB_SEGMENTS]

#: Distance from neck to nose, metres: a lever arm by which errors of the nose change the head's angle.
NECK_TO_HEAD_METRES = 0.2


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Body(Record):
    """Data of one body in T frames.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Joint positions, metres, in tree order; NaN where unknown.
    head : array (T, 5, 3)
        Positions of nose, eyes and ears, metres; NaN where unknown.
    feet : array (T, 4, 3)
        Positions of right toe, left toe, right heel and left heel, metres; NaN where unknown.
    time : array (T,)
        Times of the frames, seconds, in the order of the file; NaN where unknown.
    q : array (T, nq), optional
        Configurations to judge, in the robot's order.
    robot : Robot, optional
        The robot whose configurations are `q`; None if positions are judged.
    base : Figure, optional
        The figure that positions are compared with.
    up : array (3,), optional
        Unit vector against gravity.
    settings : ValidateSettings
        Checks, ranges and tolerances.
    tolerance : Tolerance, optional
        Allowed differences from `base` for postures of that figure. None for measured people: `figure` then has the
        measured segment lengths, and tolerances include the measurement noise.
    motion : bool
        Whether the frames are successive in time.
    residual : array (T, 14), optional
        Distance between the given joints and the joints of `q`, metres, if `q` was fitted to positions.
    """

    joints: Array
    head: Array = field(default_factory=lambda: np.empty(0))
    feet: Array = field(default_factory=lambda: np.empty(0))
    time: Array = field(default_factory=lambda: np.empty(0))
    q: Array | None = None
    robot: Robot | None = None
    base: Figure | None = None
    up: Array | None = None
    settings: ValidateSettings = field(default_factory=ValidateSettings)
    tolerance: Tolerance | None = None
    motion: bool = True
    residual: Array | None = None

    def __post_init__(self) -> None:
        count = len(self.joints)
        counted = {"head": (len(HEAD_POINTS), 3), "feet": (len(FEET_POINTS), 3), "time": ()}
        for name, shape in counted.items():
            if getattr(self, name).shape != (count, *shape):
                object.__setattr__(self, name, np.full((count, *shape), np.nan))

    @classmethod
    def of(
        cls,
        motion: Motion,
        settings: ValidateSettings,
        *,
        base: Figure | None = None,
        robot: Robot | None = None,
        tolerance: Tolerance | None = None,
        residual: Array | None = None,
        placed: bool = True,
    ) -> Body:
        """Return the `Body` of one recording: the data that its checks read.

        If the motion has configurations only, its joints are computed by forward kinematics of `robot`. If `placed` is
        False, these joints are NaN.
        """
        joints = motion.figure_joints
        if robot is not None and motion.joints is None and motion.q is not None:
            joints = np.full((len(motion), len(JOINTS), 3), np.nan)
            known = np.isfinite(motion.q).all(axis=1)
            if placed:
                joints[known] = robot.points(motion.q[known])
        return cls(
            joints=joints,
            head=motion.head,
            feet=motion.feet,
            time=np.asarray(motion.time),
            q=motion.q if robot is not None else None,
            robot=robot,
            base=base,
            # If every frame has its own origin, the frames have no common ground and no common direction up.
            up=motion.up_vector if motion.in_world else None,
            settings=settings,
            tolerance=tolerance,
            motion=motion.in_time,
            residual=residual,
        )

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.joints)

    def knows(self, name: str) -> bool:
        """Return whether some data are known, by their name in `posekit.validators.check.READABLE`."""
        if name == "time":
            return self.motion and self.dt > 0
        if name == "ground":
            return self.up is not None and math.isfinite(self.ground)
        found = getattr(self, name)
        return found is not None and (name in ("robot", "up", "q") or bool(np.isfinite(found).any()))

    @cached_property
    def rate(self) -> float:
        """Frames per second, from the median time step; NaN if times are unknown."""
        step = np.diff(self.time)
        step = step[step > 0]
        return float(np.round(1.0 / np.median(step), 6)) if len(step) else math.nan

    @property
    def dt(self) -> float:
        """Seconds from one frame to the next; NaN if times are unknown."""
        return 1.0 / self.rate

    @cached_property
    def height(self) -> Array:
        """Height of each joint along `up` (T, 14), metres; NaN if `up` is None."""
        up = np.full(3, np.nan) if self.up is None else self.up
        return np.asarray(self.joints @ up)

    @cached_property
    def ground(self) -> float:
        """Height of the ground along `up`, metres, as stated or else estimated from the frames; NaN if unknown."""
        if self.settings.ground is not None:
            return self.settings.ground
        if not self.motion or self.up is None or not np.isfinite(self.joints).any():
            return math.nan
        from posekit.validators.motion.ground import ground_of

        return ground_of(self).low

    @cached_property
    def person(self) -> Person:
        """Segment lengths and measurement noise of the person in the frames."""
        return person_of(self.joints, self.segment_lengths)

    @cached_property
    def segment_lengths(self) -> Array:
        """Length of each of `posekit.skeleton.SEGMENTS` in each frame (17, T), metres."""
        return lengths_in_frames(self.joints)

    @property
    def measured(self) -> bool:
        """Whether the frames show measured people instead of postures of the figure."""
        return self.tolerance is None and not self.settings.strict

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the noise of coordinates, metres; checks of motion widen their bounds by it."""
        if self.settings.noise is not None or self.settings.strict or self.q is not None:
            return self.settings.noise or 0.0
        return float(np.nan_to_num(self.person.noise))

    @cached_property
    def base_figure(self) -> Figure:
        """`base`, or the built-in figure."""
        return load_figure() if self.base is None else self.base

    @cached_property
    def figure(self) -> Figure:
        """The figure that positions are compared with: the base figure, scaled to measured people."""
        if not self.measured or not self.person.lengths:
            return self.base_figure
        return figure_of(self.base_figure, tuple(self.person.lengths.items()), self.person.behind)

    @property
    def lengths(self) -> Mapping[str, float]:
        """Lengths of the figure's segments, metres, by segment name."""
        return self.figure.lengths

    @cached_property
    def points(self) -> Array:
        """Joints and head points (T, 19, 3)."""
        return np.concatenate([self.joints, self.head], axis=1)

    def noise_allowed(self, segment: str = "") -> float:
        """Return the noise tolerance of a segment's length, metres; without `segment`, that of any distance."""
        noise = self.settings.noise
        if noise is None:
            noise = self.person.noise_of(segment) if self.measured else 0.0
        return ALLOWED_DEVIATIONS * math.sqrt(2) * noise

    @property
    def contact_margin(self) -> float:
        """Minimum allowed distance between capsules of the figure, metres; a negative minimum allows overlap."""
        made_up = MADE_UP_METRES if self.measured else 0.0
        return self.settings.contact_margin - made_up - self.noise_allowed()

    def rigid_tolerance(self, segment: tuple[int, int]) -> float:
        """Return the allowed difference between a segment's length and the figure's, metres."""
        given = self.settings.rigid_tolerance
        if self.tolerance is not None:
            hips = segment == (JOINT["right_hip"], JOINT["left_hip"]) and given is None
            return self.tolerance.rigid * (self.tolerance.hips if hips else 1.0)
        if given is not None or self.settings.strict:
            return MEASURED.rigid if given is None else given
        name = segment_name(segment)
        across, raised = girdle_gives(self.lengths)
        bone = math.hypot(MEASURED.rigid, self.noise_allowed("" if segment in RIGID_SEGMENTS else name))
        if "pelvis" in name and "shoulder" in name:
            return math.hypot(bone, spine_gives(self.lengths), raised)
        if name == "neck-pelvis":
            return math.hypot(bone, spine_gives(self.lengths))
        return math.hypot(bone, across) if "shoulder" in name and "elbow" not in name else bone

    def angle_tolerance(self, *segments: tuple[int, int]) -> float:
        """Return the largest tolerance of the directions of the given segments, degrees."""
        given = self.settings.angle_tolerance
        if self.tolerance is not None:
            return self.tolerance.angle
        if given is not None or self.settings.strict:
            return EXACT.angle if given is None else given
        reach = [(segment_name(one), self.lengths[segment_name(one)]) for one in segments if one in SEGMENTS]
        reach = reach or [("", NECK_TO_HEAD_METRES)]
        return max(
            math.hypot(MEASURED.angle, math.degrees(self.noise_allowed(name) / length))
            for name, length in reach
        )

    def allowed(self) -> dict[str, Any]:
        """Return the tolerances as named entries for the settings of a report."""
        if self.robot is not None:
            return {
                "judged": "configurations",
                "bodies": self.robot.bodies,
                "contact_margin": f"{100 * self.settings.contact_margin:.3g} cm",
            }
        angles = [self.angle_tolerance(one) for one in SEGMENTS if one not in RIGID_SEGMENTS]
        bones = [100 * self.rigid_tolerance(one) for one in SEGMENTS]
        return {
            "judged": "joint positions",
            "lengths": "measured" if self.measured else "figure",
            "noise": self.noise,
            "angle_tolerance": f"{min(angles):.2g} to {max(angles):.2g} deg",
            "rigid_tolerance": f"{min(bones):.2g} to {max(bones):.2g} cm",
            "contact_margin": f"{100 * self.contact_margin:.3g} cm",
        }


def spine_gives(lengths: Mapping[str, float]) -> float:
    r"""Return the largest decrease of the distance from shoulder to pelvis by side bending of the spine, metres.

    A spine of length h that is bent to a circular arc of angle :math:`\varphi` has a chord of length
    :math:`c = h \sin(\varphi/2) / (\varphi/2)`. The chord leans by :math:`\varphi/2` toward the shoulder. With the
    shoulder at distance w from the neck, the distance from shoulder to pelvis is
    :math:`\sqrt{c^2 + w^2 - 2 c w \sin(\varphi/2)}`.
    """
    half = math.radians(SIDE_BENDING_DEGREES) / 2
    h, w = lengths["neck-pelvis"], lengths["right_shoulder-left_shoulder"] / 2
    c = h * math.sin(half) / half
    return math.hypot(h, w) - math.sqrt(c * c + w * w - 2 * c * w * math.sin(half))


def hips_share(lengths: Mapping[str, float]) -> float:
    """Return the distance between the hips as a share of the thigh's length."""
    return lengths["right_hip-left_hip"] / lengths["right_hip-right_knee"]


def girdle_gives(lengths: Mapping[str, float]) -> tuple[float, float]:
    r"""Return how much rotating clavicles change the distances between shoulders, and from shoulder to pelvis, metres.

    A clavicle of length c rotates by up to :math:`\varphi` about its inner end, forward or upward. Forward rotation of
    both clavicles shortens the distance between the shoulders by :math:`2 c (1 - \cos\varphi)`. Upward rotation raises
    a shoulder by :math:`c \sin\varphi`.
    """
    clavicle = CLAVICLE_SHARE * lengths["right_shoulder-left_shoulder"] / 2
    turn = math.radians(CLAVICLE_DEGREES)
    return 2 * clavicle * (1 - math.cos(turn)), clavicle * math.sin(turn)


def once(find: Callable[[Body], Found]) -> Callable[[Body], Found]:
    """Cache the result of a function of a `Body` in this `Body`, so that several checks share the result."""

    @wraps(find)
    def found(body: Body) -> Found:
        kept: dict[Any, Found] = body.__dict__.setdefault("_once", {})
        if find not in kept:
            kept[find] = find(body)
        return kept[find]

    return found
