"""`posekit validate` on any robot: files of all kinds, exit codes, reports, bad input."""

import csv
import importlib
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.formats.own import read_report, schema
from posekit.formats.own.postures_q import NamedConfigurations, read_configurations, write_configurations
from posekit.robots import load_robot
from posekit.robots.find import find
from posekit.skeleton import JOINTS
from posekit.validation import validate_postures
from posekit.validators import Validator

FIGURE = load_figure()
HUMAN = load_robot("human")
STANDING = FIGURE.neutral_points[None, :14].copy()


@pytest.fixture
def run(run: Callable[..., Any]) -> Callable[..., Any]:
    """Return a way to run the command in this process, in a folder of its own."""
    return partial(run, "validate")


def some_q(count: int = 4) -> np.ndarray:
    """Return neutral configurations of the human, the second with a knee bent the wrong way."""
    q = np.repeat(pin.neutral(HUMAN.model)[None], count, axis=0)
    q[1, HUMAN.configuration_names.index("right_knee_Z")] = np.radians(-20.0)
    return q


# --- joints ---------------------------------------------------------------------------------------------


def test_joints_are_judged_on_a_robot_by_name(run) -> None:
    bent = STANDING.copy()
    bent[0, JOINTS.index("right_ankle")] += [0.30, 0.0, 0.0]  # the shank longer by a third
    np.savez("p.npz", joints=np.concatenate([STANDING, bent, STANDING]))
    outcome = run("p.npz", "--urdf", "human", "-o", "report.json")
    assert "made up: no pair of the robot's own bodies can collide" in outcome.out
    assert (outcome.code, outcome.err) == (1, "")
    assert outcome.out.splitlines()[0] == "3 postures: 2 valid, 1 invalid, 0 undecided"
    assert "rigid-parts/right_knee-right_ankle 1" in outcome.out
    report = read_report("report.json")
    assert [posture.verdict for posture in report.postures] == ["valid", "invalid", "valid"]
    settings = report.settings
    assert settings["robot"] == settings["urdf"] == "human"
    assert settings["bodies"].startswith("made up")
    assert settings["lengths_from"] == "median"
    assert settings["lengths"]["right_knee-right_ankle"] == pytest.approx(0.37)
    first = report.postures[0]
    assert first.residual is not None
    assert set(first.residual) == set(JOINTS)
    assert max(value or 0.0 for value in first.residual.values()) < 1e-3
    assert report.postures[1].worst is not None
    assert report.postures[1].worst.margin < 0


def test_without_a_report_nothing_is_written(run) -> None:
    np.savez("p.npz", joints=STANDING)
    outcome = run("p.npz")
    assert outcome.code == 0
    assert "written" not in outcome.out
    assert [path.name for path in Path().iterdir()] == ["p.npz"]


def test_a_urdf_of_ones_own_is_loaded_in_a_child_first(run) -> None:
    np.savez("p.npz", joints=STANDING)
    Path("mine.urdf").write_text(find("human").urdf.read_text(encoding="utf-8"), encoding="utf-8")
    for trust in ("--untrusted", "--trusted"):
        assert run("p.npz", "--urdf", "mine.urdf", "--joint-map", "human", trust).code == 0


def test_motion_capture_is_read_with_its_clips_and_up(run) -> None:
    names = [name.replace("right_", "r_").replace("left_", "l_") for name in JOINTS]
    turned = STANDING[:, :, [1, 2, 0]]  # y up: forward z, left x
    np.savez(
        "capture.npz",
        joints=np.repeat(turned, 3, axis=0).astype(np.float32),
        joint_names=np.array(names),
        clip=np.array([0, 0, 1]),
        clip_fps=np.array([30.0, 30.0]),
        up=np.array("+y"),
    )
    outcome = run("capture.npz", "--urdf", "human", "--sequence", "--checks", "reach,joint-range,balance")
    assert outcome.code == 0, outcome
    assert run("capture.npz", "--urdf", "human", "--checks", "balance", "--up", "+x").code == 1
    assert run("capture.npz", "--lengths", "median").code == 0


# --- configurations -------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_configurations_are_taken_as_they_are(run, suffix: str) -> None:
    write_configurations(f"q.{suffix}", some_q(), HUMAN.configuration_names)
    outcome = run(f"q.{suffix}", "--urdf", "human", "-o", "report.json")
    assert outcome.code == 1
    assert outcome.out.splitlines()[0] == "4 postures: 3 valid, 1 invalid, 0 undecided"
    assert "joint-range/right_knee_Z 1" in outcome.out
    report = read_report("report.json")
    assert report.settings["checks"] == ["joint-range", "collision"]
    worst = report.postures[1].worst
    assert worst is not None
    assert (worst.check, worst.where, worst.unit) == ("joint_range", "right_knee_Z", "deg")
    assert worst.margin == pytest.approx(-20.0)
    nearest = [one for one in report.postures[0].findings if one.check == "collision"]
    assert len(nearest) == 1
    assert nearest[0].verdict == "valid"
    assert (nearest[0].value or 0.0) > 0


def test_names_bring_them_into_the_robots_order() -> None:
    order = np.random.default_rng(0).permutation(HUMAN.model.nq)
    names = tuple(HUMAN.configuration_names[k] for k in order)
    mixed = NamedConfigurations(q=some_q()[:, order], names=names)
    np.testing.assert_array_equal(mixed.in_order_of(HUMAN.configuration_names), some_q())


def test_a_root_that_is_left_out_stands_at_the_origin() -> None:
    for names in (None, HUMAN.configuration_names[7:]):
        short = NamedConfigurations(q=some_q()[:, 7:], names=names)
        np.testing.assert_array_equal(short.in_order_of(HUMAN.configuration_names), some_q())


def test_configurations_of_another_robot_ask_for_its_urdf(run) -> None:
    write_configurations("q.npz", some_q(), HUMAN.configuration_names)
    outcome = run("q.npz")
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1
    assert "q.npz: configuration_names: got" in outcome.err
    assert "say which robot it is, as posekit validate --urdf FILE|NAME" in outcome.err


def test_a_plain_array_named_q_will_do(run) -> None:
    np.savez("q.npz", q=some_q()[:1].astype(np.float32))
    assert run("q.npz", "--urdf", "human").code == 0
    np.savez("f.npz", q=pin.neutral(FIGURE.model)[None])
    assert run("f.npz").code == 0
    assert run("f.npz", "--checks", "joint-range", "--ranges", "table1").code == 0


def test_ranges_by_the_robots_own_names(run) -> None:
    np.savez("q.npz", q=some_q())
    text = 'schema = "posekit.ranges/1"\nkind = "joints"\n[limits]\nright_knee_Z = [-30.0, 100.0]\n'
    Path("wide.toml").write_text(text, encoding="utf-8")
    assert run("q.npz", "--urdf", "human", "--checks", "joint-range").code == 1
    assert run("q.npz", "--urdf", "human", "--checks", "joint-range", "--ranges", "wide.toml").code == 0


@pytest.mark.parametrize(
    ("arrays", "parts"),
    [
        ({"q": np.zeros((1, 5))}, ("q.npz: q: got 5 variables; expected 43",)),
        ({"q": np.zeros(43)}, ("q.npz: q: got shape",)),
        ({"q": np.zeros((1, 43))}, ("q.npz", "quaternion", "length 0")),
        ({"q": np.full((1, 43), np.inf)}, ("q.npz: q[0, 0]: got an infinite number",)),
        ({"q": np.array([["a"]])}, ("q.npz: q",)),
        ({"q": np.zeros((0, 43))}, ("it holds no posture",)),
        (
            {"q": np.zeros((1, 2)), "configuration_names": np.array(["a"])},
            ("configuration_names: got 1 names",),
        ),
        ({"q": np.zeros((1, 2)), "configuration_names": np.array(["a", "a"])}, ("a name twice",)),
        (
            {"q": np.zeros((1, 1)), "configuration_names": np.array(["right_knee"])},
            ("configuration_names", "did you mean", "right_knee_Z"),
        ),
        (
            {"q": np.zeros((1, 1)), "configuration_names": np.array(["right_knee_Z"])},
            ("every variable of the robot", "left_hip_Z"),
        ),
    ],
)
def test_bad_configurations_are_refused(
    run, arrays: dict[str, np.ndarray], parts: tuple[str, ...], assert_refused
) -> None:
    np.savez("q.npz", **arrays)  # type: ignore[arg-type]
    assert_refused(run("q.npz", "--urdf", "human", "-o", "r.json"), *parts)
    assert [path.name for path in Path().iterdir()] == ["q.npz"]


@pytest.mark.parametrize(
    ("document", "parts"),
    [
        ({"q": [[0.0], [0.0, 1.0]]}, ("q[1]: got 2 numbers; expected 1",)),
        ({"q": [["a"]]}, ("q[0][0]", "a number")),
        ({"q": [[None]]}, ("q[0][0]",)),
        ({"postures": []}, ("q",)),
        ({"q": [[0.0]], "extra": 1}, ("extra",)),
    ],
)
def test_json_that_breaks_the_schema_is_refused(
    run, document: dict[str, Any], parts: tuple[str, ...], assert_refused
) -> None:
    text = json.dumps({"schema": "posekit.configurations/1", **document})
    Path("q.json").write_text(text, encoding="utf-8")
    assert_refused(run("q.json", "--urdf", "human"), *parts)


def test_configurations_are_read_back(tmp_path: Path) -> None:
    for suffix in ("json", "npz"):
        write_configurations(tmp_path / f"q.{suffix}", some_q(), HUMAN.configuration_names)
        back = read_configurations(tmp_path / f"q.{suffix}")
        np.testing.assert_array_equal(back.q, some_q())
        assert back.names == HUMAN.configuration_names


# --- exit codes -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("allowed", "code"), [("0", 1), ("1", 0), ("25%", 0), ("24.9%", 1), ("100%", 0), ("0%", 1), ("4", 0)]
)
def test_some_may_be_not_valid(run, allowed: str, code: int) -> None:
    np.savez("q.npz", q=some_q())
    outcome = run("q.npz", "--urdf", "human", "--checks", "joint-range", "--fail-over", allowed)
    assert outcome.code == code


def test_undecided_counts_as_not_valid(run) -> None:
    joints = np.repeat(STANDING, 2, axis=0)
    joints[1, 3] = np.nan
    np.savez("p.npz", joints=joints)
    outcome = run("p.npz")
    assert outcome.code == 1
    assert "joints are missing in 1 posture: undecided, where nothing is found" in outcome.out
    assert run("p.npz", "--fail-over", "1").code == 0


# --- reports --------------------------------------------------------------------------------------------


def test_csv_has_one_row_a_posture(run) -> None:
    np.savez("q.npz", q=some_q())
    assert run("q.npz", "--urdf", "human", "-o", "r.csv").code == 1
    with Path("r.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["posture"] for row in rows] == ["0", "1", "2", "3"]
    assert [row["verdict"] for row in rows] == ["valid", "invalid", "valid", "valid"]
    assert rows[1]["violations"] == "joint_range/right_knee_Z=-20 deg (0)"
    assert (rows[1]["worst_margin"], rows[1]["unit"], rows[1]["where"]) == ("-20", "deg", "right_knee_Z")


def test_markdown_has_tables_and_settings(run) -> None:
    np.savez("q.npz", q=some_q())
    assert run("q.npz", "--urdf", "human", "-o", "r.md").code == 1
    text = Path("r.md").read_text(encoding="utf-8")
    assert text.startswith("# Validation\n")
    assert "| 1       | invalid | joint-range/right_knee_Z -20 deg (bound 0) |" in text
    assert "- robot: human" in text
    assert "made up" in text


def test_json_keeps_its_schema(run) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    np.savez("q.npz", q=some_q())
    assert run("q.npz", "--urdf", "human", "-o", "r.json").code == 1
    document = json.loads(Path("r.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema("report")).validate(document)
    assert document["summary"] == {"valid": 3, "invalid": 1, "undecided": 0}
    assert document["checks"]["joint_range"]["places"] == {"right_knee_Z": 1}
    assert "verdicts" not in document


def test_a_large_file_is_judged_in_batches_and_listed_in_part(run, monkeypatch: pytest.MonkeyPatch) -> None:
    """With small bounds: the same verdicts as at once, those not valid listed with their numbers, up to the cap."""
    module = importlib.import_module("posekit.validation.batches")
    rng = np.random.default_rng(1)
    q = np.repeat(pin.neutral(HUMAN.model)[None], 120, axis=0)
    q[:, 7:] = rng.uniform(HUMAN.lower[7:], HUMAN.upper[7:], (120, 36))
    np.savez("q.npz", q=q)
    at_once = Validator(HUMAN, checks=("joint-range", "collision")).check(q=q)
    run("q.npz", "--urdf", "human", "-o", "whole.csv")
    monkeypatch.setattr(module, "POSTURES_AT_ONCE", 32)
    monkeypatch.setattr(importlib.import_module("posekit.validation.judging"), "MAX_LISTED", 20)
    outcome = run("q.npz", "--urdf", "human", "-o", "r.json")
    report = read_report("r.json")
    bad = np.flatnonzero(at_once.invalid)
    assert len(bad) > 20
    assert report.verdicts == "".join(verdict[0] for verdict in at_once.verdicts)
    assert report.summary["invalid"] == len(bad)
    assert [posture.index for posture in report.postures] == bad[:20].tolist()
    assert report.listed == f"the first 20 of {len(bad)} that are not valid"
    assert f"{len(bad)} invalid" in outcome.out
    run("q.npz", "--urdf", "human", "-o", "parts.csv")
    assert Path("parts.csv").read_text(encoding="utf-8") == Path("whole.csv").read_text(encoding="utf-8")


def test_the_lengths_are_those_of_the_whole_file(monkeypatch: pytest.MonkeyPatch) -> None:
    files = importlib.import_module("posekit.formats.own")
    module = importlib.import_module("posekit.validation.batches")
    joints = np.concatenate([STANDING * scale for scale in (0.99, 1.0, 1.0, 1.01)])
    whole = validate_postures(Validator(HUMAN), files.Postures(joints=joints))
    monkeypatch.setattr(module, "POSTURES_AT_ONCE", 1)
    parts = validate_postures(Validator(HUMAN), files.Postures(joints=joints))
    assert whole.settings == parts.settings
    for a, b in zip(whole.postures, parts.postures, strict=True):
        assert a.verdict == b.verdict
        assert a.fk_distance == pytest.approx(b.fk_distance, abs=1e-5)


# --- bad options ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("--urdf", "humna"), ("--urdf humna: no such file or robot",)),
        (("--urdf", "human", "--checks", "walking"), ("'walking' is not a check of robots",)),
        (("--urdf", "human", "--ranges", "table1"), ("--ranges table1", "stick figure")),
        (("--urdf", "human", "--lengths", "mean"), ("--lengths: 'mean'",)),
        (("--urdf", "human", "--bodies", "flesh"), ("--bodies: 'flesh'",)),
        (("--urdf", "human", "--joint-map", "nobody"), ('got "nobody"',)),
        (("--urdf", "human", "--srdf", "none.srdf"), ("none.srdf",)),
        (("--urdf", "talos", "--package-dir", "nowhere"), ("nowhere",)),
        (("--urdf", "panda"), ("no built-in joint map fits",)),
        (("--up", "north"), ("--up: 'north'",)),
        (("--fail-over", "1.5"), ("--fail-over: '1.5'",)),
        (("--fail-over", "101%"), ("--fail-over: '101%'",)),
        (("--fail-over", "nan"), ("--fail-over: 'nan'",)),
        (("--fail-over", "-1"), ("--fail-over: '-1'",)),
        (("--joint-map", "human"), ("--joint-map human", "stick figure")),
        (("-o", "r.txt"), ('r.txt: got the suffix ".txt"; expected .json or .md or .csv',)),
        (("-o", "nowhere/r.json"), ("nowhere/r.json",)),
    ],
)
def test_a_bad_option_is_refused(
    run, options: tuple[str, ...], parts: tuple[str, ...], assert_refused
) -> None:
    np.savez("p.npz", joints=STANDING)
    assert_refused(run("p.npz", *options), *parts)
    assert [path.name for path in Path().iterdir()] == ["p.npz"]
