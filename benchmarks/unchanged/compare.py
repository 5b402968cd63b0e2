"""Compare two recordings, and report."""

from __future__ import annotations

import difflib
import json
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.unchanged.differences import (
    ABSENT_VALUE,
    EXACT_TOLERANCE,
    REFINED_TOLERANCE,
    Difference,
    differences,
    numbers,
)
from benchmarks.unchanged.expected import EXPECTED_DIFFERENCES, VOLATILE_PLACES, Allowed, allowed

SHOWN_PER_CASE = 12
SHOWN_CHARACTERS = 90
SHOWN_LINES = 12


@dataclass
class Found:
    """What a comparison found."""

    cases: int = 0
    unexpected: dict[str, list[Difference]] = field(default_factory=lambda: defaultdict(list))
    expected: dict[Allowed, list[tuple[str, Difference]]] = field(default_factory=lambda: defaultdict(list))
    texts: list[tuple[str, Difference]] = field(default_factory=list)
    pictures: list[tuple[str, Difference]] = field(default_factory=list)


def compare(
    before: Path, after: Path, output: Path | None, expected: tuple[Allowed, ...] = EXPECTED_DIFFERENCES
) -> int:
    """Compare two recordings, and write or print a report.

    Parameters
    ----------
    before, after : Path
        Folders that `record` wrote.
    output : Path or None
        Where the report goes; printed where None.
    expected : tuple of Allowed
        Differences that were meant.

    Returns
    -------
    int
        1 where something differs that was not meant, else 0.
    """
    found = find(_records(before), _records(after), expected)
    report = "\n".join(_report(found)) + "\n"
    if output is not None:
        output.write_text(report)
    print(report if output is None else report.split("\n## ", maxsplit=1)[0])
    return int(bool(found.unexpected))


def find(before: dict[str, Any], after: dict[str, Any], expected: tuple[Allowed, ...]) -> Found:
    """Find all differences between two sets of records.

    Parameters
    ----------
    before, after : dict of str to dict
        Records by case.
    expected : tuple of Allowed
        Differences that were meant.
    """
    found = Found(cases=len(before.keys() | after.keys()))
    for case in sorted(before.keys() | after.keys()):
        if case not in before or case not in after:
            there = [ABSENT_VALUE if case not in records else "recorded" for records in (before, after)]
            all_differences: Iterator[tuple[str, Difference]] = iter([("value", Difference("case", *there))])
        else:
            all_differences = _of_case(before[case], after[case])
        for kind, one in all_differences:
            if allowed(case, one, VOLATILE_PLACES):
                continue
            meant = allowed(case, one, expected)
            if meant is not None:
                found.expected[meant].append((case, one))
            elif kind == "text":
                found.texts.append((case, one))
            elif kind == "picture":
                found.pictures.append((case, one))
            else:
                found.unexpected[case].append(one)
    return found


def _records(folder: Path) -> dict[str, Any]:
    return {path.stem: json.loads(path.read_text()) for path in sorted((folder / "records").glob("*.json"))}


def _of_case(before: dict[str, Any], after: dict[str, Any]) -> Iterator[tuple[str, Difference]]:
    """Yield a case's differences, each with its kind: ``value``, ``text`` or ``picture``."""
    tolerance = REFINED_TOLERANCE if before["refined"] else EXACT_TOLERANCE
    for part in ("refined", "runs"):
        one, other = (
            [run["argv"] for run in record["runs"]] if part == "runs" else record[part]
            for record in (before, after)
        )
        for difference in differences(one, other, tolerance, part):
            yield "value", difference
    for k, (one, other) in enumerate(zip(before["runs"], after["runs"], strict=False)):
        for difference in differences(one["exit"], other["exit"], tolerance, f"run {k}: exit"):
            yield "value", difference
        for stream in ("stdout", "stderr"):
            if one[stream] != other[stream]:
                yield "text", Difference(f"run {k}: {stream}", one[stream], other[stream])
    for name in sorted(before["files"].keys() | after["files"].keys()):
        one, other = before["files"].get(name), after["files"].get(name)
        if one is None or other is None:
            there = [ABSENT_VALUE if each is None else f"a file ({each['kind']})" for each in (one, other)]
            yield "value", Difference(f"{name}:", *there)
        elif one["kind"] == other["kind"] and one["kind"] in {"text", "picture"}:
            if one["content"] != other["content"]:
                yield one["kind"], Difference(f"{name}:", one["content"], other["content"])
        else:
            for difference in differences(_content(one), _content(other), tolerance, f"{name}:"):
                yield "value", difference


def _content(file: dict[str, Any]) -> Any:
    return numbers(file["content"]) if file["kind"] == "tokens" else file["content"]


def _report(found: Found) -> Iterator[str]:
    count = sum(map(len, found.unexpected.values()))
    meant = sum(map(len, found.expected.values()))
    yield "# What changed\n"
    yield f"{found.cases} cases. Differences that were not meant: {count}, in {len(found.unexpected)} cases. "
    yield f"Meant: {meant}. Texts that changed: {len(found.texts)}; pictures: {len(found.pictures)}.\n"
    yield "## Differences that were not meant\n"
    for case, all_of_it in found.unexpected.items():
        shown = sorted(all_of_it, key=lambda one: -one.distance)[:SHOWN_PER_CASE]
        yield f"### {case}: {len(all_of_it)}\n"
        yield "| where | before | after | apart |\n|---|---|---|---|"
        for one in shown:
            apart = f"{one.distance:.2e}" if one.distance < float("inf") else ""
            yield f"| `{one.place}` | {_short(one.before)} | {_short(one.after)} | {apart} |"
        yield f"\nand {len(all_of_it) - len(shown)} more\n" if len(shown) < len(all_of_it) else ""
    yield "## Differences that were meant\n"
    for reason, pairs in found.expected.items():
        among = len({case for case, _ in pairs})
        yield f"- {reason.reason} (`{reason.case}`, `{reason.place}`): {len(pairs)} in {among} cases"
    yield "\n## Texts that changed\n"
    for case, one in found.texts:
        texts = one.before.splitlines(), one.after.splitlines()
        lines = list(difflib.unified_diff(*texts, lineterm="", n=0))[2:]
        yield f"### {case}, {one.place}\n\n```diff"
        yield from (line[: 2 * SHOWN_CHARACTERS] for line in lines[:SHOWN_LINES])
        yield f"```\n{f'and {len(lines) - SHOWN_LINES} lines more' if len(lines) > SHOWN_LINES else ''}"
    yield "## Pictures that changed\n"
    for case, one in found.pictures:
        yield f"- {case}, {one.place} {one.before['bytes']} bytes, {one.after['bytes']} after"


def _short(value: Any) -> str:
    text = json.dumps(value).replace("|", "\\|")
    return text if len(text) <= SHOWN_CHARACTERS else text[:SHOWN_CHARACTERS] + " …"
