"""Scenes: what is collected, where the bodies are, what is pointed at."""

from __future__ import annotations

import json
from dataclasses import replace

import meshcat.geometry as mg
import numpy as np
import pytest

import posekit
from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import ViewerError
from posekit.formats.own import Postures, Result, ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, TREE_SEGMENTS, segment_name
from posekit.viewer.scene.branch import lift_branch, one_a_reason, rejected_of
from posekit.viewer.scene.compose import Style, compose, row_count
from posekit.viewer.scene.culprit import culprit
from posekit.viewer.scene.drawn_posture import DrawnPosture, Look, add_posture
from posekit.viewer.scene.drawn_subject import DrawnSubject, check_one_scale, subject_of
from posekit.viewer.scene.eye import Eye
from posekit.viewer.scene.framing import fitted_eye, orbit
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.stage import background_colour
from posekit.viewer.scene.superposed import superposed_looks
from posekit.viewer.scene.world import upright_world


def placement(scene: Scene, path: str) -> Array:
    return np.array(scene.nodes[path].transform, dtype=np.float64).reshape(4, 4).T


def capsule_ends(scene: Scene, path: str, half_length: float) -> Array:
    T = placement(scene, path)
    return np.asarray(T[:3, 3] + np.array([[-1.0], [1.0]]) * half_length * T[:3, 2])


def test_same_content_gives_same_document() -> None:
    def made() -> str:
        scene = Scene()
        scene.meshcat["ball"].set_object(mg.Sphere(0.1), mg.MeshLambertMaterial(color=0xFF0000))
        scene.meshcat["ball"].set_transform(np.eye(4))
        return json.dumps(scene.document())

    assert made() == made()


def test_only_the_difference_is_sent() -> None:
    scene = Scene()
    for name in ("a", "b"):
        scene.meshcat[name].set_object(mg.Sphere(0.1))
    known: set[str] = set()
    assert len(scene.document(known=known)["geometries"]) == 1  # shared
    before = scene.copy()
    assert scene.document(before, known) == {"geometries": {}, "commands": []}
    moved = np.eye(4)
    moved[0, 3] = 1.0
    scene.meshcat["a"].set_transform(moved)
    scene.meshcat["b"].delete()
    commands = scene.document(before, known)["commands"]
    assert [(command["type"], command["path"]) for command in commands] == [
        ("delete", "/meshcat/b"),
        ("set_transform", "/meshcat/a"),
    ]


def test_unknown_transform_hides_and_a_known_one_shows_again() -> None:
    scene = Scene()
    scene.meshcat["a"].set_object(mg.Sphere(0.1))
    scene.meshcat["a"].set_transform(np.full((4, 4), np.nan))
    hidden = scene.copy()
    assert hidden.document()["commands"][-1] == {
        "type": "set_property",
        "path": "/meshcat/a",
        "property": "visible",
        "value": False,
    }
    scene.meshcat["a"].set_transform(np.eye(4))
    assert scene.document(hidden)["commands"][-1]["value"] is True
    assert "NaN" not in json.dumps(hidden.document())


def test_pinocchios_capsules_lie_where_the_posture_has_them(subject: DrawnSubject) -> None:
    shown = subject.frames[0]
    assert shown.q is not None
    world = upright_world(subject.points())
    scene = Scene()
    posture = DrawnPosture(points=shown.points[3], q=shown.q[3])
    add_posture(scene, "by-q", posture, figure=subject.figure, world=world)
    bent = shown.points[3].copy()
    bent[JOINT["left_ankle"]] += 1e-3  # no q gives this back: the capsules are laid along the segments
    add_posture(scene, "laid", DrawnPosture(points=bent), figure=subject.figure, world=world)
    for capsule in subject.figure.capsules:
        ends = [
            capsule_ends(scene, f"/meshcat/{name}/bodies/{capsule.link}", capsule.half_length)
            for name in ("by-q", "laid")
        ]
        middle, axis = capsule.place(shown.points[None, 3, list(capsule.points)])
        wanted = world.place(middle + np.array([[-1.0], [1.0]]) * capsule.half_length * axis)
        np.testing.assert_allclose(ends[0], wanted, rtol=0, atol=1e-8)
        if capsule.link != "left_shank":
            np.testing.assert_allclose(ends[1], wanted, rtol=0, atol=1e-8)


def test_postures_of_a_person_have_capsules_of_that_size(walked: Result) -> None:
    child = Postures(joints=0.7 * walked.frames[0].joints)
    hips = next(one for one in subject_of(child).figure.capsules if one.link == "hips")
    adult = next(one for one in subject_of(walked).figure.capsules if one.link == "hips")
    assert hips.half_length == pytest.approx(0.7 * adult.half_length, abs=1e-3)
    assert hips.center == pytest.approx(0.7 * adult.center, abs=1e-3)


def test_world_is_upright_and_stands_on_the_ground(subject: DrawnSubject) -> None:
    world = upright_world(subject.points())
    placed = world.place(subject.frames[0].points)
    assert (placed[:, 0, 2] > placed[:, JOINT["pelvis"], 2]).all()
    assert 0 < np.nanmin(placed[..., 2]) < 0.1
    # One looks along the camera's sight: right of the picture is right of it.
    forward, right = world.level_axes()
    np.testing.assert_allclose(world.R_world_cam @ [0, 0, 1], forward, atol=1e-12)
    np.testing.assert_allclose(world.R_world_cam @ [1, 0, 0], right, atol=1e-12)


def test_tilted_camera_is_stood_upright(rng: np.random.Generator) -> None:
    tilt = np.radians(25)
    R_world_cam = np.array([[0, -np.sin(tilt), np.cos(tilt)], [-1, 0, 0], [0, -np.cos(tilt), -np.sin(tilt)]])
    standing = posekit.load_figure().neutral_points
    points = (standing - [-4, 0, 1]) @ R_world_cam
    world = upright_world(points, R_world_cam.T)
    placed = world.place(points)
    assert np.ptp(placed[:, 2] - standing[:, 2]) < 1e-12


def test_unknown_joints_are_left_out(subject: DrawnSubject) -> None:
    points = subject.frames[0].points[0].copy()
    points[JOINT["right_wrist"]] = np.nan
    scene = Scene()
    add_posture(scene, "a", DrawnPosture(points=points), figure=subject.figure, world=upright_world(points))
    assert "/meshcat/a/joints/right_elbow" in scene.nodes
    assert "/meshcat/a/joints/right_wrist" not in scene.nodes
    assert "/meshcat/a/bodies/right_forearm" not in scene.nodes
    assert "/meshcat/a/bodies/right_upper_arm" in scene.nodes
    with pytest.raises(ViewerError, match="no joint of the posture is known"):
        unknown = DrawnPosture(points=np.full((14, 3), np.nan))
        add_posture(scene, "b", unknown, figure=subject.figure, world=upright_world(points))
    with pytest.raises(ViewerError, match="all are NaN"):
        upright_world(np.full((14, 3), np.nan))


@pytest.mark.parametrize(
    ("reason", "links", "joints"),
    [
        ("joint_range/right_elbow.flexion", (), ("right_elbow",)),
        ("joint_range/neck.bending", (), ("neck",)),
        ("collision/right_forearm-torso", ("right_forearm", "torso"), ()),
        ("rigid_parts/right_hip-left_hip", (), ("right_hip", "left_hip")),
        ("rigid_parts/torso", (), ("neck", "right_shoulder", "left_shoulder", "pelvis")),
        ("no_solution/right_ankle", (), ("right_ankle",)),
        ("walking/rule2.left", (), ("left_elbow", "left_knee")),
        ("walking/rule3.right_arm", (), ("right_shoulder", "right_elbow", "right_wrist")),
        ("walking/rule5.standing_leg", (), ("right_knee", "left_knee")),
        ("something/else entirely", (), ()),
    ],
)
def test_culprits(reason: str, links: tuple[str, ...], joints: tuple[str, ...]) -> None:
    found = culprit(reason)
    assert (found.links, found.joints) == (links, joints)


def test_branches_of_survivors_give_the_survivors_back(subject: DrawnSubject, walked: Result) -> None:
    shown, frame = subject.frames[0], walked.frames[0]
    assert shown.sight is not None
    lengths = np.array([subject.figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS])
    for k, bits in enumerate(frame.branches):
        joints = lift_branch(
            shown.sight.camera, frame.joints[k, 0], shown.sight.image[:14], lengths, bits, tolerance=1e-9
        )
        np.testing.assert_allclose(joints, frame.joints[k], rtol=0, atol=1e-6)


def test_rejected_branches_are_pointed_at(subject: DrawnSubject, walked: Result) -> None:
    rejected = one_a_reason(rejected_of(walked, subject, 0))
    assert len(set(rejected.reasons)) == len(rejected) > 4
    row = list(rejected.reasons).index("joint_range/left_knee.flexion")
    world = upright_world(rejected.points)
    scene = compose(rejected, figure=subject.figure, world=world, style=Style()).scene
    assert f"/meshcat/posture-{row}/halos/left_knee" in scene.nodes
    assert f"/meshcat/posture-{row}/halos/right_knee" not in scene.nodes
    # No ray reaches the ankle: its knee is pointed at.
    row = list(rejected.reasons).index("no_solution/right_ankle")
    assert f"/meshcat/posture-{row}/halos/right_knee" in scene.nodes


def test_result_without_pruned_branches_is_refused(subject: DrawnSubject, walk: View) -> None:
    plain = posekit.result_of(posekit.recover(walk))
    with pytest.raises(ViewerError, match="--explain"):
        rejected_of(plain, subject, 0)


def test_what_superposed_postures_share_is_drawn_once(subject: DrawnSubject) -> None:
    shown = subject.frames[0]
    looks = superposed_looks(shown, subject.figure)
    assert sum("torso" not in look.without for look in looks) == 1
    knees = {tuple(np.round(points[JOINT["left_knee"]], 3)) for points in shown.points}
    assert sum("left_thigh" not in look.without for look in looks) == len(knees) < len(shown)


def test_groups_have_colours_of_their_own(subject: DrawnSubject) -> None:
    two = subject.frames[0].chosen([0, len(subject.frames[0]) - 1])
    looks = superposed_looks(two, subject.figure)
    assert looks[0].body and looks[1].body
    own = {name for name in looks[0].body if looks[0].body[name] != looks[1].body.get(name)}
    assert "left_shank" in own
    assert "torso" not in looks[1].body


def test_side_by_side_keeps_apart(subject: DrawnSubject) -> None:
    shown = subject.frames[0].chosen(range(4))
    world = upright_world(shown.points)
    scene = compose(shown, figure=subject.figure, world=world, style=Style(azimuth=30)).scene
    necks = np.array([placement(scene, f"/meshcat/posture-{k}/joints/neck")[:3, 3] for k in range(4)])
    gaps = np.linalg.norm(np.diff(necks, axis=0), axis=1)
    assert (gaps > 0.5).all()
    assert not any(path.startswith("/meshcat/camera") for path in scene.nodes)
    assert [row_count(n) for n in (1, 7, 8, 36)] == [1, 1, 2, 4]


def test_too_many_postures_are_refused(subject: DrawnSubject) -> None:
    many = subject.frames[0].chosen([0] * 201)
    with pytest.raises(ViewerError, match="201 postures in one picture"):
        compose(many, figure=subject.figure, world=upright_world(many.points), style=Style())


def test_fitted_eye_has_all_points_in_its_picture(rng: np.random.Generator, subject: DrawnSubject) -> None:
    world = upright_world(subject.points())
    points = rng.normal(size=(40, 3)) * [2, 1, 1]
    for azimuth, elevation in ((0, 0), (55, 14), (200, -30)):
        eyes = [fitted_eye(points, world, azimuth=azimuth, elevation=elevation, aspect=1.5)]
        eyes += orbit(points, world, count=5, azimuth=azimuth, elevation=elevation, aspect=1.5)
        for eye in eyes:
            pose, clip = eye.matrices(300, 200)
            seen = np.concatenate([points, np.ones((40, 1))], axis=1) @ np.linalg.inv(pose).T @ clip.T
            assert (np.abs(seen[:, :2] / seen[:, 3:]) < 1).all()


def test_impossible_poses_and_looks_are_refused() -> None:
    for bad in (
        {"position": [0, 0, 1], "target": [0, 0, 1]},
        {"position": [0, np.nan, 1], "target": [0, 0, 1]},
        {"position": [1, 0, 1], "target": [0, 0, 1], "fov": 180},
    ):
        with pytest.raises(ViewerError, match=r"expected|move"):
            Eye(**bad)
    with pytest.raises(ViewerError, match="opacity"):
        Look(opacity=0)
    with pytest.raises(ViewerError, match="layout"):
        Style(layout="heap")
    with pytest.raises(ViewerError, match="background"):
        background_colour("blurple")
    assert background_colour("transparent") is None


def test_files_without_postures_are_refused(walk: View, walked: Result) -> None:
    with pytest.raises(ViewerError, match="no posture in any frame"):
        subject_of(Postures(joints=np.empty((0, 14, 3))))
    other = View(camera=walk.camera, time=walk.time[:1], image=walk.image[:1])
    with pytest.raises(ViewerError, match="the view has 1 frames, the result 5"):
        subject_of(walked, other)
    with pytest.raises(ViewerError, match="recover it first"):
        subject_of(other)
    truth = subject_of(walk)
    assert truth.frames[0].points.shape == (1, 19, 3)
    assert len(JOINTS) == np.isfinite(truth.frames[0].points[0]).all(axis=1).sum()


# --- uncalibrated views ----------------------------------------------------------------------------------


def test_uncalibrated_survivors_are_seen_at_their_image(flat: Result, narrow_view: View) -> None:
    shown = subject_of(flat).frames[2]
    assert shown.sight is not None
    np.testing.assert_allclose(
        shown.sight.camera.project(shown.points[:, :14]),
        np.broadcast_to(shown.sight.image, (len(shown), 14, 2)),
        rtol=0,
        atol=1e-6,
    )
    wide = subject_of(flat, narrow_view).frames[2].sight
    assert wide is not None
    np.testing.assert_allclose(
        wide.camera.project(shown.points[:1, :14])[0], narrow_view.image[2], rtol=0, atol=1e-6
    )


def test_a_camera_infinitely_far_has_parallel_rays_and_no_eye(flat: Result) -> None:
    subject = subject_of(flat)
    shown = subject.frames[0].chosen([0, 5])
    world = upright_world(subject.points())
    made = compose(shown, figure=subject.figure, world=world, style=Style(layout="superposed"))
    assert "/meshcat/camera/rays" in made.scene.nodes
    assert "/meshcat/camera/eye" not in made.scene.nodes
    for name in JOINTS:
        dot = placement(made.scene, f"/meshcat/camera/points/{name}")[:3, 3]
        joint = placement(made.scene, f"/meshcat/posture-0/joints/{name}")[:3, 3]
        gap = (joint - dot) @ world.R_world_cam  # along the camera's axes: in depth alone
        np.testing.assert_allclose(gap[:2], 0, atol=1e-6)
        assert gap[2] > 0.59
    assert np.isfinite(made.points).any(axis=1).sum() >= 2 * 14 + 4  # the image plane is in the picture


def test_survivors_of_several_scales_stand_in_one_place(scales: Result) -> None:
    subject = subject_of(scales)
    shown = subject.frames[1]
    assert shown.scales is not None
    middles = shown.aligned_points[:, :14, :2].mean(axis=1)
    np.testing.assert_allclose(middles, np.broadcast_to(middles[0], middles.shape), rtol=0, atol=1e-9)
    assert np.ptp(shown.points[:, :14, 0].mean(axis=1)) > 0.3  # where the image's corner would put them
    third = shown.chosen([4])
    assert third.sight is not None
    np.testing.assert_allclose(
        third.sight.camera.project(third.points[:, :14])[0], third.sight.image, rtol=0, atol=1e-6
    )
    np.testing.assert_array_equal(third.alignment, 0)
    world = upright_world(subject.points())
    scene = compose(shown, figure=subject.figure, world=world, style=Style(layout="superposed")).scene
    for k in range(len(shown)):
        found = [path for path in scene.nodes if path.startswith(f"/meshcat/posture-{k}/joints/")]
        for path in found:
            index = JOINT[path.rpartition("/")[2]]
            wanted = world.place(shown.aligned_points[k, index])
            np.testing.assert_allclose(placement(scene, path)[:3, 3], wanted, rtol=0, atol=1e-8)
    with pytest.raises(ViewerError, match=r"3 scales.*--posture 0,1"):
        check_one_scale(shown)
    check_one_scale(third)


def test_pruned_branches_of_an_uncalibrated_frame_are_placed(flat: Result) -> None:
    subject = subject_of(flat)
    rejected = rejected_of(flat, subject, 0)
    assert rejected.sight is not None
    seen = np.isfinite(rejected.points[:, :14]).all(axis=2)
    again = rejected.sight.camera.project(rejected.points[:, :14])
    gap = np.linalg.norm(again - rejected.sight.image, axis=2)[seen]
    assert gap.max() < 1e-6
    assert seen.sum() > 100


def test_pruned_branches_without_a_place_are_refused(scales: Result, taylor: Result) -> None:
    with pytest.raises(ViewerError, match="recovered at 3 scales"):
        rejected_of(scales, subject_of(scales), 0)
    with pytest.raises(ViewerError, match="--proportions figure"):
        rejected_of(taylor, subject_of(taylor), 0)


def test_a_view_of_the_other_kind_is_refused(
    flat: Result, walked: Result, walk: View, flat_view: View
) -> None:
    five = posekit.result_of(posekit.recover(walk))
    short = View(camera=flat_view.camera, time=flat_view.time[:5], image=flat_view.image[:5])
    with pytest.raises(ViewerError, match="a calibrated picture, the view's camera is uncalibrated"):
        subject_of(five, short)
    long = View(camera=walk.camera, time=np.arange(8.0), image=np.resize(walk.image, (8, 14, 2)))
    with pytest.raises(ViewerError, match="an uncalibrated picture, the view's camera is calibrated"):
        subject_of(flat, long)


def test_the_truth_of_an_uncalibrated_view_tells_its_scale(flat_view: View) -> None:
    assert isinstance(flat_view.camera, ScaledOrthographicModel)
    unknown = View(
        camera=ScaledOrthographicModel(scale=None),
        time=flat_view.time,
        image=flat_view.image,
        truth=flat_view.truth,
    )
    sight = subject_of(unknown).frames[0].sight
    assert sight is not None
    assert isinstance(sight.camera, ScaledOrthographicCamera)
    assert float(sight.camera.scale) == pytest.approx(400.0)


def test_joints_that_were_not_seen_are_translucent_and_boxed(hidden_elbow: tuple[Result, View]) -> None:
    result, view = hidden_elbow
    subject = subject_of(result, view)
    shown = subject.frames[0].chosen([0])
    world = upright_world(subject.points())
    made = compose(shown, figure=subject.figure, world=world, style=Style())
    nodes = made.scene.nodes

    def opacity(path: str) -> float:
        node = nodes[f"/meshcat/posture-0/{path}"]
        assert node.object is not None
        return float(node.object["material"].get("opacity", 1.0))

    assert opacity("joints/right_elbow") < 0.5
    assert opacity("joints/right_wrist") < 0.5
    assert opacity("joints/left_elbow") == 1.0
    assert opacity("bodies/right_forearm") < opacity("bodies/left_forearm")
    assert opacity("bones-inferred") < opacity("bones")
    one = result.frames[0].inferred[0]["right_elbow"] if result.frames[0].inferred else None
    assert one is not None
    box = placement(made.scene, "/meshcat/posture-0/regions/right_elbow/faces")
    np.testing.assert_allclose(box[:3, 3], world.place((one.lower + one.upper) / 2), rtol=0, atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(box[:3, :3], axis=0), one.upper - one.lower, rtol=0, atol=1e-8)
    # The interval of depth is a thin box along the ray.
    thin = placement(made.scene, "/meshcat/posture-0/regions/right_wrist/faces")
    np.testing.assert_allclose(np.linalg.norm(thin[:3, :3], axis=0), [0.003, 0.003, 0.6], rtol=0, atol=1e-8)
    assert "/meshcat/posture-0/regions/left_elbow/faces" not in nodes
    assert "/meshcat/camera/points/right_elbow" not in nodes
    assert "/meshcat/camera/points/right_wrist" in nodes
    low, high = made.points.min(axis=0), made.points.max(axis=0)
    corners = world.place(np.array([one.lower, one.upper]))
    assert (corners >= low - 1e-9).all()
    assert (corners <= high + 1e-9).all()


def test_completed_joints_have_no_box(taylor: Result) -> None:
    subject = subject_of(taylor)
    shown = subject.frames[0]
    world = upright_world(subject.points())
    nodes = compose(shown, figure=subject.figure, world=world, style=Style()).scene.nodes
    assert not any("/regions/" in path for path in nodes)
    assert nodes["/meshcat/posture-0/joints/pelvis"].object["material"]["opacity"] < 0.5  # type: ignore[index]
    assert "/meshcat/camera/points/pelvis" not in nodes


def test_postures_without_configuration_or_with_few_digits_are_drawn_whole(
    walk: View, walked: Result, subject: DrawnSubject
) -> None:
    frame = walked.frames[0]
    q = np.round(
        frame.q, 4
    )  # as files are written where noise is known; of the second posture they have none
    q[1] = np.nan
    shown = subject_of(replace(walked, frames=[replace(frame, q=q), *walked.frames[1:]]), walk).frames[0]
    assert shown.q is not None
    np.testing.assert_allclose(np.linalg.norm(shown.q[:, 3:7], axis=1), 1, rtol=0, atol=1e-12)
    wanted = subject.frames[0].points
    np.testing.assert_allclose(
        np.delete(shown.points, 1, axis=0), np.delete(wanted, 1, axis=0), rtol=0, atol=1e-3
    )
    np.testing.assert_allclose(shown.points[1, : len(JOINTS)], wanted[1, : len(JOINTS)], rtol=0, atol=0)
    assert np.isfinite(shown.points).all()
    scene, world = Scene(), upright_world(subject.points())
    for row in (0, 1):
        posture = DrawnPosture(points=shown.points[row], q=shown.q[row])
        add_posture(scene, f"drawn-{row}", posture, figure=subject.figure, world=world)
        assert f"/meshcat/drawn-{row}/bodies/head" in scene.nodes
