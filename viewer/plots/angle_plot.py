"""Joint angles over time: a panel an angle, with the limits that it was judged by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import Postures, Result, View
from posekit.geometry import Array
from posekit.viewer.plots.angle_tracks import AngleTrack, angle_tracks, chosen_angles
from posekit.viewer.plots.panels import panels
from posekit.viewer.plots.plot_file import LEFT_COLOUR, MUTED_COLOUR, RIGHT_COLOUR, TRUNK_COLOUR, drawing
from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown, subject_of
from posekit.viewer.scene.likeliest import opening_frames

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


def plot_angles(
    given: Result | Postures | HeldPostures | View,
    view: View | None = None,
    *,
    angles: str = "all",
    drawn: Sequence[Shown] | None = None,
    frames: Sequence[int] | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    truth: Array | None = None,
    subject: DrawnSubject | None = None,
) -> Figure:
    """Draw joint angles over time.

    Parameters
    ----------
    given : Result, Postures, HeldPostures or View
        A result, or motion.
    view : View, optional
        What the result was recovered from: its truth is drawn, if it has one.
    angles : str
        ``all``, or some as ``knee,left_elbow.flexion``.
    drawn : sequence of Shown, optional
        Of each of the frames, what the line goes through; by default the likeliest path, or the likeliest posture.
    frames : sequence of int, optional
        Which; all if not given.
    limits : mapping of str to (float, float), optional
        Degrees, by angle; by default those that a result was judged by.
    truth : array (F, 14, 3), optional
        The true joints of all frames, in any frame, metres; by default the view's.
    subject : DrawnSubject, optional
        What `subject_of` gathers of the two, where that is done.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ViewerError
        Where matplotlib is missing, or there is nothing to draw.
    """
    names = chosen_angles(angles)
    subject = subject or subject_of(given, view)
    rows = list(range(len(subject.frames)) if frames is None else frames)
    every = [subject.frames[k] for k in rows]
    if drawn is None:
        drawn = opening_frames(subject, given, rows, moving=True, most=1)
    if truth is None and view is not None and np.isfinite(view.truth).any():
        truth = view.truth
    if limits is None:
        limits = judged_limits(given) or {}
    true = None if truth is None else truth[rows]
    tracks = angle_tracks(every, drawn, subject.figure, names, limits=limits, truth=true)
    if drawn and drawn[0].caption.startswith("likeliest path"):
        return plot_tracks(tracks, line="likeliest path")
    return plot_tracks(tracks, line="likeliest" if any(len(one) > 1 for one in every) else "angle")


def judged_limits(given: object) -> dict[str, tuple[float, float]] | None:
    """Return the ends of the ranges that a result was judged by, degrees; None of what is no result."""
    settings = given.settings if isinstance(given, Result) else {}
    found = settings.get("range_limits")
    if not isinstance(found, Mapping):
        return None
    return {str(name): (float(ends[0]), float(ends[1])) for name, ends in found.items()}


def plot_tracks(tracks: Sequence[AngleTrack], *, line: str = "likeliest") -> Figure:
    """Draw angles that were measured over time.

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
    figure.legend(
        handles=handles, fontsize="small", loc="outside upper center", ncols=min(len(handles), len(tracks), 4)
    )
