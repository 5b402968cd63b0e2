"""A lasting step of the whole body is taken out as a whole, and the record says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.remedy.motion import _stepped_back
from posekit.skeleton import JOINTS
from posekit.validators import Validator
from posekit.validators.motion import MotionClip, judge_motion

FRAMES, RATE = 60, 30.0
STEP = np.array([0.25, 0.1, 0.0])


def walking() -> MotionClip:
    """Return a clip of a body that is carried along at an even speed, without a ground."""
    joints = np.repeat(load_figure().neutral_points[None, : len(JOINTS)], FRAMES, axis=0)
    time = np.arange(FRAMES) / RATE
    way = np.stack([0.5 * time, 0.05 * np.sin(3 * time), 0 * time], axis=-1)
    return MotionClip(joints=joints + way[:, None], time=time, rate=RATE)


def stepped(first: int, frames: int) -> MotionClip:
    """Return it with a step of the whole body over some frames, which lasts."""
    clean = walking()
    share = np.clip((np.arange(FRAMES) - first + 1) / frames, 0, 1)
    joints = clean.joints + share[:, None, None] * STEP
    return MotionClip(joints=joints, time=clean.time, rate=RATE)


@pytest.mark.parametrize(
    ("first", "frames"), [(30, 1), (30, 2), (1, 1), (2, 1), (FRAMES - 2, 1), (FRAMES - 1, 1)]
)
def test_a_lasting_step_is_taken_out(first: int, frames: int) -> None:
    """The clip passes, is what it was up to where it is, and the record says how far the body was shifted, and when."""
    given, clean = stepped(first, frames), walking()
    assert any(one.violated.any() for one in judge_motion(Validator().profile.checks, given).judgements)
    repaired = posekit.repair(given)
    assert repaired.valid.all(), repaired.told()
    off = repaired.joints - clean.joints
    assert np.abs(off - off[0]).max() < 0.01
    span = repaired.spans[0]
    assert (span.remedy, span.place) == ("shifted back", "body")
    assert span.most == pytest.approx(np.linalg.norm(STEP), abs=0.01)
    assert repaired.changed.sum() <= FRAMES // 2 + 1
    assert repaired.told().split("; ")[1].startswith("body shifted back by up to 2")


def test_a_step_there_and_back_is_interpolated() -> None:
    """What does not last is one bad frame: the frames after it stay."""
    clean = walking()
    joints = clean.joints.copy()
    joints[30] += STEP
    repaired = posekit.repair(MotionClip(joints=joints, time=clean.time, rate=RATE))
    assert repaired.valid.all()
    assert {span.remedy for span in repaired.spans} == {"interpolated"}
    np.testing.assert_array_equal(repaired.joints[31:], clean.joints[31:])


def test_an_array_of_known_rate_is_motion() -> None:
    """What is repaired of a clip is repaired of its joints, and without a rate postures are not in time."""
    given = stepped(30, 1)
    of_array = posekit.repair(given.joints, rate=RATE)
    np.testing.assert_array_equal(of_array.joints, posekit.repair(given).joints)
    assert of_array.time is not None and not posekit.repair(given.joints).changed.any()


@pytest.mark.parametrize(
    ("asked", "said"), [({"up": "+z"}, "rate"), ({"rate": 0.0}, "rate"), ({"rate": 30, "up": "sky"}, "up")]
)
def test_impossible_rates_and_axes_are_refused(asked: dict[str, Any], said: str) -> None:
    """The error names what is wrong."""
    with pytest.raises(InputError, match=said):
        posekit.repair(walking().joints, **asked)


def test_a_frame_without_any_joint_beside_a_step_stays_so() -> None:
    """What is shifted back around it is as without it."""
    given = stepped(30, 1)
    joints = given.joints.copy()
    joints[45] = np.nan
    repaired = posekit.repair(MotionClip(joints=joints, time=given.time, rate=RATE))
    assert np.isnan(repaired.joints[45]).all()
    off = np.delete(repaired.joints - walking().joints, 45, axis=0)
    assert np.abs(off - off[0]).max() < 0.01


def test_a_step_that_is_found_in_the_first_frame_alone_is_taken_out() -> None:
    given = stepped(1, 1).joints
    out = _stepped_back(given, np.arange(FRAMES) == 0)
    off = out - walking().joints
    assert np.abs(off - off[0]).max() < 0.01
