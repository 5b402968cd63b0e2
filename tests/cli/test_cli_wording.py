"""What commands say: words that mean one thing, counts as people write them, numbers with their place."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.display.plural import plural
from posekit.recovery.key_point_offsets import PIXEL_DEVIATION
from posekit.recovery.noise import KEY_POINT_DEVIATION
from posekit.recovery.rooting import DEFAULT_DEVIATION_PIXELS
from posekit.samples import write_samples
from posekit.settings.rooting import DETECTED_DEVIATION


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the samples."""
    folder = tmp_path_factory.mktemp("samples")
    write_samples(folder)
    return folder


@pytest.mark.parametrize(
    ("count", "thing", "said"),
    [
        (0, "frame", "0 frames"),
        (1, "frame", "1 frame"),
        (2, "collision body", "2 collision bodies"),
        (12345, "key", "12,345 keys"),
    ],
)
def test_things_are_counted_as_people_write_it(count: int, thing: str, said: str) -> None:
    assert plural(count, thing) == said


def test_the_worst_of_a_check_and_of_a_clip_is_the_value_that_was_found(
    run: Callable[..., Any], samples: Path
) -> None:
    """The table and the line of the clip say the same number, beside the same bound."""
    said = run("validate", samples / "jump.bvh").out
    of_clip = re.search(r"teleport/body, frame 70 .*, worst (\S+ m) in 70 (\(bound [^)]*\))", said)
    of_check = re.search(r"\| frame 70: body (\S+ m) (\(bound [^)]*\))", said)
    assert of_clip and of_check and of_clip.groups() == of_check.groups()


@pytest.mark.parametrize("known", [True, False])
def test_the_exit_code_of_a_repair_is_that_of_what_was_written(
    run: Callable[..., Any], samples: Path, tmp_path: Path, known: bool
) -> None:
    """A fresh validation of the written file agrees; frames whose joints are unknown stay undecided."""
    walk = dict(np.load(samples / "walk.npz"))
    walk["joints"][40, 10:12] += [0.0, 0.4, 0.0]
    walk["joints"][60:64, 3] = walk["joints"][60:64, 3] if known else np.nan
    np.savez(tmp_path / "given.npz", **walk)
    assert run("validate", tmp_path / "given.npz").code == 1
    done = run("validate", tmp_path / "given.npz", "--repair", tmp_path / "out.npz")
    assert done.code == run("validate", tmp_path / "out.npz").code == int(not known), done.out
    allowing = ("--repair", tmp_path / "again.npz", "--fail-over", "4")
    assert run("validate", tmp_path / "given.npz", *allowing).code == 0


def test_a_path_alone_says_that_others_were_not_asked_for(
    run: Callable[..., Any], samples: Path, tmp_path: Path
) -> None:
    """So does the command that followed it; a joint of the figure that is off is named, with its frame."""
    followed = run("recover", samples / "walk.json", "-o", tmp_path / "walk.json", "--follow", "1").out
    said = run("convert", tmp_path / "walk.json", tmp_path / "walk.bvh", "--posture", "path").out
    assert "how sure is not asked (--follow 2)" in followed
    assert "the likeliest path, how sure is not asked (--follow 2)" in said


@pytest.mark.parametrize("end", ["json", "npz"])
def test_a_path_that_is_left_of_several_is_not_said_to_be_alone(
    run: Callable[..., Any], samples: Path, tmp_path: Path, end: str
) -> None:
    sure = "no other that is 5 cm elsewhere holds 5 %"
    out = tmp_path / f"walk.{end}"
    assert sure in run("recover", samples / "walk.json", "-o", out, "--follow", "3").out
    assert f"1 path: {sure}" in run("inspect", out).out
    assert sure in run("convert", out, tmp_path / "walk.bvh").out


def test_the_joint_that_is_furthest_off_is_named(
    run: Callable[..., Any], samples: Path, tmp_path: Path
) -> None:
    points = dict(np.load(samples / "walk.npz"))
    points["joints"][7, 4] += [0.05, 0.0, 0.0]
    np.savez(tmp_path / "off.npz", **points)
    said = run("convert", tmp_path / "off.npz", tmp_path / "off.bvh").out
    assert re.search(r"within [\d.]+ cm of the postures' \(furthest: \w+, frame 7\)", said), said


def test_an_object_without_a_sure_posture_is_told_another_scale(
    run: Callable[..., Any], samples: Path, tmp_path: Path
) -> None:
    """The sample's arm is undecided at the least scale, and certified at that where its parts close."""
    arm = ("recover", samples / "gripper.json", "-o", tmp_path / "arm.json", "--linkage", "panda")
    assert "are undecided" in (said := run(*arm).out) and "try --scale closure" in said
    assert "undecided" not in run(*arm, "--scale", "closure").out


def test_help_says_the_deviations_that_count(run: Callable[..., Any]) -> None:
    said = " ".join(run("recover", "--help").out.split())
    assert f"else {KEY_POINT_DEVIATION:g} of a detector's before a calibrated camera" in said
    of_necks = f"necks are searched with {DETECTED_DEVIATION:g} and {DEFAULT_DEVIATION_PIXELS:g}."
    assert f"and {PIXEL_DEVIATION:g}; {of_necks}" in said
