"""`posekit validate`: whether postures are physically possible."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from posekit.cli.options import (
    AngleTolerance,
    Rules,
    about,
    distinct,
    examples,
    option,
    rule_numbers,
    signed_length,
    split,
)
from posekit.cli.validate_output import ValidateOutput, parse_fail_over
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.formats.held_postures import HeldPostures
    from posekit.formats.own import Result
    from posekit.formats.own.postures_q import NamedConfigurations
    from posekit.geometry import Array

SOME_INVALID = 1
UP_AXES = {
    f"{sign}{axis}": (k, -1.0 if sign == "-" else 1.0)
    for k, axis in enumerate("xyz")
    for sign in ("+", "-", "")
}
VALIDATE_EXAMPLES = examples(
    "posekit validate postures.json -o report.json",
    "posekit validate lifted.npz -o report.json --checks joint-range,collision --ranges table1",
    "posekit validate dataset.npz --urdf human --fail-over 1% -o report.csv",
    "posekit validate walk.bvh --urdf g1 --checks joint-range,collision",
)


class _Input(NamedTuple):
    """What a file holds: postures or configurations, and the result that they are of."""

    postures: HeldPostures | NamedConfigurations
    result: Result | None = None

    @property
    def up(self) -> Array | None:
        """The direction up, where the file says it."""
        from posekit.formats.motion import UP_DIRECTIONS

        said = getattr(self.postures, "up", "")
        return UP_DIRECTIONS[said] if said else None


def validate(
    postures: Annotated[
        Path,
        typer.Argument(
            metavar="POSTURES",
            help="Postures or configurations (JSON, NPZ), a result, motion (TRC, C3D, BVH, GLB, MOT, CSV, NPZ, "
            "Parquet), survivors, or a view with truth.",
        ),
    ],
    output: Annotated[
        Path | None,
        option("--output", "REPORT", "The report: .json, .md, .csv, .parquet, or .html.", short="-o"),
    ] = None,
    urdf: Annotated[
        str,
        option(
            "--urdf",
            "FILE|NAME",
            "stick_figure, a robot of example-robot-data (human, g1, talos, …), or a URDF. Default: the stick "
            "figure; a result's own.",
        ),
    ] = "",
    checks: Annotated[
        str,
        option(
            "--checks",
            "LIST",
            "By commas. Stick figure: rigid-parts, joint-range, collision, walking (default: the first three); "
            "robots: reach, rigid-parts, joint-range, collision, balance (the first four).",
        ),
    ] = "",
    ranges: Annotated[
        str,
        option(
            "--ranges",
            "NAME|FILE",
            "Joint ranges: anatomical, urdf, table1, or a TOML file. Default: a result's own, else anatomical; "
            "a robot's own limits.",
        ),
    ] = "",
    rules: Rules = "1,2",
    walkers: Annotated[
        str,
        option(
            "--walkers",
            "paper|people",
            "Thresholds of those rules: by Lee & Chen's word, or as real walkers keep them. Default: paper; a "
            "result's own.",
        ),
    ] = "",
    rigid_tolerance: Annotated[
        str,
        option(
            "--rigid-tolerance",
            "LENGTH",
            "How far distances inside rigid parts, and the fit of a robot, may be off. Default: 3cm, more where spines "
            "bend and noise was measured; what a result's postures were recovered with.",
        ),
    ] = "",
    angle_tolerance: AngleTolerance = None,
    contact_margin: Annotated[
        str,
        option(
            "--contact-margin",
            "LENGTH",
            "Clearance that bodies must keep, as 1cm; negative allows penetration. Default: 0cm; a result's own.",
        ),
    ] = "",
    lengths: Annotated[
        str,
        option(
            "--lengths",
            "model|median|each",
            "Whose segment lengths the model gets: none, each recording's medians, each posture's own (robots, slow). "
            "Default: median; a result's own.",
        ),
    ] = "",
    noise: Annotated[
        str,
        option(
            "--noise",
            "LENGTH",
            "Standard deviation of measured coordinates, as 5mm, for which tolerances allow. Default: estimated "
            "from the limbs' lengths over time; a result has none.",
        ),
    ] = "",
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Judge postures as those of the figure itself: by its lengths, 3 cm and 0.001 degrees, no noise.",
        ),
    ] = False,
    joint_map: Annotated[
        str, option("--joint-map", "FILE|NAME", "Which frames of the robot stand for the joints.")
    ] = "",
    bodies: Annotated[
        str,
        option(
            "--bodies",
            "auto|urdf|visual|capsules",
            "What collides, of a robot: its collision bodies, its visual ones, or capsules that are made up.",
        ),
    ] = "auto",
    srdf: Annotated[str, option("--srdf", "FILE", "The robot's SRDF: which pairs are not checked.")] = "",
    package_dir: Annotated[
        list[Path] | None,
        option("--package-dir", "DIR", "Where its meshes' packages are; may be given again."),
    ] = None,
    trusted: Annotated[
        bool | None,
        typer.Option(
            "--trusted/--untrusted",
            help="Whether to load the URDF at once, or in a child process with limits first (default: the second, "
            "for what is not built in).",
        ),
    ] = None,
    sequence: Annotated[
        bool,
        typer.Option(
            "--sequence", help="Frames in time: a robot's fit starts from the one before, clip by clip."
        ),
    ] = False,
    distances: Annotated[
        bool | None,
        typer.Option(
            "--distances/--no-distances",
            help="Whether JSON and CSV have the nearest pair of bodies in every posture of a robot (default: where "
            "none is a mesh).",
        ),
    ] = None,
    up: Annotated[
        str, option("--up", "AXIS", "Against gravity, for `balance`: +z, +y, … Default: +z, or the file's.")
    ] = "",
    unit: Annotated[
        str,
        option(
            "--unit", "m|cm|mm|in", "What lengths of motion are in. Default: the file's, or told by size."
        ),
    ] = "",
    rate: Annotated[
        float | None, option("--rate", "HZ", "Frames a second of motion, where the file says none.")
    ] = None,
    body_model: Annotated[
        Path | None,
        option("--body-model", "FILE.npz", "Your SMPL, SMPL+H or SMPL-X, for files of angles as AMASS's."),
    ] = None,
    profile: Annotated[
        str,
        option("--profile", "NAME|FILE", "Checks over time and their thresholds: posekit, or a TOML table."),
    ] = "posekit",
    ground: Annotated[
        str,
        option(
            "--ground", "HEIGHT", "Where the ground is along up, as 0m. Default: estimated from each clip."
        ),
    ] = "",
    fail_over: Annotated[
        str,
        option(
            "--fail-over",
            "N|P%|N clips|P% clips",
            "How many postures or clips, or what share, may be not valid; then exit 0.",
        ),
    ] = "0",
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
    every: Annotated[
        bool, typer.Option("--all", help="List every finding, not only violations and each check's worst.")
    ] = False,
) -> None:
    """Judge postures: exit 0 if all are valid, 1 if some are not or are undecided, 2 on bad input."""
    from posekit import validation, validators
    from posekit.body.closing import closing_line
    from posekit.formats import own as files
    from posekit.formats.own.report import columns_of
    from posekit.formats.own.report_table import clip_lines, summary_table
    from posekit.settings import DEFAULT_RANGES, ValidateSettings

    outputs = ValidateOutput(report=output, page=page, timeline=timeline, keep=keep, keep_spans=keep_spans)
    distinct(postures, output, page, timeline)
    outputs.check()
    allowed = parse_fail_over(fail_over)
    given = _read(postures, unit=unit, up=up, rate=rate, body_model=body_model)
    if not len(given.postures):
        raise InputError(f"{postures}: it holds no posture; nothing can be judged; expected at least one")
    figure: str | Figure = urdf or "stick_figure"
    judged = ValidateSettings(up=(0.0, 0.0, 1.0) if given.up is None else given.up)
    if given.result is not None:
        with about(postures):
            own, judged = validation.recovered_with(given.result)
            figure = urdf or own
    if urdf not in ("", "stick_figure"):
        # What was allowed is the stick figure's: a robot's bodies are other ones, and meshes have no depth.
        own_limits = "urdf" if judged.ranges == "urdf" else DEFAULT_RANGES
        judged = judged.changed(contact_margin=0.0, ranges=own_limits)
    asked: dict[str, Any] = {
        "checks": split(checks) if checks else None,
        "walkers": walkers or None,
        "rigid_tolerance": files.parse_length(rigid_tolerance, name="--rigid-tolerance")
        if rigid_tolerance
        else None,
        "angle_tolerance": angle_tolerance,
        "noise": files.parse_length(noise, name="--noise") if noise else None,
        "strict": strict or None,
        "contact_margin": signed_length(contact_margin, "--contact-margin") if contact_margin else None,
        "ranges": ranges or None,
        "lengths": lengths or None,
        "joint_map": joint_map or None,
        "srdf": srdf or None,
        "untrusted": None if trusted is None else not trusted,
        "up": _direction(up) if up else None,
        "profile": profile,
        "ground": signed_length(ground, "--ground") if ground else None,
    }
    settings = judged.changed(
        rules=rule_numbers(rules),
        bodies=bodies,
        package_dirs=package_dir or (),
        **{name: value for name, value in asked.items() if value is not None},
    )
    validator = validators.Validator(figure, settings)
    own_name = "stick_figure" if figure == "stick_figure" else "as recovered"
    with about(postures):
        report = validation.validate(
            validator,
            given.postures,
            settings={"urdf": urdf or own_name},
            every=every,
            sequence=_clips(given) if sequence else None,
            distances=distances,
            file=str(postures),
            detail=outputs.detail,
        )
    written = list(outputs.write(report))
    changed = closing_line(report.settings.get("moved_lengths", {}))
    if changed:
        typer.echo(f"posekit: warning: {changed}", err=True)
    columns = columns_of(report)
    for line in summary_table(columns):
        typer.echo(line)
    for line in clip_lines(report.clips) if report.clips else ():
        typer.echo(line)
    for line in (*getattr(given.postures, "said", ()), *validation.said_of(report, settings)):
        typer.echo(line)
    for line in written:
        typer.echo(line)
    if allowed.exceeded(report):
        raise typer.Exit(SOME_INVALID)


def _read(path: Path, *, unit: str, up: str, rate: float | None, body_model: Path | None) -> _Input:
    """Read a file of whatever holds postures or configurations."""
    from posekit.formats.format import Content
    from posekit.formats.held_postures import configurations_of, held_postures, postures_of_result
    from posekit.formats.own import read_result
    from posekit.formats.recognising import recognise

    if rate is not None and not 0 < rate < float("inf"):
        raise InputError(f"--rate: {rate:g}; expected frames a second, above 0")
    if up:
        _direction(up)
    found = recognise(path)
    if found.holds is Content.RESULT:
        result = read_result(path)
        return _Input(postures_of_result(result), result)
    if found.holds is Content.CONFIGURATIONS:
        return _Input(configurations_of(path, found, rate))
    way = up if not up or up[0] in "+-" else f"+{up}"
    held = held_postures(path, found, unit=unit or None, up=way or None, rate=rate, body_model=body_model)
    return _Input(held)


def _clips(given: _Input) -> Any:
    """Return which sequence each posture belongs to: its clip, or one for all."""
    return getattr(given.postures, "clip", None)


def _direction(text: str) -> Any:
    """Read the direction up."""
    if text not in UP_AXES:
        raise InputError(f"--up: {text!r}; expected one of +x, -x, +y, -y, +z, -z")
    axis, sign = UP_AXES[text]
    return tuple(sign if k == axis else 0.0 for k in range(3))
