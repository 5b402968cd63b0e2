"""The compiled path of the tree: the same leaves, losses, findings and counts as the plain one, whatever it is given.

Where Numba is not installed the same loops run as Python does, over fewer views.
"""

import importlib.util
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.compiled import compiling as compiled
from posekit.compiled import tree_kernels as kernels
from posekit.refinement import under_noise
from posekit.settings import RigidTolerance
from posekit.skeleton import DOFS, JOINT, JOINTS, PARENTS, POINTS, TREE_SEGMENTS, segment_name
from posekit.tree import (
    Check,
    Findings,
    InterpretationTree,
    Leaves,
    Place,
    fast,
    interpretation_tree,
    stretches,
)
from posekit.tree.blocks import FrameBlock
from posekit.tree.candidates import Candidates, lift_all, rays_of
from posekit.tree.layout import programme_of
from posekit.validators import load_ranges, make_checks
from posekit.validators.collision import PairCollision

FIGURE = load_figure()
LENGTHS = np.array([0.0] + [FIGURE.lengths[segment_name(segment)] for segment in TREE_SEGMENTS])
TREE = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=LENGTHS)
CAMERA = PinholeCamera(K=np.array([[1500.0, 3, 960], [0, 1480, 540], [0, 0, 1]]))
N = len(JOINTS)
NUMBA = importlib.util.find_spec("numba") is not None
VIEWS = 200 if NUMBA else 5


def checks(rigid: float = 1e-6, angle: float = 1e-3, ranges: str = "urdf") -> list[Check]:
    mode: Literal["distances", "placement"] = "placement" if rigid < 0.01 else "distances"
    return make_checks(
        FIGURE,
        ("rigid-parts", "joint-range", "collision"),
        ranges=load_ranges(ranges),
        rigid_tolerance=rigid,
        rigid_mode=mode,
        angle_tolerance=angle,
    )


def postures(seed: int, n: int, beyond: float = 0.3) -> np.ndarray:
    """Draw postures (n, 19, 3), some of whose angles are up to `beyond` radians outside their limits."""
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    q[:, :3] = rng.normal(size=(n, 3)) * 0.3 + [0, 0, 4]
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    lower, upper = FIGURE.limits.lower - beyond, FIGURE.limits.upper + beyond
    q[:, FIGURE.angle_index] = lower + rng.random((n, 22)) * (upper - lower)
    return FIGURE.forward_kinematics(q)


def seen(points: np.ndarray, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    image = CAMERA.project(points)[:, :N]
    return np.asarray(image + noise * np.random.default_rng(seed).normal(size=image.shape))


def both(
    suite: list[Check],
    root: np.ndarray,
    image: np.ndarray,
    given: np.ndarray | None,
    *,
    camera: Camera = CAMERA,
    tolerance: float = 1e-9,
    tree: InterpretationTree = TREE,
) -> tuple[Leaves, Leaves]:
    with compiled.path("plain"):
        plain = tree.grow(camera, root, image, suite, given=given, tolerance=tolerance)
    with compiled.path("fast"):
        quick = tree.grow(camera, root, image, suite, given=given, tolerance=tolerance)
    return plain, quick


def assert_same(plain: Leaves, quick: Leaves) -> None:
    """Compare every leaf and every lost branch, with what was found there."""
    np.testing.assert_array_equal(quick.frame, plain.frame)
    np.testing.assert_array_equal(quick.code, plain.code)
    assert quick.level == plain.level
    np.testing.assert_array_equal(quick.postures(), plain.postures())
    assert len(quick.pruned) == len(plain.pruned)
    for a, b in zip(plain.pruned, quick.pruned, strict=True):
        assert (b.level, b.check, b.where, b.unit) == (a.level, a.check, a.where, a.unit)
        for name in ("frame", "code", "place"):
            np.testing.assert_array_equal(getattr(b, name), getattr(a, name), err_msg=f"{a.check} {name}")
        for name in ("value", "lower", "upper"):
            np.testing.assert_allclose(getattr(b, name), getattr(a, name), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(quick.counts(), plain.counts())
    assert quick.rejected() == plain.rejected()


def hide_some(image: np.ndarray, seed: int) -> np.ndarray:
    hidden = np.random.default_rng(seed).random(image.shape[:2]) < 0.15
    return np.where(hidden[..., None], np.nan, image)


def exact() -> tuple[Leaves, Leaves]:
    points = postures(1, VIEWS)
    return both(checks(), points[:, 0], seen(points), points[:, N:])


def legal() -> tuple[Leaves, Leaves]:
    points = postures(2, VIEWS, beyond=0.0)
    return both(checks(), points[:, 0], seen(points), points[:, N:])


def noisy() -> tuple[Leaves, Leaves]:
    points = postures(3, VIEWS // 2)
    image = seen(points, noise=4.0)
    return both(checks(0.05, 3.0), points[:, 0], image, points[:, N:], tolerance=0.05)


def hidden() -> tuple[Leaves, Leaves]:
    points = postures(4, VIEWS // 2)
    image = hide_some(seen(points), 5)
    given = np.where(np.arange(len(points))[:, None, None] % 3 == 0, np.nan, points[:, N:])
    return both(checks(0.05, 3.0), points[:, 0], image, given, tolerance=0.02)


def without_head() -> tuple[Leaves, Leaves]:
    points = postures(5, VIEWS // 4)
    return both(checks(), points[:, 0], seen(points), None)


def anatomical() -> tuple[Leaves, Leaves]:
    points = postures(27, VIEWS // 2, beyond=0.1)
    return both(checks(ranges="anatomical"), points[:, 0], seen(points), points[:, N:])


def anatomical_measured() -> tuple[Leaves, Leaves]:
    """Pixels that are off, joints that are hidden, and every third right elbow and left knee straight."""
    points = postures(28, VIEWS // 2, beyond=0.1)
    for first, middle, end in (
        ("right_shoulder", "right_elbow", "right_wrist"),
        ("left_hip", "left_knee", "left_ankle"),
    ):
        along = points[::3, JOINT[middle]] - points[::3, JOINT[first]]
        length = np.linalg.norm(points[::3, JOINT[end]] - points[::3, JOINT[middle]], axis=1)
        points[::3, JOINT[end]] = (
            points[::3, JOINT[middle]] + along * (length / np.linalg.norm(along, axis=1))[:, None]
        )
    image = seen(points)
    image[1::3] = seen(points, noise=2.0)[1::3]
    image[: VIEWS // 4] = hide_some(image, 29)[: VIEWS // 4]
    return both(checks(0.05, 3.0, "anatomical"), points[:, 0], image, points[:, N:], tolerance=0.02)


def projected_ranges() -> tuple[Leaves, Leaves]:
    points = postures(6, VIEWS // 4)
    return both(checks(ranges="table1"), points[:, 0], seen(points), points[:, N:])


def several_hypotheses() -> tuple[Leaves, Leaves]:
    points = np.repeat(postures(7, VIEWS // 8 + 1), 3, axis=0)
    scale = np.tile([0.97, 1.0, 1.04], len(points) // 3)[:, None]
    return both(checks(0.05, 3.0), points[:, 0] * scale, seen(points), None, tolerance=0.05)


def at_the_limits() -> tuple[Leaves, Leaves]:
    """Straight elbows and knees, arms along the abduction axis, angles exactly at their limits."""
    rng = np.random.default_rng(8)
    q = np.tile(pin.neutral(FIGURE.model), (VIEWS // 2, 1))
    q[:, :3] = [0.0, 0.0, 4.0]
    choices = np.stack([FIGURE.limits.lower, FIGURE.limits.upper, np.zeros(22), np.full(22, np.pi / 2)])
    q[:, FIGURE.angle_index] = choices[rng.integers(0, 4, (len(q), 22)), np.arange(22)]
    points = FIGURE.forward_kinematics(q)
    return both(checks(), points[:, 0], seen(points), points[:, N:])


def tangent_and_behind() -> tuple[Leaves, Leaves]:
    """Segments in the image plane, a body seen end on, one about the camera, one too long for its lengths."""
    flat = postures(9, 4)
    flat[:, :, 2] = 4.0
    near = postures(10, 4)
    near[:, :, 2] -= 3.9
    end_on = np.broadcast_to([960.0, 540.0], (2, N, 2))
    image = np.concatenate([seen(flat), end_on, np.nan_to_num(seen(near), nan=960.0), seen(flat) * 1.5])
    root = np.concatenate([flat[:, 0], np.tile([0.0, 0.0, 5.0], (2, 1)), near[:, 0], flat[:, 0]])
    return both(checks()[:9], root, image, None, tolerance=1e-6)


def uncalibrated() -> tuple[Leaves, Leaves]:
    points = postures(11, VIEWS // 8 + 1)
    camera = ScaledOrthographicCamera(scale=np.linspace(90, 110, len(points)))
    return both(checks(), points[:, 0], camera.project(points)[:, :N], points[:, N:], camera=camera)


def measured() -> tuple[Leaves, Leaves]:
    """Torsos that give and pixels that are off, judged as measured points are; every third arm is all but straight."""
    points = postures(22, VIEWS // 2, beyond=0.1)
    elbow, wrist, shoulder = (JOINT[f"right_{name}"] for name in ("elbow", "wrist", "shoulder"))
    upper = points[::3, elbow] - points[::3, shoulder]
    points[::3, wrist] = points[::3, elbow] + 0.9 * upper
    points[:, JOINT["left_shoulder"]] += np.random.default_rng(23).normal(0.0, 0.01, (len(points), 3))
    image = hide_some(seen(points, noise=1.0), 24)
    image[: VIEWS // 4] = seen(points, noise=1.0)[: VIEWS // 4]
    rigid = RigidTolerance(shoulders=0.03, sides=0.03, hips=0.0075)
    suite = make_checks(
        FIGURE,
        ("rigid-parts", "joint-range", "collision"),
        ranges=load_ranges("urdf"),
        rigid_tolerance=rigid,
        rigid_mode="distances",
        angle_tolerance=2.0,
    )
    return both(suite, points[:, 0], image, points[:, N:], tolerance=0.01)


def empty_frames() -> tuple[Leaves, Leaves]:
    """Frames without a root, without a joint that is seen, and without any branch, among others."""
    points = postures(25, 24)
    root, image = points[:, 0].copy(), seen(points)
    root[::4], image[1::4] = np.nan, np.nan
    image[2::4, 1:] += 5000.0
    return both(checks(), root, image, points[:, N:])


def one_view() -> tuple[Leaves, Leaves]:
    points = postures(12, 1)
    return both(checks(), points[:, 0], seen(points), points[:, N:])


def no_view() -> tuple[Leaves, Leaves]:
    return both(checks(), np.empty((0, 3)), np.empty((0, N, 2)), None)


def another_tree() -> tuple[Leaves, Leaves]:
    """A star: four rays from one joint, two joints long, some of them checked by nothing."""
    parents = (-1, 0, 0, 0, 0, 1, 2, 3, 4)
    lengths = np.array([0.0] + [0.3] * 8)
    tree = InterpretationTree(joints=tuple("abcdefghi"), parents=parents, lengths=lengths)
    rng = np.random.default_rng(13)
    points = np.tile([0.0, 0.0, 3.0], (20, 9, 1))
    for joint in range(1, 9):
        step = rng.normal(size=(20, 3))
        points[:, joint] = (
            points[:, parents[joint]] + 0.3 * step / np.linalg.norm(step, axis=1, keepdims=True) * 0.999
        )
    return both([], points[:, 0], CAMERA.project(points), None, tree=tree)


CASES = (
    exact,
    legal,
    noisy,
    hidden,
    without_head,
    anatomical,
    anatomical_measured,
    projected_ranges,
    several_hypotheses,
    at_the_limits,
    measured,
    empty_frames,
    tangent_and_behind,
    uncalibrated,
    one_view,
    no_view,
    another_tree,
)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_both_paths_give_the_same_leaves_losses_findings_and_counts(
    case: Callable[[], tuple[Leaves, Leaves]],
) -> None:
    assert_same(*case())


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(compiled, "_numba", lambda: None)
    monkeypatch.setattr(compiled, "_LOADED", {})
    yield


@pytest.mark.usefixtures("uncompiled")
def test_the_loops_run_as_python_too() -> None:
    points = postures(14, 3)
    assert_same(*both(checks(), points[:, 0], seen(points), points[:, N:]))
    assert compiled.compiled(kernels) is kernels


def test_the_cases_lose_branches_for_every_reason() -> None:
    cases = (exact, hidden, tangent_and_behind)
    reasons = {group.check for case in cases for group in case()[1].pruned}
    lifts = {"no_solution", "coincident", "behind_camera", "missing"}
    assert reasons >= lifts | {"rigid_parts", "joint_range"}  # and collisions: see below


def at_a_pole(frames: int) -> np.ndarray:
    """Draw postures of which every fifth has an arm along its abduction axis: no screen is sure of it."""
    rng = np.random.default_rng(15)
    q = np.tile(pin.neutral(FIGURE.model), (frames, 1))
    q[:, :3] = [0.0, 0.0, 4.0]
    q[:, FIGURE.angle_index] = rng.uniform(FIGURE.limits.lower, FIGURE.limits.upper, (frames, 22))
    q[::5, FIGURE.angle_index[DOFS.index("right_shoulder.abduction")]] = np.pi / 2
    return FIGURE.forward_kinematics(q)


@pytest.mark.parametrize("size", [1, 4, 1000])
@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("frames", [1, 2, 23])
def test_blocks_and_threads_change_nothing(
    monkeypatch: pytest.MonkeyPatch, frames: int, threads: int, size: int
) -> None:
    points = at_a_pole(frames if NUMBA else min(frames, 6))
    suite = checks()
    whole = both(suite, points[:, 0], seen(points), points[:, N:])[0]
    for name in ("MIN_FRAMES", "MAX_FRAMES", "PLAIN_FRAMES"):
        monkeypatch.setattr(fast, name, size)
    compiled.use_threads(threads)
    try:
        with compiled.path("fast"):
            split = TREE.grow(CAMERA, points[:, 0], seen(points), suite, given=points[:, N:], tolerance=1e-9)
    finally:
        compiled.use_threads(None)
    assert_same(whole, split)


def test_frames_are_shared_out_evenly() -> None:
    for threads, frames in ((1, 1000), (2, 1015), (3, 100), (2, 9), (2, 30_001)):
        compiled.use_threads(threads)
        try:
            blocks = fast._blocks(frames, fast.MIN_FRAMES)
        finally:
            compiled.use_threads(None)
        assert [b for _, b in blocks[:-1]] == [a for a, _ in blocks[1:]]
        assert (blocks[0][0], blocks[-1][1]) == (0, frames)
        sizes = {b - a for a, b in blocks[:-1]}
        assert len(sizes) <= 1
        assert max(b - a for a, b in blocks) <= fast.MAX_FRAMES
        share = -(-frames // (threads * fast.BLOCKS_PER_THREAD)) if threads > 1 else frames
        assert max(b - a for a, b in blocks) == min(frames, max(share, fast.MIN_FRAMES), fast.MAX_FRAMES)


def test_threads_do_tasks_at_the_same_time() -> None:
    """Each waits for the other."""
    met = threading.Barrier(2, timeout=20.0)
    compiled.use_threads(2)
    try:
        assert sorted(fast._spread(lambda _: met.wait(), [0, 1])) == [0, 1]
    finally:
        compiled.use_threads(None)


def test_only_frames_of_which_a_rule_is_unsure_are_grown_by_numpy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    points = at_a_pole(20 if NUMBA else 6)
    left: list[int] = []
    grow_plainly = fast._grown_plainly

    def spy(*args: Any) -> FrameBlock:
        left.extend(args[-1].tolist())
        return grow_plainly(*args)

    monkeypatch.setattr(fast, "_grown_plainly", spy)
    plain, quick = both(checks(), points[:, 0], seen(points), points[:, N:])
    assert_same(plain, quick)
    assert left == list(range(0, len(points), 5))


def test_rows_that_are_too_few_are_made_more(monkeypatch: pytest.MonkeyPatch) -> None:
    points = postures(26, 40 if NUMBA else 3, beyond=0.0)
    for name in ("NODE_ROWS", "LEAF_ROWS", "LOSS_ROWS", "QUESTION_ROWS"):
        monkeypatch.setattr(stretches, name, 1)
    compiled.use_threads(1)
    try:
        assert_same(*both(checks(0.05, 3.0), points[:, 0], seen(points), points[:, N:], tolerance=0.05))
    finally:
        compiled.use_threads(None)


@pytest.mark.parametrize("ranges", ["urdf", "anatomical", "table1"])
def test_ordinary_trees_are_grown_whole(monkeypatch: pytest.MonkeyPatch, ranges: str) -> None:
    points = postures(30, 20 if NUMBA else 3, beyond=0.0)
    monkeypatch.setattr(fast, "_grown_plainly", None)
    monkeypatch.setattr(stretches, "_first_violated", None)
    monkeypatch.setattr(interpretation_tree, "plain", None)
    image = hide_some(seen(points), 31)
    suite = checks(0.05, 3.0, ranges)
    with compiled.path("fast"):
        assert len(TREE.grow(CAMERA, points[:, 0], image, suite, given=points[:, N:], tolerance=0.02).code)


@dataclass(frozen=True, kw_only=True)
class Apart(Check):
    """A check without a compiled form: some joints are no nearer to each other than this."""

    points: tuple[int, ...]
    least: float
    name: str = "apart"
    unit: str = "m"

    @property
    def places(self) -> tuple[Place, ...]:
        return tuple(Place(name=POINTS[point]) for point in self.points[1:])

    def judge(self, points: np.ndarray) -> Findings:
        value = np.linalg.norm(points[:, 1:] - points[:, :1], axis=-1)
        return Findings(value=value, lower=np.array([self.least]), upper=np.array([np.inf]))


def apart(*names: str, least: float) -> Apart:
    return Apart(points=tuple(JOINT[name] for name in names), least=least)


UNCOMPILED = {
    "of torso and hips": [apart("right_hip", "left_shoulder", "right_shoulder", least=0.5)],
    "of the first joint": [Apart(points=(JOINT["right_shoulder"], N), least=0.25)],
    "of the limbs": [
        apart("right_elbow", "pelvis", least=0.3),
        apart("left_wrist", "neck", least=0.35),
        apart("right_knee", "left_knee", least=0.2),
    ],
    "two at a level": [apart("left_elbow", "pelvis", least=0.3), apart("left_elbow", "neck", least=0.3)],
    "of the whole body": [apart("right_wrist", "left_wrist", "right_ankle", "left_ankle", least=0.4)],
    "of a given point": [Apart(points=(JOINT["right_wrist"], N), least=0.3)],
}


@pytest.mark.parametrize("place", ["first", "last"])
@pytest.mark.parametrize("kind", UNCOMPILED)
def test_a_check_without_a_compiled_form_is_asked_where_the_loop_stops_for_it(
    monkeypatch: pytest.MonkeyPatch, kind: str, place: str
) -> None:
    points = np.concatenate([at_a_pole(VIEWS // 4 + 1), postures(40, VIEWS // 4, beyond=0.1)])
    more = [replace(check, name=f"apart_{k}") for k, check in enumerate(UNCOMPILED[kind])]
    suite = [*more, *checks()] if place == "first" else [*checks(), *more]
    asked: list[int] = []
    plainly = fast._grown_plainly

    def spy(*args: Any) -> FrameBlock:
        asked.append(len(args[-1]))
        return plainly(*args)

    monkeypatch.setattr(fast, "_grown_plainly", spy)
    plain, quick = both(suite, points[:, 0], hide_some(seen(points), 41), points[:, N:])
    assert_same(plain, quick)
    assert {check.name for check in more} & {group.check for group in plain.pruned}
    assert sum(asked) < len(points)


def test_checks_without_a_compiled_form_alone_grow_the_same_trees() -> None:
    points = postures(42, VIEWS // 4 + 1)
    assert_same(*both(list(UNCOMPILED["of the limbs"]), points[:, 0], seen(points), None))


def test_noise_allowed_for_in_each_angle_grows_the_same_trees() -> None:
    points = postures(43, VIEWS // 4 + 1, beyond=0.1)
    suite = under_noise(checks(0.05, 1.0), 0.004)
    assert_same(*both(suite, points[:, 0], seen(points, noise=2.0), points[:, N:], tolerance=0.03))


def test_a_check_that_reads_more_points_than_the_loop_has_room_for_is_asked_in_between() -> None:
    rule = checks()[0].rule
    assert rule is not None
    first = tuple(range(N + 1))
    suite = checks()
    programme = programme_of([*([] for _ in range(N - 1)), suite], PARENTS, first, N + 1)
    assert [stretch.check for stretch in programme.stretches] == [None]
    assert len(programme.checks) == len(suite)
    wide: Any = SimpleNamespace(points=tuple(range(17)), rule=rule)
    programme = programme_of([*([] for _ in range(N - 1)), [wide, *suite]], PARENTS, first, N + 1)
    assert [stretch.check for stretch in programme.stretches] == [wide, None]
    assert programme.checks[:, 6].tolist() == list(range(1, len(suite) + 1))


@pytest.mark.parametrize("own", [False, True], ids=["one length", "a length a frame"])
def test_lifted_points_are_the_same_to_the_last_bit(own: bool) -> None:
    points = postures(16, 20)
    image = hide_some(seen(points, noise=2.0), 17)
    each = np.random.default_rng(18).uniform(0.95, 1.05, (N, 20, 1)) if own else np.ones((N, 1, 1))
    lengths = LENGTHS[:, None, None] * each
    plain = lift_all(
        CAMERA,
        points[:, 0],
        image,
        given=points[:, N:],
        parents=PARENTS,
        lengths=lengths if own else LENGTHS,
        tolerance=0.01,
    )
    quick = Candidates.start(points[:, 0], PARENTS, points[:, N:])
    compiled.compiled(kernels).lift(
        0,
        len(points),
        rays_of(CAMERA, image),
        np.isnan(image).any(axis=-1),
        np.array(PARENTS),
        np.array(quick.first),
        np.array(np.broadcast_to(lengths[..., 0], (N, 20))),
        0.01,
        quick.table,
        quick.states,
        quick.reach,
    )
    np.testing.assert_array_equal(quick.table, plain.table)
    np.testing.assert_array_equal(quick.states, plain.states)
    np.testing.assert_array_equal(quick.reach, plain.reach)


def test_a_plain_lift_is_the_camera_s() -> None:
    points = postures(18, 20)
    image = seen(points)
    candidates = lift_all(CAMERA, points[:, 0], image, parents=PARENTS, lengths=LENGTHS, tolerance=1e-9)
    for joint in (1, JOINT["right_wrist"], JOINT["left_ankle"]):
        start = candidates.positions[PARENTS[joint]]
        pixel = np.broadcast_to(image[:, joint, None], (*start.shape[:2], 2))
        lift = CAMERA.lift(start, pixel, LENGTHS[joint], tolerance=1e-9)
        expected = np.where(lift.valid[..., None], lift.points, np.nan).reshape(len(points), -1, 3)
        np.testing.assert_allclose(candidates.positions[joint], expected, rtol=0, atol=1e-9)


def test_where_coal_denies_what_was_presumed_the_plain_path_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    points = postures(19, 5)
    asked = []

    def deny(self: PairCollision, presumed: np.ndarray) -> bool:
        asked.append(len(presumed))
        return False

    monkeypatch.setattr(PairCollision, "confirm", deny)
    plain, quick = both(checks(), points[:, 0], seen(points), points[:, N:])
    assert asked
    assert_same(plain, quick)


def test_coal_confirms_every_collision(monkeypatch: pytest.MonkeyPatch) -> None:
    points = postures(20, 10 if NUMBA else 3, beyond=0.0)
    confirmed = []
    confirm = PairCollision.confirm

    def spy(self: PairCollision, presumed: np.ndarray) -> bool:
        confirmed.append((self.where[0], len(presumed)))
        return confirm(self, presumed)

    monkeypatch.setattr(PairCollision, "confirm", spy)
    collision = [check for check in checks() if check.name == "collision"]
    quick = both(collision, points[:, 0], seen(points), points[:, N:])[1]
    lost = {group.where[0] for group in quick.pruned if group.check == "collision"}
    assert lost and lost <= {pair for pair, _ in confirmed}


def fake_numba(on_disk: Exception | None) -> SimpleNamespace:
    """Make a module with a `njit` that leaves functions as they are."""

    def njit(types: str = "", *, cache: bool = False, **_: object) -> Callable[[object], object]:
        if cache and on_disk is not None:
            raise on_disk
        return lambda function: function

    return SimpleNamespace(njit=njit)


@pytest.mark.parametrize(
    "failure",
    [
        None,
        RuntimeError("cannot cache function: no locator available"),
        PermissionError("read-only"),
        EOFError(),
    ],
)
def test_without_a_folder_for_the_cache_it_is_compiled_for_this_process(
    monkeypatch: pytest.MonkeyPatch, failure: Exception | None
) -> None:
    monkeypatch.setattr(compiled, "_numba", lambda: fake_numba(failure))
    monkeypatch.setattr(compiled, "_LOADED", {})
    loops = compiled.compiled(kernels)
    assert set(vars(loops)) == {name for name, types in kernels.COMPILED_TYPES.items() if types}
    assert loops is compiled.compiled(kernels)
    assert_same(*one_view())
