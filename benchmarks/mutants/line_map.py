"""Which tests run which line: a pytest plugin that asks coverage.py while the suite runs once."""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Final

import coverage
import pytest

ON_IMPORT: Final = ""
"""The context of lines that run while a module is loaded, whichever test is the first that needs it."""


class LineMap:
    """Runs beside the tests, and writes which of them ran which line, and how long each takes the processor.

    Parameters
    ----------
    path : Path
        The JSON that is written: ``tests`` with their seconds of processor, ``lines`` of each file with numbers of
        tests.
    files : list of str
        The files that are asked about.
    """

    def __init__(self, path: Path, files: list[str]) -> None:
        self._path, self._files = path, files
        self._seconds: dict[str, float] = {}
        self._failed: set[str] = set()
        self._coverage = coverage.Coverage(
            data_file=None, config_file=False, include=[str(Path(file).resolve()) for file in files]
        )
        self._coverage.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Give what runs now to the test, what its fixtures need included."""
        self._coverage.switch_context(item.nodeid)
        began = _processor_seconds()
        try:
            yield
        finally:
            self._coverage.switch_context(ON_IMPORT)
            failed = item.nodeid in self._failed
            self._seconds[item.nodeid] = math.nan if failed else _processor_seconds() - began

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep the names of tests that do not pass."""
        if not report.passed:
            self._failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Write the map."""
        self._coverage.stop()
        data = self._coverage.get_data()
        tests = {name: number for number, name in enumerate(self._seconds)}
        lines: dict[str, dict[int, list[int]]] = {}
        for file in self._files:
            found = data.contexts_by_lineno(str(Path(file).resolve()))
            lines[file] = {
                line: [tests[name] for name in names if name in tests] for line, names in found.items()
            }
        self._path.parent.mkdir(parents=True, exist_ok=True)
        written = {"tests": self._seconds, "lines": lines}
        self._path.write_text(json.dumps(written), encoding="utf-8")


def _processor_seconds() -> float:
    """Return what this process and its ended children used: a clock would tell of what else the machine does."""
    return sum(os.times()[:4])


def map_lines(path: Path, files: list[str], arguments: list[str]) -> None:
    """Run tests once and write which lines each of them runs."""
    plugin = LineMap(path, files)
    with contextlib.suppress(SystemExit):
        pytest.main([*arguments, "-q", "-p", "no:cacheprovider"], plugins=[plugin])


def read_maps(folder: Path, there: Container[str]) -> tuple[dict[str, float], dict[str, dict[int, set[str]]]]:
    """Read the seconds of tests that pass and are there, and tests of lines of files; under 0 those of any line."""
    seconds: dict[str, float] = {}
    lines: dict[str, dict[int, set[str]]] = {}
    for path in sorted(folder.glob("*.json")):
        held = json.loads(path.read_text(encoding="utf-8"))
        names = list(held["tests"])
        seconds |= {name: took for name, took in held["tests"].items() if not math.isnan(took)}
        for file, found in held["lines"].items():
            own = lines.setdefault(file, {0: set()})
            for line, numbers in found.items():
                ran = {names[number] for number in numbers}
                own.setdefault(int(line), set()).update(ran)
                own[0] |= ran
    return {name: took for name, took in seconds.items() if name in there}, lines
