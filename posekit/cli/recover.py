"""`posekit recover`: one view in, every physically possible posture out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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
    progress,
    rule_numbers,
    signed_length,
    split,
)
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.pipeline import Recovery, Tolerance

EXAMPLES = examples(
    "posekit synth walker -o walk.json && posekit recover walk.json -o postures.json",
    "posekit recover walk.json -o postures.npz --checks rigid-parts,joint-range,collision,walking",
    "posekit recover measured.json -o postures.json --rigid-tolerance 2cm --group 5cm --explain",
    "posekit recover photo.json -o postures.json --scale closure",
    "posekit recover panda.json -o found.json --linkage panda --scale closure",
)


def recover(
    view: Annotated[Path, typer.Argument(metavar="VIEW", help="A posekit.view/1 file.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="RESULT", help="The result: .json or .npz.")
    ],
    checks: Checks = PHYSICAL,
    ranges: RangesOption = "urdf",
    rules: Rules = "1,2",
    group: Annotated[
        str, typer.Option("--group", metavar="LENGTH", help="Group survivors nearer than this, as 5cm.")
    ] = "",
    rigid_tolerance: Annotated[
        str,
        typer.Option(
            "--rigid-tolerance",
            metavar="LENGTH",
            help="How far distances inside torso and hips may be off. Default: exact where some torso fits "
            "exactly, else 3cm, or 10cm in an uncalibrated view.",
        ),
    ] = "",
    tangent_tolerance: Annotated[
        str,
        typer.Option(
            "--tangent-tolerance",
            metavar="LENGTH",
            help="How much too short for its image a segment may be. Default: as above, 1cm or 5cm.",
        ),
    ] = "",
    angle_tolerance: AngleTolerance = None,
    contact_margin: ContactMargin = "0cm",
    write_urdf: Annotated[
        Path | None,
        typer.Option(
            "--write-urdf",
            metavar="FILE",
            help="Also write the person's figure: URDF, and SRDF beside it.",
        ),
    ] = None,
    scale: Annotated[
        str,
        typer.Option(
            "--scale",
            metavar="HOW",
            help="Uncalibrated views: min, VALUE (pixels a unit), stature:PX, or constraints: closure, coplanar, "
            "perpendicular, collinear, with weights if wanted (closure:1,coplanar:0.5). Default: the view's, else min.",
        ),
    ] = "",
    proportions: Annotated[
        str,
        typer.Option(
            "--proportions",
            metavar="NAME",
            help="Uncalibrated views: relative lengths of the figure, or of taylor (12 points, no neck, no pelvis).",
        ),
    ] = "figure",
    nearer: Annotated[
        Path | None,
        typer.Option(
            "--nearer",
            metavar="FILE",
            help="Which end of each segment is nearer, given by hand: posekit.nearer/1.",
        ),
    ] = None,
    linkage: Annotated[
        str,
        typer.Option(
            "--linkage",
            metavar="FILE|URDF|NAME",
            help="Recover another articulated object from an uncalibrated view.",
        ),
    ] = "",
    infer: Annotated[
        bool,
        typer.Option(
            "--infer/--no-infer",
            help="Complete joints that were not seen, each with the set of its positions.",
        ),
    ] = True,
    explain: Annotated[
        bool, typer.Option("--explain", help="List every pruned branch with the finding that killed it.")
    ] = False,
) -> None:
    """Recover every posture behind a view that passes the checks, each as a configuration of the figure."""
    from posekit import files, pipeline, validators

    distinct(view, output, write_urdf, nearer)
    if linkage:
        for name, given, default in (
            ("--write-urdf", write_urdf, None),
            ("--group", group, ""),
            ("--explain", explain, False),
            ("--checks", checks, PHYSICAL),
            ("--ranges", ranges, "urdf"),
            ("--rules", rules, "1,2"),
            ("--contact-margin", contact_margin, "0cm"),
            ("--angle-tolerance", angle_tolerance, None),
            ("--proportions", proportions, "figure"),
            ("--no-infer", infer, True),
        ):
            if given != default:
                raise InputError(f"{name} is for persons; leave it out with --linkage")
        _recover_object(view, output, linkage, scale, nearer, rigid_tolerance, tangent_tolerance)
        return
    files.check_result_path(output)
    if write_urdf is not None and write_urdf.suffix.lower() != ".urdf":
        raise InputError(
            f"--write-urdf {write_urdf}: expected a name that ends in .urdf; its .srdf is put beside it"
        )
    seen = files.read_view(view)
    table = validators.load_ranges(ranges)
    how = pipeline.parse_scale(scale, per_unit=files.PER_METRE[seen.unit]) if scale else None
    with progress("recovering", len(seen.time)) as done, about(view):
        recovery = pipeline.recover(
            seen,
            checks=split(checks),
            ranges=table,
            rules=rule_numbers(rules),
            tolerance=_tolerance(
                rigid_tolerance,
                tangent_tolerance,
                angle_tolerance,
                pipeline.PHOTOGRAPH
                if isinstance(seen.camera, files.ScaledOrthographicModel)
                else pipeline.MEASURED,
            ),
            contact_margin=signed_length(contact_margin, "--contact-margin"),
            group=files.parse_length(group, name="--group") if group else None,
            scale=how,
            proportions=proportions,
            infer=infer,
            nearer=None if nearer is None else files.read_nearer(nearer),
            progress=done,
        )
    if write_urdf is not None:
        recovery.figure.write(write_urdf)
    files.write_result(output, pipeline.result_of(recovery, unit=seen.unit, explain=explain))
    summarize(recovery)
    empty = sum(not len(frame) for frame in recovery.frames)
    if empty:
        typer.echo(
            f"posekit: warning: {empty} of {len(recovery.frames)} frames have no posture; the table says what rejected "
            "most; noisy points need more tolerance (--rigid-tolerance, --angle-tolerance, --tangent-tolerance), and "
            "a noisy head a given root",
            err=True,
        )
    typer.echo(f"written: {output}")


def _recover_object(
    view: Path, output: Path, linkage: str, scale: str, nearer: Path | None, rigid: str, tangent: str
) -> None:
    """Recover another articulated object than a person."""
    from posekit import files, pipeline
    from posekit.pipeline import objects

    files.check_object_path(output)
    thing = objects.load_object(linkage)
    seen = files.read_object_view(view, thing.linkage)
    tolerance = objects.tolerance_of(
        thing,
        rigid=files.parse_length(rigid, name="--rigid-tolerance") if rigid else None,
        tangent=files.parse_length(tangent, name="--tangent-tolerance") if tangent else None,
    )
    per_unit = 1.0 if seen.unit is None else files.PER_METRE[seen.unit]
    with progress("recovering", len(seen)) as done, about(view):
        result = objects.recover_object(
            seen,
            thing,
            scale=pipeline.parse_scale(scale, per_unit=per_unit) if scale else None,
            nearer=None if nearer is None else files.read_nearer(nearer),
            tolerance=tolerance,
            progress=done,
        )
    files.write_object(output, result)
    for line in objects.object_lines(result):
        typer.echo(line)
    typer.echo(f"written: {output}")


def _tolerance(rigid: str, tangent: str, angle: float | None, otherwise: Tolerance) -> Tolerance | None:
    """Make the tolerance of what was given, the rest as it is by default for such a view."""
    from posekit.files import parse_length
    from posekit.pipeline import EXACT, Tolerance

    if not rigid and not tangent and angle is None:
        return None
    metres = parse_length(rigid, name="--rigid-tolerance") if rigid else otherwise.rigid
    return Tolerance(
        rigid=metres,
        tangent=parse_length(tangent, name="--tangent-tolerance") if tangent else otherwise.tangent,
        placement=metres <= EXACT.rigid,
        angle=otherwise.angle if angle is None else angle,
    )


def summarize(recovery: Recovery) -> None:
    """Print a line a frame: survivors, groups, the nearest to a bound, and what killed most of the rest."""
    from posekit.pipeline.summary import summary_lines

    for line in summary_lines(recovery):
        typer.echo(line)
