"""On which side of the line from neck to pelvis the shoulders lie: positions tell it, lengths do not."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import Figure, LengthUncertainty, load_figure
from posekit.body.lengths import torso_points
from posekit.body.side import SIDE_DEVIATIONS, offset_deviation, side_is_certain
from posekit.body.uncertainty import MEASURED_LENGTHS
from posekit.robots import shoulders_are_behind
from posekit.skeleton import SEGMENT_NAMES

FIGURE = load_figure()
BEHIND = FIGURE.scaled({"right_shoulder-left_shoulder": 0.408}, behind=True)


def postures(figure: Figure, n: int, seed: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(figure.model), (n, 1))
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = figure.limits
    q[:, figure.angle_index] = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    return figure.forward_kinematics(q)


def test_a_urdf_says_the_side_and_lengths_do_not() -> None:
    assert FIGURE.shoulder_side == "front"
    assert FIGURE.scaled({"right_hip-right_knee": 0.4}).shoulder_side == "front"  # the same torso
    assert FIGURE.scaled({"neck-pelvis": 0.45}).shoulder_side == "undecided"
    assert FIGURE.from_stature(1.7).shoulder_side == "undecided"
    for behind, side in ((True, "behind"), (False, "front")):
        assert FIGURE.scaled({"neck-pelvis": 0.45}, behind=behind).shoulder_side == side


def test_shoulders_behind_have_the_same_lengths_and_the_other_sign() -> None:
    front = FIGURE.scaled({"right_shoulder-left_shoulder": 0.408}, behind=False)
    assert BEHIND.shoulder_offset == -front.shoulder_offset < 0
    assert dict(BEHIND.lengths) == pytest.approx(dict(front.lengths), abs=1e-15)
    np.testing.assert_array_equal(
        torso_points(BEHIND.lengths, behind=True) * [-1, 1, 1], torso_points(BEHIND.lengths)
    )


def test_configurations_of_shoulders_behind_give_the_joints_back() -> None:
    points = postures(BEHIND, 100)
    assert BEHIND.configurations(points).distance.max() < 1e-9
    # In front of the line the same lengths cannot: the shoulders are twice their offset away.
    front = FIGURE.scaled({"right_shoulder-left_shoulder": 0.408}, behind=False)
    distance = front.configurations(points).distance
    assert (distance >= 2 * front.shoulder_offset - 1e-9).all()


def test_the_side_that_points_show_is_the_figures() -> None:
    for figure in (FIGURE, BEHIND):
        assert shoulders_are_behind(postures(figure, 20)) == (figure.shoulder_side == "behind")


def test_the_side_is_kept_by_files_limits_and_processes(tmp_path: Path) -> None:
    path = tmp_path / "behind.urdf"
    BEHIND.write(path)
    assert load_figure(path).shoulder_side == "behind"
    unknown = FIGURE.scaled({"neck-pelvis": 0.45})
    for figure in (BEHIND, unknown):
        assert pickle.loads(pickle.dumps(figure)).shoulder_side == figure.shoulder_side
        assert figure.with_limits({"right_elbow.flexion": (0.0, 2.0)}).shoulder_side == figure.shoulder_side
    assert BEHIND.scaled({"right_hip-right_knee": 0.4}).shoulder_offset == pytest.approx(
        BEHIND.shoulder_offset
    )


@pytest.mark.parametrize("deviation", [1e-4, 1e-3, 3e-3])
def test_the_deviation_of_the_offset_is_what_lengths_leave(
    deviation: float, rng: np.random.Generator
) -> None:
    own = LengthUncertainty(own=dict.fromkeys(SEGMENT_NAMES, deviation))
    drawn = []
    for factors in np.exp(deviation * rng.normal(size=(1500, 17))).tolist():
        lengths = {name: FIGURE.lengths[name] * f for name, f in zip(SEGMENT_NAMES, factors, strict=True)}
        drawn.append(torso_points(lengths)[1, 0])
    assert offset_deviation(FIGURE.lengths, own) == pytest.approx(np.std(drawn), rel=0.1)


def test_exact_lengths_leave_nothing_and_the_common_size_no_doubt() -> None:
    assert offset_deviation(FIGURE.lengths, LengthUncertainty()) == 0
    assert offset_deviation(FIGURE.lengths, LengthUncertainty(common=0.3)) == 0
    assert FIGURE.with_side_within(LengthUncertainty(common=0.3)).shoulder_side == "front"


def test_the_side_is_certain_from_three_deviations_on() -> None:
    one = offset_deviation(FIGURE.lengths, LengthUncertainty(own=dict.fromkeys(SEGMENT_NAMES, 0.01)))
    at_limit = 0.01 * FIGURE.shoulder_offset / (SIDE_DEVIATIONS * one)
    for factor, certain in ((0.99, True), (1.01, False)):
        known = LengthUncertainty(own=dict.fromkeys(SEGMENT_NAMES, factor * at_limit))
        assert side_is_certain(FIGURE.lengths, known) == certain
        assert FIGURE.with_side_within(known).shoulder_side == ("front" if certain else "undecided")
    assert FIGURE.with_side_within(MEASURED_LENGTHS).shoulder_side == "undecided"


def test_a_flat_torso_has_no_side() -> None:
    flat = FIGURE.scaled({"right_shoulder-left_shoulder": 0.42}, behind=True)
    assert abs(flat.shoulder_offset) < 1e-6
    assert not side_is_certain(flat.lengths, MEASURED_LENGTHS)
    points = postures(flat, 50)
    assert np.isfinite(points).all()
    assert flat.configurations(points).distance.max() < 1e-6
