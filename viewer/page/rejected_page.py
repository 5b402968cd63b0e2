"""One pruned branch for each reason, where a result lists them: the page draws what was rejected beside why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posekit.errors import ViewerError
from posekit.formats.own.result import Result
from posekit.geometry import Array
from posekit.skeleton import POINTS
from posekit.viewer.scene.branch import rejected_of
from posekit.viewer.scene.drawn_subject import DrawnSubject
from posekit.viewer.scene.world import World


@dataclass(frozen=True, kw_only=True, eq=False)
class RejectedExamples:
    """The last pruned branch of each reason, the one that got farthest.

    Parameters
    ----------
    points : array (R, 19, 3)
        In the page's world, metres; NaN beyond a branch's last choice.
    reasons : sequence of R str
        ``check/where``.
    """

    points: Array
    reasons: Sequence[str]


def rejected_shown(result: Result, subject: DrawnSubject, index: int, world: World) -> RejectedExamples:
    """Place the pruned branches of a frame; none where the result lists none or they cannot be placed.

    Parameters
    ----------
    result : Result
        What the page has: one pruned branch for each reason.
    subject : DrawnSubject
        The same.
    index : int
        The frame, from 0.
    world : World
        The page's.
    """
    try:
        shown = rejected_of(result, subject, index)
    except ViewerError:
        return RejectedExamples(points=np.empty((0, len(POINTS), 3)), reasons=())
    return RejectedExamples(points=world.place(shown.points), reasons=tuple(shown.reasons))
