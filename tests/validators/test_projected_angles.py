"""The paper's projected angles: the sign of each by a posture made by hand, and both ends of each range."""

import dataclasses
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.skeleton import DOFS, HEAD, JOINT, POINTS
from posekit.tree import Check
from posekit.validators import Ranges, joint_range, load_ranges
from posekit.validators.projected_angles import angle_in_plane
from posekit.validators.table1_angles import paper_axes

FIGURE = load_figure()
TABLE1 = load_ranges("table1-printed")
CHECKS = joint_range(FIGURE, TABLE1)
# The neutral figure: x forward, y left, z up, in metres.
FORWARD, LEFT, UP = np.eye(3)
ANYWHERE = pin.Quaternion(np.array([0.3, -0.5, 0.7, 0.2]) / np.linalg.norm([0.3, -0.5, 0.7, 0.2])).matrix()


def standing(**joints: np.ndarray) -> np.ndarray:
    """Place a standing person (1, 19, 3), with some joints put at an offset from the joint before."""
    points = FIGURE.neutral_points[None].copy()
    for limb in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")):
        for side in ("right", "left"):
            for before, after in pairwise(limb):
                start, end = f"{side}_{before}", f"{side}_{after}"
                offset = joints.get(end, -UP)
                length = FIGURE.lengths[f"{start}-{end}"]
                points[0, JOINT[end]] = points[0, JOINT[start]] + length * offset / np.linalg.norm(offset)
    return points


def turned(angles: dict[str, float]) -> np.ndarray:
    """Place a person (1, 19, 3) by the figure's own angles, degrees, seen from anywhere."""
    q = pin.neutral(FIGURE.model)[None].copy()
    for dof, angle in angles.items():
        q[0, FIGURE.angle_index[DOFS.index(dof)]] = np.radians(angle)
    return np.asarray(FIGURE.forward_kinematics(q) @ ANYWHERE.T + [0.2, -0.1, 4.0])


def values(points: np.ndarray, checks: list[Check] = CHECKS) -> dict[str, float]:
    found: dict[str, float] = {}
    for check in checks:
        findings = check.judge(points[:, check.points])
        found |= dict(zip(check.where, findings.value[0].tolist(), strict=True))
    return found


def rejected(points: np.ndarray, checks: list[Check] = CHECKS) -> set[str]:
    found = set()
    for check in checks:
        bad = np.any(check.judge(points[:, check.points]).violated, axis=0).tolist()
        found |= {where for where, wrong in zip(check.where, bad, strict=True) if wrong}
    return found


def test_all_of_table_1_is_judged() -> None:
    places = {where for check in CHECKS for where in check.where}
    expected = {f"{joint}.{a}" for joint in ("pelvis", "neck") for a in ("flexion", "rotation", "bending")}
    for side in ("right", "left"):
        expected |= {f"{side}_{joint}.{a}" for joint in ("shoulder", "hip") for a in ("flexion", "abduction")}
        expected |= {f"{side}_{joint}.flexion" for joint in ("elbow", "knee")}
    assert places == expected


def test_standing_is_zero_everywhere() -> None:
    for value in values(standing()).values():
        assert value == pytest.approx(0, abs=1e-9)
    assert rejected(standing()) == set()


def test_the_torsos_axes_are_the_papers() -> None:
    points = standing()
    x, y, z = paper_axes(points[:, :4])[0]
    spine = points[0, JOINT["pelvis"]] - points[0, JOINT["neck"]]
    shoulders = points[0, JOINT["left_shoulder"]] - points[0, JOINT["right_shoulder"]]
    np.testing.assert_allclose(y, spine / np.linalg.norm(spine), rtol=0, atol=1e-15)
    np.testing.assert_allclose(z, shoulders / np.linalg.norm(shoulders), rtol=0, atol=1e-15)
    np.testing.assert_allclose(x, np.cross(y, z), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("joints", "where", "expected"),
    [
        ({"right_elbow": FORWARD - UP}, "right_shoulder.flexion", 45),
        ({"left_elbow": FORWARD - UP}, "left_shoulder.flexion", 45),
        ({"right_elbow": FORWARD}, "right_shoulder.flexion", 90),
        ({"right_elbow": FORWARD + UP}, "right_shoulder.flexion", 135),
        ({"right_elbow": -FORWARD - UP}, "right_shoulder.flexion", -45),
        ({"left_elbow": -FORWARD - UP}, "left_shoulder.flexion", -45),
        ({"right_elbow": -LEFT - UP}, "right_shoulder.abduction", 45),
        ({"left_elbow": LEFT - UP}, "left_shoulder.abduction", 45),
        ({"right_elbow": -LEFT}, "right_shoulder.abduction", 90),
        ({"right_elbow": LEFT - UP}, "right_shoulder.abduction", -45),
        ({"left_elbow": -LEFT - UP}, "left_shoulder.abduction", -45),
        ({"right_knee": FORWARD - UP}, "right_hip.flexion", 45),
        ({"left_knee": -FORWARD - 3 * UP}, "left_hip.flexion", -np.degrees(np.arctan(1 / 3))),
        ({"right_knee": -LEFT - 2 * UP}, "right_hip.abduction", np.degrees(np.arctan(1 / 2))),
        ({"left_knee": LEFT - 2 * UP}, "left_hip.abduction", np.degrees(np.arctan(1 / 2))),
        ({"left_knee": -LEFT - 2 * UP}, "left_hip.abduction", -np.degrees(np.arctan(1 / 2))),
        ({"right_wrist": FORWARD}, "right_elbow.flexion", 90),
        ({"left_wrist": FORWARD - UP}, "left_elbow.flexion", 45),
        ({"right_wrist": -FORWARD}, "right_elbow.flexion", -90),
        ({"right_ankle": -FORWARD}, "right_knee.flexion", 90),
        ({"left_ankle": -FORWARD - UP}, "left_knee.flexion", 45),
        ({"left_ankle": FORWARD - UP}, "left_knee.flexion", -45),
        ({"right_elbow": FORWARD, "right_wrist": UP}, "right_elbow.flexion", 90),
        ({"right_elbow": UP, "right_wrist": -FORWARD}, "right_elbow.flexion", 90),
        ({"right_knee": FORWARD, "right_ankle": -UP}, "right_knee.flexion", 90),
    ],
)
def test_the_sign_of_a_limbs_angle(joints: dict[str, np.ndarray], where: str, expected: float) -> None:
    for points in (standing(**joints), standing(**joints) @ ANYWHERE.T + 3.0):
        assert values(points)[where] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("angles", "where", "expected"),
    [
        ({"neck.flexion": 30}, "neck.flexion", 30),
        ({"neck.flexion": -30}, "neck.flexion", -30),
        ({"neck.rotation": 30}, "neck.rotation", 30),
        ({"neck.bending": 30}, "neck.bending", 30),
        ({"pelvis.flexion": 30}, "pelvis.flexion", 30),
        ({"pelvis.flexion": -20}, "pelvis.flexion", -20),
        ({"pelvis.rotation": 20}, "pelvis.rotation", 20),
        ({"pelvis.bending": 20}, "pelvis.bending", 20),
    ],
)
def test_the_sign_of_the_necks_and_the_pelvis_angles(
    angles: dict[str, float], where: str, expected: float
) -> None:
    # What is above the joint bends and turns to the left, as in the URDF.
    found = values(turned(angles))
    assert found.pop(where) == pytest.approx(expected, abs=1e-9)
    joint = where.partition(".")[0]
    for other in ("flexion", "rotation", "bending"):
        if f"{joint}.{other}" != where:
            assert found[f"{joint}.{other}"] == pytest.approx(0, abs=1e-9)


def test_a_chin_on_the_chest_is_flexion_of_the_neck() -> None:
    points = standing()
    nose, neck = POINTS.index("nose"), JOINT["neck"]
    c, s = np.cos(0.4), np.sin(0.4)
    down = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    before = points[0, nose, 2]
    points[:, HEAD] = (points[:, HEAD] - points[:, [neck]]) @ down.T + points[:, [neck]]
    assert points[0, nose, 2] < before
    assert values(points)["neck.flexion"] == pytest.approx(np.degrees(0.4), abs=1e-9)


def test_bending_forward_at_the_waist_is_flexion_of_the_pelvis() -> None:
    points = standing()
    hips = [JOINT[name] for name in JOINT if name.endswith(("hip", "knee", "ankle"))]
    c, s = np.cos(0.5), np.sin(0.5)
    # Seen from the torso, the legs swing forward.
    forward = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    pelvis = points[:, [JOINT["pelvis"]]]
    points[:, hips] = (points[:, hips] - pelvis) @ forward.T + pelvis
    assert points[0, JOINT["right_knee"], 0] > 0.1
    assert values(points)["pelvis.flexion"] == pytest.approx(np.degrees(0.5), abs=1e-9)


RANGES = [
    ("right_shoulder.flexion", "right_shoulder.flexion", 1, -50.0, 179.0),
    ("left_shoulder.flexion", "left_shoulder.flexion", 1, -50.0, 179.0),
    ("right_shoulder.abduction", "right_shoulder.abduction", 1, -50.0, 179.0),
    ("left_shoulder.abduction", "left_shoulder.abduction", 1, -50.0, 179.0),
    ("right_elbow.flexion", "right_elbow.flexion", 1, 0.0, 160.0),
    ("left_elbow.flexion", "left_elbow.flexion", 1, 0.0, 160.0),
    ("right_hip.flexion", "right_hip.flexion", 1, -40.0, 90.0),
    ("left_hip.flexion", "left_hip.flexion", 1, -40.0, 90.0),
    ("right_hip.abduction", "right_hip.abduction", 1, -30.0, 45.0),
    ("left_hip.abduction", "left_hip.abduction", 1, -30.0, 45.0),
    ("right_knee.flexion", "right_knee.flexion", 1, 0.0, 130.0),
    ("left_knee.flexion", "left_knee.flexion", 1, 0.0, 130.0),
    ("pelvis.flexion", "pelvis.flexion", 1, -30.0, 75.0),
    ("pelvis.rotation", "pelvis.rotation", 1, -30.0, 30.0),
    ("pelvis.bending", "pelvis.bending", 1, -35.0, 35.0),
    ("neck.flexion", "neck.flexion", 1, -55.0, 45.0),
    ("neck.rotation", "neck.rotation", 1, -70.0, 70.0),
    ("neck.bending", "neck.bending", 1, -40.0, 40.0),
]


@pytest.mark.parametrize(("where", "dof", "sign", "lower", "upper"), RANGES)
@pytest.mark.parametrize(
    ("outside", "passes"), [(-0.01, True), (0.0, True), (0.0005, True), (0.002, False), (1, False)]
)
def test_each_range_just_passes_and_just_fails(
    where: str, dof: str, sign: int, lower: float, upper: float, outside: float, passes: bool
) -> None:
    # 179 stands for 180, beyond which an angle comes back from below.
    wide = {
        "right_shoulder.flexion",
        "left_shoulder.flexion",
        "right_shoulder.abduction",
        "left_shoulder.abduction",
    }
    limits = dict(TABLE1.limits) | {f"shoulder.{a}": (-50.0, 179.0) for a in ("flexion", "abduction")}
    checks = joint_range(FIGURE, dataclasses.replace(TABLE1, limits=limits)) if where in wide else CHECKS
    for bound, beyond in ((upper, outside), (lower, -outside)):
        points = turned({dof: sign * (bound + beyond)})
        assert values(points, checks)[where] == pytest.approx(bound + beyond, abs=1e-6)
        assert (where in rejected(points, checks)) == (not passes)


@pytest.mark.parametrize(
    ("knee", "hip", "passes"),
    [
        (0, 89.9, True),
        (0, 90.1, False),
        (4.9, 90.1, False),
        (5.1, 90.1, True),
        (60, 119.9, True),
        (60, 120.1, False),
        (0, -39.9, True),
        (0, -40.1, False),
        (60, -39.9, True),
        (60, -40.1, False),
    ],
)
@pytest.mark.parametrize("side", ["right", "left"])
def test_the_hips_range_depends_on_the_knee(side: str, knee: float, hip: float, passes: bool) -> None:
    points = turned({f"{side}_hip.flexion": hip, f"{side}_knee.flexion": knee})
    assert (f"{side}_hip.flexion" in rejected(points)) == (not passes)


def test_without_the_ankle_the_hip_has_its_wide_range() -> None:
    for hip, passes in ((110.0, True), (121.0, False)):
        points = turned({"right_hip.flexion": hip, "right_knee.flexion": 0})
        points[:, JOINT["right_ankle"]] = np.nan
        assert ("right_hip.flexion" in rejected(points)) == (not passes)


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_limb_along_a_planes_normal_has_no_angle_in_it(side: str) -> None:
    outward = LEFT if side == "left" else -LEFT
    ahead = values(standing(**{f"{side}_elbow": FORWARD}))
    assert np.isnan(ahead[f"{side}_shoulder.abduction"])
    assert ahead[f"{side}_shoulder.flexion"] == pytest.approx(90)
    aside = values(standing(**{f"{side}_elbow": outward}))
    assert np.isnan(aside[f"{side}_shoulder.flexion"])
    assert aside[f"{side}_shoulder.abduction"] == pytest.approx(90)


@pytest.mark.parametrize(("shortness", "decided"), [(0.0999, False), (0.1001, True)])
def test_a_projection_is_undecided_below_its_threshold(shortness: float, decided: bool) -> None:
    # The arm points forward and, by this much, inward and up: read as an angle, adducted by 90 or more.
    across = shortness * (LEFT + UP) / np.sqrt(2)
    points = standing(right_elbow=np.sqrt(1 - shortness**2) * FORWARD + across)
    assert np.isnan(values(points)["right_shoulder.abduction"]) == (not decided)
    assert ("right_shoulder.abduction" in rejected(points)) == decided
    always = joint_range(FIGURE, dataclasses.replace(TABLE1, shortest_projection=0.0))
    assert "right_shoulder.abduction" in rejected(points, always)


def random_turns(n: int) -> list[np.ndarray]:
    rng = np.random.default_rng(2)
    turns = rng.normal(size=(n, 4))
    return [pin.Quaternion(t / np.linalg.norm(t)).matrix() for t in turns]


@pytest.mark.parametrize(
    "joints",
    [
        {"right_elbow": UP, "left_elbow": UP, "right_wrist": UP, "left_wrist": UP},
        {"right_elbow": -LEFT, "left_elbow": LEFT, "right_wrist": -LEFT, "left_wrist": LEFT},
        {"right_elbow": -LEFT, "left_elbow": LEFT, "right_wrist": FORWARD, "left_wrist": FORWARD},
        {"right_elbow": FORWARD, "right_wrist": FORWARD},
        {"right_knee": FORWARD, "right_ankle": -UP, "left_knee": FORWARD, "left_ankle": -UP},
    ],
)
def test_rounding_decides_no_verdict(joints: dict[str, np.ndarray]) -> None:
    # Straight up is 180 or -180, an elbow bent square to the torso's z is flexed or extended: by one bit.
    for R in random_turns(100):
        assert rejected(standing(**joints) @ R.T + [0, 0, 4.0]) == set()


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (0, 1, 0),
        (1, 0, 90),
        (0, -1, 180),
        (-0.0, -1, 180),
        (-1e-17, -1, 180),
        (-1, 0, -90),
        (1, -1, 135),
        (-1, -1, -135),
    ],
)
def test_an_angle_in_a_plane(x: float, y: float, expected: float) -> None:
    assert angle_in_plane(np.array(x), np.array(y), 0.0) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("missing", POINTS)
def test_a_missing_point_never_rejects_and_leaves_its_places_undecided(missing: str) -> None:
    points = turned({"right_shoulder.flexion": 30, "left_knee.flexion": 40})
    k = POINTS.index(missing)
    points[:, k] = np.nan
    for check in CHECKS:
        findings = check.judge(points[:, check.points])
        assert not findings.violated.any()
        if k in check.points:
            assert findings.undecided.any()


def test_an_elbow_is_judged_without_regard_to_a_missing_hip() -> None:
    points = turned({"right_elbow.flexion": -20})
    points[:, JOINT["right_hip"]] = np.nan
    assert "right_elbow.flexion" in rejected(points)
    assert np.isnan(values(points)["pelvis.flexion"])


def test_coincident_hips_are_undecided_without_a_warning() -> None:
    points = standing()
    points[:, JOINT["left_hip"]] = points[:, JOINT["right_hip"]]
    found = values(points)
    assert np.isnan(found["pelvis.flexion"])
    assert np.isnan(found["pelvis.rotation"])


def test_the_mirror_image_has_the_same_verdicts() -> None:
    rng = np.random.default_rng(4)
    q = np.tile(pin.neutral(FIGURE.model), (500, 1))
    q[:, FIGURE.angle_index] = rng.uniform(-0.3, 0.7, (500, 22))
    points = FIGURE.forward_kinematics(q)
    other = [name.replace("right", "L").replace("left", "right").replace("L", "left") for name in POINTS]
    mirrored = (points * [1, -1, 1])[:, [POINTS.index(name) for name in other]]
    ours, theirs = (
        np.any([c.judge(p[:, c.points]).violated.any(axis=1) for c in CHECKS], axis=0)
        for p in (points, mirrored)
    )
    np.testing.assert_array_equal(ours, theirs)
    assert 0.1 < ours.mean() < 0.999


def test_a_looser_tolerance_never_rejects_more() -> None:
    rng = np.random.default_rng(6)
    q = np.tile(pin.neutral(FIGURE.model), (1000, 1))
    limits = FIGURE.limits
    q[:, FIGURE.angle_index] = limits.lower + rng.uniform(-0.1, 1.1, (1000, 22)) * (
        limits.upper - limits.lower
    )
    points = FIGURE.forward_kinematics(q)
    found = []
    for tolerance in (1e-3, 0.5, 2.0, 8.0):
        checks = joint_range(FIGURE, TABLE1, tolerance=tolerance)
        found.append(np.any([c.judge(points[:, c.points]).violated.any(axis=1) for c in checks], axis=0))
    for strict, loose in pairwise(found):
        assert (strict | ~loose).all()
        assert loose.sum() < strict.sum()


@pytest.mark.parametrize(("tolerance", "passes"), [(1e-3, False), (0.9, False), (1.1, True), (5.0, True)])
def test_an_arm_beyond_straight_up_passes_within_the_tolerance(tolerance: float, passes: bool) -> None:
    checks = joint_range(FIGURE, TABLE1, tolerance=tolerance)
    for beyond, angle in ((-FORWARD, "flexion"), (LEFT, "abduction")):
        points = standing(right_elbow=UP + np.tan(np.radians(1.0)) * beyond)
        assert (f"right_shoulder.{angle}" in rejected(points, checks)) == (not passes)


def test_table_1_does_not_look_at_the_urdfs_limits() -> None:
    narrow = FIGURE.with_limits({dof: (-1e-3, 1e-3) for dof in DOFS})
    points = turned({"right_elbow.flexion": 90})
    assert rejected(points, joint_range(narrow, TABLE1)) == set()
    assert isinstance(TABLE1, Ranges)
