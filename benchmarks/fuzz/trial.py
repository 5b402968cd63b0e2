"""One case in a fork: what it did, and whether that is clean."""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import resource
import shutil
import signal
import sys
import time
import traceback
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Final, NamedTuple

import jsonschema
import numpy as np

from benchmarks.fuzz.cases import Case
from posekit.formats.own.object_view_schema import OBJECT_VIEW_SCHEMA, ObjectViewFile
from posekit.formats.own.schemas import SCHEMA_NAMES, schema
from posekit.skeleton import POINTS

MEMORY_BYTES: Final = 4 << 30
PROCESSOR_SECONDS: Final = 20
PATIENCE_SECONDS: Final = 120.0
"""Of the clock: others may use the processor too."""
ENDING_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
LONGEST_REFUSAL: Final = 2000
TEXT_ENDINGS: Final = (".bvh", ".trc", ".mot", ".csv")
NOT_FINITE: Final = re.compile(r"(?i)(?<![\w.])[-+]?(nan|inf|infinity)(?![\w.])")
TRACEBACK: Final = "Traceback (most recent call last)"
CRASHED: Final = 70
"""The code of a fork that an exception ended."""


class Outcome(NamedTuple):
    """What came of a case: accepted, refused, or a fault in words."""

    what: str
    detail: str = ""

    @property
    def clean(self) -> bool:
        """Whether it is what posekit promises."""
        return self.what in ("accepted", "refused", "killed, all whole")


def run_command(arguments: list[str]) -> int:
    """Run a command in this process, and return its exit code."""
    sys.argv = ["posekit", *arguments]
    try:
        import_module("posekit.__main__").main()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return 0


def in_fork(
    arguments: list[str],
    said: Path,
    patience: float = PATIENCE_SECONDS,
    kill: tuple[int, float] = (0, 0.0),
    processor: int = PROCESSOR_SECONDS,
) -> int | None:
    """Run a command in a fork, its words in `said`, and return its exit code, -N of signal N; None for a hang.

    `kill` is a signal that it gets, and after how many seconds; 0 for none.
    """
    said.write_bytes(b"")  # a killed fork may not come to it
    # A signal that comes before the command begins says nothing of the command, which hears it later.
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING_SIGNALS)
    child = os.fork()
    if child == 0:
        code = CRASHED
        try:
            code = _run_alone(arguments, said, processor)
        finally:
            os._exit(code)  # whatever came: nothing of the parent's is taken away on a way out
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING_SIGNALS)
    started = time.monotonic()
    ends, killer = started + patience, kill[0]
    while time.monotonic() < ends:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            # Its processes end with it: what they say is not said of the next case.
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(child, signal.SIGKILL)
            return os.waitstatus_to_exitcode(status)
        if killer and time.monotonic() > started + kill[1]:
            os.kill(child, killer)
            killer = 0
        time.sleep(0.005)
    for end in (os.killpg, os.kill):
        try:
            end(child, signal.SIGKILL)
        except ProcessLookupError:
            continue
    os.waitpid(child, 0)
    return None


def _run_alone(arguments: list[str], said: Path, processor: int) -> int:
    """Run a command in this fork, within its limits, and return its exit code."""
    code = CRASHED
    try:
        os.setsid()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        out = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        source = os.devnull
        if "<" in arguments:
            place = arguments.index("<")
            source, arguments = arguments[place + 1], arguments[:place] + arguments[place + 2 :]
        os.dup2(os.open(source, os.O_RDONLY), 0)
        os.dup2(out, 1)
        os.dup2(out, 2)
        sys.stdout, sys.stderr = (os.fdopen(stream, "w", errors="backslashreplace") for stream in (1, 2))
        used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_BYTES, used + MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CPU, (processor, processor))
        code = run_command(arguments)
    except BaseException:
        os.write(2, traceback.format_exc().encode(errors="replace"))
    finally:
        signal.pthread_sigmask(signal.SIG_BLOCK, ENDING_SIGNALS)  # the command has ended
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
    return code


def tried(case: Case, seeds: Path, folder: Path) -> Outcome:
    """Try a case in a folder that is emptied before."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    top = case.name.partition("/")[0]
    if top != case.name:
        shutil.copytree(seeds / top, folder / top)
    if case.name:
        (folder / case.name).write_bytes(case.data)
    if case.kind == "options":  # an odd value may name a whole file as the one to be written
        seeds = shutil.copytree(seeds, folder / "seeds", copy_function=os.link)
    arguments = placed(case.arguments, folder / top, folder / "out", seeds)
    before = {path.name for path in folder.iterdir()}
    here = Path.cwd()
    os.chdir(folder)
    try:
        code = in_fork(arguments, folder.with_suffix(".said"), kill=(case.killed_by, case.killed_after))
    finally:
        os.chdir(here)
    if case.killed_by and code not in (0, 1, 2):
        return _killed(case, code, folder)
    if code in (None, -signal.SIGXCPU, -signal.SIGKILL):
        return Outcome("hang", " ".join(arguments))
    said = folder.with_suffix(".said").read_text(encoding="utf-8", errors="replace")
    written = [path for path in folder.iterdir() if path.name not in before]
    if code < 0:
        return Outcome(f"signal {-code}", said[-300:])
    if code == CRASHED or TRACEBACK in said:
        return Outcome("traceback", said[max(said.find(TRACEBACK) - 200, 0) :][:3000])
    if code == 2:
        return _refusal(said, written)
    if code not in (0, 1):
        return Outcome(f"exit {code}", said[-300:])
    found = _accepted(written, folder)
    return _answered(said) if found.clean and case.arguments[0] == "follow" else found


def _answered(said: str) -> Outcome:
    """Judge the lines of a live stream: each is JSON whose numbers are finite."""
    try:
        for line in said.splitlines():
            if not line.startswith("posekit: "):
                _in_domain(json.loads(line, parse_constant=_not_finite))
    except ValueError as error:
        return Outcome("not finite", f"{error}: {said[-300:]}")
    return Outcome("accepted")


def _killed(case: Case, code: int | None, folder: Path) -> Outcome:
    """Judge what a signal left: no traceback, whole files only, and beside them none but of SIGKILL."""
    said = folder.with_suffix(".said").read_text(encoding="utf-8", errors="replace")
    if code is None:
        return Outcome("hang", said[-300:])
    if TRACEBACK in said:
        return Outcome("traceback", said[max(said.find(TRACEBACK) - 200, 0) :][:3000])
    # A batch ends alike on both: 130, and what to run to go on.
    if code not in (-case.killed_by, 128 + case.killed_by, 128 + signal.SIGINT):
        return Outcome(f"exit {code} of signal {case.killed_by}", said[-300:])
    if case.killed_by == signal.SIGKILL:
        for part in [path for path in folder.rglob("*.part*") if path.is_file()]:
            part.unlink()
    found = _accepted(list(folder.iterdir()), folder)
    return Outcome("killed, all whole") if found.clean else found


def placed(arguments: list[str], damaged: Path, out: Path, seeds: Path) -> list[str]:
    """Put places in where arguments begin with IN, OUT or SEEDS."""
    places = {"IN": str(damaged), "OUT": str(out), "SEEDS": str(seeds)}
    return [_placed(argument, places) for argument in arguments]


def _placed(argument: str, places: dict[str, str]) -> str:
    for word, place in places.items():
        if argument == word or argument.startswith((f"{word}/", f"{word}.")):
            return place + argument[len(word) :]
    return argument


def _refusal(said: str, written: list[Path]) -> Outcome:
    """Judge a refusal: one line, and nothing is written."""
    lines = [line for line in said.splitlines() if line.startswith("posekit: error:")]
    if len(lines) != 1 or len(lines[0]) > LONGEST_REFUSAL:
        return Outcome("not one line", said[-600:])
    if not lines[0].isprintable():
        return Outcome("not printable", repr(lines[0])[:600])
    if written:
        return Outcome("half-written", f"{[path.name for path in written]} {lines[0]}")
    return Outcome("refused")


def _accepted(written: list[Path], folder: Path) -> Outcome:
    """Judge what was written: posekit reads it again, and JSON holds finite numbers only."""
    for path in sorted(
        path for top in written for path in ((top, *top.rglob("*")) if top.is_dir() else (top,))
    ):
        if path.is_dir():
            continue
        if path.name.endswith(".part"):
            return Outcome("left over", path.name)
        if path.suffix == ".json":
            fault = _json_fault(path)
            if fault is not None:
                return fault
        if path.suffix in TEXT_ENDINGS:
            odd = NOT_FINITE.search(path.read_text(encoding="utf-8"))
            if odd is not None:
                return Outcome("not finite", f"{path.name}: {odd[0]!r}")
        if path.suffix == ".npz":
            with np.load(path) as held:
                infinite = [
                    name for name in held.files if held[name].dtype.kind == "f" and np.isinf(held[name]).any()
                ]
            if infinite:
                return Outcome("not finite", f"{path.name}: {infinite}")
        if path.suffix in (".json", ".npz", ".bvh", ".trc") and path.parent == folder:
            again = folder.with_suffix(".again")
            refused = in_fork(["inspect", str(path)], again) != 0
            # `inspect` reads views of people only, and says so of a view of an object.
            if refused and "recover it with --linkage" not in again.read_text(errors="replace"):
                return Outcome("not read again", f"{path.name}: {again.read_text(errors='replace')[-400:]}")
    return Outcome("accepted")


def _json_fault(path: Path) -> Outcome | None:
    """Judge a JSON file: its numbers are finite, and it is what its published schema says."""
    try:
        held = json.loads(path.read_text(encoding="utf-8"), parse_constant=_not_finite)
        _in_domain(held)
    except ValueError as error:
        return Outcome("not finite", f"{path.name}: {error}")
    if isinstance(held, dict) and held.get("schema") in SCHEMA_NAMES:
        wrong = next(_validator(held["schema"], _is_of_object(held)).iter_errors(held), None)
        if wrong is not None:
            return Outcome("not of its schema", f"{path.name}: {wrong.json_path}: {wrong.message}"[:600])
    return None


@cache
def _validator(name: str, of_object: bool) -> Any:
    return jsonschema.Draft202012Validator(ObjectViewFile.model_json_schema() if of_object else schema(name))


def _is_of_object(held: dict[str, Any]) -> bool:
    """Tell a view of an object, which has the points of its linkage, from a person's."""
    frames = held["frames"] if held["schema"] == OBJECT_VIEW_SCHEMA and "frames" in held else [{}]
    return not frames[0].get("image", {}).keys() <= set(POINTS)


def _in_domain(held: object) -> None:
    """Refuse a number too large for a double, and a probability that is none."""
    if isinstance(held, float) and not math.isfinite(held):
        raise ValueError(f"{held} is no number")
    if isinstance(held, dict):
        probability = held.get("probability")
        if isinstance(probability, float | int) and not -1e-9 <= probability <= 1.0 + 1e-9:
            raise ValueError(f"{probability} is no probability")
    if isinstance(held, dict | list):
        for value in held.values() if isinstance(held, dict) else held:
            _in_domain(value)


def _not_finite(word: str) -> float:
    raise ValueError(f"{word} is no number")
