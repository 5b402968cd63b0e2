"""Left and right that a detector exchanged in some frames, undone where the path through them gets likelier."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.errors import PosekitError
from posekit.following import Paths, SurvivorFrame, best_paths
from posekit.formats.keypoints.side_body import ARM_JOINTS, LEG_JOINTS
from posekit.formats.own import OpenCVModel, View
from posekit.geometry import Array
from posekit.recovery.conductor import recover
from posekit.recovery.grower import Grower
from posekit.recovery.person import uncertainty_of
from posekit.recovery.recovery import Recovery
from posekit.recovery.sequences import ranked_frames
from posekit.skeleton import POINT

SWAP_ODDS: Final = 0.01
"""Odds that labels are exchanged in a frame, before its path is known."""

LONGEST_RUN: Final = 15
"""Frames in a row that are tried with labels exchanged."""

FRAMES_AROUND: Final = 8
"""Frames on either side along which the paths through exchanged ones are compared."""

NEARER_SHARE: Final = 0.5
"""Points move on as exchanged where that leaves less than this of the squared distance to where they were going."""

FRAMES_TOGETHER: Final = 9
"""Frames that are recovered together: too few to look for another body of the clip."""

FEWEST_FRAMES: Final = 3
"""Frames that show a motion."""

PAIRS: Final[Mapping[str, tuple[str, ...]]] = {
    "legs": LEG_JOINTS,
    "arms": ARM_JOINTS,
    "all": (*LEG_JOINTS, *ARM_JOINTS, "eye", "ear"),
}
"""Points that a detector exchanges together, without their sides."""


def undo_swaps(recovery: Recovery, *, figure: Figure | None = None) -> Recovery:
    """Try frames with left and right exchanged, and keep that where the path gets likelier than the odds of a swap.

    Frames are tried that have no posture, that the path passes over, and those from one frame to another in which the
    image points of the legs, or of the arms, go on where the other side's were going. Where some are exchanged, the
    view is recovered again, as the body of a clip comes from all its frames.

    Parameters
    ----------
    recovery : Recovery
        Of a sequence of three frames or more seen by a calibrated camera; others come back as they are.
    figure : Figure, optional
        What was recovered with; the built-in one if not given.

    Returns
    -------
    Recovery
        Of the view with labels exchanged in some frames, and `settings` that say in which: ``swapped``, with
        ``legs``, ``arms`` or ``all`` by the frame's number. Where nothing was exchanged, it is the one that was given.
    """
    grower = recovery.grower
    if (
        grower is None
        or grower.nearer is not None
        or not isinstance(grower.view.camera, OpenCVModel)
        or len(recovery.frames) < FEWEST_FRAMES
        or not any(map(len, recovery.frames))
    ):
        return recovery
    frames = ranked_frames(recovery)
    runs = _runs(grower.view, recovery, best_paths(frames))
    tried = {kind: _tried(recovery, grower, runs, kind) for kind in PAIRS}
    swapped: dict[int, str] = {}
    for run, kinds in runs:
        if swapped.keys() & set(run):
            continue
        around = slice(max(run[0] - FRAMES_AROUND, 0), run[-1] + FRAMES_AROUND + 1)
        best, chosen = _cost(frames[around]), ""
        for kind in kinds:
            if not all(k in tried[kind] for k in run):
                continue
            other = [tried[kind][k] if k in run else frame for k, frame in enumerate(frames)]
            cost = _cost(other[around]) - len(run) * math.log(SWAP_ODDS)
            if cost < best:
                best, chosen = cost, kind
        for k in run if chosen else ():
            swapped[k], frames[k] = chosen, tried[chosen][k]
    if not swapped:
        return recovery
    again = recover(_exchanged(grower.view, swapped), grower.settings, figure=figure)
    return replace(
        again, settings={**again.settings, "swapped": {str(k): swapped[k] for k in sorted(swapped)}}
    )


def swapped_line(recovery: Recovery) -> str:
    """Say in which frames what was exchanged back; empty where nothing was."""
    swapped = recovery.settings.get("swapped", {})
    each = ", ".join(f"{k} ({kind})" for k, kind in swapped.items())
    return f"left and right exchanged back in frames {each}" if each else ""


def _tried(
    recovery: Recovery, grower: Grower, runs: Sequence[tuple[list[int], tuple[str, ...]]], kind: str
) -> dict[int, SurvivorFrame]:
    """Recover frames with labels exchanged, a few at once, with the body that was found: those with a posture."""
    wanted = sorted({k for run, kinds in runs if kind in kinds for k in run})
    found: dict[int, SurvivorFrame] = {}
    view = replace(
        _exchanged(grower.view, dict.fromkeys(wanted, kind)),
        lengths=dict(recovery.figure.lengths),
        length_deviation=_length_deviation(recovery, grower),
    )
    settings = grower.settings.changed(length_deviation=None)
    for start in range(0, len(wanted), FRAMES_TOGETHER):
        part = wanted[start : start + FRAMES_TOGETHER]
        try:
            other = recover(view.take(part), settings, figure=recovery.figure)
        except PosekitError:  # such labels cannot be what they say
            continue
        found |= {k: one for k, one in zip(part, ranked_frames(other), strict=True) if len(one.joints)}
    return found


def _exchanged(view: View, swapped: Mapping[int, str]) -> View:
    """Return the view with right and left exchanged in some frames."""
    points, confidence = np.concatenate([view.image, view.head_image], axis=1), view.confidence.copy()
    for k, kind in swapped.items():
        for name in PAIRS[kind]:
            sides = [POINT[f"right_{name}"], POINT[f"left_{name}"]]
            points[k, sides] = points[k, sides[::-1]]
            confidence[k, sides] = confidence[k, sides[::-1]]
    joints = view.image.shape[1]
    return replace(view, image=points[:, :joints], head_image=points[:, joints:], confidence=confidence)


def _length_deviation(recovery: Recovery, grower: Grower) -> float | None:
    """Say how far off the lengths are that were found, or given; None where nothing is refined."""
    asked = grower.settings.length_deviation
    said = grower.view.length_deviation if asked is None else asked
    clip = recovery.settings.get("one_body")
    if clip is not None:
        return float(np.median(list(clip["deviation"].values())))
    if said is None and any(frame.refined is not None for frame in recovery.frames):
        own = uncertainty_of(grower.view, None, own_figure=False).own
        return float(np.median(list(own.values())))
    return said


def _cost(frames: list[SurvivorFrame]) -> float:
    """Return what the likeliest single path costs."""
    return float(best_paths(frames).cost[0]) if any(len(each.joints) for each in frames) else np.inf


def _runs(view: View, recovery: Recovery, paths: Paths) -> list[tuple[list[int], tuple[str, ...]]]:
    """List the frames that are tried together, and what is exchanged in them: the shortest first."""
    count = len(recovery.frames)
    points = np.concatenate([view.image, view.head_image], axis=1)
    kinds: dict[tuple[int, ...], list[str]] = {}
    for kind in ("legs", "arms"):
        side = _side(view.time, points, kind)
        edges = [0, *(np.flatnonzero(np.diff(side)) + 1).tolist(), count]
        for start, end in pairwise(edges):
            if end - start <= min(LONGEST_RUN, count // 2):
                kinds.setdefault(tuple(range(start, end)), []).append(kind)
    runs = {run: (*some, "all") if len(some) > 1 else tuple(some) for run, some in kinds.items()}
    lost = [k for k, frame in enumerate(recovery.frames) if not len(frame) or paths.cheapest[k] < 0]
    runs |= {(k,): tuple(PAIRS) for k in lost}
    return sorted(((list(run), some) for run, some in runs.items()), key=lambda one: (len(one[0]), one[0]))


def _side(time: Array, points: Array, kind: str) -> NDArray[np.intp]:
    """Follow limbs in the picture: whether right is called left (F,), as seen from the first frame."""
    columns = np.array([[POINT[f"{side}_{name}"] for name in PAIRS[kind]] for side in ("right", "left")])
    side = np.zeros(len(points), dtype=np.intp)
    before: list[tuple[float, Array]] = []
    for k, seen in enumerate(points[:, columns]):
        now = float(time[k])
        expected = before[-1][1] if before else seen
        if len(before) > 1:
            (earlier, there), (last, here) = before[-2:]
            moved = (here - there) * ((now - last) / (last - earlier))
            expected = np.where(np.isnan(moved), here, here + moved)
        known = ~np.isnan(seen + seen[::-1] + expected).any(axis=(0, 2))
        straight = float(((seen - expected)[:, known] ** 2).sum())
        exchanged = float(((seen[::-1] - expected)[:, known] ** 2).sum())
        side[k] = side[k - 1] if k and not known.any() else int(exchanged < NEARER_SHARE * straight)
        found = seen[::-1] if side[k] else seen
        before = [*before[-1:], (now, np.where(np.isnan(found), expected, found))]
    return side
