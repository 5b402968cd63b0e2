"""Joint ranges: the angles of neck, pelvis and limbs are within their ranges.

`posekit.solver.Limits` computes the angles and ranges of limbs and pelvis for this check and for the solver. Several
sets of Euler angles describe the same orientation of a limb. The orientation is valid if all angles of one set are
within their ranges. Some ranges depend on other angles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import ClosedForm, Figure, load_figure
from posekit.body.angles import ball_branch, limb_branch
from posekit.body.frames import torso_frame, trunk_frames
from posekit.geometry import Array, cross, dot, unit
from posekit.geometry.rotations import relative_rotation
from posekit.skeleton import DOFS, HEAD_POINTS, HIPS, JOINT, JOINTS, TORSO
from posekit.solver import Limits, engine
from posekit.solver.limits import ENDS, KINDS, LIMBS, MIDDLES, PELVIS_SIGNS, STARTS, limb_directions
from posekit.tree.steps import LIMB, PELVIS, Step, step
from posekit.validators.body import Body, hips_share
from posekit.validators.check import Judgement
from posekit.validators.ranges import limits_of, load_ranges, of_person
from posekit.validators.table1 import table1_angles

#: Largest tolerance of an axial rotation that is judged, degrees; a rotation with a larger tolerance is undetermined.
UNSEEN_DEGREES: Final = 45.0

#: Minimum bend of an elbow or knee that determines the rotation of shoulder or hip of measured people, degrees. At a
#: bend of 15 degrees, a valgus of 4 degrees changes that rotation by 15 degrees.
STRAIGHT_DEGREES: Final = 15.0

#: Minimum bend at which a frame determines the axis of its hinge, degrees; above it carrying angles rotate that axis by
#: 35 degrees at most.
BENT_DEGREES: Final = 20.0

#: Minimum bend at which the axes of neighbouring frames decide the direction of a hinge, degrees.
LEAST_DEGREES: Final = 8.0

#: Cosine between a hinge's axis and its axis in neighbouring frames, below which the hinge bends backward.
OPPOSITE_COSINE: Final = -0.8

#: Longest time to a neighbouring frame, seconds. In less time people seldom rotate a straight arm by half a turn.
NEAR_SECONDS: Final = 1.0


PARTS: Final = ("neck", "pelvis", *LIMBS)


@dataclass(frozen=True, kw_only=True, eq=False)
class JointRange:
    """An angle of a joint is outside its range.

    The axial rotation of an almost straight limb is poorly determined. Its tolerance is the tolerance of segment
    directions, divided by the sine of the angle between upper and lower segment. In recordings of people, the axial
    rotation is undecided if elbow or knee bends by less than `STRAIGHT_DEGREES`.

    Parameters
    ----------
    part : str
        ``neck``, ``pelvis``, ``right_shoulder`` or another limb; all parts by default.
    upper_only : bool
        Judge the upper segment of the limb alone.
    """

    name = "joint-range"
    unit = "deg"
    reads = ("joints",)

    part: str = ""
    upper_only: bool = False

    @cached_property
    def points(self) -> tuple[str, ...]:
        """Names of the points that the check reads."""
        if self.part == "neck":
            return (*TORSO, *HEAD_POINTS)
        if self.part == "pelvis":
            return (*TORSO, *HIPS[1:])
        if not self.part:
            return (*JOINTS, *HEAD_POINTS)
        limb = LIMBS.index(self.part)
        ends = [STARTS[limb], MIDDLES[limb]] + [ENDS[limb]] * (not self.upper_only)
        rigid = TORSO if "shoulder" in self.part else (*TORSO, *HIPS[1:])
        return (*rigid, *(JOINTS[k] for k in ends if JOINTS[k] not in rigid))

    @cached_property
    def parts(self) -> list[JointRange]:
        """Return checks of the neck, the pelvis, each limb's upper segment, and each whole limb."""
        early = [JointRange(part=limb, upper_only=True) for limb in LIMBS]
        whole = [JointRange(part=part) for part in PARTS]
        return [*whole[:2], *early, *whole[2:]]

    def steps(self, body: Body) -> list[Step] | None:
        """Return the check for the C++ tree search; None if only Python has it, as for the neck and measured bodies."""
        if body.tolerance is None or self.part == "neck" or _of_table1(body):
            return None
        limits = _limits(body.figure, body.settings.ranges, math.nan)[0]
        given: dict[str, Any] = {
            "points": [JOINT[name] for name in self.points],
            "tolerance": body.angle_tolerance(),
            "limits": limits.numbers,
        }
        if self.part == "pelvis":
            return [step(PELVIS, DOFS[3:6], **given)]
        limb = LIMBS.index(self.part)
        return [step(LIMB, _places(limits, limb)[0], limb=limb, **given)]

    def judge(self, body: Body) -> Judgement:
        """Judge the angles of `part`, or of all parts."""
        parts = (self.part,) if self.part else PARTS
        if self.upper_only:
            joints = body.joints.copy()
            joints[:, ENDS[LIMBS.index(self.part)]] = np.nan
            body = replace(body, joints=joints)
        if table := _of_table1(body):
            return table1_angles(body, table, parts)
        forward = body.person.hips_forward if body.measured else math.nan
        limits, ik = _limits(body.figure, body.settings.ranges, forward)
        found = []
        for part in parts:
            if part == "neck":
                found.append(_neck(ik, body))
            elif part == "pelvis":
                found.append(_pelvis(limits, body))
            else:
                found.append(_limb(limits, body, LIMBS.index(part)))
        return Judgement.stacked(found)


def _of_table1(body: Body) -> Mapping[str, Any] | None:
    """Return the table of ranges in the settings if it limits the angles of Lee & Chen; otherwise None."""
    table = load_ranges(body.settings.ranges)
    return table if table is not None and table["kind"] in ("rotation", "projected") else None


def _limb(limits: Limits, body: Body, limb: int) -> Judgement:
    """Judge the angles of one limb.

    The judged set of Euler angles is the set in which elbow or knee bends forward. If it is outside its ranges, the set
    with the smallest excess over its ranges is judged instead. In motion of measured people, neighbouring frames decide
    whether elbow or knee bends backward.
    """
    joints, (places, keep) = body.joints, _places(limits, limb)
    tolerance = body.angle_tolerance((STARTS[limb], MIDDLES[limb]), (MIDDLES[limb], ENDS[limb]))
    straight = STRAIGHT_DEGREES if body.measured else 0.0
    in_time = body.motion and body.tolerance is None and body.dt > 0
    if engine.compiled and not in_time:
        found = engine.compiled.stated(limits.numbers, limb, joints, tolerance, straight)
        return Judgement(places, *found[..., keep])
    parent = trunk_frames(joints, bool(limits.numbers["between_hips"]))[limb // 2]
    upper_segment, lower_segment = limb_directions(joints, limb)
    rotations = limb_branch(parent, upper_segment, lower_segment)
    least = max(math.radians(tolerance) / math.pi, np.finfo(np.float64).tiny)

    def read(rows: NDArray[np.intp] | slice, writing: NDArray[np.intp] | None) -> tuple[Array, Array, Array]:
        """Return value, lower, upper and tolerance of the four angles in W sets of Euler angles (4, n, W, 4), degrees.

        Also return the largest excess of the angles of each set twice (n, W): without undetermined axial rotations, and
        with them.
        """
        *angles, sine = limits.read(limb, rotations[rows], math.radians(tolerance), writing)
        value, lower, upper = np.degrees(np.stack(angles))
        allowed = np.full(value.shape, tolerance)
        allowed[..., 2] /= np.maximum(np.where(np.isnan(sine), 1.0, sine), least)[:, None]
        away = np.maximum(lower - value, value - upper) - allowed
        strict = np.fmax.reduce(away, axis=2)
        unseen = (allowed[..., 2] > UNSEEN_DEGREES) | (sine < math.sin(math.radians(straight)))[:, None]
        value[unseen, 2] = away[unseen, 2] = np.nan
        return np.stack([value, lower, upper, allowed]), np.fmax.reduce(away, axis=2), strict

    # The closed form bends hinges about +y; elbows flex the other way.
    numbers, worst, strict = read(slice(None), np.full(len(joints), int(limb < 2)))
    found, backward = numbers[:, :, 0], np.zeros(len(joints), dtype=np.bool_)
    if in_time:
        backward = bent_backward(upper_segment, lower_segment, strict[:, 0] <= 0, body.dt)
    rows = np.flatnonzero((worst[:, 0] > 0) | backward)
    if len(rows):
        numbers, worst, _ = read(rows, None)
        worst = np.where(backward[rows][:, None] & (numbers[0, ..., 3] >= 0), np.inf, worst)
        best = np.argmin(np.where(np.isnan(worst), np.inf, worst), axis=1)
        found[:, rows] = numbers[:, np.arange(len(rows)), best]
    found[0, backward, 2] = np.nan  # report the hinge only, not the ball joint above it
    return Judgement(places, *found[..., keep])


def bent_backward(upper: Array, lower: Array, legal: NDArray[np.bool_], dt: float) -> NDArray[np.bool_]:
    """Return whether an elbow or a knee bends backward in each frame (T,), by comparison with neighbouring frames.

    In one frame, a limb that bends backward looks like a limb that is rotated by half a turn about its upper segment.
    Motion distinguishes these two postures: from frame to frame, a limb rotates about its axis by a few degrees, not by
    half a turn.

    Parameters
    ----------
    upper, lower : array (T, 3)
        Unit directions of the upper and the lower segment in successive frames.
    legal : bool array (T,)
        Whether the limb is within its ranges if elbow or knee bends forward.
    dt : float
        Seconds from a frame to the next.
    """
    found = np.zeros(len(upper), dtype=np.bool_)
    normal = cross(upper, lower)
    bend = np.degrees(np.arctan2(np.sqrt(dot(normal, normal)), dot(upper, lower)))
    shows = np.flatnonzero(legal & (bend >= BENT_DEGREES))
    asked = np.flatnonzero((bend >= LEAST_DEGREES) & (~legal | (bend < BENT_DEGREES)))
    if not len(shows) or not len(asked):
        return found
    axis = unit(normal)
    after = np.searchsorted(shows, asked)
    opposite = np.zeros(len(asked), dtype=np.bool_)
    agree = np.ones(len(asked), dtype=np.bool_)
    for neighbour in (after - 1, after):
        inside = (neighbour >= 0) & (neighbour < len(shows))
        other = shows[np.clip(neighbour, 0, len(shows) - 1)]
        near = inside & (np.abs(other - asked) * dt <= NEAR_SECONDS)
        # Rotate the axis by the shortest rotation between the upper segments of the two frames.
        a, b = upper[other], upper[asked]
        carried = axis[other] - (dot(axis[other], b) / np.maximum(1.0 + dot(a, b), 0.1))[:, None] * (a + b)
        turned = dot(carried, axis[asked]) < OPPOSITE_COSINE
        opposite |= near & turned
        agree &= ~near | turned
    found[asked[opposite & agree]] = True
    return found


def _places(limits: Limits, limb: int) -> tuple[list[str], list[int]]:
    """Return the names of the judged angles of a limb, and their indices among its four angles."""
    side = LIMBS[limb].split("_")[0]
    places = [f"{side}_{angle}" for angle in KINDS[limb // 2]]
    if limb < 2 and limits.numbers["by_elevation"]:
        return [f"{side}_shoulder.elevation", *places[2:]], [0, 2, 3]
    return places, [0, 1, 2, 3]


def _pelvis(limits: Limits, body: Body) -> Judgement:
    joints, numbers = body.joints, limits.numbers
    frames = trunk_frames(joints, bool(numbers["between_hips"]))
    value = np.degrees(ball_branch(relative_rotation(*frames)) * PELVIS_SIGNS)
    lower, upper = np.degrees(numbers["pelvis"]).T
    reads = ((JOINT["neck"], JOINT["pelvis"]), (JOINT["pelvis"], JOINT["right_hip"]))
    return Judgement(DOFS[3:6], value, lower, upper, body.angle_tolerance(*reads))


def _neck(ik: ClosedForm, body: Body) -> Judgement:
    """Judge flexion, bending and rotation of the head relative to the torso; undecided without head points."""
    R_torso = torso_frame(*(body.joints[:, JOINT[name]] for name in TORSO))
    value = np.degrees(ik.neck(R_torso, body.joints[:, 0], body.head))
    lower, upper = (np.degrees(one[:3]) for one in (ik.limits.lower, ik.limits.upper))
    return Judgement(DOFS[:3], value, lower, upper, body.angle_tolerance())


@lru_cache(maxsize=32)
def _limits(figure: Figure, name: str, forward: float) -> tuple[Limits, ClosedForm]:
    """Return limits of pelvis and limbs from a table of ranges, and inverse kinematics with its limits of the neck.

    `forward` is the median angle, in degrees, by which a measured person's hips lie in front of the line from neck to
    pelvis.
    """
    table = load_ranges(name)
    if table is None or table["kind"] != "anatomical":
        return limits_of(figure, None), figure.ik
    if math.isfinite(forward):
        table = of_person(table, forward, _hips_outward(figure))
    neck = [table["neck"][dof.partition(".")[2]] for dof in DOFS[:3]]
    signs = (("lower", -table["spreads"]), ("upper", table["spreads"]))
    ends = np.array([[one[end]["mean"] + out * one[end]["spread"] for end, out in signs] for one in neck])
    lower, upper = figure.limits.lower.copy(), figure.limits.upper.copy()
    lower[:3], upper[:3] = np.radians(ends).T
    return limits_of(figure, table), figure.ik.with_limits(lower, upper)


def _hips_outward(figure: Figure) -> float:
    """Return how far straight thighs lean inward, degrees, because hips are wider apart than the built-in figure's."""
    return math.degrees(math.atan((hips_share(figure.lengths) - hips_share(load_figure().lengths)) / 2))
