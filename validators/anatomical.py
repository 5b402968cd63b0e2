"""Ranges of motion as studies give them: a mean and a spread for each end of each angle, and couplings of angles.

What a person can do ends somewhere, and people differ in where. An end is a mean over people with a standard deviation;
a limit is the mean moved outward by a stated number of spreads. A coupling is an end of one angle that depends on
another, piecewise linearly (hamstrings: hip flexion on knee flexion). A sinus takes the corners off a ball joint's
ranges: nobody reaches the ends of all three angles at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import DOFS

Side = Literal["lower", "upper"]

USUAL_PELVIS_METRES: Final = 0.1
"""How high the figure's pelvis joint is above the line between its hips."""

HIP_ABDUCTION: Final = "hip.abduction"

MOSTLY_HELD_DEGREES: Final = 10.0
"""One standard deviation of how people hold their pelvis under the trunk in the median frame of a recording: 8 degrees
between 16 recordings of one skeleton, which walks, runs, jumps and crouches."""

OUTWARD_SIGNS: Mapping[str, int] = {"lower": -1, "upper": 1}


@dataclass(frozen=True, kw_only=True)
class End:
    """One end of an angle, degrees.

    Parameters
    ----------
    mean, spread : float
        Over people; the spread is one standard deviation.
    source : tuple of str
        Keys into `Anatomy.sources`.
    """

    mean: float
    spread: float
    source: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class AngleRange:
    """The range of one angle, in the clinic's degrees, and where the clinic's zero is on the figure.

    Parameters
    ----------
    lower, upper : End
        In the clinic's degrees.
    zero : End
        The figure's angle where the clinic's is zero.
    pelvis : float
        Metres, one standard deviation, by which skeletons put the pelvis before or behind the point that `zero` is of.
    moved : float
        Degrees by which somebody's zero may lie from there: the end on that side is so much farther out.
    """

    lower: End
    upper: End
    zero: End = End(mean=0.0, spread=0.0)
    pelvis: float = 0.0
    moved: float = 0.0

    def end(self, side: Side) -> tuple[float, float]:
        """Return mean and spread of an end in the figure's degrees; the zero's own spread counts too."""
        end = self.lower if side == "lower" else self.upper
        outward = max(OUTWARD_SIGNS[side] * self.moved, 0.0) * OUTWARD_SIGNS[side]
        return end.mean + self.zero.mean + outward, math.hypot(end.spread, self.zero.spread)


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """An end of one angle as a function of another.

    Parameters
    ----------
    angle : str
        The angle that is bounded: one of `posekit.tables.angles.SIDELESS_ANGLES`, ``shoulder.elevation``,
        ``shoulder.turn``, ``elbow.valgus``, ``knee.valgus``.
    side : {"lower", "upper"}
        Which end of the range it is.
    of : str
        The angle on which the end depends.
    points : tuple of (float, float)
        Knots (`of`, mean end) in the clinic's degrees, in ascending order; constant beyond the outer ones.
    spread : float
        One standard deviation of the end over people.
    source : tuple of str
        Keys of the publications that it is from, as `Anatomy.sources` explains them.
    """

    angle: str
    side: Side
    of: str
    points: tuple[tuple[float, float], ...]
    spread: float
    source: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Sinus:
    r"""A ball joint's ranges rounded off: what is possible of one angle shrinks where the others near their ends.

    With :math:`u` how far an angle is from the middle of its range, as a fraction of half the range, a joint reaches
    :math:`|u_1|^p + |u_2|^p + |u_3|^p \le 1` instead of the whole box :math:`|u_i| \le 1`.

    Parameters
    ----------
    joint : {"hip"}
        The ball joint that is rounded off.
    power : float
        The p, from 1: 2 is an ellipsoid, infinity the box.
    source : tuple of str
        Keys of the publications that it is from, as `Anatomy.sources` explains them.
    """

    joint: str
    power: float
    source: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Anatomy:
    """Ranges of motion of all angles, their couplings, and how many spreads beyond the means is still possible.

    Parameters
    ----------
    motions : mapping
        Each of `posekit.tables.angles.ANGLES`.
    couplings : tuple of Coupling
        Ends of angles that depend on other angles.
    sinuses : tuple of Sinus
        At most one of a joint.
    spreads : float
        The k of mean + k spread.
    sources : mapping
        What each key of a source stands for.
    """

    motions: Mapping[str, AngleRange]
    couplings: tuple[Coupling, ...]
    spreads: float
    sources: Mapping[str, str]
    sinuses: tuple[Sinus, ...] = ()

    def limits(self) -> dict[str, tuple[float, float]]:
        """Return the limits (lower, upper), degrees, of the 22 angles of `posekit.skeleton.DOFS`, couplings aside."""
        return {dof: (self._limit(dof, "lower"), self._limit(dof, "upper")) for dof in DOFS}

    def on_pelvis(self, above_hips: float) -> Anatomy:
        """Return the ranges of a body whose pelvis is so many metres from the line between its hips.

        The line from pelvis to hips is what pelvis and hips are measured by. How much it leans depends on the point
        that a skeleton calls the pelvis, and the more so the nearer that is to the hips: where it is off by
        :attr:`AngleRange.pelvis` at distance h, by the arc tangent of their ratio, 45 degrees at the most.
        """
        motions = {
            angle: replace(one, pelvis=0.0, zero=replace(one.zero, spread=math.hypot(one.zero.spread, lean)))
            for angle, one in self.motions.items()
            if (lean := math.degrees(math.atan2(one.pelvis, max(above_hips, one.pelvis)))) > 0
        }
        return replace(self, motions={**self.motions, **motions}) if motions else self

    def with_hips(self, forward: float, outward: float = 0.0) -> Anatomy:
        """Return the ranges of somebody whose hips lie so many degrees before the trunk's line in the median frame.

        Thighs that begin `outward` of where hips are lean inward by as much when they stand straight: that end of
        abduction moves, too.

        Part of what that differs from the usual is where the skeleton has its pelvis joint, which moves the zeros of
        pelvis and hips, and part is how the person mostly held it: each as its deviation says
        (:attr:`AngleRange.pelvis` and `MOSTLY_HELD_DEGREES`). Which of the two it is nobody knows: an end that
        the moved zero takes outward moves, the other stays.
        """
        motions = dict(self.motions)
        for angle, one in self.motions.items():
            if one.pelvis > 0:
                own = math.hypot(one.zero.spread, math.degrees(math.atan(one.pelvis / USUAL_PELVIS_METRES)))
                share = own**2 / (own**2 + MOSTLY_HELD_DEGREES**2)
                moved = share * (forward - abs(one.zero.mean))
                motions[angle] = replace(one, moved=math.copysign(1.0, one.zero.mean) * moved)
        motions[HIP_ABDUCTION] = replace(motions[HIP_ABDUCTION], moved=-outward)
        return replace(self, motions=motions)

    def couplings_of(self, angle: str, side: Side | None = None) -> tuple[Coupling, ...]:
        """Return the couplings that bound an angle."""
        return tuple(c for c in self.couplings if c.angle == angle and side in (None, c.side))

    def sinus_of(self, joint: str) -> Sinus | None:
        """Return the sinus of a ball joint, if it has one."""
        return next((sinus for sinus in self.sinuses if sinus.joint == joint), None)

    def coupled(self, coupling: Coupling, of: Array) -> tuple[Array, float]:
        """Return mean (of `of`'s shape) and spread of a coupled end where the other angle is `of`, figure's degrees."""
        angle, other = self._zero(coupling.angle), self._zero(coupling.of)
        knots = np.array(coupling.points)
        mean = np.interp(of - other.mean, knots[:, 0], knots[:, 1]) + angle.mean
        return mean, math.hypot(coupling.spread, angle.spread)

    def motion(self, dof: str) -> AngleRange:
        """Return the motion of an angle, with or without its side."""
        return self.motions[dof.removeprefix("right_").removeprefix("left_")]

    def _limit(self, dof: str, side: Side) -> float:
        mean, spread = self.motion(dof).end(side)
        return mean + OUTWARD_SIGNS[side] * self.spreads * spread

    def _zero(self, angle: str) -> End:
        return self.motions[angle].zero if angle in self.motions else End(mean=0.0, spread=0.0)
