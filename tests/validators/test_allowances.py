"""What checks are made with and allow: tolerances by noise, options, and the words of the protocol."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.body.measured import MeasuredPerson
from posekit.body.torso_bending import bending_gives
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.settings import RigidTolerance, ValidateSettings
from posekit.settings.judging import checked_rules
from posekit.skeleton import DOFS, JOINT, SEGMENTS, segment_name
from posekit.tree import Check, Findings, Loosening, Place, Scope, given_check
from posekit.validators import Validator
from posekit.validators.anatomical import Anatomy, AngleRange, Coupling, End
from posekit.validators.anatomical_limb import limb_walls
from posekit.validators.given_points import points_of, refuse_far, sequence_of
from posekit.validators.measured import Allowance, recorded_noise
from posekit.validators.options import CheckOptions
from posekit.validators.ranges import load_ranges
from posekit.validators.registry import ALL_CHECKS, PHYSICAL_CHECKS, check_names, chosen_checks, make_checks
from posekit.validators.suite import Judgement, judge, worst_margins
from posekit.validators.walking import DEFAULT_RULES, WalkingThresholds

FIGURE = load_figure()
FACTOR = 3 * math.sqrt(2)
"""Three deviations of a distance between two points of unit noise."""

noises = st.floats(0.0, 0.02)


def person(noise: float, **changes: Any) -> MeasuredPerson:
    return replace(MeasuredPerson(lengths=dict(FIGURE.lengths), behind=None, noise=noise), **changes)


# --- what noise allows ----------------------------------------------------------------------------------


@given(noise=noises, own=noises)
def test_the_noise_of_a_person_allows_what_the_stated_one_does(noise: float, own: float) -> None:
    stated = Allowance(settings=ValidateSettings(noise=noise))
    measured = Allowance(settings=ValidateSettings(), person=person(noise))
    both = Allowance(settings=ValidateSettings(noise=noise), person=person(own))
    for allowed in (stated, measured, both):
        assert allowed.off() == pytest.approx(FACTOR * noise)
        assert allowed.contact_margin == pytest.approx(-FACTOR * noise)
        assert allowed.angle("", 0.3) == pytest.approx(math.hypot(2.0, math.degrees(FACTOR * noise / 0.3)))
    assert Allowance(
        settings=ValidateSettings(contact_margin=0.01, noise=noise)
    ).contact_margin == pytest.approx(0.01 - FACTOR * noise)
    strict = Allowance(settings=ValidateSettings(strict=True), person=person(noise))
    unknown = Allowance(settings=ValidateSettings(), person=person(math.nan))
    for allowed in (strict, unknown, Allowance(settings=ValidateSettings())):
        assert allowed.off() == allowed.contact_margin == 0.0


@given(noise=noises)
def test_lengths_give_by_noise_and_by_what_a_spine_bends(noise: float) -> None:
    allowed = Allowance(settings=ValidateSettings(), person=person(noise)).rigid(FIGURE)
    bone = math.hypot(0.03, FACTOR * noise)
    spine = math.hypot(max(0.03, bending_gives(FIGURE.lengths)), FACTOR * noise)
    assert allowed.shoulders == allowed.hips == pytest.approx(bone)
    assert allowed.sides == pytest.approx(spine) and spine > bone
    for segment in SEGMENTS:
        torso = {JOINT["pelvis"], JOINT["neck"]}
        bends = set(segment) == torso or (
            JOINT["pelvis"] in segment
            and any(JOINT[f"{side}_shoulder"] in segment for side in ("right", "left"))
        )
        assert allowed.of(segment) == pytest.approx(spine if bends else bone), segment_name(segment)


def test_a_limb_that_is_measured_worse_gives_more() -> None:
    name = "left_elbow-left_wrist"
    worse = person(0.004, noise_by_limb={name: 0.009, "right_hip-right_knee": 0.001})
    allowed = Allowance(settings=ValidateSettings(), person=worse)
    assert allowed.off(name) == pytest.approx(FACTOR * 0.009)
    assert allowed.off("right_hip-right_knee") == allowed.off() == pytest.approx(FACTOR * 0.004)
    broken = Allowance(settings=ValidateSettings(), person=person(0.004, noise_by_limb={name: 0.5}))
    assert broken.off(name) == pytest.approx(FACTOR * 0.012)
    assert allowed.angle(name, 0.25) == pytest.approx(math.hypot(2.0, math.degrees(FACTOR * 0.009 / 0.25)))
    rigid = allowed.rigid(FIGURE)
    assert rigid.of((JOINT["left_elbow"], JOINT["left_wrist"])) == pytest.approx(
        math.hypot(0.03, FACTOR * 0.009)
    )


@pytest.mark.parametrize("settings", [ValidateSettings(strict=True), ValidateSettings(rigid_tolerance=0.03)])
def test_a_tolerance_that_is_given_is_that_of_every_length(settings: ValidateSettings) -> None:
    allowed = Allowance(settings=settings, person=person(0.01)).rigid(FIGURE)
    assert allowed == RigidTolerance.uniform(0.03)


def test_a_check_of_directions_has_the_tolerance_of_its_shortest_segment() -> None:
    allowed = Allowance(settings=ValidateSettings(noise=0.005))
    made = make_checks(FIGURE, PHYSICAL_CHECKS, ranges=load_ranges("urdf"))
    applied = allowed.applied(made, FIGURE)
    directed = 0
    for before, after in zip(made, applied, strict=True):
        if before.noise is not Loosening.DIRECTIONS:
            assert after is before
            continue
        read = [s for s in SEGMENTS if set(s) <= set(after.points)]
        shortest = min(FIGURE.lengths[segment_name(s)] for s in read)
        expected = math.hypot(2.0, math.degrees(FACTOR * 0.005 / shortest))
        assert after.tolerance == pytest.approx(expected)  # type: ignore[attr-defined]
        directed += 1
    assert directed == 10  # neck, pelvis, and four limbs with and without their ends

    @dataclass(frozen=True, kw_only=True)
    class Nose(Check):
        tolerance: float = 0.0
        name = "nose"
        unit = "deg"
        places = (Place(name="nose"),)
        points = (14,)
        noise = Loosening.DIRECTIONS

    (nose,) = allowed.applied([Nose()], FIGURE)
    assert nose.tolerance == pytest.approx(allowed.angle("", 0.2))  # type: ignore[attr-defined]


@pytest.mark.parametrize("made_up", [True, False])
def test_a_robot_gives_by_noise_as_well(made_up: bool) -> None:
    settings = ValidateSettings(contact_margin=0.01)
    allowed = Allowance(settings=settings, person=person(0.005)).of_robot(settings, made_up=made_up)
    off = FACTOR * 0.005
    shortest = max(min(FIGURE.lengths.values()), 0.2)
    assert allowed.rigid == pytest.approx(math.hypot(0.03, off))
    assert allowed.angle == pytest.approx(math.hypot(0.001, math.degrees(off / shortest)))
    assert allowed.contact_margin == pytest.approx(0.01 - off if made_up else 0.01)
    nobody = Allowance(settings=ValidateSettings(noise=0.005)).of_robot(settings, made_up=False)
    assert nobody.angle == pytest.approx(math.hypot(0.001, math.degrees(off / 0.2)))
    stated = ValidateSettings(rigid_tolerance=0.02, angle_tolerance=1.0)
    same = Allowance(settings=stated, person=person(0.005)).of_robot(stated, made_up=False)
    assert (same.rigid, same.angle) == (0.02, 1.0)


def test_what_was_allowed_is_told() -> None:
    told = Allowance(settings=ValidateSettings(), person=person(0.005)).told(FIGURE)
    limbs = [FIGURE.lengths[f"right_{a}-right_{b}"] for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))]
    limbs += [FIGURE.lengths[f"right_{a}-right_{b}"] for a, b in (("hip", "knee"), ("knee", "ankle"))]
    angles = [math.hypot(2.0, math.degrees(FACTOR * 0.005 / length)) for length in limbs]
    assert told["noise"] == 0.005
    assert told["angle_tolerance"] == [round(min(angles), 4), round(max(angles), 4)]
    assert told["rigid_tolerance"] == ["3.67cm", "3.67cm"]  # the root of 3² + (3 √2 0.5)²
    spine = 100 * math.hypot(max(0.03, bending_gives(FIGURE.lengths)), FACTOR * 0.005)
    assert told["torso_tolerance"] == f"{spine:.3g}cm"
    assert told["contact_margin"] == "-2.121cm"
    nobody = Allowance(settings=ValidateSettings()).told(FIGURE)
    assert nobody["noise"] is None and nobody["contact_margin"] == "0cm"
    assert nobody["angle_tolerance"] == [2.0, 2.0] and nobody["rigid_tolerance"] == ["3cm", "3cm"]
    rounded = Allowance(settings=ValidateSettings(), person=person(0.00512345678)).told(FIGURE)
    assert rounded["noise"] == 0.005123


def test_noise_over_time_is_stated_or_told_by_limbs() -> None:
    still = np.repeat(FIGURE.neutral_points[None, :14], 400, axis=0)
    seen = still + np.random.default_rng(0).normal(0.0, 0.005, still.shape)
    assert recorded_noise(seen, ValidateSettings()) == pytest.approx(0.005, rel=0.1)
    assert recorded_noise(seen, ValidateSettings(noise=0.002)) == 0.002
    assert recorded_noise(seen, ValidateSettings(strict=True)) == 0.0
    assert recorded_noise(seen[:5], ValidateSettings()) == 0.0


@pytest.mark.parametrize(("settings", "forward", "moves"), [
    (ValidateSettings(), 40.0, True),
    (ValidateSettings(strict=True), 40.0, False),
    (ValidateSettings(lengths="model"), 40.0, False),
    (ValidateSettings(), math.nan, False),
])  # fmt: skip
def test_ranges_begin_where_a_recording_has_the_pelvis(
    settings: ValidateSettings, forward: float, moves: bool
) -> None:
    ranges = load_ranges("anatomical")
    found = Allowance(settings=settings, person=person(0.0, hips_forward=forward)).ranges(ranges)
    assert (found != ranges) == moves
    assert Allowance(settings=settings).ranges(ranges) is ranges


def test_a_part_of_where_the_hips_are_is_the_skeletons() -> None:
    """As deviations say: of 10 degrees how people hold them, and of where skeletons have their pelvis."""
    anatomy = load_ranges("anatomical").anatomy
    assert anatomy is not None
    for angle, one in anatomy.motions.items():
        if one.pelvis <= 0:
            continue
        own = math.hypot(one.zero.spread, math.degrees(math.atan(one.pelvis / 0.1)))
        share = own**2 / (own**2 + 10.0**2)
        for more in (-20.0, 20.0):
            moved = anatomy.with_hips(abs(one.zero.mean) + more).motions[angle]
            sign = math.copysign(1.0, one.zero.mean)
            for side, outward in (("lower", -1), ("upper", 1)):
                by = moved.end(side)[0] - one.end(side)[0]  # type: ignore[arg-type]
                expected = sign * share * more
                assert by == pytest.approx(expected if expected * outward > 0 else 0.0)


def test_ends_are_means_and_spreads_from_the_figures_zero() -> None:
    one = AngleRange(
        lower=End(mean=-10.0, spread=3.0), upper=End(mean=50.0, spread=4.0), zero=End(mean=5.0, spread=3.0)
    )
    assert one.end("lower") == pytest.approx((-5.0, math.hypot(3.0, 3.0)))
    assert one.end("upper") == pytest.approx((55.0, 5.0))
    out, inward = replace(one, moved=7.0), replace(one, moved=-7.0)
    assert (out.end("lower")[0], out.end("upper")[0]) == pytest.approx((-5.0, 62.0))
    assert (inward.end("lower")[0], inward.end("upper")[0]) == pytest.approx((-12.0, 55.0))
    motions = {dof.removeprefix("right_").removeprefix("left_"): one for dof in DOFS}
    coupling = Coupling(
        angle="hip.flexion", side="upper", of="knee.flexion", points=((0.0, 40.0), (20.0, 60.0)), spread=4.0
    )
    anatomy = Anatomy(motions=motions, couplings=(coupling,), spreads=2.0, sources={})
    assert anatomy.limits()["left_hip.flexion"] == pytest.approx((-5.0 - 2 * math.hypot(3, 3), 65.0))
    mean, spread = anatomy.coupled(coupling, np.array([-50.0, 5.0, 15.0, 25.0, 99.0]))
    np.testing.assert_allclose(mean, [45.0, 45.0, 55.0, 65.0, 65.0])
    assert spread == pytest.approx(5.0)
    free = replace(coupling, of="shoulder.elevation")
    np.testing.assert_allclose(anatomy.coupled(free, np.array([10.0]))[0], [55.0])
    assert anatomy.couplings_of("hip.flexion") == anatomy.couplings_of("hip.flexion", "upper") == (coupling,)
    assert anatomy.couplings_of("hip.flexion", "lower") == anatomy.couplings_of("knee.flexion") == ()
    assert anatomy.sinus_of("hip") is None


def test_walls_are_without_tolerance_and_as_hips_show_them_unless_told_otherwise() -> None:
    anatomy = load_ranges("anatomical").anatomy
    assert anatomy is not None and anatomy.sinus_of("hip") is not None
    angles = np.array([[40.0, 10.0, 5.0, 30.0], [-5.0, 25.0, -20.0, 80.0]])
    usual = limb_walls(anatomy, "hip", angles).limits(anatomy.spreads)
    for changes, same in (
        ({"tolerance": 0.0}, True),
        ({"turn": (0.0, 0.0)}, True),
        ({"tolerance": 2.0}, False),
    ):
        found = limb_walls(anatomy, "hip", angles, **changes).limits(anatomy.spreads)
        assert all(np.array_equal(a, b) for a, b in zip(usual, found, strict=True)) == same
    # A pelvis between the hips is flexed until the thigh is near the middle of its range.
    turned = limb_walls(anatomy, "hip", angles, turn=(-8.0, 3.0))
    middle = np.mean([anatomy.motions["hip.flexion"].end(side)[0] for side in ("lower", "upper")])
    own = limb_walls(anatomy, "hip", angles).values[..., 0]
    np.testing.assert_allclose(turned.values[..., 0], own - np.clip(own - middle, -8.0, 3.0))


def test_a_validator_says_by_whose_body_and_what_it_judges() -> None:
    told = Validator(checks=("collision", "rigid-parts")).describe()
    assert told == {"figure": FIGURE.hash, "checks": ["rigid-parts", "collision"]}


# --- options and names ----------------------------------------------------------------------------------


def test_options_are_as_they_are_documented() -> None:
    usual = CheckOptions()
    assert usual.ranges.name == "urdf" and usual.rigid_tolerance == 0.0 and usual.rigid_mode == "placement"
    assert (
        usual.angle_tolerance == 1e-3
        and usual.contact_margin == 0.0
        and usual.rules == DEFAULT_RULES == (1, 2)
    )
    assert not (usual.limbs or usual.directions or usual.exact) and usual.up == (0.0, 0.0, 1.0)
    assert usual.thresholds == WalkingThresholds()


@pytest.mark.parametrize(("changes", "words"), [
    ({"rigid_tolerance": -0.1}, "the rigid tolerance is -0.1; expected zero or a positive, finite number"),
    ({"rigid_tolerance": math.inf}, "the rigid tolerance is inf"),
    ({"angle_tolerance": math.nan}, "the angle tolerance is nan; expected zero or a positive, finite number"),
    ({"angle_tolerance": -1e-9}, "the angle tolerance is -1e-09"),
    ({"contact_margin": math.nan}, "the contact margin is nan m; expected a finite length"),
    ({"rules": (1, 6)}, "6"),
])  # fmt: skip
def test_options_that_let_every_posture_pass_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as caught:
        CheckOptions(**changes)
    assert words in str(caught.value)
    CheckOptions(rigid_tolerance=0.0, angle_tolerance=0.0, contact_margin=-0.5)
    assert CheckOptions(rules=[1, 5, 2]).rules == checked_rules([1, 5, 2])  # type: ignore[arg-type]
    assert isinstance(CheckOptions(rules=[1, 5, 2]).rules, tuple)  # type: ignore[arg-type]


def test_a_check_takes_options_as_parameters_and_no_others() -> None:
    own = CheckOptions().with_parameters("collision", {"contact_margin": 0.02, "ranges": "table1"})
    assert own.contact_margin == 0.02 and own.ranges.name == "table1"
    with pytest.raises(
        InputError, match="--checks: collision has no parameter 'margin'; expected some of angle_tol"
    ):
        CheckOptions().with_parameters("collision", {"exact": True, "margin": 0.0})


def test_names_are_in_the_order_in_which_checks_are_applied() -> None:
    assert ALL_CHECKS == ("rigid-parts", "joint-range", "collision", "walking")
    assert PHYSICAL_CHECKS == ALL_CHECKS[:3]
    assert check_names(["walking", "collision", "walking", "rigid-parts"]) == (
        "rigid-parts",
        "collision",
        "walking",
    )
    with pytest.raises(
        InputError, match=r"--checks: 'colision' is not a check; expected .*did you mean collision"
    ):
        chosen_checks(["colision"])


UNITS = {"rigid_parts": "m", "joint_range": "deg", "collision": "m"}
OF_RULES = {1: "m", 2: "m", 3: "m", 4: "deg", 5: "deg"}


@pytest.mark.parametrize("ranges", ["urdf", "table1", "table1-printed", "anatomical"])
@pytest.mark.parametrize("mode", ["distances", "side", "placement"])
def test_every_check_has_its_unit_and_judges_whoever_stands(ranges: str, mode: Any) -> None:
    made = make_checks(
        FIGURE, ALL_CHECKS, ranges=load_ranges(ranges), rigid_mode=mode, rigid_tolerance=0.01, limbs=True,
        rules=tuple(OF_RULES), exact=True,
    )  # fmt: skip
    seen: set[str] = set()
    for check in made:
        if check.name == "walking":
            assert check.unit == OF_RULES[int(check.where[0][4])] and check.scope is Scope.MOTION
        else:
            assert check.unit == UNITS[check.name] and check.scope is Scope.POSTURE
        assert getattr(check, "exact", True) and getattr(check, "contact_margin", 0.0) == 0.0
        assert check.rigid == (check.name == "rigid_parts") and check.slow == (check.name == "collision")
        assert (check.noise is Loosening.DIRECTIONS) == (check.name == "joint_range")
        if check.name == "joint_range":
            limb = check.where[0].partition("_")[0] in ("right", "left")
            assert check.pulls == (ranges.startswith("table1") or (ranges == "anatomical" and limb))
            assert check.scaled == (ranges == "table1" and limb)
            assert check.of_configuration == (ranges == "urdf")
        else:
            assert check.of_configuration == (check.name != "walking") and not (check.pulls or check.scaled)
        found = check.judge(FIGURE.neutral_points[None, list(check.points)])
        assert found.value.shape == (1, len(check.places)) and not found.violated.any()
        seen.add(check.name)
    assert seen == {*UNITS, "walking"}


@pytest.mark.parametrize(("name", "words"), [
    ("posekit.body:load_figure", "makes no check; expected a class that inherits from posekit.validators.Check"),
    ("json:JSONDecoder", "json:JSONDecoder makes no check"),
    ("json:nothing", "cannot be imported (module 'json' has no attribute 'nothing')"),
    ("no_such_module:Check", "cannot be imported (No module named 'no_such_module')"),
    (":Check", "':Check' is not a check; expected some of rigid-parts, joint-range"),
    ("json:", "'json:' is not a check"),
    ("json", "'json' is not a check"),
])  # fmt: skip
def test_a_name_that_leads_to_no_check_is_refused(name: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        chosen_checks([name])
    assert words in str(caught.value) and str(caught.value).startswith("--checks: ")
    chosen_checks([f"{__name__}:Height"])


@dataclass(frozen=True, kw_only=True)
class Height(Check):
    """How high a wrist is, for tests."""

    places: tuple[Place, ...] = (Place(name="wrist"),)
    points: tuple[int, ...] = (8,)
    name: str = "height"
    unit: str = "m"
    most: float = 2.0
    shape: tuple[int, ...] = ()
    sure: bool = False

    def judge(self, points: Array) -> Findings:
        value = points[:, :1, 2]
        rejects = np.ones(value.shape, dtype=bool) if self.sure else None
        if self.shape:
            value = np.zeros(self.shape)
        return Findings(value=value, lower=np.array(-np.inf), upper=np.array(self.most), rejects=rejects)


@pytest.mark.parametrize(("changes", "words"), [
    ({"name": "a b"}, r"'a b' is no name of a check; expected letters, digits, - and _"),
    ({"name": "1a"}, "no name"),
    ({"points": (19,)}, r"0 to 18; it reads \[19\]"),
    ({"points": (-1, 3)}, r"it reads \[-1\]"),
    ({"points": ()}, r"it reads \[\]"),
    ({"places": ()}, "at least one place and one point"),
    ({"shape": (2, 2)}, r"judge returns a value of shape \(2, 2\) for two postures; expected \(2, 1\)"),
    ({"shape": (1, 1)}, r"of shape \(1, 1\)"),
    ({"sure": True}, "rejects a posture none of whose points is known; expected NaN there"),
])  # fmt: skip
def test_a_check_that_cannot_be_asked_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        make_checks(FIGURE, [Height(**changes)])
    assert make_checks(FIGURE, [Height(points=(18,))])[0].points == (18,)


def test_settings_of_a_check_name_its_class_and_what_is_not_usual() -> None:
    one = Height(most=1.5, points=(9,))
    assert one.settings.name == f"{__name__}:Height"
    assert dict(one.settings.parameters) == {"most": 1.5, "points": [9]}
    assert given_check(one.settings) is one
    assert dict(Height().settings.parameters) == {}


# --- the protocol ---------------------------------------------------------------------------------------


@given(
    value=st.floats(-5, 5),
    lower=st.floats(-2, 0),
    upper=st.floats(0, 2),
    tolerance=st.sampled_from([0.0, 0.25]),
)
def test_a_bound_is_kept_at_its_value_and_up_to_the_tolerance(
    value: float, lower: float, upper: float, tolerance: float
) -> None:
    found = Findings(
        value=np.array([[value]]), lower=np.array(lower), upper=np.array(upper), tolerance=tolerance
    )
    assert found.margin[0, 0] == min(value - lower, upper - value)
    assert found.violated[0, 0] == (found.margin[0, 0] < -tolerance)
    assert not found.undecided.any()
    at = replace(found, value=np.array([[upper + tolerance], [lower - tolerance]]), lower=np.array(lower))
    if (upper + tolerance) - upper == tolerance and lower - (lower - tolerance) == tolerance:
        assert not at.violated.any()
    unknown = replace(found, value=np.array([[np.nan]]))
    assert unknown.undecided.all() and not unknown.violated.any()
    assert replace(found, rejects=np.array([[True]])).violated.all()
    assert Findings(value=np.zeros((1, 1)), lower=np.zeros(1), upper=np.zeros(1)).tolerance == 0.0


def test_a_place_is_named_by_what_it_is() -> None:
    assert str(Place(joint="neck", angle="bending")) == "neck.bending"
    assert str(Place(joint="neck")) == "neck"
    assert str(Place(segment="neck-pelvis")) == "neck-pelvis"
    assert str(Place(bodies=("torso", "head"))) == "torso-head"
    assert str(Place(name="here", segment="neck-pelvis", bodies=("a", "b"), joint="neck")) == "here"
    assert Place.of_angles("neck.bending", "left_hip.flexion") == (
        Place(joint="neck", angle="bending"),
        Place(joint="left_hip", angle="flexion"),
    )


def test_a_check_says_nothing_but_what_it_must() -> None:
    one = Height()
    assert one.where == ("wrist",)
    assert one.scope is Scope.POSTURE and one.noise is Loosening.TOLERANCE and one.rule is None
    assert not (one.rigid or one.pulls or one.scaled or one.slow or one.of_configuration or one.needs_head)
    assert one.oriented(np.zeros(3)) is one and one.moving(np.zeros((1, 3))) is one
    assert one.confirm(np.zeros((1, 3))) is True
    points = np.arange(6.0).reshape(2, 1, 3)
    for found in (one.judge_frames(points, np.zeros(2, dtype=int)), one.judge_looped(points)):
        np.testing.assert_array_equal(found.value, [[2.0], [5.0]])
    with pytest.raises(NotImplementedError):
        Check().judge(points)


def test_of_two_checks_of_a_place_the_later_one_holds_where_it_is_decided() -> None:
    points = np.zeros((3, 19, 3))
    points[:, 8, 2] = [1.0, 1.0, 3.0]
    points[:, 9, 2] = [0.5, np.nan, np.nan]
    checks = [Height(), Height(points=(9,)), Height(places=(Place(name="other"),), points=(10,), most=0.1)]
    (found,) = judge(checks, points)
    assert found.where == ("wrist", "other") and found.unit == ("m", "m") and found.check == "height"
    np.testing.assert_allclose(found.value, [[0.5, 0.0], [1.0, 0.0], [3.0, 0.0]])
    np.testing.assert_allclose(found.margin, [[1.5, 0.1], [1.0, 0.1], [-1.0, 0.1]])
    assert found.violated.tolist() == [[False, False], [False, False], [True, False]]
    np.testing.assert_allclose(worst_margins(checks, points)["height"], [0.1, 0.1, -1.0])
    assert not (found.by_pairs or found.over_time) and isinstance(found, Judgement)


# --- what is given --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("given_", "postures", "words"), [
    ("text", None, r"postures: not an array of numbers; expected \(N, 14, 3\), metres"),
    (np.zeros((14, 3)), None, r"the shape is \(14, 3\); expected \(N, 14, 3\), metres"),
    (np.zeros((2, 14, 2)), None, r"the shape is \(2, 14, 2\)"),
    (np.zeros((2, 14, 3)), 3, r"the shape is \(2, 14, 3\); expected \(3, 14, 3\)"),
    (np.full((1, 14, 3), 1.1e9), None, r"a coordinate is 1\.1e\+09 m; expected finite ones within 1e\+09 m"),
    (np.full((1, 14, 3), -np.inf), None, "a coordinate is -inf m"),
])  # fmt: skip
def test_points_that_are_none_are_refused(given_: Any, postures: int | None, words: str) -> None:
    with pytest.raises(InputError, match=words):
        points_of("postures", given_, 14, postures)
    far = np.full((2, 14, 3), 1e9)
    assert points_of("postures", far, 14, 2).dtype == np.float64
    assert points_of("postures", np.full((2, 14, 3), np.nan), 14).shape == (2, 14, 3)
    refuse_far(None)


@pytest.mark.parametrize("given_", [[0.0, 1.0], [0], [[0, 1]], ["a", "b"], [True, False]])
def test_a_sequence_is_whole_numbers_one_a_posture(given_: Any) -> None:
    with pytest.raises(InputError, match=r"expected whole numbers \(2,\)"):
        sequence_of(given_, 2)
    assert sequence_of(np.array([3, 1], dtype=np.uint8), 2).tolist() == [3, 1]
    assert sequence_of([3, -1], 2).dtype == np.intp
