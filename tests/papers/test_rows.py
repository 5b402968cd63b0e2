"""Both papers row by row: a row that differs has its reason, what is wrong shows as wrong, and texts stay text."""

import json
from pathlib import Path

import numpy as np
import pytest

from posekit.papers import lee_chen_checks as lee_chen_checks_module
from posekit.papers import lee_chen_printed as printed
from posekit.papers import lee_chen_words as lee_chen_words_module
from posekit.papers import taylor_rows as taylor_rows_module
from posekit.papers.all_papers import PICTURES_SHOWN
from posekit.papers.lee_chen_checks import lee_chen_checks
from posekit.papers.lee_chen_rows import lee_chen_rows
from posekit.papers.lee_chen_table2 import exact_image
from posekit.papers.lee_chen_tables34 import WalkGrid
from posekit.papers.lee_chen_words import lee_chen_words
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.papers.rows import PaperRow, agreement, write_rows
from posekit.papers.taylor_rows import find_taylor, taylor_rows
from posekit.validators import load_ranges


@pytest.fixture(scope="module")
def work() -> LeeChenWork:
    return LeeChenWork(grid=WalkGrid(velocities=(0.9,), leans=(0.0,), phases=20))


HELD = (
    *("Table 1,", "Table 2(", "§2.1, eq", "§2.2", "§3.3, Rule", "§3.2.C"),
    *("Fig. 1:", "Fig. 2:", "Fig. 3:", "Fig. 4:", "§3.2.A(i):", "§3.2.A(iii", "§3.2.A(iv", "§3.2.B"),
)
"""What comes out as printed, to rounding."""


def both(work: LeeChenWork) -> list[PaperRow]:
    return [*lee_chen_words(work), *lee_chen_checks(work), *lee_chen_rows(work)]


@pytest.fixture(scope="module")
def rows(work: LeeChenWork) -> list[PaperRow]:
    return [*both(work), *taylor_rows(find_taylor())]


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
        if place.startswith(HELD) or place == "Table A.1":
            assert said == "agrees", place


def test_another_print_shows_as_a_difference(work: LeeChenWork, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(printed.TABLE_1, "knee.flexion", (0.0, 131.0))
    monkeypatch.setitem(printed.TABLE_A1, ("neck", "pelvis"), 46.4)
    monkeypatch.setattr(printed, "PRINTED_HEAD", printed.PRINTED_HEAD + 0.1)
    physical = np.array(printed.PRINTED_PHYSICAL["seq1"])
    physical[0, -1] = 5000
    monkeypatch.setitem(printed.PRINTED_PHYSICAL, "seq1", physical.tolist())
    monkeypatch.setattr(lee_chen_checks_module, "exact_image", lambda: exact_image() + 0.001)
    differs = {row.place: row.why for row in both(work) if row.verdict == "differs"}
    assert {place for place, why in differs.items() if why == "not explained"} == {
        "Table 1, knee, flexion",
        "Table A.1",
        "Table 2(d), head in the camera frame, cm",
        "§2.1, eq. (1): [R] is a rotation",
        "§2.1, eqs. (4)-(5): f and the camera position",
    }
    assert "Table 3 (SEQ1), level 13, left ankle" in differs


def test_the_print_agrees_where_it_is_what_comes_out(
    work: LeeChenWork, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Our own counts planted as the print agree wherever they are usual; one more in a cell, and its line does not."""
    chosen = work.chosen
    physical = {name: one.physical[chosen].tolist() for name, one in work.counts.items()}
    motion = {name: one.motion[chosen].tolist() for name, one in work.counts.items()}
    monkeypatch.setattr(printed, "PRINTED_PHYSICAL", physical)
    monkeypatch.setattr(printed, "PRINTED_MOTION", motion)

    def lines() -> dict[str, str]:
        return {row.place: row.verdict for row in lee_chen_rows(work) if ", level " in row.place}

    before = lines()
    assert len(before) == 2 * 14
    agreeing = [place for place, verdict in before.items() if verdict == "agrees"]
    assert "Table 4 (SEQ2), level 0, neck" in agreeing
    physical["seq2"][1][0] += 1
    assert {place for place in before if lines()[place] != before[place]} == {"Table 4 (SEQ2), level 0, neck"}


def test_a_forbidden_posture_that_is_kept_shows(work: LeeChenWork, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rules are asked, not taken for granted: nobody forbids standing."""
    monkeypatch.setitem(lee_chen_checks_module.RULE_POSTURES, 4, ({"neck.rotation": 0}, {"neck.bending": 0}))
    verdicts = {row.place: (row.verdict, row.here) for row in lee_chen_checks(work)}
    assert verdicts["§3.3, Rule 4"] == ("differs", "kept / kept")
    assert verdicts["§3.3, Rule 1"][0] == "agrees"


def test_taylors_proportions_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = taylor_rows_module.PRINTED_LENGTHS["thigh"][1]
    monkeypatch.setitem(taylor_rows_module.PRINTED_LENGTHS, "thigh", (19.5, ends))
    wrong = [row.place for row in taylor_rows_module._proportion_rows() if row.verdict == "differs"]
    assert wrong == ["Table 1, thigh"]


EVERYTHING_PRINTED = {
    "Lee & Chen 1985": (
        *(f"Fig. {k}" for k in (1, 2, 3, 4, 5, 6, 8)),
        *(f"eqs. ({pair})" for pair in ("2)-(3", "4)-(5", "6)-(7")),
        "eq. (1)",
        *(f"§3.2.A({number})" for number in ("i", "ii", "iii", "iv")),
        *(f"Rule {k}" for k in range(1, 6)),
        *("Table 1", "Table 2", "Table 3", "Table 4", "Table A.1", "Table A.2(a)", "Table A.2(b)"),
        *("§2.1", "§2.2", "§3.1", "§3.2.B", "§3.2.C", "§3.3", "§4.1.B", "§4.2"),
    ),
    "Taylor 2000": (
        "eqs. (1)-(2)",
        "eq. (3)",
        *(f"Fig. {k}" for k in (2, 3, 4, 7, 8)),
        "Figs. 1, 5 and 6",
        "Table 1",
        "§3.2",
    ),
}
"""What the papers number; Figs. 7 and A.1 of Lee & Chen are drawn alone."""


def test_whatever_the_papers_number_has_a_row_or_a_picture(rows: list[PaperRow]) -> None:
    for paper, numbered in EVERYTHING_PRINTED.items():
        places = " | ".join(
            row.place.replace("Figs. 6 to 8", "Fig. 6 to Fig. 8") for row in rows if row.paper == paper
        )
        assert [one for one in numbered if one not in places] == []
    captions = " | ".join(PICTURES_SHOWN.values())
    for figure in ("Fig. 6", "Fig. 7", "Fig. 8", "Fig. A.1"):
        assert f"Lee & Chen, {figure}:" in captions


def test_formulas_of_angles_are_the_prints_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other angles, which do not jump, differ from what is written out."""
    monkeypatch.setattr(lee_chen_words_module, "load_ranges", lambda _: load_ranges("table1"))
    rows = {row.place: row.verdict for row in lee_chen_words_module._formula_rows()}
    assert set(rows.values()) == {"differs"}


def test_pictures_that_are_there_are_shown(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"")
    write_rows(tmp_path, [], [], {"a.png": "Fig. 1 & 2", "b.png": "Fig. 3"})
    page = (tmp_path / "papers.html").read_text(encoding="utf-8")
    assert '<img src="a.png" alt="Fig. 1 &amp; 2">' in page
    assert "b.png" not in page


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
