"""Rigid parts: torso and hips must keep their shape (Lee & Chen 1985, §3.2.B)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from posekit.body import Figure
from posekit.body.frames import torso_frame
from posekit.compiled import screen_kinds as kernels
from posekit.geometry import Array
from posekit.settings import RigidTolerance
from posekit.skeleton import JOINT, RIGID_SEGMENTS, SEGMENTS, TORSO, segment_name
from posekit.tree import Check, Findings, Place, Rule

Mode = Literal["distances", "side", "placement"]


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
        Metres by which a distance may be off: all the same, or each its own. Points of the torso may be off by the
        widest, the side of its shoulders by theirs.
    mode : {"distances", "side", "placement"}
        ``distances`` compares the four distances inside torso and hips, as the paper does; they cannot tell
        a torso from its mirror image. ``side`` also asks on which side of the line from neck to pelvis the shoulders
        lie, where the figure knows it: that is all that the distances leave open. ``placement`` lays the figure's own
        torso onto the posture's, as the configuration q will, and compares the points.
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
    if mode == "side":
        offset = figure.shoulder_offset if figure.shoulder_side != "undecided" else math.nan
        checks.append(TorsoSide(offset=offset, tolerance=allowed.shoulders))
    elif mode == "placement":
        checks.append(
            TorsoPlacement(
                torso=figure.neutral_points[list(TORSO_POINTS)],
                tolerance=allowed.widest,
                side_known=figure.side_known,
            )
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
class TorsoSide(Check):
    """How far the shoulders lie on the figure's side of the line from neck to pelvis.

    They may lie on the other side by as much as the tolerance is more than the figure's own offset. A torso whose
    mirror image is within the tolerance has no side that can be told, and neither has one of a figure that does not
    know its own: that is undecided.

    Parameters
    ----------
    offset : float
        How far the figure's shoulders lie in front of that line, metres, negative behind it; NaN where it is not known.
    tolerance : float
        Metres by which a point of the torso may be off.
    """

    offset: float
    tolerance: float
    name: str = "rigid_parts"
    places: tuple[Place, ...] = (Place(name="torso"),)
    unit: str = "m"
    points: tuple[int, ...] = TORSO_POINTS
    rigid = True
    of_configuration = True

    @property
    def _can_be_told(self) -> bool:
        return 2 * abs(self.offset) > self.tolerance  # False of NaN

    @property
    def _sign(self) -> float:
        return -1.0 if self.offset < 0 else 1.0

    @property
    def _least(self) -> float:
        return min(abs(self.offset) - self.tolerance, 0.0)

    def judge(self, points: Array) -> Findings:
        """Measure the shoulders' offset; see `posekit.tree.Check`."""
        R = torso_frame(*np.moveaxis(points, 1, 0))
        value = np.full((len(points), 1), np.nan)
        if self._can_be_told:
            value[:, 0] = self._sign * np.einsum("ni,ni->n", R[:, :, 0], points[:, 1] - points[:, 0])
        return Findings(value=value, lower=np.array([self._least]), upper=np.array([np.inf]))

    @cached_property
    def rule(self) -> Rule:
        """The screen as numbers: the side, and the least that the offset may be."""
        least = self._least if self._can_be_told else -np.inf
        return Rule(kind=kernels.OF_SIDE, numbers=np.array([self._sign, least]))


@dataclass(frozen=True, kw_only=True, eq=False)
class TorsoPlacement(Check):
    """The largest distance between the torso's joints and those of the figure's torso laid onto them.

    Where the figure does not know on which side its shoulders lie, a torso that only the mirror image fits is
    undecided.
    """

    torso: Array
    tolerance: float
    side_known: bool = True
    name: str = "rigid_parts"
    places: tuple[Place, ...] = (Place(name="torso"),)
    unit: str = "m"
    points: tuple[int, ...] = TORSO_POINTS
    rigid = True
    of_configuration = True

    def judge(self, points: Array) -> Findings:
        """Lay the figure's torso onto the posture's; see `posekit.tree.Check`."""
        R = torso_frame(*np.moveaxis(points, 1, 0))
        value = self._apart(R, self.torso, points)
        if not self.side_known:
            mirrored = self._apart(R, self.torso * MIRROR_SIGNS, points) <= self.tolerance
            value = np.where(mirrored & (value > self.tolerance), np.nan, value)
        return Findings(value=value, lower=np.array([-np.inf]), upper=np.array([self.tolerance]))

    @staticmethod
    def _apart(R: Array, torso: Array, points: Array) -> Array:
        """Return the largest distance (N, 1) between points (N, 4, 3) and a torso turned by R (N, 3, 3)."""
        placed = points[:, :1] + np.einsum("nij,pj->npi", R, torso)
        return np.asarray(np.linalg.norm(placed - points, axis=-1).max(axis=1)[:, None])

    @cached_property
    def rule(self) -> Rule | None:
        """The screen as numbers: the tolerance, and the figure's torso; none where the side may be undecided."""
        if not self.side_known:
            return None
        numbers = np.concatenate([[self.tolerance], np.ravel(self.torso)])
        return Rule(kind=kernels.OF_PLACEMENT, numbers=numbers)


MIRROR_SIGNS: Final = np.array([-1.0, 1.0, 1.0])
"""What the torso's coordinates are times in its mirror image: front is back."""
