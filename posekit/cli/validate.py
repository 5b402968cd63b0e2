"""`posekit validate`: find defects of postures and motion, and decide which clips to keep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posekit.cli.command import command, option, reading, say, settings_from, settings_options
from posekit.settings import ValidateSettings

if TYPE_CHECKING:
    from posekit.validators import Report

SHOWN = {"checks": "LIST", "ranges": "NAME|FILE", "profile": "NAME|FILE", "ground": "HEIGHT"}
REPORTS = (".html", ".json", ".csv", ".npz", ".parquet", ".md")
INVALID = 1
BAD_INPUT = 2


@command(
    "validate",
    "posekit validate walk.bvh",
    "posekit validate dataset/ -o report.html --keep passed",
    "posekit validate g1_motion.csv --urdf g1 --rate 50 -o report.csv",
    "posekit validate jump.bvh --repair repaired.bvh",
)
@click.argument("sources", nargs=-1, required=True, metavar="FILE|DIR…", type=click.Path(path_type=Path))
@option(
    "-o",
    "--output",
    metavar="REPORT",
    type=click.Path(path_type=Path),
    help=".html, .json, .csv, .parquet, .md.",
)
@option(
    "--keep",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="New folder for the clips that pass; with --keep-spans SECONDS also for good parts of the others.",
)
@option("--keep-spans", metavar="SECONDS", default=None, hidden=True, help="Minimum duration of a good part.")
@option(
    "--repair", metavar="FILE|DIR", type=click.Path(path_type=Path), help="Write a near motion that passes."
)
@reading()
@settings_options(ValidateSettings, SHOWN, panel="Judging")
def validate(
    sources: tuple[Path, ...],
    output: Path | None,
    keep: Path | None,
    keep_spans: str | None,
    repair: Path | None,
    **given: Any,
) -> None:
    """Check postures and motion. Exit code: 0 if all are valid, 1 if some are invalid, 2 for wrong input."""
    from posekit.errors import InputError, refusal
    from posekit.motion.validation import validate as judge

    if output is not None and output.suffix not in REPORTS:
        raise refusal(output, "", f'"{output.suffix}"', f"a report of {', '.join(REPORTS)}", "rename it")

    settings = settings_from(ValidateSettings, given)
    if keep_spans is not None and keep is None:
        raise InputError("--keep-spans: got no folder; expected --keep DIR, too; give it")
    report = judge(list(sources), settings=settings, keep=keep, keep_spans=keep_spans, **given)
    if output is not None and output.suffix == ".html":
        write_page(report, output, given)
    elif output is not None:
        report.save(output)
    say(report.summary())
    code = 0 if bool(report.ok.all()) else INVALID
    if repair is not None:
        from posekit.motion.repair import repair as mend

        source = sources[0] if len(sources) == 1 else list(sources)
        mended = mend(source, repair, settings=settings, **given)
        say("\n".join(["", f"repaired: {mended.report.decision}", *mended.notes]))
        code = 0 if bool(mended.report.ok.all()) else INVALID
    elif any(clip.decision == "repair?" for clip in report.clips):
        one = sources[0]
        target = f"{one.stem}.repaired{one.suffix}" if len(sources) == 1 and one.is_file() else "repaired/"
        say(f"next: the same command with --repair {target} writes a similar motion that passes")
    if report.refused:
        code = BAD_INPUT
    raise SystemExit(code)


def write_page(report: Report, output: Path, facts: dict[str, Any]) -> None:
    """Write a report as an HTML page: the table of findings, and an animation of the first clips."""
    from posekit.formats import open as open_file
    from posekit.motion import Motion
    from posekit.viewer import draw

    opened = [open_file(name, **facts) for name in dict.fromkeys(report.files) if Path(name).is_file()]
    motions = [one for one in opened if isinstance(one, Motion)]
    draw(report, output, view=motions if len(motions) == len(opened) else None, urdf=facts["urdf"])
