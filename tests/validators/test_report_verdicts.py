"""Judgements that are made when they are looked at, and reports of made-up judgements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from posekit.validators import Judgement, Report
from posekit.validators.robot.deferred import Deferred


def judgement(
    margins: list[list[float]], check: str = "one", unit: str = "deg", **changes: object
) -> Judgement:
    margin = np.array(margins)
    made = Judgement(
        check=check,
        where=tuple(f"place{k}" for k in range(margin.shape[1])),
        unit=(unit,) * margin.shape[1],
        value=margin + 1.0,
        lower=np.ones(margin.shape),
        upper=np.full(margin.shape, np.inf),
        margin=margin,
        violated=margin < 0,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def report(*judgements: Judgement, complete: list[bool] | None = None) -> Report:
    count = len(judgements[0].margin)
    return Report(
        judgements=list(judgements),
        complete=np.array(complete or [True] * count),
        q=np.arange(float(count))[:, None],
        fk_distance=np.arange(float(count)),
    )


def test_what_waits_is_made_once_and_in_any_order() -> None:
    made: list[str] = []
    both = {name: judgement([[1.0], [-1.0], [2.0]], name) for name in ("one", "two")}

    def maker(name: str) -> object:
        def make(rows: object) -> Judgement:
            made.append(name)
            return both[name].of(rows)  # type: ignore[arg-type]

        return make

    waiting = Deferred([maker("one"), maker("two")], np.array([False, True, False]))  # type: ignore[list-item]
    assert len(waiting) == 2 and made == []
    assert waiting[1].check == "two" and waiting[-1] is waiting[1] and made == ["two"]
    assert [one.check for one in waiting] == ["one", "two"] and made == ["two", "one"]
    assert [one.check for one in waiting[:1]] == ["one"] and made == ["two", "one"]
    (first, second) = waiting.of(np.array([2, 0]))
    assert first.margin.ravel().tolist() == second.margin.ravel().tolist() == [2.0, 1.0]
    renamed = waiting.renamed(lambda one: replace(one, check=one.check.upper()))
    assert [one.check for one in renamed] == ["ONE", "TWO"] and renamed.rejected.tolist() == [
        False,
        True,
        False,
    ]
    joined = waiting.joined([judgement([[1.0], [1.0], [-1.0]], "three")])
    assert [one.check for one in joined] == ["one", "two", "three"]
    assert joined.rejected.tolist() == [False, True, True] and waiting.rejected.tolist() == [
        False,
        True,
        False,
    ]


def test_verdicts_of_a_report() -> None:
    nan = float("nan")
    one = judgement([[1.0, 2.0], [nan, nan], [-1.0, nan], [3.0, nan], [1.0, 1.0], [-1.0, 1.0]])
    found = report(one, complete=[True, True, True, True, False, False])
    assert found.verdicts == ["valid", "undecided", "invalid", "valid", "undecided", "invalid"]
    assert found.valid.tolist() == [True, False, False, True, False, False]
    assert found.undecided.tolist() == [False, True, False, False, True, False]
    assert repr(found) == "Report(6 postures, 2 valid, 2 invalid, 2 undecided)"
    over_time = report(judgement([[nan]]), judgement([[-1.0]], "motion", over_time=True))
    assert over_time.verdicts == ["invalid"]
    silent = report(judgement([[1.0]]), judgement([[nan]], "motion", over_time=True))
    assert silent.verdicts == ["valid"] and silent.worst.tolist() == [1.0]
    nothing = report(judgement([[1.0]]), judgement([[]], "limits"))
    assert nothing.verdicts == ["valid"] and nothing.worst.tolist() == [1.0]


def test_a_centimetre_counts_as_a_degree_in_the_worst_margin() -> None:
    nan = float("nan")
    found = report(judgement([[2.0], [0.5], [nan]]), judgement([[0.01], [0.02], [nan]], "two", "m"))
    np.testing.assert_allclose(found.worst, [1.0, 0.5, nan])


def test_some_of_a_report_and_a_report_without_some() -> None:
    found = report(judgement([[1.0], [-1.0], [2.0]]), complete=[True, True, False])
    part = found.of(slice(1, 3))
    assert part.verdicts == ["invalid", "undecided"] and part.fk_distance.tolist() == [1.0, 2.0]
    assert part.q.tolist() == [[1.0], [2.0]]
    left = found.without(np.array([False, True, False]))
    assert left.verdicts == ["valid", "undecided", "undecided"]
    assert np.isnan(left.q[1, 0]) and np.isnan(left.fk_distance[1]) and left.fk_distance[2] == 2.0
    assert np.isnan(left.judgements[0].value[1, 0]) and np.isnan(left.judgements[0].margin[1, 0])
    more = found.joined([judgement([[-1.0], [1.0], [1.0]], "two")])
    assert [one.check for one in more.judgements] == ["one", "two"]
    assert more.verdicts == ["invalid", "invalid", "undecided"]
    nothing = found.contacts()
    assert len(nothing) == 0 and nothing.names == () and nothing.violated.dtype == bool


def test_at_some_places_nothing_is_decided() -> None:
    one = judgement([[-1.0, 1.0], [-1.0, -2.0]])
    left = one.without(np.array([[True, False], [False, True]]))
    assert left.violated.tolist() == [[False, False], [True, False]]
    np.testing.assert_array_equal(np.isnan(left.margin), [[True, False], [False, True]])
    np.testing.assert_allclose(left.worst, [1.0, -1.0])
    assert one.of(slice(1, 2)).margin.tolist() == [[-1.0, -2.0]]
