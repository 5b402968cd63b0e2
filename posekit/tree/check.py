"""The protocol between the interpretation tree and whatever judges its nodes."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What a check found in N postures at K places.

    Parameters
    ----------
    value : array (N, K)
        The judged quantity in the check's unit; NaN where it is undecided: not applicable, too close to
        call, or a joint is missing.
    lower, upper : array broadcastable to (N, K)
        Its bounds.
    tolerance : float or array broadcastable to (N, K)
        How far outside a bound is still not a violation (rounding, stated noise), in the same unit.
    rejects : bool array (N, K), optional
        The verdict itself, where another library gave it; else it follows from value and bounds.
    """

    value: Array
    lower: Array
    upper: Array
    tolerance: float | Array = 0.0
    rejects: NDArray[np.bool_] | None = None

    @property
    def margin(self) -> Array:
        """Distance to the nearer bound (N, K): negative outside, NaN undecided."""
        return np.minimum(self.value - self.lower, self.upper - self.value)

    @property
    def violated(self) -> NDArray[np.bool_]:
        """Where the value is outside its bounds by more than the tolerance (N, K); False where undecided."""
        return self.margin < -self.tolerance if self.rejects is None else self.rejects

    @property
    def undecided(self) -> NDArray[np.bool_]:
        """Where nothing could be judged (N, K)."""
        return np.isnan(self.margin)


class Check(Protocol):
    """One kind of judgement over a fixed set of points, in batches."""

    @property
    def name(self) -> str:
        """The validator's name: ``joint_range``."""
        ...

    @property
    def where(self) -> tuple[str, ...]:
        """The K places it judges: ``("right_elbow.flexion",)``."""
        ...

    @property
    def unit(self) -> str:
        """Unit of its values."""
        ...

    @property
    def points(self) -> tuple[int, ...]:
        """The points it reads, as indices into `posekit.skeleton.POINTS`.

        The tree applies the check at the first level where all of them are known.
        """
        ...

    def judge(self, points: Array) -> Findings:
        """Judge postures given as the check's own points, (N, len(self.points), 3), metres."""
        ...


class Screened(Check, Protocol):
    """A check that can also tell, quicker, what is clear.

    Its findings are `judge`'s alone: where a screen says a place, `judge` finds that place violated first.
    """

    def screen(self, points: Array) -> tuple[NDArray[np.int8], Array | None]:
        """Tell what is clear in postures (N, len(self.points), 3).

        Returns
        -------
        places : int array (N,)
            The first place violated, `PASSED` or `UNSURE`.
        presumed : array (M, …), optional
            Questions whose answer was presumed, for `confirm`.
        """
        ...

    def confirm(self, presumed: Array) -> bool:
        """Ask whoever has the last word whether all that was presumed (M, …) is so."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Rule:
    """A screen as numbers, for loops that grow whole trees and ask all checks on the way.

    Parameters
    ----------
    kernels : module
        Where a function ``screen`` tells what is clear in one posture (see `posekit.compiled.frame_kernels.screen`).
        All rules that a tree is grown with have the same.
    kind : int
        What it takes the numbers for.
    numbers : array (N,)
    presumed : int
        How many numbers it gives for `Screened.confirm` with every place violated; 0 where none need be confirmed.
    """

    kernels: ModuleType
    kind: int
    numbers: Array
    presumed: int = 0


class Ruled(Screened, Protocol):
    """A check whose screen is a rule."""

    @property
    def rule(self) -> Rule:
        """The screen; it says what `screen` says."""
        ...
