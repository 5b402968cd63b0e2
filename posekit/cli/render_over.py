"""`posekit render … --over`: postures drawn over the pictures that they came from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from posekit.cli.options import about, progress
from posekit.cli.terminal import say
from posekit.conversion.chosen_postures import chosen_frames, frame_numbers
from posekit.conversion.given import read_given
from posekit.display.plural import plural
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.viewer.overlay import OverlaidPerson, Overlay


def render_over(
    given: Sequence[Path],
    seen: Sequence[Path],
    over: Path,
    output: Path,
    *,
    frame: str,
    posture: str,
    overlay: Overlay,
) -> None:
    """Draw everybody of some results over their pictures.

    Parameters
    ----------
    given : sequence of Path
        Results or views, one a person.
    seen : sequence of Path
        What they were recovered from: one of each, or one of all.
    over : Path
        A photograph, a folder of them, or a video.
    output : Path
        The file, or a folder.
    frame, posture : str
        Which, as the options have it.
    overlay : Overlay
        How.
    """
    from posekit.viewer.overlay import check_overlay, frame_pictures, write_overlay

    check_overlay(output, overlay)
    if over.is_dir() and output.resolve().is_relative_to(over.resolve()):
        raise InputError(
            f"-o {output}: is in the folder of the photographs, which it would join; choose another folder"
        )
    source = frame_pictures(over)
    if len(seen) not in (0, 1, len(given)):
        raise InputError(
            f"--view: {len(seen)} views of {len(given)} results; expected one of each, or one of all"
        )
    people = [
        _person(path, seen[k if len(seen) > 1 else 0] if seen else None, posture)
        for k, path in enumerate(given)
    ]
    frames = frame_numbers(frame, len(people[0].frames))
    with progress("drawing", len(frames or people[0].frames)) as done:
        count, said = write_overlay(output, people, source, replace(overlay, frames=frames), progress=done)
    for line in said:
        say(line)
    say(f"written: {output} ({plural(count, 'picture')})")


def _person(path: Path, seen: Path | None, posture: str) -> OverlaidPerson:
    from posekit.formats.own import Result, View
    from posekit.viewer.overlay import overlaid_person
    from posekit.viewer.scene.drawn_subject import subject_of
    from posekit.viewer.scene.likeliest import numbered

    content, view = read_given(path, seen)
    if not isinstance(content, Result | View):
        raise InputError(
            f"{path}: got motion or postures; --over expected a result: nothing says which camera saw it"
        )
    frames = subject = None
    if posture:
        with about(path):
            subject = subject_of(content, view)
            every = range(len(subject.frames))
            frames = numbered(chosen_frames(subject, content, posture, every, moving=True, over=True), every)
    return overlaid_person(content, view, name=str(path), frames=frames, subject=subject)
