"""Scenes: what is collected, where the bodies are, what is pointed at."""

from __future__ import annotations

import json

import meshcat.geometry as mg
import numpy as np
import pytest

import posekit
from posekit.cameras import Array
from posekit.errors import ViewerError
from posekit.files import Postures, Result, View
from posekit.skeleton import JOINT, JOINTS, TREE_SEGMENTS, segment_name
from posekit.viewer.scene.body import Look, add_posture
from posekit.viewer.scene.branch import lift_branch, one_a_reason, rejected_of
from posekit.viewer.scene.compose import Style, compose, row_count
from posekit.viewer.scene.culprit import culprit
from posekit.viewer.scene.eye import Eye
from posekit.viewer.scene.framing import fitted_eye, orbit
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.stage import background_colour
from posekit.viewer.scene.subject import Subject, subject_of
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


def test_pinocchios_capsules_lie_where_the_posture_has_them(subject: Subject) -> None:
    shown = subject.frames[0]
    assert shown.q is not None
    world = upright_world(subject.points())
    scene = Scene()
    add_posture(scene, "by-q", shown.points[3], figure=subject.figure, world=world, q=shown.q[3])
    bent = shown.points[3].copy()
    bent[JOINT["left_ankle"]] += 1e-3  # no q gives this back: the capsules are laid along the segments
    add_posture(scene, "laid", bent, figure=subject.figure, world=world)
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


def test_world_is_upright_and_stands_on_the_ground(subject: Subject) -> None:
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


def test_unknown_joints_are_left_out(subject: Subject) -> None:
    points = subject.frames[0].points[0].copy()
    points[JOINT["right_wrist"]] = np.nan
    scene = Scene()
    add_posture(scene, "a", points, figure=subject.figure, world=upright_world(points))
    assert "/meshcat/a/joints/right_elbow" in scene.nodes
    assert "/meshcat/a/joints/right_wrist" not in scene.nodes
    assert "/meshcat/a/bodies/right_forearm" not in scene.nodes
    assert "/meshcat/a/bodies/right_upper_arm" in scene.nodes
    with pytest.raises(ViewerError, match="no joint of the posture is known"):
        add_posture(scene, "b", np.full((14, 3), np.nan), figure=subject.figure, world=upright_world(points))
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


def test_branches_of_survivors_give_the_survivors_back(subject: Subject, walked: Result) -> None:
    shown, frame = subject.frames[0], walked.frames[0]
    assert shown.sight is not None
    lengths = np.array([subject.figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS])
    for k, bits in enumerate(frame.branches):
        joints = lift_branch(
            shown.sight.camera, frame.joints[k, 0], shown.sight.image[:14], lengths, bits, tolerance=1e-9
        )
        np.testing.assert_allclose(joints, frame.joints[k], rtol=0, atol=1e-6)


def test_rejected_branches_are_pointed_at(subject: Subject, walked: Result) -> None:
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


def test_result_without_pruned_branches_is_refused(subject: Subject, walk: View) -> None:
    plain = posekit.result_of(posekit.recover(walk))
    with pytest.raises(ViewerError, match="--explain"):
        rejected_of(plain, subject, 0)


def test_what_superposed_postures_share_is_drawn_once(subject: Subject) -> None:
    shown = subject.frames[0]
    looks = superposed_looks(shown, subject.figure)
    assert sum("torso" not in look.without for look in looks) == 1
    knees = {tuple(np.round(points[JOINT["left_knee"]], 3)) for points in shown.points}
    assert sum("left_thigh" not in look.without for look in looks) == len(knees) < len(shown)


def test_groups_have_colours_of_their_own(subject: Subject) -> None:
    two = subject.frames[0].chosen([0, len(subject.frames[0]) - 1])
    looks = superposed_looks(two, subject.figure)
    assert looks[0].body and looks[1].body
    own = {name for name in looks[0].body if looks[0].body[name] != looks[1].body.get(name)}
    assert "left_shank" in own
    assert "torso" not in looks[1].body


def test_side_by_side_keeps_apart(subject: Subject) -> None:
    shown = subject.frames[0].chosen(range(4))
    world = upright_world(shown.points)
    scene = compose(shown, figure=subject.figure, world=world, style=Style(azimuth=30)).scene
    necks = np.array([placement(scene, f"/meshcat/posture-{k}/joints/neck")[:3, 3] for k in range(4)])
    gaps = np.linalg.norm(np.diff(necks, axis=0), axis=1)
    assert (gaps > 0.5).all()
    assert not any(path.startswith("/meshcat/camera") for path in scene.nodes)
    assert [row_count(n) for n in (1, 7, 8, 36)] == [1, 1, 2, 4]


def test_too_many_postures_are_refused(subject: Subject) -> None:
    many = subject.frames[0].chosen([0] * 201)
    with pytest.raises(ViewerError, match="201 postures in one picture"):
        compose(many, figure=subject.figure, world=upright_world(many.points), style=Style())


def test_fitted_eye_has_all_points_in_its_picture(rng: np.random.Generator, subject: Subject) -> None:
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
