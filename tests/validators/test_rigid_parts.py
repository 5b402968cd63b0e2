"""Rigid parts: just passes, just fails, and the mirror image that distances cannot tell."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import Figure, load_figure
from posekit.body.frames import torso_frame
from posekit.errors import InputError
from posekit.settings import RigidTolerance
from posekit.skeleton import JOINT, RIGID_SEGMENTS, SEGMENTS, TORSO, segment_name
from posekit.tree import Findings
from posekit.validators import Validator, load_ranges, make_checks, rigid_parts
from posekit.validators.rigid_parts import TORSO_POINTS, Mode, TorsoSide

FIGURE = load_figure()
NAMES = tuple(segment_name(segment) for segment in RIGID_SEGMENTS)


def postures(n: int, seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    q[:, :3] = rng.normal(size=(n, 3)) * 0.3 + [0, 0, 4]
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = FIGURE.limits
    q[:, FIGURE.angle_index] = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    return FIGURE.forward_kinematics(q)


EACH = RigidTolerance(shoulders=0.01, sides=0.04, hips=0.02)


def _with(name: str, tolerance: float) -> RigidTolerance:
    changed: dict[str, Any] = {name: tolerance}
    return replace(EACH, **changed)


OWN = dict(zip(NAMES, (0.01, 0.04, 0.04, 0.02), strict=True))


def judge(
    points: np.ndarray, *, tolerance: float | RigidTolerance, mode: Mode = "placement"
) -> dict[str, Findings]:
    return {
        check.where[0]: check.judge(points[:, check.points])
        for check in rigid_parts(FIGURE, tolerance=tolerance, mode=mode)
    }


def violated(points: np.ndarray, *, tolerance: float, mode: Mode = "placement") -> list[str]:
    return [
        name
        for name, findings in judge(points, tolerance=tolerance, mode=mode).items()
        if findings.violated.any()
    ]


@pytest.mark.parametrize("mode", ["distances", "placement"])
def test_the_figures_own_postures_pass(mode: Mode) -> None:
    assert violated(postures(200), tolerance=1e-12, mode=mode) == []


def test_distances_are_judged_in_four_places_and_the_torso_in_one_more() -> None:
    assert tuple(judge(postures(1), tolerance=0.01, mode="distances")) == NAMES
    assert tuple(judge(postures(1), tolerance=0.01)) == (*NAMES, "torso")


@pytest.mark.parametrize("segment", RIGID_SEGMENTS)
@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(("off", "passes"), [(0.00999, True), (0.01001, False)])
def test_a_distance_just_passes_and_just_fails(
    segment: tuple[int, int], sign: int, off: float, passes: bool
) -> None:
    points = postures(20)
    a, b = segment
    along = points[:, b] - points[:, a]
    points[:, b] += sign * off * along / np.linalg.norm(along, axis=1, keepdims=True)
    findings = judge(points, tolerance=0.01, mode="distances")[segment_name(segment)]
    assert (findings.violated == (not passes)).all()
    np.testing.assert_allclose(
        findings.value[:, 0] - FIGURE.lengths[segment_name(segment)], sign * off, atol=1e-12
    )
    np.testing.assert_allclose(findings.margin[:, 0], 0.01 - off, rtol=0, atol=1e-12)


def test_the_mirror_image_is_told_apart_by_placement_alone() -> None:
    mirrored = postures(50) * [-1, 1, 1]
    assert violated(mirrored, tolerance=1e-12, mode="distances") == []
    torso = judge(mirrored, tolerance=0.05)["torso"]
    assert torso.violated.all()
    # The shoulders lie 3.742 cm behind the spine instead of in front of it.
    np.testing.assert_allclose(torso.value, 2 * 0.037420243, rtol=0, atol=1e-8)


BEHIND = FIGURE.scaled({}, behind=True)
UNKNOWN = replace(FIGURE, side_known=False)
OFFSET = FIGURE.shoulder_offset


def side(figure: Figure, points: np.ndarray, *, tolerance: float, mode: Mode = "side") -> Findings:
    check = rigid_parts(figure, tolerance=tolerance, mode=mode)[-1]
    return check.judge(points[:, check.points])


@pytest.mark.parametrize("tolerance", [0.0, 1e-3, 0.01, 0.03, 0.07])
def test_the_side_tells_a_mirror_image_within_any_tolerance_that_is_less_than_it(tolerance: float) -> None:
    points = postures(50)
    assert not side(FIGURE, points, tolerance=tolerance + 1e-12).violated.any()
    assert side(FIGURE, points * [-1, 1, 1], tolerance=tolerance).violated.all()
    assert side(BEHIND, points, tolerance=tolerance).violated.all()
    assert not side(BEHIND, points * [-1, 1, 1], tolerance=tolerance + 1e-12).violated.any()


@pytest.mark.parametrize("figure", [FIGURE, BEHIND])
def test_the_side_is_told_by_how_far_shoulders_are_on_it(figure: Figure) -> None:
    for sign in (1.0, -1.0):
        points = postures(5) * [sign * np.sign(OFFSET * figure.shoulder_offset), 1.0, 1.0]
        value = side(figure, points, tolerance=0.001).value
        np.testing.assert_allclose(value, sign * abs(figure.shoulder_offset), atol=1e-9)


def test_a_side_that_the_tolerance_covers_is_undecided() -> None:
    for sign in (1, -1):
        assert side(FIGURE, postures(5) * [sign, 1, 1], tolerance=2 * OFFSET + 1e-9).undecided.all()


def test_a_mirror_image_is_told_apart_by_more_than_the_tolerance() -> None:
    points = postures(3)[:, list(TORSO_POINTS)]
    for tolerance, told in ((0.02, False), (np.nextafter(0.02, 0), True)):
        check = TorsoSide(offset=0.01, tolerance=tolerance)
        assert check.judge(points).undecided.all() != told
        assert np.isinf(check.rule.numbers[1]) != told


@pytest.mark.parametrize("mode", ["side", "placement"])
def test_a_side_that_the_figure_does_not_know_is_undecided_and_rejects_nothing(mode: Mode) -> None:
    points = postures(20)
    mirrored = side(UNKNOWN, points * [-1, 1, 1], tolerance=1e-3, mode=mode)
    assert mirrored.undecided.all()
    assert not mirrored.violated.any()
    own = side(UNKNOWN, points, tolerance=1e-3, mode=mode)
    assert not own.violated.any()
    assert own.undecided.all() == (mode == "side")
    # Neither the torso nor its mirror image fits one whose pelvis is elsewhere.
    points[:, JOINT["pelvis"]] *= 1.1
    assert side(UNKNOWN, points, tolerance=1e-3, mode="placement").violated.all()


@pytest.mark.parametrize("tolerance", [0.01, OFFSET, 0.06])
def test_shoulders_may_be_behind_by_what_the_tolerance_is_more_than_their_offset(tolerance: float) -> None:
    points = postures(20)
    R = torso_frame(*np.moveaxis(points[:, [JOINT[name] for name in TORSO]], 1, 0))
    least = min(OFFSET - tolerance, 0.0)
    for beyond, rejected in ((1e-6, False), (-1e-6, True)):
        moved = points.copy()
        for joint in ("right_shoulder", "left_shoulder"):
            moved[:, JOINT[joint]] += (least + beyond - OFFSET) * R[:, :, 0]
        found = side(FIGURE, moved, tolerance=tolerance)
        assert (found.violated == rejected).all()
        np.testing.assert_allclose(found.value, least + beyond, rtol=0, atol=1e-12)


def test_a_looser_tolerance_never_rejects_a_side_more(rng: np.random.Generator) -> None:
    points = postures(200) + rng.normal(size=(200, 19, 3)) * 0.03
    rejected = [
        side(FIGURE, points, tolerance=tolerance).violated[:, 0] for tolerance in (0, 0.02, 0.04, 0.06, 0.08)
    ]
    for strict, loose in pairwise(rejected):
        assert (strict | ~loose).all()
    assert rejected[0].any()
    assert not rejected[-1].any()


def test_a_validator_rejects_the_mirror_image_of_a_measured_torso(rng: np.random.Generator) -> None:
    measured = postures(30)[:, :14] + 1e-4 * rng.normal(size=(30, 14, 3))
    for tolerance in (0.001, 0.01, 0.03):
        validator = Validator(rigid_tolerance=tolerance, checks=("rigid-parts",), strict=True)
        assert validator.check(measured).valid.all()
        report = validator.check(measured * [-1, 1, 1])
        assert report.invalid.all()
        assert report.fk_distance.min() > 0.07
        assert (
            Validator(UNKNOWN, rigid_tolerance=tolerance, checks=("rigid-parts",))
            .check(measured * [-1, 1, 1])
            .valid.all()
        )


def test_a_validator_by_medians_takes_the_side_that_positions_show(rng: np.random.Generator) -> None:
    measured = postures(30)[:, :14] * [-1, 1, 1] + 1e-4 * rng.normal(size=(30, 14, 3))
    report = Validator(rigid_tolerance=0.001, checks=("rigid-parts",), lengths="median").check(measured)
    assert report.valid.all()
    assert report.fk_distance.max() < 0.005


def test_a_flat_torso_is_its_own_mirror_image() -> None:
    flat = FIGURE.scaled({"right_shoulder-left_shoulder": 2 * np.sqrt(0.205**2 - 0.004740820734341**2)})
    check = rigid_parts(flat, tolerance=1e-4)[-1]
    points = flat.neutral_points[None] * [-1, 1, 1]
    assert not check.judge(points[:, check.points]).violated.any()


@pytest.mark.parametrize("tolerance", [1e-4, 1e-2])
@pytest.mark.parametrize(("factor", "passes"), [(0.999, True), (1.001, False)])
def test_a_torso_point_just_passes_and_just_fails(tolerance: float, factor: float, passes: bool) -> None:
    # The pelvis moved along the spine leaves the frame as it is: it alone is off, by as much.
    points = postures(20)
    neck, pelvis = points[:, JOINT["neck"]], points[:, JOINT["pelvis"]]
    down = (pelvis - neck) / np.linalg.norm(pelvis - neck, axis=1, keepdims=True)
    points[:, JOINT["pelvis"]] += factor * tolerance * down
    torso = judge(points, tolerance=tolerance)["torso"]
    np.testing.assert_allclose(torso.value, factor * tolerance, rtol=0, atol=1e-12)
    assert (torso.violated == (not passes)).all()


def test_a_looser_tolerance_never_rejects_more(rng: np.random.Generator) -> None:
    points = postures(200) + rng.normal(size=(200, 19, 3)) * 0.01
    rejected = []
    for tolerance in (0.0, 0.005, 0.01, 0.02, 0.05, 0.2):
        findings = judge(points, tolerance=tolerance).values()
        rejected.append(np.any([f.violated[:, 0] for f in findings], axis=0))
    for strict, loose in pairwise(rejected):
        assert (strict | ~loose).all()
    assert rejected[0].all()
    assert not rejected[-1].any()


@pytest.mark.parametrize("missing", TORSO)
def test_a_missing_joint_leaves_its_places_undecided(missing: str) -> None:
    points = postures(5)
    points[:, JOINT[missing]] = np.nan
    for name, findings in judge(points, tolerance=1e-9).items():
        reads = name == "torso" or missing in name.split("-")
        assert (findings.undecided == reads).all()
        assert not findings.violated.any()


def test_a_collapsed_torso_is_rejected_without_a_warning() -> None:
    assert set(NAMES) <= set(violated(np.zeros((1, 19, 3)), tolerance=0.1))


@pytest.mark.parametrize("segment", RIGID_SEGMENTS)
@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(("share", "passes"), [(0.999, True), (1.001, False)])
def test_each_distance_has_its_own_tolerance(
    segment: tuple[int, int], sign: int, share: float, passes: bool
) -> None:
    points = postures(20)
    a, b = segment
    along = points[:, b] - points[:, a]
    own = OWN[segment_name(segment)]
    points[:, b] += sign * share * own * along / np.linalg.norm(along, axis=1, keepdims=True)
    findings = judge(points, tolerance=EACH, mode="distances")[segment_name(segment)]
    assert (findings.violated == (not passes)).all()
    np.testing.assert_allclose(findings.margin[:, 0], own * (1 - share), rtol=0, atol=1e-12)


@pytest.mark.parametrize("mode", ["distances", "placement"])
def test_one_tolerance_is_the_same_for_every_distance(mode: Mode, rng: np.random.Generator) -> None:
    points = postures(100) + rng.normal(size=(100, 19, 3)) * 0.01
    each = judge(points, tolerance=RigidTolerance.uniform(0.015), mode=mode)
    for name, findings in judge(points, tolerance=0.015, mode=mode).items():
        np.testing.assert_array_equal(findings.violated, each[name].violated)
        np.testing.assert_array_equal(findings.margin, each[name].margin)


@pytest.mark.parametrize("name", ["shoulders", "sides", "hips"])
def test_a_looser_tolerance_of_one_distance_never_rejects_more(name: str, rng: np.random.Generator) -> None:
    points = postures(200) + rng.normal(size=(200, 19, 3)) * 0.01
    rejected = []
    for tolerance in (0.0, 0.01, 0.03, 0.2):
        findings = judge(points, tolerance=_with(name, tolerance), mode="distances").values()
        rejected.append(np.any([f.violated[:, 0] for f in findings], axis=0))
    for strict, loose in pairwise(rejected):
        assert (strict | ~loose).all()
    assert rejected[0].sum() > rejected[-1].sum()


def test_what_is_none_of_the_four_may_be_off_by_the_widest() -> None:
    checks = rigid_parts(FIGURE, tolerance=EACH, limbs=True)
    allowed = {check.where[0]: check.tolerance for check in checks}  # type: ignore[attr-defined]
    assert allowed == {
        **{segment_name(segment): 0.04 for segment in SEGMENTS},
        **OWN,
        "torso": 0.04,
    }


def test_a_segment_may_have_a_tolerance_of_its_own() -> None:
    forearm = (JOINT["right_elbow"], JOINT["right_wrist"])
    checks = rigid_parts(FIGURE, tolerance=replace(EACH, own=((forearm, 0.001),)), limbs=True)
    allowed = {check.where[0]: check.tolerance for check in checks}  # type: ignore[attr-defined]
    assert allowed["right_elbow-right_wrist"] == 0.001
    assert allowed["left_elbow-left_wrist"] == 0.04
    with pytest.raises(InputError, match="expected zero or a positive, finite number"):
        replace(EACH, own=((forearm, np.nan),))


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.001])
@pytest.mark.parametrize("name", ["shoulders", "sides", "hips"])
def test_a_tolerance_that_is_no_length_is_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=rf"the rigid tolerance of {name} is {value!r} m; expected zero or"):
        _with(name, value)


def test_a_suite_takes_one_tolerance_or_one_each() -> None:
    ranges = load_ranges("urdf")
    points = postures(1)
    points[:, JOINT["left_hip"]] *= 1.003  # 1 to 2 cm along the ray
    for tolerance, passes in ((0.03, True), (0.001, False), (EACH, True), (replace(EACH, hips=0.001), False)):
        checks = make_checks(FIGURE, ["rigid-parts"], ranges=ranges, rigid_tolerance=tolerance)
        rejected = any(check.judge(points[:, check.points]).violated.any() for check in checks)
        assert rejected == (not passes)
