"""`posekit view`: look at a result in the browser."""

from __future__ import annotations

import webbrowser
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from posekit.cli.options import about, examples, option
from posekit.cli.terminal import say
from posekit.conversion.given import read_given
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.formats.held_postures import HeldPostures
    from posekit.formats.own import ObjectResult, Postures, Result, View
    from posekit.viewer.page.server import PageServer
    from posekit.viewer.viser_viewer import ViserViewer

LAST_PORT = 65535

VIEW_EXAMPLES = examples(
    "posekit view postures.json --view walk.json",
    "posekit view trial.trc",
    "posekit view walk.json --frames 0-19 --no-open --port 8000",
    "posekit view postures.json --viser",
)


def view(
    given: Annotated[
        Path,
        typer.Argument(
            metavar="RESULT|POSTURES|MOTION|VIEW",
            help="A file of any format that holds postures; a view is recovered with default settings.",
        ),
    ],
    seen: Annotated[
        Path | None, option("--view", "VIEW", "What the result was recovered from: shows the image too.")
    ] = None,
    frames: Annotated[str, option("--frames", "A-B", "Only these frames, from 0, as 0-99 or 7.")] = "",
    port: Annotated[
        int, typer.Option("--port", min=0, max=LAST_PORT, help="0: any free one.", show_default=False)
    ] = 0,
    open_: Annotated[
        bool, typer.Option("--open/--no-open", help="Open the browser, where there is a screen.")
    ] = True,
    viser: Annotated[
        bool,
        typer.Option("--viser", help="In viser's viewer: the figure by Pinocchio's visualizer, playing."),
    ] = False,
) -> None:
    """Show survivors in 3D in the browser, on this machine only, until Ctrl-C."""
    from posekit.safe_io import extra
    from posekit.viewer.showing import has_screen

    if viser:
        extra("viser", "viser", "posekit view --viser")
    content, behind = read_given(given, seen)
    chosen = _frames(frames)
    with about(given):
        served: PageServer | ViserViewer = (
            _in_viser(content, behind, chosen, port)
            if viser
            else _as_page(content, behind, chosen, port, title=given.name)
        )
    with served as server:
        try:
            say(f"{server.url}  (this machine only; Ctrl-C ends)")
            if open_ and has_screen():
                webbrowser.open(server.url)
            server.serve_forever()
        except KeyboardInterrupt:
            say("stopped")


def _as_page(
    content: Result | Postures | HeldPostures | ObjectResult,
    behind: View | None,
    frames: range | None,
    port: int,
    *,
    title: str,
) -> PageServer:
    from posekit.conversion.composed import page_of
    from posekit.viewer.page.server import PageServer

    made = partial(page_of, content, behind, title=title, served=True)
    return PageServer(made(frames=frames), port, lambda number: made(frames=[number]))


def _in_viser(
    content: Result | Postures | HeldPostures | ObjectResult,
    behind: View | None,
    frames: range | None,
    port: int,
) -> ViserViewer:
    from posekit.formats.own import ObjectResult
    from posekit.viewer.scene.drawn_subject import subject_of
    from posekit.viewer.viser_viewer import ViserViewer

    if isinstance(content, ObjectResult):
        raise InputError("--viser: shows persons; got an object; expected its page: leave the option out")
    subject = subject_of(content, behind)
    if frames is not None:
        if frames.stop > len(subject.frames):
            raise InputError(
                f"--frames: {frames.start}-{frames.stop - 1}; expected numbers from 0 to {len(subject.frames) - 1}"
            )
        subject = replace(subject, frames=[subject.frames[k] for k in frames])
    return ViserViewer(subject, port)


def _frames(text: str) -> range | None:
    """Read ``A-B`` or ``A``, counted from 0."""
    if not text:
        return None
    first, dash, last = text.partition("-")
    last = last if dash else first
    # Nine digits are more than any file's frames, and no work to read.
    digits = all(number.isdecimal() and len(number) < 10 for number in (first, last))
    if not digits or int(first) > int(last):
        raise InputError(
            f"--frames: {text!r}; expected numbers from 0, the first not after the last, as 0-99"
        )
    return range(int(first), int(last) + 1)
