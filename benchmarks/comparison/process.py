"""Fresh processes: how long posekit takes to start, and how much memory views take."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.comparison.measure import Chart, Cost, Section, Sizes

REPOSITORY_ROOT = Path(__file__).resolve().parents[2]

START_COMMANDS = {
    "python -c pass": "pass",
    "import posekit": "import posekit",
    "posekit --help": "import sys; sys.argv = ['posekit', '--help']; from posekit.cli import main; main()",
    "import, load_figure()": "import posekit; posekit.load_figure()",
    "import, tree of one view": "from benchmarks.comparison.process import one_view; one_view()",
}

GROW_CODE = "from benchmarks.comparison.process import grow_views; grow_views({views})"


def one_view() -> None:
    """Recover one built-in view, from nothing."""
    from posekit.recovery import recover
    from posekit.views.builtin import builtin_view

    recover(builtin_view("seq2"))


def grow_views(views: int) -> None:
    """Grow so many trees, call by call, and print this process's peak of memory, KB."""
    import numpy as np

    from benchmarks.comparison.trees import CHUNK_VIEWS, grow, on, paths, physical_checks
    from posekit.body import load_figure
    from posekit.synthesis import random_views

    figure = load_figure()
    checks = physical_checks(figure)
    scene = random_views(figure, CHUNK_VIEWS, np.random.default_rng(0))
    with on(paths()[-1]):
        for _ in range(max(1, views // CHUNK_VIEWS)):
            grow(figure, scene, checks)
    print(_peak())


def _peak() -> int:
    """Return this process's peak of memory, KB; `getrusage` alone would count the process that started it."""
    try:
        status = Path("/proc/self/status").read_text(encoding="utf-8")
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(status.partition("VmHWM:")[2].split()[0])


def start_up(sizes: Sizes) -> Section:
    """Start each several times, in turns."""
    costs: dict[str, list[Cost]] = {name: [] for name in START_COMMANDS}
    for _ in range(sizes.starts):
        for name, code in START_COMMANDS.items():
            costs[name].append(_run(code)[1])
    least = {name: Cost(min(c.cpu for c in all_), min(c.wall for c in all_)) for name, all_ in costs.items()}
    base = least["python -c pass"].cpu
    return Section(
        title="Start-up",
        text=f"Fresh processes, the least of {sizes.starts}.",
        head=("what", "ms of one core", "ms on the clock", "times an empty Python"),
        rows=[
            (name, f"{cost.cpu * 1e3:.0f}", f"{cost.wall * 1e3:.0f}", f"{cost.cpu / base:.1f}")
            for name, cost in least.items()
        ],
        ratios={
            f"an empty Python against {name}": base / cost.cpu
            for name, cost in least.items()
            if cost.cpu != base
        },
        charts=(
            Chart(
                name="start-up",
                title="Start-up",
                y="ms of one core",
                bars={name: cost.cpu * 1e3 for name, cost in least.items()},
            ),
        ),
    )


def memory(sizes: Sizes) -> Section:
    """Grow few and many views in a process each, and compare their peaks."""
    few = max(1, sizes.memory // 10)
    peaks = {views: int(_run(GROW_CODE.format(views=views))[0]) / 1024 for views in (few, sizes.memory)}
    return Section(
        title="Memory",
        text="Peak of a process that grows trees call by call, one core; the views are made once.",
        head=("views", "peak, MB"),
        rows=[(f"{views:,}", f"{peak:.0f}") for views, peak in peaks.items()],
        ratios={"memory of a tenth of the views against all": peaks[few] / peaks[sizes.memory]},
    )


def _run(code: str) -> tuple[str, Cost]:
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        cwd=REPOSITORY_ROOT,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout, Cost(cpu, wall)
