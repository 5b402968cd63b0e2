"""Every number that decides a verdict, from both sides: a value just inside it passes, one just outside does not."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.motion import Motion
from posekit.settings import ValidateSettings
from posekit.skeleton import FEET_POINTS, JOINT, JOINTS, LIMB_SEGMENTS, POINTS, SEGMENTS, both, segment_name
from posekit.validators import Report, validate_motion
from posekit.validators.motion.profile import MOTION_CHECKS
from tests.test_checks import walk
from tests.test_checks_motion import FIGURE, RATE, gesture, held, lengthened, slid, swapped
from tests.test_ranges_laws import ends_of

FORWARD, LEFT, UP = np.eye(3)
ANKLES, WRISTS = both("ankle"), both("wrist")
TIME, COUNT = np.arange(120) / RATE, np.arange(120)
STRETCH = (COUNT >= 40) & (COUNT <= 60)


def person(frames: int = 120) -> np.ndarray:
    """Return joints (T, 14, 3) of a person who stands still, metres, z up."""
    return np.repeat(gesture(0.1)[:1], frames, axis=0)


LEG = float(
    sum(
        np.linalg.norm(person(1)[0, JOINT[f"right_{a}"]] - person(1)[0, JOINT[f"right_{b}"]])
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    )
)
STATURE = LEG / 0.491
SOLE = 0.066 - 0.039 * STATURE
"""Height of the soles of `person`, by Winter's shares of the stature: legs 0.491, ankles 0.039."""


def judged(
    joints: np.ndarray, *checks: object, rate: float = RATE, feet: bool = False, **settings: object
) -> Report:
    """Judge a motion; with `feet`, toes and heels are 4 cm below the ankles, 15 cm before and 5 cm behind."""
    points, names = joints, list(JOINTS)
    if feet:
        ends = [joints[:, ANKLES] + way * FORWARD - 0.04 * UP for way in (0.15, -0.05)]
        points, names = np.concatenate([joints, *ends], axis=1), [*JOINTS, *FEET_POINTS]
    motion = Motion(joints=points, joint_names=names, time=np.arange(len(points)) / rate, up="+z")
    return validate_motion(motion, ValidateSettings(**{"noise": 0.0, "checks": checks, **settings}))


def found(joints: np.ndarray, *checks: object, **options: object) -> bool:
    return bool(judged(joints, *checks, **options).invalid.any())


def along(way: np.ndarray, axis: np.ndarray = FORWARD) -> np.ndarray:
    """Return displacements (T, 1, 3) of a body by ways along an axis, metres."""
    return way[:, None, None] * axis


def squatting(height: float) -> np.ndarray:
    """Return a person whose hips are above the ankles by a share of the legs; knees go forward, legs keep lengths."""
    joints = person()
    joints[:, : ANKLES[0], 2] += 0.066 + height * LEG - joints[0, JOINT["right_hip"], 2]
    for hip, knee, ankle in zip(both("hip"), both("knee"), ANKLES, strict=True):
        joints[:, hip, :2] = joints[:, ankle, :2]
        joints[:, knee] = (joints[:, hip] + joints[:, ankle]) / 2 + LEG / 2 * np.sqrt(1 - height**2) * FORWARD
    return joints


def turned(degrees: float) -> np.ndarray:
    """Return a person who is turned forward about the axis to the left."""
    turn = Rotation.from_rotvec(np.radians(degrees) * LEFT)
    return turn.apply(person().reshape(-1, 3)).reshape(120, 14, 3)


# Rest and the ground


def rests(joints: np.ndarray, **options: object) -> bool:
    """Return whether the note about the ground counts frames in which the body rests."""
    (note,) = judged(joints, "penetration", **options).notes
    return re.search(r"from \d+ frames", note) is not None


def restless_at(speed: float) -> bool:
    return not rests(person() + along(speed * TIME))


def restless_at_with_noise(speed: float) -> bool:
    """Twice the noise of a speed over two frames, sqrt(2) times that of a position, is allowed."""
    return not rests(person() + along((speed + 2 * np.sqrt(2) * 0.01 * RATE / 2) * TIME), noise=0.01)


def restless_but_for_a_wrist(height: float) -> bool:
    joints = person() + along(TIME)
    joints[:, WRISTS[0]] = [0.0, 1.0, SOLE + height]
    return not rests(joints)


def rests_for(frames: float) -> bool:
    steps = np.where((COUNT >= 50) & (COUNT < 51 + frames), 0.0, 1.0)
    return rests(person() + along(np.cumsum(steps) / RATE))


def rests_to_and_fro_at(rate: float) -> bool:
    """The body goes to and fro between frames, which central differences do not see."""
    return rests(person() + along(0.05 * (COUNT % 2)), rate=rate)


def hovering(height: float, feet: bool = False, wrist: float | None = None) -> bool:
    """The body goes forward in the air for 2 s at 1 m/s, without falling."""
    rise = np.clip(np.minimum(TIME - 1.0, 3.0 - TIME) / 0.2, 0.0, 1.0)
    joints = person() + along(np.cumsum(rise > 0) / RATE) + along(height * (1 - np.cos(np.pi * rise)) / 2, UP)
    if wrist is not None:
        joints[rise > 0, WRISTS[1], 2] = wrist
    return found(joints, "support", feet=feet)


def hovering_by_toes(height: float) -> bool:
    return hovering(height, feet=True)


def hovering_over_a_hand(wrist: float) -> bool:
    return hovering(0.5, wrist=SOLE + wrist)


def lifted(height: float) -> bool:
    return found(
        person() + along(height * STRETCH, UP), MOTION_CHECKS["floating"].with_thresholds(height=0.0)
    )


def lifted_in_motion(height: float, rate: float = RATE) -> bool:
    """All joints but knees and ankles stay, so that no foot rests before and after the step."""
    joints = person() + along(height * STRETCH, UP)
    joints[:, both("knee") + ANKLES] += along(0.03 * (COUNT % 2), UP)
    return found(joints, "floating", rate=rate)


def lifted_in_slow_motion(height: float) -> bool:
    """The time from frame to frame is longer by 16 / 15; falls grow with its square."""
    return lifted_in_motion(height * (16 / 15) ** 2, rate=15.0)


def lifted_and_lowered_by(share: float) -> bool:
    return found(person() + along(0.1 * (COUNT >= 40) - 0.1 * share * (COUNT > 60), UP), "floating")


def lifted_for(frames: float) -> bool:
    return found(person() + along(0.1 * ((COUNT >= 40) & (COUNT < 40 + frames)), UP), "floating")


def lifted_from_feet_that_rise(rise: float) -> bool:
    joints = person() + along(0.1 * STRETCH, UP)
    joints[:, ANKLES] += along(rise * (COUNT % 2), UP)
    return not found(joints, "floating")


def sunk(level: float, steps: float = 10, share: float = 0.0, rate: float = RATE) -> bool:
    """The body goes to a lower level in some steps, with a share of gravity, and stays there."""
    time = np.clip(COUNT - 80, 0, steps) / rate
    start = share * 9.81 * time[-1] / 2 - level / time[-1]
    ways = along(2.0 * time) + along(start * time - share * 9.81 / 2 * time**2, UP)
    return found(person() + ways, "penetration", rate=rate)


def not_sunk_after_a_jump_of(frames: float) -> bool:
    """A body that jumps down stands on its feet again."""
    return not sunk(0.1, frames - 1, share=1.0)


def not_sunk_after_a_fall_with(share: float) -> bool:
    return not sunk(0.1, share=share)


def sunk_after_even_motion_of(frames: float) -> bool:
    return sunk(0.1, frames - 1, rate=20.0)


def above_the_stated_ground(height: float, feet: bool = False) -> bool:
    return found(person(), "floating", ground=(0.006 if feet else SOLE) - height, feet=feet)


def toes_above_the_stated_ground(height: float) -> bool:
    return above_the_stated_ground(height, feet=True)


def below_the_stated_ground(depth: float) -> bool:
    return found(person(), "penetration", ground=SOLE + depth)


# Sliding


def slides(
    speed: float = 0.1, seconds: float = 1.0, height: float = 0.0, rise: float = 0.0, **options: float
) -> bool:
    """The left foot slides while the body stands."""
    rate = options.get("rate", RATE)
    inside = (COUNT > 40) & (COUNT <= 40 + round(seconds * rate))
    joints = person()
    joints[:, ANKLES[1]] += (speed * np.cumsum(inside) / rate)[:, None] * FORWARD
    joints[:, ANKLES[1]] += (rise * np.cumsum(inside) / rate + height)[:, None] * UP
    return found(joints, "sliding", rate=rate)


def drags_at(height: float) -> bool:
    joints = squatting(height)
    joints[:, ANKLES[1]] -= (0.1 * np.clip(TIME - 2.5, 0.0, 1.0))[:, None] * FORWARD
    return found(joints, "sliding")


def slides_faster_by(metres: float, frames: float = 40, feet: bool = False) -> bool:
    """The speed grows from 0 by so much a frame, metres a second."""
    joints = person()
    speed = metres * np.clip(COUNT - 40, 0, frames) * (COUNT < 40 + frames)
    joints[:, ANKLES[1]] += (np.cumsum(speed) / RATE)[:, None] * FORWARD
    return found(joints, "sliding", feet=feet)


def slides_ever_faster_for(frames: float) -> bool:
    """Speeds in twelve frames differ by a share of their mean that is smaller, the longer the foot was faster."""
    return slides_faster_by(0.02, frames, feet=True)


# Balance


def would_fall_with_a_foot_at(height: float) -> bool:
    return found(wide(height), "balance-still")


def would_fall_with_hips_at(height: float) -> bool:
    joints = squatting(height)
    joints[:, [JOINT["neck"], *both("shoulder"), *both("elbow"), *WRISTS]] += 1.2 * FORWARD
    return found(joints, "balance-still")


# Orientation


def inverted_by(degrees: float, ankles: float = 0.05, wrists: float | None = None) -> bool:
    """Ankles are to the sides, so that the body does not stand along another axis, and far from the origin."""
    joints = turned(degrees)
    joints[:, ANKLES] = joints[:, [JOINT["pelvis"]]] + np.array([-0.8, 0.8])[:, None] * LEFT + ankles * UP
    if wrists is not None:
        joints[:, WRISTS, 2] = joints[:, :1, 2] + wrists
    return found(joints + 5.0 * UP, "orientation")


def inverted_with_ankles_at(height: float) -> bool:
    return inverted_by(180.0, ankles=height)


def inverted_with_wrists_at(height: float) -> bool:
    return inverted_by(180.0, wrists=height)


def lies(
    way: float = 0.0, rise: float = 0.0, trunk: float = 90.0, legs: float = 0.0, frames: int = 120
) -> bool:
    """A body that lies along an axis, far from the origin, goes to the side or rises."""
    joints = turned(trunk) + along(way * TIME / TIME[-1], LEFT) + along(rise * TIME / TIME[-1], UP)
    down = np.array([-np.cos(np.radians(legs)), 0.0, np.sin(np.radians(legs))])
    joints[:, both("knee") + ANKLES] = joints[:, both("hip") * 2] + LEG * down
    return found((joints + 3.0)[:frames], "orientation")


def lies_and_goes(way: float) -> bool:
    return lies(way=way)


def lies_and_rises(rise: float) -> bool:
    return lies(rise=rise / 0.9)  # from the 5th to the 95th percentile


def lies_with_a_trunk_at(degrees: float) -> bool:
    return lies(way=1.0, trunk=degrees)


def lies_with_legs_at(degrees: float) -> bool:
    return not lies(way=1.0, legs=degrees)


# Frames


def differs_from_a_copy_by(metres: float) -> bool:
    joints = gesture()
    joints[50] = joints[49] + metres * FORWARD
    return not found(joints, "repeated")


def stands_around_a_copy_for(frames: float) -> bool:
    joints = person() + along(np.cumsum(np.where(np.abs(COUNT - 50) <= frames, 0.0005, 0.01)))
    joints[49:52] = joints[49]
    return not found(joints, "repeated")


def early_by(share: float) -> bool:
    motion = Motion(joints=gesture(), time=TIME - share / RATE * (COUNT >= 50), up="+z")
    return bool(validate_motion(motion, ValidateSettings(checks=["timing"])).invalid.any())


def shuffled_at(rate: float) -> bool:
    order = COUNT.copy()
    order[50:70] = 50 + np.random.default_rng(0).permutation(20)
    return found(gesture()[order], "timing", rate=rate)


def unusual_until(frames: float) -> bool:
    """A forearm is longer than the other one after these frames: the rarer length may be the usual one."""
    joints = gesture()
    joints[COUNT >= frames, WRISTS[1]] += (
        0.1 * (joints[:, WRISTS[1]] - joints[:, JOINT["left_elbow"]])[COUNT >= frames]
    )
    return bool((judged(joints, "drift").table()["frame"] > frames).any())


# Remarks


def has_a_belt(speed: float = 1.0, travel: float = 0.0, frames: int = 120) -> bool:
    """Both feet go backward in some frames, under hips that travel forward."""
    joints = person() + along(travel * COUNT / 119)
    joints[:, ANKLES] -= along(speed * np.minimum(COUNT, frames) / RATE + travel * COUNT / 119)
    return any("treadmill" in note for note in judged(joints, "sliding").notes)


def begins_with_another_posture(joints: float) -> bool:
    moved = gesture()
    moved[0, [*WRISTS, *both("knee")][: int(joints)]] += 0.4 * LEFT
    return any("Frame 0 is another posture" in note for note in judged(moved, "teleport").notes)


# Joint ranges


def elbow_is_judged_at(bend: float, **settings: object) -> bool:
    """The rotation of the upper arm is far outside its range; straight arms do not show it."""
    q = FIGURE.neutral.copy()
    for name, degrees in (
        ("elbow_flexion", bend),
        ("shoulder_rotation", 160.0),
        ("shoulder_abduction", 30.0),
    ):
        q[FIGURE.configuration_names.index(f"right_{name}")] = np.radians(degrees)
    settings = {"checks": ["joint-range"], "noise": 0.0, **settings}
    return bool(
        validate_motion(Motion(joints=FIGURE.points(q[None])), ValidateSettings(**settings)).invalid.any()
    )


def elbow_of_the_figure_is_judged_at(bend: float) -> bool:
    return elbow_is_judged_at(bend, angle_tolerance=10.0, strict=True, ranges="urdf")


# The person in the frames


def is_nobodys_size(size: float) -> bool:
    return found(size * gesture(), "rigid-parts")


def has_nobodys_forearm(length: float) -> bool:
    joints = gesture()
    joints[:, WRISTS[1]] = joints[:, JOINT["left_elbow"]] + length * (
        joints[:, WRISTS[1]] - joints[:, JOINT["left_elbow"]]
    )
    return found(joints, "rigid-parts")


def is_noisy_in(frames: float) -> bool:
    joints = gesture()[: int(frames)]
    joints += np.random.default_rng(0).normal(0, 0.01, joints.shape)
    return float(judged(joints, "drift", noise=None).settings["noise"]) > 0.005


AIR = 0.03 + np.hypot(0.75 * 0.152, 0.039) * STATURE - 0.039 * STATURE
"""Height of a body in the air without toes: 3 cm, and the rise of an ankle over the tips of the toes."""


@pytest.mark.parametrize(
    ("finds", "inside", "outside"),
    [
        (restless_at, 0.249, 0.251),
        (restless_at_with_noise, 0.249, 0.251),
        (restless_but_for_a_wrist, 0.299, 0.301),
        (rests_for, 2, 3),
        (rests_to_and_fro_at, 19.9, 20.1),
        (hovering, AIR - 0.005, AIR + 0.005),
        (hovering_by_toes, 0.029, 0.031),
        (hovering_over_a_hand, AIR + 0.108 * STATURE - 0.005, AIR + 0.108 * STATURE + 0.005),
        (lifted, 0.0119, 0.0121),
        (lifted_in_motion, 0.149, 0.151),
        (lifted_in_slow_motion, 0.149, 0.151),
        (lifted_and_lowered_by, 0.649, 0.651),
        (lifted_for, 2, 3),
        (lifted_from_feet_that_rise, 0.0099, 0.0101),
        (sunk, 0.049, 0.051),
        (not_sunk_after_a_jump_of, 7, 8),  # a quarter of a second at 30 Hz
        (not_sunk_after_a_fall_with, 0.49, 0.51),
        (sunk_after_even_motion_of, 5, 6),
        (above_the_stated_ground, 0.059, 0.061),
        (toes_above_the_stated_ground, 0.019, 0.021),
        (below_the_stated_ground, 0.024, 0.026),
        (slides, 0.039, 0.041),
        (lambda seconds: slides(seconds=seconds), 0.35, 0.4),
        (lambda height: not slides(height=height), 0.039, 0.041),
        (lambda rise: not slides(rise=rise, seconds=0.5, height=-0.01), 0.049, 0.051),
        (lambda rate: slides(rate=rate, seconds=0.6), 28.9, 29.1),
        (drags_at, 0.59, 0.61),
        (lambda metres: not slides_faster_by(metres), 0.02 / 5.5 - 1e-4, 0.02 / 5.5 + 2e-4),
        (slides_ever_faster_for, 22, 26),  # 5.5 / 0.3 frames, and half of twelve
        (would_fall_with_a_foot_at, 0.059, 0.061),
        (would_fall_with_hips_at, 0.79, 0.81),
        (inverted_by, 120.0, 122.0),  # the trunk leans by a degree
        (inverted_with_ankles_at, -0.01, 0.01),
        (lambda height: not inverted_with_wrists_at(-height), 0.099, 0.101),
        (lies_and_goes, 0.395, 0.405),
        (lies_and_rises, 0.099, 0.102),
        (lies_with_a_trunk_at, 59.0, 61.5),
        (lies_with_legs_at, 31.0, 33.0),
        (lambda frames: lies(way=30.0, frames=int(frames)), 4, 5),
        (differs_from_a_copy_by, 0.99e-6, 1.01e-6),
        (stands_around_a_copy_for, 2, 3),
        (early_by, 0.74, 0.76),
        (shuffled_at, 19.9, 20.1),
        (unusual_until, 23, 25),
        (has_a_belt, 0.29, 0.31),
        (lambda travel: not has_a_belt(travel=travel), 0.98, 1.02),  # a quarter of the way of the belt
        (lambda frames: has_a_belt(frames=int(frames)), 58, 61),
        (begins_with_another_posture, 2, 3),
        (elbow_is_judged_at, 14.9, 15.1),
        (is_nobodys_size, 1.59, 1.61),  # times the figure
        (lambda size: not is_nobodys_size(size), 0.249, 0.251),
        (has_nobodys_forearm, 1.59, 1.61),
        (lambda length: not has_nobodys_forearm(length), 0.59, 0.61),
        (is_noisy_in, 9, 10),
        # An angle with a tolerance of 45 degrees is not determined.
        (
            elbow_of_the_figure_is_judged_at,
            *(np.degrees(np.arcsin(10 / 45)) + np.array([-0.1, 0.1])),
        ),
    ],
)
def test_a_number_decides_at_its_bound(finds: Callable[[float], bool], inside: float, outside: float) -> None:
    assert [finds(inside), finds(outside)] == [False, True]


# Tolerances for noise of measuring

NOISE = 0.004
BETWEEN = 3 * np.sqrt(2) * NOISE
"""Tolerance of a distance, metres: three standard deviations of the noise of both ends."""


def jumped(joints: slice | int) -> np.ndarray:
    moved = gesture()
    moved[50, joints] += 0.3 * LEFT
    return moved


def evenly(order: int, constant: float) -> np.ndarray:
    """Return a person whose derivative of an order is constant."""
    return person() + along(constant * TIME**order / math.factorial(order))


def wide(height: float = 0.1) -> np.ndarray:
    """Return a person with a foot off the ground and the other far to the side."""
    joints = person()
    joints[:, ANKLES] += np.array([-0.35, 0.35])[:, None] * LEFT
    joints[:, ANKLES[0]] += height * UP
    return joints


@pytest.mark.parametrize(
    ("check", "place", "joints", "bound", "deviations"),
    [
        ("floating", "lowest", person() + along(0.2 * STRETCH, UP), 0.02, 2),
        ("penetration", "lowest", person() - along(0.3 * STRETCH, UP), -0.025, 3),
        ("teleport", "left_wrist", jumped(WRISTS[1]), 0.07, 5),
        ("teleport", "body", jumped(slice(None)), 0.06, 5),
        ("jitter", "neck", gesture() + np.random.default_rng(0).normal(0, 0.02, (120, 14, 3)), 0.006, 2),
        ("balance-still", "centre_of_mass", wide(), 0.05, 2),
        ("balance", "centre_of_mass", wide(), 0.0, 2),
        *(
            (
                name,
                "neck",
                evenly(order, 2 * bound),
                bound,
                5 * np.sqrt(3 * math.comb(2 * order, order)) * RATE**order,
            )
            for order, name, bound in ((1, "speed", 14.0), (2, "acceleration", 400.0), (3, "jerk", 48e3))
        ),
    ],
)
def test_bounds_widen_by_multiples_of_the_noise(
    check: str, place: str, joints: np.ndarray, bound: float, deviations: float
) -> None:
    table = judged(joints, check, noise=NOISE).to_pandas()
    table = table[table.place == place]
    ends = table.lower if bound < 0 else table.upper
    assert len(table)
    assert ends.to_numpy() == pytest.approx(bound + math.copysign(deviations * NOISE, bound))


def test_bones_may_differ_by_what_bodies_and_noise_give() -> None:
    """Spines bend to the side by 38.2 degrees; clavicles, 0.8 of the half width, turn by 30; bones differ by 3 cm."""
    joints = gesture()
    lengths = {segment_name((a, b)): float(np.linalg.norm(joints[0, a] - joints[0, b])) for a, b in SEGMENTS}
    joints[50] *= 2.0
    table = judged(joints, "rigid-parts", noise=NOISE).to_pandas()
    table = table[table.frame == 50].set_index("place")
    assert set(lengths) <= set(table.index)
    bone = math.hypot(0.03, BETWEEN)
    height, width = lengths["neck-pelvis"], lengths["right_shoulder-left_shoulder"] / 2
    half = math.radians(38.2) / 2
    chord = height * math.sin(half) / half
    leaning = np.array([chord * math.sin(half), chord * math.cos(half)])
    spine = math.hypot(height, width) - math.dist(leaning, (width, 0.0))
    across, raised = 1.6 * width * (1 - math.cos(math.pi / 6)), 0.8 * width * math.sin(math.pi / 6)
    for name, length in lengths.items():
        gives = {
            "neck-pelvis": (spine,),
            **dict.fromkeys(("right_shoulder-pelvis", "left_shoulder-pelvis"), (spine, raised)),
            **dict.fromkeys(
                ("neck-right_shoulder", "neck-left_shoulder", "right_shoulder-left_shoulder"), (across,)
            ),
        }.get(name, ())
        ends = np.array([table.lower[name], table.upper[name]])
        assert ends == pytest.approx(length + np.array([-1, 1]) * math.hypot(bone, *gives)), name


def test_noise_is_the_scatter_of_limbs_and_an_end_may_be_worse() -> None:
    """Noise is 1.4826 / sqrt(2) median deviations: of the middle half of the limbs, or of a limb up to thrice that."""
    rng, joints = np.random.default_rng(0), gesture()
    joints += rng.normal(0, 0.004, joints.shape)
    joints[:, WRISTS[0]] += rng.normal(0, 0.01, (120, 3))
    joints[:, ANKLES[0]] += rng.normal(0, 0.1, (120, 3))
    joints[50] *= 2.0
    lengths = {
        segment_name(one): np.linalg.norm(joints[:, one[0]] - joints[:, one[1]], axis=1)
        for one in LIMB_SEGMENTS
    }
    scatter = {
        name: round(1.4826 / np.sqrt(2) * float(np.median(abs(one - np.median(one)))), 5)
        for name, one in lengths.items()
    }
    noise = round(float(np.mean(sorted(scatter.values())[2:6])), 5)
    report = judged(joints, "rigid-parts", noise=None)
    assert report.settings["noise"] == noise
    table = report.to_pandas()
    for name in ("right_elbow-right_wrist", "right_knee-right_ankle"):
        row = table[(table.place == name) & (table.frame == 50)].iloc[0]
        own = min(max(scatter[name], noise), 3 * noise)
        assert (row.upper - row.lower) / 2 == pytest.approx(math.hypot(0.03, 3 * np.sqrt(2) * own)), name
        assert (row.upper + row.lower) / 2 == pytest.approx(np.median(lengths[name]), abs=1e-5)
    assert scatter["right_elbow-right_wrist"] < 3 * noise < scatter["right_knee-right_ankle"]


def test_directions_may_differ_by_what_bodies_and_noise_give() -> None:
    q = np.tile(FIGURE.neutral, (60, 1))
    names = list(FIGURE.configuration_names)
    for name, degrees in (
        ("right_elbow_flexion", 176.0),
        ("left_knee_flexion", 176.0),
        ("neck_flexion", 89.0),
    ):
        q[50, names.index(name)] = np.radians(degrees)
    points = FIGURE.forward_kinematics(q)
    motion = Motion(joints=points, joint_names=POINTS, time=np.arange(60) / RATE)
    report = validate_motion(motion, ValidateSettings(checks=["joint-range"], noise=NOISE))
    table = report.to_pandas().set_index("place")
    for place, levers in (
        (
            "right_elbow.flexion",
            [FIGURE.lengths[f"right_{part}"] for part in ("shoulder-right_elbow", "elbow-right_wrist")],
        ),
        (
            "left_knee.flexion",
            [FIGURE.lengths[f"left_{part}"] for part in ("hip-left_knee", "knee-left_ankle")],
        ),
        ("neck.flexion", [0.2]),
    ):
        lower, upper = ends_of("anatomical", place) or (0.0, 0.0)
        tolerance = math.hypot(2.0, math.degrees(BETWEEN / min(levers)))
        assert table.upper[place] == pytest.approx(upper + tolerance), place
        assert table.lower[place] == pytest.approx(lower - tolerance), place


def test_capsules_of_people_may_overlap_by_a_centimetre_and_the_noise() -> None:
    joints = gesture()
    joints[50, WRISTS] = (joints[50, JOINT["neck"]] + joints[50, JOINT["pelvis"]]) / 2
    table = judged(joints, "collision", noise=NOISE).to_pandas()
    assert set(table.frame) == {50}
    assert table.lower.to_numpy() == pytest.approx(-0.01 - BETWEEN)


# Whole clips


@pytest.mark.parametrize("rate", [30.0, 60.0])
def test_a_body_over_a_stated_ground_may_be_away_from_it_for_a_while(rate: float) -> None:
    """The body jumps onto a box and stays there; 3 cm of slope, 4 of lifted heels and 2 are allowed."""
    count = np.arange(round(6 * rate))
    time = np.clip(count - len(count) // 2, 0, round(0.4 * rate)) / rate
    rise = (0.3 / time[-1] + 9.81 * time[-1] / 2) * time - 9.81 / 2 * time**2
    joints = person(len(count)) + along(rise, UP) + along(2.0 * time)
    frames = judged(joints, "floating", ground=SOLE, rate=rate).table()["frame"]
    above = int(np.argmax(rise > 0.09))
    assert frames.tolist() == list(range(above + round(0.4 * rate), len(count)))


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("frames", [344, 345, 400])
def test_parts_of_four_seconds_overlap_by_half_a_second(frames: int, seed: int) -> None:
    """A rest shorter than a second belongs to the part before it; a frame has the worst of its parts."""
    rng = np.random.default_rng(seed)
    way = np.convolve(rng.normal(size=frames), np.ones(20), "same")
    ups_and_downs = way > np.quantile(way, 0.4)
    heights = rng.uniform(0.15, 1.0, frames) * ups_and_downs
    joints = person(frames) + along(heights, UP) + along(0.001 * np.arange(frames))
    expected = np.full(frames, np.inf)
    starts = [start for start in range(0, frames, 105) if start + 30 <= frames]
    for start in starts:
        part = slice(start, frames if start == starts[-1] else start + 120)
        expected[part] = np.minimum(expected[part], np.mean(~ups_and_downs[part]))
    table = judged(joints, "contact-share", profile="phuma").to_pandas()
    assert table.frame.tolist() == np.flatnonzero(expected < 0.6).tolist() and len(table)
    assert table.value.to_numpy() == pytest.approx(expected[table.frame])


@pytest.mark.parametrize(("frames", "asked"), [(29, False), (30, True)])
def test_parts_need_a_second(frames: int, asked: bool) -> None:
    report = judged(gesture()[:frames], "contact-share", profile="phuma")
    assert ("contact-share" in report.checks) is asked


SCALES = {
    "swap": 0.5,
    "repeated": 0.5,
    "orientation": 90.0,
    "above-ground": 0.1,
    "balance": 0.1,
    "collision": 0.1,
}
"""Margins that count as 1; otherwise half of the range or, if it has one end, the size of that end."""


@pytest.mark.parametrize(
    ("check", "joints"),
    [
        ("frozen", held(gesture())),
        ("repeated", gesture()[[*range(60), 59, *range(60, 119)]]),
        ("swap", swapped(gesture())),
        ("teleport", jumped(WRISTS[1])),
        ("drift", lengthened(gesture())),
        ("floating", person() + along(0.2 * STRETCH, UP)),
        ("penetration", person() - along(0.3 * STRETCH, UP)),
        ("balance-still", wide()),
        ("balance", wide()),
        ("sliding", slid(gesture())),
        ("speed", evenly(1, 20.0)),
        ("orientation", turned(180.0) + 5.0),
        ("above-ground", person() - along(0.3 * STRETCH, UP)),
    ],
)
def test_margins_of_frames_are_shares_of_ranges(check: str, joints: np.ndarray) -> None:
    report = judged(joints, check, **({"ground": 0.0} if check == "above-ground" else {}))
    table = report.to_pandas()
    assert len(table)
    ends = table[["lower", "upper"]].to_numpy()
    half = np.where(
        np.isfinite(ends).all(axis=1), (ends[:, 1] - ends[:, 0]) / 2, np.nanmax(np.abs(ends), axis=1)
    )
    share = (table.margin / SCALES.get(check, half)).groupby(table.frame).min()
    assert report.margins[share.index, 0] == pytest.approx(share.to_numpy())
    assert report.worst[share.index] == pytest.approx(share.to_numpy())


@pytest.mark.parametrize("seed", [0, 1, 4, 5, 6, 7, 9, 13, 14, 15, 17])
def test_shuffled_frames_of_a_walk_are_named_with_their_distances(seed: int) -> None:
    rng, joints = np.random.default_rng(seed), walk()
    first, number = int(rng.integers(10, 90)), int(rng.integers(4, 14))
    order = np.arange(len(joints))
    order[first : first + number] = first + rng.permutation(number)
    table = judged(joints[order], "timing").to_pandas()
    away = order - np.arange(len(order))
    assert set(table.place) == {"order"} and len(table) == np.count_nonzero(away) >= 7
    assert table.value.tolist() == away[table.frame].tolist()
