"""One fault at a time in a fork: the tests that run its line, nearest and fastest first, until one fails."""

from __future__ import annotations

import contextlib
import importlib
import importlib.machinery
import json
import math
import os
import pkgutil
import resource
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Final, Literal, NamedTuple

import pytest

from benchmarks.mutants.files import ROOT
from benchmarks.mutants.mutations import Mutant

FIRST_TESTS: Final = 25
"""The first few usually find a fault: the others are not collected for them."""
TESTED_SECONDS: Final = 60.0
"""How long the tests that run a fault's line may take the processor by the map, unless told otherwise: more may find
more."""
FILE_SECONDS: Final = 20.0
"""How long near tests of other lines of its file may take besides, in that time."""
ALSO_NEAR: Final = {"validators": ("validation",), "cameras": ("recovery",), "tree": ("recovery",)}
"""Rooms whose tests are near, beside the file's own."""
PATIENCE_SECONDS: Final = 20.0
"""Of processor, beyond three times what the map says: a fault that does not end is found."""
BUSY_MACHINE: Final = 10.0
"""How many times as long that may last by the clock, where other processes run."""
MEMORY_BYTES: Final = 8 << 30

Outcome = Literal["killed", "survived", "endless"]


class Trial(NamedTuple):
    """What came of a fault: the test that found it, or none; and how long that took."""

    outcome: Outcome
    by: str
    seconds: float


def load_libraries() -> None:
    """Import posekit with everything that it needs, and forget posekit: forks have the libraries loaded."""
    import posekit

    for module in pkgutil.walk_packages(posekit.__path__, "posekit."):
        importlib.import_module(module.name)
    for name in [name for name in sys.modules if name.split(".")[0] == "posekit"]:
        del sys.modules[name]


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
    own = lines.get(mutant.line, of_file) & of_file
    # A line that no test runs was run by whatever was imported first: any of them may read what it made.
    loading = mutant.on_loading or not own
    beside = tested + FILE_SECONDS * tested / TESTED_SECONDS
    if loading:
        rounds = (near & of_file, tested / 2), (near - of_file, tested), (of_file - near, beside)
    else:
        rounds = (own & near, tested), (own - near, tested), ((near & of_file) - own, beside)
    chosen: list[str] = []
    total = 0.0
    for names, limit in rounds:
        # Of one file together, which costs its import: those of the file whose tests are the fastest come first.
        held: dict[str, list[float]] = {}
        for name in names:
            held.setdefault(name.split("::")[0], []).append(seconds[name])
        mean = {name: sum(held[file]) / len(held[file]) for name in names for file in [name.split("::")[0]]}
        for name in sorted(names, key=lambda n: (mean[n], seconds[n], n)):
            if total + seconds[name] <= limit or not chosen:
                chosen.append(name)
                total += seconds[name]
    return chosen


def tried(mutant: Mutant, tests: list[str], seconds: dict[str, float], fails: Callable[[str], bool]) -> Trial:
    """Run tests on a fault until one fails that passes without it."""
    began = time.monotonic()
    left = tests
    while left:
        some, left = left[:FIRST_TESTS], left[FIRST_TESTS:]
        if len(tests) - len(left) > FIRST_TESTS:
            some, left = some + left, []
        found = in_fork(mutant, some, PATIENCE_SECONDS + 3 * sum(seconds[name] for name in some))
        if found is None:
            return Trial("endless", "", time.monotonic() - began)
        if found:
            if not fails(found):
                return Trial("killed", found, time.monotonic() - began)
            left = [name for name in (*some, *left) if name != found]
    return Trial("survived", "", time.monotonic() - began)


def in_fork(mutant: Mutant | None, tests: list[str], patience: float) -> str | None:
    """Run tests in a fork, and return the first that fails, empty where none does, None where they do not end."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        code = 1
        try:
            os.setsid()
            null = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(null, stream)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
            allowed = math.ceil(sum(os.times()[:2]) + patience)
            resource.setrlimit(resource.RLIMIT_CPU, (allowed, allowed + 60))
            os.chdir(ROOT)
            if mutant is not None:
                plant(mutant)
            first = FirstFailure(writing)
            done = pytest.main([*tests, "-x", "-q", "-p", "no:cacheprovider"], plugins=[first])
            code = int(done)
            if code not in (0, 1) and not first.told:
                os.write(writing, tests[0].encode())
        except BaseException:
            os.write(writing, tests[0].encode())
        finally:
            os._exit(code)
    os.close(writing)
    return _waited(child, reading, tests, patience)


def _waited(child: int, reading: int, tests: list[str], patience: float) -> str | None:
    """Wait for a fork, and end it when its time is over."""
    ends = time.monotonic() + BUSY_MACHINE * patience
    status = None
    while status is None and time.monotonic() < ends:
        done, found = os.waitpid(child, os.WNOHANG)
        if done:
            status = found
        else:
            time.sleep(0.02)
    with os.fdopen(reading, "rb") as pipe:
        if status is None:
            with contextlib.suppress(ProcessLookupError):  # it has no group yet
                os.killpg(child, signal.SIGKILL)
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return None
        os.set_blocking(pipe.fileno(), False)
        said = (pipe.read() or b"").decode()
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU:
        return None
    if not said and (os.WIFSIGNALED(status) or os.waitstatus_to_exitcode(status) != 0):
        return tests[0]
    return said


class FirstFailure:
    """Tells which test failed first."""

    def __init__(self, pipe: int) -> None:
        self._pipe, self.told = pipe, False

    def tell(self, name: str) -> None:
        """Say it once."""
        if not self.told:
            self.told = True
            os.write(self._pipe, name.encode())

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Tell of a test or of its fixtures."""
        if report.failed:
            self.tell(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Tell of a file that cannot be imported."""
        if report.failed:
            self.tell(report.nodeid)


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
