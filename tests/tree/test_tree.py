"""The interpretation tree: its laws, and brute force over all leaves by a recursion that shares nothing with it."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.cameras import PinholeCamera
from posekit.skeleton import HEAD_POINTS, JOINT, JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.tree import BranchState, Check, Findings, InterpretationTree, Leaves, Place
from posekit.tree.candidates import lift_all
from posekit.validators import collision, joint_range, rigid_parts

FIGURE = load_figure()
CAMERA = PinholeCamera(K=np.array([[1500.0, 0, 960], [0, 1500, 540], [0, 0, 1]]))
LENGTHS = np.array([0.0] + [FIGURE.lengths[segment_name(segment)] for segment in TREE_SEGMENTS])
TREE = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=LENGTHS)
CHECKS = [*rigid_parts(FIGURE, tolerance=1e-6), *joint_range(FIGURE), *collision(FIGURE)]
TOLERANCE = 1e-9
N = len(JOINTS)


def legal_postures(seed: int, n: int) -> np.ndarray:
    """Draw postures (n, 19, 3) inside all limits and free of collision, about 4 m ahead."""
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(FIGURE.model), (4 * n, 1))
    q[:, :3] = rng.normal(size=(4 * n, 3)) * 0.3 + [0, 0, 4]
    turn = rng.normal(size=(4 * n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = FIGURE.limits
    q[:, FIGURE.angle_index] = limits.lower + rng.random((4 * n, 22)) * (limits.upper - limits.lower)
    points = FIGURE.forward_kinematics(q)
    hit = np.any([c.judge(points[:, c.points]).violated[:, 0] for c in collision(FIGURE)], axis=0)
    return np.asarray(points[~hit][:n])


POSTURES = legal_postures(7, 12)


def grow(points: np.ndarray, checks: Sequence[Check] = CHECKS, *, tolerance: float = TOLERANCE) -> Leaves:
    return TREE.grow(
        CAMERA, points[:, 0], CAMERA.project(points)[:, :N], checks, given=points[:, N:], tolerance=tolerance
    )


def members(leaves: Leaves) -> set[tuple[int, int]]:
    return set(zip(leaves.frame.tolist(), leaves.code.tolist(), strict=True))


def recurse(image: np.ndarray, root: np.ndarray) -> dict[str, np.ndarray]:
    """Place every leaf by a depth-first recursion and Lee & Chen's quadratic (7): branch string to joints."""
    leaves: dict[str, np.ndarray] = {}
    rays = np.concatenate([(image - [960, 540]) / 1500, np.ones((N, 1))], axis=1)

    def place(joint: int, code: str, joints: list[np.ndarray]) -> None:
        if joint == N:
            leaves[code] = np.array(joints)
            return
        ray, start = rays[joint], joints[PARENTS[joint]]
        a, b, c = ray @ ray, ray @ start, start @ start - LENGTHS[joint] ** 2
        discriminant = b * b - a * c
        if discriminant < 0:
            return
        for branch, sign in (("0", -1), ("1", 1)):
            k = (b + sign * np.sqrt(discriminant)) / a
            if k > 0:
                place(joint + 1, code + branch, [*joints, k * ray])

    place(1, "", [root])
    return leaves


class Chain:
    """A chain of n short segments seen end on: every branch is open."""

    def __init__(self, n: int) -> None:
        self.tree = InterpretationTree(
            joints=tuple(f"j{k}" for k in range(n + 1)),
            parents=tuple(range(-1, n)),
            lengths=np.full(n + 1, 0.1),
        )
        self.root = np.array([[0.0, 0.0, 5.0]])
        self.image = np.broadcast_to(np.array([960.0, 540.0]), (1, n + 1, 2))


@pytest.mark.parametrize("n", [1, 2, 3, 7, 12])
def test_n_free_segments_give_two_to_the_n_leaves(n: int) -> None:
    chain = Chain(n)
    # Along its ray a chain folds onto itself, but no two branch strings are one.
    leaves = chain.tree.grow(CAMERA, chain.root, chain.image, [])
    assert len(leaves.code) == 2**n
    assert len(set(leaves.branches())) == 2**n
    np.testing.assert_array_equal(leaves.counts(), [[2**k for k in range(n + 1)]])
    assert leaves.rejected() == [{}]


def end_on(frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Root and image of bodies all of whose joints are seen at one pixel: every branch is open."""
    return np.tile([0.0, 0.0, 5.0], (frames, 1)), np.broadcast_to([960.0, 540.0], (frames, N, 2))


def test_the_whole_body_has_8192_leaves() -> None:
    leaves = TREE.grow(CAMERA, *end_on(2), [])
    np.testing.assert_array_equal(np.diff(leaves.offsets()), 8192)
    assert (leaves.counts() == 2 ** np.arange(N)).all()


def test_every_leaf_reprojects_and_keeps_every_length() -> None:
    leaves = grow(POSTURES[:3], [])
    joints = leaves.postures()
    image = CAMERA.project(POSTURES)[:, :N]
    np.testing.assert_allclose((CAMERA.project(joints) - image[leaves.frame]) / 1500, 0, rtol=0, atol=1e-12)
    lengths = np.linalg.norm(joints[:, 1:] - joints[:, list(PARENTS[1:])], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(LENGTHS[1:], lengths.shape), rtol=0, atol=1e-12)
    assert (leaves.length_residual() <= 1e-12).all()


@pytest.mark.parametrize("frame", range(3))
def test_survivors_are_those_of_brute_force(frame: int) -> None:
    points = POSTURES[frame]
    leaves = recurse(CAMERA.project(points)[:N], points[0])
    assert set(grow(points[None], []).branches()) == set(leaves)
    codes = list(leaves)
    everything = np.stack([np.concatenate([joints, points[N:]]) for joints in leaves.values()])
    bad = np.any([c.judge(everything[:, c.points]).violated.any(axis=1) for c in CHECKS], axis=0)
    grown = grow(points[None])
    assert set(grown.branches()) == {code for code, wrong in zip(codes, bad, strict=True) if not wrong}
    brute = np.stack([leaves[code] for code in grown.branches()])
    np.testing.assert_allclose(grown.postures(), brute, rtol=0, atol=1e-8)


def test_the_true_posture_survives() -> None:
    leaves = grow(POSTURES)
    gap = np.abs(leaves.postures() - POSTURES[leaves.frame, :N]).max(axis=(1, 2))
    nearest = np.minimum.reduceat(gap, leaves.offsets()[:-1])
    assert nearest.max() < 1e-6


def test_pruning_early_or_late_gives_the_same_survivors() -> None:
    points = POSTURES[:4]
    late = TREE.prune(grow(points, []), CHECKS)
    assert members(late) == members(grow(points))


def test_the_order_of_the_checks_changes_no_survivor() -> None:
    assert members(grow(POSTURES, CHECKS[::-1])) == members(grow(POSTURES))


def test_more_checks_never_keep_more() -> None:
    few, all_ = members(grow(POSTURES, CHECKS[:9])), members(grow(POSTURES))
    assert all_ < few


def test_a_batch_is_its_frames_one_at_a_time() -> None:
    together = grow(POSTURES)
    offsets = together.offsets()
    rejected, counts = together.rejected(), together.counts()
    for k in range(len(POSTURES)):
        alone = grow(POSTURES[k : k + 1])
        part = slice(offsets[k], offsets[k + 1])
        np.testing.assert_array_equal(alone.code, together.code[part])
        np.testing.assert_array_equal(alone.postures(), together.postures()[part])
        np.testing.assert_array_equal(alone.counts()[0], counts[k])
        assert alone.rejected() == [rejected[k]]


def test_every_leaf_is_accounted_for() -> None:
    for tolerance in (0.0, 1e-9, 1e-3):
        leaves = grow(POSTURES, tolerance=tolerance)
        survivors = np.diff(leaves.offsets())
        for frame, reasons in enumerate(leaves.rejected()):
            assert sum(reasons.values()) + survivors[frame] == 8192
            assert all(count > 0 for count in reasons.values())


def test_counts_are_the_distinct_prefixes_of_the_branch_strings() -> None:
    leaves = grow(POSTURES)
    counts, branches, offsets = leaves.counts(), leaves.branches(), leaves.offsets()
    for frame in range(len(POSTURES)):
        strings = branches[offsets[frame] : offsets[frame + 1]]
        expected = [len({string[:level] for string in strings}) for level in range(N)]
        assert counts[frame].tolist() == expected
    assert (np.diff(counts, axis=1) >= 0).all()
    assert (np.diff(counts, axis=1) <= counts[:, :-1]).all()
    np.testing.assert_array_equal(counts[:, -1], np.diff(offsets))


def test_branch_strings_say_near_and_far() -> None:
    leaves = grow(POSTURES[:1], [])
    joints, branches = leaves.postures(), leaves.branches()
    near = CAMERA.lift(joints[:, 0], CAMERA.project(joints)[:, 3], LENGTHS[3], tolerance=0.0).points[:, 0]
    is_near = np.array([string[2] == "0" for string in branches])
    gap = np.linalg.norm(joints[:, 3] - near, axis=1)
    np.testing.assert_array_equal(gap < 1e-9, is_near)


def test_a_finding_behind_every_pruned_branch() -> None:
    leaves = grow(POSTURES)
    for group in leaves.pruned:
        assert len(group.frame) == len(group.code) == len(group.value) > 0
        assert (group.place >= 0).all()
        assert (group.place < len(group.where)).all()
        assert ((group.value < group.lower) | (group.value > group.upper)).all()


@pytest.mark.parametrize("missing", ["right_elbow", "left_ankle", "left_hip", "right_shoulder", "pelvis"])
def test_a_missing_joint_is_unknown_and_so_is_all_beyond_it(missing: str) -> None:
    points = POSTURES[:4]
    image = CAMERA.project(points)[:, :N].copy()
    image[:, JOINT[missing]] = np.nan
    leaves = TREE.grow(CAMERA, points[:, 0], image, CHECKS, given=points[:, N:], tolerance=TOLERANCE)
    unknown = {JOINT[missing]}
    for joint in range(1, N):
        if PARENTS[joint] in unknown:
            unknown.add(joint)
    joints = leaves.postures()
    expected = np.zeros((N, 3), dtype=bool)
    expected[sorted(unknown)] = True
    np.testing.assert_array_equal(np.isnan(joints), np.broadcast_to(expected, joints.shape))
    survivors = np.diff(leaves.offsets())
    assert (survivors > 0).all()
    for frame, reasons in enumerate(leaves.rejected()):
        assert sum(reasons.values()) + survivors[frame] == 8192
        assert f"missing/{missing}" in reasons
    known = [joint for joint in range(N) if joint not in unknown]
    gap = np.abs(joints[:, known] - points[leaves.frame][:, known]).max(axis=(1, 2))
    assert np.minimum.reduceat(gap, leaves.offsets()[:-1]).max() < 1e-6


def test_a_missing_joint_never_rejects_what_survives_with_it() -> None:
    points = POSTURES[:4]
    image = CAMERA.project(points)[:, :N].copy()
    image[:, JOINT["right_wrist"]] = np.nan
    without = TREE.grow(CAMERA, points[:, 0], image, CHECKS, given=points[:, N:], tolerance=TOLERANCE)
    wrist = np.int32(1 << (N - 1 - JOINT["right_wrist"]))
    cleared = {(frame, code & ~wrist) for frame, code in members(grow(points))}
    assert cleared <= members(without)


def test_a_root_that_is_unknown_leaves_one_unknown_posture() -> None:
    points = POSTURES[:2].copy()
    root = points[:, 0].copy()
    root[0] = np.nan
    leaves = TREE.grow(
        CAMERA, root, CAMERA.project(points)[:, :N], CHECKS, given=points[:, N:], tolerance=TOLERANCE
    )
    assert np.isnan(leaves.postures()[leaves.frame == 0]).all()
    assert (leaves.frame == 0).sum() == 1
    assert members(leaves) >= {(1, code) for frame, code in members(grow(points)) if frame == 1}


def test_the_mirror_image_has_the_mirrored_survivors() -> None:
    swap = [
        JOINT[name.replace("right", "LEFT").replace("left", "right").replace("LEFT", "left")]
        for name in JOINTS
    ]
    swap += [
        N + HEAD_POINTS.index(name) for name in ("nose", "left_eye", "right_eye", "left_ear", "right_ear")
    ]
    points = POSTURES[:6]
    leaves, mirrored = grow(points), grow((points * [-1, 1, 1])[:, swap])
    np.testing.assert_array_equal(np.diff(leaves.offsets()), np.diff(mirrored.offsets()))
    order_by_joint = leaves.postures()[:, swap[:N]] * [-1, 1, 1]
    for frame in range(len(points)):
        ours = order_by_joint[leaves.frame == frame].reshape(-1, N * 3)
        theirs = mirrored.postures()[mirrored.frame == frame].reshape(-1, N * 3)
        gap = np.abs(ours[:, None] - theirs[None]).max(axis=-1)
        assert gap.min(axis=1).max() < 1e-6
        assert gap.min(axis=0).max() < 1e-6


def test_a_looser_tolerance_never_loses_a_leaf(rng: np.random.Generator) -> None:
    points = POSTURES[:3]
    image = CAMERA.project(points)[:, :N] + rng.normal(size=(3, N, 2)) * 8
    sets, residuals = [], []
    for tolerance in (0.0, 1e-3, 1e-2, 0.1):
        leaves = TREE.grow(CAMERA, points[:, 0], image, [], given=points[:, N:], tolerance=tolerance)
        sets.append(members(leaves))
        residuals.append(leaves.length_residual().max(initial=0.0))
        assert residuals[-1] <= tolerance
    for strict, loose in pairwise(sets):
        assert strict <= loose
    assert len(sets[0]) < len(sets[-1])


def test_a_leaf_carries_the_length_that_its_tangents_lack(rng: np.random.Generator) -> None:
    points = POSTURES[:3]
    image = CAMERA.project(points)[:, :N] + rng.normal(size=(3, N, 2)) * 8
    leaves = TREE.grow(CAMERA, points[:, 0], image, [], given=points[:, N:], tolerance=0.1)
    joints = leaves.postures()
    lengths = np.linalg.norm(joints[:, 1:] - joints[:, list(PARENTS[1:])], axis=-1)
    longer = np.maximum(lengths - LENGTHS[1:], 0).max(axis=1)
    np.testing.assert_allclose(leaves.length_residual(), longer, rtol=0, atol=1e-12)
    assert longer.max() > 1e-3


def test_a_segment_too_short_says_which_and_by_how_much() -> None:
    points = POSTURES[:1]
    short = LENGTHS.copy()
    short[JOINT["left_knee"]] = 0.01
    tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=short)
    leaves = tree.grow(CAMERA, points[:, 0], CAMERA.project(points)[:, :N], [], tolerance=0.0)
    assert len(leaves.code) == 0
    assert leaves.counts().sum() == 0
    assert sum(leaves.rejected()[0].values()) == 8192
    # Branches that die earlier are short of another segment, in a posture that is not the true one.
    reasons = leaves.rejected()[0]
    assert all(reason.startswith("no_solution/") for reason in reasons)
    assert reasons["no_solution/left_knee"] > 0
    group = next(group for group in leaves.pruned if group.check == "no_solution")
    assert (group.value > 0).all()
    assert (group.upper == 0).all()
    assert leaves.postures().shape == (0, N, 3)
    assert leaves.branches() == []


def test_a_tangent_segment_has_one_leaf_and_says_so() -> None:
    tree = InterpretationTree(joints=("a", "b"), parents=(-1, 0), lengths=np.array([0.0, 3.0]))
    image = np.array([[[960.0, 540.0], [960 + 1500 * 0.75, 540.0]]])
    leaves = tree.grow(CAMERA, np.array([[0.0, 0.0, 5.0]]), image, [], tolerance=1e-12)
    assert leaves.branches() == ["0"]
    assert leaves.rejected() == [{"coincident/b": 1}]


def test_branches_behind_the_camera_are_named() -> None:
    tree = InterpretationTree(joints=("a", "b"), parents=(-1, 0), lengths=np.array([0.0, 0.5]))
    leaves = tree.grow(CAMERA, np.array([[0.0, 0.0, 0.2]]), np.full((1, 2, 2), [960.0, 540.0]), [])
    assert leaves.branches() == ["1"]
    assert leaves.rejected() == [{"behind_camera/b": 1}]


def test_candidates_are_the_86_lifts() -> None:
    candidates = lift_all(CAMERA, *end_on(2), parents=PARENTS, lengths=LENGTHS, tolerance=0.0)
    assert sum(positions.shape[1] for positions in candidates.positions[1:]) == 86
    assert all((branches == BranchState.OPEN).all() for branches in candidates.branches)
    assert candidates.too_short(0) is None


class Seen(Check):
    """A check that keeps what it was asked and rejects by a rule."""

    name, unit = "seen", "m"
    places = (Place(name="place"),)
    points: tuple[int, ...] = ()

    def __init__(self, points: tuple[int, ...], *, limit: float = np.inf) -> None:
        self.points = points
        self.limit = limit
        self.asked: list[np.ndarray] = []

    def judge(self, points: np.ndarray) -> Findings:
        self.asked.append(points)
        return Findings(value=points[:, -1, 2:], lower=np.array([-np.inf]), upper=np.array([self.limit]))


def test_a_check_is_asked_once_for_each_choice_of_its_own_branches() -> None:
    check = Seen((JOINT["right_shoulder"], JOINT["right_elbow"]))
    leaves = TREE.grow(CAMERA, *end_on(2), [check])
    assert [len(points) for points in check.asked] == [2 * 4]
    late = Seen((JOINT["left_hip"], JOINT["left_ankle"]))
    TREE.prune(leaves, [late])
    assert [len(points) for points in late.asked] == [2 * 16]


def test_a_check_of_given_points_alone_is_asked_at_the_first_level() -> None:
    given = np.zeros((3, 5, 3))
    given[1, 0, 2] = 100.0
    leaves = TREE.grow(CAMERA, *end_on(3), [Seen((N,), limit=50.0)], given=given)
    assert np.diff(leaves.offsets()).tolist() == [8192, 0, 8192]
    assert leaves.rejected()[1] == {"seen/place": 8192}


def test_points_that_were_not_given_are_unknown() -> None:
    check = Seen((0, N + 2))
    image = CAMERA.project(POSTURES[:1])[:, :N]
    TREE.grow(CAMERA, POSTURES[:1, 0], image, [check], tolerance=TOLERANCE)
    assert np.isnan(check.asked[0][:, 1]).all()
    with_checks = TREE.grow(CAMERA, POSTURES[:1, 0], image, CHECKS, tolerance=TOLERANCE)
    assert members(with_checks) >= members(grow(POSTURES[:1]))


def test_an_undecided_finding_rejects_nothing() -> None:
    findings = Findings(value=np.array([[np.nan, 2.0]]), lower=np.zeros(2), upper=np.ones(2))
    np.testing.assert_array_equal(findings.violated, [[False, True]])
    np.testing.assert_array_equal(findings.undecided, [[True, False]])
    np.testing.assert_array_equal(findings.margin, [[np.nan, -1.0]])


@pytest.mark.parametrize(("tolerance", "violated"), [(0.0, True), (0.4, True), (0.5, False), (1.0, False)])
def test_a_finding_is_violated_only_beyond_its_tolerance(tolerance: float, violated: bool) -> None:
    findings = Findings(
        value=np.array([[1.5]]), lower=np.array([0.0]), upper=np.array([1.0]), tolerance=tolerance
    )
    assert findings.violated[0, 0] == violated


def test_no_frames_grow_no_leaves() -> None:
    leaves = grow(POSTURES[:0])
    assert leaves.counts().shape == (0, N)
    assert leaves.rejected() == []
    assert leaves.postures().shape == (0, N, 3)
