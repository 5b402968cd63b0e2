"""The residual of constraints against the scale (Taylor 2000, Figs. 7b and 8b) as a chart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from posekit.errors import ViewerError
from posekit.geometry import Array
from posekit.viewer.plots.plot_file import LEFT_COLOUR, RIGHT_COLOUR, drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MIN_RESIDUAL_DRAWN = 1e-12
"""Residuals are drawn no lower: below is rounding."""

MAX_SCALE_RATIO = 3.0
"""How many times the least scale is drawn."""


def plot_curve(scale: Array, residual: Array, *, minima: tuple[Array, Array], title: str) -> Figure:
    """Draw a residual over the scale on a logarithmic axis, its local minima marked.

    Parameters
    ----------
    scale, residual : array (C,)
        The curve: the scale over the true one, or in pixels a unit, from the bound on.
    minima : tuple of array (M,)
        Scales and residuals of the local minima.
    title : str
        What the drawing is headed with.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ViewerError
        Where matplotlib is missing, or there is no curve.
    """
    if len(scale) == 0 or len(scale) != len(residual):
        raise ViewerError(
            f"a curve of {len(scale)} scales and {len(residual)} residuals; expected one of each"
        )
    near = scale <= MAX_SCALE_RATIO * scale.min()
    with drawing() as kind:
        figure = kind(figsize=(5.2, 3.2), layout="constrained")
        axes = figure.subplots()
        axes.plot(
            scale[near],
            np.maximum(residual[near], MIN_RESIDUAL_DRAWN),
            color=LEFT_COLOUR,
            lw=1.3,
            label="least over all flips",
        )
        inside = minima[0] <= MAX_SCALE_RATIO * scale.min()
        axes.plot(
            minima[0][inside],
            np.maximum(minima[1][inside], MIN_RESIDUAL_DRAWN),
            "o",
            color=RIGHT_COLOUR,
            ms=4.5,
            label="local minima, each of its own flips",
        )
        axes.set_yscale("log")
        axes.set_xlabel("scale s / true scale")
        axes.set_ylabel("residual")
        axes.set_title(title)
        axes.grid(visible=True)
        axes.legend()
    return figure
