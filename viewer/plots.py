"""Plot joint angles over time with their limits, and the findings of a report on a timeline."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posekit.body import Figure as Body
from posekit.body import load_figure
from posekit.cameras import View
from posekit.errors import refusal
from posekit.geometry import Array
from posekit.motion import Motion
from posekit.recovery import Recovery
from posekit.skeleton import DOFS
from posekit.validators import Report, Validator
from posekit.validators.report import plural
from posekit.viewer.files import library
from posekit.viewer.subjects import configured, frame_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Vermilion and blue of Okabe & Ito's palette; other angles are `TRUNK`.
COLOURS: Final = {"right": "#D55E00", "left": "#0072B2"}
TRUNK, MUTED, GOOD = "#333333", "#767676", "#56B4E9"
UNDECIDED: Final[Any] = {"facecolor": "white", "edgecolor": "#9A9A9A", "hatch": "//////", "linewidth": 0}

STYLE: Final[Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": MUTED,
    "grid.color": "#E8E8E8",
    "legend.frameon": False,
    "svg.hashsalt": "posekit",  # the same drawing gives the same file
}
#: Number of frames below which the curve has a marker for each frame.
MARKED_FRAMES: Final = 40

#: Largest number of clips in a timeline, the worst first.
MOST_CLIPS: Final = 12


def plotted(
    source: Motion | Recovery | Report,
    kind: str,
    suffix: str,
    *,
    frame: int | tuple[int, int] | None = None,
    view: View | None = None,
) -> bytes:
    """Return a plot as a file.

    Parameters
    ----------
    source : Motion, Recovery or Report
        For a timeline, a motion is checked with the default checks.
    kind : {"angles", "timeline"}
    suffix : {".png", ".svg", ".pdf"}
    frame : int or (int, int), optional
        Frames to draw.
    view : View, optional
        View of a result. If the view has true joints, their angles are drawn too.

    Raises
    ------
    InputError
        If matplotlib is not installed, or there is nothing to draw.
    """
    mpl = library("matplotlib", "matplotlib", "pictures")
    with mpl.rc_context(STYLE):
        if kind == "timeline":
            if isinstance(source, Recovery):
                raise refusal("render", "timeline", "a result", "a report or a motion", "draw angles")
            figure = timeline(
                source if isinstance(source, Report) else Validator(source.robot or "figure").check(source)
            )
        elif isinstance(source, Report):
            raise refusal("render", "angles", "a report", "a motion or a result", "give the motion")
        else:
            figure = angles(source, frame, view)
        buffer = io.BytesIO()
        date: Any = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix, {})
        figure.savefig(buffer, format=suffix[1:], dpi=160, metadata=date, facecolor="white")
    return buffer.getvalue()


def angles(source: Motion | Recovery, frame: int | tuple[int, int] | None, view: View | None) -> Figure:
    """Plot joint angles over time, one panel per angle. Grey areas are beyond limits; a band covers all survivors."""
    from matplotlib.figure import Figure

    limits = np.degrees(np.array([load_figure().limits.lower, load_figure().limits.upper]))
    motion = source.motion("answer") if isinstance(source, Recovery) else source
    robot, q = configured(motion)
    rows = frame_rows(len(motion), frame, motion.source)
    names, values = list(DOFS), np.full((len(q), len(DOFS)), np.nan)
    known = np.isfinite(q).all(axis=1)
    if isinstance(robot, Body):
        values[known] = np.degrees(q[known][:, load_figure().angle_index])
    else:
        free = 7 if robot.free_flyer else 0
        names, values = list(robot.configuration_names)[free:], np.degrees(q[:, free:])
        limits = np.clip(np.degrees(np.array([robot.lower, robot.upper])[:, free:]), -360, 360)
    time = np.asarray(motion.time)[rows]
    seconds = bool(np.isfinite(time).all() and len(time) > 1 and (np.diff(time) > 0).all())
    x, columns = (time if seconds else rows), 4
    bands = _bands(source, rows) if isinstance(source, Recovery) else None
    true = None
    if view is not None and np.isfinite(view.truth).any():
        truth = load_figure().configurations(view.truth[rows]).q[:, load_figure().angle_index]
        true = np.degrees(truth)
    lines = -(-len(names) // columns)
    width, height = 2.6 * columns, 1.5 * lines + 0.6
    figure = Figure(figsize=(width, height))
    # Margins are set here because a layout engine takes seconds for so many panels.
    edges = {"left": 0.7 / width, "right": 1 - 0.1 / width, "bottom": 0.5 / height, "top": 1 - 0.3 / height}
    figure.subplots_adjust(**edges, hspace=0.35, wspace=0.22)
    panels = figure.subplots(lines, columns, sharex=True, squeeze=False).ravel()
    for k, (panel, name) in enumerate(zip(panels, names, strict=False)):
        colour = COLOURS.get(name.split("_")[0], TRUNK)
        low, high = limits[:, k]
        marker = {"marker": "o", "markersize": 2} if len(rows) < MARKED_FRAMES else {}
        panel.plot(x, values[rows, k], color=colour, linewidth=1.2, gid="angle", **marker)
        if bands is not None:
            band = {"color": colour, "alpha": 0.2, "linewidth": 0, "gid": "survivors"}
            panel.fill_between(x, *bands[:, :, k], **band)
        if true is not None:
            panel.plot(x, true[:, k], color="black", linewidth=0.9, linestyle="--", gid="truth")
        bottom, top = min(panel.get_ylim()[0], low - 8), max(panel.get_ylim()[1], high + 8)
        for ends in ((bottom, low), (high, top)):
            panel.axhspan(*ends, color="#E9E9E9", linewidth=0, zorder=0, gid="outside")
        panel.set_ylim(bottom, top)
        panel.set_title(name.replace("_", " ").replace(".", ", "))
        panel.grid(visible=True)
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    figure.supxlabel("seconds" if seconds else "frame", fontsize=9, y=0.1 / height)
    parts = ["degrees; grey: beyond the URDF's limits"]
    parts += ["band: all survivors"] * (bands is not None) + ["dashed: true posture"] * (true is not None)
    figure.supylabel("; ".join(parts), fontsize=9, x=0.1 / width)
    return figure


def _bands(recovery: Recovery, rows: Any) -> Array:
    """Return the minimum and maximum angle of the survivors of each frame (2, F, 22), degrees."""
    every = np.degrees(recovery.survivors.q[:, load_figure().angle_index])
    found = np.full((2, len(rows), every.shape[1]), np.nan)
    for k, row in enumerate(rows.tolist()):
        mine = every[recovery.rows(row)]
        if len(mine):
            found[:, k] = mine.min(axis=0), mine.max(axis=0)
    return found


def timeline(report: Report) -> Figure:
    """Plot the worst clips of a report: one row per check with findings, one bar per span of frames."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    clips = sorted(report.clips, key=lambda one: (one.decision == "keep", -one.severity))[:MOST_CLIPS]
    lanes = [list(dict.fromkeys(span.check for span in clip.spans)) or ["all checks"] for clip in clips]
    heights = [len(one) + 0.8 for one in lanes]
    figure = Figure(figsize=(7.5, 0.26 * sum(heights) + 0.6 * len(clips) + 0.5), layout="constrained")
    panels = figure.subplots(len(clips), 1, squeeze=False, height_ratios=heights).ravel()
    for panel, clip, checks in zip(panels, clips, lanes, strict=True):
        last = max([clip.frames, *(span.last + 1 for span in clip.spans)])
        panel.barh(range(len(checks)), last, height=0.8, color="#F1F4F6", zorder=0)
        for span in clip.spans:
            style: Any = dict(UNDECIDED if span.verdict == "undecided" else {"color": COLOURS["right"]})
            style |= {"left": span.first, "gid": f"{span.check}/{span.place}:{span.first}-{span.last}"}
            panel.barh(checks.index(span.check), span.last + 1 - span.first, height=0.8, **style)
        if clip.good is not None:
            first, end = clip.good[0], clip.good[1] + 1
            panel.barh(-0.62, end - first, left=first, height=0.16, color=GOOD, gid="good")
        panel.set_yticks(range(len(checks)), checks)
        panel.set(ylim=(len(checks) - 0.4, -0.9), xlim=(0, last))
        bad = clip.invalid + clip.undecided
        name = clip.title[-60:].replace("$", r"\$")
        title = f"{name}: {clip.decision}; {bad} of {plural(clip.frames, 'frame')} not valid"
        panel.set_title(title, loc="left")
    panels[-1].set_xlabel("frame")
    keys = [Patch(color=COLOURS["right"], label="invalid"), Patch(**UNDECIDED, label="undecided")]
    keys.append(Patch(color=GOOD, label="longest valid span"))
    figure.legend(handles=keys, loc="outside lower right", ncols=3)
    return figure
