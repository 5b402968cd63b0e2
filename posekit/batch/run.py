"""A whole batch: inputs listed and opened, cut into shards, those that are not there yet recovered."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posekit.batch import digests
from posekit.batch.earlier import contents_of, known_before
from posekit.batch.inputs import list_inputs
from posekit.batch.local_pool import LocalPool
from posekit.batch.pool import Pool
from posekit.batch.ray_pool import RayPool
from posekit.batch.recipe import Recipe
from posekit.batch.run_folder import Asked, run_folder
from posekit.batch.running import Progress, Run, Summary
from posekit.batch.shard import Finished, Shard, run_shard
from posekit.errors import InputError
from posekit.safe_io import extra

DEFAULT_RETRIES: Final = 2
"""Times that a shard is tried again whose process died."""


@dataclass(frozen=True, kw_only=True)
class Workers:
    """The processes that share the work of a batch.

    Parameters
    ----------
    jobs : int, optional
        Processes; as many as cores if not given. A script that asks for them needs ``if __name__ == "__main__"``.
    retries : int
        How often a shard is tried again whose process died.
    cluster : str
        A Ray cluster's address, or ``local``; empty for processes of this machine.

    Raises
    ------
    InputError
        Where a number is impossible.
    """

    jobs: int | None = None
    retries: int = DEFAULT_RETRIES
    cluster: str = ""

    def __post_init__(self) -> None:
        if self.jobs is not None and self.jobs < 1:
            raise InputError(f"--jobs: {self.jobs}; expected one or more processes")
        if self.retries < 0:
            raise InputError(f"--retries: {self.retries}; expected zero or more")

    def pool(self) -> Pool:
        """Make the pool that they work in."""
        count = self.jobs or _cores()
        return RayPool(self.cluster, count, self.retries) if self.cluster else LocalPool(count, self.retries)


def run_batch(
    inputs: Sequence[str | Path],
    output: str | Path,
    recipe: Recipe | None = None,
    workers: Workers | None = None,
    *,
    overwrite: bool = False,
    mixed: bool = False,
    progress: Callable[[Progress], None] | None = None,
    work: Callable[[Shard], Finished] = run_shard,
) -> Summary:
    """Recover every frame of an archive into a folder of Parquet files, or what is missing there.

    Parameters
    ----------
    inputs : sequence of path
        Views, key points (files or folders of one file a picture), tables and arrays of image points, or folders of
        those.
    output : path
        The run's folder; an earlier run of the same settings goes on.
    recipe : Recipe, optional
        What is asked of every frame.
    workers : Workers, optional
        Who does it: a process a core if not given.
    overwrite : bool
        Whether the results of another run in the folder may be removed.
    mixed : bool
        Whether inputs may be of several formats.
    progress : callable, optional
        Told how far it is.
    work : callable
        What is done with a shard: a module's function.

    Returns
    -------
    Summary

    Raises
    ------
    InputError
        Where there is no input, none can be opened, formats are mixed, the folder holds another run, or nothing can be
        written any more.
    """
    began = time.monotonic()
    recipe = recipe or Recipe()
    extra("pyarrow.parquet", "parquet", "posekit batch")
    output = Path(output)
    given = [Path(one) for one in inputs]
    list_inputs(given, output)  # refuses what is not there before a folder is made
    settings = recipe.document()
    hash = digests.of_values(settings)
    pool = (workers or Workers()).pool()
    with run_folder(output) as folder, _ended_as_interrupted():
        before = known_before(folder, settings, hash, overwrite)
        listing = list_inputs(given, output, before.root if before else None)
        with pool:
            run = Run(folder=folder, recipe=recipe, hash=hash, pool=pool, progress=progress or _silent)
            run.open(listing.inputs, digests.of_values(recipe.reading()))
            run.check_kinds(mixed)
            contents = contents_of(before, run.staged, folder, overwrite)
            run.plan()
            if overwrite:
                folder.remove_others({shard.name for shard in run.shards})
            elif before is None:
                folder.check_others({shard.name for shard in run.shards})
            folder.write_asked(Asked(hash=hash, settings=settings, inputs=contents, root=listing.root))
            run.recover(work)
        run.note()
        if not run.failures:
            folder.remove_staged()
        return run.summary(time.monotonic() - began)


@contextmanager
def _ended_as_interrupted() -> Iterator[None]:
    """Take a request to end for Ctrl-C: what is begun is left clean in both."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    kept = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, kept)


def _cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _silent(progress: Progress) -> None:
    """Say nothing."""
