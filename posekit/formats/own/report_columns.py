"""The verdicts on any number of postures, in columns: what summaries, tables and CSV are made of."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.report_schema import VERDICT_NAMES, Verdict

Array = NDArray[np.float64]

PER_DEGREE: Final[Mapping[str, float]] = {"deg": 1.0, "m": 0.01}
"""What counts as one degree where margins of different units are compared: a centimetre, as at the end of a limb."""


NUMBER_COLUMNS: Final = (
    *("fk_distance", "worst_margin", "worst_value", "worst_bound"),
    *("margin", "value", "bound"),
)
"""The columns of `VerdictColumns` that are numbers with a unit: the first four a posture, the others a violation."""


def measured(value: float, unit: str, digits: int = 4) -> str:
    """Word a number and its unit: ``21.3 m/s``; a ratio, whose unit is 1, has none, and ``?`` is not known."""
    number = f"{value:.{digits}g}" if math.isfinite(value) else "?"
    return number if unit == "1" else f"{number} {unit}"


def known_number(value: float | None) -> float | None:
    """Return a number as files have it: None for what is not known or not finite."""
    return None if value is None or not math.isfinite(value) else float(value)


class ReportPlace(NamedTuple):
    """Where a check judges, and the unit of its numbers."""

    check: str
    where: str
    unit: str

    @property
    def name(self) -> str:
        """The place as it is printed: ``joint_range/right_knee``."""
        return f"{self.check}/{self.where}"


class PlaceValue(NamedTuple):
    """What was found at a place, the bound that it is nearest to, and how far inside it is (negative: outside)."""

    place: ReportPlace
    value: float
    bound: float
    margin: float


class VerdictRow(NamedTuple):
    """One posture: its verdict, the place with the least margin, its violations, and what is undecided."""

    posture: int
    verdict: Verdict
    fk_distance: float
    worst: PlaceValue | None
    violations: list[PlaceValue]
    undecided_by: list[str]


class CheckCount(NamedTuple):
    """What one check said about a file: postures rejected, undecided, violations by place, the worst and where."""

    rejected: int
    undecided: int
    places: dict[str, int]
    worst: tuple[int, PlaceValue] | None


@dataclass(frozen=True, kw_only=True, eq=False)
class VerdictColumns:
    """Verdicts on N postures with M violations.

    Parameters
    ----------
    places : sequence of ReportPlace
        Where checks judge.
    verdict : int array (N,)
        Index into `VERDICT_NAMES`.
    fk_distance : array (N,)
        Metres.
    worst_place, worst_margin : int array (N,), array (N,)
        The place with the least margin, -1 where nothing was decided, and that margin in its unit.
    worst_value, worst_bound : array (N,)
        What was found there, and the bound that it is nearest to.
    posture, place : int array (M,)
        Of each violation; postures in rising order.
    margin : array (M,)
        How far each violation is outside, in the place's unit; negative.
    value, bound : array (M,)
        What was found, and the bound that it is beyond; NaN where they are not known.
    silent : int array (N,)
        Bit 0: some joint is unknown; bit k + 1: the k-th check says nothing.
    checks : sequence of str
        The checks that were applied.
    """

    places: Sequence[ReportPlace]
    verdict: NDArray[np.int8]
    fk_distance: Array
    worst_place: NDArray[np.int32]
    worst_margin: Array
    worst_value: Array
    worst_bound: Array
    posture: NDArray[np.int64]
    place: NDArray[np.int32]
    margin: Array
    value: Array
    bound: Array
    silent: NDArray[np.int64]
    checks: Sequence[str] = ()

    def __len__(self) -> int:
        """Count the postures."""
        return len(self.verdict)

    @property
    def summary(self) -> dict[str, int]:
        """How many postures have each verdict."""
        counts = np.bincount(self.verdict, minlength=len(VERDICT_NAMES)).tolist()
        return dict(zip(VERDICT_NAMES, counts, strict=True))

    @property
    def letters(self) -> str:
        """The first letter of every verdict: ``vviu``."""
        letters = np.array([verdict[0] for verdict in VERDICT_NAMES])
        return "".join(letters[self.verdict].tolist())

    def rows(self, some: Sequence[int] | None = None) -> Iterator[VerdictRow]:
        """Go through the postures, or through some of them."""
        starts = np.searchsorted(self.posture, np.arange(len(self) + 1)).tolist()
        verdicts, distances = self.verdict.tolist(), self.fk_distance.tolist()
        places, where = self.worst_place.tolist(), self.place.tolist()
        least = np.stack([self.worst_value, self.worst_bound, self.worst_margin], axis=1).tolist()
        outside = np.stack([self.value, self.bound, self.margin], axis=1).tolist()
        silent = (self.silent != 0).tolist()
        for k in range(len(self)) if some is None else some:
            found = range(starts[k], starts[k + 1])
            yield VerdictRow(
                posture=k,
                verdict=VERDICT_NAMES[verdicts[k]],
                fk_distance=distances[k],
                worst=None if places[k] < 0 else PlaceValue(self.places[places[k]], *least[k]),
                violations=[PlaceValue(self.places[where[i]], *outside[i]) for i in found],
                undecided_by=self.silent_checks(k) if silent[k] else [],
            )

    def silent_checks(self, posture: int) -> list[str]:
        """List what is not decided about a posture: ``joints`` that are unknown, and checks that say nothing."""
        bits = int(self.silent[posture])
        return [name for k, name in enumerate(("joints", *self.checks)) if bits >> k & 1]

    def by_check(self) -> dict[str, CheckCount]:
        """Count for each check what it rejected, where, and which violation was the worst."""
        of_check = np.array([place.check for place in self.places])[self.place] if len(self.place) else None
        counts = {}
        for k, check in enumerate(self.checks):
            mine = np.flatnonzero(of_check == check) if of_check is not None else np.zeros(0, dtype=np.intp)
            most = Counter(self.place[mine].tolist()).most_common()
            worst = None
            if len(mine):
                units = np.array([PER_DEGREE.get(place.unit, 1.0) for place in self.places])
                at = int(mine[np.argmin(self.margin[mine] / units[self.place[mine]])])
                found = (float(numbers[at]) for numbers in (self.value, self.bound, self.margin))
                worst = int(self.posture[at]), PlaceValue(self.places[int(self.place[at])], *found)
            counts[check] = CheckCount(
                rejected=len(np.unique(self.posture[mine])),
                undecided=int(np.count_nonzero(self.silent >> (k + 1) & 1)),
                places={self.places[place].where: count for place, count in most},
                worst=worst,
            )
        return counts


def joined(
    parts: Sequence[VerdictColumns], places: Sequence[ReportPlace], checks: Sequence[str]
) -> VerdictColumns:
    """Put the columns of a file's batches together; postures are counted through."""
    firsts = np.cumsum([0, *(len(part) for part in parts)])
    empty: dict[str, NDArray[np.generic]] = {
        "verdict": np.zeros(0, dtype=np.int8),
        "worst_place": np.zeros(0, dtype=np.int32),
        "place": np.zeros(0, dtype=np.int32),
        **{name: np.zeros(0) for name in NUMBER_COLUMNS},
        "silent": np.zeros(0, dtype=np.int64),
    }
    arrays = {
        name: np.concatenate([none, *(getattr(part, name) for part in parts)]) for name, none in empty.items()
    }
    shifted = [part.posture + first for part, first in zip(parts, firsts[:-1].tolist(), strict=True)]
    return VerdictColumns(
        places=tuple(places),
        posture=np.concatenate([np.zeros(0, dtype=np.int64), *shifted]),
        checks=tuple(checks),
        **arrays,
    )
