"""Every check of motion: what it must know, which bounds its thresholds are, and by how much noise moves them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import FEET_POINTS, JOINTS, N_TRUNK_JOINTS
from posekit.tree import Findings
from posekit.validators.motion import MOTION_CHECKS, MotionClip, judge_motion, load_profile
from posekit.validators.motion.motion_check import MotionCheck

UP = np.array([0.0, 0.0, 1.0])
COUNT, RATE = 150, 30.0


def going(noise: float = 0.0, **known: object) -> MotionClip:
    """Return somebody who glides along, feet and a robot's velocities included: every check says something."""
    joints = np.repeat(load_figure().neutral_points[None, : len(JOINTS)], COUNT, axis=0)
    time = np.arange(COUNT) / RATE
    joints = joints + (0.9 * time)[:, None, None] * np.eye(3)[0]
    joints[:, 6:] += 0.1 * np.sin(3.0 * time)[:, None, None] * UP
    feet = np.repeat(joints[:, [12, 13]], 2, axis=1)[:, [0, 2, 1, 3]] - 0.05 * UP
    clip = MotionClip(
        joints=joints,
        feet=feet,
        time=time,
        rate=RATE,
        up=UP,
        ground=float(joints[..., 2].min()) - 0.07,
        noise=noise,
        velocity=np.tile(np.sin(time)[:, None], (1, 2)),
        velocity_limits=np.array([2.0, 0.5]),
        velocity_names=("hip", "knee"),
    )
    return replace(clip, **known)  # type: ignore[arg-type]


def judged(check: MotionCheck, clip: MotionClip) -> Findings:
    assert check.not_asked(clip) == ""
    return check.judge(clip)


def limbs_apart(trunk: float, limbs: float) -> Array:
    return np.array([trunk] * N_TRUNK_JOINTS + [limbs] * (len(JOINTS) - N_TRUNK_JOINTS))


# What a threshold of so much makes of the bounds (lower, upper) of a place, and by how many standard deviations of
# measuring these, or the tolerance beside them, are wider.
INF = np.inf
BOUNDS: dict[str, tuple[Callable[..., tuple[object, object]], Callable[[], float]]] = {
    "timing": (lambda missing, displaced: ([-0.75, -displaced], [missing, displaced]), lambda: 0),
    "frozen": (lambda longest: (-INF, longest), lambda: 0),
    "repeated": (lambda most: (-INF, most), lambda: 0),
    "swap": (lambda most: (-INF, most), lambda: 0),
    "teleport": (lambda joint, body: (-INF, [joint] * len(JOINTS) + [body]), lambda: 5),
    "speed": (lambda trunk, limbs: (-INF, limbs_apart(trunk, limbs)), lambda: 5 * of_noise(1)),
    "acceleration": (lambda trunk, limbs: (-INF, limbs_apart(trunk, limbs)), lambda: 5 * of_noise(2)),
    "jerk": (lambda trunk, limbs: (-INF, limbs_apart(trunk, limbs)), lambda: 5 * of_noise(3)),
    "root-jerk": (lambda most, cutoff: (-INF, most), lambda: 0),
    "jitter": (lambda deviation: (-INF, deviation), lambda: 2),
    "drift": (lambda share: (-share, share), lambda: np.nan),
    "joint-velocity": (lambda share: (-INF, share), lambda: 0),
    "penetration": (lambda depth, unlevel: (-depth, INF), lambda: 3),
    "floating": (lambda height, shortest, fall: (-INF, height), lambda: 2),
    "support": (lambda longest: (-INF, longest), lambda: 0),
    "sliding": (lambda fastest, lasting, uneven, rising: (-INF, fastest), lambda: 0),
    "balance-still": (lambda beyond, slower, lasting: (-INF, beyond), lambda: 2),
    "skating-gmd": (lambda height, way: (-INF, way), lambda: 0),
    "skating-wham": (lambda height, way: (-INF, way), lambda: 0),
    "skating-physdiff": (lambda height, way: (-INF, way), lambda: 0),
    "contact-share": (lambda least, window: (least, INF), lambda: 0),
    "root-height": (lambda least, most, window: (least, most), lambda: 0),
    "support-distance": (lambda root, pelvis: (-INF, [root, pelvis]), lambda: 0),
}


def of_noise(order: int) -> float:
    """Return the deviation of the length of a difference of so many frames of noise of 1 m, over its time."""
    noise = np.random.default_rng(0).normal(size=(20000, 3))
    difference = np.diff(noise, n=order, axis=0)
    return float(np.sqrt((difference**2).sum(axis=1).mean())) * RATE**order


def test_every_check_has_its_bounds_here() -> None:
    assert set(BOUNDS) == set(MOTION_CHECKS) - {"walking-phases"}


@pytest.mark.parametrize("name", BOUNDS)
def test_thresholds_are_the_bounds_and_noise_widens_them(name: str) -> None:
    kind, (bounds, factor) = MOTION_CHECKS[name], BOUNDS[name]
    given = {one.name: getattr(kind(), one.name) * 1.25 + 0.125 for one in fields(kind)}  # type: ignore[arg-type]
    lower, upper = (np.asarray(bound, dtype=float) for bound in bounds(**given))
    clip = going()
    exact = judged(kind(**given), clip)
    shape = np.broadcast_shapes(exact.value.shape)
    np.testing.assert_allclose(np.broadcast_to(exact.lower, shape), np.broadcast_to(lower, shape))
    np.testing.assert_allclose(np.broadcast_to(exact.upper, shape), np.broadcast_to(upper, shape))
    assert np.all(np.asarray(exact.tolerance) == 0.0)
    noisy = judged(kind(**given), going(noise=0.002))
    for bound, before, sign in ((noisy.lower, lower, -1.0), (noisy.upper, upper, 1.0)):
        finite = np.broadcast_to(np.isfinite(before), shape)
        wider = sign * (np.broadcast_to(bound, shape)[finite] - np.broadcast_to(before, shape)[finite])
        wider = wider + np.broadcast_to(noisy.tolerance, shape)[finite]
        if not np.isnan(factor()):
            np.testing.assert_allclose(wider, 0.002 * factor(), rtol=0.02)


@pytest.mark.parametrize("name", MOTION_CHECKS)
def test_a_check_that_lacks_something_says_which(name: str) -> None:
    check = MOTION_CHECKS[name]()
    lacks = {
        "time": (going(rate=np.nan), "the frame rate is not known (--rate)"),
        "up": (going(up=None), "which way is up is not known (--up)"),
        "ground": (
            going(joints=np.full((COUNT, len(JOINTS), 3), np.nan), feet=np.full((COUNT, len(FEET_POINTS), 3), np.nan)),
            "no height of a foot or a joint is known",
        ),
    }  # fmt: skip
    assert set(check.needs) <= set(lacks)
    for need, (clip, words) in lacks.items():
        if need in check.needs:
            assert check.not_asked(clip) == words
        else:
            assert check.not_asked(clip) != words
    if name != "joint-velocity":
        nobody = MotionClip(joints=np.empty((0, 14, 3)), time=np.empty(0), rate=RATE, up=UP)
        assert check.not_asked(nobody) == "there is no frame"


ASKED_FROM = {"jitter": 25.0, "teleport": 15.0, "sliding": 15.0}
"""Frames a second."""


@pytest.mark.parametrize("name", MOTION_CHECKS)
def test_a_check_that_needs_more_frames_a_second_says_how_many(name: str) -> None:
    check, least = MOTION_CHECKS[name](), ASKED_FROM.get(name, 7.0)
    assert check.not_asked(going(rate=least)) == ""
    fewer = check.not_asked(going(rate=least - 0.5))
    assert fewer == (f"it needs {least:g} frames a second" if name in ASKED_FROM else "")


@pytest.mark.parametrize("name", ["root-jerk", "contact-share", "root-height", "support-distance"])
def test_published_rules_are_asked_of_a_second_of_motion(name: str) -> None:
    check = MOTION_CHECKS[name]()
    for count, words in ((30, ""), (29, "it needs 1 s of motion")):
        clip = going()
        part = replace(clip, joints=clip.joints[:count], time=clip.time[:count], feet=clip.feet[:count])
        assert check.not_asked(part) == words


def test_a_check_at_few_frames_a_second_is_not_filtered_above_half_of_them() -> None:
    check = MOTION_CHECKS["root-jerk"]()
    assert check.not_asked(going(rate=6.5)) == ""
    assert check.not_asked(going(rate=6.0)) == "it needs more than 6 frames a second"


def test_right_and_left_are_told_apart_of_two_frames() -> None:
    clip, check = going(), MOTION_CHECKS["swap"]()
    for count, words in ((1, "it needs two frames"), (2, "")):
        few = replace(clip, joints=clip.joints[:count], time=clip.time[:count], feet=clip.feet[:count])
        assert check.not_asked(few) == words


def test_a_threshold_that_is_impossible_is_refused_with_its_check(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('schema = "posekit.profile/1"\n[checks.walking-phases]\nrules = "1,3"\n')
    with pytest.raises(
        InputError, match=r"checks\.walking-phases: got rules: '1,3'; expected some of 1, 2, 4"
    ):
        load_profile(str(path))
    path.write_text('schema = "posekit.profile/1"\n[checks.walking-phases]\nrules = "4"\n')
    (check,) = load_profile(str(path)).checks
    assert vars(check)["rules"] == "4"


def test_verdicts_repeat_what_findings_say() -> None:
    clip = going()
    checks = load_profile("posekit").checks
    verdict = judge_motion(checks, clip)
    assert verdict.judgements
    for one in verdict.judgements:
        (check,) = (each for each in checks if each.name.replace("-", "_") == one.check)
        found = check.judge(clip)
        assert one.where == check.places(clip) and one.unit == (check.unit,) * len(one.where)
        assert one.over_time and one.value.shape == one.lower.shape == one.upper.shape == one.violated.shape
        for mine, other in (
            (one.value, found.value),
            (one.margin, found.margin),
            (one.violated, found.violated),
        ):
            np.testing.assert_array_equal(mine, other)


def test_profiles_name_their_thresholds() -> None:
    """PHUMA's are those of its paper: 0.6 of the frames, 0.6 to 1.5 m, 6 and 11 cm, 50 m/s³."""
    published = {check.name: check for check in load_profile("phuma").checks}
    assert {name: vars(check) for name, check in published.items()} == {
        "root-jerk": {"most": 50.0, "cutoff": 3.0},
        "contact-share": {"least": 0.6, "window": 0.05},
        "root-height": {"least": 0.6, "most": 1.5, "window": 0.05},
        "support-distance": {"root": 0.06, "pelvis": 0.11},
    }
    assert load_profile("phuma").name == "phuma"
    assert [vars(check) for check in published.values()] == [
        vars(MOTION_CHECKS[name]()) for name in published
    ]


FEET = ("right_foot", "left_foot")
PAIRS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
LIMBS = tuple(
    f"{side}_{start}-{side}_{end}"
    for pairs in ((("shoulder", "elbow"), ("elbow", "wrist")), (("hip", "knee"), ("knee", "ankle")))
    for side in ("right", "left")
    for start, end in pairs
)
PLACES: dict[str, tuple[str, ...]] = {
    "timing": ("missing", "order"),
    **dict.fromkeys(("frozen", "repeated", "support"), ("body",)),
    "swap": PAIRS,
    "teleport": (*JOINTS, "body"),
    **dict.fromkeys(("speed", "acceleration", "jerk", "jitter"), JOINTS),
    **dict.fromkeys(("root-jerk", "root-height"), ("root",)),
    "drift": LIMBS,
    "joint-velocity": ("hip", "knee"),
    **dict.fromkeys(("penetration", "floating"), ("lowest",)),
    **dict.fromkeys(("sliding", "skating-gmd", "skating-wham", "skating-physdiff"), FEET),
    "balance-still": ("centre_of_mass",),
    "contact-share": ("feet",),
    "support-distance": ("root", "pelvis"),
}


@pytest.mark.parametrize("name", MOTION_CHECKS)
def test_every_check_names_its_places(name: str) -> None:
    places = MOTION_CHECKS[name]().places(going())
    if name == "walking-phases":
        assert all(place.startswith(("rule1.", "rule2.", "rule4.")) for place in places)
    else:
        assert places == PLACES[name]


def test_every_check_names_unit_and_meaning() -> None:
    units = {name: kind.unit for name, kind in MOTION_CHECKS.items()}
    assert units == {
        **dict.fromkeys(("timing", "frozen", "repeated"), "frames"),
        **dict.fromkeys(("swap", "drift", "joint-velocity", "contact-share", "walking-phases"), "1"),
        **dict.fromkeys(("speed", "sliding"), "m/s"),
        **dict.fromkeys(("jerk", "root-jerk"), "m/s³"),
        "acceleration": "m/s²",
        "support": "s",
        **dict.fromkeys(("teleport", "jitter", "penetration", "floating", "balance-still"), "m"),
        **dict.fromkeys(("skating-gmd", "skating-wham", "skating-physdiff"), "m"),
        **dict.fromkeys(("root-height", "support-distance"), "m"),
    }
    for name, kind in MOTION_CHECKS.items():
        assert kind.name == name and kind.meaning
        assert set(kind.needs) <= {"time", "up", "ground"}
        places = kind().places(going())
        assert len(set(places)) == len(places) > 0
