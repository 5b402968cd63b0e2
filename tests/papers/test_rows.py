"""Both papers row by row: a row that differs has its reason, what is wrong shows as wrong, and texts stay text."""

import json
from pathlib import Path

import numpy as np
import pytest

from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_rows import lee_chen_rows
from posekit.papers.lee_chen_tables34 import WalkGrid
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.papers.rows import PaperRow, agreement, write_rows
from posekit.papers.taylor_rows import find_taylor, taylor_rows


@pytest.fixture(scope="module")
def work() -> LeeChenWork:
    return LeeChenWork(grid=WalkGrid(velocities=(0.9,), leans=(0.0,), phases=20))


@pytest.fixture(scope="module")
def rows(work: LeeChenWork) -> list[PaperRow]:
    return [*lee_chen_rows(work), *taylor_rows(find_taylor())]


def test_every_place_has_one_row_and_what_differs_its_reason(rows: list[PaperRow]) -> None:
    places = [(row.paper, row.place) for row in rows]
    assert len(set(places)) == len(places)
    for row in rows:
        assert row.printed
        assert row.here
        assert row.check
        assert bool(row.why) == (row.verdict != "agrees")
    with pytest.raises(ValueError, match="reason"):
        PaperRow(paper="a", place="b", printed="1", here="2", verdict="differs", check="c")


def test_what_is_known_to_be_misprinted_differs_and_table_1_and_2_agree(rows: list[PaperRow]) -> None:
    verdict = {row.place: row.verdict for row in rows}
    for place in (
        "§3.1, number of interpretations",
        "Table A.2(a), right eye, x",
        "eq. (3): bound of the scale",
    ):
        assert verdict[place] == "differs"
    for place, said in verdict.items():
        if place.startswith(("Table 1,", "Table 2(")) or place == "Table A.1":
            assert said == "agrees", place


def test_another_print_shows_as_a_difference(work: LeeChenWork, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(printed.TABLE_1, "knee.flexion", (0.0, 131.0))
    monkeypatch.setitem(printed.TABLE_A1, ("neck", "pelvis"), 46.4)
    monkeypatch.setattr(printed, "PRINTED_HEAD", printed.PRINTED_HEAD + 0.1)
    physical = np.array(printed.PRINTED_PHYSICAL["seq1"])
    physical[0, -1] = 5000
    monkeypatch.setitem(printed.PRINTED_PHYSICAL, "seq1", physical.tolist())
    with pytest.raises(ValueError, match="reason"):
        list(lee_chen_rows(work))
    monkeypatch.setattr(PaperRow, "__post_init__", lambda row: None)
    differs = {row.place for row in lee_chen_rows(work) if row.verdict == "differs"}
    assert differs >= {
        "Table 1, knee, flexion",
        "Table A.1",
        "Table 2(d), head in the camera frame, cm",
        "Table 3 (SEQ1), frame 1, physical, left_ankle",
    }


def test_texts_stay_texts_and_every_row_is_in_every_file(tmp_path: Path) -> None:
    rows = [
        PaperRow(
            paper="A & B", place=f"row {k}", printed="<b>", here="x | y", verdict=agreement(True), check='"c"'
        )
        for k in range(3)
    ]
    lines = write_rows(tmp_path, rows, ["more.md"])
    page = (tmp_path / "papers.html").read_text(encoding="utf-8")
    assert "<b>" not in page
    assert page.count("&lt;b&gt;") == 3
    assert "A &amp; B" in page
    assert (tmp_path / "papers.md").read_text(encoding="utf-8").splitlines() == lines
    assert sum(line.startswith("| row ") for line in lines) == 3
    assert len({line.replace("\\|", "").count("|") for line in lines if line.startswith("|")}) == 1
    assert [row["place"] for row in json.loads((tmp_path / "papers.json").read_text())["rows"]] == [
        "row 0",
        "row 1",
        "row 2",
    ]
