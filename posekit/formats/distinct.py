"""What formats ask of names alike: each comes once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from posekit.safe_io import refusal, shown


def check_distinct(source: str | Path, field: str, names: Sequence[str]) -> None:
    """Refuse names of which one comes twice.

    Parameters
    ----------
    source, field : str or path
        The file, and where in it the names are, for errors.
    names : sequence of str
        In the file's order.

    Raises
    ------
    InputError
        Where one comes twice: the first that does is named.
    """
    if len(set(names)) != len(names):
        twice = next(name for name, count in Counter(names).items() if count > 1)
        raise refusal(source, field, f"{shown(twice)} twice", "each once", "rename one of the two")
