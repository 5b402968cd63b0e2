"""Functions that benchmarks share: clips of motion, folders of data, least processor times, and tables."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

import posekit
from posekit.errors import InputError
from posekit.motion import Motion
from posekit.samples import samples
from posekit.skeleton import JOINTS
from posekit.synthesis import Walker

DATA_VARIABLE = "POSEKIT_DATA"
"""Environment variable with folders and files of data, separated as in PATH."""

KNOWN_FAULTS = {
    # The legs whip about the pelvis by a metre per frame in seven spans; this span is sound.
    "train/directing_traffic_1": slice(520, 675),
    "train/basketball_1": slice(1, 160),  # held still from there to the end
}
"""Sound frames of clips that have faults of their own, by the clip's name (CMU's recordings)."""

FIRST_POSE = "train/"
"""Start of the names of clips whose first frame is the skeleton at rest (CMU's recordings)."""


def parser(doc: str | None) -> argparse.ArgumentParser:
    """Return a parser with ``--data`` and ``--seed``."""
    made = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    given = [Path(one) for one in os.environ.get(DATA_VARIABLE, "").split(os.pathsep) if one]
    made.add_argument(
        "--data", type=Path, action="append", default=[], help="folder or file; made if not given"
    )
    made.add_argument("--seed", type=int, default=0)
    made.set_defaults(known=given)
    return made


def data_of(given: argparse.Namespace) -> list[Path]:
    """Return the folders and files of ``--data`` or the environment."""
    return list(given.data or given.known)


def files_below(paths: Iterable[Path]) -> list[Path]:
    """Return files, and the files of folders, in order of their names."""
    return [
        one
        for path in paths
        for one in (sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else [path])
    ]


def recordings(paths: Sequence[Path], *, least: int = 60) -> list[Motion]:
    """Read the clips of files and folders that have an up axis and a rate; walkers if there are no paths.

    `least` is the number of frames in which all joints are known.
    """
    if not paths:
        return [walk(velocity, 90) for velocity in (0.6, 0.7, 0.8, 0.9)]
    found = []
    for file in files_below(paths):
        try:
            motion = posekit.open(file)
        except InputError as error:
            print(f"not read: {error}", file=sys.stderr)
            continue
        if isinstance(motion, Motion) and motion.joints is not None:
            for name, clip in motion.recordings():
                first = 1 if name.startswith(FIRST_POSE) else 0
                part = clip.take(KNOWN_FAULTS.get(name, slice(first, None)))
                whole = np.isfinite(part.figure_joints).all(axis=(1, 2)).sum()
                if whole >= least and part.up and part.rate:
                    label = file.name if len(motion.clips) < 2 else f"{file.name}:{name}"
                    found.append(replace(part, source=label, document=None))
    return found


def walk(velocity: float, frames: int, rate: float = 30.0) -> Motion:
    """Return a walk over the ground, up +y; velocity in leg lengths per second."""
    walker = Walker(velocity=velocity)
    time = np.arange(frames) / rate
    points = walker.figure.points(walker.configurations(walker.phase(time)))
    joints = points[:, : len(JOINTS)] + walker.travel(time)[:, None]
    return Motion(joints=joints, time=time, up="+y", source=f"walk {velocity:g}")


@contextmanager
def sampled() -> Iterator[Path]:
    """Write the files of ``posekit samples`` to a folder that is removed afterwards."""
    with tempfile.TemporaryDirectory() as spare:
        samples(spare)
        yield Path(spare)


def timed(way: Callable[[], object]) -> float:
    """Return the processor time of one call in this process, seconds."""
    start = time.process_time()
    way()
    return time.process_time() - start


def least(ways: Mapping[str, Callable[[], object]], repeats: int = 5) -> dict[str, float]:
    """Call functions in turn, several times, and return the least processor time of each, seconds.

    Other work on the machine only adds to a time, and in turns it affects all functions alike.
    """
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            spent[name].append(timed(way))
    return {name: min(values) for name, values in spent.items()}


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Write a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in line)} |" for line in lines)
