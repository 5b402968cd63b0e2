"""Joint ranges: the angles of neck, pelvis and limbs, in any of the ways in which they can be written.

Limbs and pelvis are read by `posekit.solver.Limits`, the same numbers that the solver keeps to. A limb is legal if
every angle of one way to write it is within its range and couplings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import ClosedForm, Figure, load_figure
from posekit.body.frames import torso_frame
from posekit.geometry import Array, perpendicular, unit
from posekit.skeleton import DOFS, HEAD_POINTS, HIPS, JOINT, JOINTS, TORSO
from posekit.solver import Limits, engine
from posekit.solver.limits import (
    ENDS,
    KINDS,
    LIMBS,
    MIDDLES,
    PELVIS_SIGNS,
    STARTS,
    hips_frame,
    limb_angles,
    limb_directions,
    pelvis_angles,
)
from posekit.solver.limits import torso_frame as torso_rows
from posekit.tree.steps import LIMB, PELVIS, Step, step
from posekit.validators.body import Body
from posekit.validators.check import Judgement
from posekit.validators.hinges import bent_backward
from posekit.validators.ranges import load_ranges, of_person
from posekit.validators.table1 import table1_angles

#: Tolerance from which an axial rotation is not determined, degrees.
UNSEEN_DEGREES: Final = 45.0

#: Bend of an elbow or knee below which measured bodies do not determine the rotation of shoulder or hip, degrees: 4
#: degrees of valgus turn it by 15 there.
STRAIGHT_DEGREES: Final = 15.0

#: Tolerance of angles that are exact, degrees: 5 µm at a wrist.
ROUNDING_DEGREES: Final = 1e-3

PARTS: Final = ("neck", "pelvis", *LIMBS)


@dataclass(frozen=True, kw_only=True, eq=False)
class JointRange:
    """An angle of a joint is outside its range.

    The rotation of an almost straight limb is hardly determined. Its tolerance is that of directions divided by the
    sine of the bend; below `straight_degrees` it is undecided for measured bodies.

    Parameters
    ----------
    part : str
        ``neck``, ``pelvis``, ``right_shoulder`` and so on; all of them by default.
    upper_only : bool
        Judge the upper segment of the limb alone.
    straight_degrees : float
        Bend below which the rotation of a measured limb is undecided.
    """

    name = "joint-range"
    unit = "deg"
    reads = ("joints",)

    part: str = ""
    upper_only: bool = False
    straight_degrees: float = STRAIGHT_DEGREES

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the points that are read."""
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
        """Return a check for neck, pelvis, and each limb without and with its lower segment."""
        early = [JointRange(part=limb, upper_only=True) for limb in LIMBS]
        whole = [JointRange(part=part) for part in PARTS]
        return [*whole[:2], *early, *whole[2:]]

    def steps(self, body: Body) -> list[Step] | None:
        """Return the check of the figure's own postures as steps of the compiled tree; the neck has none."""
        table = load_ranges(body.settings.ranges)
        printed = table is not None and table["kind"] in ("rotation", "projected")
        if body.tolerance is None or printed or self.part == "neck":
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
        """Measure the angles of the parts."""
        table = load_ranges(body.settings.ranges)
        parts = (self.part,) if self.part else PARTS
        if table is not None and table["kind"] in ("rotation", "projected"):
            return table1_angles(body, table, parts, upper_only=self.upper_only)
        measured = body.tolerance is None and not body.settings.strict
        forward = body.person.hips_forward if measured else math.nan
        limits, ik = _limits(body.figure, body.settings.ranges, forward)
        found = [_neck(ik, body) if part == "neck" else self._part(limits, part, body) for part in parts]
        return _stacked(found)

    def _part(self, limits: Limits, part: str, body: Body) -> Judgement:
        joints = body.joints
        if part == "pelvis":
            return _pelvis(limits, body)
        limb = LIMBS.index(part)
        if self.upper_only:
            joints = joints.copy()
            joints[:, ENDS[limb]] = np.nan
        segments = ((STARTS[limb], MIDDLES[limb]), (MIDDLES[limb], ENDS[limb]))
        tolerance = body.angle_tolerance(*segments)
        straight = self.straight_degrees if body.tolerance is None and not body.settings.strict else 0.0
        over_time = body.dt if body.motion and body.tolerance is None and not self.upper_only else math.nan
        return _limb_range(limits, joints, limb, tolerance, straight, over_time)


def _limb_range(
    limits: Limits, joints: Array, limb: int, tolerance: float, straight: float, dt: float
) -> Judgement:
    """Judge one limb (N, 14, 3): in the usual way of writing, else in the one that is least outside.

    Over time, neighbouring frames tell which way a hinge bends.
    """
    if engine.compiled and not dt > 0:
        places, keep = _places(limits, limb)
        found = engine.compiled.stated(limits.numbers, limb, joints, tolerance, straight)
        return Judgement(places, *found[..., keep])
    parent = torso_rows(joints) if limb < 2 else hips_frame(joints, bool(limits.numbers["between_hips"]))
    upper_segment, lower_segment = limb_directions(joints, limb)
    rotations = limb_angles(parent, upper_segment, lower_segment)

    def read(rows: NDArray[np.intp] | slice, writing: NDArray[np.intp] | None) -> tuple[Array, Array]:
        """Return value, lower, upper and tolerance (4, n, W, 4), degrees, and how far the worst is outside (n, W)."""
        *found, sine = limits.read(limb, rotations[rows], math.radians(tolerance), writing)
        numbers = np.empty((4, *found[0].shape))
        np.degrees(np.stack(found), out=numbers[:3])
        least = max(math.radians(tolerance) / math.pi, np.finfo(np.float64).tiny)
        numbers[3] = tolerance
        numbers[3, ..., 2] /= np.maximum(np.where(np.isnan(sine), 1.0, sine), least)[:, None]
        away = np.maximum(numbers[1] - numbers[0], numbers[0] - numbers[2]) - numbers[3]
        open_rotation = (numbers[3, ..., 2] > UNSEEN_DEGREES) | (sine < math.sin(math.radians(straight)))[
            :, None
        ]
        turned = np.where(open_rotation, np.nan, away[..., 2])
        strict = np.fmax.reduce(away, axis=2)
        away[..., 2] = turned
        numbers[0, ..., 2] = np.where(open_rotation, np.nan, numbers[0, ..., 2])
        return numbers, np.stack([np.fmax.reduce(away, axis=2), strict])

    # The closed form bends hinges about +y; elbows flex the other way.
    usual = np.full(len(joints), int(limb < 2))
    numbers, (worst, strict) = read(slice(None), usual)
    found, outside = numbers[:, :, 0], worst[:, 0]
    backward = np.full(len(joints), np.nan)
    if dt > 0:
        backward = bent_backward(upper_segment, lower_segment, strict[:, 0] <= 0, dt)
    rows = np.flatnonzero((outside > 0) | (backward < 0))
    if len(rows):
        numbers, (worst, _) = read(rows, None)
        worst = np.where((backward[rows] < 0)[:, None] & (numbers[0, ..., 3] >= 0), np.inf, worst)
        best = np.argmin(np.where(np.isnan(worst), np.inf, worst), axis=1)
        found[:, rows] = numbers[:, np.arange(len(rows)), best]
    found[0, backward < 0, 2] = np.nan  # the hinge is named, not the ball joint above it
    places, keep = _places(limits, limb)
    return Judgement(places, *found[..., keep])


def _places(limits: Limits, limb: int) -> tuple[list[str], list[int]]:
    """Return the names of a limb's judged angles, and which of the four they are."""
    side = LIMBS[limb].split("_")[0]
    places = [f"{side}_{angle}" for angle in KINDS[limb // 2]]
    if limb < 2 and limits.numbers["by_elevation"]:
        return [f"{side}_shoulder.elevation", *places[2:]], [0, 2, 3]
    return places, [0, 1, 2, 3]


def _pelvis(limits: Limits, body: Body) -> Judgement:
    joints, numbers = body.joints, limits.numbers
    hips = hips_frame(joints, bool(numbers["between_hips"]))
    value = np.degrees(pelvis_angles(torso_rows(joints), hips) * PELVIS_SIGNS)
    lower, upper = np.degrees(numbers["pelvis"]).T
    reads = ((JOINT["neck"], JOINT["pelvis"]), (JOINT["pelvis"], JOINT["right_hip"]))
    return Judgement(DOFS[3:6], value, lower, upper, body.angle_tolerance(*reads))


def _neck(ik: ClosedForm, body: Body) -> Judgement:
    """Judge flexion, bending and rotation of the head on the torso; undecided where the head was not seen."""
    value = np.full((len(body), 3), np.nan)
    seen = np.isfinite(body.head).all(axis=(1, 2))
    if seen.any():
        joints = body.joints[seen]
        R_torso = torso_frame(*(joints[:, JOINT[name]] for name in TORSO))
        value[seen] = np.degrees(ik.neck(R_torso, joints[:, 0], body.head[seen]))
    lower, upper = (np.degrees(one[:3]) for one in (ik.limits.lower, ik.limits.upper))
    return Judgement(DOFS[:3], value, lower, upper, body.angle_tolerance())


def _stacked(found: Sequence[Judgement]) -> Judgement:
    """Put the places of several judgements of the same frames side by side."""
    columns: dict[str, list[Array]] = {"value": [], "lower": [], "upper": [], "tolerance": []}
    for one in found:
        for name, arrays in columns.items():
            arrays.append(np.broadcast_to(np.asarray(getattr(one, name), dtype=np.float64), one.value.shape))
    stacked = {name: np.concatenate(arrays, axis=1) for name, arrays in columns.items()}
    return Judgement([place for one in found for place in one.places], **stacked)


@lru_cache(maxsize=32)
def _limits(figure: Figure, name: str, forward: float) -> tuple[Limits, ClosedForm]:
    """Return the ranges of a figure as numbers, and its closed form with the same limits of the neck.

    The hips of a measured person lie `forward` degrees before the trunk's line.
    """
    table, anatomical = load_ranges(name) or {}, False
    own = np.degrees(np.stack([figure.limits.lower, figure.limits.upper], axis=1))
    ends = own[:3].copy()
    if table.get("kind") == "configuration":
        joints = {joint: one for joint, one in table.items() if isinstance(one, dict)}
        angles = {
            f"{joint}.{angle}": limits for joint, one in joints.items() for angle, limits in one.items()
        }
        table = {"kind": "configuration", "joints": angles}
        ends = np.array([angles.get(dof, own[k]) for k, dof in enumerate(DOFS[:3])])
    elif table.get("kind") == "anatomical":
        anatomical = True
        table = of_person(table, forward, _hips_outward(figure)) if math.isfinite(forward) else table
        signs = (("lower", -table["spreads"]), ("upper", table["spreads"]))
        neck = [table["neck"][dof.partition(".")[2]] for dof in DOFS[:3]]
        ends = np.array([[one[end]["mean"] + out * one[end]["spread"] for end, out in signs] for one in neck])
    pelvis, right, left = (figure.neutral_points[JOINT[joint]] for joint in HIPS)
    limits = Limits.of(
        table if anatomical or "joints" in table else None,
        own,
        above_hips=float(np.linalg.norm(perpendicular(right - pelvis, unit(left - right)))),
        pelvis_between_hips=figure.pelvis_between_hips,
    )
    lower, upper = figure.limits.lower.copy(), figure.limits.upper.copy()
    lower[:3], upper[:3] = np.radians(ends).T
    return limits, figure.ik.with_limits(lower, upper)


def _hips_outward(figure: Figure) -> float:
    """Return by how many degrees straight thighs lean inward because hips are wider apart than usual."""
    hips, thigh, usual = "right_hip-left_hip", "right_hip-right_knee", load_figure().lengths
    lengths = figure.lengths
    return math.degrees(math.atan((lengths[hips] / lengths[thigh] - usual[hips] / usual[thigh]) / 2))
