"""One fault at a time in a fork of a process that has collected the tests: those that run its line, until one fails."""

from __future__ import annotations

import contextlib
import gc
import importlib.machinery
import json
import math
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import groupby
from pathlib import Path
from types import CodeType, FunctionType
from typing import Final, Literal, NamedTuple

import pytest

from benchmarks.mutants.files import ROOT
from benchmarks.mutants.mutations import Mutant

TESTED_SECONDS: Final = 20.0
"""How long the tests that run a fault's line may take the processor by the map, unless told otherwise: more may find
more."""
BESIDE: Final = 1.5
"""How many times that long they may take with near tests of other lines of its file."""
ALSO_NEAR: Final = {"validators": ("validation",), "cameras": ("recovery",), "tree": ("recovery",)}
"""Rooms whose tests are near, beside the file's own."""
PATIENCE_SECONDS: Final = 8.0
"""Of processor for a test, beyond three times what the map says: a fault that does not end is found."""
BUSY_MACHINE: Final = 5.0
"""How many times as long all tests may last by the clock, where other processes run."""
MEMORY_BYTES: Final = 8 << 30
OPTIONS: Final = ("-x", "-q", "-s", "-p", "no:cacheprovider")
"""What pytest is told."""

Outcome = Literal["killed", "survived", "endless"]


class Trial(NamedTuple):
    """What came of a fault: the test that found it, or none; and how long that took."""

    outcome: Outcome
    by: str
    seconds: float


def file_of(name: str) -> str:
    """Return the file of a test."""
    return name.partition("::")[0]


def chosen_tests(
    mutant: Mutant, lines: dict[int, set[str]], seconds: dict[str, float], tested: float = TESTED_SECONDS
) -> list[str]:
    """Order the tests that run a fault's line, the nearest and fastest first, as many as there is time for.

    After them come near ones that run another line of the file: what is kept from one test to the next ran its lines
    in one of them only. What runs when the file is imported is asked of all near tests: any of them may read it.
    """
    rooms = {room for part in mutant.file.split("/")[1:] for room in (part, *ALSO_NEAR.get(part, ()))}
    near = {name for name in seconds if name.split("/")[1] in rooms}
    of_file = {name for name in lines.get(0, set()) if name in seconds}
    running = lines.get(mutant.line, of_file) & of_file
    # A line that no test runs was run by whatever was imported first: any of them may read what it made.
    if mutant.on_loading or not running:
        rounds = (near & of_file, tested / 2), (near - of_file, tested), (of_file - near, BESIDE * tested)
    else:
        rounds = (
            (running & near, tested),
            (running - near, tested),
            ((near & of_file) - running, BESIDE * tested),
        )
    words = Path(mutant.file).stem.split("_")
    unlike = {name: -sum(word in name for word in words) for name in seconds}
    chosen: list[str] = []
    total = 0.0
    for names, limit in rounds:
        # Of one file together, which may cost its import: first those whose names share most words with the fault's
        # file, then of the file whose tests are the fastest.
        held: dict[str, list[str]] = {}
        for name in names:
            held.setdefault(file_of(name), []).append(name)
        rank = {
            file: (min(unlike[name] for name in own), sum(seconds[name] for name in own) / len(own), file)
            for file, own in held.items()
        }
        for name in sorted(names, key=lambda n: (rank[file_of(n)], unlike[n], seconds[n], n)):
            if total + seconds[name] <= limit or not chosen:
                chosen.append(name)
                total += seconds[name]
    return chosen


class Collected:
    """A pytest plugin: when the tests are collected it hands itself to `work`, in place of running them.

    Parameters
    ----------
    work : callable
        What is done with the collected tests.
    """

    def __init__(self, work: Callable[[Collected], None]) -> None:
        self._work = work
        self.items: dict[str, pytest.Item] = {}
        self._functions: dict[str, list[FunctionType]] = {}

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Take the tests, and find the functions of posekit that the faults are planted in."""
        self.items = {item.nodeid: item for item in session.items}
        for each in gc.get_objects():
            if isinstance(each, FunctionType):
                self._functions.setdefault(each.__code__.co_filename, []).append(each)
        gc.freeze()
        self._work(self)
        return True

    def tried(
        self, mutant: Mutant, tests: list[str], seconds: Mapping[str, float], fails: Callable[[str], bool]
    ) -> Trial:
        """Run tests on a fault until one fails that passes without it."""
        began = time.monotonic()
        while True:
            found = self.in_fork(mutant, tests, seconds)
            outcome: Outcome = "endless" if found is None else "killed" if found else "survived"
            if found not in self.items or not fails(found):
                return Trial(outcome, found or "", time.monotonic() - began)
            tests = [name for name in tests if name != found]

    def in_fork(
        self,
        mutant: Mutant | None,
        tests: list[str],
        seconds: Mapping[str, float],
        patience: float = PATIENCE_SECONDS,
    ) -> str | None:
        """Run tests in a fork, and return the first that fails, empty where none does, None where they do not end."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            try:
                os.setsid()
                null = os.open(os.devnull, os.O_RDWR)
                for stream in (0, 1, 2):
                    os.dup2(null, stream)
                resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
                os.chdir(ROOT)
                failures = Failures(seconds, patience)
                self._run(mutant, tests, failures)
                os.write(writing, failures.first.encode())
            except BaseException:
                os.write(writing, tests[0].encode())
            finally:
                os._exit(0)
        os.close(writing)
        return _waited(child, reading, tests, patience + sum(seconds[name] for name in tests))

    def _run(self, mutant: Mutant | None, tests: list[str], failures: Failures) -> None:
        """Run tests with a fault until one fails."""
        if mutant is None or (not mutant.on_loading and self._changed_in_place(mutant)):
            items = [self.items[name] for name in tests]
            items[0].config.pluginmanager.register(failures)
            for item, after in zip(items, [*items[1:], None], strict=True):
                item.ihook.pytest_runtest_protocol(item=item, nextitem=after)
                if failures.first:
                    break
        else:
            plant(mutant)
            for name in [name for name in sys.modules if name.split(".")[0] in ("posekit", "tests")]:
                del sys.modules[name]
            for _, some in groupby(tests, file_of):
                names = list(some)
                if pytest.main([*names, *OPTIONS], plugins=[failures]) not in (0, 1):
                    failures.first = failures.first or names[0]
                if failures.first:
                    break

    def _changed_in_place(self, mutant: Mutant) -> bool:
        """Give the functions of a file the code that they have with a fault, and tell whether that can be done."""
        path = ROOT / mutant.file
        source = path.read_text(encoding="utf-8")
        old, new = (compile(text, path, "exec") for text in (source, mutant.planted(source)))
        try:
            codes = dict(zip(_codes(old), _codes(new), strict=True))
            for function in self._functions[str(path)]:
                function.__code__ = codes[function.__code__]
        except (KeyError, ValueError):  # a function is gone, or closes over other names
            return False
        return True


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield all codes inside a code."""
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield each
            yield from _codes(each)


def _waited(child: int, reading: int, tests: list[str], patience: float) -> str | None:
    """Wait for a fork, and end it when its time is over by the clock, which says nothing: the machine may be busy."""
    ends = time.monotonic() + BUSY_MACHINE * patience
    status = None
    while status is None and time.monotonic() < ends:
        done, found = os.waitpid(child, os.WNOHANG)
        if done:
            status = found
        else:
            time.sleep(0.01)
    with os.fdopen(reading, "rb") as pipe:
        if status is None:
            with contextlib.suppress(ProcessLookupError):  # it has no group yet
                os.killpg(child, signal.SIGKILL)
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return ""
        os.set_blocking(pipe.fileno(), False)
        said = (pipe.read() or b"").decode()
    if os.WIFSIGNALED(status):
        return None if os.WTERMSIG(status) == signal.SIGXCPU else tests[0]
    return said


class Failures:
    """A pytest plugin that keeps which test fails first, and ends the process where one takes too long.

    Parameters
    ----------
    seconds : mapping
        How long each test takes the processor without a fault.
    patience : float
        Seconds that it may take beyond three times that.
    """

    def __init__(self, seconds: Mapping[str, float], patience: float) -> None:
        self.first = ""
        self._seconds, self._patience = seconds, patience

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Give a test its time."""
        allowed = math.ceil(sum(os.times()[:2]) + self._patience + 3 * self._seconds[nodeid])
        resource.setrlimit(resource.RLIMIT_CPU, (allowed, resource.RLIM_INFINITY))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep a test, also where its fixtures fail."""
        if report.failed:
            self.first = self.first or report.nodeid

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Keep a file that cannot be imported."""
        if report.failed:
            self.first = self.first or report.nodeid


def plant(mutant: Mutant) -> None:
    """Make the import of a file give it with its fault."""
    path = str(ROOT / mutant.file)
    usual = importlib.machinery.SourceFileLoader.get_code

    def get_code(self: importlib.machinery.SourceFileLoader, name: str) -> CodeType | None:
        if self.path != path:
            return usual(self, name)
        return compile(mutant.planted(Path(path).read_text(encoding="utf-8")), path, "exec")

    importlib.machinery.SourceFileLoader.get_code = get_code  # type: ignore[assignment, method-assign]


def as_line(mutant: Mutant, trial: Trial) -> str:
    """Return what came of a fault as a line of JSON."""
    return json.dumps({"name": mutant.name, **mutant._asdict(), **trial._asdict()})
