"""Ways to place a limb, as a table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.geometry import Array
from posekit.hidden.posture_rows import Index, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbPlacements:
    """S ways to place a limb's free joints on trunks.

    Parameters
    ----------
    trunk : int array (S,)
        On which place of the trunk.
    middle, end : array (S, 3)
        Positions, camera frame, metres; `middle` also where it was known.
    branch : int array (S, 2)
        Near (0) or far (1) of a middle and of an end that were lifted.
    excess : array (S,)
        Metres by which the worst lifted segment is too short for its image; 0 where none is.
    seed : int array (S,)
        Which sample of its trunk's even lattice it belongs to; -1 where it was found by a closer look.
    """

    trunk: Index
    middle: Array
    end: Array
    branch: Index
    excess: Array
    seed: Index

    def take(self, rows: Index | Mask) -> LimbPlacements:
        """Take some of them."""
        return LimbPlacements(**{name: getattr(self, name)[rows] for name in PLACEMENT_FIELDS})

    def and_(self, other: LimbPlacements) -> LimbPlacements:
        """Put two tables together, by trunk."""
        both = LimbPlacements(
            **{name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in PLACEMENT_FIELDS}
        )
        return both.take(np.argsort(both.trunk, kind="stable"))

    def replaced(self, rows: Index, by: LimbPlacements) -> LimbPlacements:
        """Put others in the place of some."""
        merged = {name: getattr(self, name).copy() for name in PLACEMENT_FIELDS}
        for name, values in merged.items():
            values[rows] = getattr(by, name)
        return LimbPlacements(**merged)

    def with_seed(self, seed: Index) -> LimbPlacements:
        """Name other samples that they belong to."""
        return LimbPlacements(
            **{name: getattr(self, name) for name in PLACEMENT_FIELDS if name != "seed"}, seed=seed
        )


PLACEMENT_FIELDS = ("trunk", "middle", "end", "branch", "excess", "seed")
