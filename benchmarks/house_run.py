"""Measure how a command runs, of any checkout: modules loaded, frames on the stack, start-up. Prints JSON.

    python benchmarks/house_run.py [CHECKOUT]

- Modules are those in `sys.modules` after `posekit recover` of one exact frame, in a process of its own.
- Frames on the stack are posekit's own, from the command line's `main` to a check's `judge`, both counted (those of
  comprehensions are not: Python 3.12 has none). Each check's `judge` is wrapped, wherever in `posekit.validators`, and
  one exact and one noisy frame are recovered by each way through the tree.
- Times are of the clock, the median of five turns in which all take part; what is printed are their ratios. Bytecode is
  kept in a folder of this run's own, as what is installed has its.
"""

from __future__ import annotations

import argparse
import json
import os
import pkgutil
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import nullcontext, redirect_stdout, suppress
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import FrameType
from typing import Any, get_args, get_type_hints

ROOT = Path(__file__).resolve().parents[1]
TURNS = 5
MANY_FRAMES = 1000
COMMAND = "from posekit.cli import main; main()"
LOADED = """
import json, sys
sys.argv = ["posekit", "recover", "one.json", "-o", "loaded.json"]
from posekit.cli import main
try:
    main()
except SystemExit as ended:
    assert not ended.code, ended.code
print(json.dumps([name for name, module in sys.modules.items() if module]))
"""
COMPREHENSIONS = {"<listcomp>", "<setcomp>", "<dictcomp>", "<genexpr>"}


def run(code: str, *arguments: str) -> str:
    """Run Python code in a fresh process and return what it prints."""
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def loaded() -> list[str]:
    """Name the modules that recovering one frame loads."""
    return sorted(json.loads(run(LOADED).splitlines()[-1]))


def judging_classes() -> set[type]:
    """Find the classes with a `judge` of their own in posekit.validators, wherever they are."""
    package = import_module("posekit.validators")
    for module in pkgutil.walk_packages(package.__path__, "posekit.validators."):
        with suppress(ImportError):  # of an extra that is not installed
            import_module(module.name)
    names = [name for name in sys.modules if name.startswith("posekit.validators")]
    found = {c for name in names for c in vars(sys.modules[name]).values() if isinstance(c, type)}
    return {c for c in found if "judge" in vars(c) and c.__module__.startswith("posekit.")}


def chain(frame: FrameType | None) -> tuple[str, ...]:
    """Name posekit's own frames from the outermost to this one."""
    names: list[str] = []
    while frame is not None:
        module = frame.f_globals.get("__name__", "")
        if module.startswith("posekit.") and frame.f_code.co_name not in COMPREHENSIONS:
            names.append(f"{module.removeprefix('posekit.')}.{frame.f_code.co_qualname}")
        frame = frame.f_back
    return tuple(reversed(names))


def switch_of_paths() -> Any:
    """Return the function that chooses a way through the tree, None where this checkout has none."""
    package = import_module("posekit")
    for path in sorted(Path(package.__path__[0]).rglob("*.py")):
        if "\ndef use_threads(" in path.read_text(encoding="utf-8"):
            place = path.relative_to(Path(package.__path__[0]).parent).with_suffix("")
            name = ".".join(part for part in place.parts if part != "__init__")
            return getattr(import_module(name), "path", None)
    return None


def chains(view: str) -> dict[str, list[tuple[str, ...]]]:
    """Recover a view by each way through the tree, and return the chains of calls that ended in a check's `judge`."""
    met: set[tuple[str, ...]] = set()

    def watched(judge: Any) -> Any:
        def judged(*arguments: Any, **keywords: Any) -> Any:
            met.add((*chain(sys._getframe(1)), "judge"))
            return judge(*arguments, **keywords)

        return judged

    for kind in judging_classes():
        setattr(kind, "judge", watched(vars(kind)["judge"]))  # noqa: B010 - mypy forbids the plain assignment
    main = import_module("posekit.cli").main
    switch = switch_of_paths()
    names = ("auto",) if switch is None else get_args(next(iter(get_type_hints(switch).values())))
    found = {}
    for name in names:
        met.clear()
        sys.argv = ["posekit", "recover", view, "-o", "watched.json"]
        with nullcontext() if switch is None else switch(name), redirect_stdout(StringIO()):
            try:
                main()
            except SystemExit as ended:
                if ended.code:
                    raise
        found[name] = sorted(met)
    return found


def times(commands: dict[str, tuple[str, ...]]) -> dict[str, float]:
    """Time commands in turns, after one that is not counted, and return the median of each, seconds."""
    seconds: dict[str, list[float]] = {name: [] for name in commands}
    for turn in range(TURNS + 1):
        for name, command in commands.items():
            start = time.perf_counter()
            run(*command)
            if turn:
                seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(each) for name, each in seconds.items()}


def measure() -> dict[str, Any]:
    """Measure in the current folder: ``figures`` for a table and ``lists`` of what they count."""
    run(COMMAND, "synth", "random", "-o", "one.json")
    run(COMMAND, "synth", "random", "-o", "noisy.json", "--noise", "2", "--seed", "3")
    run(COMMAND, "synth", "random", "-o", "many.json", "--frames", str(MANY_FRAMES))
    modules = loaded()
    watched: dict[str, list[list[str]]] = {}
    for view in ("one", "noisy"):
        found = subprocess.run(
            [sys.executable, __file__, "--chains", f"{view}.json"], check=True, stdout=subprocess.PIPE
        )
        watched |= {f"{view} frame, {path}": each for path, each in json.loads(found.stdout).items()}
    deepest = {name: max(each, key=len) for name, each in watched.items() if each}
    took = times(
        {
            "imports": ("import pinocchio, numpy",),
            "one": (COMMAND, "recover", "one.json", "-o", "timed.json"),
            "many": (COMMAND, "recover", "many.json", "-o", "timed.npz"),
        }
    )
    figures = {
        "modules loaded by recover of one frame": len(modules),
        "of these posekit's": sum(name.split(".")[0] == "posekit" for name in modules),
        **{f"frames from main to judge, {name}": len(each) for name, each in deepest.items()},
        "frames from main to judge, the most": max(map(len, deepest.values()), default=0),
        "recover of one frame / import pinocchio, numpy": round(took["one"] / took["imports"], 2),
        f"recover of {MANY_FRAMES:,} frames to NPZ / of one": round(took["many"] / took["one"], 2),
    }
    lists = {
        **{f"judge was called by, {name}": [" > ".join(c) for c in each] for name, each in watched.items()},
        "seconds, medians": [f"{name} {seconds:.3f}" for name, seconds in took.items()],
        "modules loaded": modules,
    }
    return {"figures": figures, "lists": lists}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("checkout", type=Path, nargs="?", default=ROOT)
    parser.add_argument("--chains", metavar="VIEW", help="only the calls that end in judge, of one view")
    given = parser.parse_args()
    if given.chains:
        print(json.dumps(chains(given.chains)))
        return
    os.environ["PYTHONPATH"] = str(given.checkout.resolve())
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        os.environ["PYTHONPYCACHEPREFIX"] = str(Path(folder, "bytecode"))
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        if not Path(run("import posekit; print(posekit.__file__)")).is_relative_to(given.checkout.resolve()):
            parser.error(f"this Python does not import posekit from {given.checkout}")
        print(json.dumps(measure()))
        os.chdir(given.checkout.resolve())


if __name__ == "__main__":
    main()
