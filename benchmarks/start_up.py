"""Start-up: commands in fresh processes, what compiled loops cost to load or to compile, and from where they pay.

    python benchmarks/start_up.py [--runs 10] [--frames 2000]

Processes take turns, so that what else the machine does falls on all of them alike. Each line has the least and the
median of the clock, the least of the processor's time, and the ratio of that to `import pinocchio, numpy`, without
which no posture is certified. The code that was compiled is kept in a folder of this run's own.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BASE = "import pinocchio, numpy"
RECOVER = """
from posekit.compiled.compiling import path
from posekit.recovery import recover
from posekit.views.builtin import builtin_view
with path({way!r}):
    recover(builtin_view("seq1"))
"""
PER_FRAME = """
import time
import numpy as np
from posekit.body import load_figure
from posekit.compiled.compiling import path, use_threads
from posekit.recovery import recover
from posekit.settings import EXACT_TOLERANCE, MEASURED_TOLERANCE
from posekit.synthesis import random_views
from posekit.views.builtin import view_of
use_threads(1)
view = view_of(random_views(load_figure(), {frames}, np.random.default_rng(0)))
for tolerance in (EXACT_TOLERANCE, MEASURED_TOLERANCE):
    spent = {{"plain": [], "fast": []}}
    for turn in range(5):
        for way in spent:
            with path(way):
                start = time.process_time()
                recover(view, tolerance=tolerance)
                spent[way].append(time.process_time() - start)
    print(*(min(seconds[1:]) / {frames} for seconds in spent.values()))
"""


def command(*arguments: str) -> list[str]:
    """Return what runs the command line."""
    code = f"import sys; sys.argv = {['posekit', *arguments]!r}; from posekit.cli import main; main()"
    return ["-c", code]


def spend(arguments: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Run Python once: seconds of the clock and of the processor."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)
    after, clock = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
    return clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--frames", type=int, default=2000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(folder / "bytecode")}
        environment["NUMBA_CACHE_DIR"] = str(folder / "machine-code")
        environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        view = str(folder / "view.json")
        subprocess.run(
            [sys.executable, *command("synth", "walker", "-o", view, "--frames", "1")],
            check=True,
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        started = {
            "python -c pass": ["-c", "pass"],
            BASE: ["-c", BASE],
            "import posekit": ["-c", "import posekit"],
            "posekit --help": command("--help"),
            "import posekit, load_figure()": ["-c", "import posekit; posekit.load_figure()"],
            "posekit recover, one exact frame": command("recover", view, "-o", str(folder / "result.npz")),
            "import numba": ["-c", "import numba"],
            "five frames, NumPy": ["-c", RECOVER.format(way="plain")],
            "five frames, compiled before": ["-c", RECOVER.format(way="fast")],
        }
        first = spend(started["five frames, compiled before"], environment)
        for arguments in started.values():
            spend(arguments, environment)
        spent: dict[str, list[tuple[float, float]]] = {name: [] for name in started}
        for _ in range(options.runs):
            for name, arguments in started.items():
                spent[name].append(spend(arguments, environment))
        least = {name: min(cpu for _, cpu in turns) for name, turns in spent.items()}
        for name, turns in spent.items():
            clock = [seconds for seconds, _ in turns]
            print(
                f"{name:34} {min(clock):6.2f} s at least, median {statistics.median(clock):6.2f}; "
                f"processor {least[name]:5.2f} s, {least[name] / least[BASE]:5.2f} x"
            )
        print(f"{'five frames, nothing compiled yet':34} {first[0]:6.2f} s once; processor {first[1]:5.2f} s")
        code = PER_FRAME.format(frames=options.frames)
        done = subprocess.run(
            [sys.executable, "-c", code], check=True, env=environment, capture_output=True, text=True
        )
    loading = least["five frames, compiled before"] - least["five frames, NumPy"]
    compiling = first[1] - least["five frames, NumPy"]
    for kind, line in zip(("exact", "measured"), done.stdout.splitlines(), strict=True):
        plain, fast = map(float, line.split())
        pays = [f"{seconds:.1f} s from {seconds / (plain - fast):,.0f}" for seconds in (loading, compiling)]
        print(
            f"an {kind} frame" if kind == "exact" else f"a {kind} frame",
            f"takes {plain * 1e6:.0f} µs in NumPy, {fast * 1e6:.0f} compiled, {plain / fast:.2f} x: "
            f"loading pays its {pays[0]} frames, compiling its {pays[1]}",
        )


if __name__ == "__main__":
    main()
