"""The angles of Lee & Chen 1985, §3.2.A: projections onto the planes of the torso's frame.

The torso's frame has y from neck to pelvis, z from right to left shoulder and x = y x z forward. Where the
print and the anatomy disagree (the knee's sign) or the print is silent (a projection without direction), what
holds is said at the angle.
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
from posekit.validators.ranges import Ranges

ROUNDING_DEGREES = 1e-3
"""Degrees within which -180 is taken for 180."""

HIP_SIGNS: Final = (1.0, -1.0, 1.0)
HEAD_SIGNS: Final = (-1.0, 1.0, -1.0)
"""What flexion, rotation and bending of a plane are times, to be the part's own."""

TORSO_POINTS = tuple(JOINT[name] for name in TORSO)


def projected_angles(figure: Figure, ranges: Ranges, *, tolerance: float) -> list[Check]:
    """Make the checks of Table 1; they judge the posture itself."""
    checks: list[Check] = [
        HeadPlane(figure=figure, ranges=ranges, tolerance=tolerance),
        HipPlane(ranges=ranges, tolerance=tolerance, middle_pelvis=figure.pelvis_between_hips),
    ]
    for side in SIDES:
        for limb in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")):
            checks += [
                ProjectedBall(ranges=ranges, tolerance=tolerance, side=side, limb=limb[:2]),
                ProjectedHinge(ranges=ranges, tolerance=tolerance, side=side, limb=limb),
            ]
    return checks


def _rule(kind: int, ranges: Ranges, tolerance: float, *more: object, wrap: float | None = None) -> Rule:
    """Write a screen as numbers: tolerance, shortest projection, where a turn is added, and what else there is."""
    turn = max(tolerance if wrap is None else wrap, ROUNDING_DEGREES) - 180
    return Rule(
        kind=kind,
        numbers=np.concatenate(
            [
                [tolerance, ranges.shortest_projection, turn],
                *(np.ravel(np.asarray(one, dtype=np.float64)) for one in more),
            ]
        ),
    )


def paper_axes(points: Array) -> Array:
    """Return the paper's torso axes x, y, z as rows (N, 3, 3), from neck, shoulders and pelvis (N, 4, 3)."""
    R = torso_frame(*np.moveaxis(points, 1, 0))
    return np.stack([R[..., 0], -R[..., 2], R[..., 1]], axis=-2)


def angle_in_plane(x: Array, y: Array, shortest: Array | float, tolerance: float = ROUNDING_DEGREES) -> Array:
    """Return the angle (deg) from the y axis towards x, NaN where the projection (x, y) is too short.

    In (-180, 180], and up to the tolerance (deg) beyond: an arm straight up is flexed by 180, on whichever side
    of it rounding or noise leaves the arm.
    """
    angle = np.degrees(np.arctan2(x, y))
    angle = np.where(angle < max(tolerance, ROUNDING_DEGREES) - 180, angle + 360, angle)
    return np.where(np.hypot(x, y) < shortest, np.nan, angle)


@dataclass(frozen=True, kw_only=True, eq=False)
class ProjectedBall(Check):
    """Shoulder or hip: flexion in the xy plane, abduction in the yz plane (§3.2.A i).

    Flexion is the angle from y to the projection of the limb's upper segment, towards x; abduction the one
    in the yz plane, away from the body. Either is undecided where its projection is shorter than
    `Ranges.shortest_projection` of the segment: an arm held straight forward has no abduction.
    """

    ranges: Ranges
    tolerance: float
    side: str
    limb: tuple[str, ...]
    name: str = "joint_range"
    unit: str = "deg"
    noise = Loosening.DIRECTIONS
    pulls = True

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """Flexion and abduction."""
        joint = f"{self.side}_{self.limb[0]}"
        return Place.of_angles(f"{joint}.flexion", f"{joint}.abduction")

    @property
    def points(self) -> tuple[int, ...]:
        """The torso, then the joint and the one beyond."""
        return TORSO_POINTS + tuple(JOINT[f"{self.side}_{joint}"] for joint in self.limb)

    def judge(self, points: Array) -> Findings:
        """Judge both angles; see `posekit.tree.Check`."""
        u = np.einsum("nij,nj->ni", paper_axes(points[:, :4]), points[:, 5] - points[:, 4])
        shortest = self.ranges.shortest_projection * np.linalg.norm(u, axis=1)
        outward = u[:, 2] if self.side == "left" else -u[:, 2]
        value = np.stack(
            [angle_in_plane(across, u[:, 1], shortest, self.tolerance) for across in (u[:, 0], outward)],
            axis=-1,
        )
        bounds = self._bounds
        return Findings(value=value, lower=bounds[:, 0], upper=bounds[:, 1], tolerance=self.tolerance)

    @property
    def _bounds(self) -> Array:
        return np.array([self.ranges.limits[f"{self.limb[0]}.{a}"] for a in ("flexion", "abduction")])

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: which way is outward, and the bounds."""
        outward = 1.0 if self.side == "left" else -1.0
        return _rule(kernels.OF_PROJECTED_BALL, self.ranges, self.tolerance, outward, self._bounds)


@dataclass(frozen=True, kw_only=True, eq=False)
class ProjectedHinge(Check):
    r"""Elbow or knee: the angle between the two segments, signed (§3.2.A ii); the hip's range goes with it.

    With u the upper and v the lower segment, elbow flexion has :math:`(v \times u)_z \ge 0`. The paper says
    the knee's is "similarly defined"; a shank bends backward, so its sign is the opposite. At the knee the
    hip's flexion is judged again: its range is the wide one only where the knee is flexed (Table 1, note a).
    """

    ranges: Ranges
    tolerance: float
    side: str
    limb: tuple[str, ...]
    name: str = "joint_range"
    unit: str = "deg"
    noise = Loosening.DIRECTIONS
    pulls = True

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The hinge's flexion; at the knee, the hip's too."""
        hinge = f"{self.side}_{self.limb[1]}.flexion"
        return Place.of_angles(
            *((hinge,) if self.limb[1] == "elbow" else (hinge, f"{self.side}_hip.flexion"))
        )

    @property
    def points(self) -> tuple[int, ...]:
        """The torso, then the limb's three joints."""
        return TORSO_POINTS + tuple(JOINT[f"{self.side}_{joint}"] for joint in self.limb)

    def judge(self, points: Array) -> Findings:
        """Judge the hinge; see `posekit.tree.Check`."""
        axes = paper_axes(points[:, :4])
        u = np.einsum("nij,nj->ni", axes, points[:, 5] - points[:, 4])
        v = np.einsum("nij,nj->ni", axes, points[:, 6] - points[:, 5])
        w = cross(v, u)
        size = np.linalg.norm(w, axis=1)
        psi = np.degrees(np.arctan2(size, np.einsum("ni,ni->n", u, v)))
        forward = w[:, 2] if self.limb[1] == "elbow" else -w[:, 2]
        # An arm held sideways bends its elbow about y: z is zero but for rounding, and zero is flexion.
        flexion = np.where(forward >= -np.radians(self.tolerance) * size, psi, -psi)
        lower, upper = self.ranges.limits[f"{self.limb[1]}.flexion"]
        if self.limb[1] == "elbow":
            return Findings(
                value=flexion[:, None],
                lower=np.array([lower]),
                upper=np.array([upper]),
                tolerance=self.tolerance,
            )
        shortest = self.ranges.shortest_projection * np.linalg.norm(u, axis=1)
        hip = angle_in_plane(u[:, 0], u[:, 1], shortest, self.tolerance)
        hip = np.where(np.isnan(flexion), np.nan, hip)  # without the knee its range is not known
        flexed = flexion > self.ranges.knee_flexed
        wide, narrow = (self.ranges.limits[f"hip.{a}"] for a in ("flexion", "flexion_with_straight_knee"))
        return Findings(
            value=np.stack([flexion, hip], axis=-1),
            lower=np.stack([np.full(len(hip), lower), np.where(flexed, wide[0], narrow[0])], axis=-1),
            upper=np.stack([np.full(len(hip), upper), np.where(flexed, wide[1], narrow[1])], axis=-1),
            tolerance=self.tolerance,
        )

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: which way it bends and the bounds; at the knee what the hip's depend on, and these."""
        limits = self.ranges.limits
        own = limits[f"{self.limb[1]}.flexion"]
        if self.limb[1] == "elbow":
            return _rule(kernels.OF_PROJECTED_HINGE, self.ranges, self.tolerance, 1.0, own)
        hip = (self.ranges.knee_flexed, *limits["hip.flexion"], *limits["hip.flexion_with_straight_knee"])
        return _rule(kernels.OF_PROJECTED_HINGE, self.ranges, self.tolerance, -1.0, own, hip)


def plane_angles(normal: Array, along: Array, ranges: Ranges) -> Array:
    """Return flexion, rotation and bending (N, 3), deg, of a plane against the torso's (§3.2.A iii).

    Flexion is measured from x to the normal's projection on xy, positive where the normal rises (towards
    -y); rotation to its projection on zx, positive towards z; bending from y to the projection of `along` on
    yz, positive towards z.
    """
    shortest = ranges.shortest_projection
    return np.stack(
        [
            angle_in_plane(-normal[:, 1], normal[:, 0], shortest),
            angle_in_plane(normal[:, 2], normal[:, 0], shortest),
            angle_in_plane(along[:, 2], along[:, 1], shortest * np.linalg.norm(along, axis=1)),
        ],
        axis=-1,
    )


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
        angles = plane_angles(normal, middle, self.ranges) * HIP_SIGNS
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
        angles = plane_angles(normal, -crown, self.ranges) * HEAD_SIGNS
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
