"""Hidden joints: the truth lies in the sets, representatives pass every check, and brute force agrees."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.geometry import unit
from posekit.hidden import (
    CompletedSurvivors,
    CompletionOutcome,
    OcclusionSampling,
    PositionKind,
    Region,
    complete,
    limb_combinations,
    reject,
)
from posekit.skeleton import JOINT, JOINTS, PARENTS, SIDES, TREE_SEGMENTS, segment_name
from posekit.synthesis import random_views
from posekit.tree import Check, InterpretationTree, Leaves
from posekit.validators import load_ranges, make_checks

FIGURE = load_figure()
LENGTHS = np.array([0.0] + [FIGURE.lengths[segment_name(segment)] for segment in TREE_SEGMENTS])
TREE = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=LENGTHS)
TOLERANCE = 1e-9
ROUNDING = 1e-7
LIMB_JOINTS = [name for name in JOINTS if name.split("_")[-1] in ("elbow", "wrist", "knee", "ankle")]


def suite(names: Sequence[str] = ("rigid-parts", "joint-range", "collision"), **more: Any) -> list[Check]:
    given_: dict[str, Any] = {"ranges": load_ranges("urdf"), "rigid_tolerance": 1e-8} | more
    return make_checks(FIGURE, names, **given_)


CHECKS = suite()


@dataclass(frozen=True)
class Hidden:
    """Random legal postures, seen but for some joints, and what is made of them."""

    camera: Camera
    truth: np.ndarray
    head: np.ndarray
    image: np.ndarray
    leaves: Leaves
    done: CompletedSurvivors
    checks: Sequence[Check]

    @property
    def true(self) -> np.ndarray:
        """The survivors that agree with the truth in all exact joints."""
        apart = np.abs(self.leaves.postures() - self.truth[self.leaves.frame]).max(axis=-1)
        return np.flatnonzero(np.fmax.reduce(apart, axis=1) < 1e-6)

    @property
    def points(self) -> np.ndarray:
        return np.concatenate([self.done.postures, self.head[self.leaves.frame]], axis=1)


def hide(
    hidden: Sequence[str] | Sequence[Sequence[str]],
    *,
    seed: int = 0,
    n: int = 6,
    checks: Sequence[Check] = CHECKS,
    sampling: OcclusionSampling | None = None,
    tolerance: float = TOLERANCE,
    noise: float = 0.0,
) -> Hidden:
    """Grow the trees of random views without some joints, the same in all frames or some for each."""
    rng = np.random.default_rng(seed)
    scene = random_views(FIGURE, n, rng, ranges="urdf")
    if noise:
        scene = scene.with_noise(noise, rng)
    image = scene.image.copy()
    for frame in range(n):
        names = hidden if not hidden or isinstance(hidden[0], str) else hidden[frame]
        image[frame, [JOINT[str(name)] for name in names]] = np.nan
    camera, root = scene.camera, scene.joints_cam[:, 0]
    leaves = TREE.grow(camera, root, image, checks, given=scene.head_cam, tolerance=tolerance)
    done = complete(leaves, camera, image, FIGURE, checks, tolerance=tolerance, sampling=sampling)
    return Hidden(camera, scene.joints_cam, scene.head_cam, image, leaves, done, checks)


def outside(region: Region, truth: np.ndarray) -> float:
    """How far (m) a position is outside what is said of it, the box or the ball about the representative."""
    beyond = np.maximum(region.lower - truth, truth - region.upper).max()
    return float(max(beyond, np.linalg.norm(truth - region.representative) - region.radius))


def check_truth(case: Hidden, *, frames: int | None = None) -> None:
    """The truth is inside every set of the survivors that agree with it on what was seen."""
    true = case.true
    assert len(set(case.leaves.frame[true])) == (len(case.truth) if frames is None else frames)
    for k in true:
        assert case.done.outcome[k] in (CompletionOutcome.COMPLETED, CompletionOutcome.EXACT), (
            case.done.reason(k)
        )
        for region in case.done.regions(k):
            truth = case.truth[case.leaves.frame[k], JOINT[region.joint]]
            assert outside(region, truth) <= region.accuracy + ROUNDING, region


def check_completions(case: Hidden) -> None:
    """Completed postures pass every check, keep all lengths and all rays; known joints are as they were."""
    postures, done = case.leaves.postures(), case.done
    known = np.isfinite(postures)
    assert np.array_equal(done.postures[known], postures[known])
    completed = done.outcome == CompletionOutcome.COMPLETED
    assert completed.any()
    assert np.isfinite(done.postures[completed]).all()
    assert np.isnan(done.postures[~completed][~known[~completed]]).all()
    points = case.points[completed]
    for check in case.checks:
        assert not check.judge(points[:, list(check.points)]).violated.any(), check.where
    lengths = np.linalg.norm(points[:, 1:14] - points[:, list(PARENTS[1:])], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(LENGTHS[1:], lengths.shape), rtol=0, atol=1e-9)
    image = case.image[case.leaves.frame[completed]]
    seen = np.isfinite(image)
    np.testing.assert_allclose(case.camera.project(points[:, :14])[seen], image[seen], rtol=0, atol=1e-8)
    for k in np.flatnonzero(completed):
        for region in done.regions(k):
            assert (region.lower <= region.representative + ROUNDING).all(), region
            assert (region.representative <= region.upper + ROUNDING).all(), region
            assert 0.0 <= region.fraction <= 1.0
            assert region.samples > 0


# --- laws -----------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=6, derandomize=True)
@given(
    hidden=st.lists(st.sampled_from(LIMB_JOINTS), min_size=1, max_size=4, unique=True),
    seed=st.integers(0, 999),
)
def test_hiding_limb_joints_never_loses_the_truth(hidden: list[str], seed: int) -> None:
    case = hide(hidden, seed=seed, n=2)
    check_truth(case)
    check_completions(case)


@pytest.mark.parametrize(
    "hidden",
    [
        ("pelvis",),
        ("right_shoulder",),
        ("left_hip",),
        ("right_shoulder", "left_shoulder"),
        ("right_shoulder", "pelvis"),
        ("right_hip", "left_hip"),
        ("pelvis", "left_hip"),
        ("left_hip", "right_wrist"),
        ("pelvis", "right_hip", "left_hip", "right_knee", "left_knee", "right_ankle", "left_ankle"),
    ],
)
def test_hiding_points_of_rigid_parts_never_loses_the_truth(hidden: tuple[str, ...]) -> None:
    case = hide(hidden, seed=3, n=2)
    check_truth(case)
    check_completions(case)


def test_hiding_nothing_changes_nothing() -> None:
    case = hide((), n=4)
    assert np.array_equal(case.done.postures, case.leaves.postures())
    assert not case.done.inferred.any()
    assert (case.done.outcome == CompletionOutcome.EXACT).all()
    assert case.done.regions(0) == []
    assert reject(case.leaves, case.done)[0] is case.leaves


def test_frames_with_different_hidden_joints_are_completed_as_each_would_be_alone() -> None:
    each = [("right_wrist",), (), ("left_knee",), ("right_wrist", "left_knee")]
    mixed = hide(each, n=4, seed=5)
    check_truth(mixed)
    for frame, names in enumerate(each):
        alone = hide(names, n=4, seed=5)
        a, b = mixed.leaves.frame == frame, alone.leaves.frame == frame
        for name in ("postures", "outcome", "kind", "fraction"):
            np.testing.assert_array_equal(getattr(mixed.done, name)[a], getattr(alone.done, name)[b])
        for name in ("lower", "upper", "radius"):
            np.testing.assert_allclose(
                getattr(mixed.done, name)[a], getattr(alone.done, name)[b], rtol=0, atol=1e-12
            )


@pytest.mark.parametrize(
    ("fewer", "more", "joint"),
    [
        (("right_wrist",), ("right_elbow", "right_wrist"), "right_wrist"),
        (("right_elbow",), ("right_elbow", "right_wrist"), "right_elbow"),
        (("left_ankle",), ("left_knee", "left_ankle"), "left_ankle"),
        (("right_hip",), ("right_hip", "right_knee"), "right_hip"),
    ],
)
def test_more_hidden_joints_never_shrink_a_set(
    fewer: tuple[str, ...], more: tuple[str, ...], joint: str
) -> None:
    a, b = hide(fewer, seed=11, n=2), hide(more, seed=11, n=2)
    for k in a.true:
        (less,) = (region for region in a.done.regions(k) if region.joint == joint)
        frame = a.leaves.frame[k]
        others = [region for i in b.true if b.leaves.frame[i] == frame for region in b.done.regions(i)]
        wider = [region for region in others if region.joint == joint]
        assert wider
        slack = less.accuracy + max(region.accuracy for region in wider) + ROUNDING
        assert (np.min([region.lower for region in wider], axis=0) <= less.lower + slack).all()
        assert (np.max([region.upper for region in wider], axis=0) >= less.upper - slack).all()


def test_a_parallel_camera_and_a_far_one_agree() -> None:
    scene = random_views(FIGURE, 4, np.random.default_rng(2))
    far = np.array([0.0, 0.0, 1e6])
    K = np.array([[1e9, 0.0, 0.0], [0.0, 1e9, 0.0], [0.0, 0.0, 1.0]])
    cameras: list[tuple[Camera, np.ndarray]] = [
        (PinholeCamera(K=K), far),
        (ScaledOrthographicCamera(scale=1000.0), 0.0 * far),
    ]
    checks = suite(rigid_tolerance=1e-4)
    results = []
    for camera, place in cameras:
        joints = scene.joints_cam - scene.joints_cam[:, :1] + place
        head = scene.head_cam - scene.joints_cam[:, :1] + place
        image = camera.project(joints).copy()
        image[:, [JOINT["right_elbow"], JOINT["left_ankle"]]] = np.nan
        leaves = TREE.grow(camera, joints[:, 0], image, checks, given=head, tolerance=1e-6)
        done = complete(leaves, camera, image, FIGURE, checks, tolerance=1e-6)
        rows = {key: k for k, key in enumerate(zip(leaves.frame.tolist(), leaves.code.tolist(), strict=True))}
        results.append((rows, done, place))
    (a, near, shift), (b, parallel, _) = results
    common = sorted(a.keys() & b.keys())
    assert len(common) >= 4
    i, j = np.array([a[key] for key in common]), np.array([b[key] for key in common])
    np.testing.assert_array_equal(near.outcome[i], parallel.outcome[j])
    slack = near.accuracy[i].max()
    np.testing.assert_allclose(near.lower[i] - shift, parallel.lower[j], rtol=0, atol=slack)
    np.testing.assert_allclose(near.upper[i] - shift, parallel.upper[j], rtol=0, atol=slack)
    np.testing.assert_allclose(near.fraction[i], parallel.fraction[j], rtol=0, atol=0.02)


def test_the_same_input_gives_the_same_output() -> None:
    a, b = hide(("left_elbow",), n=3), hide(("left_elbow",), n=3)
    for name in ("postures", "lower", "upper", "radius", "fraction"):
        np.testing.assert_array_equal(getattr(a.done, name), getattr(b.done, name))


# --- brute force ----------------------------------------------------------------------------------------


def rejection_sample(case: Hidden, k: int, hidden: Sequence[str], n: int) -> tuple[float, np.ndarray, Any]:
    """Draw positions of one limb's hidden joints at random, keep what passes: fraction, positions, (middle, end)."""
    rng = np.random.default_rng(1)
    limbs = [
        [JOINT[f"{side}_{joint}"] for joint in names]
        for side in SIDES
        for names in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
    ]
    base, middle, end = next(limb for limb in limbs if {JOINT[name] for name in hidden} & set(limb))
    points = np.concatenate([case.leaves.postures()[k], case.head[case.leaves.frame[k]]])
    drawn = np.repeat(points[None], n, axis=0)
    if JOINTS[middle] in hidden:
        drawn[:, middle] = points[base] + LENGTHS[middle] * unit(rng.standard_normal((n, 3)))
    if JOINTS[end] in hidden:
        ends = [drawn[:, middle] + LENGTHS[end] * unit(rng.standard_normal((n, 3)))]
    else:
        pixel = np.broadcast_to(case.image[case.leaves.frame[k], end], (1, n, 2))
        lift = case.camera.lift(drawn[None, :, middle], pixel, LENGTHS[end], tolerance=0.0)
        ends = [np.where(lift.valid[0, :, b, None], lift.points[0, :, b], np.nan) for b in (0, 1)]
    feasible, some = [], np.zeros(n, dtype=bool)
    for position in ends:
        drawn[:, end] = position
        rows = np.flatnonzero(np.isfinite(position).all(axis=1))
        for check in case.checks:
            rows = rows[~check.judge(drawn[rows][:, list(check.points)]).violated.any(axis=1)]
        feasible.append(drawn[rows][:, [middle, end]])
        some[rows] = True
    return float(some.mean()), np.concatenate(feasible), (middle, end)


@pytest.mark.parametrize(
    ("hidden", "which"),
    [
        (("right_wrist",), 0),
        (("right_elbow",), 1),
        (("left_knee",), 1),
        (("right_elbow", "right_wrist"), -1),
    ],
)
def test_sets_are_those_of_rejection_sampling(hidden: tuple[str, ...], which: int) -> None:
    case = hide(hidden, seed=3, n=2)
    n = 100_000 if len(hidden) == 1 else 50_000
    for k in case.true[-1:]:
        fraction, positions, joints = rejection_sample(case, k, hidden, n)
        regions = {JOINT[region.joint]: region for region in case.done.regions(k)}
        for column, joint in enumerate(joints):
            if joint not in regions:
                continue
            region, found = regions[joint], positions[:, column]
            # Nothing that is feasible is missing, and what is claimed is there: up to what 1e5 draws leave out.
            assert (region.lower <= found.min(axis=0) + region.accuracy).all()
            assert (region.upper >= found.max(axis=0) - region.accuracy).all()
            wide = 0.03 if which >= 0 else 0.1
            assert (region.lower >= found.min(axis=0) - wide).all()
            assert (region.upper <= found.max(axis=0) + wide).all()
            radius = np.linalg.norm(found - region.representative, axis=1).max()
            assert abs(region.radius - radius) <= wide
        joint = joints[1 - which] if which >= 0 else joints[1]
        assert regions[joint].kind == (PositionKind.SPHERE_REGION if which >= 0 else PositionKind.REGION)
        # A Fibonacci lattice of 400 points is off by its boundary: half a step along it, averaged.
        assert regions[joint].fraction == pytest.approx(fraction, abs=0.015)


# --- what is said ---------------------------------------------------------------------------------------


def test_kinds_are_those_of_the_pattern() -> None:
    expected = {
        ("right_wrist",): {"right_wrist": PositionKind.SPHERE_REGION},
        ("right_elbow",): {
            "right_elbow": PositionKind.SPHERE_REGION,
            "right_wrist": PositionKind.DEPTH_INTERVAL,
        },
        ("right_elbow", "right_wrist"): {
            "right_elbow": PositionKind.SPHERE_REGION,
            "right_wrist": PositionKind.REGION,
        },
        ("left_shoulder", "right_shoulder", "left_elbow"): {
            "right_shoulder": PositionKind.CIRCLE,
            "left_shoulder": PositionKind.CIRCLE,
            "right_elbow": PositionKind.DEPTH_INTERVAL,
            "left_elbow": PositionKind.REGION,
            "right_wrist": PositionKind.DEPTH_INTERVAL,
            "left_wrist": PositionKind.DEPTH_INTERVAL,
        },
    }
    for hidden, kinds in expected.items():
        case = hide(hidden, seed=1, n=2)
        assert {region.joint: region.kind for region in case.done.regions(case.true[0])} == kinds
        names = {JOINTS[joint] for joint in np.flatnonzero(case.done.inferred[case.true[0]])}
        assert names == set(kinds)
    assert PositionKind.DEPTH_INTERVAL.label == "depth interval"


def test_the_rigid_torso_leaves_a_hidden_shoulder_one_position() -> None:
    case = hide(("right_shoulder",), seed=4)
    for k in case.true:
        region = case.done.regions(k)[0]
        assert (region.joint, region.kind, region.radius, region.fraction) == (
            "right_shoulder",
            PositionKind.POINT,
            0.0,
            1.0,
        )
        truth = case.truth[case.leaves.frame[k], JOINT["right_shoulder"]]
        np.testing.assert_allclose(region.representative, truth, rtol=0, atol=1e-9)


def test_a_seen_wrist_beyond_a_hidden_elbow_stays_on_its_ray() -> None:
    case = hide(("right_elbow",), seed=6)
    for k in case.true:
        wrist = case.done.regions(k)[1]
        ray = case.truth[case.leaves.frame[k], JOINT["right_wrist"]]
        for end in (wrist.lower[2], wrist.upper[2]):
            at_depth = ray * end / ray[2]
            box = np.clip(at_depth, wrist.lower, wrist.upper)
            np.testing.assert_allclose(box, at_depth, rtol=0, atol=1e-9)


def test_the_representative_is_nearest_to_the_middle_of_the_samples() -> None:
    case = hide(("left_wrist",), seed=8, n=2, sampling=OcclusionSampling(sphere=3000))
    for k in case.true:
        _, positions, _ = rejection_sample(case, k, ("left_wrist",), 20_000)
        wrist = positions[:, 1]
        middle = wrist.mean(axis=0)
        nearest = np.linalg.norm(wrist - middle, axis=1).min()
        region = case.done.regions(k)[0]
        assert np.linalg.norm(region.representative - middle) <= nearest + 0.02


def test_finer_sampling_moves_no_end_by_more_than_was_said() -> None:
    coarse, fine = (
        hide(("left_elbow",), seed=9, n=3),
        hide(("left_elbow",), seed=9, n=3, sampling=OcclusionSampling(sphere=1600)),
    )
    slack = coarse.done.accuracy[:, :, None] + ROUNDING
    assert (np.abs(coarse.done.lower - fine.done.lower) <= slack).all()
    assert (np.abs(coarse.done.upper - fine.done.upper) <= slack).all()
    assert (fine.done.spacing <= coarse.done.spacing).all()


def test_two_hidden_knees_are_chosen_so_that_the_legs_do_not_collide(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = suite(contact_margin=0.08)
    knees = ("right_knee", "left_knee")
    case = hide(knees, seed=2, checks=wide)
    check_completions(case)
    assert (case.done.outcome == CompletionOutcome.COMPLETED).all()
    # The middles alone would not do.
    monkeypatch.setattr(limb_combinations, "N_WAYS_TRIED", {2: (1,)})
    alone = hide(knees, seed=2, checks=wide).done.outcome
    assert (alone == CompletionOutcome.UNDECIDED).any()
    assert (alone == CompletionOutcome.COMPLETED).any()


@pytest.mark.parametrize(("ranges", "motion"), [("urdf", ("walking",)), ("table1", ())])
def test_motion_and_measured_points_are_completed_too(ranges: str, motion: tuple[str, ...]) -> None:
    checks = suite(
        ("rigid-parts", "joint-range", "collision", *motion),
        ranges=load_ranges(ranges),
        rigid_tolerance=0.03,
        rigid_mode="distances",
        angle_tolerance=2.0,
        rules=(1,),
    )
    case = hide(("right_elbow", "left_knee"), seed=12, n=12, checks=checks, tolerance=0.01, noise=1.0)
    completed = case.done.outcome == CompletionOutcome.COMPLETED
    assert completed.any()
    points = case.points[completed]
    for check in checks:
        assert not check.judge(points[:, list(check.points)]).violated.any()


def kept(case: Hidden) -> set[int]:
    """Frames of which some survivor has the truth: where joints were seen within 8 cm, the others in their regions."""
    frames = set()
    for k in np.flatnonzero(case.done.outcome <= CompletionOutcome.COMPLETED):
        truth = case.truth[case.leaves.frame[k]]
        known = ~case.done.inferred[k]
        off = [np.linalg.norm(case.done.postures[k] - truth, axis=-1)[known].max()]
        off += [outside(region, truth[JOINT[region.joint]]) for region in case.done.regions(k)]
        if max(off) < 0.08:
            frames.add(int(case.leaves.frame[k]))
    return frames


@pytest.mark.parametrize("hidden", ["pelvis", "right_shoulder", "left_hip"])
def test_a_measured_joint_of_the_trunk_is_a_region_and_proves_nothing(hidden: str) -> None:
    checks = suite(rigid_tolerance=0.03, rigid_mode="distances", angle_tolerance=2.0)
    case = hide((hidden,), seed=5, n=8, checks=checks, tolerance=0.01, noise=1.0)
    assert not case.done.impossible.any()
    completed = np.flatnonzero(case.done.outcome == CompletionOutcome.COMPLETED)
    regions = [case.done.regions(k)[0] for k in completed]
    assert {(region.joint, region.kind) for region in regions} == {(hidden, PositionKind.SPHERE_REGION)}
    parent = PARENTS[JOINT[hidden]]
    reach = 2.0 * FIGURE.lengths[segment_name((parent, JOINT[hidden]))]
    assert max(np.prod((region.upper - region.lower) / reach) for region in regions) < 1.0 / 3.0
    everything = hide((), seed=5, n=8, checks=checks, tolerance=0.01, noise=1.0)
    assert kept(case) >= kept(everything)
    assert len(kept(case)) >= 6


# --- what is impossible ---------------------------------------------------------------------------------


def out_of_reach(joint: str, hidden: str) -> tuple[Leaves, CompletedSurvivors]:
    scene = random_views(FIGURE, 2, np.random.default_rng(0))
    image = scene.image.copy()
    image[:, JOINT[hidden]] = np.nan
    image[0, JOINT[joint]] += 900.0
    leaves = TREE.grow(
        scene.camera, scene.joints_cam[:, 0], image, CHECKS, given=scene.head_cam, tolerance=TOLERANCE
    )
    return leaves, complete(leaves, scene.camera, image, FIGURE, CHECKS, tolerance=TOLERANCE)


@pytest.mark.parametrize(
    ("joint", "hidden"),
    [("right_wrist", "right_elbow"), ("left_ankle", "left_knee"), ("right_knee", "right_hip")],
)
def test_a_limb_that_cannot_reach_its_ray_is_rejected_with_its_joint(joint: str, hidden: str) -> None:
    leaves, done = out_of_reach(joint, hidden)
    first = leaves.frame == 0
    assert first.any()
    assert done.impossible[first].all()
    assert not done.impossible[~first].all()
    assert {done.reason(k) for k in np.flatnonzero(first)} == {f"occluded/{hidden}"}
    left, rows = reject(leaves, done)
    assert len(left.code) == len(rows)
    assert not (left.frame == 0).any()
    lost = left.rejected()[0]
    assert lost[f"occluded/{hidden}"] == first.sum()
    assert sum(lost.values()) == 8192


def test_a_shoulder_whose_arm_has_no_legal_lift_is_rejected() -> None:
    case = hide(("pelvis",), seed=3)
    gone = case.done.impossible
    assert gone.any()
    assert not gone[case.true].any()
    assert all(case.done.reason(k).startswith("occluded/") for k in np.flatnonzero(gone))


def test_what_only_the_sampling_did_not_find_is_undecided() -> None:
    case = hide(("right_hip",), seed=0)
    open_ = np.flatnonzero(case.done.outcome == CompletionOutcome.UNDECIDED)
    assert len(open_)
    assert (case.done.miss[open_] > 0.0).any()
    assert not (case.done.miss[open_] == 0.0).any()
    assert np.isnan(case.done.postures[open_][:, JOINT["right_hip"]]).all()
    assert case.done.regions(open_[0]) == []
    left, _ = reject(case.leaves, case.done)
    assert len(left.code) == len(case.done) - case.done.impossible.sum()


# --- bad input ------------------------------------------------------------------------------------------


def test_a_survivor_without_a_neck_is_refused() -> None:
    scene = random_views(FIGURE, 1, np.random.default_rng(0))
    root = np.full((1, 3), np.nan)
    leaves = TREE.grow(scene.camera, root, scene.image, CHECKS)
    with pytest.raises(InputError, match="neck"):
        complete(leaves, scene.camera, scene.image, FIGURE, CHECKS)


def test_an_image_of_another_shape_is_refused() -> None:
    case = hide((), n=1)
    with pytest.raises(InputError, match=r"\(1, 14, 2\)"):
        complete(case.leaves, case.camera, case.image[:, :13], FIGURE, CHECKS)


@pytest.mark.parametrize(
    "name",
    [
        "sphere",
        "ends",
        "circle",
        "rotations",
        "measured_sphere",
        "trunk_sphere",
        "hip_depths",
        "trunks",
        "rounds",
    ],
)
def test_too_few_samples_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=name):
        replace(OcclusionSampling(), **{name: -1})


def test_image_points_beyond_all_bounds_do_no_harm() -> None:
    scene = random_views(FIGURE, 1, np.random.default_rng(0))
    image = scene.image.copy()
    image[:, JOINT["right_elbow"]] = np.nan
    image[:, JOINT["right_wrist"]] = 1e300
    with np.errstate(over="ignore"):  # as `recover` does
        leaves = TREE.grow(scene.camera, scene.joints_cam[:, 0], image, CHECKS, given=scene.head_cam)
    done = complete(leaves, scene.camera, image, FIGURE, CHECKS)
    assert len(done)
    assert done.impossible.all()
