"""Batches: what a process takes as frames grow, what a second worker brings, and what is left of a run that is killed.

    python benchmarks/batch.py scale [--views 200000] [--distinct 20000] [--two 40000] [--turns 2]
    python benchmarks/batch.py kills [--kills 20] [--views 20000] [--cluster local] [--seed 0]

``scale`` recovers a table of synthetic views (random legal postures from random cameras; `--distinct` of them over and
over), and prints the memory of driver and workers by tenths of the run. Then it recovers the first `--two` of them with
one worker, with two, and in two runs of one worker each that know nothing of each other: by the clock, which says
little where others use the cores, and by processor time. What two such runs do is what two cores of the machine are
worth; what two workers of one run do less is the driver's doing.
``kills`` kills a run with SIGKILL at random moments, a worker or the driver, starts it again whenever the driver
is gone, lets it end, and compares every byte with a run that was left alone.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from posekit.batch import (
    Progress,
    Recipe,
    Summary,
    Workers,
    read_frames,
    run_batch,
    shard_paths,
    write_view_table,
)
from posekit.body import load_figure
from posekit.formats.markdown import table_lines
from posekit.formats.own import View
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

PIECE_VIEWS = 5000
BYTES_PER_MIB = 2**20


def views(count: int, distinct: int) -> Iterator[View]:
    """Draw views in pieces, the same again after so many."""
    for start in range(0, count, PIECE_VIEWS):
        seed = start % distinct
        yield view_of(
            random_views(load_figure(), min(PIECE_VIEWS, count - start), np.random.default_rng(seed))
        )


class Memory(threading.Thread):
    """Looks at the memory of this process and its children twice a second, by tenths of a run."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.tenth = 0
        self.driver: Counter[int] = Counter()
        self.worker: Counter[int] = Counter()
        self.ended = threading.Event()

    def run(self) -> None:
        while not self.ended.wait(0.5):
            self.driver[self.tenth] = max(self.driver[self.tenth], resident(os.getpid()))
            for child in children(os.getpid()):
                self.worker[self.tenth] = max(self.worker[self.tenth], resident(child))

    def see(self, now: Progress) -> None:
        if now.stage == "recovering":
            self.tenth = min(9, 10 * now.done // max(now.total, 1))


def resident(pid: int) -> int:
    """Return the memory that a process holds, bytes; 0 where it is gone."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmRSS")), 0)


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    try:
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


WARM_UP_SHARE = 0.4
"""Part of a run after which its workers are compared: until then each loads compiled loops, which it does once whatever
comes after."""


class Steady:
    """The rate of the rest of a run, when processes are up and have loaded their code."""

    def __init__(self, memory: Memory | None) -> None:
        self.memory = memory
        self.seen: list[tuple[float, float, int]] = []

    def see(self, now: Progress) -> None:
        if self.memory is not None:
            self.memory.see(now)
        if now.stage == "recovering":
            self.seen.append((time.monotonic(), sum(map(processor_time, children(os.getpid()))), now.done))

    @property
    def rates(self) -> tuple[float, float]:
        """Views a second by the clock, and by the processor time of all workers."""
        later, cpu_later, done_later = self.seen[-1]
        clock, cpu, done = next(one for one in self.seen if one[2] >= WARM_UP_SHARE * done_later)
        return (done_later - done) / (later - clock), (done_later - done) / (cpu_later - cpu)


def processor_time(pid: int) -> float:
    """Return the processor time that a process has taken, seconds."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def timed(
    table: Path, out: Path, recipe: Recipe, jobs: int, memory: Memory | None = None
) -> tuple[Summary, Steady]:
    """Run a batch, and look at its rate."""
    steady = Steady(memory)
    return run_batch([table], out, recipe, Workers(jobs=jobs), progress=steady.see), steady


def scale(given: argparse.Namespace, place: Path) -> None:
    recipe = Recipe(rank=given.rank)
    table = place / "views.parquet"
    write_view_table(table, views(given.views, given.distinct))
    small = place / "small.parquet"
    write_view_table(small, views(given.two, given.distinct))
    memory = Memory()
    memory.start()
    summary, steady = timed(table, place / "all", recipe, 2, memory)
    memory.ended.set()
    size = sum(path.stat().st_size for path in shard_paths(place / "all"))
    print(f"load averages {os.getloadavg()}, {os.cpu_count()} cores\n")
    print(
        f"{summary.frames:,} views, {summary.survivors:,} survivors in {summary.shards} shards, "
        f"{size / BYTES_PER_MIB:,.0f} MiB: {summary.seconds:.0f} s; "
        f"{steady.rates[1]:,.0f} views a second of processor time\n"
    )
    rows = [
        [
            f"{10 * k}-{10 * k + 10} %",
            f"{memory.driver[k] / BYTES_PER_MIB:.0f}",
            f"{memory.worker[k] / BYTES_PER_MIB:.0f}",
        ]
        for k in range(10)
    ]
    print("\n".join(table_lines(["part of the run", "driver, MiB", "a worker, MiB"], rows)), "\n")
    rows = []
    for turn in range(given.turns):
        for jobs in (1, 2):
            _, steady = timed(small, place / f"small{turn}{jobs}", recipe, jobs)
            clock, cpu = steady.rates
            rows.append([f"{jobs} of one run", f"{clock:,.0f}", f"{cpu:,.0f}"])
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
            runs = [pool.submit(alone, small, place / f"apart{turn}{k}", recipe) for k in range(2)]
            clocks, cpus = zip(*(run.result() for run in runs), strict=True)
        rows.append(["1 of each of two runs", f"{sum(clocks):,.0f}", f"{sum(cpus) / 2:,.0f}"])
    print("\n".join(table_lines(["workers", "views/s by the clock", "views/s of processor time"], rows)))


def kills(given: argparse.Namespace, place: Path) -> None:
    rng = random.Random(given.seed)
    table, out = place / "views.parquet", place / "out"
    write_view_table(table, views(given.views, given.distinct))
    command = [
        sys.executable,
        "-c",
        "from posekit.cli import main; main()",
        "batch",
        str(table),
        "-o",
        str(out),
    ]
    command += ["--jobs", "2", "--shard-frames", "200", "--no-rank"]
    if given.cluster:
        command += ["--cluster", given.cluster]
    begun, struck, mark = 0, Counter[str](), 0
    run: subprocess.Popen[bytes] | None = None
    while struck.total() < given.kills:
        if run is None or run.poll() is not None:
            if run is not None and run.returncode == 0:
                raise SystemExit("the run ended before all kills; give more --views")
            run, begun = (
                subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL),
                begun + 1,
            )
        shards = out / "shards"
        while run.poll() is None and (len(list(shards.glob("*"))) if shards.is_dir() else 0) <= mark:
            time.sleep(0.01)  # so that each time something new is done, or in the making
        time.sleep(rng.random())
        mark = len(list(shards.glob("*")))
        workers = [pid for pid in children(run.pid) if b"spawn_main" in command_of(pid)]
        who, pid = ("worker", rng.choice(workers)) if workers and rng.random() < 0.6 else ("driver", run.pid)
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue
        struck[who] += 1
    if run is not None:
        run.wait()
    last = subprocess.run(command, check=False, capture_output=True, text=True)
    print(
        f"killed {dict(struck)}, begun {begun + 1} times; the last: exit {last.returncode}: {last.stdout.strip()}"
    )
    reference = run_batch(
        [table], place / "left-alone", Recipe(rank=False, shard_frames=200), Workers(jobs=2)
    )
    found: Counter[int] = Counter()
    for frames in read_frames(out):
        found.update(frames.column("frame").to_pylist())
    print(f"frames: {len(found):,} of {given.views:,}, {sum(n > 1 for n in found.values())} of them twice")
    ours, theirs = (
        {path.name: path.read_bytes() for path in shard_paths(place / name)} for name in ("out", "left-alone")
    )
    same = sum(ours.get(name) == content for name, content in theirs.items())
    print(f"shards: {len(ours)}, {same} of {reference.shards} the same bytes as of a run that was left alone")


def command_of(pid: int) -> bytes:
    """Return how a process was started."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def alone(table: Path, out: Path, recipe: Recipe) -> tuple[float, float]:
    """Return the rates of a run of one worker."""
    return timed(table, out, recipe, 1)[1].rates


MIN_VIEWS_COMPARED = 20_000
"""Views below which one worker and two are not compared."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", choices=("scale", "kills"))
    parser.add_argument("--views", type=int, default=None)
    parser.add_argument("--distinct", type=int, default=20_000)
    parser.add_argument("--two", type=int, default=40_000)
    parser.add_argument("--turns", type=int, default=2)
    parser.add_argument("--rank", action="store_true")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--cluster", default="")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if given.two < MIN_VIEWS_COMPARED or (
        given.study == "scale" and given.views is not None and given.views < MIN_VIEWS_COMPARED
    ):
        parser.error(
            f"--views, --two: expected {MIN_VIEWS_COMPARED:,} or more: fewer are done before they can be timed"
        )
    given.views = given.views or (200_000 if given.study == "scale" else 20_000)
    place = Path(tempfile.mkdtemp(prefix="batch-"))
    try:
        (scale if given.study == "scale" else kills)(given, place)
    finally:
        shutil.rmtree(place)


if __name__ == "__main__":
    main()
