"""What is drawn of a frame where nothing is asked for: its likeliest posture first, then what else it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from posekit.answers.wording import percent
from posekit.body import with_head
from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import Postures, Result, View
from posekit.skeleton import JOINTS
from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown

MAX_BESIDE: Final = 6
"""Postures that stand side by side where nothing is asked for."""

MAX_TOLD: Final = 4
"""Probabilities in a caption."""


def likeliest_first(shown: Shown, most: int | None = None) -> Shown:
    """Return the postures that stand for all of a frame, the likeliest first; all, where nothing says how likely.

    Parameters
    ----------
    shown : Shown
        All postures of a frame.
    most : int, optional
        How many are returned at most.
    """
    if not len(shown) or (shown.answer is None and shown.probability is None):
        return shown
    if shown.answer is not None:
        rows, share = shown.answer.representatives, shown.answer.probability
    else:
        assert shown.probability is not None
        rows = np.argsort(-shown.probability, kind="stable")
        share = shown.probability[rows]
    apart = ", from left to right" if most == MAX_BESIDE and len(rows) > 1 else ""
    told = [percent(one) for one in share[:MAX_TOLD].tolist()]
    said = f"likeliest: {told[0]}"
    if len(rows) > 1 and most != 1:
        said += f"; then {', '.join(told[1:])}" + (", …" if len(rows) > MAX_TOLD else "")
    rows = rows[:most]
    chosen = shown.chosen(rows.tolist())
    return replace(
        chosen, caption=f"{said}{apart} ({plural(len(shown), 'posture')})", probability=share[: len(rows)]
    )


def opening_frames(
    subject: DrawnSubject,
    content: Result | Postures | HeldPostures | View,
    frames: Sequence[int],
    *,
    moving: bool,
    most: int | None = MAX_BESIDE,
) -> list[Shown]:
    """Choose what is drawn of some frames where nothing is asked for.

    That is the likeliest path if there is one and the picture moves, else the likeliest posture with what else it can
    be.

    Parameters
    ----------
    subject : DrawnSubject
        All frames.
    content : Result, Postures, HeldPostures or View
        What they are of.
    frames : sequence of int
        Which frames.
    moving : bool
        Whether they are drawn one after another.
    most : int, optional
        Postures of a frame, at most.
    """
    if moving and isinstance(content, Result) and content.paths is not None:
        path = along_path(subject, content)
        return [path[k] for k in frames]
    return [likeliest_first(subject.frames[k], most) for k in frames]


def by_probability(shown: Shown) -> Shown:
    """Return all postures of a frame, the likeliest first."""
    if shown.probability is None:
        return shown
    rows = np.argsort(-shown.probability, kind="stable").tolist()
    return replace(shown.chosen(rows), caption=plural(len(shown), "posture"))


def along_path(subject: DrawnSubject, content: Result | Postures | HeldPostures | View) -> list[Shown]:
    """Return the frames of a subject with the postures of a result's likeliest path, its depths smoothed where it can.

    Raises
    ------
    InputError
        Where the result has no path.
    """
    paths = content.paths if isinstance(content, Result) else None
    if paths is None:
        raise InputError("--posture path: the result has no path; recover it with --follow 1")
    smoothed = paths.smoothed[0]
    points = with_head(np.where(np.isnan(smoothed), paths.joints[0], smoothed))
    frames = []
    for k, shown in enumerate(subject.frames):
        scale, survivor = float(paths.scale[0, k]), int(paths.survivor[0, k])
        sight = shown.sight
        if sight is not None and np.isfinite(scale):
            sight = sight.rescaled(scale)
        if survivor >= 0:
            chosen = shown.chosen([survivor])
            moved = points[k] - chosen.points[0]
            moved[len(JOINTS) :] = moved[0]  # a path says nothing of the head, which stays on the neck
            chosen = replace(chosen, points=chosen.points + moved, q=None)
        else:
            known = int(np.isfinite(points[k]).any())
            chosen = Shown(
                points=points[k : k + known],
                scales=np.array([scale] * known) if np.isfinite(scale) else None,
                time=shown.time,
            )
        said = "likeliest path" + (", bridged" if survivor < 0 else "")
        frames.append(replace(chosen, sight=sight, caption=said))
    return frames


def numbered(frames: Sequence[Shown], numbers: Sequence[int]) -> list[Shown]:
    """Write the number of each frame into its caption, with its time where it has one."""
    return [
        replace(
            shown, caption=f"frame {k}{when(shown.time)}" + (f"\n{shown.caption}" if shown.caption else "")
        )
        for shown, k in zip(frames, numbers, strict=True)
    ]


def when(time: float) -> str:
    """Spell a time in seconds; nothing where it is not known."""
    return f", {time:.2f} s" if np.isfinite(time) else ""
