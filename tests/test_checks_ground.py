"""Checks against the ground and published filters: what they measure is the number that was planted."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.skeleton import JOINT, JOINTS
from tests.test_checks_motion import RATE, gesture, judged, pendulum_walk
from tests.test_checks_motion_laws import rows_of

N = 150
FEET = [JOINT["right_ankle"], JOINT["left_ankle"]]
HIPS = [JOINT["right_hip"], JOINT["left_hip"]]


def standing(frames: int = N) -> np.ndarray:
    """Return joints (T, 14, 3) of a person who gestures, soles at 0."""
    return gesture(frames / RATE)


def hovering(seconds: float, height: float = 0.3) -> np.ndarray:
    """Return a standing person who rises within half a second, hovers, and comes down again."""
    time = np.arange(N) / RATE - 1.0
    ramp = np.clip(np.minimum(time, seconds - time) / 0.5, 0.0, 1.0)
    way = height * (1 - np.cos(np.pi * ramp)) / 2
    return standing() + way[:, None, None] * [0.0, 0.0, 1.0]


@pytest.mark.parametrize(("seconds", "found"), [(1.1, False), (1.6, True), (2.5, True)])
def test_a_body_that_does_not_fall_hovers_and_lacks_support(seconds: float, found: bool) -> None:
    report = judged(hovering(seconds))
    hovers, lacks = (rows_of(report, check) for check in ("floating", "support"))
    assert hovers.value.max() == pytest.approx(0.3, abs=0.01)
    assert 30 < hovers.frame.min() < 40 and abs(hovers.frame.max() - 30 * (1 + seconds)) < 10
    assert bool(len(lacks)) is found
    # The slow half of each ramp looks like rest.
    assert lacks.value.to_numpy() == pytest.approx(seconds - 0.5, abs=0.1)


def over_hands(height: float) -> np.ndarray:
    """Return a standing person who goes over straight arms for 0.7 s, wrists at a height over the ground."""
    joints, rows = standing(), slice(60, 81)
    turned = joints[rows] * [1.0, -1.0, -1.0]
    for side in ("right", "left"):
        for above, below in (("shoulder", "elbow"), ("elbow", "wrist")):
            top, end = JOINT[f"{side}_{above}"], JOINT[f"{side}_{below}"]
            turned[:, end] = turned[:, top] - [0.0, 0.0, 0.27]
    turned[..., 2] += height - turned[..., 2].min()
    joints[rows] = turned + (0.5 * np.arange(21) / RATE)[:, None, None] * [1.0, 0.0, 0.0]
    return joints


@pytest.mark.parametrize(("height", "found"), [(0.07, False), (0.5, True)])
def test_hands_that_reach_the_ground_carry_a_body(height: float, found: bool) -> None:
    rows = rows_of(judged(over_hands(height), checks=["floating"]), "floating")
    assert rows.frame.tolist() == (list(range(60, 81)) if found else [])


@pytest.mark.parametrize("drifts", [False, True])
def test_feet_of_a_body_on_its_knees_may_drag(drifts: bool) -> None:
    joints = standing()
    knees = [JOINT["right_knee"], JOINT["left_knee"]]
    joints[..., 2] += 0.05 - joints[:, knees, 2].mean()
    joints[:, FEET] = joints[:, knees] + [-0.4, 0.0, 0.0]
    way = -0.2 * np.clip(np.arange(N) / RATE - 1.0, 0.0, 2.0)
    joints[:, slice(None) if drifts else FEET, 0] += way[:, None]
    rows = rows_of(judged(joints, checks=["sliding"]), "sliding")
    assert bool(len(rows)) == drifts
    assert not drifts or rows.value.max() == pytest.approx(0.2, abs=0.02)


def leaning(way: float) -> np.ndarray:
    """Return a person who stands still with all joints but the ankles moved forward."""
    joints = np.repeat(standing(30)[:1], N, axis=0)
    upper = [k for k in range(14) if k not in FEET]
    joints[:, upper, 0] += way
    return joints


def test_who_leans_beyond_the_feet_would_fall() -> None:
    values = {}
    for way in (0.0, 0.3, 0.4, -0.4):
        report = judged(leaning(way), checks=["balance-still"])
        rows = rows_of(report, "balance-still")
        assert len(rows) == (0 if way == 0 else len(rows)) and set(rows.upper) <= {0.05}
        values[way] = float(rows.value.iloc[N // 2 - 10]) if len(rows) else 0.0
    assert values[0.0] == 0 < values[0.3] < values[0.4] < values[0.3] + 0.1


def test_who_moves_is_not_still() -> None:
    joints = leaning(0.4) + (0.3 * np.arange(N) / RATE)[:, None, None] * [1.0, 0.0, 0.0]
    assert rows_of(judged(joints, checks=["balance-still"]), "balance-still").empty
    sitting = leaning(0.4)
    sitting[:, [k for k in range(14) if k not in FEET], 2] -= 0.35
    assert rows_of(judged(sitting, checks=["balance-still"]), "balance-still").empty


# Published filters


def test_skating_is_the_way_of_a_foot_in_a_twentieth_of_a_second() -> None:
    joints = standing() + (0.6 * np.arange(N) / RATE)[:, None, None] * [0.6, 0.8, 0.0]
    rows = rows_of(judged(joints, profile="skating", ground=0.0), "skating")
    middle = rows[(rows.frame > 5) & (rows.frame < N - 5)]
    assert set(middle.place) == {"right_foot", "left_foot"}
    assert middle.value.to_numpy() == pytest.approx(0.6 / 20)
    assert len(middle) == 2 * (N - 11)
    high = joints + np.array([0.0, 0.0, 0.2])
    assert rows_of(judged(high, profile="skating", ground=0.0), "skating").empty


def test_contact_is_the_share_of_frames_with_a_foot_on_the_ground() -> None:
    joints = standing(120)
    raised = np.arange(120) % 20 < 9
    joints[raised] += [0.0, 0.0, 0.15]
    rows = rows_of(judged(joints, profile="phuma"), "contact-share")
    assert len(rows) == 120 and rows.value.to_numpy() == pytest.approx(11 / 20)
    joints[np.arange(120) % 20 < 4] -= [0.0, 0.0, 0.15]
    assert rows_of(judged(joints, profile="phuma"), "contact-share").empty


@pytest.mark.parametrize("way", [0.0, 0.2])
def test_support_distance_is_from_the_feet_to_below_the_hips(way: float) -> None:
    joints = np.repeat(standing(30)[:1], 120, axis=0)
    joints[:, HIPS, 0] += way
    rows = rows_of(judged(joints, profile="phuma"), "support-distance")
    first = joints[0, :, :2]
    one, other = first[FEET]
    along = (other - one) / np.linalg.norm(other - one)
    hips = first[HIPS].mean(axis=0) - one
    distance = np.linalg.norm(hips - np.clip(hips @ along, 0, np.linalg.norm(other - one)) * along)
    rows = rows[rows.place == "root"]
    assert bool(len(rows)) is bool(distance > 0.06) and (way == 0 or len(rows) == 120)
    assert rows.value.to_numpy() == pytest.approx(distance)


@pytest.mark.parametrize(("low", "found"), [(0.1, False), (-0.4, True), (0.8, True)])
def test_root_height_is_that_of_the_hips_over_the_ground(low: float, found: bool) -> None:
    joints = standing(120) + np.array([0.0, 0.0, low])
    rows = rows_of(judged(joints, profile="phuma", ground=0.0), "root-height")
    assert bool(len(rows)) is found
    expected = joints[rows.frame][:, HIPS, 2].mean(axis=1)
    assert rows.value.to_numpy() == pytest.approx(expected)


@pytest.mark.parametrize(
    ("height", "seconds", "found"), [(0.4, 1.2, False), (0.4, 2.0, True), (0.15, 2.0, False)]
)
def test_bodies_may_be_above_the_ground_for_a_second(height: float, seconds: float, found: bool) -> None:
    joints = hovering(seconds, height)
    rows = rows_of(judged(joints, profile="protomotions", ground=0.0), "above-ground")
    assert bool(len(rows)) is found
    assert rows.frame.tolist() == (list(range(rows.frame.min(), rows.frame.max() + 1)) if found else [])
    assert not found or (rows.value.max() == pytest.approx(height, abs=0.01) and rows.value.min() > 0.2)


@pytest.mark.parametrize(
    ("check", "profile", "bound"), [("root-speed", "holomotion", 10.0), ("body-speed", "protomotions", 15.0)]
)
def test_speeds_are_ways_over_time(check: str, profile: str, bound: float) -> None:
    for share in (0.9, 1.2):
        way = share * bound * np.arange(60) / RATE
        rows = rows_of(judged(standing(60) + way[:, None, None] * [1.0, 0, 0], profile=profile), check)
        assert bool(len(rows)) is (share > 1)
        assert np.median(rows.value) == pytest.approx(share * bound, rel=0.05) if len(rows) else share < 1


# The whole file


@pytest.mark.parametrize("level", [-1.3, 0.0, 2.0])
def test_a_file_at_another_height_has_the_same_doubts(level: float) -> None:
    joints = pendulum_walk() + np.array([0.0, 0.0, level])
    time = np.arange(len(joints)) / 60.0
    assert not judged(joints, time=time).warnings
    for factor in (0.5, 2.0):
        (warning,) = judged(joints, time=factor * time).warnings
        assert "about 60 Hz would fit" in warning


def bent(degrees: float) -> np.ndarray:
    """Return a person on straight legs whose trunk bends forward about the hips."""
    joints = standing()
    upper = [k for k, name in enumerate(JOINTS) if not name.endswith(("hip", "knee", "ankle"))]
    hips = joints[:, HIPS].mean(axis=1, keepdims=True)
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    joints[:, upper] = hips + (joints[:, upper] - hips) @ np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]])
    return joints


@pytest.mark.parametrize("up", ["+z", "-z", "+x", "-x", "+y", "-y"])
def test_a_person_who_bends_stands_on_the_plane_through_the_origin(up: str) -> None:
    report = judged(bent(70.0) + np.array([3.0, 2.0, 0.0]), checks=["orientation"], up=up)
    assert report.invalid.any() == (up != "+z")


def test_a_trunk_without_legs_has_any_height() -> None:
    joints = np.repeat(bent(45.0)[:1], N, axis=0)
    joints[:, [k for k, name in enumerate(JOINTS) if name.endswith(("knee", "ankle"))]] = np.nan
    joints[..., 0] += 0.05 - np.nanmin(joints[..., 0])
    assert not judged(joints, checks=["orientation"]).invalid.any()


def test_a_body_without_a_trunk_has_no_orientation() -> None:
    joints = standing()
    joints[:, JOINT["neck"]] = np.nan
    assert judged(joints).not_asked["orientation"] == "it needs neck and pelvis in one frame"


def test_upside_down_is_measured_from_up() -> None:
    joints = standing() * [1.0, -1.0, -1.0] + (np.arange(N) / RATE)[:, None, None] * [0.3, 0.0, 0.0]
    rows = rows_of(judged(joints, checks=["orientation"]), "orientation")
    trunk = joints[:, JOINT["neck"]] - joints[:, JOINT["pelvis"]]
    expected = np.degrees(np.arccos(trunk[:, 2] / np.linalg.norm(trunk, axis=1)))
    assert rows.value.to_numpy() == pytest.approx(expected)
    assert set(np.round(rows.upper, 6)) == {60.0}
