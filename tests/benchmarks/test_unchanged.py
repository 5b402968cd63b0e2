"""The comparison of two recordings finds what it must find, and nothing else."""

import importlib
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def unchanged(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The modules of `benchmarks.unchanged`, which is not installed."""
    monkeypatch.syspath_prepend(str(ROOT))
    names = ("canonical", "compare", "corpus", "differences", "expected")
    return SimpleNamespace(
        **{name: importlib.import_module(f"benchmarks.unchanged.{name}") for name in names}
    )


def recorded(
    content: Any, *, kind: str = "json", refined: bool = False, status: int = 0, said: str = ""
) -> dict[str, Any]:
    run = {"argv": ["posekit", "recover"], "exit": status, "stdout": said, "stderr": ""}
    return {
        "name": "a",
        "refined": refined,
        "runs": [run],
        "files": {"result.json": {"kind": kind, "content": content}},
    }


def compared(unchanged: SimpleNamespace, before: Any, after: Any, **options: Any) -> list[str]:
    """Where a recording of `before` and one of `after` differ, without leave."""
    records = ({"a": recorded(content, **options)} for content in (before, after))
    return [one.place for one in unchanged.compare.find(*records, ()).unexpected["a"]]


@pytest.mark.parametrize(
    ("refined", "off", "found"),
    [(False, 1e-11, True), (False, 1e-13, False), (True, 1e-10, False), (True, 1e-8, True)],
)
def test_numbers_are_compared_as_exactly_as_they_are_found(
    unchanged: SimpleNamespace, refined: bool, off: float, found: bool
) -> None:
    places = compared(unchanged, {"x": [0.5, 0.25]}, {"x": [0.5, 0.25 + off]}, refined=refined)
    assert places == (["result.json:x[1]"] if found else [])


def test_large_numbers_are_compared_by_their_ratio(unchanged: SimpleNamespace) -> None:
    assert compared(unchanged, [1e6], [1e6 + 1e-7]) == []
    assert compared(unchanged, [1e6], [1e6 + 1e-4]) == ["result.json:[0]"]


@pytest.mark.parametrize(
    ("before", "after", "place"),
    [
        ({"a": 1, "b": 2}, {"a": 1}, "b"),
        ({"a": 1}, {"a": 1, "b": 2}, "b"),
        ({"a": "valid"}, {"a": "invalid"}, "a"),
        ({"a": [1, 2]}, {"a": [1, 2, 3]}, "a.length"),
        ({"a": 10**13}, {"a": 10**13 + 1}, "a"),
        ({"a": True}, {"a": 1}, "a"),
        ({"a": None}, {"a": 0.0}, "a"),
        ({"a": 0.5}, {"a": float("nan")}, "a"),
    ],
)
def test_what_is_discrete_is_compared_exactly(
    unchanged: SimpleNamespace, before: Any, after: Any, place: str
) -> None:
    for refined in (False, True):
        assert compared(unchanged, before, after, refined=refined) == [f"result.json:{place}"]


def test_what_is_the_same_is_no_difference(unchanged: SimpleNamespace) -> None:
    assert (
        compared(unchanged, {"a": 2, "b": float("nan"), "c": 1}, {"c": 1, "b": float("nan"), "a": 2.0}) == []
    )


def test_numbers_in_tables_of_text_are_numbers(unchanged: SimpleNamespace) -> None:
    assert compared(unchanged, ["1", "0.50", "neck"], ["1", "0.5", "neck"], kind="tokens") == []
    assert compared(unchanged, ["0.50", "neck"], ["0.51", "pelvis"], kind="tokens") == [
        "result.json:[0]",
        "result.json:[1]",
    ]


def test_texts_are_listed_and_exit_codes_are_compared(unchanged: SimpleNamespace) -> None:
    before, after = {"a": recorded({}, said="one")}, {"a": recorded({}, said="two", status=1)}
    found = unchanged.compare.find(before, after, ())
    assert [one.place for one in found.unexpected["a"]] == ["run 0: exit"]
    assert [one.place for _, one in found.texts] == ["run 0: stdout"]


def test_what_was_meant_and_what_is_volatile_is_no_failure(unchanged: SimpleNamespace) -> None:
    meant = unchanged.expected.Allowed("a", "result.json:frames[0].*", "frames count from 0")
    before = {"a": recorded({"frames": [{"n": 1}], "settings": {"versions": {"numpy": "1"}}})}
    after = {"a": recorded({"frames": [{"n": 0}], "settings": {"versions": {"numpy": "2"}}})}
    found = unchanged.compare.find(before, after, (meant,))
    assert not found.unexpected
    assert [one.place for _, one in found.expected[meant]] == ["result.json:frames[0].n"]


def test_a_difference_that_was_meant_goes_no_farther_than_was_said(unchanged: SimpleNamespace) -> None:
    meant = unchanged.expected.Allowed("a", "result.json:x", "another order of sums", within=1e-6)
    for off, count in ((1e-7, 0), (1e-5, 1)):
        found = unchanged.compare.find(
            {"a": recorded({"x": 0.5})}, {"a": recorded({"x": 0.5 + off})}, (meant,)
        )
        assert len(found.unexpected["a"]) == count


def test_a_case_or_a_file_that_is_missing_is_a_failure(unchanged: SimpleNamespace, tmp_path: Path) -> None:
    for name, records in (("before", {"a": recorded(1), "b": recorded(1)}), ("after", {"a": recorded(1)})):
        (tmp_path / name / "records").mkdir(parents=True)
        for case, record in records.items():
            (tmp_path / name / "records" / f"{case}.json").write_text(json.dumps(record))
    report = tmp_path / "report.md"
    assert unchanged.compare.compare(tmp_path / "before", tmp_path / "after", report, ()) == 1
    assert "### b: 1" in report.read_text()
    assert unchanged.compare.compare(tmp_path / "before", tmp_path / "before", report, ()) == 0
    without = recorded(1) | {"files": {}}
    found = unchanged.compare.find({"a": recorded(1)}, {"a": without}, ())
    assert [one.place for one in found.unexpected["a"]] == ["result.json:"]


def test_what_a_run_says_of_time_and_place_is_left_out(unchanged: SimpleNamespace) -> None:
    text = unchanged.canonical.text_of(
        "/tmp/x/a.json in 1.25 s, at most 208 MiB; settings 572c0a3794854b0a", {"/tmp/x": "W"}
    )
    assert text == "W/a.json in <time>, at most <memory>; settings <digest>"


def test_every_case_reads_what_stands_before_it(unchanged: SimpleNamespace) -> None:
    everything = unchanged.corpus.cases(data=True)
    before = {"inputs", "data"}
    for case in everything:
        assert case.reads <= before, case.name
        before.add(case.name)
    without = unchanged.corpus.cases(data=False)
    assert {case.name for case in without} < before
    assert not any("data" in case.reads for case in without)
    assert unchanged.corpus.INPUTS_READ <= before
    assert {case.name for case in unchanged.corpus.cases(data=False, only="validate-result")} == {
        "validate-result",
        "recover-walker",
        "synth-walker",
    }
