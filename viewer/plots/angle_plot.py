"""Joint angles over time: a panel an angle, with the limits that it was judged by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.viewer.plots.angle_tracks import AngleTrack
from posekit.viewer.plots.panels import panels
from posekit.viewer.plots.plot_file import LEFT_COLOUR, MUTED_COLOUR, RIGHT_COLOUR, TRUNK_COLOUR, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANEL_COLUMNS: Final = 4
MARKED_FRAMES: Final = 40
"""Frames up to which each is a point on the line, too."""

EVERY_OPACITY: Final = 0.16
HALF_OPACITY: Final = 0.34
LIMIT_MARGIN: Final = 12.0
"""Degrees beyond the limits that a panel shows at least."""


def plot_angles(tracks: Sequence[AngleTrack], *, line: str = "likeliest") -> Figure:
    """Draw angles over time.

    Parameters
    ----------
    tracks : sequence of AngleTrack
        1 to 64.
    line : str
        What the line goes through.

    Returns
    -------
    matplotlib.figure.Figure
        Of each panel: what lies outside the limits is grey, all survivors are a faint band, half of their probability
        a darker one, what is drawn is a line, and the truth is dashed; `get_gid` says which is which.

    Raises
    ------
    ViewerError
        Where matplotlib is missing, or there are no angles or too many.
    """
    with drawing() as kind:
        figure, axes = panels(
            kind, len(tracks), columns=PANEL_COLUMNS, size=(2.5, 1.45), what="angles", extra=0.8
        )
        for panel, track in zip(axes, tracks, strict=True):
            _draw(panel, track)
        seconds = bool((np.mod(tracks[0].time, 1) != 0).any())
        figure.supxlabel("seconds" if seconds else "frame", fontsize=9)
        figure.supylabel("degrees", fontsize=9)
        _key(figure, tracks, line)
    return figure


def _draw(panel: Axes, track: AngleTrack) -> None:
    side = track.name.split("_")[0]
    colour = {"right": RIGHT_COLOUR, "left": LEFT_COLOUR}.get(side, TRUNK_COLOUR)
    x = track.time
    ends = (x[0] - 0.5, x[0] + 0.5) if len(x) == 1 else (x[0], x[-1])
    panel.set_xlim(*ends)
    values = np.concatenate([track.value, track.least, track.most, track.truth, track.limits or ()])
    known = values[np.isfinite(values)]
    low, high = (known.min(), known.max()) if len(known) else (-1.0, 1.0)
    low, high = low - LIMIT_MARGIN, high + LIMIT_MARGIN
    panel.set_ylim(low, high)
    if track.limits is not None:
        for start, end in ((low, track.limits[0]), (track.limits[1], high)):
            panel.axhspan(start, end, color="#E9E9E9", linewidth=0, zorder=0, gid="outside")
        for limit in track.limits:
            panel.axhline(limit, color=MUTED_COLOUR, linewidth=0.6, zorder=1, gid="limit")
    for one, other, opacity, name in (
        (track.least, track.most, EVERY_OPACITY, "survivors"),
        (track.lower, track.upper, HALF_OPACITY, "half"),
    ):
        if len(x) == 1:
            panel.vlines(x, one, other, color=colour, alpha=opacity, linewidth=9, gid=name)
        else:
            panel.fill_between(x, one, other, color=colour, alpha=opacity, linewidth=0, gid=name)
    marker = "o" if len(x) <= MARKED_FRAMES else ""
    panel.plot(x, track.value, color=colour, linewidth=1.2, marker=marker, markersize=2, gid="line")
    if np.isfinite(track.truth).any():
        panel.plot(
            x, track.truth, color="black", linewidth=0.9, linestyle=(0, (3, 2)), marker="", gid="truth"
        )
        if len(x) == 1:
            panel.plot(x, track.truth, color="black", linestyle="none", marker="x", markersize=4, gid="truth")
    panel.set_title(track.name.replace("_", " ").replace(".", ", "))
    panel.grid(visible=True)


def _key(figure: Figure, tracks: Sequence[AngleTrack], line: str) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [Line2D([], [], color=TRUNK_COLOUR, linewidth=1.2, label=line)]
    if any(np.nanmax(np.append(track.most - track.least, 0.0)) > 0 for track in tracks):
        handles.append(Patch(color=TRUNK_COLOUR, alpha=EVERY_OPACITY, linewidth=0, label="all survivors"))
    if any(np.isfinite(track.lower).any() for track in tracks):
        handles.append(
            Patch(color=TRUNK_COLOUR, alpha=HALF_OPACITY, linewidth=0, label="half of their probability")
        )
    if any(np.isfinite(track.truth).any() for track in tracks):
        handles.append(Line2D([], [], color="black", linewidth=0.9, linestyle=(0, (3, 2)), label="truth"))
    if any(track.limits is not None for track in tracks):
        handles.append(Patch(color="#E9E9E9", label="outside the limits"))
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(handles), 2 + len(tracks)))
