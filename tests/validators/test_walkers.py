"""Whose thresholds the rules of walking have: the paper's by default, people's where they are asked for."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.batch import Recipe
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.evaluate import Method
from posekit.formats import own as files
from posekit.formats.own import View
from posekit.recovery import recover
from posekit.recovery.recovered import recovered_with
from posekit.recovery.result import result_of
from posekit.settings import RecoverSettings, ValidateSettings
from posekit.skeleton import DOFS
from posekit.synthesis import SyntheticScene, random_views
from posekit.validators import PHYSICAL_CHECKS, Validator, make_checks
from posekit.validators.joint_range import joint_range
from posekit.validators.ranges import URDF_RANGES
from posekit.validators.walking import (
    PEOPLE_THRESHOLDS,
    THRESHOLDS_BY_WALKERS,
    WalkingThresholds,
    thresholds_of,
)
from posekit.views.builtin import view_of

FIGURE = load_figure()
ALL = (*PHYSICAL_CHECKS, "walking")


def passing() -> SyntheticScene:
    """Return a person one of whose legs passes the other: both knees are a little in front, as people have them."""
    scene = random_views(FIGURE, 1, np.random.default_rng(2))
    q = np.array(FIGURE.configurations(FIGURE.neutral_points[None]).q)
    for side, degrees in (("right", 25.0), ("left", 12.0)):
        q[0, FIGURE.angle_index[DOFS.index(f"{side}_hip.flexion")]] = np.radians(degrees)
        q[0, FIGURE.angle_index[DOFS.index(f"{side}_knee.flexion")]] = np.radians(30.0)
    points = (
        FIGURE.forward_kinematics(q) @ np.array([[0.4, -0.916515139, 0], [0, 0, -1], [0.916515139, 0.4, 0]]).T
    )
    points[..., 2] += 4.0
    image = scene.camera.project(points)
    return replace(scene, joints_cam=points[:, :14], image=image[:, :14], head_image=image[:, 14:])


@pytest.fixture(scope="module")
def view() -> View:
    return view_of(passing())


def has_truth(recovery: Any, view: View) -> bool:
    off = np.linalg.norm(recovery.frames[0].joints - view.truth[0], axis=2).max(axis=1)
    return bool((off < 1e-6).any())


def test_names_stand_for_thresholds() -> None:
    assert dict(THRESHOLDS_BY_WALKERS) == {
        "paper": WalkingThresholds(),
        "people": PEOPLE_THRESHOLDS,
        "paper-printed": WalkingThresholds(printed=True),
    }
    assert thresholds_of("people") is PEOPLE_THRESHOLDS
    with pytest.raises(InputError, match="--walkers: 'giants'; expected one of paper, people, paper-printed"):
        thresholds_of("giants")


def test_people_are_recovered_where_the_papers_rules_kill_them(view: View) -> None:
    assert has_truth(recover(view), view)
    by_word, as_people = (recover(view, checks=ALL, rules=(1,), walkers=name) for name in ("paper", "people"))
    assert not has_truth(by_word, view)
    assert has_truth(as_people, view)
    assert by_word.settings["walkers"] == "paper"
    assert as_people.settings["walkers"] == "people"
    default = recover(view, checks=ALL, rules=(1,))
    assert default.settings["walkers"] == "paper"
    np.testing.assert_array_equal(default.frames[0].joints, by_word.frames[0].joints)


def test_every_way_to_ask_means_the_same(view: View) -> None:
    expected = recover(view, checks=ALL, rules=(1,), walkers="people").frames[0].joints
    settings = RecoverSettings(checks=ALL, rules=(1,), walkers="people")
    recipe = Recipe(settings=settings)
    np.testing.assert_array_equal(recover(view, recipe.settings).frames[0].joints, expected)
    assert recipe.document()["walkers"] == "people"  # a batch of other thresholds is another batch
    method = Method(settings=settings)
    np.testing.assert_array_equal(method.recover(view)[0].joints, expected)
    assert method.document()["walkers"] == "people"
    verdicts = {name: Validator(checks=ALL, rules=(1,), walkers=name) for name in THRESHOLDS_BY_WALKERS}
    assert verdicts["people"].check(view.truth).verdicts == ["undecided"]  # no swing is large enough to say
    assert verdicts["paper"].check(view.truth).verdicts == ["invalid"]
    own = [
        check.thresholds.knee_swing
        for check in make_checks(
            FIGURE, ("walking",), ranges=URDF_RANGES, rigid_tolerance=0.0, thresholds=PEOPLE_THRESHOLDS
        )
        if hasattr(check, "thresholds")
    ]
    assert set(own) == {PEOPLE_THRESHOLDS.knee_swing}


@pytest.mark.parametrize(
    "made",
    [
        lambda: RecoverSettings(walkers="x"),
        lambda: ValidateSettings(walkers="x"),
        lambda: Validator(walkers="x"),
    ],
)
def test_other_names_are_refused_at_once(made: Callable[[], object]) -> None:
    with pytest.raises(InputError, match="--walkers: 'x'; expected one of paper, people, paper-printed"):
        made()


def test_the_command_line_takes_them(
    view: View, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Callable[..., Any]
) -> None:
    monkeypatch.chdir(tmp_path)
    files.write_view("view.json", view)
    walking = ("--checks", ",".join(ALL), "--rules", "1")
    assert command("recover", "view.json", "-o", "r.json", *walking, "--walkers", "people").code == 0
    assert files.read_result("r.json").settings["walkers"] == "people"
    # Its survivors are judged as they were recovered, unless others are asked for.
    command("validate", "r.json", "-o", "v.json", *walking)
    own = json.loads(Path("v.json").read_text(encoding="utf-8"))
    assert own["settings"]["walkers"] == "people"
    assert own["summary"]["invalid"] == 0
    command("validate", "r.json", "-o", "v.json", *walking, "--walkers", "paper")
    assert json.loads(Path("v.json").read_text(encoding="utf-8"))["summary"]["invalid"] > 0
    for words in (
        ("recover", "view.json", "-o", "x.json"),
        ("validate", "r.json", "-o", "x.json"),
        ("evaluate", "view.json", "-o", "x.json"),
        ("batch", "view.json", "-o", "x"),
    ):
        refused = command(*words, "--walkers", "giants")
        assert refused.code == 2
        assert "--walkers: 'giants'; expected one of paper, people, paper-printed" in refused.err
    assert command("evaluate", "view.json", "-o", "e.json", *walking, "--walkers", "people").code == 0
    assert json.loads(Path("e.json").read_text(encoding="utf-8"))["all"]["retained_within_35mm"] == 1.0


# --- what a result says that it was judged with ------------------------------------------------------------


def test_a_result_says_what_its_frames_were_judged_with() -> None:
    scene = random_views(FIGURE, 3, np.random.default_rng(0))
    exact = result_of(recover(view_of(scene), contact_margin=0.01))
    told = recovered_with(exact).settings
    assert told.rigid_tolerance == 0.03
    assert told.angle_tolerance == pytest.approx(1e-3)
    assert (told.contact_margin, told.walkers) == (0.01, "paper")
    noisy = view_of(scene.with_noise(2.0, np.random.default_rng(1)))
    noisy = replace(noisy, deviation=2.0, root=scene.joints_cam[:, 0])
    refined = result_of(recover(noisy, contact_margin=-0.01, length_deviation=0.0))
    assert refined.settings["refined"]["contact"] == pytest.approx(-0.04)
    told = recovered_with(refined).settings
    assert told.contact_margin == pytest.approx(-0.04)
    assert told.angle_tolerance == refined.settings["refined"]["angle"]
    older = replace(refined, settings={**refined.settings, "refined": {"angle": 14.0}})
    assert recovered_with(older).settings.contact_margin == -0.01
    uncertain = result_of(recover(noisy, length_deviation=0.05))
    assert (
        recovered_with(uncertain).settings.rigid_tolerance
        == uncertain.settings["refined"]["rigid"]
        == pytest.approx(3 * np.sqrt(2 * 0.05**2 + 0.027**2) * max(scene.figure.lengths.values()))
    )


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"contact_margin": "1cm"}, r"settings\.contact_margin: got '1cm'"),
        ({"contact_margin": True}, r"settings\.contact_margin: got True"),
        ({"walkers": ["people"]}, r"settings\.walkers: got \['people'\]"),
        ({"judged": ["refined", []], "refined": {"contact": "x"}}, r"settings\.refined\.contact: got 'x'"),
        ({"judged": ["refined"], "refined": {"angle": None}}, r"settings\.refined\.angle: got None"),
        ({"judged": ["given"], "tolerance": {"angle": float("nan")}}, r"settings\.tolerance\.angle: got nan"),
    ],
)
def test_settings_that_say_no_number_are_refused(view: View, changed: dict[str, Any], said: str) -> None:
    result = result_of(recover(view))
    with pytest.raises(InputError, match=said):
        recovered_with(replace(result, settings={**result.settings, **changed}))


def test_an_arm_may_be_turned_as_far_as_its_direction_may() -> None:
    """Flexion turns an arm that is not across its axis by less than a direction: so much more may it be off."""
    q = np.array(FIGURE.configurations(FIGURE.neutral_points[None]).q)
    row = {
        name: FIGURE.angle_index[DOFS.index(f"right_shoulder.{name}")] for name in ("flexion", "abduction")
    }
    q[0, row["abduction"]], q[0, row["flexion"]] = np.radians([-45.0, -58.0])  # 8 degrees outside
    points = FIGURE.forward_kinematics(q)
    off = float(
        np.degrees(2 * np.arcsin(np.sin(np.radians(4.0)) * np.cos(np.radians(45.0))))
    )  # of the direction
    assert 5.5 < off < 5.7
    for directions, tolerance, expected in (
        (False, 7.9, True),
        (False, 8.1, False),
        (True, 0.9 * off, True),
        (True, 1.1 * off, False),
    ):
        checks = joint_range(FIGURE, tolerance=tolerance, directions=directions)
        (arm,) = (
            check
            for check in checks
            if check.where[:1] == ("right_shoulder.flexion",) and len(check.where) == 2
        )
        assert bool(arm.judge(points[:, list(arm.points)]).violated.any()) is expected
