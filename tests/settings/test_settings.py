"""Settings are made once, say what is impossible at once, and are read again as they were written."""

import json
import pickle
from typing import Any

import pytest

import posekit
from posekit import RecoverSettings, Tolerance, ValidateSettings
from posekit.errors import InputError
from posekit.settings import (
    EXACT_TOLERANCE,
    MEASURED_TOLERANCE,
    PHOTOGRAPH_TOLERANCE,
    CheckSettings,
    PartialTolerance,
    Rooting,
    Scale,
)
from posekit.validators import load_ranges

CHANGED = {
    "checks": ["rigid-parts", CheckSettings(name="collision", parameters={"margin": 0.01})],
    "ranges": "table1",
    "rules": (3,),
    "walkers": "people",
    "tolerance": Tolerance(rigid=0.02, tangent=0.01, placement=False, angle=3.0, hips=0.5),
    "contact_margin": -0.01,
    "group": 0.05,
    "scale": Scale(how="constraints", weights={"closure": 1.0}),
    "proportions": "taylor",
    "nearer": [{"neck-pelvis": "neck"}],
    "infer": False,
    "rooting": Rooting(method="search", deviation=2.0, trust_head=False),
    "refine": True,
    "length_deviation": 0.02,
    "coverage": 0.9,
}


CHANGED_OF_VALIDATION = {
    **{name: CHANGED[name] for name in ("checks", "ranges", "rules", "walkers", "contact_margin")},
    "rigid_tolerance": 0.01,
    "angle_tolerance": 2.0,
    "noise": 0.005,
    "lengths": "each",
    "strict": True,
    "joint_map": "isb",
    "bodies": "capsules",
    "srdf": "robot.srdf",
    "package_dirs": ("meshes",),
    "untrusted": True,
    "up": (0.0, -1.0, 0.0),
    "profile": "mine.toml",
    "ground": 0.1,
}
ALL_CHANGED = [
    (kind, name, value)
    for kind, changes in ((RecoverSettings, CHANGED), (ValidateSettings, CHANGED_OF_VALIDATION))
    for name, value in changes.items()
]


@pytest.mark.parametrize(("kind", "name", "value"), ALL_CHANGED)
def test_every_setting_is_read_as_it_was_written(kind: Any, name: str, value: Any) -> None:
    settings = kind().changed(**{name: value})
    assert settings != kind()
    assert kind.from_json(json.loads(json.dumps(settings.to_json()))) == settings
    assert pickle.loads(pickle.dumps(settings)) == settings


def test_all_settings_have_a_changed_one() -> None:
    assert set(CHANGED) == set(RecoverSettings().to_json())
    assert set(CHANGED_OF_VALIDATION) == set(ValidateSettings().to_json())


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"lengths": "longer"}, "--lengths: 'longer'; expected one of model, median, each"),
        ({"bodies": "none"}, "--bodies: 'none'; expected one of auto, urdf, visual, capsules"),
        ({"up": [0, 0, 0]}, "up is .*; expected a direction"),
        ({"rigid_tolerance": -1.0}, "the rigid tolerance is -1.0"),
    ],
)
def test_impossible_settings_of_a_validation_are_refused_at_once(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        ValidateSettings.from_json(changes)


@pytest.mark.parametrize(
    "partial", [PartialTolerance(rigid=0.05), PartialTolerance(tangent=0.0, angle=1.0)], ids=str
)
def test_partial_tolerances_are_read_as_they_were_written(partial: PartialTolerance) -> None:
    settings = RecoverSettings(tolerance=partial)
    assert RecoverSettings.from_json(settings.to_json()) == settings


@pytest.mark.parametrize("usual", [MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE])
@pytest.mark.parametrize(
    ("rigid", "tangent", "angle"),
    [(0.02, None, None), (None, 0.003, 4.0), (1e-8, None, None), (0.0, 0.0, 0.0)],
)
def test_gaps_are_filled_from_what_is_usual(
    usual: Tolerance, rigid: float | None, tangent: float | None, angle: float | None
) -> None:
    filled = PartialTolerance(rigid=rigid, tangent=tangent, angle=angle).filled(usual)
    assert filled.rigid == (usual.rigid if rigid is None else rigid)
    assert filled.tangent == (usual.tangent if tangent is None else tangent)
    assert filled.angle == (usual.angle if angle is None else angle)
    assert filled.placement == (filled.rigid <= EXACT_TOLERANCE.rigid)
    assert filled.hips == 1.0


def test_nothing_given_is_no_tolerance() -> None:
    assert PartialTolerance.of(rigid=None, tangent=None, angle=None) is None


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"rules": (9,)}, "--rules: 9 is not a rule"),
        ({"walkers": "x"}, "--walkers: 'x'; expected one of paper, people, paper-printed"),
        ({"group": -1.0}, "--group: -1.0 m"),
        ({"contact_margin": float("nan")}, "the contact margin is nan m"),
        ({"scale": "big"}, "--scale"),
        ({"proportions": "x"}, "--proportions: 'x'; expected figure or taylor"),
        ({"length_deviation": 0.31}, "--length-deviation: 0.31"),
        ({"tolerance": {"rigid": -1.0}}, "--rigid-tolerance"),
        ({"rooting": {"method": "feet"}}, "--root: 'feet'"),
        ({"checks": [3]}, "--checks: 3 is no check"),
        ({"checks": [{"parameters": {}}]}, "is no check; expected its name"),
        ({"speed": 1}, "'speed' is no setting; expected some of checks, ranges"),
        ({"rooting": {"feet": 1}}, "settings: .*feet"),
    ],
)
def test_what_is_impossible_is_refused_at_once(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        RecoverSettings.from_json(changes)
    assert "\n" not in str(caught.value)


def test_parameters_that_no_file_can_hold_are_refused() -> None:
    with pytest.raises(InputError, match="the check mine: its parameters cannot be written as JSON"):
        CheckSettings(name="mine", parameters={"limit": float("inf")})


def test_settings_and_changes_are_the_same_question() -> None:
    view = posekit.builtin_view("seq1")
    settings = RecoverSettings(checks=("rigid-parts", "joint-range"), ranges="table1")
    by_settings = posekit.recover(view, settings)
    by_changes = posekit.recover(view, checks=("rigid-parts", "joint-range"), ranges=load_ranges("table1"))
    by_both = posekit.recover(view, settings.changed(ranges="urdf"), ranges="table1")
    assert by_settings.settings == by_changes.settings == by_both.settings
    assert [one.branches for one in by_settings.frames] == [one.branches for one in by_changes.frames]
    assert RecoverSettings.from_json(by_settings.settings["asked"]) == settings


def test_a_tolerance_that_is_given_is_said_to_be_given() -> None:
    view = posekit.builtin_view("seq1")
    for tolerance in (EXACT_TOLERANCE, MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE):
        recovery = posekit.recover(view, tolerance=tolerance)
        assert {frame.judged for frame in recovery.frames} == {"given"}
        assert {frame.tolerance for frame in recovery.frames} == {tolerance}


def test_validation_takes_settings_and_changes() -> None:
    standing = posekit.load_figure().neutral_points[None, :14]
    strict = ValidateSettings(contact_margin=10.0)
    assert posekit.Validator(settings=strict).check(standing).verdicts == ["invalid"]
    assert posekit.Validator(settings=strict, contact_margin=0.0).check(standing).verdicts == ["valid"]
