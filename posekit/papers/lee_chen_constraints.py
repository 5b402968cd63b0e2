"""Comparison with Lee & Chen 1985: joint ranges (Table 1), joint angles (§3.2.A), collisions, rules (§3.3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
import pinocchio as pin

from posekit.body import load_figure
from posekit.cameras.head import TABLE_A2
from posekit.geometry import Array, turned_near, unit
from posekit.papers.rows import Row, printed, row
from posekit.settings import EXACT, Tolerance, ValidateSettings
from posekit.skeleton import DOFS, JOINT, JOINTS, SIDES
from posekit.synthesis import random_postures
from posekit.validators.body import Body
from posekit.validators.check import Check
from posekit.validators.collision import Collision
from posekit.validators.joint_range import JointRange
from posekit.validators.walking import WalkingRules

#: Distance from a bound of Table 1, inside and outside, at which a posture is judged.
PROBE_DEGREES: Final = 0.3

#: Flexion of the knee for hip flexion beyond 90 degrees, degrees (Table 1, footnote a).
FLEXED_KNEE: Final = 60.0

HIP_FLEXIONS: Final = (80.0, 100.0, 119.0)

N_COLLISIONS, N_FORMULAS = 300, 200

#: Largest accepted difference from the written-out formulas; the rounding error of arc cosines near 0 and 180 degrees
#: is a tenth of it.
FORMULA_DEGREES: Final = 1e-5

#: Rules of §3.3: angles (degrees) of a posture that a rule forbids, and changes of the angles that make it allowed.
RULES: Final[dict[int, tuple[dict[str, float], dict[str, float]]]] = {
    1: ({"right_shoulder.flexion": 30, "left_shoulder.flexion": 30}, {"left_shoulder.flexion": -30}),
    2: ({"right_shoulder.flexion": 30, "right_hip.flexion": 30}, {"right_hip.flexion": -30}),
    # At a rotation of -20 degrees, the right hip is in front and the left hip behind.
    3: (
        {"pelvis.rotation": -20, "right_hip.flexion": -30, "left_hip.flexion": 30},
        {"right_hip.flexion": 30, "left_hip.flexion": -30},
    ),
    4: ({"right_shoulder.abduction": 40}, {"right_shoulder.abduction": 0, "right_shoulder.flexion": 40}),
    5: ({"right_knee.flexion": 60, "left_knee.flexion": 60}, {"left_knee.flexion": 0}),
}

FORMULAS: Final = (
    ("(i): shoulder and hip", "angles of the projections on xy and yz", ("shoulder", "hip")),
    ("(ii): elbow and knee", "the angle from v to u, with the sign of (v x u) z", ("elbow", "knee")),
    ("(iii): pelvis", "angles of the normal of the hip plane, and of its middle", ("pelvis",)),
    ("(iv): neck", "in the same manner, of the head plane", ("neck",)),
)


def constraint_rows() -> Iterator[Row]:
    """Yield a `Row` for each comparison: physical constraints and walking rules."""
    yield from _formula_rows()
    yield from _table_1_rows()
    yield from _knee_and_collision_rows()
    yield from _rule_rows()


def posed(angles: Mapping[str, float]) -> Array:
    """Return the points (1, 19, 3) of a standing posture in which the given URDF angles (degrees) are changed.

    If `angles` has only angles of the pelvis, the legs stay vertical, because Table 1 measures leg angles from the
    torso.
    """
    figure = load_figure()
    q = pin.neutral(figure.model)[None].copy()
    for dof, degrees in angles.items():
        q[0, figure.angle_index[DOFS.index(dof)]] = np.radians(degrees)
    points = figure.forward_kinematics(q)
    if angles and all(dof.startswith("pelvis") for dof in angles):
        for side in SIDES:
            legs = [JOINT[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle")]
            hanging = figure.neutral_points[legs]
            points[:, legs] = points[:, legs[0], None] + hanging - hanging[0]
    return points


def body_of(points: Array, tolerance: Tolerance = EXACT, **settings: Any) -> Body:
    """Return postures (N, 19, 3) of the built-in figure as a `Body`, which is the input of checks."""
    return Body(
        joints=points[:, : len(JOINTS)],
        head=points[:, len(JOINTS) :],
        base=load_figure(),
        settings=ValidateSettings(**settings),
        tolerance=tolerance,
        motion=False,
    )


def legal(check: Check, points: Array, **settings: Any) -> list[bool]:
    """Return whether each posture (N, 19, 3) passes a check."""
    violated = check.judge(body_of(points, **settings)).violated
    return [not any(row) for row in violated.tolist()]


def _table_1_rows() -> Iterator[Row]:
    for angle, bounds in printed()["lee_chen"]["ranges"].items():
        joint, part = angle.split(".")
        sides = ("",) if joint in ("pelvis", "neck") else tuple(f"{side}_" for side in SIDES)
        dof = part.removesuffix("_with_straight_knee")
        verdicts: dict[float, list[bool]] = {-PROBE_DEGREES: [], PROBE_DEGREES: []}
        for bound, outward in zip(bounds, (-1.0, 1.0), strict=True):
            for side in sides:
                knee = {f"{side}knee.flexion": FLEXED_KNEE} if angle == "hip.flexion" else {}
                for by in verdicts:
                    body = posed({f"{side}{joint}.{dof}": bound + outward * by} | knee)
                    verdicts[by] += legal(JointRange(), body, ranges="table1")
        inside, outside = verdicts.values()
        here = f"{sum(inside)} of {len(inside)} postures inside are legal, {sum(outside)} of {len(outside)} outside"
        yield row(
            "table1",
            here,
            all(inside) and not any(outside),
            angle=angle.replace(".", ", ").replace("_", " "),
            lower=bounds[0],
            upper=bounds[1],
            by=PROBE_DEGREES,
        )
    rest = {"right_hip.abduction": 5.0, "right_knee.flexion": FLEXED_KNEE}
    thighs = np.concatenate([posed({"right_hip.flexion": flexion} | rest) for flexion in HIP_FLEXIONS])
    words = ["legal" if one else "illegal" for one in legal(JointRange(), thighs, ranges="table1-printed")]
    here = "`table1`: the angle out of the plane of flexion; `table1-printed`: as printed"
    yield row("abduction", here, False, found=", ".join(words))


def _knee_and_collision_rows() -> Iterator[Row]:
    signs = []
    for limb in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")):
        joints = posed({f"right_{limb[1]}.flexion": FLEXED_KNEE})[0]
        a, b, c = (joints[JOINT[f"right_{name}"]] for name in limb)
        left = joints[JOINT["left_shoulder"]] - joints[JOINT["right_shoulder"]]
        signs.append("non-negative" if np.cross(c - b, b - a) @ left >= 0 else "negative")
    here = f"{signs[0]} at the elbow, {signs[1]} at the knee"
    yield row("knee", here, signs == ["non-negative"] * 2)
    figure, rng = load_figure(), np.random.default_rng(1985)
    q = np.tile(pin.neutral(figure.model), (N_COLLISIONS, 1))
    q[:, figure.angle_index] = rng.uniform(
        figure.limits.lower, figure.limits.upper, (N_COLLISIONS, len(DOFS))
    )
    free = legal(Collision(), figure.forward_kinematics(q))
    data, geometry_data = figure.model.createData(), pin.GeometryData(figure.geometry)
    hit = [pin.computeCollisions(figure.model, data, figure.geometry, geometry_data, one, True) for one in q]
    alike = sum(one != other for one, other in zip(free, hit, strict=True))
    here = f"{alike} of {N_COLLISIONS} verdicts are equal, {sum(hit)} bodies collide"
    yield row("collision", here, alike == N_COLLISIONS)


def _rule_rows() -> Iterator[Row]:
    for rule, (forbidden, change) in RULES.items():
        bodies = np.concatenate([posed(forbidden), posed(forbidden | change)])
        kept = legal(WalkingRules(rules=(rule,)), bodies, walkers="paper-printed")
        here = " / ".join("kept" if one else "rejected" for one in kept)
        yield row(
            "rule",
            here,
            kept == [False, True],
            rule=rule,
            forbidden=_named(forbidden),
            allowed=_named(change),
        )
    (standing,) = legal(WalkingRules(rules=(2,)), posed({"neck.rotation": 15.0}), walkers="paper-printed")
    here = f"Rule 2 {'keeps' if standing else 'rejects'} a standing body that turns the head by 15 degrees"
    yield row("body-plane", here, standing)


def _named(angles: Mapping[str, float]) -> str:
    return ", ".join(
        f"{dof.replace('_', ' ').replace('.', ' ')} {degrees:g}" for dof, degrees in angles.items()
    )


def _formula_rows() -> Iterator[Row]:
    """Compare joint angles by the printed formulas of §3.2.A with the angles that the joint range check computes."""
    figure = load_figure()
    points = figure.forward_kinematics(random_postures(figure, N_FORMULAS, np.random.default_rng(32)))
    judgement = JointRange().judge(body_of(points, ranges="table1-printed"))
    found = dict(zip(judgement.places, judgement.value.T, strict=True))
    written = _written_out(points)
    for part, words, joints in FORMULAS:
        own = {where: angle for where, angle in written.items() if where.split(".")[0].endswith(joints)}
        off = []
        for where, angle in own.items():
            # The paper gives bending and rotation of pelvis and neck the same sign to both sides.
            ours = found[where] if where.startswith(SIDES) else np.abs(found[where])
            off.append(turned_near(ours - angle, 0.0, half_turn=180.0))
        decided = np.isfinite(off)
        worst = float(np.nanmax(np.abs(off)))
        here = f"{worst:.0e} degrees off at most, {decided.mean():.1%} decided"
        fits = worst < FORMULA_DEGREES and bool(decided.mean() > 0.9)
        yield row("formula", here, fits, part=part, words=words, n=N_FORMULAS)


def _written_out(points: Array) -> dict[str, Array]:
    """Return the joint angles (N,), degrees, by the printed arc-cosine formulas of §3.2.A."""
    place = {name: points[:, k] for name, k in JOINT.items()}
    y = unit(place["pelvis"] - place["neck"])
    z = unit(place["left_shoulder"] - place["right_shoulder"])
    axes = np.stack([np.cross(y, z), y, z], axis=1)

    def part(start: str, end: str) -> Array:
        return np.asarray(np.einsum("nij,nj->in", axes, place[end] - place[start]))

    angles: dict[str, Array] = {}
    for side, outward in zip(SIDES, (-1.0, 1.0), strict=True):
        for ball, end in (("shoulder", "elbow"), ("hip", "knee")):
            along = part(f"{side}_{ball}", f"{side}_{end}")
            angles[f"{side}_{ball}.flexion"] = np.sign(along[0]) * _between(along[1], along[0])
            angles[f"{side}_{ball}.abduction"] = np.sign(outward * along[2]) * _between(along[1], along[2])
        for joints, forward in ((("shoulder", "elbow", "wrist"), 1.0), (("hip", "knee", "ankle"), -1.0)):
            start, middle, last = (f"{side}_{joint}" for joint in joints)
            u, v = unit(part(start, middle).T), unit(part(middle, last).T)
            bend = np.degrees(np.arccos(np.clip((u * v).sum(axis=1), -1.0, 1.0)))
            angles[f"{middle}.flexion"] = np.where(forward * np.cross(v, u)[:, 2] >= 0, bend, -bend)
    right, left = part("pelvis", "right_hip").T, part("pelvis", "left_hip").T
    middle_of_hips = (right + left) / 2
    planes = {"pelvis": (np.cross(middle_of_hips, left - right), middle_of_hips)}
    # The head's forward and up axes are the axes of Table A.2.
    moved = points[:, [0, *range(14, 19)]] - points[:, :1]
    linear = np.array([np.linalg.lstsq(TABLE_A2.points - TABLE_A2.points[0], each)[0] for each in moved])
    ahead, up = (np.einsum("nij,nj->ni", axes, linear[:, k]) for k in (0, 1))
    planes["neck"] = (ahead, -up)
    for joint, (normal, along_plane) in planes.items():
        angles[f"{joint}.flexion"] = _between(normal[:, 0], normal[:, 1])
        angles[f"{joint}.rotation"] = _between(normal[:, 0], normal[:, 2])
        angles[f"{joint}.bending"] = _between(along_plane[:, 1], along_plane[:, 2])
    return angles


def _between(along: Array, across: Array) -> Array:
    """Return the angle between an axis and a vector with components `along` and `across` it: (N,), degrees."""
    return np.asarray(np.degrees(np.arccos(np.clip(along / np.hypot(along, across), -1.0, 1.0))))
