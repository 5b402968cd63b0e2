"""The frames of clips that are shown beside their spans."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.held_postures import HeldPostures
from posekit.formats.motion import UP_DIRECTIONS
from posekit.formats.own.report_clips import ClipVerdict, Still
from posekit.geometry import Array
from posekit.validation.over_time import frames_of

MOST_STILLS: Final = 8
"""Frames of a clip that are kept: the worst of its worst spans."""

MOST_DRAWN_CLIPS: Final = 500
"""Clips of which frames are kept, the worst."""

UP_OF_CAMERAS: Final = "-y"
"""What is taken for up where nothing says it: a camera's frame."""


def stills_of(clips: Sequence[ClipVerdict], held: HeldPostures) -> tuple[tuple[Still, ...], ...]:
    """Keep the worst frame of each of a clip's worst spans, with the frame before.

    Parameters
    ----------
    clips : sequence of ClipVerdict
        The verdicts on the clips of a file.
    held : HeldPostures
        What it holds.
    """
    frames = frames_of(held, "")
    if frames is None:
        return tuple(() for _ in clips)
    points = held.postures.joints
    if held.postures.head is not None:
        points = np.concatenate([points, held.postures.head], axis=1)
    R_up = _upright(UP_DIRECTIONS[held.up or UP_OF_CAMERAS])
    stills = []
    for k, clip in enumerate(clips):
        rows = frames.rows(k)
        known = set(frames.frame[rows][np.isfinite(points[rows]).any(axis=(1, 2))].tolist())
        worst = dict.fromkeys(span.worst_frame for span in clip.spans)
        wanted = [frame for frame in worst if frame in known][:MOST_STILLS]
        at = [int(np.flatnonzero(frames.frame[rows] == frame)[0]) for frame in wanted]
        stills.append(
            tuple(_still(points, rows, one, frame, R_up) for one, frame in zip(at, wanted, strict=True))
        )
    return tuple(stills)


def worst_stills(
    clips: Sequence[ClipVerdict], stills: Sequence[Sequence[Still]], most: int = MOST_DRAWN_CLIPS
) -> list[Sequence[Still]]:
    """Forget the frames of those clips that are not among the worst.

    Parameters
    ----------
    clips : sequence of ClipVerdict
        The verdicts so far.
    stills : sequence of sequences of Still
        Of each clip, what is kept.
    most : int
        Of how many clips to keep them.
    """
    drawn = (k for k, some in enumerate(stills) if some)
    kept = set(sorted(drawn, key=lambda k: clips[k].rank())[:most])
    return [some if k in kept else () for k, some in enumerate(stills)]


def _still(points: Array, rows: NDArray[np.intp], at: int, frame: int, R_up: Array) -> Still:
    shown = points[rows[at]] @ R_up.T
    known = shown[np.isfinite(shown).all(axis=1)]
    middle = known.mean(axis=0) if len(known) else np.zeros(3)
    before = points[rows[at - 1]] @ R_up.T - middle if at else None
    return Still(
        frame=frame,
        points=(shown - middle).astype(np.float32),
        before=None if before is None else before.astype(np.float32),
    )


def _upright(up: Array) -> Array:
    """Return the rotation that takes an axis to z."""
    first = np.roll(np.abs(up), 1)  # the axis after it
    return np.stack([first, np.cross(up, first), up])
