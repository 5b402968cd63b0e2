"""What ranking returns: a probability for every survivor of every frame, and what it is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Ranking(ShortRepr):
    """The probabilities of N survivors, over the frames that they are of.

    Parameters
    ----------
    probability : array (N,)
        That a survivor is the one nearest to the truth, if one of its frame is: over a frame they sum to one.
    frame : int array (N,)
        The frame of each survivor.
    terms : mapping
        What the probability is made of: by name, weighted log terms (N,). The probability is proportional to the
        exponential of their sum.
    up : str
        Who says which way is up; empty where nobody does.
    """

    probability: Array
    frame: NDArray[np.intp]
    terms: Mapping[str, Array]
    up: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "terms", MappingProxyType(dict(self.terms)))
        for array in (self.probability, self.frame, *self.terms.values()):
            array.flags.writeable = False

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.frame)

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """The survivors (N,) frame by frame, the most probable of each first; equals stay in their order."""
        return np.lexsort((-self.probability, self.frame))

    def first(self, frames: int) -> NDArray[np.intp]:
        """Return the most probable survivor of each of the first frames (F,); -1 where a frame has none."""
        found = np.full(frames, -1, dtype=np.intp)
        ranked = self.frame[self.order]
        starts = np.flatnonzero(np.diff(ranked, prepend=-1))
        inside = starts[ranked[starts] < frames]
        found[ranked[inside]] = self.order[inside]
        return found

    def of(self, frame: int) -> Ranking:
        """Return the ranking of one frame's survivors alone, in their order."""
        rows = np.flatnonzero(self.frame == frame)
        return Ranking(
            probability=self.probability[rows],
            frame=self.frame[rows],
            terms={name: values[rows] for name, values in self.terms.items()},
            up=self.up,
        )


def softmax(score: Array, frame: NDArray[np.intp]) -> Array:
    """Return probabilities (N,) in proportion to the exponential of scores, of each frame's for itself.

    Where all scores of a frame are minus infinity its survivors are equally probable.
    """
    if not len(score):
        return np.empty(0)
    order = np.argsort(frame, kind="stable")
    starts = np.flatnonzero(np.diff(frame[order], prepend=-1))
    counts = np.diff(starts, append=len(order))
    sorted_score = score[order]
    # The highest score of each frame is taken off, so that no exponential overflows.
    highest = np.repeat(np.maximum.reduceat(sorted_score, starts), counts)
    weight = np.exp(
        np.where(np.isfinite(highest), sorted_score - np.where(np.isfinite(highest), highest, 0.0), 0.0)
    )
    probability = np.empty(len(score))
    probability[order] = weight / np.repeat(np.add.reduceat(weight, starts), counts)
    return probability
