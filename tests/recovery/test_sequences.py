"""Following a person through a recovery: paths of survivors, with and without a calibrated camera."""

import dataclasses
import math

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.following import Beam, Follower, best_paths
from posekit.formats.own import OpenCVModel, View
from posekit.recovery.recovery import Recovery
from posekit.recovery.sequences import follow, follow_frames, survivor_frames
from posekit.settings.scale import parse_scale
from posekit.skeleton import JOINTS, TREE_SEGMENTS
from posekit.synthesis import CameraPlacements, Walker, walker_scene
from posekit.synthesis.camera_sphere import CameraSphere
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at
from posekit.views.builtin import forget_camera, view_of

WRIST, KNEE = JOINTS.index("right_wrist"), JOINTS.index("left_knee")


@pytest.fixture(scope="module")
def view():
    """A walker who passes a camera that stands still, exact points in pixels."""
    walker, sphere = Walker(), CameraSphere()
    time = np.arange(12) / 30
    q = walker.configurations(walker.phase(time, 0.1))
    q[:, :3] += walker.travel(time, 0.1)
    points = walker.figure.forward_kinematics(q)
    middle = points.reshape(-1, 3).mean(axis=0)
    position = middle + np.array([2.0, 0.2, -3.5])
    R = np.broadcast_to(look_at(position, middle, np.array([0.0, 1.0, 0.0])), (12, 3, 3))
    scene = observe(
        walker.figure,
        sphere.camera,
        points,
        CameraPlacements(R, np.broadcast_to(position, (12, 3))),
        time=time,
    )
    return View(
        camera=OpenCVModel(K=scene.camera.K),
        time=time,
        image=scene.image,
        root=scene.joints_cam[:, 0],
        truth=scene.joints_cam,
        lengths=dict(scene.figure.lengths),
    )


@pytest.fixture(scope="module")
def recovery(view):
    return posekit.recover(view)


def lengths(joints):
    start, end = np.array(TREE_SEGMENTS).T
    return np.linalg.norm(joints[..., end, :] - joints[..., start, :], axis=-1)


def test_a_path_is_made_of_survivors(view, recovery):
    found = follow(recovery, k=3, apart=0.05)
    assert len(found) > 1
    assert found.joints.shape == (len(found), 12, 14, 3)
    assert (np.diff(found.cost) >= 0).all()
    assert found.share.sum() == pytest.approx(1.0)
    assert found.lead == pytest.approx(found.cost[1] - found.cost[0])
    assert found.share[1] / found.share[0] == pytest.approx(math.exp(-found.lead))
    for path in range(len(found)):
        for k, frame in enumerate(recovery.frames):
            chosen = found.survivor[path, k]
            np.testing.assert_array_equal(found.joints[path, k], frame.joints[chosen])
            assert found.branches[path][k] == frame.branches[chosen]
    assert not found.interpolated.any()
    assert np.linalg.norm(found.joints[0] - view.truth, axis=-1).mean() < 0.02
    assert found.smoothed().shape == (12, 14, 3)
    with pytest.raises(ValueError, match="read-only"):
        found.joints[...] = 0


def test_survivors_cost_what_they_are_ranked(recovery):
    ranked = follow(recovery, k=1)
    given = follow(recovery, k=1, log_probability=[np.log(each) for each in recovery.probability])
    assert ranked.survivor.tolist() == given.survivor.tolist()
    assert ranked.cost == pytest.approx(given.cost)
    assert math.isnan(ranked.lead)
    free = follow_frames(recovery.frames, k=1)
    assert free.cost[0] < ranked.cost[0]
    last = [np.where(np.arange(len(frame)) == len(frame) - 1, 0.0, -np.inf) for frame in recovery.frames]
    forced = follow(recovery, k=1, log_probability=last).survivor[0]
    assert (forced >= 0).any()
    assert all(one in (-1, len(frame) - 1) for one, frame in zip(forced, recovery.frames, strict=True))


def test_frames_without_a_posture_are_bridged(view, recovery):
    image = view.image.copy()
    image[5:7, WRIST] += 600  # farther than any forearm reaches
    broken = posekit.recover(dataclasses.replace(view, image=image))
    assert [len(frame) > 0 for frame in broken.frames] == [k not in (5, 6) for k in range(12)]
    found = follow(broken)
    assert found.bridged[0].tolist() == [k in (5, 6) for k in range(12)]
    assert found.interpolated[0, 5:7].all()
    assert np.isinf(found.deviation[0, 5:7]).all()
    np.testing.assert_allclose(lengths(found.joints[0, 5]), lengths(found.joints[0, 4]), atol=1e-6)
    assert np.linalg.norm(found.joints[0, 5:7] - view.truth[5:7], axis=-1).mean() < 0.03
    whole = follow(recovery, k=1)
    assert whole.cost[0] < found.cost[0]


def test_joints_that_were_not_seen_are_bridged_where_other_frames_know_them(view):
    image = view.image.copy()
    image[4:7, WRIST] = np.nan
    image[:, KNEE + 2] = np.nan  # the ankle: never
    found = follow(posekit.recover(dataclasses.replace(view, image=image)), k=1)
    assert found.interpolated[0, :, WRIST].tolist() == [k in (4, 5, 6) for k in range(12)]
    assert found.interpolated[0, :, KNEE + 2].all()
    assert np.isfinite(found.joints).all()
    away = np.linalg.norm(found.joints[0, :, WRIST] - view.truth[:, WRIST], axis=-1)
    assert away[4:7].max() < 0.05


@pytest.fixture(scope="module")
def photographs():
    scene = walker_scene(Walker(), camera=(4.0, 0.3, 1.5), frames=3, dt=1 / 15)
    return forget_camera(view_of(scene)), scene.joints_cam


def test_an_uncalibrated_sequence_is_followed_about_the_neck(photographs):
    view, true = photographs
    recovery = posekit.recover(view, scale=parse_scale("closure"))
    found = follow(recovery, k=1)
    for k, frame in enumerate(recovery.frames):
        chosen = found.survivor[0, k]
        assert found.scale is not None
        assert frame.scales is not None
        assert found.scale[0, k] == frame.scales[chosen]
        np.testing.assert_array_equal(found.joints[0, k], frame.joints[chosen])
    relative = true - true[:, :1]
    path = np.linalg.norm(found.joints[0] - found.joints[0, :, :1] - relative, axis=-1).mean()
    chance = np.mean(
        [
            np.linalg.norm(frame.joints - frame.joints[:, :1] - each, axis=-1).mean()
            for frame, each in zip(recovery.frames, relative, strict=True)
        ]
    )
    assert path < 0.75 * chance
    with pytest.raises(InputError, match="uncalibrated"):
        found.smoothed()


def test_pictures_that_are_cut_elsewhere_change_nothing_of_an_uncalibrated_path(photographs):
    view, _ = photographs
    away = np.random.default_rng(0).normal(0, 0.02, (len(view), 1, 2))
    here, there = (
        follow(posekit.recover(each), k=1)
        for each in (view, dataclasses.replace(view, image=view.image + away))
    )
    assert np.abs(here.joints - there.joints).max() > 0.1
    assert here.survivor.tolist() == there.survivor.tolist()
    assert here.cost == pytest.approx(there.cost, abs=1e-6)


def test_frames_are_followed_live(recovery):
    probability = [np.log(each) for each in recovery.probability]
    frames = survivor_frames(recovery.frames, probability)
    follower = Follower(lag=len(frames), beam=Beam())
    for frame in frames:
        assert follower.push(frame) is None
    live = [one.survivor for one in follower.finish()]
    assert live == best_paths(frames).survivor[0].tolist() == follow(recovery, k=1).survivor[0].tolist()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"k": 0}, "--follow: 0 paths"),
        ({"k": True}, "--follow: True paths"),
        ({"log_probability": []}, "log_probability has 0 frames"),
        ({"log_probability": [[0.0]] * 12}, "log_probability of frame 0"),
        ({"log_probability": [np.nan] * 12}, "log_probability of frame 0"),
    ],
)
def test_what_cannot_be_followed(recovery, given, says):
    with pytest.raises(InputError, match=says):
        follow(recovery, **given)


def test_probabilities_above_one_and_nan_are_refused(recovery):
    for wrong in (1.0, np.nan):
        given = [np.full(len(frame), wrong) for frame in recovery.frames]
        with pytest.raises(InputError, match="of at most zero"):
            follow(recovery, log_probability=given)


def test_a_recovery_without_any_posture_is_refused(recovery):
    image = Recovery(figure=recovery.figure, fit=recovery.fit, frames=[], settings={})
    with pytest.raises(InputError, match="none of 0 frames has a posture"):
        follow_frames(image.frames)


def test_times_that_do_not_ascend_are_refused(recovery):
    frames = [dataclasses.replace(frame, time=0.0) for frame in recovery.frames[:2]]
    with pytest.raises(InputError, match="ascending"):
        follow_frames(frames)


def test_refined_survivors_bring_their_deviation(view):
    rng = np.random.default_rng(5)
    image = view.image[:8] + np.where(np.arange(14)[:, None] > 0, rng.normal(0, 2.0, (8, 14, 2)), 0.0)
    names = ("time", "head_image", "root", "truth", "confidence")
    some = dataclasses.replace(
        view, image=image, deviation=2.0, **{name: getattr(view, name)[:8] for name in names}
    )
    recovery = posekit.recover(some)
    assert all(frame.refined is not None for frame in recovery.frames)
    found = follow(recovery)
    given = survivor_frames(recovery.frames)
    refined = recovery.frames[3].refined
    assert refined is not None
    np.testing.assert_array_equal(given[3].covariance, refined.covariance)
    # What is expected of all survivors, smoothed, has the lengths of those chosen, and is surer than they are.
    chosen = np.stack([frame.joints[one] for frame, one in zip(given, found.survivor[0], strict=True)])
    assert 1e-3 < np.linalg.norm(found.joints[0] - chosen, axis=-1).max() < 0.3
    np.testing.assert_allclose(lengths(found.joints[0]), lengths(chosen), atol=1e-9)
    spread = np.stack([frame.deviation[one] for frame, one in zip(given, found.survivor[0], strict=True)])
    assert np.median(found.deviation[0]) < np.median(spread)
    off, first = (
        np.linalg.norm(each - some.truth, axis=-1).mean()
        for each in (
            found.joints[0],
            np.stack(
                [f.joints[np.argmax(p)] for f, p in zip(recovery.frames, recovery.probability, strict=True)]
            ),
        )
    )
    assert off < first
    assert ((found.confidence > 0) & (found.confidence <= 1)).all()
