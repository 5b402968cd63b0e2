"""Following: brute force over paths, least squares for the smoother, and the live tracker beside the whole sequence."""

import io
import itertools
import json

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.following import Tracker, follow
from posekit.following.kalman import DENSITY, Moving, smooth, steps
from posekit.following.lines import answers
from posekit.following.paths import SKIP, Candidates, Trellis, _usual_step, step_costs
from posekit.recovery import Answer, Frames, Recovery, Survivors

FIGURE = load_figure()
STANDING = FIGURE.neutral_points[:14] + np.array([0.0, 0.0, 4.0])
LENGTHS = dict(FIGURE.lengths)


def recovery_of(frames, probability=None, radius=0.0, step=1 / 30):
    """A recovery of frames with given survivors (N, 14, 3)."""
    joints = np.concatenate(frames)
    counts = [len(one) for one in frames]
    p = (
        np.concatenate([np.full(n, 1 / n) for n in counts])
        if probability is None
        else np.concatenate(probability)
    )
    return Recovery(
        survivors=Survivors(
            frame=np.repeat(np.arange(len(frames)), counts),
            joints=joints,
            q=np.zeros((len(joints), FIGURE.model.nq)),
            probability=p,
            radius=np.full((len(joints), 14), radius),
        ),
        frames=Frames(time=np.arange(len(frames)) * step),
        answer=Answer(joints=np.full((len(frames), 14, 3), np.nan), sure=np.full(len(frames), np.nan)),
        lengths=LENGTHS,
    )


def cost_of(frames, path):
    """The cost of one path, step by step; -1 passes a frame over."""
    ends, total, last = Moving.nothing(1), 0.0, None
    for frame, one in zip(frames, path, strict=True):
        led = ends.after(1.0 if last is None else frame.time - last)
        last = frame.time
        weight = 0.25 if frame.covariance.any() else 1.0
        if one < 0:
            total += SKIP + weight * _usual_step(frame.covariance[0], np.ones(14, dtype=bool))
            ends = led
            continue
        joints, covariance = frame.joints[[one]], frame.covariance[[one]]
        total += weight * step_costs(ends, led, joints, covariance)[0, 0] + frame.cost[one]
        ends = led.given(joints, covariance)
    return total


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_cheapest_path_is_that_of_brute_force(seed, noise):
    rng = np.random.default_rng(seed)
    frames = []
    for k in range(3):
        joints = STANDING + 0.03 * rng.normal(size=(3, 1, 3)) + 0.02 * rng.normal(size=(3, 14, 3))
        covariance = np.broadcast_to(noise**2 * np.eye(3), (3, 14, 3, 3))
        frames.append(Candidates(k / 30, joints, covariance, rng.uniform(0, 0.3, 3)))
    trellis = Trellis()
    for frame in frames:
        trellis.push(frame)
    every = {path: cost_of(frames, path) for path in itertools.product(range(-1, 3), repeat=3)}
    best = min(every, key=every.get)
    assert tuple(trellis.cheapest_path()) == best
    assert trellis.cheapest.min() == pytest.approx(every[best], rel=1e-9)
    for share in trellis.marginals():
        assert share.sum() == pytest.approx(1.0)


def test_smoother_is_the_least_squares_solution():
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.02, 0.06, 6))
    joints = rng.normal(size=(6, 14, 3)) * 0.1
    joints[3] = np.nan
    A = rng.normal(size=(6, 14, 3, 3)) * 0.02
    covariance = A @ A.swapaxes(-1, -2) + 1e-4 * np.eye(3)
    found, _ = smooth(time, joints, covariance)
    j = 7
    # Normal equations over all states of one joint: a start, the motion, and the measurements.
    size = 6 * len(time)
    H, g = np.zeros((size, size)), np.zeros(size)
    H[:6, :6] += np.diag([1e-4] * 3 + [1 / 1.5**2] * 3)
    for k in range(len(time)):
        if k:
            F, noise = steps(time[k] - time[k - 1])
            J = np.zeros((6, size))
            J[:, 6 * k - 6 : 6 * k], J[:, 6 * k : 6 * k + 6] = -F, np.eye(6)
            H += J.T @ np.linalg.inv(DENSITY[j] * noise) @ J
        if np.isfinite(joints[k, j, 0]):
            W = np.linalg.inv(covariance[k, j] + 1e-8 * np.eye(3))
            H[6 * k : 6 * k + 3, 6 * k : 6 * k + 3] += W
            g[6 * k : 6 * k + 3] += W @ joints[k, j]
    expected = np.linalg.solve(H, g).reshape(-1, 6)[:, :3]
    np.testing.assert_allclose(found[:, j], expected, atol=1e-6)


def test_a_jump_is_passed_over_and_bridged():
    still = [STANDING[None] + [0.01 * k, 0, 0] for k in range(9)]
    away = [*still[:4], still[4] + [3.0, 0, 0], *still[5:]]
    path = follow(recovery_of(away, radius=0.02)).path
    assert path.survivor[0].tolist() == [0, 1, 2, 3, -1, 5, 6, 7, 8]
    assert np.abs(path.joints[0, 4] - still[4][0]).max() < 0.02
    assert SKIP > 0


def test_the_path_keeps_to_one_body_and_to_the_lengths():
    rng = np.random.default_rng(1)
    frames, probability = [], []
    for k in range(8):
        near = STANDING + np.array([0.02 * k, 0, 0])
        far = near * [1, 1, 1] + 0.3 * np.eye(14)[8][:, None] * [0, 0, 1]
        order = [near, far] if k != 3 else [far, near]
        frames.append(np.stack(order) + 0.001 * rng.normal(size=(2, 14, 3)))
        probability.append(np.array([0.75, 0.25]))
    found = follow(recovery_of(frames, probability, radius=0.03), paths=2)
    chosen = found.path.survivor[0] - 2 * np.arange(8)
    assert chosen.tolist() == [0, 0, 0, 1, 0, 0, 0, 0]
    assert len(found.path) == 2 and found.path.probability.sum() == pytest.approx(1.0)
    assert found.path.probability[0] > found.path.probability[1]
    upper_arm = np.linalg.norm(found.path.joints[0, :, 6] - found.path.joints[0, :, 1], axis=1)
    np.testing.assert_allclose(upper_arm, LENGTHS["right_shoulder-right_elbow"], atol=1e-4)


def test_exact_points_keep_their_survivors():
    view = posekit.builtin_view("seq1")
    found = follow(posekit.recover(view), paths=2)
    rows, joints = found.path.survivor[0], found.survivors.joints
    assert (rows >= 0).all()
    np.testing.assert_allclose(found.path.joints[0], joints[rows], atol=1e-12)
    np.testing.assert_array_equal(found.survivors.frame[rows], np.arange(5))
    assert len(found.motion("path")) == 5


def test_impossible_sequences_are_refused():
    with pytest.raises(posekit.InputError, match="do not ascend"):
        follow(recovery_of([STANDING[None]] * 2, step=0.0))
    empty = recovery_of([STANDING[None]])
    nothing = Recovery(survivors=empty.survivors.take(slice(0, 0)), frames=empty.frames, answer=empty.answer)
    with pytest.raises(posekit.InputError, match="no frame with a posture"):
        follow(nothing)


@pytest.fixture(scope="module")
def walk():
    """Image points of a standing figure that sways, by a camera of 1280 x 720."""
    forward, left, up = FIGURE.neutral_points[:14].T
    place = np.stack([left, -up, 4.0 - forward], axis=1)
    rng = np.random.default_rng(3)
    points = np.stack([place + np.array([0.02 * k, 0, 0]) for k in range(4)])
    return points, points[..., :2] / points[..., 2:] * 1000 + [640, 360] + rng.normal(size=(4, 14, 2))


def tracker(**about):
    camera = posekit.cameras.PinholeCamera(
        K=np.array([[1000.0, 0, 640], [0, 1000, 360], [0, 0, 1]]), size=(1280, 720)
    )
    return Tracker(camera=camera, lengths=LENGTHS, deviation=1.0, **about)


def test_tracker_tells_what_recover_finds(walk):
    points, image = walk
    live = tracker(lag=2)
    told = [live.update(one, time=k / 30, root=points[k, 0]) for k, one in enumerate(image)]
    assert [one.path is None for one in told] == [True, True, False, False]
    assert told[3].path.frame == 1
    rest = live.finish()
    assert [one.frame for one in rest] == [2, 3]
    for k, one in enumerate(told):
        assert one.survivors and not one.reason
        view = posekit.View(
            camera=live.camera,
            time=[0.0],
            image=image[k][None],
            root=points[k, :1],
            lengths=LENGTHS,
            deviation=1.0,
        )
        alone = posekit.recover(view)
        np.testing.assert_allclose(one.joints, alone.answer.joints[0], atol=1e-9)
        assert np.linalg.norm(one.joints - points[k], axis=1).mean() < 0.25


def test_tracker_goes_on_without_a_person(walk):
    points, image = walk
    live = tracker(lag=0)
    assert "neck" in live.update(np.full((14, 2), np.nan), time=0.0).reason
    assert np.isnan(live.update(np.full((14, 2), np.nan), time=0.1).path.joints).all()
    assert live.update(image[0], time=0.2, root=points[0, 0]).survivors
    with pytest.raises(posekit.InputError, match="seconds after"):
        live.update(image[0], time=0.2)
    with pytest.raises(posekit.InputError, match="shape"):
        live.update(image[0][:5], time=0.3)


def test_lines_are_answered_one_by_one(walk):
    points, image = walk
    good = [
        {"time": k / 30, "points": one.tolist(), "root": points[k, 0].tolist()}
        for k, one in enumerate(image[:2])
    ]
    named = {"time": 1.0, "points": {"neck": image[2][0].tolist(), "left_wrist": None}}
    text = [json.dumps(one).encode() for one in [*good, named]]
    stream = io.BytesIO(
        b"\n".join([text[0], b"", b"{bad", text[1], b'{"time": 3, "points": {"tail": [1, 2]}}', text[2]])
    )
    told = [json.loads(line) for line in answers(stream, tracker(lag=1), keep_going=True)]
    assert ["error" in one for one in told] == [False, True, False, True, False]
    assert set(told[0]["joints"]) == set(posekit.skeleton.JOINTS) and told[2]["path"]["frame"] == 0
    assert "line 5" in told[3]["error"] and "left_wrist" not in told[4]["joints"]
    with pytest.raises(posekit.InputError, match="line 1"):
        list(answers(io.BytesIO(b"[]\n"), tracker()))
