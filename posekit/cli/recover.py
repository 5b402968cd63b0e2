"""`posekit recover`: one view in, every physically possible posture out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from posekit.cli.detector_options import (
    Calibrate,
    CameraFile,
    Deviation,
    FieldOfView,
    Focal35,
    Format,
    LengthsFile,
    MinConfidence,
    Person,
    Proportions,
    Rate,
    Size,
    Skeleton,
    Stature,
    SwapSides,
)
from posekit.cli.detector_source import source_of
from posekit.cli.options import (
    PHYSICAL,
    AngleTolerance,
    Checks,
    ContactMargin,
    RangesOption,
    Rules,
    Walkers,
    about,
    distinct,
    examples,
    progress,
    rule_numbers,
    signed_length,
    split,
)
from posekit.errors import InputError, PosekitError

if TYPE_CHECKING:
    from posekit.files import View
    from posekit.pipeline import Recovery, Rooting, Tolerance
    from posekit.pipeline.detected import Opened
    from posekit.validators import Ranges

EXAMPLES = examples(
    "posekit synth walker -o walk.json && posekit recover walk.json -o postures.json",
    "posekit recover walk.json -o postures.npz --checks rigid-parts,joint-range,collision,walking",
    "posekit recover measured.json -o postures.json --rigid-tolerance 2cm --group 5cm --explain",
    "posekit recover photo.json -o postures.json --scale closure",
    "posekit recover keypoints/ -o postures.npz --camera calibration.toml:cam_01 --stature 175cm",
    "posekit recover panda.json -o found.json --linkage panda --scale closure",
)


MOST = 1024
"""Survivors of a frame that paths may go through: the likeliest."""


def recover(
    view: Annotated[
        Path,
        typer.Argument(
            metavar="VIEW|KEYPOINTS",
            help="A posekit.view/1 file, or a detector's file or folder of key points, in any format that is read.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="RESULT", help="The result: .json or .npz.")
    ],
    checks: Checks = PHYSICAL,
    ranges: RangesOption = "urdf",
    rules: Rules = "1,2",
    walkers: Walkers = "paper",
    group: Annotated[
        str, typer.Option("--group", metavar="LENGTH", help="Group survivors nearer than this, as 5cm.")
    ] = "",
    rigid_tolerance: Annotated[
        str,
        typer.Option(
            "--rigid-tolerance",
            metavar="LENGTH",
            help="How far distances inside torso and hips may be off. Default: exact where some torso fits "
            "exactly, else 3cm, or 10cm in an uncalibrated view. A tolerance that is given turns refinement off.",
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
    proportions: Proportions = "figure",
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
    root: Annotated[
        str,
        typer.Option(
            "--root",
            metavar="HOW",
            help="Calibrated views without a root: find the neck's depth by auto, head, torso or search.",
        ),
    ] = "auto",
    deviation: Deviation = None,
    refine: Annotated[
        bool | None,
        typer.Option(
            "--refine/--no-refine",
            help="Turn survivors into the likeliest postures near them, and reject what the noise cannot explain. "
            "Default: where the view, a detector or --deviation says how noisy its points are.",
        ),
    ] = None,
    length_deviation: Annotated[
        float | None,
        typer.Option(
            "--length-deviation",
            metavar="FRACTION",
            help="Then: how far lengths may be off, standard deviation. Default: 0.01, from shoulder to pelvis 0.02.",
        ),
    ] = None,
    paths: Annotated[
        int,
        typer.Option(
            "--follow",
            metavar="K",
            min=0,
            max=1000,
            help="Follow the person through the frames: the K likeliest paths through the 1024 likeliest survivors of "
            "each; minutes where there are so many.",
        ),
    ] = 0,
    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth",
            metavar="FILE",
            help="Motion capture of the same seconds: survivors are compared with it.",
        ),
    ] = None,
    format: Format = "",
    skeleton: Skeleton = "",
    person: Person = "",
    swap_sides: SwapSides = False,
    camera: CameraFile = "",
    fov: FieldOfView = None,
    focal35: Focal35 = None,
    size: Size = "",
    fps: Rate = None,
    min_confidence: MinConfidence = 0.0,
    stature: Stature = "",
    lengths: LengthsFile = None,
    calibrate: Calibrate = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="List every pruned branch with the finding that killed it.")
    ] = False,
) -> None:
    """Recover every posture behind a view that passes the checks, each as a configuration of the figure."""
    from posekit import files, pipeline, validators
    from posekit.pipeline.detected.compare import compare
    from posekit.pipeline.detected.conversion import of_person
    from posekit.pipeline.detected.given_views import given_views
    from posekit.sequences import Beam

    for read in (view, nearer, truth, calibrate, lengths):
        distinct(output, write_urdf, read)
    if view.is_dir() and output.resolve().parent == view.resolve():
        raise InputError(
            f"-o {output}: is in the folder of key points, which would read it as a picture; choose another folder"
        )
    if linkage:
        for name, given, default in (
            ("--write-urdf", write_urdf, None),
            ("--group", group, ""),
            ("--explain", explain, False),
            ("--checks", checks, PHYSICAL),
            ("--ranges", ranges, "urdf"),
            ("--rules", rules, "1,2"),
            ("--walkers", walkers, "paper"),
            ("--contact-margin", contact_margin, "0cm"),
            ("--angle-tolerance", angle_tolerance, None),
            ("--proportions", proportions, "figure"),
            ("--no-infer", infer, True),
            ("--refine", refine, None),
            ("--length-deviation", length_deviation, None),
            ("--follow", paths, 0),
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
    source = source_of(
        format=format,
        skeleton=skeleton,
        person=person,
        swap_sides=swap_sides,
        camera=camera,
        fov=fov,
        focal35=focal35,
        size=size,
        fps=fps,
        min_confidence=min_confidence,
        deviation=deviation,
        stature=stature,
        lengths=lengths,
        calibrate=calibrate,
        proportions=proportions,
    )
    asked = Asked(
        checks=split(checks),
        ranges=validators.load_ranges(ranges),
        rules=rule_numbers(rules),
        walkers=walkers,
        rigid=rigid_tolerance,
        tangent=tangent_tolerance,
        angle=angle_tolerance,
        contact_margin=signed_length(contact_margin, "--contact-margin"),
        group=files.parse_length(group, name="--group") if group else None,
        scale=scale,
        proportions=proportions if proportions in ("figure", "taylor") else "figure",
        nearer=None if nearer is None else files.read_nearer(nearer),
        infer=infer,
        rooting=pipeline.Rooting(method=root, deviation=deviation),  # type: ignore[arg-type]
        refine=refine,
        length_deviation=length_deviation,
        explain=explain,
    )
    people = given_views(view, source, truth)
    alone = len(people) == 1
    recovered = asked.recover_all(people, view)
    for one, recovery in recovered:
        for line in one.says:
            typer.echo(line)
        if write_urdf is not None:
            recovery.figure.write(of_person(write_urdf, one, alone=alone))
        path = of_person(output, one, alone=alone)
        with about(view):
            following = pipeline.follow(recovery, k=paths, beam=Beam(survivors=MOST)) if paths else None
        result = pipeline.result_of(recovery, unit=one.view.unit, explain=explain, following=following)
        files.write_result(path, result)
        summarize(recovery)
        if following is not None:
            typer.echo(pipeline.following_line(following))
        if truth is not None:
            for line in compare(recovery, one.view.truth).lines:
                typer.echo(line)
        typer.echo(f"written: {path}")


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What the options ask of every view."""

    checks: tuple[str, ...]
    ranges: Ranges
    rules: tuple[int, ...]
    walkers: str
    rigid: str
    tangent: str
    angle: float | None
    contact_margin: float
    group: float | None
    scale: str
    proportions: str
    nearer: Sequence[Mapping[str, str]] | None
    infer: bool
    rooting: Rooting
    refine: bool | None
    length_deviation: float | None
    explain: bool

    def recover_all(self, people: Sequence[Opened], path: Path) -> list[tuple[Opened, Recovery]]:
        """Recover everybody before anything is written; of several people, warn of those who cannot be."""
        recovered = []
        for one in people:
            try:
                recovered.append((one, self.recover(one.view, path)))
            except PosekitError as error:
                if len(people) == 1 or (one is people[-1] and not recovered):
                    raise
                typer.echo(f"posekit: warning: person {one.person} is left out: {error}", err=True)
        return recovered

    def recover(self, seen: View, path: Path) -> Recovery:
        """Recover a view that comes from `path`."""
        from posekit import files, pipeline

        uncalibrated = isinstance(seen.camera, files.ScaledOrthographicModel)
        otherwise = pipeline.PHOTOGRAPH if uncalibrated else pipeline.MEASURED
        with progress("recovering", len(seen.time)) as done, about(path):
            return pipeline.recover(
                seen,
                checks=self.checks,
                ranges=self.ranges,
                rules=self.rules,
                walkers=self.walkers,
                tolerance=_tolerance(self.rigid, self.tangent, self.angle, otherwise),
                contact_margin=self.contact_margin,
                group=self.group,
                scale=pipeline.parse_scale(self.scale, per_unit=files.PER_METRE[seen.unit])
                if self.scale
                else None,
                proportions=self.proportions,
                infer=self.infer,
                nearer=self.nearer,
                rooting=pipeline.Rooting(method=self.rooting.method) if uncalibrated else self.rooting,
                refine=self.refine,
                length_deviation=self.length_deviation,
                progress=done,
            )


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
    from posekit.pipeline.advice import advice_lines
    from posekit.pipeline.summary import summary_lines

    for line in [*summary_lines(recovery), *advice_lines(recovery)]:
        typer.echo(line)
    empty = sum(not len(frame) for frame in recovery.frames)
    if empty:
        typer.echo(
            f"posekit: warning: {empty} of {len(recovery.frames)} frames have no posture; the table says what rejected "
            "most; noisy points need their noise said (--deviation PX), or more tolerance (--rigid-tolerance, "
            "--angle-tolerance, --tangent-tolerance), and a noisy head a given root",
            err=True,
        )
