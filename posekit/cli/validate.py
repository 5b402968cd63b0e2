"""`posekit validate`: whether postures are physically possible."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from posekit.cli.given import schema_of
from posekit.cli.options import (
    PHYSICAL,
    AngleTolerance,
    Checks,
    ContactMargin,
    RangesOption,
    Rules,
    about,
    distinct,
    examples,
    rule_numbers,
    signed_length,
    split,
)
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.figure import Figure

SOME_INVALID = 1
EXAMPLES = examples(
    "posekit validate postures.json -o report.json",
    "posekit validate lifted.npz -o report.json --checks joint-range,collision --ranges table1",
)


def validate(
    postures: Annotated[
        Path, typer.Argument(metavar="POSTURES", help="posekit.postures/1 (JSON, NPZ), or a result.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="REPORT", help="The report: .json.")],
    urdf: Annotated[
        str,
        typer.Option(
            "--urdf",
            metavar="FILE|NAME",
            help="human (built in), or a figure's URDF. Default: human; a result's own figure.",
        ),
    ] = "",
    checks: Checks = PHYSICAL,
    ranges: RangesOption = "urdf",
    rules: Rules = "1,2",
    rigid_tolerance: Annotated[
        str,
        typer.Option(
            "--rigid-tolerance",
            metavar="LENGTH",
            help="How far distances inside torso and hips may be off.",
        ),
    ] = "3cm",
    angle_tolerance: AngleTolerance = None,
    contact_margin: ContactMargin = "0cm",
    every: Annotated[
        bool, typer.Option("--all", help="List every finding, not only violations and each check's worst.")
    ] = False,
) -> None:
    """Judge postures: exit 0 if all are valid, 1 if some are not, 2 on bad input."""
    from posekit import files, pipeline, validators

    distinct(postures, output)
    files.check_report_path(output)
    given = files.read_postures(postures)
    if not len(given.joints):
        raise InputError(f"{postures}: it holds no posture; nothing can be judged; expected at least one")
    figure: str | Figure = urdf or "human"
    least = 0.001
    if schema_of(postures).startswith("posekit.result/"):
        own, least = pipeline.recovered_with(files.read_result(postures))
        figure = urdf or own
    angle_tolerance = least if angle_tolerance is None else angle_tolerance
    validator = validators.Validator(
        figure,
        checks=split(checks),
        ranges=ranges,
        rules=rule_numbers(rules),
        rigid_tolerance=files.parse_length(rigid_tolerance, name="--rigid-tolerance"),
        angle_tolerance=angle_tolerance,
        contact_margin=signed_length(contact_margin, "--contact-margin"),
    )
    settings = {
        "urdf": urdf or ("human" if figure == "human" else "as recovered"),
        "ranges": ranges,
        "rules": rules,
        "rigid_tolerance": rigid_tolerance,
        "angle_tolerance": angle_tolerance,
        "contact_margin": contact_margin,
    }
    with about(postures):
        report = pipeline.validate(validator, given, settings=settings, every=every)
    files.write_report(output, report)
    for line in pipeline.verdict_lines(report):
        typer.echo(line)
    typer.echo(f"written: {output}")
    if report.summary["valid"] < len(report.postures):
        raise typer.Exit(SOME_INVALID)
