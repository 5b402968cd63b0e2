"""Judgements that are made when somebody asks for their numbers: verdicts alone need none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from posekit.validators.suite import Judgement


class Deferred(Sequence[Judgement]):
    """A sequence of judgements, each made once, when it is first looked at; nothing is undecided in them.

    Of a batch of N configurations the numbers of K joints are five arrays (N, K): several times what the verdicts take.

    Parameters
    ----------
    makers : sequence of callable
        Each returns one judgement, of the postures that its argument picks; they are called in any order, or never.
    rejected : bool array (N,)
        Which postures they reject.
    """

    def __init__(
        self, makers: Sequence[Callable[[NDArray[Any] | slice], Judgement]], rejected: NDArray[np.bool_]
    ) -> None:
        self._makers = tuple(makers)
        self.rejected = rejected
        self._made: dict[int, Judgement] = {}

    def __len__(self) -> int:
        """Count them, without making them."""
        return len(self._makers)

    @overload
    def __getitem__(self, at: int) -> Judgement: ...
    @overload
    def __getitem__(self, at: slice) -> list[Judgement]: ...
    def __getitem__(self, at: int | slice) -> Judgement | list[Judgement]:
        """Return one, or some, and make them if need be."""
        places = range(len(self))[at]
        return [self._one(k) for k in places] if isinstance(places, range) else self._one(places)

    def of(self, rows: NDArray[np.intp]) -> list[Judgement]:
        """Return them about some postures (M,) alone: the others' are not made."""
        return [maker(rows) for maker in self._makers]

    def renamed(self, rename: Callable[[Judgement], Judgement]) -> Deferred:
        """Return them as they are when something was done with each, once it is made."""

        def after(maker: Callable[[NDArray[Any] | slice], Judgement]) -> Callable[..., Judgement]:
            return lambda rows: rename(maker(rows))

        return Deferred([after(maker) for maker in self._makers], self.rejected)

    def joined(self, judgements: Sequence[Judgement]) -> Deferred:
        """Return them with some that are made by now after them, of the same postures."""
        rejected = self.rejected.copy()
        for judgement in judgements:
            rejected |= judgement.violated.any(axis=1)
        return Deferred([*self._makers, *(judgement.of for judgement in judgements)], rejected)

    def _one(self, place: int) -> Judgement:
        if place not in self._made:
            self._made[place] = self._makers[place](slice(None))
        return self._made[place]
