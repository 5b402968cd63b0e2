"""Laws of the checks over time: findings move with the motion, and values are the numbers that were planted."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.motion import Motion
from posekit.skeleton import JOINT, JOINTS, other_side
from posekit.validators import Report
from posekit.validators.motion.profile import MOTION_CHECKS
from tests.test_checks_motion import (
    RATE,
    first_pose,
    gesture,
    held,
    judged,
    jumped,
    lengthened,
    lifted,
    shaken,
    slid,
    span,
    swapped,
)

PLANTS = (held, jumped, first_pose, lengthened, lifted, shaken, slid, swapped)
EXCHANGED = [JOINTS.index(other_side(name)) for name in JOINTS]
PROFILES = Path(posekit.__file__).with_name("urdf") / "profiles"
PROFILE = tomllib.loads(PROFILES.joinpath("posekit.toml").read_text())
BOUNDS = PROFILE["checks"]


@pytest.mark.parametrize(
    ("profile", "checks"),
    [
        ("posekit", PROFILE["checks"]),
        ("phuma", ("contact-share", "root-height", "support-distance")),
        ("protomotions", ("above-ground", "body-speed")),
        ("holomotion", ("root-speed",)),
        ("skating", ("skating",)),
    ],
)
def test_a_check_by_its_name_has_the_thresholds_of_its_profile(profile: str, checks: Sequence[str]) -> None:
    stated = tomllib.loads(PROFILES.joinpath(f"{profile}.toml").read_text())["checks"]
    for name in checks:
        defaults = MOTION_CHECKS[name].defaults
        assert {key: defaults[key] for key in stated[name]} == stated[name], name


def sides_exchanged(place: str) -> str:
    """Return the name of a place with right and left exchanged."""
    words = {"right": "left", "left": "right"}
    parts = ["_".join(words.get(word, word) for word in part.split("_")) for part in place.split("-")]
    return "-".join(sorted(parts))


def findings(report: Report, name: Callable[[str], str] = str) -> dict[tuple[int, str, str], list[float]]:
    """Return value and margin of each finding, by frame, check and place."""
    table = report.table()
    keys = zip(table["frame"].tolist(), table["check"], map(name, table["place"]), strict=True)
    return dict(zip(keys, np.stack([table["value"], table["margin"]], axis=1).tolist(), strict=True))


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("change", ["turned", "y up", "later", "mirrored"])
def test_findings_move_with_the_motion(plant: Callable[[np.ndarray], np.ndarray], change: str) -> None:
    joints = plant(gesture())
    time, up = np.arange(len(joints)) / RATE, "+z"
    name: Callable[[str], str] = str
    report = judged(joints, time=time)
    if change == "turned":
        c, s = np.cos(0.7), np.sin(0.7)
        joints = joints @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]) + [0.3, -0.2, 0.0]
    elif change == "y up":
        joints, up = joints[..., [1, 2, 0]], "+y"
    elif change == "later":
        time = time + 100.0
    else:
        joints, name = joints[:, EXCHANGED] * [1.0, -1.0, 1.0], sides_exchanged
    expected, found = (
        findings(report, lambda place: name(name(place))),
        findings(judged(joints, time=time, up=up), name),
    )
    assert expected and set(found) == set(expected)
    for key, numbers in expected.items():
        assert found[key] == pytest.approx(numbers, rel=1e-5, abs=1e-6), key


def rows_of(report: Report, check: str) -> Any:
    """Return the findings of a check as a data frame."""
    table = report.to_pandas()
    return table[table.check == check]


STRETCH = (np.arange(120) >= 40) & (np.arange(120) <= 60)


def raised(joints: np.ndarray, size: float) -> np.ndarray:
    return joints + (size * STRETCH)[:, None, None] * [0.0, 0.0, 1.0]


def sunk(joints: np.ndarray, size: float) -> np.ndarray:
    return raised(joints, -size)


def stretched(joints: np.ndarray, size: float) -> np.ndarray:
    moved = joints.copy()
    way = joints[:, JOINT["left_wrist"]] - joints[:, JOINT["left_elbow"]]
    moved[:, JOINT["left_wrist"]] += (size * STRETCH)[:, None] * way
    return moved


def shrunk(joints: np.ndarray, size: float) -> np.ndarray:
    return stretched(joints, -size)


def drifting(joints: np.ndarray, size: float) -> np.ndarray:
    way = size / RATE * np.cumsum((np.arange(120) >= 40) & (np.arange(120) < 85))
    return joints + way[:, None, None] * [0.6, 0.8, 0.0]


def moved_wrist(joints: np.ndarray, size: float) -> np.ndarray:
    moved = joints.copy()
    moved[50, JOINT["right_wrist"]] += [0.0, size, 0.0]
    return moved


def moved_body(joints: np.ndarray, size: float) -> np.ndarray:
    moved = joints.copy()
    moved[50] += [0.0, size, 0.0]
    return moved


@pytest.mark.parametrize(
    ("plant", "check", "place", "bound", "frames"),
    [
        (raised, "floating", "lowest", BOUNDS["floating"]["height"], (40, 60)),
        (sunk, "penetration", "lowest", -BOUNDS["penetration"]["depth"], (40, 60)),
        (stretched, "drift", "left_elbow-left_wrist", BOUNDS["drift"]["share"], (40, 60)),
        (shrunk, "drift", "left_elbow-left_wrist", -BOUNDS["drift"]["share"], (40, 60)),
        (drifting, "sliding", "left_foot", BOUNDS["sliding"]["fastest"], (40, 84)),
        (moved_wrist, "teleport", "right_wrist", BOUNDS["teleport"]["joint"], (50, 50)),
        (moved_body, "teleport", "body", BOUNDS["teleport"]["body"], (50, 50)),
    ],
)
@pytest.mark.parametrize("share", [0.8, 1.3, 2.0, 3.0])
def test_a_defect_beyond_its_bound_is_found_with_its_size(
    plant: Callable[[np.ndarray, float], np.ndarray],
    check: str,
    place: str,
    bound: float,
    frames: tuple[int, int],
    share: float,
) -> None:
    found = rows_of(judged(plant(gesture(), share * abs(bound))), check)
    if share < 1:
        assert found.empty
        return
    mine = found[found.place == place]
    worst = mine.loc[mine.margin.idxmin()]
    assert worst.value == pytest.approx(share * bound, abs=5e-4)
    assert worst.margin == pytest.approx(-(share - 1) * abs(bound), abs=5e-4)
    assert (worst.upper if bound > 0 else worst.lower) == pytest.approx(bound)
    assert (mine.frame.min(), mine.frame.max()) == frames


@pytest.mark.parametrize(
    ("copies", "check"), [(1, "repeated"), (4, "repeated"), (5, "frozen"), (12, "frozen")]
)
def test_copies_of_a_frame_are_counted(copies: int, check: str) -> None:
    joints = gesture()
    joints[40 : 40 + copies] = joints[39]
    report = judged(joints)
    found = rows_of(report, check)
    assert set(report.table()["check"]) == {check}
    assert found.frame.tolist() == span(40, 39 + copies) and set(found.value) == {copies}


@pytest.mark.parametrize("missing", [1, 3, 5])
def test_missing_frames_are_counted(missing: int) -> None:
    kept = np.delete(np.arange(120), slice(50, 50 + missing))
    (found,) = rows_of(judged(gesture()[kept], time=kept / RATE), "timing").itertuples()
    assert (found.frame, found.place, found.value) == (50, "missing", pytest.approx(missing))


def test_frames_out_of_order_are_named_with_their_distance() -> None:
    order = np.arange(120)
    order[[50, 54]] = order[[54, 50]]
    found = rows_of(judged(gesture()[order], time=order / RATE), "timing")
    found = found[found.place == "order"]
    assert dict(zip(found.frame, abs(found.value), strict=True)) == {50: 4, 54: 4}


@pytest.mark.parametrize("deviation", [0.01, 0.02])
def test_trembling_is_the_standard_deviation_of_a_coordinate(deviation: float) -> None:
    joints = gesture(20.0)
    joints += np.random.default_rng(0).normal(0, deviation, joints.shape)
    report = judged(joints, checks=["jitter"], noise=0.0)
    assert len(rows_of(report, "jitter")) > 0.9 * joints[..., 0].size
    assert np.median(rows_of(report, "jitter").value) == pytest.approx(deviation, rel=0.15)


@pytest.mark.parametrize(("first", "last"), [(0, 149), (12, 137), (40, 80)])
def test_noise_of_all_frames_is_measuring_and_noise_of_some_is_jitter(first: int, last: int) -> None:
    joints = gesture(5.0)
    joints[first : last + 1] += np.random.default_rng(1).normal(0, 0.015, (last + 1 - first, 14, 3))
    rows = rows_of(judged(joints, checks=["jitter"]), "jitter")
    assert bool(len(rows)) == (first > 0)
    assert not first or (abs(rows.frame.min() - first) <= 3 and abs(rows.frame.max() - last) <= 3)


@pytest.mark.parametrize("plant", [raised, sunk, stretched, drifting, moved_wrist])
def test_stated_noise_widens_bounds_and_never_rejects_more(
    plant: Callable[[np.ndarray, float], np.ndarray],
) -> None:
    joints = plant(gesture(), 0.09)
    counts = [len(judged(joints, noise=noise).table()["frame"]) for noise in (0.0, 0.003, 0.01, 0.03)]
    assert counts == sorted(counts, reverse=True) and counts[0] > counts[-1]


@pytest.mark.parametrize(("check", "least"), [("teleport", 15.0), ("jitter", 25.0), ("sliding", 15.0)])
def test_checks_say_which_rate_they_need(check: str, least: float) -> None:
    joints = gesture()
    for rate, asked in ((0.9 * least, False), (1.1 * least, True)):
        report = judged(joints, time=np.arange(len(joints)) / rate)
        assert (check in report.checks) is asked
        assert asked or f"{least:g} frames per second" in report.not_asked[check]


@pytest.mark.parametrize(("share", "found"), [(0.9, False), (1.5, True)])
def test_speeds_of_robots_are_shares_of_the_limits_of_their_urdf(share: float, found: bool) -> None:
    robot = posekit.load_robot("g1")
    name = "left_shoulder_pitch_joint"
    joint, at = robot.model.getJointId(name), robot.configuration_names.index(name)
    step = share * robot.model.velocityLimit[robot.model.idx_vs[joint]] / 200.0
    q = np.tile(robot.neutral, (11, 1))
    q[:, at] = step * (np.arange(11) - 5)
    walk = Motion(q=q, robot="g1", q_names=robot.configuration_names, time=np.arange(11) / 200.0, up="+z")
    rows = rows_of(posekit.validate(walk, posekit.ValidateSettings(bodies="capsules")), "joint-velocity")
    assert rows.frame.tolist() == (span(1, 10) if found else [])
    assert set(rows.place) <= {name} and rows.value.to_numpy() == pytest.approx(share)


SLIDER = """<robot name="slider"><link name="base"/><link name="arm"/><link name="hand"/><link name="tool"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="wheel" type="continuous"><parent link="arm"/><child link="hand"/><origin xyz="0 0 0.3"/>
<axis xyz="0 1 0"/></joint>
<joint name="slide" type="prismatic"><parent link="hand"/><child link="tool"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>"""


@pytest.mark.parametrize(("share", "found"), [(0.98, False), (1.02, True)])
@pytest.mark.parametrize(("profile", "most"), [("holomotion", 20.0), ("protomotions", 40.0)])
def test_a_profile_bounds_the_speed_of_every_joint_that_turns(
    profile: str, most: float, share: float, found: bool, tmp_path: Path
) -> None:
    """The bound replaces the limits of the URDF; joints that slide have none."""
    (tmp_path / "slider.urdf").write_text(SLIDER, encoding="utf-8")
    robot = posekit.load_robot(tmp_path / "slider.urdf", fixed_base=True)
    angle = share * most / 100.0 * (np.arange(11) - 5)
    columns = {"turn": [angle], "wheel": [np.cos(angle), np.sin(angle)], "slide": [angle]}
    names = [name for name, values in columns.items() for _ in values]
    q = np.concatenate([columns[name] for name in columns]).T
    assert [name.partition(".")[0] for name in robot.configuration_names] == names
    motion = Motion(q=q, robot=str(tmp_path / "slider.urdf"), time=np.arange(11) / 100.0, up="+z")
    settings = posekit.ValidateSettings(profile=profile, checks="joint-velocity")
    rows = rows_of(posekit.Validator(robot, settings).check(motion), "joint-velocity")
    assert sorted(rows.place) == sorted(["turn", "wheel"] * 10 * found)
    assert rows.value.to_numpy() == pytest.approx(share)


# Numbers that are known


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0, 240.0])
@pytest.mark.parametrize(("check", "order"), [("speed", 1), ("acceleration", 2), ("jerk", 3)])
def test_derivatives_are_those_of_a_polynomial(check: str, order: int, rate: float) -> None:
    """All joints go along x with a constant derivative of the order, between the trunk's bound and the limbs'."""
    time = np.arange(round(rate)) / rate
    constant = (BOUNDS[check]["trunk"] + BOUNDS[check]["limbs"]) / 2
    way = constant * time**order / np.prod(np.arange(1, order + 1))
    joints = gesture(0.1)[:1] + way[:, None, None] * [1.0, 0.0, 0.0]
    found = rows_of(judged(joints, time=time, checks=[check]), check)
    assert set(found.place) == {name for k, name in enumerate(JOINTS) if k < 6}
    assert found.value.to_numpy() == pytest.approx(constant, rel=1e-6)
    assert found.upper.to_numpy() == pytest.approx(BOUNDS[check]["trunk"])
    assert found.margin.to_numpy() == pytest.approx(BOUNDS[check]["trunk"] - constant)
    reach = order * max(round(rate / 60), 1)
    assert found.frame.min() == (reach + 1) // 2
    assert check == "jerk" or found.frame.max() == len(time) - 1 - reach // 2
    slower = gesture(0.1)[:1] + 0.9 * BOUNDS[check]["trunk"] / constant * way[:, None, None] * [1.0, 0.0, 0.0]
    assert not judged(slower, time=time, checks=[check]).invalid.any()


@pytest.mark.parametrize("deviation", [0.002, 0.004, 0.008])
def test_noise_is_that_of_the_coordinates_whatever_two_limbs_do(deviation: float) -> None:
    rng = np.random.default_rng(0)
    joints = gesture(8.0)
    joints += rng.normal(0, deviation, joints.shape)
    for shaken_limbs in (False, True):
        if shaken_limbs:
            joints[:, [JOINT["right_wrist"], JOINT["left_wrist"]]] += rng.normal(0, 0.04, (len(joints), 2, 3))
        assert judged(joints).settings["noise"] == pytest.approx(deviation, rel=0.15)


@pytest.mark.parametrize(("step", "found"), [(0.0006, False), (0.0014, True)])
def test_frames_come_again_only_while_the_body_moves(step: float, found: bool) -> None:
    """A millimetre a frame is motion; below it rounding makes neighbours equal."""
    joints = np.repeat(gesture(0.1)[:1], 120, axis=0)
    joints += (step * np.arange(120))[:, None, None] * [1.0, 0.0, 0.0]
    joints[50:53] = joints[49]
    assert bool(len(rows_of(judged(joints), "repeated"))) is found


@pytest.mark.parametrize(("stated", "asked"), [("0", False), ("1e9", False), ("2.0", True)])
def test_a_velocity_of_zero_or_a_huge_one_is_no_limit(stated: str, asked: bool, tmp_path: Path) -> None:
    path, name = tmp_path / "person.urdf", "right_elbow_flexion"
    words = Path(posekit.__file__).with_name("urdf").joinpath("stick_figure.urdf").read_text(encoding="utf-8")
    path.write_text(re.sub(r'velocity="[^"]*"', f'velocity="{stated}"', words), encoding="utf-8")
    robot = posekit.load_robot(str(path))
    q = np.tile(robot.neutral, (20, 1))
    q[:, robot.configuration_names.index(name)] = np.linspace(0, 0.5, 20)
    motion = Motion(q=q, robot=str(path), time=np.arange(20) / 100, up="+z")
    report = posekit.Validator(robot, checks=["joint-velocity"]).check(motion)
    assert ("joint-velocity" in report.not_asked) is not asked
    if asked:
        found = rows_of(report, "joint-velocity")
        assert set(found.place) == {name}
        assert found.value.to_numpy() == pytest.approx(0.5 / 19 * 100 / float(stated))


@pytest.mark.parametrize(
    ("frames", "way", "found"),
    [(1, 0.1, True), (1, 0.3, True), (3, 0.1, False), (3, 0.2, True), (5, 0.15, False), (5, 0.3, True)],
)
def test_a_body_that_is_displaced_goes_farther_than_forces_can_push_it(
    frames: int, way: float, found: bool
) -> None:
    """Twice gravity over half of a time T, and against it over the other half, explains a way of 20 T² / 4."""
    share = np.clip((np.arange(120) - 59) / frames, 0, 1)
    joints = gesture() + (way * share)[:, None, None] * [0.0, 1.0, 0.0]
    rows = rows_of(judged(joints), "teleport")
    rows = rows[rows.place == "body"]
    assert rows.frame.tolist() == (span(60, 59 + frames) if found else [])
    assert rows.value.to_numpy() == pytest.approx(way - 20.0 * (frames / RATE) ** 2 / 4)
