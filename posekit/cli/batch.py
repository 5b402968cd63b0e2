"""`posekit batch`: archives recovered by local processes or a cluster, into a folder of Parquet files."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from posekit.cli.asked import settings_of
from posekit.cli.detector_options import Proportions, Reading, Who
from posekit.cli.detector_source import source_of
from posekit.cli.groups import with_groups
from posekit.cli.judging_options import Judging, TolerancesAsRecover
from posekit.cli.noise_options import UncertainAsRecover
from posekit.cli.options import ContactMargin, examples, option, signed_length
from posekit.cli.terminal import INTERRUPTED_CODE, Ended, say
from posekit.display.plural import plural

if TYPE_CHECKING:
    from posekit.batch import Progress, Summary

BATCH_EXAMPLES = examples(
    "posekit batch archive/ -o results",
    "posekit batch cam1/*.json -o results --camera calibration.toml:cam1 --stature 175cm --person all",
    "posekit batch views.parquet -o results --jobs 16 --q --margins",
    "posekit batch archive/ -o results --cluster 10.0.0.1:6379",
)
EXIT_SOME_FAILED = 1
PROGRESS_EVERY_SECONDS = 10.0
"""Seconds between two lines of progress where there is no terminal."""


@with_groups
def batch(
    *,
    inputs: Annotated[
        list[Path],
        typer.Argument(
            metavar="INPUT...",
            help="Views, key points (a file, or a folder of a file a picture), Parquet or NPZ of image points, or "
            "folders of those.",
        ),
    ],
    output: Annotated[
        Path,
        option("--output", "DIR", "The folder of results. A run that was stopped goes on there.", short="-o"),
    ],
    jobs: Annotated[int | None, option("--jobs", "N", "Processes. Default: one a core.")] = None,
    shard_frames: Annotated[
        int, option("--shard-frames", "N", "Frames of one file of results, at most.")
    ] = 2000,
    retries: Annotated[
        int, option("--retries", "N", "How often a shard is tried again whose process died.")
    ] = 2,
    cluster: Annotated[
        str,
        option(
            "--cluster",
            "ADDRESS",
            "Work on a Ray cluster (extra ray); `local` starts one here. All machines need the same paths.",
        ),
    ] = "",
    overwrite: Annotated[
        bool,
        typer.Option("--overwrite", help="Remove results in DIR that are of other settings or other inputs."),
    ] = False,
    mixed: Annotated[bool, typer.Option("--mixed", help="Inputs of several formats are meant.")] = False,
    rank: Annotated[
        bool,
        typer.Option("--rank/--no-rank", help="Also each survivor's probability among those of its frame."),
    ] = True,
    q: Annotated[
        bool, typer.Option("--q", help="Also each survivor's configuration: several times the time.")
    ] = False,
    margins: Annotated[
        bool,
        typer.Option("--margins", help="Also each survivor's worst margin by check: several times the time."),
    ] = False,
    show_progress: Annotated[
        bool | None,
        typer.Option(
            "--progress/--no-progress", help="Show rate and time left. Default: where stderr is a terminal."
        ),
    ] = None,
    judging: Judging,
    tolerances: TolerancesAsRecover,
    contact_margin: ContactMargin = "0cm",
    scale: Annotated[str, option("--scale", "HOW", "Uncalibrated views: as `posekit recover` has it.")] = "",
    proportions: Proportions = "figure",
    uncertain: UncertainAsRecover,
    reading: Reading,
    who: Who,
) -> None:
    """Recover an archive: every frame once, whatever dies on the way; exit 1 where some shards failed."""
    from posekit.batch import Recipe, Workers, run_batch

    workers = Workers(jobs=jobs, retries=retries, cluster=cluster)

    recipe = Recipe(
        source=source_of(reading, who, proportions=proportions, deviation=uncertain.deviation),
        settings=settings_of(
            judging,
            tolerances,
            uncertain,
            contact_margin=signed_length(contact_margin, "--contact-margin"),
            scale=scale,
            proportions="taylor" if proportions == "taylor" else "figure",
        ),
        rank=rank,
        q=q,
        margins=margins,
        shard_frames=shard_frames,
    )
    try:
        # Ray prints from a thread of its own that a worker died.
        with _shown(show_progress) as progress, redirect_stdout(sys.stderr):
            summary = run_batch(
                inputs,
                output,
                recipe,
                workers,
                overwrite=overwrite,
                mixed=mixed,
                progress=progress,
            )
    except KeyboardInterrupt:
        raise Ended(f"interrupted; run it again to go on in {output}", INTERRUPTED_CODE) from None
    _report(summary, output)
    if summary.failures:
        raise typer.Exit(EXIT_SOME_FAILED)


def _report(summary: Summary, output: Path) -> None:
    """Print what is there, and what failed."""
    there = f", {summary.skipped} of them from before" if summary.skipped else ""
    say(
        f"{plural(summary.frames, 'frame')} of {plural(summary.inputs, 'input')} in "
        f"{plural(summary.shards, 'shard')}{there}: "
        f"{plural(summary.survivors, 'survivor')}, {plural(summary.empty, 'frame')} without any"
    )
    for failure in summary.failures[:5]:
        what = failure.shard or failure.input
        say(f"posekit: warning: {what} failed: {failure.error}", err=True)
    if summary.failures:
        missing = summary.planned - summary.frames
        say(
            f"posekit: warning: {len(summary.failures)} failed, {plural(missing, 'frame')} are missing; all "
            "are named in "
            f"{output / 'manifest.json'}; run it again to try them again",
            err=True,
        )
    peak = f", at most {summary.peak / 2**20:.0f} MiB a process" if summary.peak else ""
    say(f"{summary.seconds:.1f} s{peak}; written: {output}")


@contextmanager
def _shown(asked: bool | None) -> Iterator[Any]:
    """Show how far a run is: a bar on a terminal, a line now and then elsewhere if that is asked for."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if asked is False or (asked is None and not console.is_terminal):
        yield None
        return
    speed = Speed()
    if not console.is_terminal:
        yield speed.line
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[speed]}"),
        TimeElapsedColumn(),
    )
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task("opening", total=None, speed="")

        def show(now: Progress) -> None:
            bar.update(task, description=now.stage, completed=now.done, total=now.total, speed=speed.of(now))

        yield show


class Speed:
    """How fast frames are done, and how long the rest takes."""

    def __init__(self) -> None:
        self.began: float | None = None
        self.told = -PROGRESS_EVERY_SECONDS

    def of(self, now: Progress) -> str:
        """Say it in a few words; nothing while inputs are opened."""
        failed = f", {now.failed} failed" if now.failed else ""
        if now.stage != "recovering":
            return failed.removeprefix(", ")
        if self.began is None:
            self.began = time.monotonic()
            self.first = now.done
            return failed.removeprefix(", ")
        seconds = time.monotonic() - self.began
        rate = (now.done - self.first) / seconds if seconds > 0 else 0.0
        if rate <= 0:
            return failed.removeprefix(", ")
        return f"{rate:,.0f} frames/s, {_clock((now.total - now.done) / rate)} left{failed}"

    def line(self, now: Progress) -> None:
        """Print it as a line, not too often."""
        words = self.of(now)
        ended = now.done >= now.total
        if time.monotonic() - self.told < PROGRESS_EVERY_SECONDS and not ended:
            return
        self.told = time.monotonic()
        unit = "frames" if now.stage == "recovering" else "inputs"
        print(
            f"{now.stage}: {now.done:,} of {now.total:,} {unit}; {words}".rstrip("; "),
            file=sys.stderr,
            flush=True,
        )


def _clock(seconds: float) -> str:
    """Spell a duration."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return (
        f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
    )
