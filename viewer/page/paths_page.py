"""Paths through the frames of a result, as the page plays them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.answers.paths import distinct_paths
from posekit.answers.wording import words_of_paths
from posekit.formats.own.paths import FollowedPaths
from posekit.geometry import Array
from posekit.skeleton import JOINTS, POINTS

MOST_PATHS: Final = 8
"""In a page."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownPaths:
    """P paths through the T frames of a page.

    Parameters
    ----------
    probability : array (P,)
        Of each and what it stands for, the likeliest first; NaN of one that is the only one in the result.
    words : str
        How likely they are, for people.
    survivor : int array (P, T)
        The page's posture of each frame; -1 where the path has none of them.
    points : array (P, T, 19, 3)
        Camera frame, metres, where they are drawn: depths smoothed where they were; NaN where unknown.
    bridged : bool array (P, T, 14)
        Which joints no image point placed.
    """

    probability: Array
    words: str
    survivor: NDArray[np.int32]
    points: Array
    bridged: NDArray[np.bool_]


def paths_shown(
    paths: FollowedPaths | None,
    frames: Sequence[int],
    rows: Sequence[NDArray[np.intp]],
    bodies: Sequence[Array],
    moves: Sequence[Array],
) -> ShownPaths | None:
    """Gather the paths of a result; None where nobody was followed.

    Parameters
    ----------
    paths : FollowedPaths, optional
        Through all frames.
    frames : sequence of T int
        Which of them the page has.
    rows : sequence of T int array
        The number that each of the page's postures has in its frame.
    bodies : sequence of T array (N, 19, 3)
        The page's postures where they are drawn, camera frame, metres.
    moves : sequence of T array (N, 3)
        By which they were moved there.
    """
    if paths is None:
        return None
    chosen, probability = distinct_paths(paths.joints, paths.share)
    chosen, probability = chosen[:MOST_PATHS], probability[:MOST_PATHS]
    index = list(frames)
    smoothed = paths.smoothed[chosen][:, index]
    joints = np.where(np.isnan(smoothed), paths.joints[chosen][:, index], smoothed)
    points = np.full((len(chosen), len(index), len(POINTS), 3), np.nan)
    points[:, :, : len(JOINTS)] = joints
    survivor = np.full(points.shape[:2], -1, dtype=np.int32)
    for t, (row, body, move) in enumerate(zip(rows, bodies, moves, strict=True)):
        place = {number: k for k, number in enumerate(row.tolist())}
        for p, number in enumerate(paths.survivor[chosen, index[t]].tolist()):
            k = place.get(number, -1)
            survivor[p, t] = k
            if k >= 0:
                points[p, t, : len(JOINTS)] += move[k]
                # The head goes along with the neck.
                points[p, t, len(JOINTS) :] = body[k, len(JOINTS) :] + (points[p, t, 0] - body[k, 0])
    alone = len(paths.share) == 1  # how likely others are is not told
    return ShownPaths(
        probability=np.full(1, np.nan) if alone else probability,
        words=words_of_paths(paths),
        survivor=survivor,
        points=points,
        bridged=paths.interpolated[chosen][:, index],
    )
