"""Checks over time: each says a value a frame, or why it is not asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.validators.motion import MOTION_CHECKS, MotionClip, judge_motion, load_profile

UP = np.array([0.0, 0.0, 1.0])


def standing(count: int, *, rate: float = 30.0, ground: float | None = 0.0) -> MotionClip:
    joints = np.repeat(load_figure().neutral_points[None, :14], count, axis=0)
    joints = joints - (joints[:, :, 2:].min() - 0.066) * UP  # an ankle is so high over the sole
    return MotionClip(joints=joints, time=np.arange(count) / rate, rate=rate, up=UP, ground=ground)


def test_every_check_of_a_profile_is_asked_or_says_why_not() -> None:
    checks = load_profile("posekit").checks
    verdict = judge_motion(checks, standing(8))
    asked = {judgement.check.replace("_", "-") for judgement in verdict.judgements}
    assert asked | set(verdict.not_asked) == {check.name for check in checks}
    assert all(len(judgement.value) == 8 for judgement in verdict.judgements)


def test_a_check_alone_has_the_thresholds_of_the_usual_profile() -> None:
    """A threshold stands in the profile and in the check: asked by name under another profile it is the same."""
    checks = load_profile("posekit").checks
    assert [vars(check) for check in checks] == [vars(type(check)()) for check in checks]


def test_standing_still_breaks_no_check() -> None:
    verdict = judge_motion(load_profile("posekit").checks, standing(8))
    assert not any(judgement.violated.any() for judgement in verdict.judgements)


def test_nothing_known_is_no_violation() -> None:
    nothing = MotionClip(
        joints=np.full((4, 14, 3), np.nan), time=np.full(4, np.nan), rate=np.nan, up=None, ground=None
    )
    verdict = judge_motion([kind() for kind in MOTION_CHECKS.values()], nothing)
    assert not any(judgement.violated.any() for judgement in verdict.judgements)


def test_an_unknown_check_or_threshold_is_named(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('schema = "posekit.profile/1"\n[checks.speeed]\nfastest = 1\n')
    with pytest.raises(InputError, match=r"speeed.*did you mean"):
        load_profile(str(path))
    path.write_text('schema = "posekit.profile/1"\n[checks.speed]\nfast = 1\n')
    with pytest.raises(InputError, match="fast"):
        load_profile(str(path))
    with pytest.raises(InputError, match="--profile nobody"):
        load_profile("nobody")
