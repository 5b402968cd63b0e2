"""Checks over time: clean motion passes, planted defects are named in the right frames."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

import posekit
from posekit.errors import InputError
from posekit.geometry import beyond_hull
from posekit.motion import Motion
from posekit.settings import ValidateSettings
from posekit.skeleton import JOINT, JOINTS, other_side
from posekit.validators import Body, Report, validate_motion
from posekit.validators.motion.ground import ground_of

RATE = 30.0
FIGURE = posekit.load_figure()


def gesture(seconds: float = 4.0) -> np.ndarray:
    """Return joints (T, 14, 3) of a person who stands, sways and moves both arms, metres, z up, soles at 0."""
    time = np.arange(round(seconds * RATE)) / RATE
    q = np.tile(FIGURE.neutral, (len(time), 1))
    for part, middle, swing, hertz in (
        ("right_shoulder_flexion", 0.8, 0.6, 0.7),
        ("right_elbow_flexion", 0.9, 0.5, 0.9),
        ("left_shoulder_flexion", 0.4, 0.4, 0.5),
        ("left_elbow_flexion", 0.6, 0.3, 0.8),
    ):
        q[:, FIGURE.configuration_names.index(part)] = middle + swing * np.sin(2 * np.pi * hertz * time)
    joints = FIGURE.points(q)
    joints[..., 2] += 0.066 - joints[:, 12:, 2].min()
    return joints


def judged(
    joints: np.ndarray, *, time: np.ndarray | None = None, up: str = "+z", **settings: object
) -> Report:
    time = np.arange(len(joints)) / RATE if time is None else time
    return validate_motion(Motion(joints=joints, time=time, up=up), ValidateSettings(**settings))


def frames_of(report: Report, check: str) -> list[int]:
    rows = report.findings["row"][report.findings["check"] == report.checks.index(check)]
    return sorted(set(report.frame[rows].tolist()))


def span(first: int, last: int) -> list[int]:
    return list(range(first, last + 1))


def test_clean_motion_passes_all_checks_and_states_its_ground() -> None:
    report = judged(gesture())
    assert report.ok.all() and report.decision == "keep 1 of 1 clip"
    assert any(note.startswith("Ground estimated at 0.0") for note in report.notes)
    assert (report.worst > 0).all()


def test_checks_that_found_nothing_are_not_the_worst_of_good_frames() -> None:
    report = judged(gesture())
    for name in ("repeated", "frozen", "swap", "timing"):
        assert (report.margins[:, report.checks.index(name)] >= 0.7).all(), name


def swapped(joints: np.ndarray) -> np.ndarray:
    order = [JOINTS.index(other_side(name)) for name in JOINTS]
    moved = joints.copy()
    moved[40:61] = joints[40:61][:, order]
    return moved


def held(joints: np.ndarray) -> np.ndarray:
    moved = joints.copy()
    moved[40:61] = joints[39]
    return moved


def shaken(joints: np.ndarray) -> np.ndarray:
    moved = joints.copy()
    moved[40:61] += np.random.default_rng(0).normal(0, 0.02, moved[40:61].shape)
    return moved


def jumped(joints: np.ndarray) -> np.ndarray:
    moved = joints.copy()
    moved[50, JOINT["right_wrist"]] += [0.0, 0.2, 0.0]
    return moved


def first_pose(joints: np.ndarray) -> np.ndarray:
    moved = joints.copy()
    moved[0] = (FIGURE.neutral_points[:14] - FIGURE.neutral_points[3]) * [-1.0, -1.0, 1.0] + joints[0, 3]
    moved[0, :, 0] += 0.5
    return moved


def lengthened(joints: np.ndarray) -> np.ndarray:
    moved = joints.copy()
    way = 0.06 * (joints[:, JOINT["left_knee"]] - joints[:, JOINT["left_hip"]])
    weight = np.convolve((np.abs(np.arange(len(joints)) - 60) <= 35).astype(float), np.full(5, 0.2), "same")
    for name in ("left_knee", "left_ankle"):
        moved[:, JOINT[name]] += weight[:, None] * way
    return moved


def slid(joints: np.ndarray) -> np.ndarray:
    way = 0.1 / RATE * np.cumsum((np.arange(len(joints)) >= 40) & (np.arange(len(joints)) < 85))
    return joints + way[:, None, None] * np.array([0.6, 0.8, 0.0])


def lifted(joints: np.ndarray) -> np.ndarray:
    return joints + 0.05 * ((np.arange(len(joints)) >= 40) & (np.arange(len(joints)) <= 60))[
        :, None, None
    ] * [0, 0, 1]


@pytest.mark.parametrize(
    ("plant", "check", "expected"),
    [
        (swapped, "swap", span(40, 60)),
        (held, "frozen", span(40, 60)),
        (shaken, "jitter", span(40, 60)),
        (jumped, "teleport", [50]),
        (first_pose, "teleport", [0]),
        (lengthened, "drift", span(25, 95)),
        (slid, "sliding", span(40, 84)),
        (lifted, "floating", span(40, 60)),
        (lambda joints: 2 * joints[:1] - lifted(2 * joints[:1] - joints), "penetration", span(40, 60)),
    ],
)
def test_planted_defects_are_named_in_their_frames(
    plant: Callable[[np.ndarray], np.ndarray], check: str, expected: list[int]
) -> None:
    report = judged(plant(gesture()))
    found = frames_of(report, check)
    assert found, report.summary()
    assert abs(found[0] - expected[0]) <= 3 and abs(found[-1] - expected[-1]) <= 3, (found[0], found[-1])
    assert report.clips[0].decision != "keep"
    if plant is not shaken:  # joints that tremble by 2 cm break ranges, too
        assert report.clips[0].reason == check
    if plant is first_pose:
        assert not frames_of(report, "swap")
        assert any(note.startswith("Frame 0 is another posture") for note in report.notes)


def test_gaps_and_repeated_times_are_named_by_timing() -> None:
    time = np.arange(120) / RATE
    gap = np.delete(time, slice(50, 55))
    assert frames_of(judged(np.delete(gesture(), slice(50, 55), axis=0), time=gap), "timing") == [50]
    time[60] = time[59]
    assert 60 in frames_of(judged(gesture(), time=time), "timing")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stated_ground_counts_in_every_frame(sign: float) -> None:
    joints = gesture()
    ramp = np.interp(np.arange(len(joints)), (40, 100), (0.0, 0.15))
    low = ground_of(Body(joints=joints, time=np.arange(len(joints)) / RATE, up=np.array([0, 0, 1.0]))).low
    report = judged(joints + sign * ramp[:, None, None] * [0, 0, 1], ground=low)
    found = frames_of(report, "floating" if sign > 0 else "penetration")
    assert found[-1] == len(joints) - 1 and 48 <= found[0] <= 95
    assert not judged(joints, ground=low).invalid.any()


@pytest.mark.parametrize("up", ["-z", "+y", "-x"])
def test_a_wrong_axis_is_named_as_orientation(up: str) -> None:
    report = judged(gesture() + np.linspace(0, 1, 120)[:, None, None] * [1.0, 1.0, 0.0], up=up)
    assert frames_of(report, "orientation") == span(0, 119)
    assert report.clips[0].reason == "orientation"


def test_a_fall_slower_than_gravity_doubts_the_rate() -> None:
    time = np.arange(150) / RATE
    joints = np.tile(gesture(0.1)[:1], (150, 1, 1))
    for start in (0.5, 1.5, 2.5, 3.5):  # four hops with flights of 0.5 s
        t = np.clip(time - start, 0.0, 0.5)
        joints[..., 2] += (0.5 * 9.81 * t * (0.5 - t))[:, None]
    assert not judged(joints, time=time).warnings
    (warning,) = judged(joints, time=2 * time).warnings
    assert "about 30 Hz would fit" in warning
    (warning,) = judged(joints, time=time / 2).warnings
    assert "about 30 Hz would fit" in warning


def pendulum_walk(steps: int = 8, length: float = 0.6, width: float = 0.2, rate: float = 60.0) -> np.ndarray:
    """Return joints (T, 14, 3) of a body whose centre of mass goes as an inverted pendulum over each standing foot."""
    neutral = FIGURE.neutral_points[:14] - FIGURE.neutral_points[12:14].mean(axis=0)
    omega, seconds = np.sqrt(9.81 / (neutral[4, 2] + 0.1)), 0.5
    time = np.arange(round(steps * seconds * rate)) / rate
    step, t = np.divmod(time, seconds)
    t, side = t - seconds / 2, np.where(step % 2, 1.0, -1.0)
    forward = step * length + length / 2 * np.sinh(omega * t) / np.sinh(omega * seconds / 2)
    across = side * width / 2 * (1 - np.cosh(omega * t) / np.cosh(omega * seconds / 2))
    joints = neutral + np.stack([forward, across, np.zeros(len(t))], axis=1)[:, None]
    joints[..., 2] += 0.066
    swing = np.stack(
        [step * length + 2 * length * t / seconds, -side * width / 2, 0.116 - 0.8 * t**2], axis=1
    )
    stance = np.stack([step * length, side * width / 2, np.full(len(t), 0.066)], axis=1)
    right = side < 0
    joints[:, 12] = np.where(right[:, None], stance, swing)
    joints[:, 13] = np.where(right[:, None], swing, stance)
    joints[:, 10:12] = (joints[:, 4:6] + joints[:, 12:14]) / 2 + [0.05, 0.0, 0.0]
    return joints


def test_a_walk_out_of_balance_doubts_the_rate() -> None:
    joints = pendulum_walk()
    time = np.arange(len(joints)) / 60.0
    assert not judged(joints, time=time).warnings
    for factor in (0.5, 2.0):
        (warning,) = judged(joints, time=factor * time).warnings
        assert "about 60 Hz would fit" in warning


def test_gestures_that_are_far_too_fast_or_slow_doubt_the_rate() -> None:
    joints, time = gesture(6.0), np.arange(180) / RATE
    noisy = joints + np.random.default_rng(0).normal(0, 0.005, joints.shape)
    assert not judged(joints, time=time).warnings and not judged(noisy, time=time).warnings
    for factor, rate in ((0.25, 60), (4.0, 15)):
        (warning,) = judged(joints, time=factor * time).warnings
        assert "joints change their speed" in warning and f"about {rate} Hz would fit" in warning


def test_a_walk_that_stays_in_place_is_said_to_be_on_a_treadmill() -> None:
    joints = pendulum_walk()
    time = np.arange(len(joints)) / 60.0
    belt = joints - 1.2 * time[:, None, None] * [1.0, 0.0, 0.0]
    assert not any("treadmill" in note for note in judged(joints, time=time).notes)
    report = judged(belt, time=time, noise=0.0)
    assert frames_of(report, "sliding")
    assert any("backward at 1.2 m/s" in note and "treadmill" in note for note in report.notes)


def test_published_profiles_follow_their_rules() -> None:
    joints = gesture()
    sunk = joints.copy()
    sunk[50] -= [0.0, 0.0, 0.06]
    by = judged(sunk, profile="protomotions", ground=0.0)
    assert frames_of(by, "above-ground") == [50]
    fast = joints.copy()
    fast[60:] += [0.6, 0.0, 0.0]  # 18 m/s
    assert frames_of(judged(fast, profile="protomotions"), "body-speed") == [60]
    assert frames_of(judged(fast, profile="holomotion"), "root-speed") == [60]
    low = judged(joints - [0.0, 0.0, 0.4], profile="phuma", ground=0.0)
    root = joints[:, 4:6, 2].mean(axis=1) - 0.4
    assert frames_of(low, "root-height") == np.flatnonzero(root < 0.6).tolist()
    jerky = np.cumsum(np.cumsum(np.random.default_rng(0).normal(0, 30, (120, 3)), axis=0), axis=0) / RATE**2
    low = signal.sosfiltfilt(signal.butter(4, 3.0, fs=RATE, output="sos"), jerky, axis=0, padlen=60)
    mean = np.linalg.norm(np.diff(low, n=3, axis=0), axis=1).mean() * RATE**3
    assert bool(frames_of(judged(joints + jerky[:, None], profile="phuma"), "root-jerk")) is bool(mean > 50)
    assert mean > 50


@pytest.mark.parametrize(
    "text", ['[checks.jitter]\ndeviation = "a"', "[checks.jitter]\nx = 1", "[checks.jiter]"]
)
def test_broken_profiles_are_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(f'schema = "posekit.profile/1"\n{text}\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"own\.toml: checks"):
        judged(gesture(1.0), profile=str(path))


def test_distance_beyond_a_hull_is_that_of_its_corners_and_edges() -> None:
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]])
    for point, expected in (
        ((0.5, 0.5), -0.5),
        ((2.0, 0.5), 1.0),
        ((2.0, 2.0), np.sqrt(2)),
        ((0.9, 0.5), -0.1),
    ):
        found = beyond_hull(np.array([[*point, 3.0]]), square, np.array([0, 0, 1.0]))[0]
        assert found == pytest.approx(expected)
