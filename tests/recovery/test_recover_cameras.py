"""Whence the camera, the place and the body come: the head, a root, a lens that distorts, a person's lengths."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posekit.body import Figure, load_figure
from posekit.cameras import PinholeCamera
from posekit.cameras.head import HeadWarning
from posekit.errors import FigureError, HeadError, InputError
from posekit.formats.own import LeeChenModel, OpenCVModel
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.recovery.summary import summary_lines
from posekit.settings import EXACT_TOLERANCE, MEASURED_TOLERANCE
from posekit.skeleton import HEAD_POINTS, JOINT
from posekit.synthesis import (
    SyntheticScene,
    Walker,
    random_postures,
    random_views,
    walker_scene,
)
from posekit.synthesis.camera_sphere import CameraPlacements
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at
from posekit.views.builtin import builtin_view, view_of

FIGURE = load_figure()
SEQ1 = builtin_view("seq1")
FOUND = 1e-6
LEAVES = 8192


def test_f_given_and_f_recovered_lead_to_the_same_postures() -> None:
    recovered, given = recover(SEQ1), recover(replace(SEQ1, camera=LeeChenModel(f=0.05)))
    assert [frame.branches for frame in given.frames] == [frame.branches for frame in recovered.frames]
    for a, b in zip(given.frames, recovered.frames, strict=True):
        np.testing.assert_allclose(a.joints, b.joints, rtol=0, atol=1e-9)
        assert a.camera["f"] == 0.05
        np.testing.assert_allclose(a.camera["position"], [4, 0, 0], rtol=0, atol=1e-8)


def test_a_root_serves_where_no_head_is_seen(truth_at) -> None:
    camera = LeeChenModel(f=0.05)
    headless = replace(
        SEQ1, camera=camera, head_image=np.full((5, 5, 2), np.nan), root=SEQ1.truth[:, 0], head_points=None
    )
    recovery = recover(headless)
    assert max(truth_at(recovery, SEQ1.truth)) < FOUND
    for frame, with_head in zip(recovery.frames, recover(SEQ1).frames, strict=True):
        assert set(with_head.branches) <= set(frame.branches)
        assert np.isnan(frame.head).all()
        assert frame.camera == {"f": 0.05, "rotation": None, "position": None, "residual": None}
        assert not any("neck" in reason for reason in frame.rejected)
        neck = [
            frame.q[:, recovery.figure.configuration_names.index(f"neck_{angle}")] for angle in ("flexion",)
        ]
        assert (np.array(neck) == 0).all()


def test_a_root_comes_before_the_heads_neck() -> None:
    moved = SEQ1.truth[:, 0] * 1.01
    recovery = recover(replace(SEQ1, root=moved), tolerance=MEASURED_TOLERANCE)
    for frame, root in zip(recovery.frames, moved, strict=True):
        if len(frame):
            assert np.array_equal(frame.joints[0, 0], root)
        np.testing.assert_allclose(recovery.fit.root, moved, rtol=0, atol=0)
    head = recovery.fit.head - moved[:, None]
    np.testing.assert_allclose(head, recover(SEQ1).fit.head - SEQ1.truth[:, :1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("give_root", [False, True])
def test_a_frame_without_a_head_is_skipped_where_only_the_head_tells_f(give_root: bool) -> None:
    head_image, root = SEQ1.head_image.copy(), np.full((5, 3), np.nan)
    head_image[2, HEAD_POINTS.index("nose")] = np.nan
    if give_root:
        root[2] = SEQ1.truth[2, 0]
    view = replace(SEQ1, head_image=head_image, root=root, camera=LeeChenModel(f=None))
    recovery = recover(view, group=0.05)
    frame = recovery.frames[2]
    assert frame.reason.startswith("frames[2]: 5 of 6 head points are known")
    assert frame.reason.endswith("missing: nose")
    assert (len(frame), frame.joints.shape, frame.branches, frame.pruned()) == (0, (0, 14, 3), [], [])
    assert frame.rejected == {"root/not_known": LEAVES}
    assert frame.tolerance is None
    assert frame.levels["physical"].tolist() == [0] * 14
    whole = recover(SEQ1).frames
    for k in (0, 1, 3, 4):
        assert recovery.frames[k].branches == whole[k].branches
    assert len(result_of(recovery).frames) == 5
    assert "frames[2]" in "\n".join(summary_lines(recovery))


def test_where_f_is_known_a_frame_without_head_and_root_is_placed_exactly(truth_at) -> None:
    head_image = SEQ1.head_image.copy()
    head_image[2, HEAD_POINTS.index("nose")] = np.nan
    recovery = recover(replace(SEQ1, head_image=head_image, camera=LeeChenModel(f=0.05)))
    frame = recovery.frames[2]
    assert frame.judged == "exact"
    assert frame.root is not None
    assert frame.root.method in ("torso", "search")
    assert frame.root.lower < SEQ1.truth[2, 0, 2] < frame.root.upper
    assert max(truth_at(recovery, SEQ1.truth)) < FOUND
    assert [one.root is None for one in recovery.frames] == [True, True, False, True, True]


def test_a_root_and_f_together_need_no_head(truth_at) -> None:
    head_image, root = SEQ1.head_image.copy(), np.full((5, 3), np.nan)
    head_image[2], root[2] = np.nan, SEQ1.truth[2, 0]
    recovery = recover(replace(SEQ1, head_image=head_image, root=root, camera=LeeChenModel(f=0.05)))
    assert max(truth_at(recovery, SEQ1.truth)) < FOUND


def test_a_view_without_any_head_is_refused_where_only_the_head_tells_f() -> None:
    view = replace(SEQ1, camera=LeeChenModel(f=None), head_image=np.full((5, 5, 2), np.nan))
    with pytest.raises(HeadError) as caught:
        recover(view)
    assert str(caught.value).startswith("frames[0]: 1 of 6 head points are known")
    assert "f and root" in str(caught.value)


def test_a_view_of_which_only_the_neck_is_seen_is_refused() -> None:
    image = np.full_like(SEQ1.image, np.nan)
    image[:, 0] = SEQ1.image[:, 0]
    blind = replace(SEQ1, camera=LeeChenModel(f=0.05), image=image, head_image=np.full((5, 5, 2), np.nan))
    with pytest.raises(InputError, match=r"frames.0.: nothing bounds how far away the neck is.*give root"):
        recover(blind)


def test_a_head_point_that_does_not_fit_is_named() -> None:
    assert SEQ1.head_points is not None
    eye = SEQ1.head_points["right_eye"] * [0, 1, 1] + [-0.32168, 0, 0]
    with pytest.warns(HeadWarning, match="head point right_eye does not fit the others in 5 of 5 frames"):
        recover(replace(SEQ1, head_points={**SEQ1.head_points, "right_eye": eye}), checks=())


def distorted_scene(count: int = 10) -> SyntheticScene:
    """See random postures through a lens with strong distortion."""
    rng = np.random.default_rng(9)
    points = FIGURE.forward_kinematics(random_postures(FIGURE, count, rng))
    direction = rng.normal(size=(count, 3))
    middle = points.mean(axis=1)
    position = middle + 4.0 * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    camera = PinholeCamera(
        K=np.array([[900.0, 0.5, 640.0], [0, 910.0, 360.0], [0, 0, 1]]),
        distortion=np.array([-0.3, 0.1, 1e-3, -2e-3, 0.0]),
    )
    return observe(
        FIGURE,
        camera,
        points,
        CameraPlacements(look_at(position, middle, np.array([0.0, 0.0, 1.0])), position),
    )


def test_a_distorted_opencv_view_is_recovered(truth_at) -> None:
    scene = distorted_scene()
    recovery = recover(view_of(scene))
    assert max(truth_at(recovery, scene.joints_cam)) < FOUND
    assert all(frame.tolerance == EXACT_TOLERANCE for frame in recovery.frames)
    for frame, image in zip(recovery.frames, scene.image, strict=True):
        seen = scene.camera.project(frame.joints)
        np.testing.assert_allclose(seen, np.broadcast_to(image, seen.shape), rtol=0, atol=1e-9)
        assert frame.camera["f"] is None
        assert frame.camera["residual"] < 1e-9


def test_an_opencv_cameras_place_in_the_world_is_reported() -> None:
    scene = random_views(FIGURE, 1, np.random.default_rng(2))
    R, t = scene.R_cam_world[0], scene.t_cam_world[0]
    model = OpenCVModel(K=scene.camera.K, R=R, t=t)
    record = recover(replace(view_of(scene), camera=model)).frames[0].camera
    np.testing.assert_allclose(record["rotation"], R)
    np.testing.assert_allclose(record["position"], -R.T @ t)


# --- the person -----------------------------------------------------------------------------------------


def scaled_person() -> Figure:
    return FIGURE.scaled({"right_hip-right_knee": 0.40, "neck-pelvis": 0.49})


@pytest.mark.parametrize(
    "make", [scaled_person, lambda: FIGURE.from_stature(1.95)], ids=["lengths", "stature"]
)
def test_a_view_of_another_person_tells_that_persons_body(make: Any, truth_at) -> None:
    person = make()
    scene = random_views(person, 20, np.random.default_rng(3))
    recovery = recover(view_of(scene))
    assert max(truth_at(recovery, scene.joints_cam)) < FOUND
    assert dict(recovery.figure.lengths) == pytest.approx(dict(person.lengths), abs=1e-12)
    with_figure = recover(replace(view_of(scene), lengths={}, head_points=None), figure=person)
    assert [frame.branches for frame in with_figure.frames] == [frame.branches for frame in recovery.frames]


def test_stature_and_lengths_of_a_view_scale_the_figure(truth_at) -> None:
    tall = FIGURE.from_stature(1.9)
    scene = random_views(tall, 5, np.random.default_rng(3))
    view = replace(view_of(scene), lengths={}, head_points=None, stature=1.9)
    recovery = recover(view)
    assert max(truth_at(recovery, scene.joints_cam)) < FOUND
    assert recovery.figure.hash == tall.hash
    longer = recover(replace(view, lengths={"right_knee-right_ankle": 0.60}))
    assert longer.figure.lengths["right_knee-right_ankle"] == pytest.approx(0.60)
    assert longer.figure.lengths["left_knee-left_ankle"] == pytest.approx(
        tall.lengths["left_knee-left_ankle"]
    )


def test_a_walker_of_another_stature_keeps_the_camera_of_1985(truth_at) -> None:
    person = FIGURE.from_stature(1.6)
    scene = walker_scene(Walker(velocity=0.7, figure=person), frames=2)
    recovery = recover(view_of(scene), checks=("rigid-parts", "joint-range"))
    assert max(truth_at(recovery, scene.joints_cam)) < FOUND
    np.testing.assert_allclose(recovery.frames[0].camera["position"], [4, 0, 0], rtol=0, atol=1e-8)


def test_a_torso_that_cannot_close_is_refused() -> None:
    with pytest.raises(FigureError, match=r"the triangle neck, right_shoulder, pelvis does not close"):
        recover(replace(SEQ1, lengths={"neck-pelvis": 2.0}))


def test_a_segment_too_short_for_its_image_is_named_with_by_how_much() -> None:
    with pytest.raises(InputError) as caught:
        recover(replace(SEQ1, lengths={"right_elbow-right_wrist": 0.05}))
    text = str(caught.value)
    assert text.startswith("frames[0]: the segment right_elbow-right_wrist is at least ")
    assert " cm too short for its image" in text
    missing = float(text.partition(" cm too short")[0].rpartition(" ")[2]) / 100
    # With what is missing, and no more, the frame has a solution again for that segment.
    enough = recover(replace(SEQ1, lengths={"right_elbow-right_wrist": 0.05 + missing * 1.01}), checks=())
    assert enough.frames[0].too_short() is None


def test_an_image_point_beyond_all_reach_costs_its_frame_alone() -> None:
    image = SEQ1.image.copy()
    image[1, JOINT["left_elbow"], 0] = 1e298
    recovery = recover(replace(SEQ1, image=image))
    assert [len(frame) > 0 for frame in recovery.frames] == [True, False, True, True, True]
    assert recovery.frames[1].too_short() is not None
    assert len(recovery.frames[1]) + sum(recovery.frames[1].rejected.values()) == LEAVES
