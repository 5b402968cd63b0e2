"""Collision: the closed-form distance against coal's, verdicts against Pinocchio's over the whole body."""

import math
from fractions import Fraction
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.body.capsules import Capsule
from posekit.skeleton import HEAD, JOINT, JOINTS, POINTS
from posekit.validators import collision
from posekit.validators.collision import CONTACT_TOLERANCE, PairCollision, segment_distance

FIGURE = load_figure()
PAIRS = [f"{FIGURE.capsules[i].link}-{FIGURE.capsules[j].link}" for i, j in FIGURE.collision_pairs]


def configurations(n: int, *, wild: bool = False, seed: int = 11) -> np.ndarray:
    """Draw configurations inside the limits, or with any angles at all."""
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    q[:, :3] = rng.normal(size=(n, 3)) * 0.3 + [0, 0, 4]
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = FIGURE.limits
    inside = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    q[:, FIGURE.angle_index] = rng.uniform(-np.pi, np.pi, (n, 22)) if wild else inside
    return q


def distances(points: np.ndarray, *, contact_margin: float = 0.0, exact: bool = True) -> np.ndarray:
    checks = collision(FIGURE, contact_margin=contact_margin, exact=exact)
    return np.concatenate([c.judge(points[:, c.points]).value for c in checks], axis=1)


def verdicts(points: np.ndarray, *, contact_margin: float = 0.0, exact: bool = False) -> np.ndarray:
    checks = collision(FIGURE, contact_margin=contact_margin, exact=exact)
    return np.concatenate([c.judge(points[:, c.points]).violated for c in checks], axis=1)


def pinocchio_distances(q: np.ndarray) -> np.ndarray:
    """Ask coal for every pair of the whole body, through Pinocchio (n, pairs)."""
    model, geometry = FIGURE.model, FIGURE.geometry
    data, geometry_data = model.createData(), geometry.createData()
    found = np.empty((len(q), len(geometry.collisionPairs)))
    for k, row in enumerate(q):
        pin.computeDistances(model, data, geometry, geometry_data, row)
        found[k] = [result.min_distance for result in geometry_data.distanceResults]
    return found


def coal_distance(gap: np.ndarray, half_a: np.ndarray, half_b: np.ndarray, radii: float) -> float:
    placed = []
    for half, middle, radius in ((half_a, np.zeros(3), radii / 3), (half_b, gap, 2 * radii / 3)):
        length = float(np.linalg.norm(half))
        R = pin.Quaternion.FromTwoVectors(np.array([0.0, 0, 1]), half / length).toRotationMatrix()
        placed += [coal.Capsule(radius, 2 * length), coal.Transform3s(R, middle)]
    return float(coal.distance(*placed, coal.DistanceRequest(), coal.DistanceResult()))


def assert_distance_is_coals(gap: np.ndarray, half_a: np.ndarray, half_b: np.ndarray, radii: float) -> None:
    ours = segment_distance(gap[None], half_a[None], half_b[None])[0] - radii
    assert ours == pytest.approx(coal_distance(gap, half_a, half_b, radii), abs=1e-12)


def test_the_distance_of_random_capsules_is_coals(rng: np.random.Generator) -> None:
    deep = 0
    for _ in range(500):
        gap, half_a, half_b = rng.normal(size=(3, 3)) * rng.choice([0.02, 0.1, 0.5], (3, 1))
        radii = float(rng.uniform(0.01, 0.3))
        assert_distance_is_coals(gap, half_a, half_b, radii)
        deep += coal_distance(gap, half_a, half_b, radii) < 0
    assert 100 < deep < 400


@pytest.mark.parametrize("along", [0.0, 0.1, 0.35, 0.5])
@pytest.mark.parametrize("apart", [0.0, 1e-9, 0.03, 0.2])
def test_the_distance_of_parallel_capsules_is_coals(along: float, apart: float) -> None:
    half_a, half_b = np.array([0.0, 0.0, 0.2]), np.array([0.0, 0.0, 0.15])
    assert_distance_is_coals(np.array([apart, 0.0, along]), half_a, half_b, 0.1)


def exact_distance(gap: np.ndarray, half_a: np.ndarray, half_b: np.ndarray) -> float:
    """Minimise over the square of s and t in rational numbers: its inside, then its four edges."""

    def dot(u: list[Fraction], v: list[Fraction]) -> Fraction:
        return sum((x * y for x, y in zip(u, v, strict=True)), Fraction())

    def clamp(x: Fraction) -> Fraction:
        return max(Fraction(-1), min(Fraction(1), x))

    g, a, b = ([Fraction(float(x)) for x in vector] for vector in (gap, half_a, half_b))
    aa, bb, ab, ag, bg = dot(a, a), dot(b, b), dot(a, b), dot(a, g), dot(b, g)
    places = [(clamp((ag + t * ab) / aa), Fraction(t)) for t in (-1, 1)]
    places += [(Fraction(s), clamp((s * ab - bg) / bb)) for s in (-1, 1)]
    if determinant := aa * bb - ab * ab:
        s = (ag * bb - ab * bg) / determinant
        places += [(s, t) for t in [(s * ab - bg) / bb] if max(abs(s), abs(t)) <= 1]
    apart = [[gi + t * bi - s * ai for gi, bi, ai in zip(g, b, a, strict=True)] for s, t in places]
    return math.sqrt(min(dot(vector, vector) for vector in apart))


@pytest.mark.parametrize("tilt", [0.0, 1e-15, 1e-12, 1e-10, 1e-8, 1e-7, 1e-6, 1e-5, 1e-3])
@pytest.mark.parametrize("apart", [0.0, 1e-9, 0.03, 0.2])
def test_the_distance_of_nearly_parallel_segments_keeps_its_digits(tilt: float, apart: float) -> None:
    # Coal's own is up to 1.5e-7 m off here, where the axes all but cross: the arithmetic of fractions is not.
    half_a = np.array([0.0, 0.0, 0.2])
    for sign in (-1, 1):
        half_b = sign * 0.15 * np.array([np.sin(tilt), 0.0, np.cos(tilt)])
        for along in (0.0, 0.1, 0.35, 0.5):
            gap = np.array([apart, 0.0, along])
            found = segment_distance(gap[None], half_a[None], half_b[None])[0]
            assert found == pytest.approx(exact_distance(gap, half_a, half_b), abs=1e-15)


def test_the_distance_of_random_segments_keeps_its_digits(rng: np.random.Generator) -> None:
    for _ in range(300):
        gap, half_a, half_b = rng.normal(size=(3, 3)) * rng.choice([0.02, 0.1, 0.5], (3, 1))
        if rng.random() < 0.5:
            half_b = half_a * rng.normal() + rng.normal(size=3) * 10.0 ** rng.uniform(-14, -3)
        found = segment_distance(gap[None], half_a[None], half_b[None])[0]
        assert found == pytest.approx(exact_distance(gap, half_a, half_b), abs=1e-14)


@pytest.mark.parametrize(
    ("gap", "half_b", "expected"),
    [
        ([0, 0, 0], [0.1, 0, 0], 0.0),
        ([0, 0.3, 0], [0.1, 0, 0], 0.3),
        ([0, 0, 0.5], [0, 0, 0.1], 0.2),
        ([0, 0, 0.3], [0, 0, 0.1], 0.0),
        ([0, 0, 0], [0, 0, 0.2], 0.0),
        ([0.3, 0, 0], [0.1, 0, 0], 0.2),
        ([0, 0.4, 0.5], [0.1, 0, 0], 0.5),
    ],
)
def test_the_distance_of_segments_by_hand(gap: list[float], half_b: list[float], expected: float) -> None:
    half_a = np.array([[0.0, 0.0, 0.2]])
    found = segment_distance(np.array([gap], dtype=float), half_a, np.array([half_b], dtype=float))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)


@given(numbers=st.lists(st.floats(-0.5, 0.5, allow_subnormal=False), min_size=9, max_size=9))
def test_no_two_points_of_the_segments_are_nearer(numbers: list[float]) -> None:
    gap, half_a, half_b = np.array(numbers).reshape(3, 3)
    half_a, half_b = half_a + np.array([0.6, 0, 0]), half_b + np.array([0, 0.6, 0])
    found = segment_distance(gap[None], half_a[None], half_b[None])[0]
    s, t = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    grid = np.linalg.norm(gap + t[..., None] * half_b - s[..., None] * half_a, axis=-1)
    assert found <= grid.min() + 1e-12
    assert found >= grid.min() - 0.05
    swapped = segment_distance(-gap[None], half_b[None], half_a[None])[0]
    assert found == pytest.approx(swapped, abs=1e-12)


@pytest.mark.parametrize("wild", [False, True])
def test_distances_are_those_of_the_whole_body(wild: bool) -> None:
    q = configurations(200, wild=wild)
    np.testing.assert_allclose(
        distances(FIGURE.forward_kinematics(q)), pinocchio_distances(q), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("wild", [False, True])
@pytest.mark.parametrize("exact", [False, True])
def test_verdicts_are_those_of_the_whole_body(wild: bool, exact: bool) -> None:
    q = configurations(3000, wild=wild)
    pool = pin.GeometryPool(FIGURE.model, FIGURE.geometry, 1)
    whole = np.asarray(pin.computeCollisionsInParallel(1, pool, np.asfortranarray(q.T), True)).astype(bool)
    ours = verdicts(FIGURE.forward_kinematics(q), exact=exact).any(axis=1)
    np.testing.assert_array_equal(ours, whole)
    assert 0.1 < ours.mean() < 0.95


@pytest.mark.parametrize("contact_margin", [-0.3, -0.15, -0.06, -0.01, 0.0, 0.02, 0.2])
def test_a_verdict_is_a_distance_below_the_margin(contact_margin: float) -> None:
    q = configurations(300, wild=True)
    points = FIGURE.forward_kinematics(q)
    distance = pinocchio_distances(q)
    # Deeper than both radii the axes cross, and there is no deeper.
    clear = np.abs(distance - contact_margin) > 2 * CONTACT_TOLERANCE
    np.testing.assert_array_equal(
        verdicts(points, contact_margin=contact_margin)[clear], (distance < contact_margin)[clear]
    )


def test_a_larger_margin_never_rejects_less() -> None:
    points = FIGURE.forward_kinematics(configurations(1000, wild=True))
    rejected = [verdicts(points, contact_margin=m) for m in (-0.2, -0.1, -0.05, -0.01, 0.0, 0.01, 0.05, 0.2)]
    for smaller, larger in pairwise(rejected):
        assert (larger | ~smaller).all()
        assert larger.sum() > smaller.sum()


@pytest.mark.parametrize("contact_margin", [-0.03, 0.0, 0.03])
def test_the_exact_flag_changes_no_verdict_and_never_lowers_a_value(contact_margin: float) -> None:
    points = FIGURE.forward_kinematics(configurations(1000, wild=True))
    np.testing.assert_array_equal(
        verdicts(points, contact_margin=contact_margin),
        verdicts(points, contact_margin=contact_margin, exact=True),
    )
    quick = distances(points, contact_margin=contact_margin, exact=False)
    assert not any(
        check.exact or check.contact_margin for check in collision(FIGURE) if isinstance(check, PairCollision)
    )
    exact = distances(points, contact_margin=contact_margin)
    assert (quick <= exact + 1e-12).all()
    rejected = verdicts(points, contact_margin=contact_margin)
    np.testing.assert_array_equal(quick[rejected], exact[rejected])


@pytest.mark.parametrize(
    ("depth", "rejected"), [(-1e-6, False), (-2e-9, False), (0.0, False), (2e-9, True), (1e-6, True)]
)
@pytest.mark.parametrize("contact_margin", [-0.02, 0.0, 0.05])
def test_two_capsules_just_pass_and_just_fail(depth: float, rejected: bool, contact_margin: float) -> None:
    a = Capsule(link="a", start=(0,), end=(1,), center=0.2, half_length=0.15, radius=0.05)
    b = Capsule(link="b", start=(2,), end=(3,), center=0.2, half_length=0.15, radius=0.04)
    check = PairCollision(a=a, b=b, contact_margin=contact_margin, exact=True)
    x = 0.09 + contact_margin - depth
    points = np.array([[[0, 0, 0], [0, 0, 0.4], [x, 0, 0.1], [x, 0, 0.5]]])
    findings = check.judge(points)
    assert findings.violated[0, 0] == rejected
    assert findings.value[0, 0] == pytest.approx(contact_margin - depth, abs=1e-14)
    assert findings.margin[0, 0] == pytest.approx(-depth, abs=1e-14)


def test_a_capsule_lies_on_the_postures_own_points(rng: np.random.Generator) -> None:
    q = configurations(50)
    model, geometry = FIGURE.model, FIGURE.geometry
    data, geometry_data = model.createData(), geometry.createData()
    points = FIGURE.forward_kinematics(q)
    for k, row in enumerate(q):
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, row)
        for capsule, placement in zip(FIGURE.capsules, geometry_data.oMg, strict=True):
            middle, axis = capsule.place(points[k : k + 1, capsule.points])
            np.testing.assert_allclose(middle[0], placement.translation, rtol=0, atol=1e-9)
            assert abs(axis[0] @ placement.rotation[:, 2]) == pytest.approx(1, abs=1e-9)


def test_what_is_checked_is_what_the_figure_says() -> None:
    assert [check.where[0] for check in collision(FIGURE)] == PAIRS
    arms = [f"{side}_{part}" for side in ("right", "left") for part in ("upper_arm", "forearm")]
    legs = [f"{side}_{part}" for side in ("right", "left") for part in ("thigh", "shank")]
    wanted = {(arm, other) for arm in arms for other in ("torso", "head", *legs)}
    wanted |= {(f"{side}_forearm", "hips") for side in ("right", "left")}
    wanted |= {
        (f"right_{a}", f"left_{b}")
        for group in (("upper_arm", "forearm"), ("thigh", "shank"))
        for a in group
        for b in group
    }
    checked = {frozenset(pair.split("-")) for pair in PAIRS}
    assert checked == {frozenset(pair) for pair in wanted}


def test_standing_and_sitting_are_free_of_collision_and_folded_arms_are_not() -> None:
    neutral = FIGURE.neutral_points[None]
    assert not verdicts(neutral).any()
    through = neutral.copy()
    through[0, JOINT["right_wrist"]] = through[0, JOINT["pelvis"]] + [0.0, 0.0, 0.2]
    hit = verdicts(through)[0]
    assert "torso-right_forearm" in [pair for pair, bad in zip(PAIRS, hit, strict=True) if bad]


def test_the_mirror_image_has_the_mirrored_verdicts() -> None:
    points = FIGURE.forward_kinematics(configurations(1000, wild=True))
    other = [name.replace("right", "L").replace("left", "right").replace("L", "left") for name in POINTS]
    mirrored = (points * [-1, 1, 1])[:, [POINTS.index(name) for name in other]]
    np.testing.assert_array_equal(verdicts(points).any(axis=1), verdicts(mirrored).any(axis=1))
    np.testing.assert_allclose(
        distances(points).min(axis=1), distances(mirrored).min(axis=1), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("missing", POINTS)
def test_a_missing_point_never_collides_and_is_undecided(missing: str, exact: bool) -> None:
    points = FIGURE.forward_kinematics(configurations(30, wild=True))
    k = POINTS.index(missing)
    points[:, k] = np.nan
    for check in collision(FIGURE, exact=exact):
        findings = check.judge(points[:, check.points])
        assert (findings.undecided == (k in check.points)).all()
        assert not findings.violated[findings.undecided].any()


def test_without_the_head_nothing_collides_with_it() -> None:
    points = FIGURE.forward_kinematics(configurations(500, wild=True))
    whole = verdicts(points)
    points[:, HEAD] = np.nan
    without = verdicts(points)
    with_head = np.array(["head" in pair for pair in PAIRS])
    assert whole[:, with_head].any()
    assert not without[:, with_head].any()
    np.testing.assert_array_equal(without[:, ~with_head], whole[:, ~with_head])


def test_a_segment_of_no_length_is_undecided_without_a_warning() -> None:
    points = FIGURE.neutral_points[None].copy()
    points[:, JOINT["right_wrist"]] = points[:, JOINT["right_elbow"]]
    for check in collision(FIGURE, exact=True):
        findings = check.judge(points[:, check.points])
        assert (findings.undecided == ("right_forearm" in check.where[0])).all()
        assert not findings.violated.any()


def test_a_large_batch_is_judged_as_its_parts() -> None:
    points = FIGURE.forward_kinematics(configurations(1500, wild=True))
    check = next(c for c in collision(FIGURE) if c.where[0] == "torso-right_forearm")
    many = np.tile(points, (4, 1, 1))[:, check.points]
    together = check.judge(many).violated
    alone = check.judge(points[:, check.points]).violated
    np.testing.assert_array_equal(together, np.tile(alone, (4, 1)))


def test_no_postures_have_no_collisions() -> None:
    assert verdicts(np.empty((0, len(POINTS), 3))).shape == (0, len(PAIRS))
    assert len(JOINTS) == 14
