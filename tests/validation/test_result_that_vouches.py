"""A result says what it was judged with; it is believed no further than posekit allows of itself."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.body.measured import LEAST_FRAMES, hips_forward
from posekit.geometry import Array
from posekit.recovery.recovered import recovered_with
from posekit.validators import Validator


@pytest.fixture
def result(command: Callable[..., Any], tmp_path: Path) -> Path:
    """Return a result of one frame."""
    view, path = tmp_path / "view.json", tmp_path / "result.json"
    assert command("synth", "walker", "-o", view, "--frames", 1).code == 0
    assert command("recover", view, "-o", path).code == 0
    return path


@pytest.mark.parametrize("kind", ["given", "measured", "noisy", "refined"])
def test_a_limb_two_metres_off_is_not_valid_whatever_the_file_says(
    kind: str, result: Path, command: Callable[..., Any]
) -> None:
    assert command("validate", result).code == 0
    document = json.loads(result.read_text())
    tolerance = {"rigid": 1000.0, "tangent": 1000.0, "placement": False, "angle": 180.0, "hips": 1.0}
    settings = document["settings"]
    settings["judged"] = [kind]
    settings["contact_margin"] = -1000.0
    settings["tolerance" if kind == "given" else kind] = tolerance | {"contact": -1000.0}
    names = document["joint_names"]
    for survivor in document["frames"][0]["postures"]:
        point = survivor["joints"][names.index("left_wrist")]
        point[0] += {"m": 2, "cm": 200, "mm": 2000}[document["unit"]]
    result.write_text(json.dumps(document))
    outcome = command("validate", result)
    assert outcome.code == 1, outcome
    assert "more than posekit allows of itself" in outcome.err


def test_survivors_of_one_view_are_no_recording(command: Callable[..., Any], tmp_path: Path) -> None:
    """A survivor is judged the same beside others as alone: their median frame says nothing of the skeleton's hips."""
    view, path = tmp_path / "view.json", tmp_path / "result.npz"
    assert command("synth", "random", "-o", view, "--uncalibrated", "--seed", 2).code == 0
    assert command("recover", view, "-o", path, "--proportions", "taylor").code == 0
    result = posekit.read_result(path)
    own, settings = recovered_with(result)
    joints = result.frames[0].joints
    assert len(joints) > 2 * LEAST_FRAMES
    assert not math.isnan(hips_forward(joints))

    def margins(postures: Array) -> Array:
        report = Validator(own, settings).check(postures)
        return np.concatenate([one.margin for one in report.judgements if one.check == "joint_range"])

    alone = [margins(one[None]) for one in joints]
    np.testing.assert_allclose(margins(joints), np.concatenate(alone), rtol=0, atol=1e-9)


def test_the_path_of_a_followed_result_is_offered_as_motion(
    result: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    assert "posekit convert RESULT path.npz" not in command("validate", result).out
    view, followed, path = tmp_path / "walk.json", tmp_path / "followed.npz", tmp_path / "path.npz"
    assert command("synth", "walker", "-o", view, "--frames", "5", "--dt", "0.1").code == 0
    assert command("recover", view, "-o", followed, "--follow", "1").code == 0
    assert "posekit convert RESULT path.npz" in command("validate", followed).out
    assert command("convert", followed, path).code == 0
    assert "1 clip: " in command("validate", path).out
