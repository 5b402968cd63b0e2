"""Panels side by side: how many fit into a row, one scale for all, no more than can be read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import ViewerError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_PANELS: Final = 64
"""Panels in one drawing."""

LEAST_INCHES: Final = 5.0
"""Width of a drawing at least: its key and the names of its axes are to be whole."""


def panels(
    kind: type[Figure],
    count: int,
    *,
    columns: int,
    size: tuple[float, float],
    what: str,
    sharey: bool = False,
    extra: float = 0.5,
) -> tuple[Figure, Sequence[Axes]]:
    """Make a figure of `count` panels of `size` inches, in rows of at most `columns`.

    Raises
    ------
    ViewerError
        Where there is nothing to draw, or more than can be read.
    """
    if not 0 < count <= MAX_PANELS:
        raise ViewerError(f"got {count} {what} to draw; expected 1 to {MAX_PANELS}; choose some of them")
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    figure = kind(
        figsize=(max(columns * size[0] + 0.4, LEAST_INCHES), rows * size[1] + extra), layout="constrained"
    )
    grid = figure.subplots(rows, columns, squeeze=False, sharey=sharey).ravel()
    for empty in grid[count:]:
        empty.remove()
    return figure, list(grid[:count])


def same_scale(axes: Sequence[Axes], points: NDArray[np.float64], *, margin: float = 0.06) -> float:
    """Give all panels the limits that hold all points (..., 2), one unit of length in both directions.

    Returns
    -------
    float
        The larger extent, in the points' unit.

    Raises
    ------
    ViewerError
        Where no point is known.
    """
    known = points.reshape(-1, 2)
    known = known[np.isfinite(known).all(axis=1)]
    if not len(known):
        raise ViewerError("no joint's position is known (all are NaN): there is nothing to draw")
    low, high = known.min(axis=0), known.max(axis=0)
    extent = float((high - low).max()) or 1.0
    room = margin * extent
    for panel in axes:
        panel.set_aspect("equal")
        panel.set_xlim(low[0] - room, high[0] + room)
        panel.set_ylim(low[1] - room, high[1] + room)
    return extent
