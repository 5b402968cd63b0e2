"""Joint ranges: some configuration inside the limits must give the posture.

Two kinds: the URDF's own angles (this file), or those of the paper's Table 1 (`table1_angles`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posekit.body import Figure
from posekit.body.closed_form import ClosedForm
from posekit.body.frames import hips_frame, torso_frame
from posekit.compiled import screen_kinds as kernels
from posekit.geometry import Array
from posekit.skeleton import DOFS, HEAD, HIPS, JOINT, SIDES, TORSO
from posekit.tree import Check, Findings, Loosening, Place, Rule
from posekit.validators.ranges import URDF_RANGES, Ranges

ANGLE_TOLERANCE = 1e-3
"""Degrees outside a limit that rounding may leave: a thousandth, some 5 um at a wrist."""

UNSEEN_DEGREES = 45.0
"""Degrees of tolerance from which on an axial rotation is not seen at all: it is undecided."""

TORSO_POINTS = tuple(JOINT[name] for name in TORSO)
HIPS_POINTS = tuple(JOINT[name] for name in HIPS)


def joint_range(
    figure: Figure,
    ranges: Ranges = URDF_RANGES,
    *,
    tolerance: float = ANGLE_TOLERANCE,
    directions: bool = False,
) -> list[Check]:
    """Make the checks of the joint ranges.

    With ranges of kind ``configuration`` they judge the configuration: torso and hips are the figure's own,
    laid onto the posture, and the limbs' directions are the posture's. Shoulder and hip are judged when
    elbow and knee are known, with the axial rotation free, and again, with it, when wrist and ankle are.
    With ``rotation`` and ``projected``, tables of the paper's angles, they judge the posture itself. Anatomical ranges
    are of kind ``configuration`` with couplings: the limbs are judged by `AnatomicalLimb`.

    Parameters
    ----------
    figure : Figure
        Its limits are the ranges where `ranges` gives none.
    ranges : Ranges
        The table of ranges; by default the URDF's own.
    tolerance : float
        Degrees by which the direction of a segment may be off; see `LimbRange` for what follows for axial rotations.
    directions : bool
        Whether the same follows for the first angles of shoulder and hip: see `LimbRange`.
    """
    if ranges.kind != "configuration":
        from posekit.validators.table1_angles import table1_angles

        return table1_angles(figure, ranges, tolerance=tolerance)
    ranges = ranges.of(figure)
    ik, anatomy = figure.ik, ranges.anatomy
    if anatomy is not None:
        from posekit.validators.anatomical_checks import AnatomicalLimb

        # The figure itself is left alone: to write a URDF and read it again takes as long as many frames.
        ik = limited(figure, ranges)
    elif ranges.limits:
        figure = figure.with_limits(
            {dof: (np.radians(a), np.radians(b)) for dof, (a, b) in ranges.limits.items()}
        )
        ik = figure.ik
    limits_alone = anatomy is None
    checks: list[Check] = [
        Neck(ik=ik, tolerance=tolerance, of_configuration=limits_alone),
        Pelvis(ik=ik, tolerance=tolerance, of_configuration=limits_alone),
    ]
    for side in SIDES:
        for limb in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")):
            joints = tuple(f"{side}_{joint}" for joint in limb)
            for part in (joints[:2], joints):
                if anatomy is None:
                    checks.append(
                        LimbRange(figure=figure, limb=part, tolerance=tolerance, directions=directions)
                    )
                else:
                    checks.append(
                        AnatomicalLimb(figure=figure, anatomy=anatomy, limb=part, tolerance=tolerance)
                    )
    return checks


def limited(figure: Figure, ranges: Ranges) -> ClosedForm:
    """Return the closed form of a figure within its own `ranges`; angles that these do not list keep its limits."""
    lower, upper = figure.limits.lower.copy(), figure.limits.upper.copy()
    for dof, ends in ranges.limits.items():
        lower[DOFS.index(dof)], upper[DOFS.index(dof)] = np.radians(ends)
    return figure.ik.with_limits(lower, upper)


def _rule(ik: ClosedForm, where: tuple[str, ...], kind: int, more: Sequence[float]) -> Rule:
    """Write a screen as numbers: signs and limits of some angles, radians, then tolerances and what else there is."""
    rows = [DOFS.index(dof) for dof in where]
    limits = ik.limits
    numbers = np.concatenate([limits.sign[rows], limits.lower[rows], limits.upper[rows], more])
    return Rule(kind=kind, numbers=numbers)


def _findings(ik: ClosedForm, where: tuple[str, ...], angles: Array, tolerance: float | Array) -> Findings:
    rows = [DOFS.index(dof) for dof in where]
    return Findings(
        value=np.degrees(angles),
        lower=np.degrees(ik.limits.lower[rows]),
        upper=np.degrees(ik.limits.upper[rows]),
        tolerance=tolerance,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Neck(Check):
    """Flexion, bending and rotation of the head on the torso; undecided where the head was not seen."""

    ik: ClosedForm
    tolerance: float
    name: str = "joint_range"
    places: tuple[Place, ...] = Place.of_angles("neck.flexion", "neck.bending", "neck.rotation")
    unit: str = "deg"
    points: tuple[int, ...] = TORSO_POINTS + HEAD
    of_configuration: bool = True
    noise = Loosening.DIRECTIONS

    def judge(self, points: Array) -> Findings:
        """Judge the neck's three angles; see `posekit.tree.Check`."""
        R_torso = torso_frame(*np.moveaxis(points[:, :4], 1, 0))
        angles = self.ik.neck(R_torso, points[:, 0], points[:, 4:])
        return _findings(self.ik, self.where, angles, self.tolerance)

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: limits, tolerance, and where the head's points are."""
        return _rule(
            self.ik,
            self.where,
            kernels.OF_NECK,
            [np.radians(self.tolerance), *np.ravel(self.ik.head_offsets)],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Pelvis(Check):
    """Flexion, bending and rotation of the hips under the torso."""

    ik: ClosedForm
    tolerance: float
    name: str = "joint_range"
    places: tuple[Place, ...] = Place.of_angles("pelvis.flexion", "pelvis.bending", "pelvis.rotation")
    unit: str = "deg"
    points: tuple[int, ...] = TORSO_POINTS + HIPS_POINTS[1:]
    of_configuration: bool = True
    noise = Loosening.DIRECTIONS

    def judge(self, points: Array) -> Findings:
        """Judge the pelvis's three angles; see `posekit.tree.Check`."""
        R_torso = torso_frame(*np.moveaxis(points[:, :4], 1, 0))
        neck = points[:, 0] if self.ik.middle_pelvis else None
        R_hips = hips_frame(points[:, 3], points[:, 4], points[:, 5], neck)
        angles = self.ik.pelvis(R_torso, R_hips)
        return _findings(self.ik, self.where, angles, self.tolerance)

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: limits, tolerance, and whether the neck turns the hips."""
        return _rule(
            self.ik, self.where, kernels.OF_PELVIS, [np.radians(self.tolerance), self.ik.middle_pelvis]
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbRange(Check):
    """Shoulder and elbow, or hip and knee; with two joints only the first two angles.

    A limb that is almost straight hardly shows its axial rotation: turning the lower segment's direction by
    the tolerance turns the rotation by the tolerance over the sine of the bend. That much the rotation may be
    off; beyond `UNSEEN_DEGREES` it is undecided.

    Parameters
    ----------
    limb : tuple of str
        ``("right_shoulder", "right_elbow", "right_wrist")``, or the first two.
    directions : bool
        Whether the first angle of an upper segment near the second one's pole is treated likewise, and both as
        refinement measures them (`posekit.refinement.limits`): what it leaves within the tolerance is then valid.
    """

    figure: Figure
    limb: tuple[str, ...]
    tolerance: float
    directions: bool = False
    name: str = "joint_range"
    unit: str = "deg"
    noise = Loosening.DIRECTIONS
    of_configuration = True

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The angles judged."""
        return Place.of_angles(*(self._angles[:2] if len(self.limb) == 2 else self._angles))

    @cached_property
    def _angles(self) -> tuple[str, ...]:
        """The four angles of the whole limb."""
        first = DOFS.index(f"{self.limb[0]}.flexion")
        return DOFS[first : first + 4]

    @property
    def _on_torso(self) -> bool:
        return self.limb[0].endswith("shoulder")

    @property
    def _parent(self) -> tuple[int, ...]:
        return TORSO_POINTS if self._on_torso else self.figure.ik.hips_joints

    @cached_property
    def points(self) -> tuple[int, ...]:
        """The rigid part the limb hangs on, then the limb's joints."""
        return self._parent + tuple(JOINT[joint] for joint in self.limb)

    def judge(self, points: Array) -> Findings:
        """Judge the limb's angles; see `posekit.tree.Check`."""
        rigid, limb = np.split(np.moveaxis(points, 1, 0), [len(self._parent)])
        R_parent = (torso_frame if self._on_torso else hips_frame)(*rigid)
        end = limb[2] if len(limb) == 3 else None
        angles = self.figure.ik.limb(self.limb[0], R_parent, limb[0], limb[1], end)
        angles = angles[:, : 2 if end is None else 4].copy()
        tolerance = np.full(angles.shape, self.tolerance, dtype=np.float64)
        if end is not None:
            bend = np.abs(np.sin(angles[:, 3]))
            least = max(np.radians(self.tolerance) / np.pi, np.finfo(np.float64).tiny)
            tolerance[:, 2] /= np.maximum(np.where(np.isnan(bend), 1.0, bend), least)
            angles[tolerance[:, 2] > UNSEEN_DEGREES, 2] = np.nan
        if self.directions:
            level = np.abs(np.cos(angles[:, 1]))
            tolerance[:, 0] = self._turn(np.where(np.isnan(level), 1.0, level))
            if end is not None:
                tolerance[:, 2] = self._turn(np.where(np.isnan(bend), 1.0, bend))
            angles[tolerance > UNSEEN_DEGREES] = np.nan
        return _findings(self.figure.ik, self._angles[: angles.shape[1]], angles, tolerance)

    def _turn(self, sine: Array) -> Array:
        """Return by how many degrees a direction may turn about an axis to which it has an angle of that sine (N,)."""
        share = np.radians(self.tolerance) / np.maximum(sine, np.finfo(np.float64).tiny)
        return np.asarray(np.degrees(np.tan(np.arcsin(np.minimum(share, 1.0)))))

    @property
    def rule(self) -> Rule | None:
        """The screen as numbers: what the limb hangs on, whether it is whole, limits and tolerances."""
        # With directions each angle has a tolerance of its own, which the screen does not know.
        return None if self.directions else self.passing

    @cached_property
    def passing(self) -> Rule:
        """The screen by the tolerance alone: with directions angles may be as far off, or farther."""
        sizes = self.figure.ik.rigid_kind(self._parent), len(self.limb) == 3
        more = [np.radians(self.tolerance), np.radians(UNSEEN_DEGREES), *sizes]
        return _rule(self.figure.ik, self._angles, kernels.OF_LIMB, more)
