"""What a batch of verdicts says, in the columns of a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.report_columns import PER_DEGREE, ReportPlace, VerdictColumns
from posekit.validators import Judgement
from posekit.validators import Report as Verdicts
from posekit.validators.robot import Contacts, Deferred


def columns_of(
    verdicts: Verdicts,
    contacts: Contacts | None,
    places: dict[ReportPlace, int],
    checks: Sequence[str],
    *,
    margins: bool = True,
) -> VerdictColumns:
    """Put the findings of a batch in columns.

    Parameters
    ----------
    verdicts : posekit.validators.Report
        What the validator said of some postures.
    contacts : Contacts, optional
        The pairs of bodies, where the check of collisions names none.
    places : dict
        The places known so far and their numbers; new ones are added.
    checks : sequence of str
        The checks that are applied, as findings name them.
    margins : bool
        Whether the least margin of every posture is wanted, or only of those that are rejected, where the others'
        were not made yet; theirs is then NaN.
    """
    n = len(verdicts.complete)
    judgements, asked = verdicts.judgements, np.arange(n)
    if isinstance(judgements, Deferred) and not margins:
        asked = np.flatnonzero(judgements.rejected)
        judgements = judgements.of(asked)
    worst = _Worst.of(n)
    found: list[_Judged] = []
    silent = np.where(verdicts.complete, 0, 1).astype(np.int64)
    for judgement in judgements:
        if not judgement.where:
            continue  # a robot without limits is inside them
        if not judgement.over_time:
            says_nothing = np.isnan(judgement.worst) & ~judgement.violated.any(axis=1)
            silent[asked[says_nothing]] |= 2 << checks.index(judgement.check)
        if judgement.by_pairs and contacts is not None:
            index = _indices(places, [ReportPlace(judgement.check, name, "m") for name in contacts.names])
            lower = lower_margin(judgement)
            touching = _Judged(
                contacts.posture,
                index[contacts.pair],
                contacts.distance,
                np.full(len(contacts.distance), lower),
                contacts.distance - lower,
            )
            found.append(touching.of(contacts.violated))
            worst.take(touching, PER_DEGREE["m"])
            continue
        index = _indices(
            places,
            [
                ReportPlace(judgement.check, where, unit)
                for where, unit in zip(judgement.where, judgement.unit, strict=True)
            ],
        )
        some = np.flatnonzero(judgement.violated.any(axis=1))
        at, columns = np.nonzero(judgement.violated[some])
        found.append(_judged_at(judgement, asked, index, some[at], columns))
        each = np.array([PER_DEGREE.get(unit, 1.0) for unit in judgement.unit])
        every = np.arange(len(asked)) if margins else some
        scaled = judgement.margin[every] / each
        scaled[np.isnan(scaled)] = np.inf
        if len(scaled):
            column = scaled.argmin(axis=1)
            worst.take(_judged_at(judgement, asked, index, every, column), each[column])
    outside = _Judged(*(np.concatenate(parts) for parts in zip(*found, strict=True))) if found else _NONE
    outside = outside.of(np.argsort(outside.posture, kind="stable"))
    verdict = np.where(verdicts.invalid, 1, np.where(verdicts.valid, 0, 2)).astype(np.int8)
    return VerdictColumns(
        places=tuple(places),
        verdict=verdict,
        fk_distance=verdicts.fk_distance,
        worst_place=worst.place,
        worst_margin=worst.margin,
        worst_value=worst.value,
        worst_bound=worst.bound,
        posture=outside.posture.astype(np.int64),
        place=outside.place.astype(np.int32),
        margin=outside.margin,
        value=outside.value,
        bound=outside.bound,
        silent=silent,
        checks=tuple(checks),
    )


def in_order(columns: VerdictColumns, parts: Sequence[NDArray[np.intp]]) -> VerdictColumns:
    """Put the columns of a file's parts, one after the other, in the order of the file.

    Parameters
    ----------
    columns : VerdictColumns
        Of the parts.
    parts : sequence of int array
        Which postures of the file each part has.
    """
    rows = np.concatenate([np.zeros(0, dtype=np.intp), *parts])
    if (np.diff(rows) == 1).all():
        return columns
    place, posture = np.argsort(rows), rows[columns.posture]
    order = np.argsort(posture, kind="stable")
    each = ("verdict", "fk_distance", "worst_place", "worst_margin", "worst_value", "worst_bound", "silent")
    return replace(
        columns,
        posture=posture[order],
        **{name: getattr(columns, name)[place] for name in each},
        **{name: getattr(columns, name)[order] for name in ("place", "margin", "value", "bound")},
    )


class _Judged(NamedTuple):
    """Values that were judged, M of them: of which posture, at which place, with the bound each is nearest to."""

    posture: NDArray[Any]
    place: NDArray[Any]
    value: NDArray[np.float64]
    bound: NDArray[np.float64]
    margin: NDArray[np.float64]

    def of(self, rows: NDArray[Any]) -> _Judged:
        """Return some of them."""
        return _Judged(*(column[rows] for column in self))


_NONE: Final = _Judged(*(np.zeros(0) for _ in _Judged._fields))


def _judged_at(
    judgement: Judgement,
    asked: NDArray[np.intp],
    index: NDArray[np.int32],
    rows: NDArray[np.intp],
    columns: NDArray[np.intp],
) -> _Judged:
    """Pick values out of a judgement about the postures `asked`, whose places have these indices."""
    value, lower, upper = (getattr(judgement, name)[rows, columns] for name in ("value", "lower", "upper"))
    with np.errstate(invalid="ignore"):  # a bound that is not there is infinite
        bound = np.where(value - lower <= upper - value, lower, upper)
    return _Judged(asked[rows], index[columns], value, bound, judgement.margin[rows, columns])


class _Worst(NamedTuple):
    """Of N postures the place with the least margin so far, -1 where there is none."""

    place: NDArray[np.int32]
    value: NDArray[np.float64]
    bound: NDArray[np.float64]
    margin: NDArray[np.float64]
    least: NDArray[np.float64]

    @classmethod
    def of(cls, count: int) -> _Worst:
        """Begin, with nothing known of any posture."""
        value, bound, margin = (np.full(count, np.nan) for _ in range(3))
        return cls(np.full(count, -1, dtype=np.int32), value, bound, margin, np.full(count, np.inf))

    def take(self, judged: _Judged, per_degree: Any) -> None:
        """Take over, in place, the margins smaller than the smallest so far; a row may be there more than once."""
        scaled = np.where(np.isnan(judged.margin), np.inf, judged.margin / per_degree)
        order = np.argsort(-scaled, kind="stable")  # the smallest last, so that it stays
        order = order[scaled[order] < self.least[judged.posture[order]]]
        at = judged.posture[order]
        self.least[at] = scaled[order]
        for name in ("place", "value", "bound", "margin"):
            getattr(self, name)[at] = getattr(judged, name)[order]


def _indices(places: dict[ReportPlace, int], new: list[ReportPlace]) -> NDArray[np.int32]:
    return np.array([places.setdefault(place, len(places)) for place in new], dtype=np.int32)


def lower_margin(judgement: Judgement) -> float:
    """Return the contact margin that a collision check judged by, metres."""
    return float(judgement.lower.flat[0]) if judgement.lower.size else 0.0
