"""Laws of the remedy for configurations of robots."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.remedy import Repaired, repair_configurations
from posekit.remedy.configurations import NearestConfiguration
from posekit.samples.robot_squat import write_robot_squat
from posekit.validators import Validator

PANDA = Validator("panda")
MOST_TURN = 3.0


def draw(count: int = 12, beyond: float = 0.2) -> Array:
    """Return configurations of a Panda, some joints beyond their limits by up to so many radians."""
    subject, rng = PANDA.configured[0], np.random.default_rng(0)
    q = np.tile(pin.neutral(subject.model), (count, 1))
    low = np.maximum(subject.lower, -MOST_TURN)[subject.index] - beyond
    high = np.minimum(subject.upper, MOST_TURN)[subject.index] + beyond
    q[:, subject.index] = rng.uniform(low, high, (count, len(low)))
    return q


@cache
def repaired_draw() -> Repaired:
    """Return what they are repaired to."""
    return repair_configurations(draw(), PANDA)


def test_configurations_come_back_valid_by_a_fresh_validator() -> None:
    """Limits and contacts pass one that has not seen them."""
    given, repaired = draw(), repaired_draw()
    assert PANDA.check(q=given).invalid.sum() > 8
    assert repaired.q is not None
    assert Validator("panda").check(q=repaired.q).valid.all()
    assert repaired.valid.all() and repaired.left == ()


def test_meshes_that_cross_come_apart(tmp_path: Path) -> None:
    """An arm deep in the chest of the sample's robot is brought out, in each of its frames."""
    write_robot_squat(tmp_path / "squat.npz")
    judge = Validator("g1")
    assert judge.robot is not None
    with np.load(tmp_path / "squat.npz") as held:
        parts = [held[name][49:53] for name in ("root_pos", "root_quat_xyzw", "dof_pos")]
    given = np.concatenate(parts, axis=1)
    assert judge.check(q=given).invalid.all()
    repaired = repair_configurations(given, judge)
    assert repaired.q is not None and repaired.left == ()
    assert Validator("g1").check(q=repaired.q).valid.all()


def test_legal_configurations_come_back_as_they_were() -> None:
    """A repaired one is legal, and is not touched again."""
    once = repaired_draw().q
    assert once is not None
    again = repair_configurations(once, PANDA)
    assert again.q is not None and again.spans == ()
    np.testing.assert_array_equal(again.q, once)


def test_limits_alone_are_clamped() -> None:
    """Without contact nothing is nearer than each joint at its own limit."""
    judge = Validator("panda", checks=["joint-range"])
    subject = judge.configured[0]
    repaired = repair_configurations(draw(), judge)
    assert repaired.q is not None
    clamped, at = draw(), subject.index
    clamped[:, at] = np.clip(clamped[:, at], subject.lower[at], subject.upper[at])
    np.testing.assert_allclose(repaired.q, clamped, rtol=0, atol=1e-6)


def test_spans_name_joints_with_their_units() -> None:
    """Fingers slide, the others turn."""
    units = {span.place: span.unit for span in repaired_draw().spans}
    assert units["panda_joint1"] == "rad" and units["panda_finger_joint1"] == "m"


def test_slopes_of_distances_are_differences() -> None:
    """A pair's distance changes by its slope times the step."""
    judge = Validator("human")
    subject, collision = judge.configured
    nearest = NearestConfiguration(subject=subject, collision=collision)
    rng = np.random.default_rng(3)
    q = np.asarray(pin.neutral(subject.model))
    q[subject.index] += rng.uniform(-0.5, 0.5, len(subject.index))
    value, slope = nearest._contacts(q)
    step = 1e-6 * rng.normal(size=nearest.space.nv)
    after, _ = nearest._contacts(nearest.space.integrate(q[None], step[None])[0])
    assert len(value)
    np.testing.assert_allclose(after - value, slope @ step, rtol=0, atol=1e-9)


def test_what_is_no_configuration_is_refused() -> None:
    """A width that is not the model's is named."""
    with pytest.raises(InputError, match="expected"):
        repair_configurations(np.zeros((1, 3)), PANDA)


def test_configurations_of_the_figure_heed_what_no_limit_says() -> None:
    """Anatomical ranges bound an arm by its elevation and turn, beside its three angles."""
    judge = Validator()
    subject = judge.configured[0]
    q = np.tile(pin.neutral(subject.model), (6, 1))
    low, high = subject.lower[subject.index], subject.upper[subject.index]
    q[:, subject.index] = np.random.default_rng(5).uniform(low, high, (6, len(low)))
    assert judge.check(q=q).invalid.sum() > 3
    repaired = repair_configurations(q, judge)
    assert repaired.q is not None
    assert Validator().check(q=repaired.q).valid.all()
    legal = judge.check(q=q).valid
    np.testing.assert_array_equal(repaired.q[legal], q[legal])
