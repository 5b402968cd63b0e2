"""Walls around a limb's angles, in every way to write the limb: limits for verdicts, spreads for plausibility.

A wall is one end of one angle: a mean, that may depend on other angles, and a spread over people. A limb can be written
in several ways (both branches of the ball joint, both signs of the hinge); walls are set up for each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from posekit.geometry import Array, other_branch, other_hinge, turned_near
from posekit.tables.angles import DERIVED_ANGLES, SIDEWAYS_ANGLES
from posekit.validators.anatomical import OUTWARD_SIGNS, Anatomy, Side
from posekit.validators.anatomical_shoulder import elevation_and_plane, turn_offset

BALL_ANGLES = ("flexion", "abduction", "rotation")
HINGE_OF_BALL: Mapping[str, str] = {"shoulder": "elbow", "hip": "knee"}
ROTATION_INDEX = BALL_ANGLES.index("rotation")
VALGUS_SIGNS: Mapping[str, int] = {"shoulder": -1, "hip": 1}
"""Whether a lower segment that stands off away from the body looks like an internal rotation of the ball joint."""

LIMIT_SIDES: tuple[Side, Side] = ("lower", "upper")
ELEVATION_ANGLE, PLANE_ANGLE, TURN_ANGLE = DERIVED_ANGLES

RIGHT_ANGLE = np.array(90.0)
"""The bend, degrees, at which ranges of axial rotation are measured."""

LEAST_LEFT = 0.1
"""The fraction of a range that a sinus leaves at the very end of another angle: below it spreads lose their meaning."""


def writings(angles: Array) -> Array:
    r"""Write limbs in all ways: from four angles (N, 4), or the first two (N, 2), to (N, W, 4) or (N, W, 2), degrees.

    :math:`(\alpha, \beta, \gamma) \to (\alpha + 180, 180 - \beta, \gamma + 180)` is the same rotation;
    :math:`(\gamma, \varepsilon) \to (\gamma + 180, -\varepsilon)` gives the lower segment the same direction.
    """
    turned = other_branch(angles, half_turn=180.0)
    if angles.shape[1] == 2:
        return np.stack([angles, turned], axis=1)
    bent, both = (other_hinge(each, half_turn=180.0) for each in (angles, turned))
    # An axial rotation that is turned twice is as it was.
    both[:, 2] = angles[:, 2]
    return np.stack([angles, bent, turned, both], axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Wall:
    """One end of one judged angle in all writings.

    Parameters
    ----------
    place : int
        Which angle.
    side : {"lower", "upper"}
        Which end of the range it is.
    mean : float or array broadcastable to (N, W)
        Degrees.
    spread : float or array, as `mean`
        One standard deviation over people, degrees.
    """

    place: int
    side: Side
    mean: Array | float
    spread: Array | float

    def limit(self, spreads: float) -> Array | float:
        """Return the mean moved outward by so many spreads."""
        return self.mean + OUTWARD_SIGNS[self.side] * spreads * self.spread


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbReadings:
    """A limb's angles in all writings, and the walls around them.

    Parameters
    ----------
    names : tuple of str (K,)
        The angles, ``"hip.flexion"``: of the ball joint three, or two, then the hinge's; of shoulders the elevation.
    values : array (N, W, K)
        Degrees.
    walls : tuple of Wall
        The ends of the angles that are judged.
    """

    names: tuple[str, ...]
    values: Array
    walls: tuple[Wall, ...]

    @property
    def judged(self) -> tuple[int, ...]:
        """The places that have a wall."""
        return tuple(sorted({wall.place for wall in self.walls}))

    def limits(self, spreads: float) -> tuple[Array, Array]:
        """Return lower and upper limits (N, W, K), the narrowest of the walls, moved outward by so many spreads."""
        lower, upper = np.full(self.values.shape, -np.inf), np.full(self.values.shape, np.inf)
        for wall in self.walls:
            column = (..., wall.place)
            bound = wall.limit(spreads)
            if wall.side == "lower":
                lower[column] = np.maximum(lower[column], bound)
            else:
                upper[column] = np.minimum(upper[column], bound)
        return lower, upper

    def excess(self) -> Array:
        """Return how many spreads each angle is beyond the mean of its ends, the worst of its walls (N, W, K); >= 0."""
        worst = np.zeros(self.values.shape)
        for wall in self.walls:
            column = (..., wall.place)
            beyond = OUTWARD_SIGNS[wall.side] * (self.values[column] - wall.mean) / wall.spread
            worst[column] = np.fmax(worst[column], beyond)
        return worst


def judged_names(anatomy: Anatomy, joint: str, count: int) -> tuple[str, ...]:
    """Name the angles of a limb that are judged where `count` of its four angles are known: 2 or 4.

    An arm's direction is judged by its elevation where the table bounds that, instead of by flexion and abduction.
    """
    names = (*(f"{joint}.{angle}" for angle in BALL_ANGLES), f"{HINGE_OF_BALL[joint]}.flexion")[:count]
    if not _by_elevation(anatomy, joint):
        return names
    return (*names[2:], ELEVATION_ANGLE)


def limb_walls(
    anatomy: Anatomy,
    joint: str,
    angles: Array,
    tolerance: float = 0.0,
    turn: tuple[float, float] = (0.0, 0.0),
) -> LimbReadings:
    """Set up the walls of a limb.

    Parameters
    ----------
    anatomy : Anatomy
        The table of ranges and couplings.
    joint : {"shoulder", "hip"}
        The ball joint of the limb.
    angles : array (N, 4) or (N, 2)
        In one of its writings, degrees: ball joint and hinge, or the first two of the ball joint.
    tolerance : float
        Degrees by which ends are moved outward where a sinus narrows another angle's.
    turn : tuple of 2 float
        From where to where a pelvis between the hips may be flexed, degrees, which its joints do not tell
        (`posekit.body.closed_form.freed`): it is flexed until the thigh is as near as can be to the middle of its
        range, where it has most room in all other angles.

    Returns
    -------
    LimbWalls
        Each angle turned to within half a turn of the middle of its range.
    """
    by_elevation = _by_elevation(anatomy, joint)
    written = writings(angles)
    turn_sides = {c.side for c in anatomy.couplings_of(TURN_ANGLE)}
    if by_elevation and (turn_sides == set(LIMIT_SIDES) or angles.shape[1] == 2):
        written = written[:, : written.shape[1] // 2]  # elevation and turn are the same in both branches
    names = [*(f"{joint}.{angle}" for angle in BALL_ANGLES), f"{HINGE_OF_BALL[joint]}.flexion"][
        : angles.shape[1]
    ]
    ends = {(name, side): anatomy.motions[name].end(side) for name in names for side in LIMIT_SIDES}
    columns = [
        turned_near(written[..., k], (ends[name, "lower"][0] + ends[name, "upper"][0]) / 2, half_turn=180.0)
        for k, name in enumerate(names)
    ]
    first = names[0]
    middle = (ends[first, "lower"][0] + ends[first, "upper"][0]) / 2
    columns[0] = columns[0] - np.clip(columns[0] - middle, *turn)
    readings = dict(zip(names, columns, strict=True))
    replaced = {(name, side) for name in names[:2] for side in LIMIT_SIDES} if by_elevation else set()
    if joint == "shoulder":
        elevation, plane = elevation_and_plane(angles[:, 0], angles[:, 1])
        readings[PLANE_ANGLE] = np.broadcast_to(plane[:, None], columns[0].shape)
        readings[ELEVATION_ANGLE] = np.broadcast_to(elevation[:, None], columns[0].shape)
        columns.append(readings[ELEVATION_ANGLE])
        names.append(ELEVATION_ANGLE)
        replaced |= {("shoulder.rotation", c.side) for c in anatomy.couplings_of(TURN_ANGLE)}
    walls = [
        Wall(place=names.index(name), side=side, mean=mean, spread=spread)
        for (name, side), (mean, spread) in ends.items()
        if (name, side) not in replaced
    ]
    for coupling in anatomy.couplings:
        if coupling.of in readings and coupling.angle in readings:
            mean, spread = anatomy.coupled(coupling, readings[coupling.of])
            walls.append(
                Wall(place=names.index(coupling.angle), side=coupling.side, mean=mean, spread=spread)
            )
    if "shoulder.rotation" in readings:
        walls += _turn_walls(anatomy, angles, readings)
    sinus = anatomy.sinus_of(joint)
    if sinus is not None:
        walls = _round_off(walls, columns, anatomy.spreads, sinus.power, tolerance)
    if angles.shape[1] > ROTATION_INDEX:
        walls = _off_plane(anatomy, joint, walls, readings)
    return LimbReadings(names=tuple(names), values=np.stack(columns, axis=-1), walls=tuple(walls))


def _round_off(
    walls: list[Wall], columns: list[Array], spreads: float, power: float, tolerance: float
) -> list[Wall]:
    """Draw the ends of each angle of the ball joint toward its middle, as far as the angles before it are from theirs.

    Abduction's by flexion, rotation's by both. All three conditions together are the sinus; two of them, which need
    no rotation, are judged before the limb's end is known. So flexion and abduction are measured against their own
    ranges (the first two walls of each), whatever else is known: the upper segment alone rejects nothing that the
    whole limb would pass. Middles lie between the means: more spreads or tolerance only widen.
    """
    used: Array = np.zeros(columns[0].shape)
    rounded = list(walls)
    for place in range(min(len(columns), len(BALL_ANGLES))):
        own = [k for k, wall in enumerate(walls) if wall.place == place]
        # Of rotation all walls count; it is not among what is judged early.
        below, above = (
            [walls[k] for k in own if walls[k].side == side][: None if place == ROTATION_INDEX else 1]
            for side in LIMIT_SIDES
        )
        lower = reduce(np.maximum, (wall.mean for wall in below))
        upper = reduce(np.minimum, (wall.mean for wall in above))
        middle = (lower + upper) / 2
        if place:
            left = np.maximum(1.0 - used, LEAST_LEFT**power) ** (1 / power)
            for k in own:
                mean = middle + (walls[k].mean - middle) * left
                rounded[k] = replace(walls[k], mean=mean, spread=walls[k].spread * left)
        if place < ROTATION_INDEX:
            off = columns[place] - middle
            half = np.where(off < 0, middle - below[0].limit(spreads), above[0].limit(spreads) - middle)
            used = used + (np.abs(off) / (half + tolerance)) ** power
    return rounded


def _off_plane(anatomy: Anatomy, joint: str, walls: list[Wall], readings: Mapping[str, Array]) -> list[Wall]:
    r"""Move the ends of the rotation outward by what a lower segment off its hinge's plane is taken for.

    The rotation is read from the lower segment's direction. Where that stands off the hinge's plane by v, the reading
    is off by :math:`\arcsin(\sin v / \sin\varepsilon)` at a bend of :math:`\varepsilon`, a right angle where the bend
    is less than v. To an arm, valgus looks like external rotation, to a leg, which bends backward, like internal; the
    other way round where the hinge is bent beyond straight. Ranges of rotation are measured at a right angle: what it
    is there is in them.
    """
    hinge = f"{HINGE_OF_BALL[joint]}.flexion"
    outward = {side: np.zeros(readings[hinge].shape) for side in LIMIT_SIDES}
    bend = np.sin(np.radians(readings[hinge]))
    for coupling in anatomy.couplings:
        if SIDEWAYS_ANGLES.get(coupling.angle) != hinge:
            continue
        sign = OUTWARD_SIGNS[coupling.side]
        off, squarely = (
            np.radians(np.maximum(sign * mean + anatomy.spreads * spread, 0.0))
            for mean, spread in (anatomy.coupled(coupling, at) for at in (readings[hinge], RIGHT_ANGLE))
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.degrees(np.arcsin(np.minimum(np.sin(off) / np.abs(bend), 1.0)) - squarely)
        taken_for = sign * VALGUS_SIGNS[joint] * np.where(bend < 0, -1, 1)
        for side in LIMIT_SIDES:
            outward[side] += np.where(
                taken_for == OUTWARD_SIGNS[side], np.where(off > 0, np.maximum(turn, 0.0), 0.0), 0.0
            )
    return [
        replace(wall, mean=wall.mean + OUTWARD_SIGNS[wall.side] * outward[wall.side])
        if wall.place == ROTATION_INDEX
        else wall
        for wall in walls
    ]


def _by_elevation(anatomy: Anatomy, joint: str) -> bool:
    return joint == "shoulder" and bool(anatomy.couplings_of(ELEVATION_ANGLE, "upper"))


def _turn_walls(anatomy: Anatomy, angles: Array, readings: Mapping[str, Array]) -> list[Wall]:
    """Bound the rotation by the turn: with flexion and abduction given, the two differ by an offset."""
    couplings = anatomy.couplings_of(TURN_ANGLE)
    bounds = [anatomy.coupled(coupling, readings[ELEVATION_ANGLE]) for coupling in couplings]
    rotation = readings["shoulder.rotation"]
    # The other branch has half a turn more of rotation, and half a turn less of offset: the turn is the same.
    branch = np.array([0.0, 0.0, 180.0, 180.0])[: rotation.shape[1]]
    offset = turn_offset(angles[:, 0], angles[:, 1])[:, None] + branch
    middle = sum((mean for mean, _ in bounds), start=np.zeros(rotation.shape)) / max(len(bounds), 1)
    shift = rotation - turned_near(rotation + offset, middle, half_turn=180.0)
    return [
        Wall(place=2, side=coupling.side, mean=mean + shift, spread=spread)
        for coupling, (mean, spread) in zip(couplings, bounds, strict=True)
    ]
