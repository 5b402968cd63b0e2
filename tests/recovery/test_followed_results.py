"""Paths in results, and what is said of frames without a posture."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats import own as files
from posekit.formats.motion import read_motion
from posekit.formats.own import View
from posekit.formats.own.paths import FollowedPaths
from posekit.recovery import recover
from posekit.recovery.advice import advice_lines
from posekit.recovery.least_violation import least_violation
from posekit.recovery.result import result_of
from posekit.recovery.sequences import follow
from posekit.recovery.summary import following_line
from posekit.settings import MEASURED_TOLERANCE
from posekit.skeleton import JOINT
from posekit.synthesis import random_views
from posekit.views.builtin import builtin_view, view_of

FIGURE = load_figure()


def exact(count: int, seed: int = 5) -> View:
    scene = random_views(FIGURE, count, np.random.default_rng(seed))
    return replace(view_of(scene), root=scene.joints_cam[:, 0])


def off(view: View, joint: str, pixels: float) -> View:
    """Move a joint's image points in all frames but the first."""
    image = view.image.copy()
    image[1:, JOINT[joint], 0] += pixels
    return replace(view, image=image)


@pytest.mark.parametrize("name", ["r.json", "r.npz"])
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_a_file_keeps_the_paths(name: str, unit: Any, tmp_path: Path) -> None:
    recovery = recover(builtin_view("seq1"))
    following = follow(recovery, k=3)
    files.write_result(tmp_path / name, result_of(recovery, unit=unit, following=following))
    read = files.read_result(tmp_path / name).paths
    assert read is not None
    assert len(read) == len(following)
    np.testing.assert_array_equal(read.survivor, following.survivor)
    np.testing.assert_allclose(read.joints, following.joints, rtol=1e-12)
    np.testing.assert_allclose(read.smoothed[0], following.smoothed(0), rtol=1e-12)
    np.testing.assert_array_equal(read.interpolated, following.interpolated)
    np.testing.assert_array_equal(np.isnan(read.deviation), np.isinf(following.deviation))
    np.testing.assert_allclose(read.cost, following.cost)
    assert (read.lead, read.exact, read.apart) == pytest.approx(
        (following.lead, following.exact, following.apart)
    )
    for frame, row in zip(recovery.frames, read.survivor[0], strict=True):
        assert row < 0 or np.isfinite(frame.joints[row]).all()


def test_paths_of_other_frames_are_refused() -> None:
    recovery = recover(builtin_view("seq1"))
    paths = result_of(recovery, following=follow(recovery)).paths
    assert paths is not None
    with pytest.raises(InputError, match=r"paths\.survivor"):
        result_of(replace(recovery, frames=recovery.frames[:2]), following=follow(recovery))
    values = {item.name: getattr(paths, item.name) for item in fields(paths)}
    for name, bad in (
        ("cost", [np.inf] * 2),
        ("joints", paths.joints[:, :1]),
        ("survivor", paths.survivor - 5),
    ):
        with pytest.raises(InputError, match=f"paths.{name}"):
            FollowedPaths(**{**values, name: bad})


@pytest.mark.parametrize("change", ["long", "text", "nothing", "deep"])
def test_files_with_damaged_paths_are_refused(change: str, tmp_path: Path) -> None:
    recovery = recover(builtin_view("seq1"))
    files.write_result(tmp_path / "r.json", result_of(recovery, following=follow(recovery)))
    document = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    first = document["paths"]["paths"][0]
    if change == "long":
        first["survivor"].append(0)
    elif change == "text":
        first["cost"] = "cheap"
    elif change == "nothing":
        document["paths"]["paths"] = []
    else:
        first["joints"][0][0] = [1.0]
    (tmp_path / "r.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        files.read_result(tmp_path / "r.json")
    assert "\n" not in str(refused.value)


def test_the_command_line_follows_and_converts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Callable[..., Any]
) -> None:
    monkeypatch.chdir(tmp_path)
    files.write_view("seq1.json", builtin_view("seq1"))
    done = command("recover", "seq1.json", "-o", "r.npz", "--follow", "2")
    assert done.code == 0, done.err
    assert "2 likeliest paths" in done.out
    done = command("convert", "r.npz", "path.trc", "--posture", "path")
    assert done.code == 0, done.err
    assert "the likeliest path, with " in done.out and "bridged" not in done.out
    paths = files.read_result("r.npz").paths
    assert paths is not None
    written = read_motion("path.trc")
    # TRC says which way is up as its tools have it: compare distances, which no turn changes.
    own, theirs = paths.smoothed[0], written.points[:, :14]
    np.testing.assert_allclose(
        np.linalg.norm(own[:, 1:] - own[:, :1], axis=2),
        np.linalg.norm(theirs[:, 1:] - theirs[:, :1], axis=2),
        atol=1e-5,
    )
    assert command("recover", "seq1.json", "-o", "n.npz").code == 0
    refused = command("convert", "n.npz", "path.bvh", "--posture", "path")
    assert refused.code == 2
    assert "--follow 2" in refused.err
    assert not Path("path.bvh").exists()


def test_the_command_line_finds_the_scale_of_the_lengths(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Callable[..., Any]
) -> None:
    """Frames that have nothing to do with each other tell it too, by what noise can explain."""
    monkeypatch.chdir(tmp_path)
    scene = random_views(FIGURE, 12, np.random.default_rng(3)).with_noise(1.0, np.random.default_rng(4))
    view = replace(view_of(scene), root=scene.joints_cam[:, 0], head_image=np.empty(0), deviation=1.0)
    long = {name: 1.04 * length for name, length in FIGURE.lengths.items()}
    files.write_view("long.json", replace(view, lengths=long))
    asked = ("recover", "long.json", "-o", "r.npz", "--follow-scale", "0.04")
    done = command(*asked, "--follow", "1")
    assert done.code == 0, done.err
    said = next(line for line in done.out.splitlines() if line.startswith("lengths times "))
    assert float(said.split()[2].rstrip(",")) == pytest.approx(1 / 1.04, abs=0.02)
    lengths = files.read_result("r.npz").settings["lengths"]
    assert lengths["neck-pelvis"] == pytest.approx(FIGURE.lengths["neck-pelvis"], rel=0.02)
    Path("r.npz").unlink()
    for more, said in (
        ((), "--follow 1"),
        (("--follow", "1", "--no-refine"), "no --no-refine"),
        (("--follow", "1", "--follow-scale", "3"), "at most 0.15"),
    ):
        refused = command(*asked, *more)
        assert refused.code == 2 and said in refused.err and refused.err.count("\n") == 1
        assert not Path("r.npz").exists()


def test_the_line_on_paths_says_how_sure() -> None:
    recovery = recover(builtin_view("seq1"))
    assert "as likely as the next that is 5 cm elsewhere" in following_line(follow(recovery, k=2))
    assert "--follow 2" in following_line(follow(recovery, k=1))


def test_paths_that_are_the_same_to_5_cm_are_told_as_one() -> None:
    following = follow(recover(builtin_view("seq1")), k=2)
    twice = replace(following, joints=following.joints[[0, 0]] + np.array([0.0, 0.012])[:, None, None, None])
    assert "no other that is 5 cm elsewhere" in following_line(twice)


# --- frames without a posture ---------------------------------------------------------------------------


def test_the_least_violation_is_what_was_done_to_the_view() -> None:
    """A wrist beyond the arm's reach: nothing else is wrong, and allowing as much admits a posture."""
    view = exact(12)
    focal = float(view.camera.K[0, 0]) if hasattr(view.camera, "K") else 1.0
    shifted = off(view, "right_wrist", 0.6 * focal / 4)
    recovery = recover(shifted, tolerance=MEASURED_TOLERANCE, infer=False)
    assert recovery.grower is not None
    named = 0
    for k, frame in enumerate(recovery.frames):
        if len(frame):
            continue
        found = least_violation(recovery.grower, k, MEASURED_TOLERANCE)
        assert found is not None
        assert len(found.branch) == 13
        worst = found.excesses[0]
        named += worst.reason == "no_solution/right_elbow-right_wrist"
        wider = replace(MEASURED_TOLERANCE, tangent=MEASURED_TOLERANCE.tangent + worst.beyond + 1e-6)
        if [one.reason for one in found.excesses] == ["no_solution/right_elbow-right_wrist"]:
            again = recover(shifted, tolerance=wider, infer=False).frames[k]
            assert found.branch in again.branches
    assert named >= 6


def test_a_posture_violates_nothing() -> None:
    recovery = recover(exact(3), infer=False)
    assert recovery.grower is not None
    for k in range(3):
        found = least_violation(recovery.grower, k)
        assert found is not None
        assert found.excesses == ()
        assert not advice_lines(recovery)


def test_wrong_lengths_are_doubted_by_name() -> None:
    view = replace(exact(12), deviation=1.0, lengths={"right_hip-right_knee": 0.2})
    recovery = recover(view, infer=False)
    assert sum(len(frame) == 0 for frame in recovery.frames) > 6
    lines = advice_lines(recovery)
    assert any("no posture; the one nearest to the limits breaks" in line for line in lines)
    assert any(
        line.startswith("right_hip-right_knee") or "right_hip-right_knee" in line for line in lines[3:]
    )
    assert all("\n" not in line for line in lines)


def test_an_uncalibrated_or_hidden_frame_has_advice_or_none() -> None:
    view = exact(4)
    image = view.image.copy()
    image[:, 1:] = np.nan
    nothing = recover(replace(view, image=image), infer=False)
    assert all("\n" not in line for line in advice_lines(nothing))
