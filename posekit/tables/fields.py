"""Kinds of fields that several tables have."""

from __future__ import annotations

from typing import Annotated, Any, Final

from pydantic import AfterValidator, BeforeValidator, Field

from posekit.safe_io.refusal import shown
from posekit.tables.file_model import refuse

MAX_POINTS: Final = 1000
"""Names in a list of points."""


def _ascending(bounds: list[float]) -> list[float]:
    lower, upper = bounds
    if lower > upper:
        refuse("the lower one first", "swap them", got=f"[{lower:g}, {upper:g}]")
    return bounds


def _two_numbers(value: Any) -> Any:
    numbers = value if isinstance(value, list) else []
    if len(numbers) != 2 or not all(
        isinstance(one, int | float) and not isinstance(one, bool) for one in numbers
    ):
        refuse("[lower, upper], two numbers", "give two numbers", got=shown(value))
    return value


Bounds = Annotated[list[float], BeforeValidator(_two_numbers), AfterValidator(_ascending)]
"""A lower and an upper end."""


def _not_blank(name: str) -> str:
    if not name.strip():
        refuse("a name", "write one")
    return name


Name = Annotated[str, AfterValidator(_not_blank)]
Pair = Annotated[list[str], Field(min_length=2, max_length=2)]
"""The names of two points."""


def listed(value: Any) -> Any:
    """Take a single name for a list of one."""
    return [value] if isinstance(value, str) else value
