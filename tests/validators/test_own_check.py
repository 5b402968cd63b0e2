"""A check of one's own: asked wherever posekit's are, given as an object, by its class, or by an entry point."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.batch import Recipe, Workers, read_frames, run_batch, write_view_table
from posekit.body import load_figure
from posekit.compiled import compiling
from posekit.errors import InputError
from posekit.formats.own import read_report, read_result
from posekit.settings import CheckSettings, RecoverSettings
from posekit.skeleton import JOINT
from posekit.synthesis import random_views
from posekit.tree import given_check
from posekit.validators import (
    Check,
    Findings,
    Loosening,
    Place,
    Scope,
    Validator,
    chosen_checks,
    joint_range,
    load_ranges,
    make_checks,
)
from posekit.views.builtin import view_of

FIGURE = load_figure()
EXAMPLES = Path(__file__).parents[2] / "examples"
PHYSICAL = ("rigid-parts", "joint-range", "collision")
VIEW = posekit.builtin_view("seq1")
LOW = -0.78
"""Metres: ground under the camera that some of the view's feet are below."""

ENTRY_POINTS = """[posekit.checks]
feet-above-ground = own_check:FeetAboveGround
standing = making_checks:standing
"""
MAKING = """
from own_check import FeetAboveGround

def standing(figure, depth=5.0):
    return [FeetAboveGround(ground=-figure.neutral_points[0, 2] - depth)]
"""


@pytest.fixture
def feet(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The class of the example, imported as a module of its own."""
    monkeypatch.syspath_prepend(EXAMPLES)
    import own_check  # type: ignore[import-not-found]

    return own_check.FeetAboveGround


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put the example, and a function that makes it, where every process finds both, under names of entry points."""
    place = tmp_path / "site"
    (place / "feet-1.0.dist-info").mkdir(parents=True)
    (place / "feet-1.0.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: feet\nVersion: 1.0\n"
    )
    (place / "feet-1.0.dist-info" / "entry_points.txt").write_text(ENTRY_POINTS)
    (place / "own_check.py").write_text((EXAMPLES / "own_check.py").read_text())
    (place / "making_checks.py").write_text(MAKING)
    monkeypatch.syspath_prepend(place)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(place), os.environ.get("PYTHONPATH", "")]))
    return place


@dataclass(frozen=True, kw_only=True)
class FarHands(Check):
    """Hands and feet are apart: it reads four limbs."""

    least: float = 0.3
    name = "far_hands"
    unit = "m"
    places = (Place(name="hands"), Place(name="feet"))
    points = tuple(JOINT[name] for name in ("right_wrist", "left_wrist", "right_ankle", "left_ankle"))

    def judge(self, points: np.ndarray) -> Findings:
        apart = np.linalg.norm(points[:, 0::2] - points[:, 1::2], axis=-1)
        return Findings(value=apart, lower=np.full(2, self.least), upper=np.full(2, np.inf))


def heights(joints: np.ndarray) -> np.ndarray:
    return np.asarray(-joints[:, [JOINT["right_ankle"], JOINT["left_ankle"]], 1].max(axis=1))


def test_the_example_runs() -> None:
    run = subprocess.run(
        [sys.executable, EXAMPLES / "own_check.py"], capture_output=True, text=True, check=True
    )
    assert "frame 1: 24 postures, 12 with feet above the ground; 12 leaves were rejected" in run.stdout


@pytest.mark.parametrize("path", ["plain", "fast"])
def test_it_prunes_the_tree_and_is_counted(feet: Any, path: Any) -> None:
    without = posekit.recover(VIEW, checks=PHYSICAL)
    with compiling.path(path):
        found = posekit.recover(VIEW, checks=[*PHYSICAL, feet(ground=LOW)])
    for before, after in zip(without.frames, found.frames, strict=True):
        legal = heights(before.joints) >= LOW - 0.01
        np.testing.assert_array_equal(after.joints, before.joints[legal])
        lost = sum(
            count for reason, count in after.rejected.items() if reason.startswith("feet_above_ground/")
        )
        assert (lost > 0) == (not legal.all())
        assert len(after) + sum(after.rejected.values()) == 8192
        np.testing.assert_allclose(
            after.margins["feet_above_ground"], heights(after.joints) - LOW, atol=1e-12
        )


def test_it_is_asked_as_soon_as_its_points_are_known(feet: Any) -> None:
    grown = posekit.recover(VIEW, checks=[feet(ground=5.0)]).frames[0]
    assert {branch.joint for branch in grown.pruned() if branch.reason.startswith("feet")} == {"left_ankle"}


def test_one_of_four_limbs_judges_whole_bodies() -> None:
    before, after = (
        posekit.recover(VIEW, checks=checks).frames
        for checks in (PHYSICAL, [*PHYSICAL, FarHands(least=0.45)])
    )
    for one, other in zip(before, after, strict=True):
        joints = one.joints
        hands = np.linalg.norm(joints[:, JOINT["right_wrist"]] - joints[:, JOINT["left_wrist"]], axis=1)
        ankles = np.linalg.norm(joints[:, JOINT["right_ankle"]] - joints[:, JOINT["left_ankle"]], axis=1)
        np.testing.assert_array_equal(other.joints, joints[np.minimum(hands, ankles) >= 0.45])
    assert sum(map(len, after)) < sum(map(len, before))


def noisy_view() -> Any:
    view = view_of(random_views(FIGURE, 4, np.random.default_rng(3)))
    noise = np.random.default_rng(0).normal(size=view.image.shape)
    root = random_views(FIGURE, 4, np.random.default_rng(3)).joints_cam[:, 0]
    return replace(
        view,
        image=view.image + noise,
        head_image=np.full_like(view.head_image, np.nan),
        root=root,
        deviation=1.0,
    )


@pytest.mark.parametrize("noise", [Loosening.TOLERANCE, Loosening.REFINED])
def test_refined_postures_are_certified_by_it(
    feet: Any, noise: Loosening, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feet, "noise", noise)
    view = noisy_view()
    ground = float(np.median(np.concatenate([heights(f.joints) for f in posekit.recover(view).frames])))
    found = posekit.recover(view, checks=[*PHYSICAL, feet(ground=ground), FarHands(least=0.2)])
    assert {frame.judged for frame in found.frames} == {"refined"}
    assert sum(map(len, found.frames))
    for frame in found.frames:
        assert (heights(frame.joints) >= ground - 0.01).all()
        assert (frame.margins["far_hands"] >= 0.0).all()
    reasons = {reason for frame in found.frames for reason in frame.rejected}
    assert any(reason.startswith("feet_above_ground/") for reason in reasons)


def test_what_is_asked_of_refined_postures_alone_loses_none_that_passes(feet: Any) -> None:
    view = noisy_view()
    before = posekit.recover(view, coverage=1.0)
    ground = float(np.median(np.concatenate([heights(frame.joints) for frame in before.frames])))
    after = posekit.recover(view, checks=[*PHYSICAL, feet(ground=ground)], coverage=1.0)
    for one, other in zip(before.frames, after.frames, strict=True):
        assert (heights(one.joints) >= ground - 0.01).sum() <= len(other)


def test_hidden_joints_are_put_where_it_allows() -> None:
    view = view_of(random_views(FIGURE, 3, np.random.default_rng(5)))
    image = view.image.copy()
    image[:, [JOINT["left_wrist"], JOINT["right_ankle"]]] = np.nan
    found = posekit.recover(replace(view, image=image), checks=[*PHYSICAL, FarHands(least=0.6)])
    joints = np.concatenate([frame.joints for frame in found.frames])
    margins = np.concatenate([frame.margins["far_hands"] for frame in found.frames])
    known = np.isfinite(joints).all(axis=(1, 2))
    assert known.sum() > len(known) / 2
    assert (margins[known] >= 0.0).all()


def test_whole_postures_and_configurations_are_validated_by_it(feet: Any) -> None:
    standing = FIGURE.neutral_points[:14].copy()
    low = float(standing[[12, 13], 2].min())
    validator = Validator(checks=["collision", feet(ground=low)])
    report = validator.check(np.stack([standing, standing - [0, 0, 0.02]]))
    assert report.verdicts == ["valid", "invalid"]
    (q,) = report.q[:1]
    moved = q.copy()
    moved[2] -= 0.02
    by_q = validator.check(q=np.stack([q, moved]))
    assert by_q.verdicts == ["valid", "invalid"]
    assert [one.check for one in by_q.judgements] == ["collision", "feet_above_ground"]
    below = Validator(checks=[feet(ground=0.78)], up=(0.0, -1.0, 0.0)).check(standing[None] * [1, -1, -1])
    assert below.judgements[0].violated.all()


def test_the_command_line_takes_names_of_entry_points(
    installed: Path, tmp_path: Path, command: Callable[..., Any]
) -> None:
    out = tmp_path / "out.json"
    given = command("synth", "walker", "-o", tmp_path / "walk.json")
    assert given.code == 0
    names = "rigid-parts,joint-range,standing"
    done = command("recover", tmp_path / "walk.json", "-o", out, "--checks", names)
    assert done.code == 0, done.err
    result = read_result(out)
    assert "feet_above_ground" in json.loads(out.read_text())["frames"][0]["postures"][0]["margins"]
    assert result.settings["checks"] == ["rigid-parts", "joint-range", "standing"]
    archive = tmp_path / "out.npz"
    assert command("recover", tmp_path / "walk.json", "-o", archive, "--checks", names).code == 0
    assert "feet_above_ground" in read_result(archive).frames[0].margins
    report = tmp_path / "report.json"
    done = command("validate", out, "-o", report, "--checks", "collision,feet-above-ground")
    assert done.code in (0, 1), done.err
    assert "feet_above_ground" in (read_report(report).checks or {})
    wrong = command("recover", tmp_path / "walk.json", "-o", out, "--checks", "feet")
    assert wrong.code == 2
    assert (
        "'feet' is not a check; expected some of rigid-parts, joint-range, collision, walking, feet-above"
        in wrong.err
    )


@pytest.mark.parametrize("name", ["feet-above-ground", "object"])
def test_workers_make_it_from_its_settings(installed: Path, tmp_path: Path, feet: Any, name: str) -> None:
    write_view_table(tmp_path / "views.parquet", view_of(random_views(FIGURE, 6, np.random.default_rng(0))))
    own = name if name != "object" else feet(ground=-0.3)
    settings = RecoverSettings(checks=("rigid-parts", own))
    recipe = Recipe(settings=settings, shard_frames=3, rank=False, margins=True)
    summary = run_batch([tmp_path / "views.parquet"], tmp_path / "run", recipe, Workers(jobs=2))
    assert not summary.failures
    rows = list(read_frames(tmp_path / "run"))
    assert sum(len(table) for table in rows) == 6
    rejected = {
        reason for table in rows for one in table.column("rejected").to_pylist() for reason in json.loads(one)
    }
    assert any(reason.startswith("feet_above_ground/") for reason in rejected)


def test_settings_record_its_class_and_what_is_not_default(feet: Any) -> None:
    assert FarHands().settings == CheckSettings(name=f"{__name__}:FarHands")
    settings = feet(ground=-1.5).settings
    assert settings == CheckSettings(name="own_check:FeetAboveGround", parameters={"ground": -1.5})
    again = make_checks(FIGURE, [replace(settings, parameters={"ground": -1.25})], up=(0.0, -1.0, 0.0))
    assert again == [feet(ground=-1.25, up=(0.0, -1.0, 0.0))]
    assert chosen_checks([feet(), "collision", "rigid-parts", feet()]) == (
        CheckSettings(name="rigid-parts"),
        CheckSettings(name="collision"),
        CheckSettings(name="own_check:FeetAboveGround"),
    )
    here = FarHands(least=0.12)
    assert given_check(here.settings) is here


def test_a_check_that_comes_with_posekit_takes_parameters() -> None:
    narrow = CheckSettings(name="joint-range", parameters={"ranges": "table1"})
    made = make_checks(FIGURE, [narrow])
    assert [type(check) for check in made] == [
        type(check) for check in joint_range(FIGURE, load_ranges("table1"))
    ]
    with pytest.raises(
        InputError, match="collision has no parameter 'margin'; expected some of angle_tolerance"
    ):
        make_checks(FIGURE, [CheckSettings(name="collision", parameters={"margin": 0.1})])


@dataclass(frozen=True, kw_only=True)
class Wrong(Check):
    """A check that can be wrong in every way."""

    name: str = "wrong"
    unit: str = "m"
    places: tuple[Place, ...] = (Place(name="here"),)
    points: tuple[int, ...] = (0,)
    value: np.ndarray = field(default_factory=lambda: np.zeros((2, 1)))
    scope = Scope.POSTURE

    def judge(self, points: np.ndarray) -> Findings:
        return Findings(value=self.value, lower=np.array([0.0]), upper=np.array([1.0]))


@pytest.mark.parametrize(
    ("check", "message"),
    [
        (
            Wrong(points=(19,)),
            r"wrong: expected at least one place and one point, .* 0 to 18; it reads \[19\]",
        ),
        (Wrong(points=()), "at least one place and one point"),
        (Wrong(places=()), "at least one place and one point"),
        (Wrong(name="a/b"), "'a/b' is no name of a check"),
        (
            Wrong(value=np.zeros(2)),
            r"judge returns a value of shape \(2,\) for two postures; expected \(2, 1\)",
        ),
        (Wrong(value=np.full((2, 1), 2.0)), "it rejects a posture none of whose points is known"),
        (
            "no.such.module:Feet",
            "cannot be imported .*; expected a class in a module that every process finds",
        ),
        ("posekit.skeleton:Feet", "cannot be imported"),
        ("posekit.skeleton:segment_name", "makes no check"),
        ("feet", "'feet' is not a check; expected some of rigid-parts"),
        (3, "3 is no check"),
    ],
)
def test_what_is_no_check_is_refused_before_anything_is_grown(check: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        posekit.recover(VIEW, checks=["rigid-parts", check])
    with pytest.raises(InputError, match=message):
        Validator(checks=[check])


def test_a_class_whose_parameters_are_other_ones_is_named(feet: Any) -> None:
    settings = CheckSettings(name="own_check:FeetAboveGround", parameters={"floor": 1.0})
    with pytest.raises(InputError, match=r"own_check:FeetAboveGround: it cannot be made: .*'floor'"):
        make_checks(FIGURE, [settings])
