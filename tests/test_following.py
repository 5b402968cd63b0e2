"""Following: brute force over paths, least squares for the smoother, and the live tracker beside the whole sequence."""

import io
import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_t

import posekit
from posekit.body import load_figure
from posekit.following.kalman import DENSITY, Moving, smooth, steps
from posekit.following.lines import answers
from posekit.following.paths import SKIP, Candidates, Trellis, _usual_step, candidates, follow, step_costs
from posekit.following.tracker import Tracker
from posekit.formats.layout import load_layout
from posekit.recovery import Answer, Frames, Recovery, Survivors
from posekit.skeleton import JOINTS

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
def test_paths_are_as_likely_as_by_brute_force(seed, noise):
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
    assert trellis.cheapest.min() == pytest.approx(every[best], rel=1e-9)
    paths = np.array(list(every))
    chance = np.exp(every[best] - np.array(list(every.values())))
    chance /= chance.sum()
    for k, (stage, share) in enumerate(zip(trellis.stages, trellis.marginals(), strict=True)):
        for one in range(-1, 3):
            through = share[stage.survivor == one].sum()
            # Ends that cost too much are dropped, although later frames may favour them.
            assert through == pytest.approx(chance[paths[:, k] == one].sum(), abs=1e-6)


def test_smoother_is_the_least_squares_solution():
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.02, 0.06, 6))
    joints = rng.normal(size=(6, 14, 3)) * 0.1
    joints[3] = np.nan
    A = rng.normal(size=(6, 14, 3, 3)) * 0.02
    covariance = A @ A.swapaxes(-1, -2) + 1e-4 * np.eye(3)
    found = smooth(time, joints, covariance)
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


def test_tracker_tells_of_a_detectors_points_what_recover_finds(walk):
    _, image = walk
    layout = load_layout("coco_17")
    points = np.full((17, 3), np.nan)
    for k, name in enumerate(layout.points):
        if name in JOINTS:
            points[k] = [*image[0, JOINTS.index(name)], 0.9]
    live = tracker(layout="coco_17")
    told = live.update(points, time=0.0)
    names, seen, _ = layout.seen((), points[None, :, :2])
    detections = posekit.Detections(
        points=seen,
        names=names,
        frame=[0],
        confidence=np.where(np.isnan(seen[..., 0]), np.nan, 0.9),
    )
    view = replace(detections.view(live.camera, deviation=1.0), lengths=LENGTHS)
    np.testing.assert_allclose(told.joints, posekit.recover(view).answer.joints[0], atol=1e-9)
    points[layout.points.index("left_shoulder")] = np.nan
    hidden = live.update(points, time=0.1)
    assert "shoulders" in hidden.reason
    assert np.isnan(hidden.joints).all()


def test_tracker_goes_on_without_a_person(walk):
    points, image = walk
    live = tracker(lag=0)
    assert "shoulders" in live.update(np.full((14, 2), np.nan), time=0.0).reason
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


def test_steps_cost_what_a_student_distribution_says():
    rng = np.random.default_rng(5)
    ends = Moving.nothing(2).given(STANDING + 0.1 * rng.normal(size=(2, 14, 3)), np.zeros((2, 14, 3, 3)))
    led = ends.after(0.04).after(0.03)
    A = rng.normal(size=(3, 14, 3, 3)) * 0.05
    covariance = A @ A.swapaxes(-1, -2)
    joints = ends.mean[:1, :, :3] + 0.1 * rng.normal(size=(3, 14, 3))
    joints[2, 5] = np.nan
    found = step_costs(ends, led, joints, covariance)
    for s, n in itertools.product(range(2), range(3)):
        cost = 0.0
        for j in range(14):
            if np.isnan(joints[n, j, 0]):
                continue
            S = led.spread[s, j, :3, :3] + covariance[n, j]
            law = multivariate_t(loc=led.mean[s, j, :3], shape=S, df=4.0)
            own = DENSITY[j] * 0.07**3 / 3  # the variance that the random acceleration adds
            cost += law.logpdf(led.mean[s, j, :3]) - law.logpdf(joints[n, j])
            cost += 0.5 * max(np.log(np.linalg.det(S) / own**3), 0.0)
        assert found[s, n] == pytest.approx(cost, rel=1e-9)


@pytest.mark.parametrize(("joint", "speed"), [(0, 15.0), (6, 25.0), (8, 35.0), (10, 25.0), (13, 35.0)])
@pytest.mark.parametrize("deviation", [0.0, 0.01])
def test_no_joint_is_faster_than_people_are(joint, speed, deviation):
    spread = np.broadcast_to(deviation**2 * np.eye(3), (1, 14, 3, 3))
    ends = Moving.nothing(1).given(STANDING[None], spread)
    led = ends.after(0.1)
    own = np.sqrt(np.trace(ends.spread[0, joint, :3, :3])) + np.sqrt(3) * deviation
    for share, possible in ((0.999, True), (1.001, False)):
        moved = STANDING[None].copy()
        moved[0, joint, 1] += share * (0.1 * speed + 3.0 * own)
        assert np.isfinite(step_costs(ends, led, moved, spread)[0, 0]) == possible


@pytest.mark.parametrize("scale", [np.nan, 120.0], ids=["perspective", "orthographic"])
def test_the_noise_of_a_survivor_is_along_its_rays(scale):
    one = recovery_of([STANDING[None]], radius=0.196)
    one = replace(one, survivors=replace(one.survivors, scale=np.array([scale])))
    found = candidates(one, 0)
    for j in range(14):
        values, vectors = np.linalg.eigh(found.covariance[0, j])
        np.testing.assert_allclose(np.sqrt(values), [0.02, 0.02, 0.1], rtol=1e-9)
        ray = np.array([0, 0, 1.0]) if np.isfinite(scale) else STANDING[j] / np.linalg.norm(STANDING[j])
        assert abs(vectors[:, 2] @ ray) == pytest.approx(1.0)
    np.testing.assert_allclose(found.joints[0], STANDING - np.isfinite(scale) * STANDING[0])


def test_smoothed_joints_that_are_never_seen_are_unknown_and_others_are_interpolated():
    time, joints = np.arange(5) / 30, np.repeat(STANDING[None], 5, axis=0)
    joints[:, 3] = np.nan
    joints[1:4, 7] = np.nan
    covariance = np.broadcast_to(1e-4 * np.eye(3), (5, 14, 3, 3))
    found = smooth(time, joints, covariance)
    assert np.isnan(found[:, 3]).all()
    np.testing.assert_allclose(found[:, 7], STANDING[None, 7].repeat(5, axis=0), atol=1e-3)


@pytest.mark.parametrize(("apart", "paths"), [(0.24, 1), (0.26, 2)])
def test_another_path_is_elsewhere_by_a_quarter_of_a_metre(apart, paths):
    other = STANDING + apart * np.eye(14)[9][:, None] * [1.0, 0.0, 0.0]
    frames = [np.stack([STANDING, other])] * 3
    found = follow(recovery_of(frames, [np.array([0.7, 0.3])] * 3), paths=3)
    assert len(found.path) == paths
    np.testing.assert_array_equal(found.path.survivor[0], [0, 2, 4])
    if paths == 2:
        assert 0.0 < found.path.probability[1] < 0.4
        np.testing.assert_array_equal(found.path.survivor[1], [1, 3, 5])
