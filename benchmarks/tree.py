"""The interpretation tree against brute force on the same views, its plain path against the compiled one, and rates.

    python benchmarks/tree.py [--views 200] [--batch 4000] [--mocap CAPTURE.npz] [--cameras 4]

Brute force lifts all 8192 leaves of a view, in one NumPy batch, and asks every check about every leaf that has a
solution; collisions are asked of Pinocchio's pool over whole configurations. The tree's collisions are coal's too.
Survivors must be identical. With `--mocap` views of real motion are taken as well, as they are judged by default: each
frame of the capture seen by some cameras, one tree a clip, whose person has lengths of their own. All of them then go
through `posekit.recover`: of random ones the head tells the neck, of real motion the neck is given; each clip seen by a
camera is a view. Rates are best of five, on one thread, on two, and in two processes with a thread each; ratios are of
one run on one machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing import Queue, get_context
from multiprocessing.synchronize import Barrier
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import posekit
from posekit.body import Figure, load_figure
from posekit.cameras import Camera
from posekit.compiled import compiling as compiled
from posekit.formats.own import View
from posekit.geometry import Array
from posekit.settings import EXACT_TOLERANCE, MEASURED_TOLERANCE, Tolerance
from posekit.skeleton import JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import SyntheticScene, mocap_scenes, random_views, read_capture
from posekit.tree import Check, InterpretationTree, Leaves, enumerate_leaves
from posekit.validators import judge, load_ranges, make_checks
from posekit.views.builtin import view_of

CHUNK_FRAMES = 2000
"""Frames a call."""

N_PROCESSES = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Job:
    """Views of one person."""

    figure: Figure
    camera: Camera
    root: Array
    image: Array
    head: Array
    tolerance: Tolerance

    @staticmethod
    def of(scenes: Sequence[SyntheticScene], tolerance: Tolerance) -> Job:
        """Put scenes of one person and one kind of camera together."""
        return Job(
            figure=scenes[0].figure,
            camera=scenes[0].camera,
            root=np.concatenate([scene.joints_cam[:, 0] for scene in scenes]),
            image=np.concatenate([scene.image for scene in scenes]),
            head=np.concatenate([scene.head_cam for scene in scenes]),
            tolerance=tolerance,
        )

    @property
    def lengths(self) -> Array:
        """The tree's lengths, metres."""
        return np.array([0.0, *(self.figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)])

    def checks(self) -> list[Check]:
        """Make all physical checks."""
        return make_checks(
            self.figure,
            ("rigid-parts", "joint-range", "collision"),
            ranges=load_ranges("urdf"),
            rigid_tolerance=self.tolerance.rigid,
            rigid_mode="placement" if self.tolerance.placement else "side",
            angle_tolerance=self.tolerance.angle,
        )


def grow(
    job: Job, checks: list[Check], frames: slice = slice(None), chunk: int = CHUNK_FRAMES
) -> list[Leaves]:
    """Grow the trees of some frames."""
    tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=job.lengths)
    rows = np.arange(len(job.image))[frames]
    return [
        tree.grow(
            job.camera,
            job.root[part],
            job.image[part],
            checks,
            given=job.head[part],
            tolerance=job.tolerance.tangent,
        )
        for part in (rows[first : first + chunk] for first in range(0, len(rows), chunk))
    ]


def codes(grown: Sequence[Leaves]) -> list[NDArray[np.int32]]:
    """Return the surviving codes of each frame."""
    return [leaves.code[a:b] for leaves in grown for a, b in pairwise(leaves.offsets())]


def brute_force(job: Job, k: int, checks: list[Check], pool: pin.GeometryPool) -> NDArray[np.intp]:
    """Judge all leaves of one view."""
    leaves, found = enumerate_leaves(
        job.camera,
        job.root[k],
        job.image[k],
        parents=PARENTS,
        lengths=job.lengths,
        tolerance=job.tolerance.tangent,
    )
    head = np.broadcast_to(job.head[k], (len(leaves), 5, 3))
    points = np.concatenate([leaves, head], axis=1)
    alive = np.ones(len(points), dtype=bool)
    for judgement in judge(checks, points):
        alive &= ~judgement.violated.any(axis=1)
    q = np.asfortranarray(job.figure.inverse_kinematics(points).T)
    alive &= ~np.asarray(pin.computeCollisionsInParallel(2, pool, q, True)).astype(bool)
    return found[alive]


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    start = time.perf_counter()
    result = call()
    return result, time.perf_counter() - start


def against_brute_force(job: Job, views: int) -> None:
    """Compare survivors and times with brute force; exact views alone, whose q is the posture itself."""
    checks, some = job.checks(), slice(0, views)
    pool = pin.GeometryPool(job.figure.model, job.figure.geometry, 2)
    rest = [check for check in checks if check.name != "collision"]
    brute, brute_time = timed(lambda: [brute_force(job, k, rest, pool) for k in range(views)])
    rows = [("brute force", brute_time / views)]
    paths: tuple[compiled.Path_, ...] = ("plain", "fast")
    for path in paths:
        with compiled.path(path):
            grow(job, checks, some)
            batched = codes(grow(job, checks, some))
            single, seconds = timed(
                lambda: [codes(grow(job, checks, slice(k, k + 1)))[0] for k in range(views)]
            )
            rows.append((f"{path}, one view a call", seconds / views))
            _, seconds = min((timed(lambda: grow(job, checks)) for _ in range(3)), key=lambda pair: pair[1])
            rows.append((f"{path}, batches of {CHUNK_FRAMES}", seconds / len(job.image)))
        for name, ours in (("batched", batched), ("one at a time", single)):
            same = sum(np.array_equal(np.sort(a), np.sort(b)) for a, b in zip(brute, ours, strict=True))
            print(f"survivors identical to brute force, {path}, {name}: {same} of {views} views")
    for name, seconds in rows:
        print(f"{name:28} {seconds * 1e3:9.4f} ms a view {brute_time / views / seconds:8.1f} x")


def identical(a: Sequence[Leaves], b: Sequence[Leaves]) -> bool:
    """Return whether leaves, losses and findings of two paths are the same."""
    return all(
        np.array_equal(x.frame, y.frame)
        and np.array_equal(x.code, y.code)
        and len(x.pruned) == len(y.pruned)
        and all(
            (p.level, p.check, p.where) == (q.level, q.check, q.where)
            and all(
                np.array_equal(getattr(p, name), getattr(q, name), equal_nan=name == "value")
                for name in ("frame", "code", "place", "value", "lower", "upper")
            )
            for p, q in zip(x.pruned, y.pruned, strict=True)
        )
        for x, y in zip(a, b, strict=True)
    )


def rates(name: str, jobs: Sequence[Job]) -> None:
    """Print the rates of both paths and the cost of threads."""
    suites = [job.checks() for job in jobs]
    views = sum(len(job.image) for job in jobs)

    def everything() -> list[Leaves]:
        return [leaves for job, checks in zip(jobs, suites, strict=True) for leaves in grow(job, checks)]

    with compiled.path("plain"):
        plain = everything()
    with compiled.path("fast"):
        quick = everything()
    counts = np.concatenate([np.diff(leaves.offsets()) for leaves in quick])
    print(
        f"{name}: {views} views, survivors median {np.median(counts):.0f}, mean {counts.mean():.1f}, "
        f"95 % {np.percentile(counts, 95):.0f}; both paths identical: {identical(plain, quick)}"
    )
    settings: tuple[tuple[compiled.Path_, int], ...] = (("plain", 1), ("fast", 1), ("fast", 2))
    for path, threads in settings:
        compiled.use_threads(threads)
        with compiled.path(path):
            wall, busy = [], []
            for _ in range(2 if path == "plain" else 5):
                before = time.process_time()
                wall.append(timed(everything)[1])
                busy.append(time.process_time() - before)
        print(
            f"  {path:5} {threads} thread(s): {views / min(wall):8.0f} views/s, "
            f"{min(busy) / views * 1e6:6.1f} us of processor time a view"
        )
    compiled.use_threads(None)


def recover_all(views: Sequence[View]) -> int:
    """Recover views and count their survivors."""
    return sum(len(frame) for view in views for frame in posekit.recover(view).frames)


def recover_rates(name: str, views: Sequence[View]) -> None:
    """Print the rates of `posekit.recover`, compiled code loaded and persons known."""
    frames = sum(len(view) for view in views)
    start = time.process_time()
    with compiled.path("fast"):
        survivors = recover_all(views)
    first = time.process_time() - start
    print(f"posekit.recover, {name}: {frames} frames in {len(views)} views, {survivors} survivors")
    for threads in (1, 2):
        compiled.use_threads(threads)
        wall, busy = [], []
        with compiled.path("fast"):
            for _ in range(5):
                before = time.process_time()
                wall.append(timed(lambda: recover_all(views))[1])
                busy.append(time.process_time() - before)
        print(
            f"  {threads} thread(s):  {frames / min(wall):8.0f} views/s, "
            f"{min(busy) / frames * 1e6:6.1f} us of processor time a view"
        )
    compiled.use_threads(None)
    persons = max(first - min(busy), 0.0) / len(views)
    print(
        f"  the first time: {persons * 1e3:.1f} ms a view more, for persons that are new and code that is loaded"
    )
    context = get_context("spawn")
    begin, results = context.Barrier(N_PROCESSES), context.Queue()
    workers = [context.Process(target=_worker, args=(views, begin, results)) for _ in range(N_PROCESSES)]
    for worker in workers:
        worker.start()
    turns = list(zip(*(results.get() for _ in workers), strict=True))
    for worker in workers:
        worker.join()
    seconds = min(max(wall for wall, _ in turn) for turn in turns)
    cost = min(sum(busy for _, busy in turn) for turn in turns) / (N_PROCESSES * frames)
    print(
        f"  {N_PROCESSES} processes:  {N_PROCESSES * frames / seconds:8.0f} views/s, "
        f"{cost * 1e6:6.1f} us of processor time a view: {N_PROCESSES / cost:.0f} views/s of {N_PROCESSES} idle cores"
    )


def _worker(views: Sequence[View], begin: Barrier, results: Queue[list[tuple[float, float]]]) -> None:
    """Recover the same views as the other workers, at the same times; return clock's and processor's time of each."""
    compiled.use_threads(1)
    spans = []
    with compiled.path("fast"):
        recover_all(views)
        for _ in range(5):
            begin.wait()
            before = time.process_time()
            wall = timed(lambda: recover_all(views))[1]
            spans.append((wall, time.process_time() - before))
    results.put(spans)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=200)
    parser.add_argument("--batch", type=int, default=4000)
    parser.add_argument("--mocap", type=Path)
    parser.add_argument("--cameras", type=int, default=4)
    given = parser.parse_args()
    scene = random_views(load_figure(), max(given.views, given.batch), np.random.default_rng(0))
    random = Job.of([scene], EXACT_TOLERANCE)
    against_brute_force(random, given.views)
    rates("random legal views, exact", [random])
    recover_rates("random legal views", [view_of(scene)])
    if given.mocap is not None:
        capture = read_capture(given.mocap)
        frames = sum(len(capture.frames_of(k, complete=True)) for k in range(len(capture.names)))
        seen = [mocap_scenes(capture, frames, np.random.default_rng(seed)) for seed in range(given.cameras)]
        rates(
            "real motion, as measured",
            [Job.of(scenes, MEASURED_TOLERANCE) for scenes in zip(*seen, strict=True)],
        )
        recover_rates(
            "real motion", [view_of(scene) for scenes in zip(*seen, strict=True) for scene in scenes]
        )


if __name__ == "__main__":
    main()
