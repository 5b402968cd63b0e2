"""Every angle of the figure is judged at the ends that its table of ranges states, with its own value."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.skeleton import DOFS
from posekit.validators.ranges import of_person

FIGURE = posekit.load_figure()
RANGES = Path(posekit.__file__).with_name("urdf") / "ranges"
PEOPLE, TABLE1 = (
    tomllib.loads((RANGES / f"{name}.toml").read_text(encoding="utf-8")) for name in ("anatomical", "table1")
)
BENT = {"shoulder.rotation": "elbow", "hip.flexion": "knee", "hip.rotation": "knee"}
"""Joints that are bent, too: a straight limb shows no rotation, and a straight knee stops the hip."""

ROUNDING = 2e-3
"""Degrees that rounding may add to an end of a range."""

COUPLED = ("shoulder", "hip", "pelvis.flexion")
"""Angles whose ends depend on other angles or on the person, in the table of people."""


def ends_of(table: str, dof: str) -> tuple[float, float] | None:
    """Return the range that a table states for an angle, degrees."""
    joint, angle = dof.removeprefix("right_").removeprefix("left_").split(".")
    if table == "urdf":
        low, high = (np.degrees(ends[DOFS.index(dof)]) for ends in (FIGURE.limits.lower, FIGURE.limits.upper))
        return float(low), float(high)
    if table == "table1":
        found = TABLE1.get(joint, {}).get(angle)
        return None if found is None else tuple(found)
    if f"{joint}.{angle}".startswith(COUPLED):
        return None
    ends = PEOPLE[joint][angle]
    lower, upper = (
        ends[end]["mean"] + sign * PEOPLE["spreads"] * ends[end]["spread"]
        for end, sign in (("lower", -1), ("upper", 1))
    )
    return lower, upper


def posed(**degrees: float) -> np.ndarray[Any, Any]:
    """Return points (1, 19, 3) of the figure with some angles, degrees; a dot in a name is written as two `_`."""
    q = FIGURE.neutral.copy()
    for name, angle in degrees.items():
        q[FIGURE.angle_index[DOFS.index(name.replace("__", "."))]] = math.radians(angle)
    return FIGURE.forward_kinematics(q[None])


def is_judged(table: str, dof: str, end: int) -> bool:
    """Return whether a table has that end; near straight up an arm is written by other angles."""
    ends = ends_of(table, dof)
    return ends is not None and not (abs(ends[end]) >= 130 and "shoulder" in dof)


CASES = [
    (table, dof, end)
    for table in ("urdf", "table1", "anatomical")
    for dof in DOFS
    for end in (0, 1)
    if is_judged(table, dof, end)
]


@pytest.mark.parametrize(("table", "dof", "end"), CASES)
def test_an_angle_is_rejected_beyond_the_end_of_its_range(table: str, dof: str, end: int) -> None:
    ends = ends_of(table, dof)
    assert ends is not None
    side = dof.partition("_")[0]
    bent = BENT.get(dof.removeprefix("right_").removeprefix("left_"))
    others = {f"{side}_{bent}__flexion": 80.0} if bent else {}
    validator = posekit.Validator(checks=["joint-range"], ranges=table, strict=True)
    for beyond in (-1.0, 1.0):
        angle = ends[end] + (beyond if end else -beyond)
        found = validator.check(posed(**others, **{dof.replace(".", "__"): angle})).to_pandas()
        mine = found[found.place == dof]
        assert len(mine) == (beyond > 0)
        if beyond > 0:
            (row,) = mine.itertuples()
            assert row.value == pytest.approx(angle, abs=1e-6)
            if dof.endswith("rotation"):  # the straighter the limb, the less it shows its rotation
                assert (row.lower, row.upper) == pytest.approx(ends, abs=ROUNDING)
            else:
                assert (row.lower, row.upper) == pytest.approx((ends[0] - 1e-3, ends[1] + 1e-3), abs=5e-4)
            assert row.margin == pytest.approx(-1.0, abs=ROUNDING)


@pytest.mark.parametrize("raised", [60.0, 100.0, 125.0])
def test_an_elbow_bends_about_the_axis_that_the_arm_carries(raised: float) -> None:
    validator = posekit.Validator(checks=["joint-range"], ranges="table1", strict=True)
    for side in ("right", "left"):
        pose = {f"{side}_shoulder__abduction": raised, f"{side}_elbow__flexion": 161.0}
        found = validator.check(posed(**pose)).to_pandas()
        (row,) = found[found.place == f"{side}_elbow.flexion"].itertuples()
        assert row.value == pytest.approx(161.0, abs=1e-6)


@pytest.mark.parametrize(("angle", "degrees"), [("shoulder.flexion", -75.0), ("hip.abduction", 60.0)])
def test_tolerances_grow_with_the_angle_of_an_arm_alone(angle: str, degrees: float) -> None:
    """The axis of a shortest rotation by rho is wrong by rho / sin(rho) times the error of the direction."""
    settings = posekit.ValidateSettings(ranges="table1", strict=True, angle_tolerance=1.0)
    validator = posekit.Validator(settings=settings, checks=["joint-range"])
    rho = math.radians(degrees)
    gain = rho / math.sin(rho) if angle.startswith("shoulder") else 1.0
    for side in ("right", "left"):
        found = validator.check(posed(**{f"{side}_{angle.replace('.', '__')}": degrees})).to_pandas()
        (row,) = found[found.place == f"{side}_{angle}"].itertuples()
        lower, upper = ends_of("table1", f"{side}_{angle}") or (0.0, 0.0)
        assert (row.lower, row.upper) == pytest.approx((lower - gain, upper + gain), abs=1e-6)


@pytest.mark.parametrize(("ball", "hinge"), [("shoulder", "elbow"), ("hip", "knee")])
@pytest.mark.parametrize("bend", [30.0, 60.0, 90.0, 125.0])
def test_a_rotation_is_as_uncertain_as_its_limb_is_straight(ball: str, hinge: str, bend: float) -> None:
    settings = posekit.ValidateSettings(ranges="urdf", strict=True, angle_tolerance=1.0)
    validator = posekit.Validator(settings=settings, checks=["joint-range"])
    for side in ("right", "left"):
        place = f"{side}_{ball}.rotation"
        upper = (ends_of("urdf", place) or (0.0, 0.0))[1]
        pose = {f"{side}_{ball}__rotation": upper + 12.0, f"{side}_{hinge}__flexion": bend}
        (row,) = validator.check(posed(**pose)).to_pandas().itertuples()
        assert (row.place, row.value) == (place, pytest.approx(upper + 12.0))
        assert row.upper == pytest.approx(upper + 1 / math.sin(math.radians(bend)))


def coupled(angle: str, end: str, at: float) -> float:
    """Return an end of an angle by another one, degrees: interpolated, with the spread between people."""
    (one,) = (each for each in PEOPLE["coupling"] if (each["angle"], each["end"]) == (angle, end))
    spread = PEOPLE["spreads"] * one["spread"]
    return float(np.interp(at, *np.array(one["points"]).T)) + (spread if end == "upper" else -spread)


@pytest.mark.parametrize("raised", [10.0, 25.0, 40.0, 60.0, 90.0])
def test_a_raised_arm_turns_inward_by_less(raised: float) -> None:
    upper = coupled("shoulder.turn", "upper", raised)
    validator = posekit.Validator(checks=["joint-range"], strict=True)
    for side in ("right", "left"):
        pose = {"abduction": raised, "rotation": upper + 5.0}
        given = {f"{side}_shoulder__{name}": angle for name, angle in pose.items()}
        found = validator.check(posed(**given, **{f"{side}_elbow__flexion": 80.0})).to_pandas()
        (row,) = found[found.place == f"{side}_shoulder.rotation"].itertuples()
        assert (row.value, row.upper) == pytest.approx((upper + 5.0, upper), abs=ROUNDING)


def test_a_straight_knee_stops_the_hip() -> None:
    validator, zeros = posekit.Validator(checks=["joint-range"], strict=True), []
    for bend in (2.0, 5.0, 13.5, 20.0, 30.0):
        upper = coupled("hip.flexion", "upper", bend)
        found = validator.check(posed(left_hip__flexion=upper + 5.0, left_knee__flexion=bend)).to_pandas()
        (row,) = found[found.place == "left_hip.flexion"].itertuples()
        zeros.append(row.upper - upper)
    assert np.ptp(zeros) < ROUNDING and zeros[0] < 0  # the zero of the hip is that of the pelvis


@pytest.mark.parametrize("degrees", [70.5, 120.0])
def test_an_arm_is_raised_by_less_backward_than_forward(degrees: float) -> None:
    validator = posekit.Validator(checks=["joint-range"], strict=True)
    for side in ("right", "left"):
        backward = validator.check(posed(**{f"{side}_shoulder__flexion": -degrees})).to_pandas()
        (row,) = backward[backward.place == f"{side}_shoulder.elevation"].itertuples()
        # 62.3 degrees and 0.8 spreads of 9.5 behind the body.
        assert (row.value, row.upper) == pytest.approx((degrees, 62.3 + 0.8 * 9.5), abs=ROUNDING)
        assert validator.check(posed(**{f"{side}_shoulder__flexion": degrees})).ok.all()


WORDS = (RANGES / "table1.toml").read_text(encoding="utf-8")
ELBOW = "[elbow]\nflexion = [0.0, 160.0]"


@pytest.mark.parametrize(
    ("given", "instead", "field"),
    [
        ("posekit.ranges/1", "posekit.ranges/2", "schema"),
        ('"rotation"', '"bent"', "kind"),
        ('kind = "rotation"', 'kind = "anatomical"\nspreads = 1.0', "neck.flexion.lower.mean"),
        (ELBOW, "[elbow]\nflexion = [160.0, 0.0]", "elbow.flexion"),
        (ELBOW, "[elbow]\nflexion = [0.0]", "elbow.flexion"),
        (ELBOW, "[elbow]\nflexing = [0.0, 160.0]", "elbow.flex"),
        (ELBOW, "", "elbow.flexion"),
        (WORDS, 'schema = "posekit.ranges/1"\nkind = "anatomical"', "spreads"),
    ],
)
def test_a_broken_table_names_the_field(given: str, instead: str, field: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert given in WORDS
    path.write_text(WORDS.replace(given, instead), encoding="utf-8")
    with pytest.raises(InputError, match=rf"mine\.toml: {field}"):
        posekit.Validator(ranges=str(path)).check(posed())


def test_own_ranges_judge_by_their_own_ends(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(WORDS.replace(ELBOW, "[elbow]\nflexion = [10.0, 50.0]"), encoding="utf-8")
    validator = posekit.Validator(checks=["joint-range"], ranges=str(path), strict=True)
    for angle, places in ((5.0, {"right_elbow.flexion"}), (30.0, set()), (55.0, {"right_elbow.flexion"})):
        found = validator.check(posed(right_elbow__flexion=angle, left_elbow__flexion=30.0)).table()
        assert set(found["place"]) == places


@pytest.mark.parametrize("joint", ["right_elbow_Z", "left_hip_Z", "middle_lumbar_Z", "right_shoulder_Y"])
@pytest.mark.parametrize("end", [0, 1])
def test_joints_of_a_robot_are_judged_by_the_ends_of_a_table(joint: str, end: int) -> None:
    limits = tomllib.loads((RANGES / "human_as_stick_figure.toml").read_text(encoding="utf-8"))["limits"]
    robot = posekit.load_robot("human", bodies="none")
    q = np.tile(robot.neutral, (2, 1))
    inward = 1 if end == 0 else -1
    q[:, robot.configuration_names.index(joint)] = np.radians(
        limits[joint][end] + np.array([0.2, -0.2]) * inward
    )
    validator = posekit.Validator(robot, checks=["joint-range"], ranges="human_as_stick_figure")
    found = validator.check(posekit.Motion(q=q, robot="human")).table()
    assert found["frame"].tolist() == [1] and found["place"].tolist() == [joint]
    assert found["value"] == pytest.approx(limits[joint][end] - 0.2 * inward)
    allowed = np.array([-1e-3, 1e-3])  # degrees, for rounding
    assert [found["lower"][0], found["upper"][0]] == pytest.approx(limits[joint] + allowed, abs=1e-9)


def test_the_table_of_a_robots_joints_names_its_bad_limits(tmp_path: Path) -> None:
    words = (RANGES / "human_as_stick_figure.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(
        words.replace("right_knee_Z = [0.0, 130.0]", "right_knee_Z = [130.0, 0.0]"), encoding="utf-8"
    )
    with pytest.raises(InputError, match=r"mine\.toml: limits\.right_knee_Z"):
        posekit.Validator("human", ranges=str(path)).check(posekit.load_robot("human").neutral[None])


@pytest.mark.parametrize("forward", [-30.0, 0.0, 5.0, 20.0])
@pytest.mark.parametrize("outward", [0.0, 4.0])
def test_ranges_of_a_person_widen_by_the_share_of_the_hips_that_may_be_another_pelvis(
    forward: float, outward: float
) -> None:
    """The zero has the spread of people (6.75 degrees) and of a pelvis 1.5 cm off in 10; 10 degrees are the posture."""
    own = 6.75**2 + math.degrees(math.atan(0.015 / 0.1)) ** 2
    moved = of_person(PEOPLE, forward, outward)
    angles = [(joint, angle) for joint in ("pelvis", "hip") for angle in PEOPLE[joint]]
    for joint, angle in angles:
        ends = [[one[joint][angle][end]["mean"] for end in ("lower", "upper")] for one in (PEOPLE, moved)]
        mean = PEOPLE[joint][angle].get("zero", {}).get("mean", 0.0)
        shift = np.sign(mean) * (forward - abs(mean)) * own / (own + 100.0)
        shift = -outward if (joint, angle) == ("hip", "abduction") else shift
        assert np.diff(ends, axis=0)[0] == pytest.approx([min(shift, 0.0), max(shift, 0.0)]), (joint, angle)
