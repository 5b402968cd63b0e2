"""A result says what it was judged with; it is believed no further than posekit allows of itself."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


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
