"""What the page needs for flips by hand (Taylor 2000, section 3.1): the segments, and what rejected their combinations.

A pruned branch rejects all combinations of flips that begin as it does; with those that survive, all are told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, chain
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.result import ResultFrame
from posekit.skeleton import POINTS
from posekit.viewer.page.family_page import MIDDLE_POINTS, Step
from posekit.viewer.page.packed import MOST_BRANCH_BITS, packed

Json = dict[str, Any]

BRANCH_BYTES: Final = 17
"""Bytes of a pruned branch in a page: 12, as text of 4 letters for 3 bytes, and its share of the rest."""

MOST_BRANCHES: Final = 120_000
"""Pruned branches in a page, 2 MB; where a result has more, the page has none of them."""


def flips_of(steps: Sequence[Step], levels: Sequence[str]) -> Json:
    """Describe the segments that can be flipped by hand, and which step decides each level of the tree.

    Parameters
    ----------
    steps : sequence of (child, parent, reflected)
        The tree's walk (`posekit.viewer.page.family_page.walk`).
    levels : sequence of str
        The joints of the tree's levels, the root first.

    Returns
    -------
    dict
        ``segments``: name as in ``posekit.nearer/1``, names of both ends, the joints whose mean is each end, the steps
        that turn together. ``levels``: the step of each level from the second.
    """
    names = [*POINTS, *MIDDLE_POINTS]
    joints = [[index] for index in range(len(POINTS))] + [list(pair) for pair in MIDDLE_POINTS.values()]
    turning: dict[tuple[int, ...], list[int]] = {}
    for number, (child, parent, _) in enumerate(steps):
        ends = sorted((child, parent))
        # A girdle turns as a whole: a half of it is from one of two joints to their middle.
        halved = joints[ends[1]] if ends[0] in joints[ends[1]] else ends
        turning.setdefault(tuple(halved), []).append(number)
    segments = [
        {
            "name": f"{names[a]}-{names[b]}",
            "ends": [names[a], names[b]],
            "joints": [joints[a], joints[b]],
            "steps": numbers,
        }
        for (a, b), numbers in turning.items()
    ]
    of_child = {names[child]: number for number, (child, _, _) in enumerate(steps)}
    return {"segments": segments, "levels": [of_child.get(name, -1) for name in levels[1:]]}


def branches_held(frames: Sequence[ResultFrame]) -> int:
    """Return how many pruned branches a page has: all of uncalibrated frames, or none where they are too many."""
    count = sum(len(frame.pruned or ()) for frame in frames if frame.family is not None)
    return count if count <= MOST_BRANCHES else 0


def verdicts(frames: Sequence[ResultFrame], reasons: Mapping[str, int]) -> tuple[Json, list[Json]]:
    """Pack the pruned branches of uncalibrated frames: branch, reason, what was found, the bound that it is beyond.

    Parameters
    ----------
    frames : sequence of ResultFrame
        The page's frames, as the result has them.
    reasons : mapping of str to int
        Number of each reason in the page.

    Returns
    -------
    dict, list of dict
        Arrays for all frames, and for each frame its first branch, how many it has, and whether all postures that
        survive are listed.
    """
    lists = [
        [
            (int("1" + one["branch"], 2), reasons[one["reason"]], *_beyond(one))
            for one in (frame.pruned or () if frame.family is not None else ())
            if len(one["branch"]) <= MOST_BRANCH_BITS and one["reason"] in reasons
        ]
        for frame in frames
    ]
    if not branches_held(frames):
        lists = [[] for _ in frames]
    firsts = accumulate(map(len, lists), initial=0)
    starts = [
        {"firstPruned": first, "pruned": len(one), "complete": not frame.unlisted and frame.refined is None}
        for first, one, frame in zip(firsts, lists, frames, strict=False)
    ]
    rows = list(chain.from_iterable(lists))
    if not rows:
        return {}, starts
    kinds: tuple[tuple[str, Any], ...] = (
        ("prunedBranch", np.uint16),
        ("prunedReason", np.uint16),
        ("prunedValue", np.float32),
        ("prunedBound", np.float32),
    )
    columns: list[NDArray[Any]] = [
        np.array(column, dtype=kind) for column, (_, kind) in zip(zip(*rows, strict=True), kinds, strict=True)
    ]
    return {name: packed(column) for (name, _), column in zip(kinds, columns, strict=True)}, starts


def _beyond(record: Mapping[str, Any]) -> tuple[float, float]:
    """Return what was found and the bound that it is beyond, the nearer one; NaN where that is not told."""
    value, lower, upper = (
        float("nan") if record.get(name) is None else float(record[name])
        for name in ("value", "lower", "upper")
    )
    bound = lower if value < lower else upper
    return value, bound if np.isfinite(bound) else float("nan")


def units_of(frames: Sequence[ResultFrame]) -> dict[str, str]:
    """Return the unit of each reason of the frames' pruned branches."""
    return {one["reason"]: str(one.get("unit", "")) for frame in frames for one in frame.pruned or ()}
