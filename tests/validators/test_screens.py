"""What screens say is clear is what the judges say; on ordinary postures they are hardly ever unsure."""

import numpy as np
import pinocchio as pin
import pytest

from posekit import tree
from posekit.body import load_figure
from posekit.compiled import angle_kernels
from posekit.compiled.angle_kernels import TURN_AT
from posekit.compiled.frame_kernels import NUMBERS_AT
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.geometry import fit_rotation
from posekit.skeleton import DOFS
from posekit.tree import Check
from posekit.validators import collision, joint_range, load_ranges, rigid_parts

FIGURE = load_figure()
N = 150


MIDDLE = FIGURE.scaled({"pelvis-right_hip": 0.161, "pelvis-left_hip": 0.161})
"""The same with the pelvis between the hips: the spine turns them."""


def suite(tolerance: float) -> list[Check]:
    rigid = rigid_parts(FIGURE, tolerance=tolerance / 100)
    side = rigid_parts(FIGURE, tolerance=tolerance / 100, mode="side")[-1:]
    projected = [
        check
        for name in ("table1", "table1-printed")
        for check in joint_range(FIGURE, load_ranges(name), tolerance=tolerance)
    ]
    anatomical = load_ranges("anatomical")
    middle = [
        check
        for ranges in (load_ranges("urdf"), load_ranges("table1"), load_ranges("table1-printed"), anatomical)
        for check in joint_range(MIDDLE, ranges, tolerance=tolerance)
        if check.where[0].startswith(("pelvis", "right_hip"))
    ]
    own = joint_range(FIGURE, tolerance=tolerance)
    return [*rigid, *side, *own, *projected, *middle, *collision(FIGURE)]


SUITES = {tolerance: suite(tolerance) for tolerance in (0.0, 1e-3, 3.0)}
NAMES = [f"{type(check).__name__} {check.where[0]} {len(check.where)}" for check in SUITES[0.0]]


def postures(seed: int, n: int = N) -> np.ndarray:
    """Draw postures (n, 19, 3) inside and outside all limits, many of them self-penetrating."""
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    q[:, FIGURE.angle_index] = rng.uniform(-np.pi, np.pi, (n, 22))
    return FIGURE.forward_kinematics(q)


def special(seed: int) -> np.ndarray:
    """Make postures with straight limbs, right angles, points that coincide, are missing or absurdly far."""
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(FIGURE.model), (N, 1))
    limits = FIGURE.limits
    values = np.stack([limits.lower, limits.upper, np.zeros(22), np.full(22, np.pi / 2), np.full(22, -np.pi)])
    q[:, FIGURE.angle_index] = values[rng.integers(0, len(values), (N, 22)), np.arange(22)]
    points = FIGURE.forward_kinematics(q)
    points += rng.choice([0.0, 1e-12, 1e-9, 1e-6, 1e-5], (N, 1, 1)) * rng.normal(size=points.shape)
    for row in range(0, N, 3):
        points[row, rng.integers(19)] = points[row, rng.integers(19)]
    for row in range(1, N, 3):
        points[row, rng.integers(19)] = (np.nan, 1e200, np.inf, 1e9)[rng.integers(4)]
    return points


def places(check: Check, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what the screen says, and what the judge says."""
    own = np.ascontiguousarray(points[:, check.points])
    assert check.rule is not None
    with np.errstate(all="ignore"):
        violated = check.judge(own).violated
        found, presumed = tree.screened([check.rule], [range(own.shape[1])], own, presuming=True)
    screened = found[:, 0]
    if check.rule.presumed:
        assert len(presumed) == (screened >= 0).sum()
        assert not len(presumed) or check.confirm(presumed)
    return screened, np.where(violated.any(axis=1), violated.argmax(axis=1), NO_VIOLATION)


@pytest.mark.parametrize("tolerance", SUITES)
@pytest.mark.parametrize("index", range(len(NAMES)), ids=NAMES)
def test_a_screen_never_contradicts_the_judge(tolerance: float, index: int) -> None:
    check = SUITES[tolerance][index]
    for points in (postures(index), special(index)):
        screened, judged = places(check, points)
        clear = screened != NOT_CLEAR
        np.testing.assert_array_equal(screened[clear], judged[clear])


@pytest.mark.parametrize("index", range(len(NAMES)), ids=NAMES)
def test_a_screen_is_hardly_ever_unsure_of_ordinary_postures(index: int) -> None:
    points = np.concatenate([postures(100 + index), FIGURE.neutral_points[None]])
    screened, judged = places(SUITES[1e-3][index], points)
    assert (screened == NOT_CLEAR).mean() < 0.03
    if SUITES[1e-3][index].name == "joint_range":
        assert (judged >= 0).any() and (judged == NO_VIOLATION).any()


def test_bodies_that_may_overlap_by_more_than_their_radii_are_clear() -> None:
    points = np.concatenate([postures(5), special(6)])
    for check in collision(FIGURE, contact_margin=-1.0):
        screened, judged = places(check, points)
        clear = screened != NOT_CLEAR
        np.testing.assert_array_equal(screened[clear], judged[clear])
        assert clear[:N].all() and (judged == NO_VIOLATION).all()


def test_the_polar_factor_is_the_best_rotation() -> None:
    rng = np.random.default_rng(0)
    body = rng.normal(size=(5, 3))
    for _ in range(20):
        seen = rng.normal(size=(5, 3))
        expected = fit_rotation(body, seen[None])[0]
        w = np.empty(NUMBERS_AT)
        w[TURN_AT : TURN_AT + 9] = np.einsum("pi,pj->ij", seen, body).ravel()
        if angle_kernels.polar(w):
            X = w[TURN_AT : TURN_AT + 9].reshape(3, 3)
            np.testing.assert_allclose(X, expected, rtol=0, atol=1e-11)
            np.testing.assert_allclose(X @ X.T, np.eye(3), rtol=0, atol=1e-12)


def test_a_mirrored_or_flat_head_is_not_clear() -> None:
    w = np.empty(NUMBERS_AT)
    for C in (np.diag([1.0, 1.0, -1.0]), np.diag([1.0, 1.0, 0.0]), np.zeros((3, 3)), np.full((3, 3), np.nan)):
        w[TURN_AT : TURN_AT + 9] = C.ravel()
        assert not angle_kernels.polar(w)


@pytest.mark.parametrize("off", [-1e-3, -1e-9, -1e-13, 0.0, 1e-13, 1e-9, 1e-3])
def test_a_distance_at_its_bound_is_left_to_the_judge(off: float) -> None:
    rng = np.random.default_rng(7)
    for check in rigid_parts(FIGURE, tolerance=0.01, mode="distances"):
        a, b = check.points
        points = postures(8, 20) + rng.normal(size=(20, 1, 3))
        along = points[:, b] - points[:, a]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        points[:, b] = points[:, a] + along / length * (length + 0.01 + off)
        screened, judged = places(check, points)
        clear = screened != NOT_CLEAR
        assert clear.all() == (abs(off) > 1e-12)
        np.testing.assert_array_equal(screened[clear], judged[clear])


@pytest.mark.parametrize("bend", [0.0, 1e-9, 1e-7, 3e-6])
@pytest.mark.parametrize("tolerance", [1e-3, 3.0])
def test_straight_limbs_are_clear_where_their_rotation_is_not_judged(bend: float, tolerance: float) -> None:
    """Elbows and knees of real motion are often straight to rounding."""
    rng = np.random.default_rng(9)
    q = np.tile(pin.neutral(FIGURE.model), (N, 1))
    q[:, FIGURE.angle_index] = rng.uniform(FIGURE.limits.lower, FIGURE.limits.upper, (N, 22))
    hinges = [
        DOFS.index(f"{side}_{hinge}.flexion") for side in ("right", "left") for hinge in ("elbow", "knee")
    ]
    q[:, FIGURE.angle_index[hinges]] = bend
    points = FIGURE.forward_kinematics(q)
    for check in SUITES[tolerance]:
        if len(check.where) == 4:
            screened, judged = places(check, points)
            clear = screened != NOT_CLEAR
            np.testing.assert_array_equal(screened[clear], judged[clear])
            assert clear.mean() > (0.95 if 7 * bend < np.radians(tolerance) else -1)
