"""Which survivors a page holds: the likeliest first, so many that it stays small, and those that stand for all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.held_postures import HeldPostures
from posekit.formats.own.frame_answer import likeliest_order
from posekit.formats.own.postures import Postures
from posekit.formats.own.result import Result, ResultFrame
from posekit.formats.own.survivor_columns import SurvivorColumns
from posekit.viewer.page.hand_page import BRANCH_BYTES, branches_held

POSTURE_BYTES: Final = 200
"""Bytes of one posture in a page: 19 points of 6 bytes, margins and the like, as text of 4 letters for 3 bytes."""

INFERRED_BYTES: Final = 140
"""Bytes of where a joint can be that was not seen."""

FAMILY_BYTES: Final = 40
"""Bytes of how a posture is lifted at other scales."""

FRAME_BYTES: Final = 2600
"""Bytes of what is said of a frame."""

MOST_EXAMPLES: Final = 60
"""Rejected branches of a frame, one for each reason."""

PAGE_BYTES: Final = 9_500_000
"""Bytes of a page's data: with its scripts it is below 10 MB."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownSurvivors:
    """What of a result is in a page.

    Parameters
    ----------
    result : Result
        With those survivors alone, the likeliest first, and with one pruned branch for each reason; frames that are
        not chosen have none. Without paths.
    rows : sequence of int array
        Of each chosen frame: the number that each survivor has in the whole result.
    counts : sequence of int
        How many survivors the whole result has in each of these frames.
    """

    result: Result
    rows: Sequence[NDArray[np.intp]]
    counts: Sequence[int]


def survivors_shown(result: Result, frames: Sequence[int], most: int | None = None) -> ShownSurvivors:
    """Choose what a page holds of a result.

    Parameters
    ----------
    result : Result
        With any number of survivors.
    frames : sequence of int
        Which of its frames, from 0.
    most : int, optional
        How many survivors; as many as fit into 10 MB if not given.
    """
    chosen = [result.frames[index] for index in frames]
    counts = [len(frame.joints) for frame in chosen]
    most = _most(chosen) if most is None else most
    each = most_of_each(counts, most)
    rows = [_rows(frame, each) for frame in chosen]
    nothing = np.zeros(0, dtype=np.intp)
    of = dict(zip(frames, rows, strict=True))
    shown = [frame_of_rows(frame, of.get(index, nothing)) for index, frame in enumerate(result.frames)]
    return ShownSurvivors(result=replace(result, frames=shown, paths=None), rows=rows, counts=counts)


def postures_shown(given: Postures | HeldPostures) -> Postures | HeldPostures:
    """Leave out what is too much for a page: the postures at the end.

    Parameters
    ----------
    given : Postures or HeldPostures
        Of any number.
    """
    most = PAGE_BYTES // POSTURE_BYTES
    if isinstance(given, HeldPostures):
        if len(given) <= most:
            return given
        return replace(
            given,
            postures=_first(given.postures, most),
            **{name: getattr(given, name)[:most] for name in ("frame", "clip", "time", "feet", "q")},
        )
    return given if len(given.joints) <= most else _first(given, most)


def most_of_each(counts: Sequence[int], most: int) -> int:
    """Return how many survivors each frame may have, so that all together have so many at most, or one a frame.

    Parameters
    ----------
    counts : sequence of int
        How many each has.
    most : int
        How many there may be.
    """
    low, high = 1, max(1, *counts) if counts else 1
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if np.minimum(counts, middle).sum() <= most else (low, middle - 1)
    return low


def frame_of_rows(frame: ResultFrame, rows: NDArray[np.intp]) -> ResultFrame:
    """Return a frame with some of its survivors, in an order; of its answer what is said of all.

    Parameters
    ----------
    frame : ResultFrame
        With all.
    rows : int array (K,)
        Which, from 0.
    """
    columns = {one.name: _taken(getattr(frame, one.name), rows) for one in fields(SurvivorColumns)}
    return replace(frame, **columns, posture_set=None, answer=None, pruned=_one_a_reason(frame))


def _one_a_reason(frame: ResultFrame) -> list[Mapping[str, Any]]:
    """Return the last pruned branch of each reason, the one that got farthest; none where none are listed."""
    last = {str(record.get("reason", "")): record for record in frame.pruned or ()}
    return list(last.values())[:MOST_EXAMPLES]


def _taken(values: Any, rows: NDArray[np.intp]) -> Any:
    if values is None:
        return None
    if isinstance(values, np.ndarray):
        return values[rows]
    if isinstance(values, dict):
        return {name: each[rows] for name, each in values.items()}
    if hasattr(values, "chi2"):
        return None
    return [values[row] for row in rows.tolist()]


def _most(frames: Sequence[ResultFrame]) -> int:
    hidden = max((len(one) for frame in frames for one in (frame.inferred or ())[:1]), default=0)
    margins = 6 * max(len(frames[0].margins) - 4, 0)
    family = FAMILY_BYTES * any(frame.family is not None for frame in frames)
    room = PAGE_BYTES - FRAME_BYTES * len(frames) - BRANCH_BYTES * branches_held(frames)
    return max(room, 0) // (POSTURE_BYTES + margins + family + INFERRED_BYTES * hidden)


def _rows(frame: ResultFrame, most: int) -> NDArray[np.intp]:
    """Order a frame's survivors, the likeliest first; those that stand for all are among them."""
    count = len(frame.joints)
    order = np.arange(count)
    if frame.probability is not None:
        order = likeliest_order(frame.probability, frame.answer)
    kept = order[:most]
    if frame.answer is not None and most < count:
        kept = np.concatenate(
            [kept, frame.answer.representatives[~np.isin(frame.answer.representatives, kept)]]
        )
    return np.asarray(kept, dtype=np.intp)


def _first(postures: Postures, most: int) -> Postures:
    head = None if postures.head is None else postures.head[:most]
    return Postures(joints=postures.joints[:most], head=head)
