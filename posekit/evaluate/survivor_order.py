"""What orders the survivors of a frame: a function that is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.recovery.ranked import ranked
from posekit.recovery.recovery import FrameRecovery


@dataclass(frozen=True, kw_only=True, eq=False)
class SurvivorOrder:
    """The order of one frame's N survivors.

    Parameters
    ----------
    order : int array (N,)
        Indices of survivors, the best first.
    probability : array (N,), optional
        That each survivor is the true one, in the survivors' own order; their sum is at most one (what is left is that
        none is). None where the ranking gives none.
    """

    order: NDArray[np.intp]
    probability: Array | None = None


class Ranker(Protocol):
    """Orders the survivors of frames of one person."""

    def __call__(self, frames: Sequence[FrameRecovery], figure: Figure) -> Sequence[SurvivorOrder]:
        """Return one ranking a frame; of a frame without survivors an empty one."""
        ...


def by_probability(frames: Sequence[FrameRecovery], figure: Figure) -> list[SurvivorOrder]:
    """Rank by probability, of a camera held level (`posekit.ranking.rank`)."""
    if not frames:
        return []
    ranking = ranked(frames, figure.lengths, [frame.spread for frame in frames])
    parts = [ranking.of(k) for k in range(len(frames))]
    return [SurvivorOrder(order=part.order, probability=part.probability) for part in parts]


def first_ranked(
    rankings: Sequence[SurvivorOrder], counts: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Array]:
    """Return the first survivor of each frame (-1 where there is none), and its probability (NaN where none is given).

    Raises
    ------
    InputError
        Where a ranking is not of the frame's survivors.
    """
    if len(rankings) != len(counts):
        raise InputError(f"the ranking has {len(rankings)} frames; expected {len(counts)}")
    first = np.full(len(counts), -1, dtype=np.intp)
    probability = np.full(len(counts), np.nan)
    for k, (ranking, count) in enumerate(zip(rankings, counts.tolist(), strict=True)):
        order = np.asarray(ranking.order)
        if order.shape != (count,) or not np.array_equal(np.sort(order), np.arange(count)):
            raise InputError(
                f"the ranking of frame {k} is no order of its {count} survivors; expected each index once"
            )
        given = ranking.probability
        if given is not None and (
            np.shape(given) != (count,) or not ((np.asarray(given) >= 0) & (np.asarray(given) <= 1)).all()
        ):
            raise InputError(
                f"the probabilities of frame {k} are not {count} numbers from 0 to 1; expected one a survivor"
            )
        if count:
            first[k] = order[0]
            probability[k] = np.nan if given is None else given[order[0]]
    return first, probability
