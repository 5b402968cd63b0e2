"""Reports: each verdict with the findings that it rests on."""

import csv
import json

import numpy as np
import pytest
from pyarrow import parquet

from posekit.errors import InputError
from posekit.formats.own import (
    Finding,
    JudgedCheck,
    PostureReport,
    ValidationReport,
    make_report,
    read_report,
    write_report,
)
from posekit.formats.own.report import Worst, columns_of
from posekit.formats.own.report_columns import ReportPlace, VerdictColumns, joined
from posekit.formats.own.report_table import summary_table
from posekit.tree.check import Findings

VALUE = np.array([[0.5, 2.0, -1.0], [0.5, 0.4, 0.9], [np.nan, np.nan, np.nan]])


def judged(name="joint_range") -> JudgedCheck:
    findings = Findings(value=VALUE, lower=np.zeros(3), upper=np.array([1.0, 1.0, np.inf]))
    return JudgedCheck(check=name, unit="rad", where=("a", "b", "c"), findings=findings)


def a_report(**options) -> ValidationReport:
    return make_report(
        settings={"checks": ["joint_range"]},
        verdicts=["invalid", "valid", "undecided"],
        fk_distance=np.array([1e-12, 0.0, np.nan]),
        judged=[judged()],
        **options,
    )


def test_violated_and_worst_findings_are_listed():
    report = a_report()
    listed = [[(f.where, f.verdict) for f in posture.findings] for posture in report.postures]
    assert listed == [[("b", "invalid"), ("c", "invalid")], [("b", "valid")], [("a", "undecided")]]
    first = report.postures[0].findings[0]
    assert first == Finding(
        check="joint_range",
        where="b",
        value=2.0,
        lower=0.0,
        upper=1.0,
        margin=-1.0,
        unit="rad",
        verdict="invalid",
    )
    assert report.postures[0].findings[1].upper is None
    assert report.postures[2].findings[0].value is None
    assert report.postures[2].fk_distance is None
    assert report.summary == {"valid": 1, "invalid": 1, "undecided": 1}


def test_all_findings_are_listed_on_request():
    assert [len(posture.findings) for posture in a_report(all_findings=True).postures] == [3, 3, 3]


@pytest.mark.parametrize("everything", [False, True])
def test_a_report_is_read_back(tmp_path, everything):
    report = a_report(all_findings=everything)
    write_report(tmp_path / "r.json", report)
    assert read_report(tmp_path / "r.json") == report
    document = json.loads((tmp_path / "r.json").read_text())
    assert list(document) == ["schema", "settings", "summary", "postures"]


def test_numbers_that_json_has_not_become_null(tmp_path):
    finding = Finding(
        check="c",
        where="w",
        value=np.nan,
        lower=-np.inf,
        upper=np.inf,
        margin=np.nan,
        unit="m",
        verdict="undecided",
    )
    posture = PostureReport(verdict="undecided", fk_distance=np.nan, findings=[finding])
    write_report(tmp_path / "r.json", ValidationReport(settings={}, postures=[posture]))
    back = read_report(tmp_path / "r.json").postures[0]
    assert (back.fk_distance, back.findings[0].value, back.findings[0].lower) == (None, None, None)


def test_no_posture_and_no_place_are_reports(tmp_path):
    empty = make_report(settings={}, verdicts=[], fk_distance=np.zeros(0), judged=[])
    write_report(tmp_path / "r.json", empty)
    assert read_report(tmp_path / "r.json").summary == {"valid": 0, "invalid": 0, "undecided": 0}
    nowhere = Findings(value=np.zeros((1, 0)), lower=np.zeros(0), upper=np.zeros(0))
    check = JudgedCheck(check="c", unit="m", where=(), findings=nowhere)
    report = make_report(settings={}, verdicts=["valid"], fk_distance=np.zeros(1), judged=[check])
    assert report.postures[0].findings == ()


def test_a_report_of_nothing_is_a_table_without_rows(tmp_path):
    nothing = make_report(settings={}, verdicts=[], fk_distance=np.zeros(0), judged=[])
    tables = []
    for name, report in (("nothing.parquet", nothing), ("whole.parquet", a_report())):
        write_report(tmp_path / name, report)
        tables.append(parquet.read_table(tmp_path / name))
    assert [len(table) for table in tables] == [0, 3]
    assert tables[0].schema.names == tables[1].schema.names
    assert [str(one) for one in tables[0].schema.types] == [str(one) for one in tables[1].schema.types]


def test_thousands_of_postures_are_reported_in_seconds(tmp_path, rng):
    findings = Findings(value=rng.normal(size=(10_000, 22)), lower=np.full(22, -2.0), upper=np.full(22, 2.0))
    check = JudgedCheck(check="c", unit="rad", where=[str(i) for i in range(22)], findings=findings)
    verdicts = np.where(findings.violated.any(axis=1), "invalid", "valid").tolist()
    report = make_report(settings={}, verdicts=verdicts, fk_distance=np.zeros(10_000), judged=[check])
    write_report(tmp_path / "r.json", report)
    assert read_report(tmp_path / "r.json").summary["invalid"] == verdicts.count("invalid")


def test_what_does_not_fit_is_refused(tmp_path):
    with pytest.raises(InputError, match="report: joint_range: got 3 postures; expected 1"):
        make_report(settings={}, verdicts=["valid"], fk_distance=np.zeros(1), judged=[judged()])
    with pytest.raises(InputError, match='verdicts: got "true"; expected valid or invalid or undecided'):
        make_report(settings={}, verdicts=["true"], fk_distance=np.zeros(1), judged=[])
    with pytest.raises(
        InputError, match=r'the suffix "\.npz"; expected \.json or \.md or \.csv or \.parquet'
    ):
        write_report(tmp_path / "r.npz", a_report())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("place", "value", "text"),
    [
        (
            ("postures", 1, "verdict"),
            "ok",
            "postures[1].verdict: got \"ok\"; expected 'valid', 'invalid' or 'undecided'",
        ),
        (
            ("postures", 1, "findings", 0, "value"),
            "2",
            'postures[1].findings[0].value: got "2"; expected a number',
        ),
        (("summary", "valid"), -1, "summary.valid: got -1; expected a number of at least 0"),
        (("schema",), "posekit.report/9", "the file is of another version"),
    ],
)
def test_a_file_that_breaks_the_schema_is_one_clear_line(tmp_path, place, value, text):
    write_report(tmp_path / "r.json", a_report())
    document = json.loads((tmp_path / "r.json").read_text())
    *parents, last = place
    node = document
    for part in parents:
        node = node[part]
    node[last] = value
    (tmp_path / "r.json").write_text(json.dumps(document))
    with pytest.raises(InputError) as caught:
        read_report(tmp_path / "r.json")
    assert text in str(caught.value)


# --- tables, CSV, and reports that list a part ------------------------------------------------------------


def test_a_report_of_a_part_is_read_back(tmp_path):
    findings = a_report().postures[0].findings
    posture = PostureReport(
        verdict="invalid",
        fk_distance=0.01,
        findings=findings,
        index=7,
        worst=Worst(check="joint_range", where="b", margin=-1.0, unit="rad"),
        residual={"neck": 0.01, "pelvis": None},
    )
    silent = PostureReport(
        verdict="undecided", fk_distance=None, findings=(), index=8, undecided_by=("joints", "reach")
    )
    report = ValidationReport(
        settings={}, postures=(posture, silent), listed="the first 2 of 2", verdicts="vvvvvvviuv"
    )
    write_report(tmp_path / "r.json", report)
    back = read_report(tmp_path / "r.json")
    assert back == report
    assert back.summary == {"valid": 8, "invalid": 1, "undecided": 1}
    assert len(back) == 10


def test_a_report_without_columns_has_those_that_its_findings_tell():
    columns = columns_of(a_report())
    assert columns.summary == {"valid": 1, "invalid": 1, "undecided": 1}
    assert columns.letters == "ivu"
    rows = list(columns.rows())
    assert [
        [(one.place.where, one.value, one.bound, one.margin) for one in row.violations] for row in rows
    ] == [
        [("b", 2.0, 1.0, -1.0), ("c", -1.0, 0.0, -1.0)],
        [],
        [],
    ]
    count = columns.by_check()["joint_range"]
    assert (count.rejected, count.places) == (1, {"b": 1, "c": 1})
    assert count.worst is not None
    assert count.worst[0] == 0


@pytest.mark.parametrize("name", ["r.md", "r.csv"])
def test_tables_are_written_of_any_report(tmp_path, name):
    write_report(tmp_path / name, a_report())
    text = (tmp_path / name).read_text(encoding="utf-8")
    assert "invalid" in text
    assert "undecided" in text
    write_report(tmp_path / name, ValidationReport(settings={}, postures=()))
    assert (tmp_path / name).stat().st_size > 0


def test_a_name_cannot_break_out_of_its_cell(tmp_path):
    finding = Finding(
        check="c",
        where='a|b,"c"\n=1',
        value=2.0,
        lower=None,
        upper=1.0,
        margin=-1.0,
        unit="m",
        verdict="invalid",
    )
    report = ValidationReport(
        settings={"a\nb": "x\n# y"},
        postures=[PostureReport(verdict="invalid", fk_distance=0.0, findings=[finding])],
    )
    write_report(tmp_path / "r.md", report)
    lines = (tmp_path / "r.md").read_text(encoding="utf-8").splitlines()
    assert not any(line.startswith("# y") for line in lines)
    assert all(
        line.replace("\\|", "").count("|") == line.replace("\\|", "").count(" |") + 1
        for line in lines
        if line.startswith("| 0 ")
    )
    write_report(tmp_path / "r.csv", report)
    with (tmp_path / "r.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 1
    assert rows[0]["violations"] == 'c/a|b,"c"\n=1=2 m (1)'


def test_batches_are_counted_through():
    places = [ReportPlace("joint_range", "knee", "deg"), ReportPlace("collision", "a-b", "m")]

    def part(verdict, posture, place, margin):
        n = len(verdict)
        return VerdictColumns(
            places=places,
            verdict=np.array(verdict, dtype=np.int8),
            fk_distance=np.zeros(n),
            worst_place=np.full(n, -1, dtype=np.int32),
            **{name: np.full(n, np.nan) for name in ("worst_margin", "worst_value", "worst_bound")},
            posture=np.array(posture, dtype=np.int64),
            place=np.array(place, dtype=np.int32),
            margin=np.array(margin, dtype=np.float64),
            value=np.full(len(margin), np.nan),
            bound=np.full(len(margin), np.nan),
            silent=np.array([2 if v == 2 else 0 for v in verdict], dtype=np.int16),
            checks=("joint_range", "collision"),
        )

    first = part([0, 1, 2], [1, 1], [0, 1], [-3.0, -0.05])
    second = part([1, 0], [0], [0], [-1.0])
    columns = joined([first, second], places, ("joint_range", "collision"))
    assert columns.letters == "viuiv"
    assert columns.posture.tolist() == [1, 1, 3]
    counts = columns.by_check()
    assert (counts["joint_range"].rejected, counts["joint_range"].undecided) == (2, 1)
    assert counts["collision"].rejected == 1
    worst = counts["joint_range"].worst
    assert worst is not None
    posture, judged = worst
    assert (posture, judged.place, judged.margin) == (1, places[0], -3.0)
    table = "\n".join(summary_table(columns))
    assert table.startswith("5 postures: 2 valid, 2 invalid, 1 undecided")
    assert "joint-range/knee 2" in table
    assert joined([], places, ()).summary == {"valid": 0, "invalid": 0, "undecided": 0}
