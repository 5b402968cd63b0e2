"""Rigid parts: torso and hips must keep their shape (Lee & Chen 1985, §3.2.B)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from posekit.body import Figure
from posekit.body.frames import torso_frame
from posekit.compiled import screen_kinds as kernels
from posekit.geometry import Array
from posekit.settings import RigidTolerance
from posekit.skeleton import JOINT, RIGID_SEGMENTS, SEGMENTS, TORSO, segment_name
from posekit.tree import Check, Findings, Place, Rule

Mode = Literal["distances", "placement"]


def rigid_parts(
    figure: Figure,
    *,
    tolerance: float | RigidTolerance,
    mode: Mode = "placement",
    limbs: bool = False,
) -> list[Check]:
    """Make the checks of the rigid parts.

    They judge the posture itself, as it was seen.

    Parameters
    ----------
    tolerance : float or RigidTolerance
        Metres by which a distance may be off: all the same, or each its own. Lifted segments, and points of the torso
        in the mode ``placement``, may be off by the widest.
    mode : {"distances", "placement"}
        ``distances`` compares the four distances inside torso and hips, as the paper does; they cannot tell
        a torso from its mirror image. ``placement`` also lays the figure's own torso onto the posture's,
        as the configuration q will, and compares the points.
    limbs : bool
        Judge the thirteen lifted segments too, which a tree's postures have right by construction and others need not.
    """
    allowed = tolerance if isinstance(tolerance, RigidTolerance) else RigidTolerance.uniform(tolerance)
    checks: list[Check] = [
        SegmentLength(
            places=(Place(segment=segment_name(segment)),),
            points=segment,
            length=figure.lengths[segment_name(segment)],
            tolerance=allowed.of(segment),
        )
        for segment in (SEGMENTS if limbs else RIGID_SEGMENTS)
    ]
    if mode == "placement":
        checks.append(
            TorsoPlacement(torso=figure.neutral_points[list(TORSO_POINTS)], tolerance=allowed.widest)
        )
    return checks


@dataclass(frozen=True, kw_only=True)
class SegmentLength(Check):
    """The distance between two joints of one rigid part."""

    places: tuple[Place, ...]
    points: tuple[int, ...]
    length: float
    tolerance: float
    name: str = "rigid_parts"
    unit: str = "m"
    rigid = True
    of_configuration = True

    def judge(self, points: Array) -> Findings:
        """Compare the distance with the figure's; see `posekit.tree.Check`."""
        value = np.linalg.norm(points[:, 0] - points[:, 1], axis=-1)[:, None]
        return Findings(
            value=value,
            lower=np.array([self.length - self.tolerance]),
            upper=np.array([self.length + self.tolerance]),
        )

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: the bounds."""
        bounds = np.array([self.length - self.tolerance, self.length + self.tolerance])
        return Rule(kind=kernels.OF_DISTANCE, numbers=bounds)


TORSO_POINTS = tuple(JOINT[name] for name in TORSO)


@dataclass(frozen=True, kw_only=True, eq=False)
class TorsoPlacement(Check):
    """The largest distance between the torso's joints and those of the figure's torso laid onto them."""

    torso: Array
    tolerance: float
    name: str = "rigid_parts"
    places: tuple[Place, ...] = (Place(name="torso"),)
    unit: str = "m"
    points: tuple[int, ...] = TORSO_POINTS
    rigid = True
    of_configuration = True

    def judge(self, points: Array) -> Findings:
        """Lay the figure's torso onto the posture's; see `posekit.tree.Check`."""
        R = torso_frame(*np.moveaxis(points, 1, 0))
        placed = points[:, :1] + np.einsum("nij,pj->npi", R, self.torso)
        value = np.linalg.norm(placed - points, axis=-1).max(axis=1)[:, None]
        return Findings(value=value, lower=np.array([-np.inf]), upper=np.array([self.tolerance]))

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: the tolerance, and the figure's torso."""
        numbers = np.concatenate([[self.tolerance], np.ravel(self.torso)])
        return Rule(kind=kernels.OF_PLACEMENT, numbers=numbers)
