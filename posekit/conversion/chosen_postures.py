"""Which frames, and which postures of each, are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.formats.held_postures import HeldPostures
    from posekit.formats.own import Postures, Result, View
    from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown

POSTURE_WORDS = "numbers from 0 with commas, all, likeliest, path or groups"


def chosen_frames(
    subject: DrawnSubject,
    content: Result | Postures | HeldPostures | View,
    posture: str,
    frames: Sequence[int],
    *,
    moving: bool,
    over: bool = False,
) -> list[Shown]:
    """Choose what is drawn of some frames: see `opening_frames` for what that is where nothing is asked for.

    Parameters
    ----------
    subject : DrawnSubject
        All frames.
    content : Result, Postures, HeldPostures or View
        What they are of.
    posture : str
        As ``--posture`` has it; empty where nothing is asked for.
    frames : sequence of int
        Which frames.
    moving : bool
        Whether they are drawn one after another.
    over : bool
        Whether they are drawn over a photograph.
    """
    from posekit.viewer.scene.likeliest import MAX_BESIDE, along_path, by_probability, opening_frames

    if posture == "path":
        path = along_path(subject, content)
        return [path[k] for k in frames]
    if posture == "all" and over:
        return [by_probability(subject.frames[k]) for k in frames]
    if posture:
        return [chosen_postures(subject.frames[k], posture, k) for k in frames]
    most = None if over else 1 if moving else MAX_BESIDE
    return opening_frames(subject, content, frames, moving=moving, most=most)


def chosen_postures(shown: Shown, text: str, frame: int) -> Shown:
    """Choose postures of a frame by a list of numbers from 0, ``all``, ``likeliest`` or ``groups``.

    Parameters
    ----------
    shown : Shown
        All of the frame.
    text : str
        The list or the word.
    frame : int
        The frame's number, for errors.
    """
    from posekit.viewer.scene.likeliest import likeliest_first

    if text == "all" or len(shown) == 0:
        return shown
    if text == "likeliest":
        if shown.probability is None:
            raise InputError(
                "--posture likeliest: nothing says how likely the postures are; expected a result"
            )
        return likeliest_first(shown, 1)
    if text == "groups":
        if shown.groups is None:
            raise InputError("--posture groups: the result has no groups; recover it with --group 5cm")
        groups = shown.groups.tolist()
        return shown.chosen([groups.index(group) for group in sorted(set(groups))])
    words = [word.strip() for word in text.split(",") if word.strip()]
    rows = [number_of(word, len(shown), f"--posture: frame {frame}: {word!r}") for word in words]
    if not rows:
        raise InputError(f"--posture: {text!r}; expected {POSTURE_WORDS}")
    return shown.chosen(rows)


def frame_numbers(text: str, count: int) -> list[int] | None:
    """Read ``K`` or ``A-B`` of `count` frames, from 0; None where nothing is asked for."""
    if not text:
        return None
    first, dash, last = text.partition("-")
    start = number_of(first, count, f"--frame: {text!r}")
    end = number_of(last, count, f"--frame: {text!r}") if dash else start
    if end < start:
        raise InputError(f"--frame: {text!r}; expected the first frame before the last, as 0-4")
    return list(range(start, end + 1))


def number_of(word: str, count: int, what: str) -> int:
    """Read the number of one of `count`, from 0."""
    if not (word.isdecimal() and len(word) < 10 and int(word) < count):
        raise InputError(f"{what}; expected a number from 0 to {count - 1}")
    return int(word)
