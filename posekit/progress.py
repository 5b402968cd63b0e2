"""Progress of work that takes seconds: its loops are shown by whatever shows progress; nothing does by default.

>>> import posekit.progress
>>> from tqdm import tqdm  # doctest: +SKIP
>>> posekit.progress.show_with(tqdm)  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")

_shown: list[Callable[[Iterable[object], str], Iterable[object]]] = []


def show_with(bar: Callable[[Iterable[object], str], Iterable[object]] | None) -> None:
    """Show the progress of all work that follows.

    Parameters
    ----------
    bar : callable or None
        Takes the items of a loop and a label, and returns the items, as ``tqdm`` does. None shows nothing.
    """
    _shown[:] = [] if bar is None else [bar]


def watched(items: Iterable[Item], label: str) -> Iterator[Item]:
    """Go through the items of a loop and show how far it is; loops within it are not shown."""
    if not _shown:
        yield from items
        return
    bar = _shown.pop()
    try:
        yield from bar(items, label)  # type: ignore[misc]
    finally:
        _shown[:] = [bar]
