"""`posekit render`: postures as pictures, animations and pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from posekit.cli.options import about, examples, numbers, option, options_given, progress
from posekit.cli.terminal import say
from posekit.conversion.given import read_given
from posekit.display.plural import plural
from posekit.errors import InputError, ViewerError

if TYPE_CHECKING:
    from posekit.formats.held_postures import HeldPostures
    from posekit.formats.own import ObjectResult, Postures, Result, View
    from posekit.geometry import Array

RENDER_EXAMPLES = examples(
    "posekit render postures.json -o survivors.png --posture groups",
    "posekit render postures.json --view walk.json -o first.png --frame 0 --posture 0 --supersample 3",
    "posekit render postures.json -o all.png --layout superposed --background grey",
    "posekit render postures.json -o walk.gif --posture likeliest --fps 5",
    "posekit render postures.npz --view view.json --over recording.mp4 -o over.mp4",
    "posekit render postures.npz --view view.json -o angles.png --angles knee,elbow",
    "posekit render walk.bvh -o walk.html",
    "posekit render postures.json -o turn.gif --frame 1 --posture 0 --turntable 36 --size 640x480",
    "posekit render explained.json --view walk.json -o rejected.png --rejected",
)


DEFAULT_SIZE = "1280x720"


class Layout(StrEnum):
    """How several postures are arranged."""

    SIDE_BY_SIDE = "side-by-side"
    SUPERPOSED = "superposed"


def render(
    ctx: typer.Context,
    given: Annotated[
        list[Path],
        typer.Argument(
            metavar="RESULT|POSTURES|MOTION|VIEW",
            help="A file of any format that holds postures; a view is recovered with default settings. With --over "
            "several results, one a person.",
        ),
    ],
    output: Annotated[
        Path,
        option(
            "--output",
            "FILE",
            "The picture: .png, .gif, .mp4; with --over also a folder; or .html: the page of all survivors, or, with "
            "--posture, --layout, --rejected or --eye, that scene alone.",
            short="-o",
        ),
    ],
    seen: Annotated[
        list[Path] | None,
        option("--view", "VIEW", "What the result was recovered from: shows its camera and image."),
    ] = None,
    over: Annotated[
        Path | None,
        option(
            "--over",
            "IMAGE|FOLDER|VIDEO",
            "Draw over the pictures that the frames came from, through the view's camera, lens included.",
        ),
    ] = None,
    frame: Annotated[
        str, option("--frame", "K|A-B", "From 0. Default: the first with a posture; all where it moves.")
    ] = "",
    posture: Annotated[
        str,
        option(
            "--posture",
            "LIST",
            "From 0, as 0,4; all; likeliest; path, the likeliest; or groups, the first of each. Default: the likeliest "
            "and what else it can be; where it moves, the path, else the likeliest.",
        ),
    ] = "",
    rejected: Annotated[
        bool,
        typer.Option(
            "--rejected",
            help="Instead of survivors, one pruned branch for each reason, with what killed it highlighted; "
            "of a result that was recovered with --explain.",
        ),
    ] = False,
    angles: Annotated[
        str,
        option(
            "--angles",
            "LIST",
            "Instead of figures, joint angles over time with their limits: all, or some as knee,left_elbow.flexion; "
            "-o is a .png, .svg or .pdf.",
        ),
    ] = "",
    truth: Annotated[
        Path | None,
        option(
            "--truth",
            "FILE",
            "A view with truth, or motion of the same seconds: its figure beside the others, its angles dashed.",
        ),
    ] = None,
    layout: Annotated[
        Layout | None,
        typer.Option(
            "--layout", help="Of several postures. Default: side-by-side; superposed where it moves."
        ),
    ] = None,
    size: Annotated[
        str, option("--size", "WxH", "Pixels. Default: 1280x720; with --over the pictures' own.")
    ] = "",
    supersample: Annotated[
        int, typer.Option("--supersample", min=1, max=8, help="Draw this many times larger, then scale down.")
    ] = 2,
    background: Annotated[
        str, option("--background", "COLOUR", "white, grey, black, transparent, or as #e8ebee.")
    ] = "white",
    azimuth: Annotated[
        float | None,
        typer.Option(
            "--azimuth",
            help="Degrees: 0 looks from the view's camera, 90 from its right.",
            show_default=False,
        ),
    ] = None,
    elevation: Annotated[
        float | None, typer.Option("--elevation", help="Degrees above the level.", show_default=False)
    ] = None,
    eye: Annotated[
        str, option("--eye", "X,Y,Z", "Look from this point: metres, z up, the ground at 0.")
    ] = "",
    target: Annotated[str, option("--target", "X,Y,Z", "With --eye: the point to look at.")] = "0,0,0.9",
    fov: Annotated[float, typer.Option("--fov", help="Vertical field of view, degrees.")] = 25.0,
    through_view: Annotated[
        bool,
        typer.Option(
            "--through-view",
            help="Look through the view's own camera: exactly over its image points. Of survivors of several scales, "
            "choose those of one with --posture.",
        ),
    ] = False,
    camera: Annotated[
        bool, typer.Option("--camera/--no-camera", help="Draw the view's camera, image and rays.")
    ] = True,
    ground: Annotated[bool, typer.Option("--ground/--no-ground", help="Draw the ground's grid.")] = True,
    turntable: Annotated[
        int,
        typer.Option("--turntable", min=0, help="Go around once in this many pictures.", show_default=False),
    ] = 0,
    fps: Annotated[
        float | None,
        typer.Option(
            "--fps",
            help="Pictures a second, where it moves. Default: as the frames' times say, else 10.",
            show_default=False,
        ),
    ] = None,
    timeout: Annotated[
        float, typer.Option("--timeout", min=1, help="Seconds after which a browser that hangs is ended.")
    ] = 60.0,
) -> None:
    """Draw postures as a picture, an animation, or a page to be turned by hand.

    Right limbs are orange, left ones blue. Pictures are drawn by an installed Chromium or Chrome, found by
    POSEKIT_BROWSER or on PATH, without a window, a server or an open port; pages (.html) need none.
    """
    from posekit.conversion.composed import DrawnChoice, write_whole_page

    if over is not None:
        from posekit.cli.render_over import render_over
        from posekit.viewer.overlay import Overlay

        _refuse_others(options_given(ctx), "--over", OVER_OPTIONS)
        overlay = Overlay(size=_size(size) if size else None, fps=fps)
        render_over(given, seen or [], over, output, frame=frame, posture=posture, overlay=overlay)
        return
    if angles:
        from posekit.cli.render_angles import render_angles

        _refuse_others(options_given(ctx), "--angles", ANGLE_OPTIONS)
        render_angles(given, seen or [], output, angles=angles, frame=frame, posture=posture, truth=truth)
        return
    if len(given) > 1 or len(seen or []) > 1:
        raise InputError(
            f"got {len(given)} files and {len(seen or [])} views; several are drawn with --over alone"
        )
    file, behind_file = given[0], seen[0] if seen else None
    import numpy as np

    from posekit.viewer.moving import real_time
    from posekit.viewer.pictures import Shot, check_picture, write_picture
    from posekit.viewer.scene.compose import Style
    from posekit.viewer.scene.eye import Eye
    from posekit.viewer.scene.stage import background_colour

    background_colour(background)
    pose = None
    if eye:
        position, middle = numbers(eye, 3, "--eye"), numbers(target, 3, "--target")
        pose = Eye(position=np.array(position), target=np.array(middle), fov=fov)
    shot = Shot(
        size=_size(size or DEFAULT_SIZE),
        supersample=supersample,
        azimuth=azimuth,
        elevation=elevation,
        fov=fov,
        eye=pose,
        through_view=through_view,
        turntable=turntable,
        fps=Shot.fps if fps is None else fps,
        timeout=timeout,
    )
    moving = check_picture(output, shot)
    over_time = moving and not turntable
    content, behind = read_given(file, behind_file, explain=rejected)
    if (
        output.suffix.lower() == ".html"
        and posture in ("", "all")
        and layout is None
        and not rejected
        and not eye
        and truth is None
    ):
        with about(file):
            write_whole_page(output, content, behind, frame=frame, title=file.name)
        say(f"written: {output}")
        return
    with about(file):
        true = None
        if truth is not None:
            true = _truth_of(truth, content, behind, behind_file, rejected)
        asked = DrawnChoice(frame=frame, posture=posture, rejected=rejected, truth=true)
        subject, frames = asked.of(content, behind, moving=over_time)
    arranged = asked.layout(moving=over_time, through_view=through_view)
    style = Style(
        layout=layout.value if layout else arranged,
        background=background,
        camera=camera and truth is None,
        ground=ground,
    )
    if fps is None and over_time:
        shot = replace(shot, fps=real_time([one.time for one in frames]))
    with progress("drawing", turntable if moving and turntable else len(frames) if moving else 1) as done:
        count = write_picture(output, subject, frames, style=style, shot=shot, title=file.name, progress=done)
    pictures = f" ({plural(count, 'picture')})" if moving else ""
    say(f"written: {output}{pictures}")


OVER_OPTIONS = ("--output", "--view", "--over", "--frame", "--posture", "--size", "--fps")
ANGLE_OPTIONS = ("--output", "--view", "--angles", "--frame", "--posture", "--truth")
"""What is heeded beside ``--over``, and beside ``--angles``."""


def _refuse_others(options: Sequence[str], beside: str, heeded: Sequence[str]) -> None:
    """Refuse options that would have no effect."""
    for name in options:
        if name not in heeded:
            raise InputError(f"{name}: means nothing beside {beside}; expected some of {', '.join(heeded)}")


def _truth_of(
    path: Path,
    content: Result | Postures | HeldPostures | ObjectResult,
    view: View | None,
    view_path: Path | None,
    rejected: bool,
) -> Array:
    """Read the truth of a result's frames in the camera's frame."""
    from posekit.cli.true_joints import before_camera, joints_in_view
    from posekit.formats.own import Result
    from posekit.formats.recognising import recognise

    if not isinstance(content, Result) or rejected:
        raise InputError("--truth: is drawn beside what was recovered; expected a result, without --rejected")
    seen = None
    if view is not None:
        seen = joints_in_view(path, recognise(path), view, view_path, len(content.frames))
    return before_camera(content, path)[0] if seen is None else seen


def _size(text: str) -> tuple[int, int]:
    words: Sequence[str] = text.lower().split("x")
    if len(words) != 2 or not all(word.isdecimal() and len(word) < 6 and int(word) > 0 for word in words):
        raise ViewerError(f"--size: {text!r}; expected width x height in pixels, as 1280x720")
    return int(words[0]), int(words[1])
