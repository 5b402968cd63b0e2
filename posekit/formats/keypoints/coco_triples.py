"""Key points as COCO spells them, and OpenPose too: one flat list ``[x, y, v] * K`` a person."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.safe_io import refusal, shown

NUMBER_TYPES = frozenset((int, float))


def triples(source: str | Path, lists: Sequence[Any], place: Callable[[int], str]) -> Array:
    """Turn flat lists of numbers into an array.

    Parameters
    ----------
    source : str or path
        The file, for errors.
    lists : sequence of D lists
        Each ``[x, y, v] * K`` as parsed from JSON, null for a number that is not known.
    place : callable
        Says where in the file the list of an index is.

    Returns
    -------
    array (D, K, 3)
        NaN for null; (0, 0, 3) where there is no list.

    Raises
    ------
    InputError
        Where an entry is no list of numbers, or their lengths are not equal, or no multiple of three.
    """
    if not lists:
        return np.empty((0, 0, 3))
    for index, values in enumerate(lists):
        if not isinstance(values, list) or not values or len(values) % 3:
            got = f"{len(values)} numbers" if isinstance(values, list) else shown(values)
            raise refusal(
                source, place(index), got, "a list [x, y, v, x, y, v, …]", "check how it was written"
            )
        if len(values) != len(lists[0]):
            expected = f"{len(lists[0]) // 3}, as in {place(0)}"
            remedy = "split the file by the kind of detector"
            raise refusal(source, place(index), f"{len(values) // 3} points", expected, remedy)
    kinds = set(map(type, chain.from_iterable(lists)))
    if not kinds <= NUMBER_TYPES | {type(None)}:
        raise _no_number(source, lists, place)
    if type(None) in kinds:
        flat = np.array([[np.nan if value is None else value for value in values] for values in lists], float)
    else:
        flat = np.fromiter(chain.from_iterable(lists), np.float64, len(lists) * len(lists[0]))
    return flat.reshape(len(lists), -1, 3)


def _no_number(source: str | Path, lists: Sequence[Any], place: Callable[[int], str]) -> InputError:
    index, column = next(
        (index, column)
        for index, values in enumerate(lists)
        for column, value in enumerate(values)
        if type(value) not in NUMBER_TYPES and value is not None
    )
    value = lists[index][column]
    got = "a list inside the list" if isinstance(value, list) else shown(value)
    remedy = "write the points as one flat list" if isinstance(value, list) else "correct it"
    return refusal(source, f"{place(index)}[{column}]", got, "a number", remedy)
