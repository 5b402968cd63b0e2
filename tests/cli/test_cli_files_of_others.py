"""`posekit validate` on files of others: what they do not say is said, and what is missing is named with its remedy."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.formats.motion.amass import SMPL_NAMES
from posekit.formats.motion.body_model import BODY_PARENTS
from posekit.skeleton import POINT, POINTS
from posekit.validators import Validator

FRAMES = 12


@pytest.fixture
def run(run: Callable[..., Any]) -> Callable[..., Any]:
    """Return a way to run the command in this process, in a folder of its own."""
    return partial(run, "validate")


def standing() -> np.ndarray:
    way = np.linspace(0, 0.4, FRAMES)[:, None, None] * [1.0, 0.0, 0.0]
    return load_figure().neutral_points[None] + [0.0, 0.0, 1.0] + way


def test_millimetres_are_said_and_judged(run: Callable[..., Any]) -> None:
    np.savez("mm.npz", points=1000 * standing(), names=np.array(POINTS), rate=30.0)
    done = run("mm.npz")
    assert "lengths are taken as mm" in done.out and f"{FRAMES} valid" in done.out, done.err
    np.savez("mm.npz", points=1000 * standing(), names=np.array(POINTS), rate=30.0, unit=np.array("m"))
    done = run("mm.npz")
    assert done.code == 2 and "--unit" in done.err and done.err.count("\n") == 1
    assert run("mm.npz", "--unit", "mm").code != 2


def test_a_table_of_a_robot_is_judged_over_time(run: Callable[..., Any]) -> None:
    validator = Validator("g1", checks=["joint-range"])
    q = np.zeros((FRAMES, len(validator.configuration_names)))
    q[:, 2], q[:, 6] = 0.79, 1.0
    at = validator.configuration_names.index("left_elbow_joint")
    q[6:, at] = 1.0
    np.savetxt("walk.csv", q, delimiter=",")
    arguments = ("walk.csv", "--urdf", "g1", "--checks", "joint-range,joint-velocity,drift", "-o", "r.json")
    done = run(*arguments, "--rate", 50)
    assert done.code == 1 and "joint-velocity/left_elbow_joint" in done.out, done.err
    checks = json.loads(Path("r.json").read_text(encoding="utf-8"))["checks"]
    assert checks["drift"]["rejected"] == 0
    assert "--rate" in run(*arguments).out
    done = run("walk.csv", "--urdf", "g1", "--checks", "timing", "--rate", 50)
    assert done.code == 0 and f"{FRAMES} valid" in done.out, done.err


def test_angles_of_a_body_model_are_judged_with_the_model(run: Callable[..., Any]) -> None:
    rest = np.array([load_figure().neutral_points[POINT.get(name, POINT["pelvis"])] for name in SMPL_NAMES])
    np.savez("model.npz", J=rest, parents=np.array(BODY_PARENTS))
    poses, trans = np.zeros((FRAMES, 66)), np.tile([0.0, 0.0, 1.0], (FRAMES, 1))
    trans[:, 0] = np.linspace(0, 0.4, FRAMES)
    np.savez("clip.npz", poses=poses, trans=trans, betas=np.zeros(10), mocap_framerate=60.0)
    done = run("clip.npz")
    assert done.code == 2 and "--body-model" in done.err and done.err.count("\n") == 1
    done = run("clip.npz", "--body-model", "model.npz")
    assert done.code != 2 and f"{FRAMES} valid" in done.out, done.err


@pytest.mark.parametrize("name", ["clip.pkl", "clip.pt"])
def test_pickles_are_not_opened(run: Callable[..., Any], name: str) -> None:
    Path(name).write_bytes(b"\x80\x04cos\nsystem\n.")
    done = run(name)
    assert done.code == 2 and "numpy.savez" in done.err and done.err.count("\n") == 1
