"""The central claim: with exact image points the true posture is always among the survivors.

And the survivors are all that can be: those of brute force over all 8192 leaves. Whatever can be asked of
something else than posekit's own checks is asked there: projection and lengths are calculated here, kinematics
and collisions are Pinocchio's on the whole body.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.formats.own import View
from posekit.recovery import recover
from posekit.recovery.recovery import Recovery
from posekit.settings import EXACT_TOLERANCE
from posekit.skeleton import DOFS, HEAD, PARENTS, SEGMENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import CameraPlacements, CameraSphere, SyntheticScene, random_postures, random_views
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at
from posekit.tree import enumerate_leaves
from posekit.validators import judge, load_ranges, make_checks
from posekit.views.builtin import view_of

FIGURE = load_figure()
VIEWS, CHUNKS = 10_000, 4
BRUTE_VIEWS, BRUTE_CHUNKS = 200, 4
FOUND = 1e-6
"""Metres within which a survivor is the truth."""
LEAVES = 8192
UP = np.array([0.0, 0.0, 1.0])
FALLBACKS = VIEWS // 1000
"""Frames that may be judged as measured: fewer than 0.1 %."""


class Chunk(NamedTuple):
    scene: SyntheticScene
    view: View
    recovery: Recovery

    @property
    def joints(self) -> np.ndarray:
        """All survivors of all frames (N, 14, 3)."""
        return np.concatenate([frame.joints for frame in self.recovery.frames])

    @property
    def frame(self) -> np.ndarray:
        """The frame of each survivor (N,)."""
        return np.repeat(np.arange(len(self.scene)), [len(frame) for frame in self.recovery.frames])

    @property
    def exact(self) -> np.ndarray:
        """Which frames were judged as exact (F,)."""
        return np.array([frame.tolerance == EXACT_TOLERANCE for frame in self.recovery.frames])


def recovered(scene: SyntheticScene) -> Chunk:
    view = view_of(scene)
    return Chunk(scene, view, recover(view, length_deviation=0.0, ranges="urdf"))


@lru_cache(maxsize=1)
def chunk_of(index: int) -> Chunk:
    return recovered(
        random_views(FIGURE, VIEWS // CHUNKS, np.random.default_rng([1985, index]), ranges="urdf")
    )


@pytest.fixture(scope="module", params=range(CHUNKS))
def chunk(request: pytest.FixtureRequest) -> Chunk:
    return chunk_of(request.param)


def distance_to_truth(chunk: Chunk) -> np.ndarray:
    """Return how far the nearest survivor of each frame is from the truth (F,), by its worst joint."""
    apart = np.linalg.norm(chunk.joints - chunk.scene.joints_cam[chunk.frame], axis=-1).max(axis=1)
    nearest = np.full(len(chunk.scene), np.inf)
    np.minimum.at(nearest, chunk.frame, apart)
    return nearest


def worst_length(chunk: Chunk) -> float:
    """Return the largest error of any of the 17 lengths of any survivor of a frame judged as exact, metres."""
    joints = chunk.joints[chunk.exact[chunk.frame]]
    errors = [
        np.linalg.norm(joints[:, a] - joints[:, b], axis=-1) - FIGURE.lengths[segment_name((a, b))]
        for a, b in SEGMENTS
    ]
    return float(np.abs(errors).max())


def some(chunk: Chunk, count: int) -> np.ndarray:
    """Draw some survivors, by index."""
    return np.sort(np.random.default_rng(7).choice(len(chunk.joints), count, replace=False))


def test_the_truth_is_among_the_survivors_every_time(chunk: Chunk) -> None:
    apart = distance_to_truth(chunk)
    assert apart.shape == (VIEWS // CHUNKS,)
    assert (apart < FOUND).all()


def test_exact_views_are_judged_as_exact(chunk: Chunk) -> None:
    exact = chunk.exact
    assert (~exact).sum() < FALLBACKS / CHUNKS


def test_every_survivor_reprojects(chunk: Chunk) -> None:
    K = chunk.scene.camera.K
    rays = chunk.joints / chunk.joints[..., 2:]
    assert (chunk.joints[..., 2] > 0).all()
    assert chunk.scene.size is not None
    error = np.abs((rays @ K.T)[..., :2] - chunk.scene.image[chunk.frame])
    assert error.max() < 1e-9 * max(chunk.scene.size)


def test_every_survivor_keeps_all_17_lengths(chunk: Chunk) -> None:
    assert len(SEGMENTS) == 17
    assert worst_length(chunk) < 1e-9


def test_every_leaf_is_accounted_for(chunk: Chunk) -> None:
    assert {len(frame) + sum(frame.rejected.values()) for frame in chunk.recovery.frames} == {LEAVES}


def test_levels_end_at_the_survivors_and_never_decrease(chunk: Chunk) -> None:
    for frame in chunk.recovery.frames:
        physical = frame.levels["physical"]
        assert physical[0] == 1
        assert physical[-1] == len(frame)
        assert (np.diff(physical) >= 0).all()


def test_branch_codes_are_unique_and_sorted(chunk: Chunk) -> None:
    for frame in chunk.recovery.frames:
        codes = frame.branches
        assert codes == sorted(set(codes))
        assert {len(code) for code in codes} == {13}


def test_forward_kinematics_gives_the_joints_back(chunk: Chunk) -> None:
    rows = some(chunk, 2000 // CHUNKS)
    q = np.concatenate([frame.q for frame in chunk.recovery.frames])[rows]
    distance = np.concatenate([frame.fk_distance for frame in chunk.recovery.frames])
    joints = FIGURE.forward_kinematics(q)[:, :14]
    apart = np.linalg.norm(joints - chunk.joints[rows], axis=-1).max(axis=1)
    exact = chunk.exact[chunk.frame]
    assert apart[exact[rows]].max() < 1e-9
    assert distance[exact].max() < 1e-9
    np.testing.assert_allclose(distance[rows], apart, rtol=0, atol=1e-14)


def test_q_is_inside_the_limits(chunk: Chunk) -> None:
    """To 1e-3 degrees; an almost straight limb's axial rotation to that over the sine of its bend (see `Limb`)."""
    model = FIGURE.model
    q = np.concatenate([frame.q for frame in chunk.recovery.frames])[chunk.exact[chunk.frame]]
    outside = np.degrees(np.maximum(model.lowerPositionLimit - q, q - model.upperPositionLimit)[:, 7:])
    allowed = np.full_like(outside, 1e-3)
    for dof in DOFS:
        joint, angle = dof.split(".")
        if angle == "rotation" and joint.endswith(("shoulder", "hip")):
            hinge = joint.replace("shoulder", "elbow").replace("hip", "knee")
            place = dict(zip(FIGURE.configuration_names, range(model.nq), strict=True))
            bend = np.abs(np.sin(q[:, place[f"{hinge}_flexion"]]))
            allowed[:, place[f"{joint}_rotation"] - 7] /= np.maximum(bend, 1e-3 / 180)
    assert (outside <= allowed).all()


def test_pinocchios_whole_body_is_free_of_collision(chunk: Chunk) -> None:
    model, geometry = FIGURE.model, FIGURE.geometry
    data, geometry_data = model.createData(), geometry.createData()
    q = np.concatenate([frame.q for frame in chunk.recovery.frames])[some(chunk, 500)]
    assert not any(pin.computeCollisions(model, data, geometry, geometry_data, row, True) for row in q)


@lru_cache(maxsize=1)
def pool() -> pin.GeometryPool:
    return pin.GeometryPool(FIGURE.model, FIGURE.geometry, 1)


def hit(q: np.ndarray) -> np.ndarray:
    """Ask Pinocchio's pool about whole bodies (N, nq)."""
    return np.asarray(pin.computeCollisionsInParallel(1, pool(), np.asfortranarray(q.T), True)).astype(bool)


@pytest.mark.parametrize(
    ("ranges", "index", "count"),
    [*(("urdf", index, BRUTE_VIEWS // BRUTE_CHUNKS) for index in range(BRUTE_CHUNKS)), ("table1", 9, 10)],
)
def test_survivors_are_those_of_brute_force(ranges: str, index: int, count: int) -> None:
    """All 8192 leaves, each lifted and judged on its own; collision once more by Pinocchio, on q."""
    scene = random_views(FIGURE, count, np.random.default_rng([2000, index]), ranges="urdf")
    view = view_of(scene)
    recovery = recover(view, ranges=ranges, tolerance=EXACT_TOLERANCE)
    lengths = np.array([0.0, *(FIGURE.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)])
    checks = make_checks(
        FIGURE,
        ("rigid-parts", "joint-range", "collision"),
        ranges=load_ranges(ranges),
        rigid_tolerance=EXACT_TOLERANCE.rigid,
        angle_tolerance=EXACT_TOLERANCE.angle,
    )
    for k, frame in enumerate(recovery.frames):
        leaves, codes = enumerate_leaves(
            scene.camera,
            recovery.fit.root[k],
            view.image[k],
            parents=PARENTS,
            lengths=lengths,
            tolerance=EXACT_TOLERANCE.tangent,
        )
        head = np.broadcast_to(recovery.fit.head[k], (len(leaves), len(HEAD), 3))
        points = np.concatenate([leaves, head], axis=1)
        violated = {
            judgement.check: np.asarray(judgement.violated.any(axis=1)) for judgement in judge(checks, points)
        }
        possible = ~violated["rigid_parts"] & ~violated["joint_range"]
        survivors = [int(code, 2) for code in frame.branches]
        assert codes[possible & ~violated["collision"]].tolist() == survivors
        possible[np.flatnonzero(possible)] = ~hit(FIGURE.inverse_kinematics(points[possible]))
        assert codes[possible].tolist() == survivors


def test_a_check_less_never_loses_a_survivor() -> None:
    view = view_of(random_views(FIGURE, 50, np.random.default_rng(11), ranges="urdf"))
    for ranges in ("urdf", "table1"):
        all_three, two, one = (
            recover(
                view,
                checks=("rigid-parts", "joint-range", "collision")[:count],
                ranges=ranges,
                length_deviation=0.0,
            ).frames
            for count in (3, 2, 1)
        )
        for strict, looser, loosest in zip(all_three, two, one, strict=True):
            assert set(strict.branches) <= set(looser.branches) <= set(loosest.branches)


def at_the_limits(count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw configurations with most angles exactly at a limit, at zero (a straight limb) or at a quarter turn."""
    lower, upper = FIGURE.limits.lower, FIGURE.limits.upper
    shape = (count, len(lower))
    quarter = np.clip(np.pi / 2 * rng.integers(-1, 3, shape), lower, upper)
    places = [np.broadcast_to(values, shape) for values in (lower, upper, np.clip(0.0, lower, upper))]
    angles = np.choose(rng.integers(0, 5, shape), [*places, quarter, rng.uniform(lower, upper, shape)])
    q = np.tile(pin.neutral(FIGURE.model), (count, 1))
    q[:, FIGURE.angle_index] = angles
    free = ~hit(q)
    return np.asarray(q[free])


def test_limits_met_exactly_and_straight_limbs_are_no_exception() -> None:
    rng = np.random.default_rng(3)
    q = at_the_limits(2000, rng)
    points = FIGURE.forward_kinematics(q)
    assert len(q) > 500
    axes = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [1, 1, 0], [1, 0, 1]])
    direction = axes[rng.integers(0, len(axes), len(q))]
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    target = points[np.arange(len(q)), rng.integers(0, 14, len(q))]
    position = target + 4.0 * direction
    scene = observe(
        FIGURE, CameraSphere().camera, points, CameraPlacements(look_at(position, target, UP), position), q=q
    )
    chunk = recovered(scene)
    apart, exact = distance_to_truth(chunk), chunk.exact
    assert (apart < FOUND).all()
    assert exact.mean() > 0.999
    assert worst_length(chunk) < 1e-9


def square_on(off: float, count: int = 200) -> Chunk:
    """See one segment of each posture so that its two candidate ends are 2 off (m) apart: tangent at zero."""
    rng = np.random.default_rng(3)
    points = FIGURE.forward_kinematics(random_postures(FIGURE, count, rng))
    segment = np.array(TREE_SEGMENTS)[rng.integers(0, len(TREE_SEGMENTS), count)]
    start, end = points[np.arange(count), segment[:, 0]], points[np.arange(count), segment[:, 1]]
    length = np.linalg.norm(end - start, axis=1, keepdims=True)
    axis = (end - start) / length
    side = rng.normal(size=(count, 3))
    side -= (side * axis).sum(axis=1, keepdims=True) * axis
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    position = end + 4.0 * (side * np.cos(off / length) + axis * np.sin(off / length))
    R = look_at(position, end, np.array([0.1, 0.2, 1.0]))
    return recovered(observe(FIGURE, CameraSphere().camera, points, CameraPlacements(R, position)))


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-6, 1e-5])
def test_a_segment_square_to_its_ray_keeps_the_truth(off: float) -> None:
    chunk = square_on(off)
    apart, exact = distance_to_truth(chunk), chunk.exact
    assert (apart < FOUND).all()
    assert exact.all()
    met = ["coincident/" in " ".join(frame.rejected) for frame in chunk.recovery.frames]
    assert sum(met) > 0.95 * len(met) or off > 1e-7


@pytest.mark.parametrize("off", [3e-8, 1e-7])
def test_two_ends_too_near_to_tell_apart_become_one_and_keep_the_truth(off: float) -> None:
    """Ends less than 1e-7 m from their middle count as one: no more exact, but the truth is not lost.

    Where the next segment is almost square to its ray as well, the 1e-7 m grow to some 1e-5 at its end.
    """
    chunk = square_on(off)
    apart, exact = distance_to_truth(chunk), chunk.exact
    assert (apart < 1e-4).all()
    assert np.median(apart) < 2e-7
    assert 0.5 < exact.mean() < 1
