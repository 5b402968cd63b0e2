"""`posekit recover`: one view in, every physically possible posture out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from posekit.cli.asked import (
    check_noise,
    follow_scaled,
    leaving_out,
    refuse_unexplained,
    refuse_unrecovered,
    settings_of,
)
from posekit.cli.detector_options import Proportions, Reading, Who
from posekit.cli.detector_source import source_of
from posekit.cli.groups import with_groups
from posekit.cli.judging_options import Judging, Tolerances
from posekit.cli.noise_options import Uncertain
from posekit.cli.options import (
    ContactMargin,
    about,
    examples,
    option,
    options_given,
    progress,
    progress_so_far,
    signed_length,
)
from posekit.cli.recover_object import recover_object, refuse_options_of_persons
from posekit.cli.terminal import say
from posekit.display.plural import plural
from posekit.errors import InputError, TooLargeError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from posekit.following.following import Following
    from posekit.formats.own import Result
    from posekit.recovery.recovery import Recovery
    from posekit.recovery.scaled_sequences import ScaledFollowing
    from posekit.views.opened import Opened

RECOVER_EXAMPLES = examples(
    "posekit synth walker -o walk.json && posekit recover walk.json -o postures.json",
    "posekit recover walk.json -o postures.npz --checks rigid-parts,joint-range,collision,walking",
    "posekit recover measured.json -o postures.json --rigid-tolerance 2cm --group 5cm --explain",
    "posekit recover photo.json -o postures.json --scale closure",
    "posekit recover keypoints/ -o postures.npz --camera calibration.toml:cam_01 --stature 175cm",
    "posekit recover panda.json -o found.json --linkage panda --scale closure",
)

FRAMES_NAMED_IN_WARNINGS: Final = 5
"""Frames of one reason that are named."""
REASONS_SHOWN: Final = 3
"""Reasons that are told."""


@with_groups
def recover(
    ctx: typer.Context,
    *,
    view: Annotated[
        Path,
        typer.Argument(
            metavar="VIEW|KEYPOINTS",
            help="A posekit.view/1 file, or a detector's file or folder of key points, in any format that is read.",
        ),
    ],
    output: Annotated[
        Path, option("--output", "RESULT", "The result: .json, .json.gz, .npz or .parquet.", short="-o")
    ],
    judging: Judging,
    group: Annotated[str, option("--group", "LENGTH", "Group survivors nearer than this, as 5cm.")] = "",
    tolerances: Tolerances,
    contact_margin: ContactMargin = "0cm",
    write_urdf: Annotated[
        Path | None,
        option("--write-urdf", "FILE", "Also write the person's figure: URDF, and SRDF beside it."),
    ] = None,
    scale: Annotated[
        str,
        option(
            "--scale",
            "HOW",
            "Uncalibrated views: likely, min, VALUE (pixels a unit), stature:PX, or constraints: closure, coplanar, "
            "perpendicular, collinear, with weights if wanted (closure:1,coplanar:0.5). Default: the view's, else "
            "likely of a photograph, min of exact points.",
        ),
    ] = "",
    proportions: Proportions = "figure",
    nearer: Annotated[
        Path | None,
        option("--nearer", "FILE", "Which end of each segment is nearer, given by hand: posekit.nearer/1."),
    ] = None,
    linkage: Annotated[
        str,
        option(
            "--linkage", "FILE|URDF|NAME", "Recover another articulated object from an uncalibrated view."
        ),
    ] = "",
    uncertain: Uncertain,
    paths: Annotated[
        int,
        option(
            "--follow",
            "K",
            "Follow the person through the frames: the K likeliest paths from survivor to survivor.",
            min=0,
            max=1000,
        ),
    ] = 0,
    follow_scale: Annotated[
        float | None,
        option(
            "--follow-scale",
            "FRACTION",
            "Then: all lengths may be off by a common factor, with this standard deviation, as 0.05; the factor "
            "with which the frames fit and move best is applied. Where the noise is known, and the neck's place: by a "
            "root, or six points of the head.",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        option("--truth", "FILE", "Motion capture of the same seconds: survivors are compared with it."),
    ] = None,
    reading: Reading,
    who: Who,
    explain: Annotated[
        bool, typer.Option("--explain", help="List every pruned branch with the finding that killed it.")
    ] = False,
) -> None:
    """Recover every posture behind a view that passes the checks, each as a configuration of the figure."""
    from posekit.cli.look_further import tell_further
    from posekit.formats import own as files
    from posekit.recovery.conductor import recover as recover_view
    from posekit.recovery.result import result_of
    from posekit.views.given_views import given_views
    from posekit.views.opened import of_person

    if view.is_dir() and output.resolve().parent == view.resolve():
        raise InputError(
            f"-o {output}: is in the folder of key points, which would read it as a picture; choose another folder"
        )
    if linkage:
        refuse_options_of_persons(options_given(ctx))
        recover_object(view, output, linkage, scale, nearer, tolerances)
        return
    files.check_result_path(output)
    _check_urdf_path(write_urdf)
    source = source_of(reading, who, proportions=proportions, deviation=uncertain.deviation)
    settings = settings_of(
        judging,
        tolerances,
        uncertain,
        contact_margin=signed_length(contact_margin, "--contact-margin"),
        group=files.parse_length(group, name="--group") if group else None,
        scale=scale,
        proportions="taylor" if proportions == "taylor" else "figure",
        nearer=None if nearer is None else files.read_nearer(nearer),
    )
    people = given_views(view, source, truth)
    check_noise(people[0].view, uncertain.deviation)  # one camera sees them all
    recovered: list[tuple[Opened, Recovery, ScaledFollowing | None]] = []
    for one in people:  # everybody, before anything is written
        with leaving_out(one, people, recovered):
            if follow_scale is not None:
                scaled = follow_scaled(one.view, view, settings, paths=paths, deviation=follow_scale)
                recovery = scaled.recovery
            else:
                scaled = None
                with progress("recovering", len(one.view)) as done, about(view):
                    recovery = recover_view(one.view, settings, progress=done)
                if paths:
                    recovery = _sides_undone(recovery, view)
            refuse_unrecovered(recovery, view)
            refuse_unexplained(recovery, view, explain=explain)
            recovered.append((one, recovery, scaled))
    written = []
    for one, recovery, scaled in recovered:
        path, figure_path = output, write_urdf
        if len(people) > 1:
            path = of_person(output, one, alone=False)
            figure_path = None if write_urdf is None else of_person(write_urdf, one, alone=False)
        following = _followed(recovery, scaled, view, paths)
        result = result_of(recovery, unit=one.view.unit, explain=explain, following=following)
        further = _further_lines(recovery, scaled, following)
        if truth is not None:
            from posekit.evaluate.comparison import compare

            further += compare(result, one.view.truth).lines
        written.append(_write(result, path, figure_path, one, recovery, further))
    first, found, _ = recovered[0]
    if any(len(frame) for frame in found.frames):
        tell_further(written[0], None if first.says else view)


def _write(
    result: Result,
    path: Path,
    figure_path: Path | None,
    one: Opened,
    recovery: Recovery,
    further: Sequence[str],
) -> Path:
    """Write what was recovered of a person, and say it; what is refused on the way to its words leaves no file."""
    from posekit.recovery.advice import advice_lines
    from posekit.recovery.summary import summary_lines

    lines = [*one.says, *summary_lines(recovery, one.pictures), *advice_lines(recovery)]
    warnings = warnings_of(recovery)
    if figure_path is not None:
        recovery.figure.write(figure_path)
    path, more = _written(path, _with_pictures(result, one))
    for line in lines:
        say(line)
    for line in [*more, *warnings]:
        say(f"posekit: warning: {line}", err=True)
    for line in [*further, f"written: {path}"]:
        say(line)
    return path


def _written(path: Path, result: Result) -> tuple[Path, list[str]]:
    """Write a result, as NPZ beside it where the file could not be read again; return where, and what is to be said."""
    from posekit.recovery.result_output import write_result

    try:
        write_result(path, result)
    except TooLargeError as error:
        instead = path.with_name(path.name.removesuffix(".gz")).with_suffix(".npz")
        if instead.exists():
            raise
        write_result(instead, result)
        return instead, [f"{error}; it is in {instead}"]
    return path, []


def _with_pictures(result: Result, one: Opened) -> Result:
    """Name the pictures that the frames were detected in, where a detector's file does."""
    if not one.pictures:
        return result
    return replace(result, settings={**result.settings, "pictures": list(one.pictures)})


def _check_urdf_path(path: Path | None) -> None:
    """Refuse a name that is no URDF's."""
    if path is not None and path.suffix.lower() != ".urdf":
        raise InputError(
            f"--write-urdf {path}: expected a name that ends in .urdf; its .srdf is put beside it"
        )


def _further_lines(
    recovery: Recovery, scaled: ScaledFollowing | None, following: Following | None
) -> list[str]:
    """Say the scale that was found, and the paths."""
    lines = [] if scaled is None else [_scale_line(scaled)]
    if following is not None:
        from posekit.recovery.summary import following_line
        from posekit.recovery.swapped_labels import swapped_line

        lines += [line for line in (swapped_line(recovery), following_line(following)) if line]
    return lines


def _followed(recovery: Recovery, scaled: ScaledFollowing | None, view: Path, paths: int) -> Following | None:
    """Follow the person through the frames, where that is asked for and not done by now."""
    if scaled is not None or not paths:
        return None if scaled is None else scaled.following
    from posekit.recovery.sequences import follow

    with progress_so_far("following") as done, about(view):
        return follow(recovery, k=paths, progress=done)


def _sides_undone(recovery: Recovery, view: Path) -> Recovery:
    """Exchange left and right back where the person's path says that they were exchanged."""
    from posekit.recovery.swapped_labels import undo_swaps

    with about(view):
        return undo_swaps(recovery)


def _scale_line(scaled: ScaledFollowing) -> str:
    """Say which scale of the lengths was found."""
    tried = scaled.choice.scales
    end = "; it is the last that was tried: a farther one may be better" if scaled.at_the_end else ""
    return f"lengths times {scaled.scale:.3f}, standard deviation {scaled.deviation:.3f} ({len(tried)} tried{end})"


def warnings_of(recovery: Recovery) -> list[str]:
    """Warn of lengths that were moved, of frames that were not recovered, and of those without a posture."""
    from posekit.body.closing import closing_line
    from posekit.formats.own import OpenCVModel

    lines = []
    changed = closing_line(recovery.figure.moved_lengths)
    if changed:
        lines.append(changed)
    total = len(recovery.frames)
    reasons = sorted(recovery.unrecovered.items(), key=lambda pair: -len(pair[1]))
    for reason, frames in reasons[:REASONS_SHOWN]:
        named = ", ".join(str(k) for k in frames[:FRAMES_NAMED_IN_WARNINGS]) + (
            ", …" if len(frames) > FRAMES_NAMED_IN_WARNINGS else ""
        )
        which = f"frame{'s' if len(frames) > 1 else ''} {named}"
        lines.append(f"{len(frames)} of {plural(total, 'frame')} not recovered: {reason} ({which})")
    others = sum(len(frames) for _, frames in reasons[REASONS_SHOWN:])
    if others:
        lines.append(
            f"{others} more not recovered, each with its reason in the result's settings.unrecovered"
        )
    empty = sum(not len(frame) and not frame.reason for frame in recovery.frames)
    if empty:
        # What a deviation does is known where the camera is.
        calibrated = recovery.grower is not None and isinstance(recovery.grower.view.camera, OpenCVModel)
        noise = "their noise said (--deviation PX), or more tolerance" if calibrated else "more tolerance"
        head = "" if recovery.frames[0].family else ", and a noisy head a given root"
        lines.append(
            f"{empty} of {plural(total, 'frame')} have no posture; the table says what rejected most; noisy "
            f"points need {noise} (--rigid-tolerance, --angle-tolerance, --tangent-tolerance){head}"
        )
    return lines
