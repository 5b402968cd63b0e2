"""Table 1 as rotations: SciPy's rotations say the same, every row ends at its bounds, and nothing jumps."""

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.body import load_figure
from posekit.geometry import unit
from posekit.skeleton import HEAD, JOINT
from posekit.tree import Check, Findings
from posekit.validators import joint_range, load_ranges
from posekit.validators import rotation_angles as turned
from posekit.validators.table1_angles import paper_axes

FIGURE = load_figure()
CHECKS = joint_range(FIGURE, load_ranges("table1"))
PRINTED = joint_range(FIGURE, load_ranges("table1-printed"))
STANDING = FIGURE.neutral_points
AXES = paper_axes(STANDING[None, [JOINT[j] for j in ("neck", "right_shoulder", "left_shoulder", "pelvis")]])[
    0
]
OUTWARD = {"right": -1.0, "left": 1.0}
DOWN = np.array([0.0, 1.0, 0.0])
# The paper's axes: x forward, y down, z left. Raising a limb forward is turning it about -z, the left one
# sideways about x.


def arm(flexion: float, abduction: float, outward: float) -> Rotation:
    return Rotation.from_rotvec([outward * abduction, 0, -flexion], degrees=True)


def thigh(flexion: float, abduction: float, outward: float) -> Rotation:
    return Rotation.from_euler("ZX", [-flexion, outward * abduction], degrees=True)


def posed(angles: Mapping[str, float]) -> np.ndarray:
    """Place a person (1, 19, 3) by Table 1's angles of the right side; all that is not given is at rest."""
    points = STANDING.copy()
    angle = dict.fromkeys(("shoulder.flexion", "shoulder.abduction", "elbow.flexion", "hip.flexion"), 0.0)
    angle |= dict.fromkeys(("hip.abduction", "knee.flexion"), 0.0)
    parts = ("flexion", "rotation", "bending")
    angle |= {f"{joint}.{part}": 0.0 for joint in ("pelvis", "neck") for part in parts} | dict(angles)
    # Under the torso hips turn against what is above them; the head turns and bends to the left.
    flexion, rotation, bending = (angle[f"pelvis.{part}"] for part in parts)
    hips = Rotation.from_rotvec([bending, rotation, -flexion], degrees=True)
    flexion, rotation, bending = (angle[f"neck.{part}"] for part in parts)
    head = Rotation.from_rotvec([-bending, -rotation, flexion], degrees=True)
    for turn, root, moved in (
        (hips, JOINT["pelvis"], [JOINT["right_hip"], JOINT["left_hip"]]),
        (head, JOINT["neck"], list(HEAD)),
    ):
        points[moved] = points[root] + turn.apply((points[moved] - points[root]) @ AXES.T) @ AXES
    for side, outward in OUTWARD.items():
        mine = angle if side == "right" else dict.fromkeys(angle, 0.0)
        for joints, ball, bend in (
            (("shoulder", "elbow", "wrist"), arm, -mine["elbow.flexion"]),
            (("hip", "knee", "ankle"), thigh, mine["knee.flexion"]),
        ):
            R = ball(mine[f"{joints[0]}.flexion"], mine[f"{joints[0]}.abduction"], outward)
            below = R * Rotation.from_euler("z", bend, degrees=True)
            start, middle, end = (JOINT[f"{side}_{joint}"] for joint in joints)
            for a, b, turn in ((start, middle, R), (middle, end, below)):
                length = np.linalg.norm(STANDING[b] - STANDING[a])
                points[b] = points[a] + length * turn.apply(DOWN) @ AXES
    return points[None]


def found(checks: list[Check], points: np.ndarray) -> dict[str, Findings]:
    """Judge postures, angle by angle; of the hip's flexion, which is judged twice, what the knee says is kept."""
    return {
        where: Findings(
            **{name: np.broadcast_to(part, one.value.shape)[:, k] for name, part in parts.items()}
        )
        for check in checks
        for one in [check.judge(points[:, check.points])]
        for parts in [{name: getattr(one, name) for name in ("value", "lower", "upper", "tolerance")}]
        for k, where in enumerate(check.where)
    }


def rejected(points: np.ndarray) -> set[str]:
    return {where for where, one in found(CHECKS, points).items() if one.violated[0]}


# Every row of Table 1: the angle, its bounds, and three times what the others are. Of an arm straight up the other
# angle is zero: 180 of one is all that there is.
SIDE = {"hip.abduction": -20.0, "elbow.flexion": 30.0, "neck.rotation": 40.0, "pelvis.bending": -20.0}
OTHER = {
    "hip.abduction": 30.0,
    "elbow.flexion": 100.0,
    "neck.flexion": -30.0,
    "neck.bending": 25.0,
    "pelvis.flexion": 40.0,
    "pelvis.rotation": 20.0,
}
ARMS = [{}, {"shoulder.abduction": 60.0, **SIDE}, {"shoulder.abduction": -30.0, **OTHER}]
FLEXED = [{}, {"shoulder.flexion": 110.0, **SIDE}, {"shoulder.flexion": -40.0, **OTHER}]
RAISED = [{}, SIDE, OTHER]
BENT = [{"knee.flexion": 5.0}, {"knee.flexion": 60.0, **SIDE}, {"knee.flexion": 129.0, **OTHER}]
SQUATS = [{}, {"hip.flexion": 85.0, **SIDE}, {"hip.flexion": -35.0, **OTHER}]
REACHING = [
    {},
    {"shoulder.flexion": 90.0, "shoulder.abduction": 40.0},
    {"shoulder.flexion": 20.0, "shoulder.abduction": 130.0},
]
STEPS = [
    {},
    {"hip.flexion": 100.0, "hip.abduction": 30.0},
    {"hip.flexion": -30.0, "hip.abduction": -20.0},
]
ALOFT = {"shoulder.flexion": 80.0, "shoulder.abduction": 80.0, "knee.flexion": 90.0}
NODS = [
    ALOFT,
    {"neck.flexion": 30.0, "neck.rotation": -40.0, "neck.bending": 20.0},
    {"neck.flexion": -40.0, "neck.rotation": 50.0, "neck.bending": -30.0},
]
BOWS = [
    ALOFT,
    {"pelvis.flexion": 50.0, "pelvis.rotation": -20.0, "pelvis.bending": 25.0},
    {"pelvis.flexion": -20.0, "pelvis.rotation": 25.0, "pelvis.bending": -30.0},
]
ROWS = [
    ("shoulder.flexion", -50.0, ARMS),
    ("shoulder.flexion", 180.0, RAISED),
    ("shoulder.abduction", -50.0, FLEXED),
    ("shoulder.abduction", 180.0, RAISED),
    ("elbow.flexion", 0.0, REACHING),
    ("elbow.flexion", 160.0, REACHING),
    ("hip.flexion", -40.0, RAISED),
    ("hip.flexion", 90.0, RAISED),
    ("hip.flexion", -40.0, BENT),
    ("hip.flexion", 120.0, BENT),
    ("hip.abduction", -30.0, SQUATS),
    ("hip.abduction", 45.0, SQUATS),
    ("hip.abduction", -30.0, [each | {"hip.flexion": 119.0} for each in BENT]),
    ("hip.abduction", 45.0, [each | {"hip.flexion": 119.0} for each in BENT]),
    (
        "knee.flexion",
        0.0,
        [each | {"hip.flexion": min(each.get("hip.flexion", 0.0), 89.0)} for each in STEPS],
    ),
    ("knee.flexion", 130.0, STEPS),
    ("pelvis.flexion", -30.0, BOWS),
    ("pelvis.flexion", 75.0, BOWS),
    ("pelvis.rotation", -30.0, BOWS),
    ("pelvis.rotation", 30.0, BOWS),
    ("pelvis.bending", -35.0, BOWS),
    ("pelvis.bending", 35.0, BOWS),
    ("neck.flexion", -55.0, NODS),
    ("neck.flexion", 45.0, NODS),
    ("neck.rotation", -70.0, NODS),
    ("neck.rotation", 70.0, NODS),
    ("neck.bending", -40.0, NODS),
    ("neck.bending", 40.0, NODS),
]


@pytest.mark.parametrize(("row", "bound", "others"), ROWS)
def test_each_row_ends_at_its_bounds_whatever_the_others_are(
    row: str, bound: float, others: list[dict[str, float]]
) -> None:
    where = row if row.startswith(("pelvis", "neck")) else f"right_{row}"
    outward = 1.0 if bound > 0 or (row == "elbow.flexion" and bound) else -1.0
    for rest in others:
        inside, outside = (posed(rest | {row: bound + outward * by}) for by in (-0.3, 0.3))
        assert rejected(inside) == set()
        assert rejected(outside) == {where}
        if abs(bound) < 180:
            assert found(CHECKS, outside)[where].value[0] == pytest.approx(bound + 0.3 * outward)


def test_every_row_of_the_table_is_asked() -> None:
    asked = {(row, bound) for row, bound, _ in ROWS}
    limits = load_ranges("table1").limits
    expected = {
        (row.replace("_with_straight_knee", ""), bound) for row, bounds in limits.items() for bound in bounds
    }
    assert asked == expected


def random_turns(n: int, rng: np.random.Generator) -> Rotation:
    return Rotation.random(n, rng)


def test_an_arms_angles_are_the_rotation_vector_that_carries_it_there(rng: np.random.Generator) -> None:
    u = unit(rng.normal(size=(500, 3)))
    for side, outward in OUTWARD.items():
        value, _ = turned.shoulder_angles(u, outward)
        for (flexion, abduction), each in zip(value, u, strict=True):
            np.testing.assert_allclose(arm(flexion, abduction, outward).apply(DOWN), each, atol=1e-12)
        assert np.hypot(*value.T).max() <= 180, side


def test_a_thighs_angles_are_turns_about_z_then_about_its_own_x(rng: np.random.Generator) -> None:
    u = unit(rng.normal(size=(500, 3)))
    for outward in OUTWARD.values():
        value, _ = turned.hip_angles(u, outward, 40.0)
        for (flexion, abduction), each in zip(value, u, strict=True):
            np.testing.assert_allclose(thigh(flexion, abduction, outward).apply(DOWN), each, atol=1e-12)
        assert value[:, 0].min() >= -140
        assert value[:, 0].max() <= 220


@pytest.mark.parametrize("tilt", [0.0, 25.0, -80.0])
def test_a_hinge_bends_about_the_axis_that_the_limb_takes_with_it(
    tilt: float, rng: np.random.Generator
) -> None:
    for flexion, abduction, bend in rng.uniform([-60, -60, 1], [130, 60, 170], (200, 3)):
        axis = np.array([np.sin(np.radians(tilt)), 0.0, np.cos(np.radians(tilt))])
        part = bend * np.cos(np.radians(tilt))
        for ball, sign, flexed in (
            (arm, -1.0, turned.elbow_flexion),
            (thigh, 1.0, turned.knee_flexion),
        ):
            upper = ball(flexion, abduction, 1.0)
            lower = upper * Rotation.from_rotvec(sign * bend * axis, degrees=True)
            value, _ = flexed(upper.apply(DOWN)[None], lower.apply(DOWN)[None])
            assert value[0] == pytest.approx(part, abs=1e-9)


def test_a_planes_angles_are_its_rotation_vector(rng: np.random.Generator) -> None:
    turns = random_turns(500, rng)
    R = turns.as_matrix()
    expected = turns.as_rotvec(degrees=True)[:, [2, 1, 0]] * [-1, -1, 1]
    np.testing.assert_allclose(turned.plane_angles(R[:, :, 0], 3 * R[:, :, 1]), expected, atol=1e-6)


STEP = 0.05
"""Degrees by which neighbouring postures differ, in every segment."""


def neighbours(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw postures (n, 19, 3), a tenth with arms near straight up, the rest of them anywhere, and neighbours."""
    here = np.repeat(STANDING[None], n, axis=0)
    there = here.copy()
    for root, moved in (
        (JOINT["pelvis"], [JOINT["right_hip"], JOINT["left_hip"]]),
        (JOINT["neck"], list(HEAD)),
    ):
        vectors = rng.uniform(-1, 1, (n, 3))
        turn = Rotation.from_rotvec(np.radians(120) * vectors / np.sqrt(3))
        nearby = turn * Rotation.from_rotvec(np.radians(STEP) * unit(rng.normal(size=(n, 3))))
        for points, each in ((here, turn), (there, nearby)):
            own = STANDING[moved] - STANDING[root]
            points[:, moved] = points[:, [root]] + np.einsum("nij,pj->npi", each.as_matrix(), own)
    for side in OUTWARD:
        for joints in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")):
            start, middle, end = (JOINT[f"{side}_{joint}"] for joint in joints)
            for a, b in ((start, middle), (middle, end)):
                direction = unit(rng.normal(size=(n, 3)))
                if joints[1] == "elbow" and b == middle:
                    direction[: n // 10] = unit([0, 0, 1] + 0.03 * rng.normal(size=(n // 10, 3)))
                beside = unit(np.cross(direction, rng.normal(size=(n, 3))))
                moved = np.cos(np.radians(STEP)) * direction + np.sin(np.radians(STEP)) * beside
                length = np.linalg.norm(STANDING[b] - STANDING[a])
                here[:, b] = here[:, a] + length * direction
                there[:, b] = there[:, a] + length * moved
    return here, there


def pairs_of(checks: list[Check], n: int) -> dict[str, tuple[Findings, Findings]]:
    """Judge pairs of neighbouring postures, by angle."""
    here, there = neighbours(n, np.random.default_rng(19))
    ours, theirs = found(checks, here), found(checks, there)
    return {where: (one, theirs[where]) for where, one in ours.items()}


def turned_by(pair: tuple[Findings, Findings]) -> np.ndarray:
    return np.asarray(np.abs(np.mod(pair[0].value - pair[1].value + 180, 360) - 180))


def test_nothing_jumps_between_neighbouring_postures() -> None:
    """An angle changes by its stated gain at most: nowhere by much but where a limb is at the end of its reach.

    That is an arm straight up, where both its rows end, a thigh straight sideways and a limb folded onto itself.
    """
    for where, pair in pairs_of(CHECKS, 100_000).items():
        gain = np.maximum(pair[0].tolerance, pair[1].tolerance) / 1e-3
        clear = gain < 20
        assert clear.mean() > 0.8, where
        assert (turned_by(pair)[clear] <= 2.1 * gain[clear] * STEP).all(), where
        if where.endswith(("shoulder.flexion", "abduction")):
            # How far the limb is beyond its bounds, in degrees that it must turn, is continuous straight up, too.
            beyond, next_to = (each.margin * 1e-3 / each.tolerance for each in pair)
            assert (np.abs(beyond - next_to) <= 1.5 * STEP).all(), where


@pytest.mark.parametrize("hinge", ["right_elbow.flexion", "left_knee.flexion"])
def test_printed_hinges_do_jump(hinge: str) -> None:
    assert turned_by(pairs_of(PRINTED, 10_000)[hinge]).max() > 90


def test_a_raised_limb_has_no_abduction_where_the_print_has_180() -> None:
    points = posed({"hip.flexion": 110.0, "knee.flexion": 90.0, "shoulder.flexion": 120.0})
    for where in ("right_hip.abduction", "right_shoulder.abduction"):
        assert found(CHECKS, points)[where].value[0] == pytest.approx(0, abs=1e-9)
        assert abs(found(PRINTED, points)[where].value[0]) == pytest.approx(180)
    assert rejected(points) == set()
