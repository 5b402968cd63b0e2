"""What was missed against what the noise allows, a dot a view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.viewer.plots.panels import panels
from posekit.viewer.plots.plot_file import LEFT_COLOUR, RIGHT_COLOUR, drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN_DEGREES = (0.05, 90.0)
"""Degrees between which both axes go; what is outside stands on the edge."""


def plot_noise_bound(studies: Sequence[tuple[str, float, Array, Array, NDArray[np.bool_]]]) -> Figure:
    """Draw the largest error of each view over its deviation by the noise, a panel a study.

    Parameters
    ----------
    studies : sequence of (str, float, array (N,), array (N,), bool array (N,))
        Title, the bound that is drawn across, deviations and errors (degrees), and which views can be solved.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ViewerError
        Where matplotlib is missing or there is no study.
    """
    with drawing() as kind:
        figure, axes = panels(kind, len(studies), columns=2, size=(4.2, 3.9), what="studies", sharey=True)
        for panel, (title, bound, deviation, error, solvable) in zip(axes, studies, strict=True):
            x, y = (np.clip(values, *SHOWN_DEGREES) for values in (deviation, error))
            for some, colour, label in (
                (solvable, LEFT_COLOUR, "can be solved"),
                (~solvable, RIGHT_COLOUR, "left to chance by the noise"),
            ):
                share = f"{(error[some] <= bound).mean():.0%} within {bound:g}°" if some.any() else "none"
                panel.plot(
                    x[some],
                    y[some],
                    ".",
                    color=colour,
                    ms=3,
                    alpha=0.6,
                    label=f"{label}: {some.sum()}, {share}",
                )
            panel.plot(SHOWN_DEGREES, SHOWN_DEGREES, color="0.5", lw=0.8, ls=":")
            panel.axhline(bound, color="0.2", lw=1.0)
            panel.set(xscale="log", yscale="log", xlim=SHOWN_DEGREES, ylim=SHOWN_DEGREES, title=title)
            panel.grid(visible=True)
            panel.legend(loc="upper left", fontsize=8)
        figure.supxlabel("standard deviation of the worst angle by the noise (degrees)", fontsize=9)
        figure.supylabel("largest error of an angle (degrees)", fontsize=9)
    return figure
