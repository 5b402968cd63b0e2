"""A frame that does not show the neck is empty and says why; the others are as if it were not there."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import HeadError, InputError
from posekit.evaluate import Method, compare, evaluate
from posekit.formats import own as files
from posekit.formats.own import LeeChenModel, OpenCVModel, View
from posekit.recovery import recover
from posekit.recovery.recovery import Recovery
from posekit.recovery.result import result_of
from posekit.recovery.sequences import follow
from posekit.settings import RecoverSettings
from posekit.skeleton import JOINT
from posekit.synthesis import random_views
from posekit.views.builtin import builtin_view, view_of
from tests.detector_files import view_keypoints, write_keypoints

LOST = [0, 2]
"""The first frame among them: what is said of all frames is hardly said of that one."""
KEPT = [1, 3, 4]
REASON = "the neck, from which the tree grows, is not seen"


def neckless(view: View, *, rootless: bool = True) -> View:
    image, root = view.image.copy(), view.root.copy()
    image[LOST, 0] = np.nan
    if rootless:
        root[LOST] = np.nan
    return replace(view, image=image, root=root)


@cache
def kinds() -> dict[str, View]:
    exact = view_of(random_views(load_figure(), 5, np.random.default_rng(3)))
    exact = replace(exact, time=np.arange(5) / 10)
    rng = np.random.default_rng(0)
    noisy = replace(
        exact,
        image=exact.image + rng.normal(size=exact.image.shape),
        head_image=exact.head_image + rng.normal(size=exact.head_image.shape),
    )
    lens = np.array([-0.1, 0.02, 1e-3, 1e-3, 0.0])
    assert isinstance(exact.camera, OpenCVModel)
    return {
        "the head tells f": builtin_view("seq1"),
        "f is known": replace(builtin_view("seq1"), camera=LeeChenModel(f=0.05)),
        "a lens that distorts": replace(exact, camera=replace(exact.camera, distortion=lens)),
        "the root is given": replace(noisy, root=noisy.truth[:, 0], deviation=1.0),
        "the head tells the root": replace(noisy, root=np.empty(0), deviation=1.0),
        "the neck is placed": replace(noisy, root=np.empty(0), head_image=np.empty(0), deviation=1.0),
        "of unknown noise": replace(noisy, root=np.empty(0), head_image=np.empty(0)),
    }


def assert_same(found: Recovery, alone: Recovery) -> None:
    """Compare a recovery of all frames with one of those that show the neck, to the last bit."""
    for k, one in zip(KEPT, alone.frames, strict=True):
        frame = found.frames[k]
        assert frame.branches == one.branches
        for name in ("time", "joints", "q", "head", "chi2", "fk_distance", "length_residual", "margins"):
            np.testing.assert_equal(getattr(frame, name), getattr(one, name))
        for name in ("rejected", "judged", "camera", "tolerance"):
            assert getattr(frame, name) == getattr(one, name)
        if one.refined is not None and frame.refined is not None:
            np.testing.assert_array_equal(frame.refined.covariance, one.refined.covariance)
        np.testing.assert_array_equal(found.probability[k], alone.probability[KEPT.index(k)])
    for k in LOST:
        frame = found.frames[k]
        assert (len(frame), frame.reason, frame.judged) == (0, f"frames[{k}]: {REASON}", None)
        assert frame.rejected == {"neck/not_seen": 8192}
    assert found.unrecovered == {REASON: LOST}


@pytest.mark.parametrize(
    ("kind", "rootless"), [*((kind, True) for kind in kinds()), ("the root is given", False)]
)
def test_the_others_are_those_of_the_view_without_these_frames(kind: str, rootless: bool) -> None:
    view = kinds()[kind]
    found, alone = recover(neckless(view, rootless=rootless)), recover(view.take(KEPT))
    assert all(map(len, alone.frames))
    assert_same(found, alone)
    paths, theirs = follow(found, k=2), follow(alone, k=2)
    np.testing.assert_array_equal(paths.survivor[:, KEPT], theirs.survivor)
    assert (paths.survivor[:, LOST] == -1).all()
    measured = compare(found, view.truth)
    np.testing.assert_array_equal(measured.first[KEPT], compare(alone, view.truth[KEPT]).first)
    assert np.isnan(measured.best[LOST]).all()


def test_flips_by_hand_stay_with_their_frames() -> None:
    view = kinds()["a lens that distorts"]
    ends = [("right", "elbow"), ("left", "elbow"), ("left", "wrist"), ("right", "wrist"), ("left", "elbow")]
    nearer = [{f"{side}_elbow-{side}_wrist": f"{side}_{end}"} for side, end in ends]
    found = recover(neckless(view), nearer=nearer, checks=("rigid-parts",))
    alone = recover(view.take(KEPT), nearer=[nearer[k] for k in KEPT], checks=("rigid-parts",))
    assert_same(found, alone)
    assert all(any(name.startswith("nearer/") for name in found.frames[k].rejected) for k in KEPT)


def test_an_evaluation_counts_them_as_empty() -> None:
    view = kinds()["a lens that distorts"]
    some = evaluate(neckless(view), method=Method(noise=(0.0,))).frames.measured
    alone = evaluate(view.take(KEPT), method=Method(noise=(0.0,))).frames.measured
    assert (some.survivors[LOST] == 0).all()
    np.testing.assert_array_equal(some.survivors[KEPT], alone.survivors)
    np.testing.assert_array_equal(some.errors["best"][KEPT], alone.errors["best"])


def test_an_evaluation_goes_on_where_a_whole_part_lacks_it() -> None:
    """Views are evaluated 256 frames at a time."""
    scene = random_views(load_figure(), 260, np.random.default_rng(8))
    image = scene.image.copy()
    image[256:, 0] = np.nan
    view = replace(view_of(scene), image=image, root=scene.joints_cam[:, 0])
    method = Method(noise=(0.0,), settings=RecoverSettings(checks=("rigid-parts",)))
    found = evaluate(view, method=method).frames.measured
    assert (found.survivors[:256] > 0).all() and (found.survivors[256:] == 0).all()


def test_a_result_is_read_back_with_its_empty_frames(tmp_path: Path) -> None:
    view = kinds()["the head tells f"]
    files.write_view(tmp_path / "v.json", neckless(view))
    again = recover(files.read_view(tmp_path / "v.json"))
    files.write_result(tmp_path / "r.npz", result_of(again))
    read = files.read_result(tmp_path / "r.npz")
    assert [len(frame.joints) > 0 for frame in read.frames] == [False, True, False, True, True]
    assert read.settings["unrecovered"] == {REASON: LOST}


def test_a_neck_that_is_seen_nowhere_is_refused() -> None:
    view = kinds()["the root is given"]
    image = view.image.copy()
    image[:, 0] = np.nan
    with pytest.raises(InputError, match=r"image\[:, 0\]: got NaN; expected the neck in one frame at least"):
        replace(view, image=image)


def test_errors_are_those_of_the_frames_that_show_it() -> None:
    view = replace(builtin_view("seq1"), head_image=np.empty(0))
    with pytest.raises(HeadError, match=r"^frames\[1\]: 1 of 6 head points are known"):
        recover(neckless(view))
    placed = kinds()["the neck is placed"]
    image = placed.image.copy()
    image[:, JOINT["right_hip"]] += 2000.0  # no hips are so wide
    with pytest.raises(InputError) as refused:
        recover(neckless(replace(placed, image=image)))
    text = str(refused.value)
    assert text.startswith("frames[1]: ")
    assert "lengths, camera or image points may be wrong" in text
    assert text.endswith("correct them, or give root")
    assert "\n" not in text and len(text) < 400


def test_a_root_behind_the_camera_is_named_by_its_frame() -> None:
    view = kinds()["the root is given"]
    root = view.root.copy()
    root[3, 2] *= -1
    with pytest.raises(InputError, match=r"^frames\[3\]\.root: .* is behind the camera"):
        recover(neckless(replace(view, root=root)))


def test_pictures_of_nobody_are_frames_from_end_to_end(tmp_path: Path, command: Callable[..., Any]) -> None:
    """Numbers and times of frames, paths and exports are those of the pictures."""
    view = kinds()["the neck is placed"]
    assert isinstance(view.camera, OpenCVModel)
    place = tmp_path / "openpose"
    write_keypoints(place, view_keypoints(view, "openpose"), "openpose")
    pictures = sorted(place.iterdir())
    for k in (0, 2):
        document = json.loads(pictures[k].read_text(encoding="utf-8"))
        if k:  # somebody without a shoulder
            points = document["people"][0]["pose_keypoints_2d"]
            for j in (1, 2, 5):  # BODY_25: neck and shoulders
                points[3 * j : 3 * j + 3] = [0, 0, 0]
        else:
            document["people"] = []
        pictures[k].write_text(json.dumps(document), encoding="utf-8")
    f = view.camera.K[0, 0]
    size = (2 * view.camera.K[0, 2], 2 * view.camera.K[1, 2])
    fov = np.degrees(2 * np.arctan(size[0] / 2 / f))
    asked = ("--fov", f"{fov:.12g}", "--size", f"{size[0]:.0f}x{size[1]:.0f}", "--fps", "10")
    done = command("recover", place, "-o", tmp_path / "r.npz", *asked, "--follow", "1", "--no-refine")
    assert done.code == 0, done.err
    assert "1 of 5 frames not recovered: the person is not seen: none of the joints is (frame 0)" in done.err
    assert "right_shoulder and left_shoulder are not seen" in done.err
    result = files.read_result(tmp_path / "r.npz")
    np.testing.assert_allclose([frame.time for frame in result.frames], np.arange(5) / 10)
    assert [len(frame.joints) > 0 for frame in result.frames] == [False, True, False, True, True]
    assert result.paths is not None
    assert (result.paths.survivor[0] >= 0).tolist() == [False, True, False, True, True]
    assert command("convert", place, tmp_path / "v.json", *asked).code == 0
    back = files.read_view(tmp_path / "v.json")
    assert np.isnan(back.image[:, JOINT["neck"], 0]).tolist() == [True, False, True, False, False]
    assert np.isfinite(back.image[2]).any()
