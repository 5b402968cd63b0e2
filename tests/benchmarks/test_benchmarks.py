"""The report of the benchmarks runs, at sizes whose numbers mean nothing, and its gate says what fell."""

import importlib
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch):
    """Import from the folder of benchmarks, which is not installed."""
    monkeypatch.syspath_prepend(str(ROOT))

    def one(name: str) -> ModuleType:
        return importlib.import_module(name)

    return one


def small(load, monkeypatch: pytest.MonkeyPatch):
    """Return `main` without the slow witnesses: engines that are not needed, and real starts."""
    process, lifter = load("benchmarks.comparison.process"), load("benchmarks.comparison.lifter")
    monkeypatch.setattr(process, "START_COMMANDS", {"python -c pass": "pass", "import": "import posekit"})
    monkeypatch.setattr(process, "GROW_CODE", "print({views})")
    monkeypatch.setattr(lifter, "util", _Without("torch", lifter.util))
    monkeypatch.setattr(lifter, "LAYER_SIZES", ((32, 64), *[(64, 64)] * 4, (64, 48)))
    monkeypatch.setattr(lifter, "N_RUNS", 1)
    return load("benchmarks.__main__").main


class _Without:
    """importlib.util, where a package is missing."""

    def __init__(self, name: str, util: ModuleType) -> None:
        self.name, self.util = name, util

    def find_spec(self, name: str):
        return None if name == self.name else self.util.find_spec(name)


def test_the_report_runs_and_has_every_section(load, monkeypatch, tmp_path: Path, capsys) -> None:
    main = small(load, monkeypatch)
    monkeypatch.setattr(load("benchmarks.comparison.growth"), "JOINT_COUNTS", (4, 6))
    assert main(["--tiny", "-o", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert text in capsys.readouterr().out
    for title in (
        "From a view to its survivors",
        "What the cost grows with",
        "Collision engines",
        "Validating configurations",
        "Start-up",
        "Memory",
    ):
        assert f"## {title}" in text
    assert "| brute force " in text
    assert "20 of 20" in text
    assert "PyTorch is not installed" in text
    for line in text.splitlines():
        if line.startswith("!["):
            picture = tmp_path / "out" / line.partition("(")[2].rstrip(")")
            assert picture.stat().st_size > 1000
    found = json.loads((tmp_path / "out" / "ratios.json").read_text(encoding="utf-8"))
    assert found["machine"]["cores"] >= 1
    assert found["machine"]["versions"]["numpy"]
    assert all(ratio > 0 and np.isfinite(ratio) for ratio in found["ratios"].values())


def test_a_fallen_ratio_is_said_and_fails_only_where_that_is_wanted(
    load, monkeypatch, tmp_path, capsys
) -> None:
    main, gate = small(load, monkeypatch), load("benchmarks.comparison.gate")
    name = "an empty Python against import"
    for before, fell in ((1e9, True), (1e-9, False)):
        gate.write_baseline(tmp_path / "b.json", {name: before, "of a section that did not run": 1e9}, {})
        asked = ["--tiny", "--only", "start-up", "--gate", "--baseline", str(tmp_path / "b.json")]
        asked += ["-o", str(tmp_path / "out")]
        assert main(asked) == 0
        output = capsys.readouterr()
        assert (f"warning: a ratio fell: {name}" in output.err) == fell
        assert ("No ratio fell." in output.out) == (not fell)
        assert main([*asked, "--strict"]) == int(fell)
        capsys.readouterr()


def test_the_gate_compares_ratios_with_a_tolerance(load) -> None:
    gate = load("benchmarks.comparison.gate")
    before = {"a": 100.0, "b": 2.0, "c": 1.0, "d": 3.0}
    assert gate.warnings_of({"a": 71.0, "b": 9.0, "c": 1.0}, before, 0.3) == []
    said = gate.warnings_of({"a": 69.0, "b": 2.0, "c": float("nan")}, before, 0.3)
    assert [line.partition(":")[0] for line in said] == ["a", "c"]
    assert "69, was 100 (-31%)" in said[0]


def test_the_committed_baseline_is_one(load) -> None:
    gate = load("benchmarks.comparison.gate")
    ratios = gate.read_baseline(gate.BASELINE_PATH)
    assert ratios
    assert all(ratio > 0 and np.isfinite(ratio) for ratio in ratios.values())
    document = json.loads(gate.BASELINE_PATH.read_text(encoding="utf-8"))
    assert set(document) == {"schema", "machine", "ratios"}
    assert document["machine"]["versions"]["pin"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": "other", "ratios": {}}', "nan"])
def test_what_is_no_baseline_is_refused(load, tmp_path: Path, text: str) -> None:
    path = tmp_path / "b.json"
    path.write_text(text, encoding="utf-8")
    gate = load("benchmarks.comparison.gate")
    with pytest.raises(SystemExit, match="no baseline"):
        gate.read_baseline(path)
    with pytest.raises(SystemExit, match="no baseline"):
        gate.read_baseline(tmp_path / "missing.json")


def test_an_unknown_section_is_refused(load, capsys) -> None:
    with pytest.raises(SystemExit):
        load("benchmarks.__main__").main(["--only", "speed"])
    assert "'speed'; expected some of views, growth" in capsys.readouterr().err


def test_mujoco_reads_the_figure_as_pinocchio_has_it(load) -> None:
    """Placements of every capsule, beside Pinocchio's, at random configurations."""
    mujoco = pytest.importorskip("mujoco")
    pin = importlib.import_module("pinocchio")
    export, engines = load("benchmarks.comparison.export"), load("benchmarks.comparison.engines")
    figure = importlib.import_module("posekit.body").load_figure()
    theirs = mujoco.MjModel.from_xml_string(export.mjcf(figure.model, figure.geometry))
    state = mujoco.MjData(theirs)
    model, geometry = figure.model, figure.geometry
    data, geometry_data = model.createData(), geometry.createData()
    for q in engines.random_configurations(figure, 5, seed=4):
        state.qpos[:7] = [*q[:3], q[6], *q[3:6]]
        for joint in range(2, model.njoints):
            state.qpos[theirs.joint(model.names[joint]).qposadr[0]] = q[model.idx_qs[joint]]
        mujoco.mj_kinematics(theirs, state)
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, q)
        for body, place in zip(geometry.geometryObjects, geometry_data.oMg, strict=True):
            at = theirs.geom(body.name).id
            assert np.allclose(state.geom_xpos[at], place.translation, atol=1e-9)
            assert np.allclose(state.geom_xmat[at].reshape(3, 3), place.rotation, atol=1e-9)


def test_engines_that_differ_are_named_with_their_distance(load) -> None:
    engines = load("benchmarks.comparison.engines")
    figure = importlib.import_module("posekit.body").load_figure()
    q = engines.random_configurations(figure, 50, seed=2)
    reference = engines.pool(figure).judge(q)
    wrong = reference.copy()
    wrong[[3, 7]] ^= True
    found = engines.compare(figure, q, wrong, reference)
    assert (found.equal, found.asked, found.touching) == (48, 50, 0)
    assert np.array_equal(found.distances < 0, reference[[3, 7]])
