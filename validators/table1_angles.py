"""Checks of Table 1 of Lee & Chen 1985, and of one's own tables of the same angles.

The angles are those of `posekit.validators.rotation_angles`, or the print's projections (kind ``projected``;
`posekit.validators.projected_angles`), in the torso's frame: y from neck to pelvis, z from right to left shoulder and
x = y x z forward.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.body.frames import hips_frame, torso_frame
from posekit.compiled import screen_kinds as kernels
from posekit.geometry import Array, cross, unit
from posekit.skeleton import HEAD, JOINT, SIDES, TORSO
from posekit.tree import Check, Findings, Loosening, Place, Rule
from posekit.validators import rotation_angles as turned
from posekit.validators.projected_angles import (
    ROUNDING_DEGREES,
    projected_ball,
    projected_hinge,
    projected_plane,
)
from posekit.validators.ranges import Ranges

HIP_SIGNS: Final = (1.0, -1.0, 1.0)
HEAD_SIGNS: Final = (-1.0, 1.0, -1.0)
"""What flexion, rotation and bending of a plane are times, to be the part's own."""

TORSO_POINTS = tuple(JOINT[name] for name in TORSO)


def table1_angles(figure: Figure, ranges: Ranges, *, tolerance: float) -> list[Check]:
    """Make the checks of Table 1; they judge the posture itself."""
    checks: list[Check] = [
        HeadPlane(figure=figure, ranges=ranges, tolerance=tolerance),
        HipPlane(ranges=ranges, tolerance=tolerance, middle_pelvis=figure.pelvis_between_hips),
    ]
    for side in SIDES:
        for limb in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")):
            checks += [
                LimbBall(ranges=ranges, tolerance=tolerance, side=side, limb=limb[:2]),
                LimbHinge(ranges=ranges, tolerance=tolerance, side=side, limb=limb),
            ]
    return checks


def _rule(kind: int, ranges: Ranges, tolerance: float, *more: object, wrap: float | None = None) -> Rule:
    """Write a screen as numbers: tolerance, shortest projection, where a turn is added, and what else there is.

    Of angles that are no projections the second is below zero.
    """
    turn = max(tolerance if wrap is None else wrap, ROUNDING_DEGREES) - 180
    shortest = ranges.shortest_projection if ranges.kind == "projected" else -1.0
    return Rule(
        kind=kind,
        numbers=np.concatenate(
            [
                [tolerance, shortest, turn],
                *(np.ravel(np.asarray(one, dtype=np.float64)) for one in more),
            ]
        ),
    )


def paper_axes(points: Array) -> Array:
    """Return the paper's torso axes x, y, z as rows (N, 3, 3), from neck, shoulders and pelvis (N, 4, 3)."""
    R = torso_frame(*np.moveaxis(points, 1, 0))
    return np.stack([R[..., 0], -R[..., 2], R[..., 1]], axis=-2)


@dataclass(frozen=True, kw_only=True, eq=False)
class Table1Limb(Check):
    """What is judged of a limb: some of its joints from the torso on, by their names without the side."""

    ranges: Ranges
    tolerance: float
    side: str
    limb: tuple[str, ...]
    name: str = "joint_range"
    unit: str = "deg"
    noise = Loosening.DIRECTIONS
    pulls = True

    @cached_property
    def points(self) -> tuple[int, ...]:
        """The torso, then the limb's joints."""
        return TORSO_POINTS + tuple(JOINT[f"{self.side}_{joint}"] for joint in self.limb)

    @property
    def scaled(self) -> bool:
        """Whether its tolerance grows where the angles turn faster than the limb."""
        return self.ranges.kind == "rotation"


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbBall(Table1Limb):
    """Shoulder or hip: flexion and abduction of the limb's upper segment (§3.2.A i)."""

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """Flexion and abduction."""
        joint = f"{self.side}_{self.limb[0]}"
        return Place.of_angles(f"{joint}.flexion", f"{joint}.abduction")

    def judge(self, points: Array) -> Findings:
        """Judge both angles; see `posekit.tree.Check`."""
        u = np.einsum("nij,nj->ni", paper_axes(points[:, :4]), points[:, 5] - points[:, 4])
        value, gain = _ball_angles(u, self.limb[0], self.side, self.ranges, self.tolerance)
        bounds = self._bounds
        return Findings(value=value, lower=bounds[:, 0], upper=bounds[:, 1], tolerance=self.tolerance * gain)

    @property
    def _bounds(self) -> Array:
        return np.array([self.ranges.limits[f"{self.limb[0]}.{a}"] for a in ("flexion", "abduction")])

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: which way is outward, the bounds, and whether it is an arm."""
        outward = 1.0 if self.side == "left" else -1.0
        more = outward, self._bounds, self.limb[0] == "shoulder"
        kind = kernels.OF_TURNED_BALL if self.scaled else kernels.OF_PROJECTED_BALL
        return _rule(kind, self.ranges, self.tolerance, *more)


def _ball_angles(
    u: Array, joint: str, side: str, ranges: Ranges, tolerance: float
) -> tuple[Array, Array | float]:
    """Return flexion and abduction (N, 2), deg, of upper segments (N, 3), and what their tolerance is times."""
    outward = 1.0 if side == "left" else -1.0
    if ranges.kind == "projected":
        return projected_ball(u, outward, ranges.shortest_projection, tolerance), 1.0
    if joint == "shoulder":
        return turned.shoulder_angles(unit(u), outward)
    return turned.hip_angles(unit(u), outward, sum(ranges.limits["hip.flexion"]) / 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbHinge(Table1Limb):
    """Elbow or knee: the flexion between the two segments (§3.2.A ii); the hip's range goes with it.

    At the knee the hip's flexion is judged again: its range is the wide one only where the knee is flexed (Table 1,
    note a). The bound moves from one to the other as the knee flexes by `Ranges.knee_flexed`; of printed angles it
    jumps there.
    """

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The hinge's flexion; at the knee, the hip's too."""
        hinge = f"{self.side}_{self.limb[1]}.flexion"
        return Place.of_angles(
            *((hinge,) if self.limb[1] == "elbow" else (hinge, f"{self.side}_hip.flexion"))
        )

    def judge(self, points: Array) -> Findings:
        """Judge the hinge; see `posekit.tree.Check`."""
        axes = paper_axes(points[:, :4])
        u = np.einsum("nij,nj->ni", axes, points[:, 5] - points[:, 4])
        v = np.einsum("nij,nj->ni", axes, points[:, 6] - points[:, 5])
        flexion, gain = self._flexion(u, v)
        lower, upper = self.ranges.limits[f"{self.limb[1]}.flexion"]
        if self.limb[1] == "elbow":
            return Findings(
                value=flexion[:, None],
                lower=np.array([lower]),
                upper=np.array([upper]),
                tolerance=self.tolerance * gain[:, None],
            )
        ball, ball_gain = _ball_angles(u, "hip", self.side, self.ranges, self.tolerance)
        hip = np.where(np.isnan(flexion), np.nan, ball[:, 0])  # without the knee its range is not known
        gains = np.stack([gain, np.broadcast_to(ball_gain, ball.shape)[:, 0]], axis=-1)
        share = self._flexed(flexion)
        wide, narrow = (self.ranges.limits[f"hip.{a}"] for a in ("flexion", "flexion_with_straight_knee"))
        ends = [(1 - share) * straight + share * bent for straight, bent in zip(narrow, wide, strict=True)]
        return Findings(
            value=np.stack([flexion, hip], axis=-1),
            lower=np.stack([np.full(len(hip), lower), ends[0]], axis=-1),
            upper=np.stack([np.full(len(hip), upper), ends[1]], axis=-1),
            tolerance=self.tolerance * gains,
        )

    def _flexion(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return the hinge's flexion (N,), deg, and what its tolerance is times."""
        if self.ranges.kind == "projected":
            flexion = projected_hinge(u, v, self._forward, self.tolerance)
            return flexion, np.ones(len(flexion))
        return (turned.elbow_flexion if self.limb[1] == "elbow" else turned.knee_flexion)(unit(u), unit(v))

    def _flexed(self, flexion: Array) -> Array:
        """Return how far the hip's range is the wide one (N,): 0 where the knee is straight, 1 where it is flexed."""
        if self.ranges.kind == "projected":
            return np.where(flexion > self.ranges.knee_flexed, 1.0, 0.0)
        return np.clip(flexion / max(self.ranges.knee_flexed, ROUNDING_DEGREES), 0.0, 1.0)

    @property
    def _forward(self) -> float:
        return 1.0 if self.limb[1] == "elbow" else -1.0

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: which way it bends and the bounds; at the knee what the hip's depend on, and these."""
        limits = self.ranges.limits
        more: tuple[object, ...] = (self._forward, limits[f"{self.limb[1]}.flexion"])
        if self.limb[1] == "knee":
            hip = limits["hip.flexion"], limits["hip.flexion_with_straight_knee"]
            more = (*more, self.ranges.knee_flexed, *hip)
        kind = kernels.OF_TURNED_HINGE if self.scaled else kernels.OF_PROJECTED_HINGE
        return _rule(kind, self.ranges, self.tolerance, *more)


def _plane_angles(normal: Array, along: Array, ranges: Ranges) -> Array:
    """Return flexion, rotation and bending (N, 3), deg, of a plane against the torso's (§3.2.A iii)."""
    if ranges.kind == "rotation":
        return turned.plane_angles(normal, along)
    return projected_plane(normal, along, ranges.shortest_projection)


@dataclass(frozen=True, kw_only=True, eq=False)
class HipPlane(Check):
    """Pelvis: the hips' plane against the torso's (§3.2.A iii).

    Signs are the URDF's: what is above the pelvis bends and turns to the left. A pelvis between the hips makes no plane
    with them: the spine stands for it (`posekit.body.frames.hips_frame`).
    """

    ranges: Ranges
    tolerance: float
    middle_pelvis: bool = False
    name: str = "joint_range"
    places: tuple[Place, ...] = Place.of_angles("pelvis.flexion", "pelvis.rotation", "pelvis.bending")
    unit: str = "deg"
    points: tuple[int, ...] = (*TORSO_POINTS, JOINT["right_hip"], JOINT["left_hip"])
    noise = Loosening.DIRECTIONS
    pulls = True

    def judge(self, points: Array) -> Findings:
        """Judge the pelvis; see `posekit.tree.Check`."""
        axes = paper_axes(points[:, :4])
        pelvis, right, left = points[:, 3], points[:, 4], points[:, 5]
        below = (right + left) / 2 - pelvis
        if self.middle_pelvis:
            below = -hips_frame(pelvis, right, left, points[:, 0])[..., 2]
        middle = np.einsum("nij,nj->ni", axes, below)
        normal = unit(cross(middle, np.einsum("nij,nj->ni", axes, left - right)))
        angles = _plane_angles(normal, middle, self.ranges) * HIP_SIGNS
        return _plane_findings("pelvis", angles, self.ranges, self.tolerance)

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: signs and bounds, and whether the neck turns the hips."""
        bounds = _plane_bounds("pelvis", self.ranges)
        more = HIP_SIGNS, bounds, self.middle_pelvis
        return _rule(kernels.OF_HIP_PLANE, self.ranges, self.tolerance, *more, wrap=ROUNDING_DEGREES)


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadPlane(Check):
    """Neck: the head's plane against the torso's (§3.2.A iv); undecided where the head was not seen.

    The head plane's normal is the facing direction; flexion lowers the chin; the head bends and turns to the left.
    """

    figure: Figure
    ranges: Ranges
    tolerance: float
    name: str = "joint_range"
    places: tuple[Place, ...] = Place.of_angles("neck.flexion", "neck.rotation", "neck.bending")
    unit: str = "deg"
    points: tuple[int, ...] = TORSO_POINTS + HEAD
    noise = Loosening.DIRECTIONS
    pulls = True

    def judge(self, points: Array) -> Findings:
        """Judge the neck; see `posekit.tree.Check`."""
        axes = paper_axes(points[:, :4])
        R_head = self.figure.ik.head_frame(points[:, 0], points[:, 4:])
        normal, crown = (np.einsum("nij,nj->ni", axes, R_head[:, :, k]) for k in (0, 2))
        angles = _plane_angles(normal, -crown, self.ranges) * HEAD_SIGNS
        return _plane_findings("neck", angles, self.ranges, self.tolerance)

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: signs and bounds, and where the head's points are."""
        more = HEAD_SIGNS, _plane_bounds("neck", self.ranges), self.figure.ik.head_offsets
        return _rule(kernels.OF_HEAD_PLANE, self.ranges, self.tolerance, *more, wrap=ROUNDING_DEGREES)


def _plane_findings(joint: str, angles: Array, ranges: Ranges, tolerance: float) -> Findings:
    bounds = _plane_bounds(joint, ranges)
    return Findings(value=angles, lower=bounds[:, 0], upper=bounds[:, 1], tolerance=tolerance)


def _plane_bounds(joint: str, ranges: Ranges) -> Array:
    return np.array([ranges.limits[f"{joint}.{angle}"] for angle in ("flexion", "rotation", "bending")])
