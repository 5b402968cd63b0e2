"""Checks of the limbs by anatomical ranges: some way to write the limb is inside all limits and couplings."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posekit.body import Figure
from posekit.body.frames import hips_frame, torso_frame
from posekit.compiled import screen_kinds as kernels
from posekit.compiled.compiling import compiled
from posekit.geometry import Array, rotate_back, unit
from posekit.skeleton import DOFS, JOINT, TORSO
from posekit.tree import Check, Findings, Loosening, Place, Rule
from posekit.validators.anatomical import Anatomy
from posekit.validators.anatomical_limb import judged_names, limb_walls

UNSEEN_DEGREES = 45.0
"""Degrees of tolerance from which on an axial rotation is not seen at all: it is undecided."""

TORSO_POINTS = tuple(JOINT[name] for name in TORSO)


@dataclass(frozen=True, kw_only=True, eq=False)
class AnatomicalLimb(Check):
    """Shoulder and elbow, or hip and knee; with two joints only what the upper segment's direction tells.

    All ways to write the limb are tried: both branches of the ball joint, both signs of the hinge. The limb is legal
    when in one of them every angle is within its limits, the narrowest of its own range and its couplings, up to the
    tolerance. That one is reported, else the one that is least outside. An arm's direction is judged by its elevation,
    how far it is raised in its plane, instead of by flexion and abduction, where the table bounds that. As in
    `posekit.validators.joint_range.Limb` the axial rotation of a limb that is almost straight has its tolerance
    divided by the sine of the bend, and is undecided beyond `UNSEEN_DEGREES`.

    Parameters
    ----------
    figure : Figure
        The person's figure: lengths, capsules, limits.
    anatomy : Anatomy
        The table of ranges and couplings.
    limb : tuple of str
        ``("right_shoulder", "right_elbow", "right_wrist")``, or the first two.
    tolerance : float
        Degrees by which the direction of a segment may be off.
    """

    figure: Figure
    anatomy: Anatomy
    limb: tuple[str, ...]
    tolerance: float
    name: str = "joint_range"
    unit: str = "deg"
    noise = Loosening.DIRECTIONS
    pulls = True

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The angles judged."""
        names = judged_names(self.anatomy, self._joint, 2 if len(self.limb) == 2 else 4)
        side = self.limb[0].split("_")[0]
        return Place.of_angles(*(f"{side}_{name}" for name in names))

    @cached_property
    def points(self) -> tuple[int, ...]:
        """The rigid part the limb hangs on, then the limb's joints."""
        return self._parent + tuple(JOINT[joint] for joint in self.limb)

    @property
    def _joint(self) -> str:
        return self.limb[0].split("_")[1]

    @property
    def _on_torso(self) -> bool:
        return self._joint == "shoulder"

    @property
    def _parent(self) -> tuple[int, ...]:
        return TORSO_POINTS if self._on_torso else self.figure.ik.hips_joints

    def judge(self, points: Array) -> Findings:
        """Judge the limb's angles; see `posekit.tree.Check`."""
        R_parent, limb = self._parts(points)
        end = limb[2] if len(limb) == 3 else None
        angles = np.degrees(self.figure.ik.limb(self.limb[0], R_parent, limb[0], limb[1], end))
        walls = limb_walls(
            self.anatomy,
            self._joint,
            angles if end is not None else angles[:, :2],
            self.tolerance,
            self._turn,
        )
        lower, upper = walls.limits(self.anatomy.spreads)
        value = walls.values
        tolerance = np.full((len(value), value.shape[2]), self.tolerance, dtype=np.float64)
        if end is not None:
            bend = np.abs(np.sin(np.radians(angles[:, 3])))
            least = max(np.radians(self.tolerance) / np.pi, np.finfo(np.float64).tiny)
            tolerance[:, 2] /= np.maximum(np.where(np.isnan(bend), 1.0, bend), least)
            value[tolerance[:, 2] > UNSEEN_DEGREES, :, 2] = np.nan
        beyond = np.maximum(lower - value, value - upper) - tolerance[:, None]
        worst = np.fmax.reduce(beyond, axis=2)
        best = np.argmin(np.where(np.isnan(worst), np.inf, worst), axis=1)[:, None, None]
        judged = list(walls.judged)
        value, lower, upper = (
            np.take_along_axis(each, best, axis=1)[:, 0, judged] for each in (value, lower, upper)
        )
        return Findings(value=value, lower=lower, upper=upper, tolerance=tolerance[:, judged])

    def judge_looped(self, points: Array) -> Findings:
        """Judge whole limbs by a loop, but for those that it is not sure of; see `posekit.tree.Check`."""
        if len(self.limb) == 2:
            return self.judge(points)
        from posekit.compiled import limb_kernels  # read by compiled loops alone

        R_parent, (start, middle, end) = self._parts(points)
        upper, lower = (rotate_back(R_parent, unit(b - a)) for a, b in ((start, middle), (middle, end)))
        value, low, high = np.empty((3, len(points), len(self.places)))
        loose, writing = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
        upper, lower = np.ascontiguousarray(upper), np.ascontiguousarray(lower)
        loop = compiled(limb_kernels).limbs_read
        loop(upper, lower, self._ends, self.rule.numbers, value, low, high, loose, writing)
        tolerance = np.full(value.shape, self.tolerance, dtype=np.float64)
        tolerance[:, judged_names(self.anatomy, self._joint, 4).index(f"{self._joint}.rotation")] = loose
        rows = np.flatnonzero(writing < 0)
        if rows.size:
            asked = self.judge(points[rows])
            value[rows], low[rows], high[rows] = asked.value, asked.lower, asked.upper
            tolerance[rows] = asked.tolerance
        return Findings(value=value, lower=low, upper=high, tolerance=tolerance)

    def _parts(self, points: Array) -> tuple[Array, Array]:
        """Return the frames of what the limb hangs on (N, 3, 3), and its joints (2 or 3, N, 3)."""
        rigid, limb = np.split(np.moveaxis(points, 1, 0), [len(self._parent)])
        return (torso_frame if self._on_torso else hips_frame)(*rigid), limb

    @cached_property
    def _ends(self) -> Array:
        """The figure's own limits of the four angles (4, 2), degrees: of ways to write a limb they choose the first."""
        first, limits = DOFS.index(f"{self.limb[0]}.flexion"), self.figure.ik.limits
        return np.degrees(np.stack([limits.lower, limits.upper], axis=-1)[first : first + 4])

    @cached_property
    def _turn(self) -> tuple[float, float]:
        """From where to where a pelvis may be flexed that is between the hips, degrees; zeros where hips show it."""
        if self._on_torso or not self.figure.ik.middle_pelvis:
            return 0.0, 0.0
        low, high = np.degrees(self.figure.ik.pelvis_turn).tolist()
        return low, high

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: what the limb hangs on, whether it is whole, ranges, couplings and tolerances."""
        from posekit.validators.anatomical_screen import limb_numbers  # read by compiled loops alone

        first = DOFS.index(f"{self.limb[0]}.flexion")
        numbers = limb_numbers(
            self.anatomy,
            self._joint,
            self.figure.ik.limits.sign[first : first + (2 if len(self.limb) == 2 else 4)],
            rigid=self.figure.ik.rigid_kind(self._parent),
            tolerance=self.tolerance,
            unseen=UNSEEN_DEGREES,
            turn=self._turn,
        )
        return Rule(kind=kernels.OF_ANATOMICAL_LIMB, numbers=numbers)
