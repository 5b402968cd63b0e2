"""A stick figure in the plane: trunk solid, left limbs dashed, right limbs wavy (Lee & Chen 1985, Fig. 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from posekit.skeleton import HIPS, JOINTS, SEGMENTS, SIDES, TORSO, segment_name
from posekit.viewer.plots.plot_file import LEFT_COLOUR, RIGHT_COLOUR, TRUNK_COLOUR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SIDE_COLOURS: Final = {"right": RIGHT_COLOUR, "left": LEFT_COLOUR, "trunk": TRUNK_COLOUR}
LEFT_DASHES: Final = (0, (3.2, 1.6))
N_WAVES: Final = 7
"""Waves along a right limb's segment, whatever its length: it is seen which one is foreshortened."""
WAVE_AMPLITUDE: Final = 0.012
"""Of the waves, as a part of the figure's extent."""


def side(segment: tuple[int, int]) -> str:
    """Return whose segment it is: ``right`` or ``left`` limb, or ``trunk`` where it is in a rigid part."""
    start, end = (JOINTS[joint] for joint in segment)
    if {start, end} <= set(TORSO) or {start, end} <= set(HIPS):
        return "trunk"
    return next(name for name in SIDES if end.startswith(name))


def draw_stick(
    axes: Axes, points: Array, *, extent: float, alpha: float = 1.0, width: float = 1.5, colour: str = ""
) -> None:
    """Draw one stick figure.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Where it is drawn.
    points : array (14, 2)
        Joints in the plane of the drawing; a segment with an unknown end (NaN) is left out.
    extent : float
        Height of what is drawn, in the same unit; the waves of the right limbs are a part of it.
    alpha : float
        Opacity.
    width : float
        Of the lines, in points.
    colour : str
        One colour for all segments, instead of one a side.

    Notes
    -----
    Each segment is a line of its own; its `get_gid` gives ``side:a-b``.
    """
    for segment in SEGMENTS:
        ends = points[list(segment)]
        if np.isnan(ends).any():
            continue
        whose = side(segment)
        line = wave(ends, WAVE_AMPLITUDE * extent) if whose == "right" else ends
        axes.plot(
            *line.T,
            color=colour or SIDE_COLOURS[whose],
            linewidth=width,
            linestyle=LEFT_DASHES if whose == "left" else "solid",
            alpha=alpha,
            solid_capstyle="round",
            solid_joinstyle="round",
            gid=f"{whose}:{segment_name(segment)}",
        )
    axes.plot(
        *points.T, linestyle="none", marker="o", markersize=2.2, color=TRUNK_COLOUR, alpha=alpha, gid="joints"
    )


def wave(ends: Array, amplitude: float) -> Array:
    """Turn a segment (2, 2) into a wavy line (K, 2) between the same ends."""
    along = ends[1] - ends[0]
    length = float(np.hypot(*along))
    if length == 0.0:
        return ends
    t = np.linspace(0.0, 1.0, 16 * N_WAVES + 1)
    across = np.array([-along[1], along[0]]) / length
    # A short segment, pointing at the viewer, would turn into a coil.
    height = min(amplitude, length / (3 * N_WAVES)) * np.sin(2 * np.pi * N_WAVES * t)
    line: Array = ends[0] + t[:, None] * along + height[:, None] * across
    line[-1] = ends[1]
    return line


def add_key(figure: Figure) -> None:
    """Say above the drawing which line is which side's."""
    from matplotlib.lines import Line2D

    # matplotlib's own sketch filter stands in for the wave: a legend's line has two points only.
    right = Line2D([], [], color=RIGHT_COLOUR, linewidth=1.5, label="right arm and leg (wavy)")
    right.set_sketch_params(scale=2.5, length=14.0, randomness=1.0)
    figure.legend(
        handles=[
            right,
            Line2D(
                [],
                [],
                color=LEFT_COLOUR,
                linewidth=1.5,
                linestyle=LEFT_DASHES,
                label="left arm and leg (dashed)",
            ),
            Line2D([], [], color=TRUNK_COLOUR, linewidth=1.5, label="torso and hips"),
        ],
        loc="outside upper center",
        ncols=3 if figure.get_figwidth() > 6 else 1,
        handlelength=3.2,
    )
