"""Progress of long loops: `show_with` sets a progress bar; by default no progress is shown.

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
    """Show the progress of all later loops with a progress bar.

    Parameters
    ----------
    bar : callable or None
        Function that takes the items of a loop and a label, shows progress and yields the items, such as ``tqdm``. None
        shows no progress.
    """
    _shown[:] = [] if bar is None else [bar]


def watched(items: Iterable[Item], label: str) -> Iterator[Item]:
    """Yield the items of a loop and show its progress; the progress of inner loops is not shown."""
    if not _shown:
        yield from items
        return
    bar = _shown.pop()
    try:
        yield from bar(items, label)  # type: ignore[misc]
    finally:
        _shown[:] = [bar]
