"""Laws of `posekit.Tracker`: a picture by itself, whatever came before; the path remembers."""

import numpy as np
import pytest

import posekit
from posekit.compiled import compiling
from posekit.errors import InputError
from posekit.following.survivor_frame import SurvivorFrame
from posekit.formats.own import ScaledOrthographicModel
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.live.tracked_posture import deviation_from
from posekit.skeleton import JOINT, JOINTS
from tests.live.conftest import PIXELS, SETTINGS, picture


def shown(tracker, seen, k, time):
    return tracker.update(seen.image[k], time, root=seen.root[k])


def test_a_picture_is_what_recover_finds_of_it_alone(tracker, seen, alone) -> None:
    for k, recovery in enumerate(alone):
        told = shown(tracker, seen, k, seen.time[k])
        answer = recovery.answers[0]
        assert told.survivors == len(recovery.frames[0]) > 0
        assert told.probability == answer.sure
        np.testing.assert_array_equal(told.joints, answer.posture)
        np.testing.assert_array_equal(told.answer.depth.near, answer.depth.near)
        assert told.frame == k and told.time == seen.time[k] and told.reason == ""


def test_the_order_of_pictures_changes_no_picture(tracker, seen, alone) -> None:
    for time, k in enumerate([3, 1, 0, 1, 2]):
        told = shown(tracker, seen, k, float(time))
        np.testing.assert_array_equal(
            told.joints, alone[k].frames[0].joints[alone[k].probability[0].argmax()]
        )


def test_a_frame_is_the_same_whatever_its_process_recovered_before(seen, alone, tracker, monkeypatch) -> None:
    posekit.recover(posekit.builtin_view("seq1"))
    posekit.recover(seen, SETTINGS.changed(ranges="table1", contact_margin=0.02))
    monkeypatch.setattr(compiling._State, "grown", 10 * compiling.PAYS_FROM)
    again = posekit.recover(picture(seen, 0), SETTINGS)
    assert again.frames[0].branches == alone[0].frames[0].branches
    assert again.frames[0].rejected == alone[0].frames[0].rejected
    np.testing.assert_array_equal(again.frames[0].joints, alone[0].frames[0].joints)
    np.testing.assert_array_equal(again.probability[0], alone[0].probability[0])


def test_the_path_is_that_of_all_pictures_where_it_looks_ahead_to_the_end(seen) -> None:
    live = posekit.Tracker(
        SETTINGS, camera=seen.camera, lengths=seen.lengths, deviation=PIXELS, lag=len(seen)
    )
    told = [shown(live, seen, k, seen.time[k]) for k in range(len(seen))]
    assert all(one.path is None for one in told)
    whole = posekit.follow(posekit.recover(seen, SETTINGS), k=1)
    assert [one.survivor for one in live.finish()] == whole.survivor[0].tolist()


def test_the_path_tells_where_somebody_was_lag_pictures_before(tracker, seen) -> None:
    told = [shown(tracker, seen, k, seen.time[k]) for k in range(len(seen))]
    assert [one.path and one.path.frame for one in told] == [None, *range(len(seen) - 1)]
    assert [one.frame for one in tracker.finish()] == [len(seen) - 1]


def test_a_picture_without_a_neck_is_passed_over(tracker, seen) -> None:
    hidden = seen.image[1].copy()
    hidden[0] = np.nan
    shown(tracker, seen, 0, 0.0)
    told = tracker.update(hidden, 0.1)
    assert told.survivors == 0 and told.probability == 0 and "the neck" in told.reason
    assert np.isnan(told.joints).all() and told.recovery is None
    after = shown(tracker, seen, 2, 0.2)
    assert after.path is not None and after.path.frame == 1 and after.path.bridged


def test_a_picture_that_is_no_body_says_why(tracker, seen) -> None:
    far = seen.image[0] + 30.0 * np.arange(len(JOINTS))[:, None]
    told = tracker.update(far, 0.0, root=seen.root[0])
    assert told.survivors == 0 and told.reason and "frames[" not in told.reason


@pytest.mark.parametrize(
    ("points", "time", "says"),
    [
        (np.zeros((13, 2)), 1.0, "points: got shape"),
        (np.zeros((14, 4)), 1.0, "points: got shape"),
        (np.full((14, 2), np.inf), 1.0, "image"),
        (np.zeros((14, 2)), np.nan, "time: got"),
        (np.zeros((14, 2)), 0.0, "ascending times"),
    ],
)
def test_what_is_no_picture_is_refused_and_leaves_no_trace(tracker, seen, points, time, says) -> None:
    shown(tracker, seen, 0, 0.0)
    with pytest.raises(InputError, match=says.replace("[", r"\[")):
        tracker.update(points, time)
    assert shown(tracker, seen, 1, 0.5).frame == 1


def test_a_detectors_points_are_taken_in_its_order(seen) -> None:
    layout = load_skeleton_map("coco_17")
    live = posekit.Tracker(
        posekit.RecoverSettings(ranges="urdf"), camera=seen.camera, stature=1.7, layout=layout
    )
    assert live.names == layout.points
    points = np.full((17, 3), np.nan)
    for k, name in enumerate(layout.points):
        if name in JOINT:
            points[k] = [*seen.image[0, JOINT[name]], 0.9]
    assert np.isfinite(live.update(points, 0.0).joints[JOINT["left_wrist"]]).all()
    points[[layout.points.index("left_shoulder")]] = np.nan
    assert "the neck" in live.update(points, 1.0).reason


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({}, "neither a camera nor the size"),
        ({"size": (640, 480), "stature": 1.7, "lengths": {"neck-pelvis": 0.5}}, "lengths and a stature"),
        ({"size": (640, 480), "layout": "no_such_layout"}, "no_such_layout"),
        ({"size": (640, 480), "layout": "bvh_cmu"}, "has no order of points"),
        ({"size": (640, 480), "lag": -1}, "lag is -1"),
        ({"size": (640, 0)}, "size must be"),
        ({"camera": ScaledOrthographicModel(scale=None)}, "expected an OpenCVModel"),
    ],
)
def test_what_makes_no_tracker_is_refused_at_once(given, says) -> None:
    with pytest.raises(posekit.PosekitError, match=says):
        posekit.Tracker(**given)


def test_a_joint_is_off_by_its_own_deviation_and_by_where_the_others_are(rng) -> None:
    joints = rng.normal(size=(3, 14, 3))
    deviation = rng.uniform(0.01, 0.1, (3, 14))
    alone = SurvivorFrame(time=0.0, joints=joints[:1], deviation=deviation[:1])
    np.testing.assert_allclose(deviation_from(joints[0], np.ones(1), alone), deviation[0])
    p = np.array([0.2, 0.5, 0.3])
    off = deviation_from(joints[1], p, SurvivorFrame(time=0.0, joints=joints, deviation=deviation))
    drawn = [p[i] * (np.sum((joints[i] - joints[1]) ** 2, axis=1) + deviation[i] ** 2) for i in range(3)]
    np.testing.assert_allclose(off, np.sqrt(sum(drawn)))
