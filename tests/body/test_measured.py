"""What a recording tells of the person in it."""

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.body.measured import LEAST_FRAMES, LIMB_NAMES, SIZE_BOUNDS, figure_of, measured_person
from posekit.body.torso_bending import bending_gives
from posekit.skeleton import JOINT, JOINTS

FIGURE = load_figure()
OTHER_SIDE = {"right": "left", "left": "right"}
SWAPPED = [JOINT["_".join(OTHER_SIDE.get(part, part) for part in name.split("_"))] for name in JOINTS]


def moving(count: int, seed: int = 0) -> np.ndarray:
    """Return postures that have nothing to do with each other: faster than anybody moves."""
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(FIGURE.model), (count, 1))
    limits = FIGURE.limits
    q[:, FIGURE.angle_index] = rng.uniform(limits.lower, limits.upper, (count, len(limits.lower)))
    return FIGURE.forward_kinematics(q)[:, :14]


@pytest.mark.parametrize("noise", [0.001, 0.005, 0.02])
@pytest.mark.parametrize("seed", range(5))
def test_noise_is_estimated_within_a_fifth_however_people_move(noise: float, seed: int) -> None:
    joints = moving(200, seed)
    joints += np.random.default_rng(seed).normal(0.0, noise, joints.shape)
    assert measured_person(joints).noise == pytest.approx(noise, rel=0.2)


def test_motion_alone_is_no_noise() -> None:
    assert measured_person(moving(100)).noise < 1e-12


def test_too_few_frames_tell_no_noise() -> None:
    assert np.isnan(measured_person(moving(LEAST_FRAMES - 1)).noise)
    assert np.isfinite(measured_person(moving(LEAST_FRAMES)).noise)


def test_a_joint_that_is_measured_worse_has_more_noise_on_its_limb_alone() -> None:
    joints = moving(400)
    rng = np.random.default_rng(1)
    joints += rng.normal(0.0, 0.004, joints.shape)
    joints[:, JOINT["left_ankle"]] += rng.normal(0.0, 0.012, (400, 3))
    person = measured_person(joints)
    assert person.noise == pytest.approx(0.004, rel=0.2)
    assert person.noise_of("left_knee-left_ankle") > 0.007
    assert person.noise_of("right_knee-right_ankle") < 0.006
    assert person.noise_of("neck-pelvis") == person.noise


def test_a_span_of_broken_frames_changes_little() -> None:
    joints = moving(300)
    joints += np.random.default_rng(2).normal(0.0, 0.005, joints.shape)
    whole = measured_person(joints)
    joints[100:200, JOINT["right_wrist"]] = 0.0
    joints[50:150] = joints[50:150][:, SWAPPED]
    person = measured_person(joints)
    assert person.noise == pytest.approx(whole.noise, rel=0.5)
    for name in LIMB_NAMES:
        assert person.lengths[name] == pytest.approx(whole.lengths[name], abs=0.01)


@pytest.mark.parametrize("size", [0.5, 1.0, 1.2])
def test_a_figure_gets_the_lengths_of_a_person(size: float) -> None:
    person = measured_person(size * moving(20))
    figure = figure_of(FIGURE, person.lengths, person.behind)
    for name, length in FIGURE.lengths.items():
        assert figure.lengths[name] == pytest.approx(size * length, abs=1e-6)


@pytest.mark.parametrize("size", [0.5 * SIZE_BOUNDS[0], 2 * SIZE_BOUNDS[1], 1000.0])
def test_a_size_that_nobody_has_leaves_the_figure_its_own(size: float) -> None:
    person = measured_person(size * moving(20))
    assert figure_of(FIGURE, person.lengths, person.behind) is FIGURE


def test_a_limb_that_nobody_has_is_the_figures_at_the_persons_size() -> None:
    lengths = {name: 1.1 * length for name, length in FIGURE.lengths.items()}
    figure = figure_of(FIGURE, {**lengths, "right_elbow-right_wrist": 0.9}, FIGURE.shoulder_offset < 0)
    assert figure.lengths["right_elbow-right_wrist"] == pytest.approx(1.1 * 0.26)


@pytest.mark.parametrize("name", ["neck-pelvis", "right_shoulder-pelvis", "right_hip-left_hip"])
@pytest.mark.parametrize("factor", [0.0, 0.1, 4.0])
def test_a_torso_that_no_body_has_refuses_nothing(name: str, factor: float) -> None:
    lengths = {**FIGURE.lengths, name: factor * FIGURE.lengths[name]}
    assert figure_of(FIGURE, lengths, None).lengths["right_elbow-right_wrist"] == pytest.approx(0.26)


def test_bending_to_the_side_brings_a_shoulder_nearer() -> None:
    assert bending_gives({"neck-pelvis": 0.5, "right_shoulder-left_shoulder": 0.36}) == pytest.approx(
        0.067, abs=5e-4
    )
