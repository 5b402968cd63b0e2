"""`posekit validate`: whether postures and motion are physically possible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from posekit.cli.groups import with_groups
from posekit.cli.main import BAD_INPUT
from posekit.cli.options import distinct, examples, option, progress
from posekit.cli.terminal import say
from posekit.cli.validate_options import BodyOptions, JudgedOptions, StatedOptions, asked_of
from posekit.cli.validate_output import FailOver, ValidateOutput, parse_fail_over
from posekit.display.check_words import check_words
from posekit.display.plural import plural
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.formats.own import ValidationReport
    from posekit.validation import AskedValidation

SOME_INVALID: Final = 1
MAX_REFUSED: Final = 20
"""Broken files that are named on the terminal; the report names all."""
MAX_RECOGNISED: Final = 10
"""Sentences of what was recognised that are printed."""
VALIDATE_EXAMPLES = examples(
    "posekit validate walk.bvh",
    "posekit validate dataset/ -o report.html --keep passed",
    "posekit validate 'clips/*.npz' more.trc -o report.json --ground 0m --fail-over 1%",
    "posekit validate g1_motion.npz --urdf g1 --rate 50 -o report.csv",
    "posekit validate lifted.npz --strict --checks joint-range,collision --ranges table1",
)


@with_groups
def validate(
    *,
    given: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE|DIR|PATTERN...",
            help="Motion (BVH, TRC, C3D, GLB, MOT, CSV, NPZ, Parquet), postures or configurations (JSON, NPZ), "
            "results, survivors, views with truth; folders of them, patterns.",
        ),
    ],
    output: Annotated[
        Path | None,
        option(
            "--output",
            "REPORT",
            "The report: .json, .md, .csv, .parquet, or .html; a folder for archives: tables, written as it goes on.",
            short="-o",
        ),
    ] = None,
    page: Annotated[
        Path | None, option("--page", "FILE.html", "The page of the report, beside --output.")
    ] = None,
    timeline: Annotated[
        Path | None,
        option(
            "--timeline", "FILE|DIR", "Timelines of the worst clips (PNG, SVG, PDF), or a folder: one a clip."
        ),
    ] = None,
    keep: Annotated[
        Path | None, option("--keep", "DIR", "A new folder for the clips that pass, in their own format.")
    ] = None,
    keep_spans: Annotated[
        float | None,
        option(
            "--keep-spans",
            "SECONDS",
            "Keep the longest good span of other clips too, where it takes as long.",
        ),
    ] = None,
    repair: Annotated[
        Path | None,
        option(
            "--repair", "FILE|DIR", "The nearest that passes, as a file, or in a folder one of each clip."
        ),
    ] = None,
    fail_over: Annotated[
        str,
        option(
            "--fail-over",
            "N|P%|N clips|P% clips",
            "How many postures or clips, or what share, may be not valid; then exit 0.",
        ),
    ] = "0",
    body: BodyOptions,
    stated: StatedOptions,
    judged: JudgedOptions,
    distances: Annotated[
        bool | None,
        typer.Option(
            "--distances/--no-distances",
            help="Whether JSON and CSV have the nearest pair of bodies in every posture of a robot (default: where "
            "none is a mesh).",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        option("--jobs", "N", "Processes, where --output is a folder. Default: one a core."),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="List every finding, not only violations and each check's worst.")
    ] = False,
) -> None:
    """Judge postures and motion: exit 0 if all are valid, 1 if some are not or are undecided, 2 on bad input.

    With --repair the exit code, and --fail-over, are of what was written.

    Of several files those that are broken are named, the others judged and reported; then it is 2, too.
    """
    from posekit.validation import WantedDetail, files_of, validate_files

    if output is not None and (output.is_dir() or not output.suffix):
        outputs = ValidateOutput(page=page, timeline=timeline, keep=keep, keep_spans=keep_spans)
        if outputs != ValidateOutput() or repair is not None:
            raise InputError(
                f"-o {output}: a folder has verdicts alone; expected no --page, --timeline, --keep or --repair"
            )
        _refuse_ignored("verdicts", every=every, distances=distances, urdf=body.urdf)
        files = files_of(given, output)
        _validate_archive(files, output, asked_of(body, stated, judged), jobs, parse_fail_over(fail_over))
        return
    outputs = ValidateOutput(report=output, page=page, timeline=timeline, keep=keep, keep_spans=keep_spans)
    outputs.check(repair)
    _refuse_ignored(outputs.detail, every=every, distances=distances, urdf=body.urdf, jobs=jobs)
    allowed = parse_fail_over(fail_over)
    asked = asked_of(body, stated, judged)
    files = files_of(given, output)
    distinct(*files, output, page, timeline, keep, repair)
    if repair is not None:
        from posekit.conversion.repaired_file import check_repairable, repair_targets

        repair_targets(files, repair)
        check_repairable(files, asked)
    with progress("judging", len(files)) as done:
        wanted = WantedDetail(detail=outputs.detail, every=every, distances=distances)
        report = validate_files(files, asked, wanted=wanted, progress=done)
    said: list[str] = []
    if repair is not None:
        from posekit.conversion.repaired_file import repair_files

        with progress("repairing", len(files)) as done:
            for made in repair_files(files, asked, repair):
                said += made.lines
                report = replace(report, repair=(*report.repair, *made.records))
                done(1)
    said = [*outputs.write(report), *said]
    _tell(report)
    for line in said:
        say(line)
    if report.refused:
        raise typer.Exit(BAD_INPUT)
    if allowed.exceeded(report) if repair is None else allowed.exceeded_by_records(report.repair):
        raise typer.Exit(SOME_INVALID)


def _refuse_ignored(
    detail: str, *, every: bool, distances: bool | None, urdf: str, jobs: int | None = None
) -> None:
    """Refuse options that would do nothing, before the work."""
    if jobs is not None:
        raise InputError("--jobs: processes are of a folder of verdicts; expected -o DIR; leave --jobs out")
    if every and detail != "findings":
        raise InputError(
            "--all: only a report in JSON lists findings; expected -o REPORT.json; or leave --all out"
        )
    if distances is not None and (detail == "verdicts" or urdf in ("", "stick_figure")):
        raise InputError(
            "--distances: only a report of a robot in JSON, CSV or Parquet has them; expected --urdf and -o; or leave "
            "it out"
        )


def _validate_archive(
    files: Sequence[Path], output: Path, asked: AskedValidation, jobs: int | None, allowed: FailOver
) -> None:
    """Judge files into a folder, by several processes."""
    from posekit.batch import validate_archive
    from posekit.batch.run import Workers

    with progress("judging", len(files)) as done:
        totals = validate_archive(files, output, asked, Workers(jobs=jobs), progress=done)
    for line in _bounded(totals.refused, MAX_REFUSED, "files that could not be judged"):
        say(f"posekit: error: {line}", err=True)
    for name, counts in (("frames", totals.frames), ("clips", totals.clips)):
        told = ", ".join(f"{counts[verdict]:,} {verdict}" for verdict in ("valid", "invalid", "undecided"))
        say(f"{counts.total():,} {name}: {told}")
    for check, count in totals.rejected.most_common():
        say(f"  {check_words(check)}: {plural(count, 'frame')} rejected")
    say(f"written: {output}, {plural(totals.parts, 'part')}, {totals.skipped} of them from before")
    if totals.refused:
        raise typer.Exit(BAD_INPUT)
    counts = totals.clips if allowed.clips else totals.frames
    if allowed.exceeded_by(counts.total() - counts["valid"], counts.total()):
        raise typer.Exit(SOME_INVALID)


def _tell(report: ValidationReport) -> None:
    """Print what was recognised, what was found, what was allowed, and what was not asked."""
    from posekit.body.closing import closing_line
    from posekit.formats.own.report import columns_of
    from posekit.formats.own.report_table import clip_lines, summary_table
    from posekit.validation import said_of

    for line in _bounded(report.refused, MAX_REFUSED, "files that could not be judged"):
        say(f"posekit: error: {line}", err=True)
    left_out = report.settings.get("left_out", ())
    if left_out:
        more = f" and {len(left_out) - 1} more" if len(left_out) > 1 else ""
        say(f"posekit: warning: left out, as they hold no postures: {left_out[0]}{more}", err=True)
    changed = closing_line(report.settings.get("moved_lengths", {}))
    if changed:
        say(f"posekit: warning: {changed}", err=True)
    for line in _bounded(
        report.settings.get("recognised", ()), MAX_RECOGNISED, "such sentences in the report"
    ):
        say(line)
    for line in summary_table(columns_of(report), report.frames):
        say(line)
    for line in (*(clip_lines(report.clips) if report.clips else ()), *said_of(report)):
        say(line)
    reasons: dict[str, list[str]] = {}
    for check, why in report.settings.get("not_asked", {}).items():
        for reason in why:
            reasons.setdefault(reason, []).append(check)
    for reason, checks in reasons.items():
        say(f"not asked: {', '.join(checks)}: {reason}")


def _bounded(lines: Sequence[str], most: int, what: str) -> Iterator[str]:
    """Yield some lines, and how many more there are."""
    yield from lines[:most]
    if len(lines) > most:
        yield f"{len(lines) - most} more {what}"
