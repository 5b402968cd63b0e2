"""Base class of the public frozen dataclasses, with a short repr and read-only arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import fields
from typing import Any, Final, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import check_names
from posekit.geometry.vectors import Array

S = TypeVar("S", bound=np.generic)

MAX_REPR_CHARACTERS: Final = 240
MAX_TEXT_CHARACTERS: Final = 40
#: Longest sequence whose members a repr lists; a longer sequence is shown by its length.
MAX_LISTED: Final = 4


class Record:
    """Base class of dataclasses whose repr is one line; it shows shapes of arrays and omits None and empty fields.

    A subclass is decorated with ``@dataclass(frozen=True, kw_only=True, eq=False, repr=False)``.
    """

    def __new__(cls, *_: Any, **given: Any) -> Self:
        """Make an instance; for a name that is not a field, the error suggests the most similar field."""
        known = getattr(cls, "__dataclass_fields__", given)
        check_names(cls.__name__, given, known, kind="field", expected="a field of the class")
        return super().__new__(cls)

    def __repr__(self) -> str:
        """Return the class's name and its fields on one line."""
        return f"{type(self).__name__}({cut_text(', '.join(self._facts()), MAX_REPR_CHARACTERS)})"

    def _facts(self) -> list[str]:
        """List the fields of the repr as ``name=value``; a subclass may list others."""
        held = ((one.name, getattr(self, one.name)) for one in fields(self) if one.repr)  # type: ignore[arg-type]
        return [f"{name}={short(value)}" for name, value in held if not _is_empty(value)]

    def _set(self, name: str, value: Any) -> None:
        """Set a field of the frozen instance during its construction; an array is made read-only."""
        object.__setattr__(self, name, locked(value) if isinstance(value, np.ndarray) else value)

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields to pickle; fields that are computed on first access are computed now."""
        return {name: getattr(self, name) for name in vars(self)}


def locked(values: NDArray[S]) -> NDArray[S]:
    """Make an array read-only and return it."""
    values.flags.writeable = False
    return values


def read_only(values: ArrayLike) -> Array:
    """Return a read-only copy in double precision."""
    return locked(np.array(values, dtype=np.float64))


def short(value: Any) -> str:
    """Describe a value in a few characters.

    Examples
    --------
    >>> short(np.zeros((3, 2))), short([1.0] * 50), short("front"), short(0.1 + 0.2)
    ('(3, 2)', '[50 float]', "'front'", '0.3')
    """
    if isinstance(value, np.ndarray):
        return str(value.shape)
    if isinstance(value, str):
        return repr(cut_text(value, MAX_TEXT_CHARACTERS))
    if isinstance(value, float | np.floating):
        return f"{float(value):.4g}"
    if value is None or isinstance(value, bool | int | np.integer):
        return str(value)
    if isinstance(value, Mapping):
        return f"{{{len(value)} {'entry' if len(value) == 1 else 'entries'}}}"
    if isinstance(value, Sequence | Set):
        plain = all(isinstance(one, str | int | float) for one in value)
        if plain and len(value) <= MAX_LISTED:
            listed = ", ".join(short(one) for one in value)
            return f"({listed})" if isinstance(value, tuple) else f"[{listed}]"
        kinds = {type(one).__name__ for one in value}
        return f"[{len(value)} {kinds.pop() if len(kinds) == 1 else 'members'}]"
    return type(value).__name__


def cut_text(text: str, most: int) -> str:
    """Return a text on one line, cut to at most `most` characters."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str | tuple | list | Mapping | Set) and not value)
