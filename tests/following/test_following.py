"""Live following, bridging, smoothing, and the scale of lengths."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.following import (
    Beam,
    Follower,
    MotionModel,
    SurvivorFrame,
    best_paths,
    bridge,
    choose_scale,
    elevations,
    smooth,
)
from posekit.following.smoothing import START_DEVIATION, rts
from posekit.following.trellis import Trellis
from posekit.formats.own import OpenCVModel, View
from posekit.recovery import recover
from posekit.skeleton import JOINTS, TREE_SEGMENTS
from posekit.synthesis import CameraPlacements, Walker, walker_scene
from posekit.synthesis.camera_sphere import CameraSphere
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at

WIDE = Beam(coverage=1.0, survivors=10**5, width=40, slack=1e9)


def sequence(seed, sizes, *, move=0.05):
    """Draw frames whose survivors are off one moving posture, each by its own."""
    rng = np.random.default_rng(seed)
    posture = rng.normal(0, 0.4, (14, 3)) + np.array([0, 0, 4])
    velocity = rng.normal(0, 0.5, 3)
    return [
        SurvivorFrame(
            time=k / 30,
            joints=posture + velocity * k / 30 + rng.normal(0, move, (size, 14, 3)),
            cost=rng.exponential(2.0, size),
        )
        for k, size in enumerate(sizes)
    ]


def lengths(joints):
    start, end = np.array(TREE_SEGMENTS).T
    return np.linalg.norm(joints[..., end, :] - joints[..., start, :], axis=-1)


@settings(deadline=None, max_examples=15, derandomize=True)
@given(st.integers(0, 10**6), st.lists(st.integers(0, 6), min_size=1, max_size=9), st.integers(0, 3))
def test_a_lag_of_the_whole_sequence_is_offline(seed, sizes, more):
    frames = sequence(seed, sizes)
    follower = Follower(lag=len(frames) + more, beam=WIDE)
    assert [follower.push(frame) for frame in frames] == [None] * len(frames)
    estimates = follower.finish()
    path = best_paths(frames, beam=WIDE)
    assert [one.survivor for one in estimates] == path.survivor[0].tolist()
    np.testing.assert_array_equal(np.stack([one.joints for one in estimates]), path.joints[0])
    np.testing.assert_array_equal(np.stack([one.interpolated for one in estimates]), path.interpolated[0])
    assert [one.time for one in estimates] == path.time.tolist()


@settings(deadline=None, max_examples=10, derandomize=True)
@given(st.integers(0, 10**6), st.integers(0, 4))
def test_each_estimate_is_the_best_path_s_so_far(seed, lag):
    frames = sequence(seed, (4,) * 6)
    follower = Follower(lag=lag, beam=WIDE)
    for k, frame in enumerate(frames):
        estimate = follower.push(frame)
        assert (estimate is None) == (k < lag)
        if estimate is not None:
            so_far = best_paths(frames[: k + 1], beam=WIDE)
            assert estimate.frame == k - lag
            assert estimate.survivor == so_far.survivor[0, k - lag]
            assert estimate.confidence == pytest.approx(so_far.confidence[0, k - lag])
    assert [one.frame for one in follower.finish()] == list(range(6 - lag, 6))
    assert follower.finish() == []


def test_a_follower_forgets_what_it_told():
    follower = Follower(lag=3)
    for frame in sequence(1, (6,) * 200):
        follower.push(frame)
    assert len(follower._frames) == len(follower._trellis.stages) == 3
    assert len(follower._known) <= 8


def test_covariances_stay_covariances_however_long_a_sequence_is():
    rng = np.random.default_rng(2)
    posture = sequence(0, (1,))[0].joints[0]
    root = rng.normal(0, [[0.01], [0.01], [0.2]], (3, 14, 3, 3))
    trellis = Trellis(MotionModel(), Beam())
    for k in range(600):
        joints = posture + rng.normal(0, 0.05, (3, 14, 3))
        trellis.push(SurvivorFrame(time=k / 30, joints=joints, covariance=root @ root.swapaxes(-1, -2)))
    ends = trellis.ends
    both, turned = ends.of_both, ends.of_both.swapaxes(-1, -2)
    assert np.linalg.eigvalsh(np.block([[ends.of_place, both], [turned, ends.of_velocity]])).min() > 0


def test_a_follower_goes_on_where_nothing_survives():
    """The neck coasts on for a while, the limbs keep their directions, and the person is found again."""
    posture = np.array(sequence(0, (1,))[0].joints[0])
    follower = Follower(lag=0)
    told = []
    for k in range(40):
        joints = posture[None] + np.array([0.02 * k, 0, 0]) if not 10 <= k < 30 else np.empty((0, 14, 3))
        one = follower.push(SurvivorFrame(time=k / 30, joints=joints))
        assert one is not None
        told.append(one)
    assert [one.bridged for one in told] == [10 <= k < 30 for k in range(40)]
    for k, one in enumerate(told):
        np.testing.assert_allclose(lengths(one.joints), lengths(posture), atol=1e-9)
        if k < 15 or k >= 30:
            np.testing.assert_allclose(one.joints, posture + np.array([0.02 * k, 0, 0]), atol=1e-9)
    assert told[29].joints[0, 0] == pytest.approx(posture[0, 0] + 0.02 * 15, abs=1e-9)


def test_a_follower_remembers_a_joint_however_long_it_is_not_seen():
    posture = np.array(sequence(0, (1,))[0].joints[0])
    hidden = posture.copy()
    hidden[9] = np.nan
    follower = Follower(lag=2)
    for k in range(100):
        told = follower.push(SurvivorFrame(time=k / 30, joints=(posture if k < 3 else hidden)[None]))
    assert told is not None
    assert told.interpolated.tolist() == [joint == 9 for joint in range(14)]
    np.testing.assert_allclose(told.joints, posture, atol=1e-9)
    assert len(follower._known) <= 10


@pytest.mark.parametrize("lag", [-1, 1.5, True, None])
def test_lags_that_are_none(lag):
    with pytest.raises(InputError, match="lag is"):
        Follower(lag=lag)


def test_a_frame_that_comes_too_early_is_refused():
    first, second = sequence(0, (2, 2))
    for lag in (0, 5):
        follower = Follower(lag=lag)
        follower.push(second)
        with pytest.raises(InputError, match="ascending"):
            follower.push(first)


@pytest.mark.parametrize("sizes", [(0,), (0, 0, 0), (0, 0, 3, 0, 0)])
def test_sequences_of_almost_nothing(sizes):
    paths = best_paths(sequence(1, sizes), k=3, apart=0.0, beam=WIDE)
    known = max(sizes) > 0
    assert len(paths) == (3 if known else 1)
    assert np.isfinite(paths.joints).all() == known
    assert paths.bridged[0].tolist() == [size == 0 for size in sizes]


@settings(deadline=None, max_examples=20, derandomize=True)
@given(st.integers(0, 10**6), st.integers(3, 12))
def test_bridges_keep_lengths_and_what_is_known(seed, count):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.02, 0.2, count))
    posture = np.zeros((count, 14, 3))
    posture[:, 0] = rng.normal(0, 1, (count, 3)) + np.array([0, 0, 4])
    for start, end in TREE_SEGMENTS:
        way = rng.normal(size=(count, 3))
        posture[:, end] = posture[:, start] + 0.3 * way / np.linalg.norm(way, axis=1, keepdims=True)
    gone = rng.random((count, 14)) < 0.4
    gone[:, 0] &= rng.random(count) < 0.5
    gone[rng.integers(count)] = False
    filled = bridge(time, np.where(gone[..., None], np.nan, posture))
    np.testing.assert_array_equal(filled[~gone], posture[~gone])
    assert np.isfinite(filled).all()
    for start, end in TREE_SEGMENTS:
        # A segment whose end is placed has its length; one whose start alone is placed goes to where its end is seen.
        rows = gone[:, end]
        np.testing.assert_allclose(
            np.linalg.norm(filled[rows, end] - filled[rows, start], axis=1), 0.3, atol=1e-9
        )


def test_a_bridged_segment_turns_evenly():
    time = np.array([0.0, 0.1, 0.3, 0.4])
    joints = np.zeros((4, 14, 3))
    joints[:, :, 2] = 3.0 + 0.1 * np.arange(14)
    joints[:, 8] = joints[:, 6] + [0.25, 0, 0]
    joints[3, 8] = joints[3, 6] + [0, 0.25, 0]
    joints[1:3, 8] = np.nan
    filled = bridge(time, joints)
    angle = np.degrees(np.arctan2(*(filled[:, 8] - filled[:, 6]).T[1::-1]))
    np.testing.assert_allclose(angle, [0, 22.5, 67.5, 90], atol=1e-9)


def test_opposite_directions_have_no_shortest_way():
    joints = np.zeros((3, 14, 3))
    joints[:, :, 2] = 3.0 + 0.1 * np.arange(14)
    joints[2, 8] = 2 * joints[2, 6] - joints[2, 8]
    joints[1, 8] = np.nan
    filled = bridge(np.arange(3.0), joints)
    np.testing.assert_allclose(lengths(filled)[1], lengths(filled)[0], atol=1e-12)


def test_what_is_never_known_stays_unknown():
    joints = np.full((3, 14, 3), np.nan)
    joints[:, 0] = 1.0
    assert np.isnan(bridge(np.arange(3.0), joints)[:, 1:]).all()


@settings(deadline=None, max_examples=15, derandomize=True)
@given(st.integers(0, 10**6))
def test_the_smoother_is_the_least_squares_solution(seed):
    """Solve for all places and velocities at once, with the motion and its start as equations."""
    rng = np.random.default_rng(seed)
    count, density, one = 6, float(rng.uniform(0.5, 50)), np.eye(3)
    time = np.cumsum(rng.uniform(0.01, 0.3, count))
    value, root = rng.normal(0, 1, (count, 3)), rng.normal(0, 0.1, (count, 3, 3))
    covariance = root @ root.swapaxes(1, 2) + 1e-4 * one
    measured = rng.random(count) < 0.7
    measured[:2] = True
    rows, right = [], []

    def add(block, at, wanted, noise):
        W = np.linalg.inv(np.linalg.cholesky(noise))
        row = np.zeros((len(noise), 6 * count))
        row[:, 6 * at : 6 * at + block.shape[1]] = block
        rows.append(W @ row)
        right.append(W @ wanted)

    add(np.eye(6), 0, np.append(value[0], np.zeros(3)), START_DEVIATION**2 * np.eye(6))
    for k in np.flatnonzero(measured).tolist():
        add(np.eye(3, 6), k, value[k], covariance[k])
    for k in range(count - 1):
        dt = time[k + 1] - time[k]
        F = np.kron([[1, dt], [0, 1]], one)
        noise = density * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], one)
        add(np.hstack([-F, np.eye(6)]), k, np.zeros(6), noise)
    A = np.concatenate(rows)
    solved = np.linalg.lstsq(A, np.concatenate(right), rcond=None)[0].reshape(count, 6)[:, :3]
    spread = np.diag(np.linalg.inv(A.T @ A)).reshape(count, 6)[:, :3].sum(axis=1) ** 0.5
    found, deviation = rts(time, value[:, None], covariance[:, None], measured[:, None], np.array([density]))
    np.testing.assert_allclose(found[:, 0], solved, atol=1e-5)
    np.testing.assert_allclose(deviation[:, 0], spread, rtol=1e-4)


def walking(frames=40, seed=0, noise=0.0):
    """Return times, true joints, and the same with noise along the rays."""
    scene = walker_scene(Walker(), camera=(3.0, 0.2, 2.0), frames=frames, dt=1 / 30)
    true = scene.joints_cam
    distance = np.linalg.norm(true, axis=2, keepdims=True)
    off = noise * np.random.default_rng(seed).standard_normal(distance.shape)
    return scene.time, true, true * (1 + off / distance)


def test_smoothing_takes_noise_away():
    time, true, noisy = walking(noise=0.04)
    smoothed, deviation = smooth(time, noisy, 0.04)
    before = np.linalg.norm(noisy - true, axis=-1).mean()
    after = np.linalg.norm(smoothed - true, axis=-1).mean()
    assert after < 0.85 * before
    assert (deviation < 0.04).all()
    np.testing.assert_allclose(lengths(smoothed), lengths(noisy), atol=1e-9)


def test_what_is_known_exactly_is_left():
    time, true, _ = walking()
    smoothed, _ = smooth(time, true, 0.0)
    assert np.abs(smoothed - true).max() < 1e-3


def test_the_root_alone_takes_the_posture_along():
    time, true, noisy = walking(noise=0.05)
    shifted = true + (noisy[:, :1] - true[:, :1])
    smoothed, deviation = smooth(time, shifted, 0.05, root_alone=True)
    np.testing.assert_allclose(smoothed - smoothed[:, :1], shifted - shifted[:, :1], atol=1e-12)
    off = np.abs(smoothed[:, 0, 2] - true[:, 0, 2])
    assert off.mean() < 0.5 * np.abs(shifted[:, 0, 2] - true[:, 0, 2]).mean()
    assert np.isnan(deviation[:, 1:]).all()


def test_smoothing_bridges_what_has_no_deviation():
    time, true, _ = walking()
    broken = true.copy()
    broken[10:13] *= 1.2
    deviation = np.full((len(time), 14), 0.01)
    deviation[10:13] = np.inf
    smoothed, _ = smooth(time, broken, deviation)
    assert np.linalg.norm(smoothed[10:13, 0] - true[10:13, 0], axis=-1).max() < 0.03


def test_unknown_joints_stay_unknown():
    time, true, _ = walking()
    true = true.copy()
    true[:, 9] = np.nan
    true[5, 13] = np.nan
    smoothed, _ = smooth(time, true, 0.02)
    np.testing.assert_array_equal(np.isnan(smoothed), np.isnan(true))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"joints": np.zeros((3, 13, 3))}, "joints have shape"),
        ({"time": [0.0, 2.0, 1.0]}, "ascending"),
        ({"time": [0.0, 1.0]}, "time has shape"),
        ({"deviation": np.zeros(5)}, "does not fit"),
        ({"deviation": -1.0}, "zero or more"),
        ({"deviation": math.nan}, "zero or more"),
        ({"acceleration": 0.0}, "positive and finite"),
    ],
)
def test_what_cannot_be_smoothed(change, says):
    given = {"time": [0.0, 1.0, 2.0], "joints": np.ones((3, 14, 3)), "deviation": 0.1, **change}
    with pytest.raises(InputError, match=says):
        smooth(given.pop("time"), given.pop("joints"), given.pop("deviation"), **given)


def recovered(yaw, scale=1.0, frames=30):
    """Recover a walker whose lengths are told `scale` times as long as they are."""
    walker, sphere = Walker(), CameraSphere()
    time = np.arange(frames) / 30
    q = walker.configurations(walker.phase(time, 0.1))
    q[:, :3] += walker.travel(time, 0.1)
    points = walker.figure.forward_kinematics(q)
    middle = points.reshape(-1, 3).mean(axis=0)
    position = middle + 4 * np.array([math.cos(math.radians(yaw)), 0.05, math.sin(math.radians(yaw))])
    R = np.broadcast_to(look_at(position, middle, np.array([0.0, 1.0, 0.0])), (frames, 3, 3))
    scene = observe(
        walker.figure,
        sphere.camera,
        points,
        CameraPlacements(R, np.broadcast_to(position, (frames, 3))),
        time=time,
    )
    view = View(
        camera=OpenCVModel(K=scene.camera.K),
        time=time,
        image=scene.image,
        root=scene.joints_cam[:, 0],
        lengths={name: length * scale for name, length in scene.figure.lengths.items()},
    )
    sets = [
        SurvivorFrame(time=frame.time, joints=frame.joints, branches=frame.branches)
        for frame in recover(view).frames
    ]
    return sets, scene.joints_cam


@pytest.mark.parametrize("yaw", [60.0, 200.0])
def test_a_walker_is_followed(yaw):
    frames, true = recovered(yaw)
    path = best_paths(frames)
    error = np.linalg.norm(path.joints[0] - true, axis=-1).mean()
    chance = np.mean(
        [np.linalg.norm(f.joints - t, axis=-1).mean() for f, t in zip(frames, true, strict=True)]
    )
    assert error < 0.015
    assert error < 0.6 * chance
    follower = Follower(lag=10)
    live = [one for frame in frames if (one := follower.push(frame)) is not None] + follower.finish()
    assert np.linalg.norm(np.stack([one.joints for one in live]) - true, axis=-1).mean() < 0.02
    assert path.codes[0][3] == frames[3].branches[path.survivor[0, 3]]


def test_the_scale_of_the_lengths_is_found():
    sets = {scale: recovered(200.0, scale)[0] for scale in (0.985, 1.0, 1.02, 1.06)}
    choice = choose_scale(sets)
    assert choice.scale == 1.0
    assert choice.between == pytest.approx(1.0, abs=0.02)
    assert choice.paths[choice.best].cost[0] == choice.cost.min()


def test_scales_that_are_none():
    frames = sequence(0, (2, 2))
    for sets, says in (
        ({}, "no scale"),
        ({-1.0: frames}, "impossible"),
        ({math.nan: frames}, "impossible"),
        ({1.0: frames, 1.1: frames[:1]}, "same times"),
    ):
        with pytest.raises(InputError, match=says):
            choose_scale(sets)


def test_sides_are_those_of_the_rays():
    joints = np.tile([1.0, 0.0, 1.0], (14, 1))
    for start, end in TREE_SEGMENTS:
        joints[end] = joints[start] + [0.2, 0.0, 0.1]
    assert (elevations(joints) > 0).all()
    assert (elevations(joints, perspective=False) > 0).all()
    joints[JOINTS.index("right_shoulder")] = joints[0] + [-0.2, 0.0, 0.1]
    assert elevations(joints)[0] < 0  # nearer to the camera, though deeper
    assert elevations(joints, perspective=False)[0] > 0
