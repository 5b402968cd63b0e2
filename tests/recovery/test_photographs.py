"""Photographs without a camera: a likely scale, key points as far off as people put them, parts of a body."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.body.anthropometry.view_likelihood import USUAL_DISTANCE_METRES
from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.formats.own import ScaledOrthographicModel, View, read_result
from posekit.recovery import recover
from posekit.recovery.advice import advice_lines
from posekit.recovery.key_point_offsets import joint_offsets
from posekit.recovery.likely_scale import likely_scales
from posekit.recovery.photograph import RELIEF_METRES
from posekit.recovery.seen_trunk import with_trunk
from posekit.skeleton import JOINT, JOINTS, SEGMENT_NAMES, SIDES, TREE_SEGMENTS
from posekit.synthesis import random_postures
from posekit.views.person_view import pelvis_fraction

FIGURE = load_figure()
S = 200.0
FRAMES = 12
TWELVE = [k for k, name in enumerate(JOINTS) if name not in ("neck", "pelvis")]
LEVEL = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From the figure's frame (x forward, y left, z up) to a level camera's that is behind it."""


def people(n: int, seed: int = 7, deviation: float = 0.05) -> np.ndarray:
    """Random legal postures (n, 14, 3) of people whose lengths nobody knows, seen by level cameras from all around."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(n):
        own = {name: FIGURE.lengths[name] for name in SEGMENT_NAMES}
        for part in ("shoulder-{}_elbow", "elbow-{}_wrist", "hip-{}_knee", "knee-{}_ankle"):
            factor = np.exp(deviation * rng.standard_normal())
            for side in SIDES:
                own[f"{side}_{part.format(side)}"] *= factor
        figure = FIGURE.scaled(own)
        joints = figure.forward_kinematics(random_postures(figure, 1, rng))[0, :14]
        turn = rng.uniform(0, 2 * np.pi)
        about = np.array(
            [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]], dtype=float
        )
        made.append((joints - joints.mean(axis=0)) @ (LEVEL @ about).T)
    return np.array(made)


TRUTH = people(FRAMES)


def perspective(truth: np.ndarray, distance: float = 4.0) -> np.ndarray:
    """Take pictures of S pixels a metre in the middle of the body."""
    return S * distance * truth[..., :2] / (truth[..., 2:] + distance)


def view_of(image: np.ndarray, *, scale: float | None = None, **more: Any) -> View:
    return View(
        camera=ScaledOrthographicModel(scale=scale), time=np.arange(len(image)) / 30, image=image, **more
    )


def without(image: np.ndarray, *names: str) -> np.ndarray:
    image = image.copy()
    image[:, [JOINT[name] for name in names]] = np.nan
    return image


TWELVE_POINTS = without(perspective(TRUTH), "neck", "pelvis")


def test_nearly_every_photograph_of_twelve_points_has_a_posture_near_the_truth() -> None:
    recovery = recover(view_of(TWELVE_POINTS), infer=False)
    assert {frame.judged for frame in recovery.frames} == {"refined"}
    best = []
    for frame, truth in zip(recovery.frames, TRUTH, strict=True):
        assert len(frame)
        off = frame.joints[:, TWELVE] - truth[TWELVE]
        off -= off.mean(axis=1, keepdims=True)
        best.append(np.linalg.norm(off, axis=2).mean(axis=1).min())
    assert np.median(best) < 0.08


def test_survivors_give_the_picture_again_as_well_as_people_mark_it() -> None:
    recovery = recover(view_of(TWELVE_POINTS), infer=False)
    for k, frame in enumerate(recovery.frames):
        assert frame.scales is not None
        seen = frame.joints[:, TWELVE, :2] * frame.scales[:, None, None]
        off = np.linalg.norm(seen - TWELVE_POINTS[k, TWELVE], axis=2) / S
        aside = (
            np.linalg.norm(TWELVE_POINTS[k, TWELVE] - TWELVE_POINTS[k, TWELVE[:4]].mean(axis=0), axis=1) / S
        )
        allowed = np.hypot(joint_offsets()[TWELVE], RELIEF_METRES / USUAL_DISTANCE_METRES * aside)
        assert (off < 5 * allowed).all()
        assert np.median(off) < joint_offsets().mean()


def test_lengths_are_as_uncertain_as_scale_and_body_and_the_result_says_so() -> None:
    recovery = recover(view_of(TWELVE_POINTS), infer=False)
    noise = recovery.settings["noise"]
    assert noise["size"] == 0.0
    assert min(noise["by_segment"].values()) > 0.08
    for frame in recovery.frames:
        for a, b in TREE_SEGMENTS:
            if {a, b} & {JOINT["neck"], JOINT["pelvis"]}:
                continue
            name = f"{JOINTS[a]}-{JOINTS[b]}"
            length = np.linalg.norm(frame.joints[:, a] - frame.joints[:, b], axis=1) / FIGURE.lengths[name]
            assert (np.abs(np.log(length)) < 4 * noise["by_segment"][name]).all()


def test_exact_pictures_stay_exact() -> None:
    joints = FIGURE.forward_kinematics(random_postures(FIGURE, 4, np.random.default_rng(1)))[:, :14] @ LEVEL.T
    exact = ScaledOrthographicCamera(scale=S).project(joints)
    recovery = recover(view_of(exact, scale=S))
    assert {frame.judged for frame in recovery.frames} == {"exact"}
    assert recovery.settings["noise"] is None


def test_the_likely_scale_grows_with_the_picture_and_does_not_care_where_it_is() -> None:
    found = likely_scales(TWELVE_POINTS, FIGURE)
    larger = likely_scales(3 * TWELVE_POINTS + 1000, FIGURE)
    # A pixel counts for more in the smaller picture.
    np.testing.assert_allclose(larger.scale / found.scale, 3, rtol=0.01)
    np.testing.assert_allclose(larger.deviation, found.deviation, atol=0.01)


def test_the_likely_scale_is_the_true_one_within_its_deviation() -> None:
    found = likely_scales(TWELVE_POINTS, FIGURE)
    off = np.log(found.scale / S) / found.deviation
    assert (np.abs(off) < 2.5).all()
    assert np.sqrt(np.mean(off**2)) < 1.3
    assert (found.deviation < 0.2).all()


def test_one_segment_that_is_too_long_does_not_set_the_likely_scale() -> None:
    image = TWELVE_POINTS.copy()
    elbow, wrist = JOINT["left_elbow"], JOINT["left_wrist"]
    image[:, wrist] = image[:, elbow] + [0.6 * S, 0.0]  # a forearm of 60 cm
    moved = likely_scales(image, FIGURE).scale / likely_scales(TWELVE_POINTS, FIGURE).scale
    assert (np.abs(np.log(moved)) < 0.1).all()


def test_a_picture_without_a_segment_has_no_likely_scale() -> None:
    image = np.full((1, 14, 2), np.nan)
    image[0, JOINT["left_wrist"]] = 10.0
    found = likely_scales(image, FIGURE)
    assert np.isnan(found.scale).all()
    assert np.isnan(found.deviation).all()


def test_the_likely_scale_can_be_asked_for() -> None:
    recovery = recover(view_of(perspective(TRUTH)), scale="likely", refine=False)
    family = recovery.frames[0].family
    assert family is not None
    assert family.how == "likely"
    assert family.deviation is not None
    assert family.chosen[0] == likely_scales(perspective(TRUTH)[:1], FIGURE).scale[0]


def test_a_neck_and_a_pelvis_that_are_not_seen_are_between_those_that_are() -> None:
    trunk = with_trunk(TWELVE_POINTS, FIGURE, joint_offsets())
    shoulders = TWELVE_POINTS[:, [JOINT[f"{side}_shoulder"] for side in SIDES]].mean(axis=1)
    hips = TWELVE_POINTS[:, [JOINT[f"{side}_hip"] for side in SIDES]].mean(axis=1)
    np.testing.assert_allclose(trunk.image[:, JOINT["neck"]], shoulders)
    np.testing.assert_allclose(
        trunk.image[:, JOINT["pelvis"]], shoulders + pelvis_fraction(FIGURE) * (hips - shoulders)
    )
    assert trunk.told.all()
    assert trunk.reasons == [""] * FRAMES
    np.testing.assert_array_equal(trunk.offset[:, TWELVE], np.tile(joint_offsets()[TWELVE], (FRAMES, 1)))
    # The waist bends: the pelvis joint leaves the line to the middle of the hips.
    height = np.linalg.norm(FIGURE.neutral_points[[4, 5]].mean(axis=0) - FIGURE.neutral_points[3])
    np.testing.assert_allclose(
        trunk.offset[:, JOINT["pelvis"]], np.hypot(joint_offsets()[JOINT["pelvis"]], height / np.sqrt(3))
    )


@pytest.mark.parametrize(
    "hidden",
    [
        ("left_shoulder",),
        ("right_hip",),
        ("right_hip", "left_hip", "right_knee", "left_knee", "right_ankle", "left_ankle"),
        ("left_shoulder", "left_elbow", "left_wrist"),
        ("right_shoulder", "right_hip"),
    ],
)
def test_a_part_of_a_body_has_a_posture_which_tells_what_is_seen(hidden: tuple[str, ...]) -> None:
    image = without(TWELVE_POINTS[:4], *hidden)
    recovery = recover(view_of(image), infer=False)
    for frame in recovery.frames:
        assert len(frame)
        assert frame.inferred is not None
        trunk = {name for name in hidden if JOINT[name] < 6}
        for joints, inferred in zip(frame.joints, frame.inferred, strict=True):
            # A joint of the trunk is a region about the likeliest posture's, one of a limb is left open.
            assert trunk <= set(inferred)
            assert not set(inferred) & {JOINTS[k] for k in TWELVE} - trunk
            for name in trunk:
                region = inferred[name]
                assert ((region.lower < joints[JOINT[name]]) & (joints[JOINT[name]] < region.upper)).all()
                assert region.radius > 0.05
            known = np.isfinite(joints[TWELVE]).all(axis=1)
            assert known.tolist() == [JOINTS[k] not in set(hidden) - trunk for k in TWELVE]


def test_what_hangs_on_the_nearest_joint_is_as_uncertain_as_it_is_far() -> None:
    image = without(TWELVE_POINTS[:1], "left_shoulder")
    trunk = with_trunk(image, FIGURE, joint_offsets())
    joint, other = JOINT["left_shoulder"], JOINT["right_shoulder"]
    assert not trunk.told[0, [joint, JOINT["neck"], JOINT["pelvis"]]].any()
    np.testing.assert_array_equal(trunk.image[0, joint], image[0, other])
    apart = np.linalg.norm(FIGURE.neutral_points[joint] - FIGURE.neutral_points[other])
    assert trunk.offset[0, joint] == pytest.approx(np.hypot(joint_offsets()[other], apart / np.sqrt(3)))


def test_too_little_of_a_trunk_is_said_and_the_other_frames_are_recovered() -> None:
    image = TWELVE_POINTS[:2].copy()
    image[0, [k for k in range(6) if JOINTS[k] != "left_hip"]] = np.nan
    recovery = recover(view_of(image), infer=False)
    assert [len(frame) > 0 for frame in recovery.frames] == [False, True]
    assert recovery.frames[0].reason.startswith("frames[0]: only left_hip of neck, right_shoulder")
    with pytest.raises(InputError, match=r"^frames\[0\]: only left_hip of neck, .*needs at least 2 of them$"):
        recover(view_of(image[:1]))


def test_an_empty_photograph_says_what_would_have_to_be_wrong_in_it() -> None:
    standing = FIGURE.neutral_points[None, :14] @ LEVEL.T
    image = S * standing[..., :2]
    image[0, JOINT["left_wrist"]] = image[0, JOINT["left_elbow"]] + [1.5 * S, 0.0]
    recovery = recover(view_of(image, deviation=1.0))
    assert len(recovery.frames[0]) == 0
    lines = [line for line in advice_lines(recovery) if line.startswith("frame 0: no posture")]
    assert len(lines) == 1
    assert "left_elbow" in lines[0] or "left_wrist" in lines[0]
    assert "would have to be" in lines[0]


def test_the_command_recovers_photographs_without_a_flag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    names = ["nose", "left_eye", "right_eye", "left_ear", "right_ear"]
    names += [
        f"{side}_{part}"
        for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
        for side in ("left", "right")
    ]
    annotations = []
    for k, image in enumerate(TWELVE_POINTS[:4]):
        at = {name: image[JOINT[name]] + 300 for name in names if name in JOINT}
        points = [[*at[name].tolist(), 2] if name in at else [0, 0, 0] for name in names]
        annotations.append(
            {
                "id": k,
                "image_id": k,
                "category_id": 1,
                "keypoints": [x for one in points for x in one],
                "num_keypoints": 12,
            }
        )
    document = {
        "images": [{"id": k, "file_name": f"{k}.jpg", "width": 640, "height": 640} for k in range(4)],
        "annotations": annotations,
        "categories": [{"id": 1, "name": "person", "keypoints": names, "skeleton": []}],
    }
    Path("people.json").write_text(json.dumps(document), encoding="utf-8")
    done = command("recover", "people.json", "-o", "out.json")
    assert done.code == 0, done.err
    assert "none in 0" in done.out
    assert "scale by likely" in done.out
    result = read_result("out.json")
    assert all(len(frame.joints) and frame.family and frame.family.deviation for frame in result.frames)
    judged = command("validate", "out.json", "-o", "report.json")
    assert judged.code == 0, judged.out
