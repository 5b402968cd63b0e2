"""What suites of checks say about whole postures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.body.closed_form import Alike
from posekit.geometry import Array
from posekit.tree import Check


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
    return [
        _gathered(name, [check for check in checks if check.name == name], points)
        for name in dict.fromkeys(check.name for check in checks)
    ]


def _gathered(name: str, checks: Sequence[Check], points: Array) -> Judgement:
    """Ask the checks of one validator, each place of which has one column."""
    units: dict[str, str] = {}
    for check in checks:
        units |= dict.fromkeys(check.where, check.unit)
    column = {where: k for k, where in enumerate(units)}
    # A column lies in one piece: it is written, and mostly read, as a whole.
    value, lower, upper, margin = np.empty((4, len(units), len(points)))
    violated = np.empty((len(units), len(points)), dtype=np.bool_)
    written: set[str] = set()
    for check in checks:
        findings = check.judge(points[:, list(check.points)])
        shape = findings.value.shape
        new = (
            findings.value,
            np.broadcast_to(findings.lower, shape),
            np.broadcast_to(findings.upper, shape),
            findings.margin,
            findings.violated,
        )
        for k, where in enumerate(check.where):
            known: Any = ~np.isnan(new[3][:, k]) if where in written else True
            for held, found in zip((value, lower, upper, margin, violated), new, strict=True):
                np.copyto(held[column[where]], found[:, k], where=known)
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
