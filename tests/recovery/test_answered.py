"""Answers of recoveries and of the results that are written of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.recovery.answered import result_answers
from posekit.recovery.result import result_of
from posekit.recovery.summary import summary_lines
from posekit.synthesis import random_views
from posekit.views.builtin import builtin_view, view_of

VIEW = builtin_view("seq1")


@pytest.fixture(scope="module", params=[0.0, 2.0], ids=["exact", "2 px"])
def recovery(request):
    scene = random_views(posekit.load_figure(), 5, np.random.default_rng(3))
    if request.param:
        scene = scene.with_noise(request.param, np.random.default_rng(4))
    view = view_of(scene)
    return posekit.recover(
        replace(view, deviation=request.param or None), ranges="urdf", length_deviation=0.0
    )


def test_answers_are_of_what_is_listed(recovery):
    assert len(recovery.answers) == len(recovery.frames)
    for frame, probability, answer in zip(
        recovery.frames, recovery.probability, recovery.answers, strict=True
    ):
        np.testing.assert_array_equal(answer.bodies.joints, frame.joints)
        np.testing.assert_array_equal(answer.bodies.probability, probability)
        assert (answer.probability.sum() >= 0.95) == (len(frame) > 0)


def test_a_written_result_has_the_same_answers(recovery, tmp_path):
    posekit.write_result(tmp_path / "r.npz", result_of(recovery))
    read = result_answers(posekit.read_result(tmp_path / "r.npz"))
    for own, other in zip(recovery.answers, read, strict=True):
        np.testing.assert_array_equal(own.rows, other.rows)
        np.testing.assert_allclose(own.depth.near, other.depth.near, atol=1e-3)
        np.testing.assert_allclose(own.regions.level, other.regions.level, atol=0.05)


def test_a_result_without_probabilities_is_refused(recovery):
    result = result_of(recovery)
    bare = replace(result, frames=[replace(frame, probability=None) for frame in result.frames])
    with pytest.raises(InputError, match="without probabilities"):
        result_answers(bare)


def test_three_lines_a_person_come_before_the_table(recovery):
    lines = summary_lines(recovery)
    assert [line.split(":")[0] for line in lines[1:3]] == ["likeliest", "what else it can be"]
    assert lines[0].startswith(f"{sum(len(frame) for frame in recovery.frames)} postures in 5 frames")
    assert lines[3].split()[0] == "frame"
    assert [int(line.split()[0]) for line in lines[4:9]] == list(range(5))


def test_hidden_joints_have_no_regions():
    image = VIEW.image.copy()
    image[:, 12:] = np.nan
    answers = posekit.recover(replace(VIEW, image=image)).answers
    found = [answer for answer in answers if len(answer)]
    assert found
    for answer in found:
        assert np.isnan(answer.regions.level[12:]).all()
        assert np.isfinite(answer.regions.level[:12]).all()


def test_what_is_shown_of_an_answer_is_what_a_run_says(
    command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = Path(__file__).parents[2] / "docs/explanation/answers.md"
    shown = page.read_text(encoding="utf-8").partition("```\n$ ")[2].partition("```")[0]
    synth, recover, *said = shown.splitlines()
    assert command(*synth.removeprefix("posekit ").split()).code == 0
    assert command(*recover.removeprefix("$ posekit ").split()).out.splitlines()[: len(said)] == said
