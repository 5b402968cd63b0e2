"""The 1985 paper again: Table 2, Tables 3 and 4, and frame 1 after Rules 1-5."""

import json
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen import reproduce_lee_chen
from posekit.papers.lee_chen_table2 import CameraEstimate, camera_estimates, exact_image, exact_tables
from posekit.papers.lee_chen_tables34 import (
    GROUPING_METRES,
    N_PHASES,
    PAPER_TOLERANCE,
    Sequence1985,
    closest,
    sequences,
)
from posekit.papers.taylor import reproduce_taylor
from posekit.recovery import recover
from posekit.skeleton import JOINTS
from posekit.synthesis import seq1, seq2
from posekit.synthesis.walker_scene import SEQ1_PHASE0, SEQ2_PHASE0, SEQ_VELOCITY
from posekit.validators import ALL_CHECKS
from posekit.views.builtin import view_of

PHASE0 = {"seq1": SEQ1_PHASE0, "seq2": SEQ2_PHASE0}
SCENES = {"seq1": seq1, "seq2": seq2}


@lru_cache(maxsize=2)
def found(name: str) -> Sequence1985:
    return closest(name, SEQ_VELOCITY)


@lru_cache(maxsize=1)
def estimates() -> dict[str, CameraEstimate]:
    return {one.way: one for one in camera_estimates()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lee-chen")
    reproduce_lee_chen(path, pictures=False)
    return path


# --- Table 2 --------------------------------------------------------------------------------------------


def test_exact_projections_give_the_camera() -> None:
    estimate = estimates()["exact projections, f free"]
    assert estimate.off < 1e-6
    assert estimate.f == pytest.approx(5.0, abs=1e-6)
    assert estimate.misfit is None


def test_the_printed_digits_are_those_of_the_exact_projections() -> None:
    """They differ by half a unit of the last digit and a little: Table A.2 was made from unrounded data."""
    gap = np.abs(exact_image() * [100, -100] - printed.IMAGE_A2)
    assert gap.max() < 5e-4


def test_the_printed_digits_give_the_camera_where_it_is_refined() -> None:
    refined = estimates()["printed digits, f free"]
    assert refined.off < 0.5
    assert refined.f == pytest.approx(4.996, abs=5e-4)
    np.testing.assert_allclose(refined.position, [399.69, 0.04, -0.02], rtol=0, atol=0.005)
    assert refined.misfit is None
    known = estimates()["printed digits, f = 5 cm known"]
    np.testing.assert_allclose(known.position, [399.998, -0.009, -0.023], rtol=0, atol=5e-4)
    assert known.off < 0.05


def test_the_linear_solution_alone_does_not() -> None:
    linear = estimates()["printed digits, linear solution alone"]
    assert linear.off == pytest.approx(4.2, abs=0.05)
    assert linear.f == pytest.approx(5.047, abs=5e-4)


def test_the_misprinted_eye_is_named_and_spoils_the_linear_solution() -> None:
    assert estimates()["printed digits, right eye as misprinted"].misfit == "right_eye"
    assert estimates()["the same, linear solution alone"].off > 100


@pytest.mark.parametrize(
    ("part", "values", "within"),
    [
        ("T", printed.T, 0.021),
        ("R", printed.R, 1e-4),
        ("position", printed.PRINTED_POSITION, 0.016),
        ("head", printed.PRINTED_HEAD, 0.024),
    ],
)
def test_the_whole_of_table_2_is_near_the_print(part: str, values: np.ndarray, within: float) -> None:
    ours = exact_tables()[part]
    assert ours.shape == values.shape
    assert np.abs(ours - values).max() < within


def test_table_2_is_what_its_own_definition_says() -> None:
    """Lee & Chen 1985, eq. (1): (x, y, z, 1) [T] = (X, Y, H), and the image is (X / H, Y / H)."""
    from posekit.cameras.head import TABLE_A2

    tables = exact_tables()
    projected = np.concatenate([TABLE_A2.points * 100, np.ones((6, 1))], axis=1) @ tables["T"]
    np.testing.assert_allclose(
        projected[:, :2] / projected[:, 2:], exact_image() * [100, -100], rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(tables["R"] @ tables["R"].T, np.eye(3), rtol=0, atol=1e-12)
    np.testing.assert_allclose(tables["position"], [400, 0, 0], rtol=0, atol=1e-6)
    x, y, z = tables["head"].T
    np.testing.assert_allclose(5 * x / (z + 5), exact_image()[:, 0] * 100, rtol=0, atol=1e-9)
    np.testing.assert_allclose(5 * y / (z + 5), exact_image()[:, 1] * -100, rtol=0, atol=1e-9)


# --- Tables 3 and 4 -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["seq1", "seq2"])
def test_the_built_in_phase_is_what_the_search_finds(name: str) -> None:
    assert found(name).phase == pytest.approx(PHASE0[name], abs=1e-12)
    assert found(name).velocity == SEQ_VELOCITY
    candidates = sequences(name, SEQ_VELOCITY)
    assert len(candidates) == N_PHASES
    limit = printed.PRINTED_FINAL[name][2]
    allowed = [one for one in candidates if one.truth_survives and one.final[1] <= limit]
    assert found(name).distance == min(one.distance for one in allowed)


@pytest.mark.parametrize(("name", "most"), [("seq1", 2), ("seq2", 1)])
def test_frame_1_ends_as_the_paper_says(name: str, most: int) -> None:
    sequence = found(name)
    assert sequence.truth_survives
    assert 1 <= sequence.final[1] <= most
    assert sequence.final[1] <= sequence.final[0]
    assert sequence.final[0] <= sequence.motion[0, -1]


@pytest.mark.parametrize("name", ["seq1", "seq2"])
def test_levels_behave_as_the_papers_columns_do(name: str) -> None:
    sequence = found(name)
    for counts in (sequence.physical, sequence.motion):
        assert counts.shape == (3, 14)
        assert (counts[:, 0] == 1).all()
        assert (np.diff(counts, axis=1) >= 0).all()
        assert (counts[:, 1:] <= 2 * counts[:, :-1]).all()
    assert (sequence.motion <= sequence.physical).all()
    # The same order of magnitude in every cell: other walkers, other tolerances.
    for ours, theirs in (
        (sequence.physical, printed.PRINTED_PHYSICAL[name]),
        (sequence.motion, printed.PRINTED_MOTION[name]),
    ):
        assert np.abs(np.log2(ours / np.array(theirs, dtype=np.float64))).max() <= 3


@pytest.mark.parametrize("name", ["seq1", "seq2"])
def test_the_built_in_view_gives_the_same_counts(name: str) -> None:
    recovery = recover(
        view_of(SCENES[name]()),
        checks=ALL_CHECKS,
        ranges="table1-printed",
        walkers="paper-printed",
        rules=(1, 2),
        tolerance=PAPER_TOLERANCE,
        group=GROUPING_METRES,
    )
    for row, frame in enumerate(printed.PRINTED_FRAMES):
        levels = recovery.frames[frame - 1].levels
        assert levels["physical"].tolist() == found(name).physical[row].tolist()
        assert levels["motion"].tolist() == found(name).motion[row].tolist()
    groups = recovery.frames[0].groups
    assert groups is not None
    assert len(set(groups.tolist())) == found(name).groups_after_rules_1_2


def test_the_printed_tables_are_typed_as_they_should_be() -> None:
    for table in (printed.PRINTED_PHYSICAL, printed.PRINTED_MOTION):
        for name in ("seq1", "seq2"):
            rows = np.array(table[name])
            assert rows.shape == (3, len(JOINTS))
            assert (np.diff(rows, axis=1) >= 0).all()
    assert [row[-1] for row in printed.PRINTED_PHYSICAL["seq1"]] == [192, 96, 80]
    assert [row[-1] for row in printed.PRINTED_PHYSICAL["seq2"]] == [44, 32, 8]
    assert [row[-1] for row in printed.PRINTED_MOTION["seq1"]] == [32, 20, 28]
    assert [row[-1] for row in printed.PRINTED_MOTION["seq2"]] == [6, 5, 4]
    assert printed.PRINTED_FINAL == {"seq1": (32, 16, 2), "seq2": (6, 6, 1)}


# --- the report -----------------------------------------------------------------------------------------


def test_the_files_put_everything_beside_the_print(folder: Path) -> None:
    written = {path.name for path in folder.iterdir()}
    assert written == {"lee-chen.json", "lee-chen.md"}
    text = (folder / "lee-chen.md").read_text(encoding="utf-8")
    for heading in (
        "## Table 2",
        "## Table 3 (SEQ1)",
        "## Table 4 (SEQ2)",
        "## Frame 1 after grouping and Rules 3-5",
        "## Where this differs from the paper",
    ):
        assert heading in text
    for sequence in (found("seq1"), found("seq2")):
        assert f"{sequence.phase:.2f} of a cycle" in text
        assert f"{printed.PRINTED_PHYSICAL[sequence.name][0][-1]} / {sequence.physical[0, -1]}" in text
    assert "not Cutting's" in text


def test_every_table_of_the_report_is_rectangular(folder: Path) -> None:
    lines = (folder / "lee-chen.md").read_text(encoding="utf-8").splitlines()
    tables: list[list[str]] = [[]]
    for line in lines:
        if line.startswith("|"):
            tables[-1].append(line)
        elif tables[-1]:
            tables.append([])
    assert sum(bool(table) for table in tables) == 5
    for table in tables:
        assert len({row.count("|") for row in table}) <= 1
        assert len({len(row) for row in table}) <= 1


def test_the_json_holds_the_numbers(folder: Path) -> None:
    document = json.loads((folder / "lee-chen.json").read_text(encoding="utf-8"))
    assert set(document) == {"table2", "sequences"}
    ways = [one["way"] for one in document["table2"]["estimates"]]
    assert ways == list(estimates())
    assert document["table2"]["unit"] == "cm"
    np.testing.assert_allclose(document["table2"]["exact"]["head"], exact_tables()["head"])
    for one, name in zip(document["sequences"], ("seq1", "seq2"), strict=True):
        assert one["name"] == name
        assert one["physical"] == found(name).physical.tolist()
        assert one["motion"] == found(name).motion.tolist()
        assert one["printed_physical"] == [list(row) for row in printed.PRINTED_PHYSICAL[name]]
        assert one["truth_survives"] is True
        assert one["frames"] == [1, 3, 5]


def test_the_report_is_the_same_every_time(folder: Path, tmp_path: Path) -> None:
    reproduce_lee_chen(tmp_path, pictures=False)
    for name in ("lee-chen.md", "lee-chen.json"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_taylors_objects_and_experiment_are_reproduced(tmp_path: Path) -> None:
    lines = reproduce_taylor(tmp_path)
    text = (tmp_path / "taylor.md").read_text(encoding="utf-8")
    assert text.splitlines() == lines
    assert "3.76" in text, "the paper's own figure stands beside"
    document = json.loads((tmp_path / "taylor.json").read_text(encoding="utf-8"))
    for one in document["objects"]:
        worst = np.array(one["worst_degrees"])
        assert (worst <= one["printed_degrees"]).mean() >= 0.95
        assert np.abs(np.array([minimum["s"] for minimum in one["minima"]]) / one["true_s"] - 1).min() < 1e-9
    assert len(document["random_views"]) == 4
    for views in document["random_views"]:
        assert abs(views["within"] - views["within_expected"]) < 0.06 * views["views"]
        assert views["solvable_within"] > 0.96 * views["solvable"] > 0
    checks = {row["checks"]: row for row in document["survivors_exact"]}
    assert checks["none"]["mean"] == 2048
    assert checks["all, urdf"]["mean"] < checks["rigid parts"]["mean"]
    for name in ("taylor.fig7.png", "taylor.fig8.png", "taylor.views.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
