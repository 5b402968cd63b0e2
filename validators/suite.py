"""What suites of checks say about whole postures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from posekit.body.closed_form import Alike
from posekit.compiled.compiling import is_fast
from posekit.geometry import Array
from posekit.tree import Check

GROWN_WORTH: Final = 10
"""Postures whose judging gains by compiled loops what growing the trees of one frame does."""


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """What one validator says about N postures at its K places.

    Parameters
    ----------
    check : str
        The validator.
    where : tuple of str (K,)
        The places that it judges, as findings name them.
    unit : tuple of str (K,)
        The unit of the values at each place: m or deg.
    value, lower, upper, margin : array (N, K)
        A negative margin is outside; NaN is undecided.
    violated : bool array (N, K)
        Where a value is outside its bounds by more than the tolerance; False where undecided.
    by_pairs : bool
        Whether its one place stands for all pairs of bodies, which `Report.contacts` lists.
    over_time : bool
        Whether it is of a check over time, which says nothing of frames that it does not apply to: they are not
        undecided for that.
    """

    check: str
    where: tuple[str, ...]
    unit: tuple[str, ...]
    value: Array
    lower: Array
    upper: Array
    margin: Array
    violated: NDArray[np.bool_]
    by_pairs: bool = False
    over_time: bool = False

    @property
    def worst(self) -> Array:
        """The smallest margin of each posture (N,); NaN where nothing was decided."""
        return np.asarray(np.fmin.reduce(self.margin, axis=1))

    def without(self, rows: NDArray[np.bool_]) -> Judgement:
        """Return it with nothing decided of some postures (N,), or at some of their places (N, K)."""
        column = rows if rows.ndim == 2 else rows[:, None]
        return replace(
            self,
            value=np.where(column, np.nan, self.value),
            margin=np.where(column, np.nan, self.margin),
            violated=self.violated & ~column,
        )

    def of(self, rows: NDArray[np.intp] | slice) -> Judgement:
        """Return what it says about some of the postures."""
        names = ("value", "lower", "upper", "margin", "violated")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


def worst_margins(checks: Sequence[Check], points: Array, alike: Alike | None = None) -> dict[str, Array]:
    """Find the worst margin of each posture (N,) by validator, NaN where nothing was decided: `judge`, but no more.

    Parameters
    ----------
    checks : sequence of Check
        Which margins; of two that judge one place the later holds where it is decided.
    points : array (N, 19, 3)
        Whole postures, metres.
    alike : callable, optional
        Finds postures that have the points of a check in the same places: it judges one of each set of them.
    """
    found: dict[str, dict[str, Array]] = {}
    for check in checks:
        columns = list(check.points)
        if alike is None:
            margin = check.judge(points[:, columns]).margin
        else:
            rows, place = alike(check.points)
            margin = check.judge(points[rows[:, None], columns]).margin[place]
        margins = found.setdefault(check.name, {})
        for where, new in zip(check.where, margin.T, strict=True):
            margins[where] = np.where(np.isnan(new), margins[where], new) if where in margins else new
    return {name: np.fmin.reduce(list(margins.values())) for name, margins in found.items()}


def judge(checks: Sequence[Check], points: Array) -> list[Judgement]:
    """Ask all checks about whole postures (N, 19, 3), and gather their findings by validator.

    Where two checks judge the same place, the later one knows more joints, and holds where it is decided.
    """
    # Each point in one piece: checks read a few of them, over all postures.
    by_point = np.ascontiguousarray(np.moveaxis(points, 1, 0))
    looped = is_fast(len(points) // GROWN_WORTH)
    return [
        _gathered(name, [check for check in checks if check.name == name], by_point, looped)
        for name in dict.fromkeys(check.name for check in checks)
    ]


def _gathered(name: str, checks: Sequence[Check], by_point: Array, looped: bool) -> Judgement:
    """Ask the checks of one validator about points (19, N, 3); each of its places has one column."""
    units: dict[str, str] = {}
    for check in checks:
        units |= dict.fromkeys(check.where, check.unit)
    column = {where: k for k, where in enumerate(units)}
    # A column lies in one piece: it is written, and mostly read, as a whole.
    value, lower, upper, margin = np.empty((4, len(units), by_point.shape[1]))
    violated = np.empty((len(units), by_point.shape[1]), dtype=np.bool_)
    written: set[str] = set()
    # The last that knows a place holds: those before it are asked about postures that it left open, mostly none.
    for check in reversed(checks):
        rows: Any = slice(None)
        if written.issuperset(check.where):
            rows = np.flatnonzero(np.isnan(margin[[column[where] for where in check.where]]).any(axis=0))
            if not rows.size:
                continue
        own_points = np.moveaxis(by_point[list(check.points)][:, rows], 0, 1)
        findings = check.judge_looped(own_points) if looped else check.judge(own_points)
        shape = findings.value.shape
        new = (
            findings.value,
            np.broadcast_to(findings.lower, shape),
            np.broadcast_to(findings.upper, shape),
            findings.margin,
            findings.violated,
        )
        for k, where in enumerate(check.where):
            at, own, into = column[where], cast(Any, slice(None)), rows
            if where in written:
                # A posture that is open in one of the places may be known in another.
                own = np.flatnonzero(np.isnan(margin[at, rows]))
                into = own if isinstance(rows, slice) else rows[own]
            for held, found in zip((value, lower, upper, margin, violated), new, strict=True):
                held[at, into] = found[own, k]
        written.update(check.where)
    return Judgement(
        check=name,
        where=tuple(units),
        unit=tuple(units.values()),
        value=value.T,
        lower=lower.T,
        upper=upper.T,
        margin=margin.T,
        violated=violated.T,
    )
