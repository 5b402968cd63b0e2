"""One line for every object that posekit returns: how much it holds, and not all of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

MAX_REPR: Final = 240
"""Characters of an object."""
MAX_TEXT: Final = 40
"""Characters of a text in it."""
MAX_LISTED: Final = 4
"""Members that are listed; of more, their number is said."""


class ShortRepr:
    """Print as one line: the name of the class, and what each of its fields holds.

    Arrays are their shape, long sequences the number of their members. What is None or empty is left out. A class that
    has more to say than its fields overrides `_facts`.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Sequence(ShortRepr):
    ...     points: np.ndarray
    ...     names: tuple[str, ...] = ()
    >>> Sequence(points=np.zeros((150, 14, 3)), names=("neck", "pelvis"))
    Sequence(points=(150, 14, 3), names=('neck', 'pelvis'))
    """

    def __init_subclass__(cls, **given: Any) -> None:
        """Give the class this way of printing: a dataclass makes none of its own where there is one."""
        super().__init_subclass__(**given)
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = ShortRepr.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        """Say what it holds, in a line of `MAX_REPR` characters at most."""
        return f"{type(self).__name__}({cut_text(', '.join(self._facts()), MAX_REPR)})"

    def _facts(self) -> list[str]:
        """List what is said of it."""
        if not is_dataclass(self):
            return []
        held = ((one.name, getattr(self, one.name)) for one in fields(self) if one.repr)
        return [f"{name}={short(value)}" for name, value in held if not _is_empty(value)]


def short(value: Any) -> str:
    """Say in a few words what a value is.

    Parameters
    ----------
    value : object
        Anything.

    Examples
    --------
    >>> short(np.zeros((3, 2))), short([1.0] * 50), short("front"), short(0.1 + 0.2)
    ('(3, 2)', '[50 float]', "'front'", '0.3')
    """
    if isinstance(value, np.ndarray):
        return str(value.shape)
    if isinstance(value, str):
        return repr(cut_text(value, MAX_TEXT))
    if isinstance(value, float | np.floating):
        return f"{float(value):.4g}"
    if value is None or isinstance(value, bool | int | np.integer):
        return str(value)
    if isinstance(value, Path):
        return repr(cut_text(str(value), MAX_TEXT))
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
    """Return a text in one line, cut to a number of characters.

    Parameters
    ----------
    text : str
        Any.
    most : int
        Characters.
    """
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str | tuple | list | Mapping | Set) and not value)
