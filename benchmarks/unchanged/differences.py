"""Where two canonical contents differ: what is discrete exactly, numbers within a tolerance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

EXACT_TOLERANCE = 1e-12
REFINED_TOLERANCE = 1e-9
ABSENT_VALUE = "(absent)"


@dataclass(frozen=True)
class Difference:
    """One place where two recordings differ."""

    place: str
    before: Any
    after: Any

    @property
    def distance(self) -> float:
        """How far two numbers are apart; infinite for anything else."""
        if _is_number(self.before) and _is_number(self.after):
            distance = abs(self.before - self.after)
            return math.inf if math.isnan(distance) else distance
        return math.inf


def differences(before: Any, after: Any, tolerance: float, place: str = "") -> Iterator[Difference]:
    """Yield where two contents differ.

    Parameters
    ----------
    before, after : object
        Dicts, lists, strings, numbers, truth values, None.
    tolerance : float
        How far floating-point numbers may be apart: absolute up to 1, relative beyond. Whole numbers, and everything
        else, are compared exactly.
    place : str
        Where they stand.

    Yields
    ------
    Difference
        In the order of `before`.
    """
    if isinstance(before, dict) and isinstance(after, dict):
        for key in [*before, *(key for key in after if key not in before)]:
            inner = f"{place}.{key}" if place and not place.endswith(":") else f"{place}{key}"
            if key in before and key in after:
                yield from differences(before[key], after[key], tolerance, inner)
            else:
                yield Difference(inner, before.get(key, ABSENT_VALUE), after.get(key, ABSENT_VALUE))
    elif isinstance(before, list) and isinstance(after, list):
        if len(before) != len(after):
            yield Difference(f"{place}.length", len(before), len(after))
        elif before != after:
            for k, (one, other) in enumerate(zip(before, after, strict=True)):
                yield from differences(one, other, tolerance, f"{place}[{k}]")
    elif not same(before, after, tolerance):
        yield Difference(place, before, after)


def same(before: Any, after: Any, tolerance: float) -> bool:
    """Whether two values are the same: NaN is NaN, and 2 is 2.0, but True is not 1."""
    if not (_is_number(before) and _is_number(after)):
        return type(before) is type(after) and bool(before == after)
    if before == after or (math.isnan(before) and math.isnan(after)):
        return True
    if isinstance(before, int) and isinstance(after, int):
        return False
    return bool(abs(before - after) <= tolerance * max(1.0, abs(before), abs(after)))


def numbers(tokens: list[str]) -> list[int | float | str]:
    """Return the words of a text with its numbers as numbers."""
    return [_number(token) for token in tokens]


def _number(token: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(token)
        except ValueError:
            continue
    return token


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
