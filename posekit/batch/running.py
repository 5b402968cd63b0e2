"""The course of a run: inputs opened, shards planned, those that are missing recovered."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from posekit.batch.inputs import Input
from posekit.batch.intact import known_digests
from posekit.batch.pool import Outcome, Pool
from posekit.batch.recipe import Recipe
from posekit.batch.run_folder import Failure, RunFolder
from posekit.batch.shard import Finished, Shard, finished, shards_of
from posekit.batch.staging import Staged, Staging, stage
from posekit.errors import InputError

NOTE_SECONDS: Final = 5.0
"""Seconds between two notes of failures in the manifest."""
MOST_WARNINGS: Final = 20


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a run is.

    Parameters
    ----------
    stage : {"opening", "recovering"}
        What the run is at.
    done, total : int
        Inputs that are opened; frames that are recovered, those of earlier runs included.
    before : int
        Frames that were there when the run began.
    failed : int
        Inputs or shards.
    """

    stage: str
    done: int
    total: int
    before: int = 0
    failed: int = 0


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a run left.

    Parameters
    ----------
    inputs, shards, skipped : int
        Inputs that were opened, shards whose files are there, and those among them that were there before.
    frames, survivors, empty : int
        Frames in them, their survivors, and frames without any.
    planned : int
        Frames of all inputs that were opened.
    failures : tuple of Failure
        Shards, and inputs, of which nothing came.
    peak : int
        The most memory of a process, bytes.
    seconds : float
        How long the run took.
    """

    inputs: int
    shards: int
    skipped: int
    frames: int
    survivors: int
    empty: int
    planned: int
    failures: tuple[Failure, ...]
    peak: int
    seconds: float


class Run:
    """The state of a run: what is open, what is planned, what is done."""

    def __init__(
        self,
        *,
        folder: RunFolder,
        recipe: Recipe,
        hash: str,
        pool: Pool,
        progress: Callable[[Progress], None],
    ) -> None:
        self.folder, self.recipe, self.hash = folder, recipe, hash
        self.pool, self.progress = pool, progress
        self.staged: list[Staged] = []
        self.shards: list[Shard] = []
        self.missing: list[Shard] = []
        self.failures: list[Failure] = []
        self.done: list[Finished] = []
        self.known = known_digests(folder.path)
        self.found: dict[str, Finished] = {}
        self.skipped = 0
        self.peak = 0
        self.warned = 0

    def open(self, listed: Sequence[Input], reading: str) -> None:
        """Open every input; those that cannot be are failures, unless all are."""
        jobs = [
            Staging(
                name=one.name, path=one.path, folder=self.folder.path, recipe=self.recipe, reading=reading
            )
            for one in listed
        ]
        self._stage(jobs)
        # Tables are removed when a run is done. One that goes on needs those of inputs with shards that are missing.
        again = []
        for k, one in enumerate(self.staged):
            lacking = any(not Path(table.path).is_file() for table in one.tables)
            if lacking and any(
                self._there(shard) is None
                for shard in shards_of(one, self.recipe, self.hash, self.folder.path)
            ):
                again.append(k)
        if again:
            names = {self.staged[k].name for k in again}
            self.staged = [one for one in self.staged if one.name not in names]
            self._stage([replace(job, again=True) for job in jobs if job.name in names])
        self.staged.sort(key=lambda one: one.name)
        if not self.staged:
            more = f" (and {len(self.failures) - 1} more)" if len(self.failures) > 1 else ""
            raise InputError(f"{self.failures[0].error}{more}")

    def _there(self, shard: Shard) -> Finished | None:
        """Look at a shard's file; at one that is whole only once, since all of it is read."""
        if shard.name not in self.found:
            there = finished(shard, self.known)
            if there is None:
                return None
            self.found[shard.name] = there
        return self.found[shard.name]

    def _stage(self, jobs: Sequence[Staging]) -> None:
        for count, outcome in enumerate(self.pool.run(stage, jobs), 1):
            self._see(outcome)
            if outcome.value is not None:
                self.staged.append(outcome.value)
                self._warn(outcome.value.name, outcome.value.warnings)
            else:
                self._fail(outcome, outcome.item.name)
            self.progress(Progress(stage="opening", done=count, total=len(jobs), failed=len(self.failures)))

    def check_kinds(self, mixed: bool) -> None:
        """Refuse inputs of several formats, unless that is meant."""
        first = self.staged[0]
        for one in () if mixed else self.staged:
            if one.kind != first.kind:
                raise InputError(
                    f"{one.name}: got {one.kind}, and {first.name} is {first.kind}; expected inputs of one format; "
                    "give --mixed if that is meant"
                )

    def plan(self) -> None:
        """Cut the inputs into shards, and find those whose files are there."""
        for one in self.staged:
            self.shards.extend(shards_of(one, self.recipe, self.hash, self.folder.path))
        for shard in self.shards:
            there = self._there(shard)
            if there is None:
                self.missing.append(shard)
            else:
                self.done.append(there)
        self.skipped = len(self.done)

    def recover(self, work: Callable[[Shard], Finished]) -> None:
        """Recover the shards that are missing."""
        total = sum(len(shard) for shard in self.shards)
        before = done = sum(one.frames for one in self.done)
        self.note()
        noted = time.monotonic()
        known = len(self.failures)
        for outcome in self.pool.run(work, self.missing):
            self._see(outcome)
            if outcome.value is not None:
                self.done.append(outcome.value)
                self._warn(outcome.item.name, outcome.value.warnings)
                done += outcome.value.frames
            else:
                self._fail(outcome, outcome.item.input, outcome.item)
            if len(self.failures) > known and time.monotonic() - noted > NOTE_SECONDS:
                self.note()
                noted, known = time.monotonic(), len(self.failures)
            self.progress(
                Progress(stage="recovering", done=done, total=total, before=before, failed=len(self.failures))
            )

    def note(self) -> None:
        """Write the manifest."""
        digests = {one.name: one.digest for one in self.done}
        self.folder.write_manifest(self.totals(), self.failures, digests)

    def totals(self) -> dict[str, int]:
        """Count what is there."""
        return {
            "inputs": len(self.staged),
            "shards": len(self.shards),
            "done": len(self.done),
            "planned": sum(len(shard) for shard in self.shards),
            "frames": sum(one.frames for one in self.done),
            "survivors": sum(one.survivors for one in self.done),
            "empty": sum(one.empty for one in self.done),
        }

    def summary(self, seconds: float) -> Summary:
        """Say what the run left."""
        totals = self.totals()
        return Summary(
            shards=totals.pop("done"),
            skipped=self.skipped,
            failures=tuple(self.failures),
            peak=self.peak,
            seconds=seconds,
            **{name: totals[name] for name in ("inputs", "frames", "survivors", "empty", "planned")},
        )

    def _see(self, outcome: Outcome[Any, Any]) -> None:
        """Keep what every outcome tells, and stop where nothing can be written any more."""
        self.peak = max(self.peak, outcome.peak)
        if outcome.fatal:
            raise InputError(outcome.error)

    def _fail(self, outcome: Outcome[Any, Any], input: str, shard: Shard | None = None) -> None:
        self.failures.append(
            Failure(
                shard=shard.name if shard else "",
                input=input,
                person=shard.table.person if shard else None,
                start=shard.start if shard else None,
                stop=shard.stop if shard else None,
                error=outcome.error,
                attempts=outcome.attempts,
                died=outcome.died,
            )
        )

    def _warn(self, name: str, lines: Sequence[str]) -> None:
        for line in lines:
            self.warned += 1
            if self.warned <= MOST_WARNINGS:
                warnings.warn(line if name in line else f"{name}: {line}", UserWarning, stacklevel=2)
            elif self.warned == MOST_WARNINGS + 1:
                warnings.warn("more warnings are not shown", UserWarning, stacklevel=2)
