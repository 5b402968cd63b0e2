"""What a batch of verdicts says, in the columns of a report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

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
    worst_place, worst_margin, least = np.full(n, -1, dtype=np.int32), np.full(n, np.nan), np.full(n, np.inf)
    found: list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]] = []
    silent = np.where(verdicts.complete, 0, 1).astype(np.int16)
    for judgement in judgements:
        if not judgement.where:
            continue  # a robot without limits is inside them
        says_nothing = np.isnan(judgement.worst) & ~judgement.violated.any(axis=1)
        if not judgement.over_time:
            silent[asked[says_nothing]] |= np.int16(2 << checks.index(judgement.check))
        if judgement.by_pairs and contacts is not None:
            rows, margin = contacts.posture, contacts.distance - lower_margin(judgement)
            index = _indices(places, [ReportPlace(judgement.check, name, "m") for name in contacts.names])[
                contacts.pair
            ]
            bad = contacts.violated
            found.append((rows[bad], index[bad], margin[bad]))
            _take_least(rows, index, margin, PER_DEGREE["m"], (worst_place, worst_margin, least))
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
        found.append((asked[some[at]], index[columns], judgement.margin[some[at], columns]))
        each = np.array([PER_DEGREE.get(unit, 1.0) for unit in judgement.unit])
        scaled = np.where(np.isnan(judgement.margin), np.inf, judgement.margin / each)
        if len(scaled):
            column, every = scaled.argmin(axis=1), np.arange(len(asked))
            _take_least(
                asked,
                index[column],
                judgement.margin[every, column],
                each[column],
                (worst_place, worst_margin, least),
            )
    rows = np.concatenate([part[0] for part in found] or [np.zeros(0, dtype=np.int64)])
    order = np.argsort(rows, kind="stable")
    verdict = np.where(verdicts.invalid, 1, np.where(verdicts.valid, 0, 2)).astype(np.int8)
    return VerdictColumns(
        places=tuple(places),
        verdict=verdict,
        fk_distance=verdicts.fk_distance,
        worst_place=worst_place,
        worst_margin=worst_margin,
        posture=rows[order].astype(np.int64),
        place=np.concatenate([part[1] for part in found] or [np.zeros(0)])[order].astype(np.int32),
        margin=np.concatenate([part[2] for part in found] or [np.zeros(0)])[order],
        silent=silent,
        checks=tuple(checks),
    )


def _take_least(
    rows: NDArray[Any],
    place: NDArray[Any],
    margin: NDArray[Any],
    per_degree: Any,
    worst: tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Take over, in place, the margins that are smaller than the smallest so far; a row may be there more than once."""
    worst_place, worst_margin, least = worst
    scaled = np.where(np.isnan(margin), np.inf, margin / per_degree)
    order = np.argsort(-scaled, kind="stable")  # the smallest last, so that it stays
    order = order[scaled[order] < least[rows[order]]]
    at = rows[order]
    worst_place[at], worst_margin[at], least[at] = place[order], margin[order], scaled[order]


def _indices(places: dict[ReportPlace, int], new: list[ReportPlace]) -> NDArray[np.int32]:
    return np.array([places.setdefault(place, len(places)) for place in new], dtype=np.int32)


def lower_margin(judgement: Judgement) -> float:
    """Return the contact margin that a collision check judged by, metres."""
    return float(judgement.lower.flat[0]) if judgement.lower.size else 0.0
