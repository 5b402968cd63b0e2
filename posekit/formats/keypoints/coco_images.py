"""COCO's pictures: the list of images, and which of them a detection belongs to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from posekit.geometry import Array
from posekit.safe_io import refusal, shown


@dataclass(frozen=True, kw_only=True)
class Images:
    """Pictures in the file's order.

    Parameters
    ----------
    names : tuple of str (F,)
        Their files' names where each has one of its own, else their ids.
    size : array (F, 2)
        Width and height, pixels; NaN where not given.
    index : dict
        The place of each id.
    """

    names: tuple[str, ...]
    size: Array
    index: dict[int | str, int]


def images_of(source: Path, images: Any) -> Images:
    """Read the list ``images``.

    Raises
    ------
    InputError
        Where it is no list of objects with ids, an id comes twice, or a size is no number.
    """
    if not isinstance(images, list) or not all(isinstance(one, dict) for one in images):
        raise refusal(source, "images", shown(images), "a list of objects", "check how it was written")
    index: dict[int | str, int] = {}
    for place, one in enumerate(images):
        identity = one.get("id")
        if type(identity) not in (int, str):
            raise refusal(source, f"images[{place}].id", shown(identity), "a number")
        if identity in index:
            got = f"{shown(identity)} twice"
            raise refusal(source, f"images[{place}].id", got, "each id once", "remove one of them")
        index[identity] = place
    size = np.full((len(images), 2), np.nan)
    for place, one in enumerate(images):
        for column, side in enumerate(("width", "height")):
            value = one.get(side)
            if value is not None:
                if type(value) not in (int, float) or value <= 0:
                    raise refusal(source, f"images[{place}].{side}", shown(value), "pixels, above 0")
                size[place, column] = value
    names = [one.get("file_name") for one in images]
    if len(set(map(str, names))) != len(names) or not all(isinstance(name, str) and name for name in names):
        names = [str(one) for one in index]
    return Images(names=tuple(names), size=size, index=index)


def images_from(identities: Sequence[int | str]) -> Images:
    """Make the pictures of a file that lists none, from its detections' ids: ascending, numbers first."""
    present = set(identities)
    numbers = sorted(one for one in present if isinstance(one, int))
    ordered: list[int | str] = [*numbers, *sorted(one for one in present if isinstance(one, str))]
    return Images(
        names=tuple(map(str, ordered)),
        size=np.full((len(ordered), 2), np.nan),
        index={one: place for place, one in enumerate(ordered)},
    )
