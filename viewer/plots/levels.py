"""Survivors per level of the interpretation tree (Lee & Chen 1985, Tables 3 and 4) as a chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.errors import ViewerError
from posekit.formats.own.result import ResultFrame
from posekit.viewer.plots.panels import panels
from posekit.viewer.plots.plot_file import LEFT_COLOUR, MUTED_COLOUR, RIGHT_COLOUR, drawing
from posekit.viewer.plots.tree_nodes import scale_count

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STAGE_STYLES: Final = {
    "physical": ("physical constraints", LEFT_COLOUR, "o"),
    "motion": ("and the motion model", RIGHT_COLOUR, "D"),
}


def plot_levels(
    frames: Sequence[ResultFrame],
    *,
    printed: Mapping[str, Sequence[Sequence[int]]] | None = None,
    titles: Sequence[str] | None = None,
) -> Figure:
    """Draw how many branches are alive at each level, a panel a frame, on a scale that doubles.

    Parameters
    ----------
    frames : sequence of ResultFrame
        Their ``levels``: 14 joints from the top, survivors after the physical checks and after the motion
        model too. Where no motion model was asked both are equal, and one line is drawn.
    printed : mapping, optional
        Numbers to compare with, as the paper prints them: ``physical`` and ``motion``, each one row of 14 a
        frame; drawn as hollow marks.
    titles : sequence of str, optional
        One a frame; its time by default.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ViewerError
        Where matplotlib is missing, there are no frames or too many, or the printed numbers do not fit.
    """
    _check(frames, printed or {}, titles)
    names = titles if titles is not None else [f"{frame.time:.3g} s" for frame in frames]
    with drawing() as kind:
        figure, axes = panels(
            kind, len(frames), columns=5, size=(2.5, 3.3), what="frames", sharey=True, extra=0.8
        )
        largest = 1
        stages = [stage for stage in STAGE_STYLES if stage == "physical" or _has_motion(frames)]
        for index, (panel, frame, name) in enumerate(zip(axes, frames, names, strict=True)):
            rows = {stage: np.asarray(frame.levels[stage]) for stage in stages}
            print_rows = {stage: np.asarray((printed or {})[stage][index]) for stage in printed or {}}
            largest = max(
                largest, *(int(row.max(initial=1)) for row in (*rows.values(), *print_rows.values()))
            )
            _draw(panel, rows, print_rows, trees=scale_count(frame))
            panel.set_title(name)
            panel.set_yticks(range(len(frame.levels["joint"])), [_label(j) for j in frame.levels["joint"]])
        axes[0].invert_yaxis()
        for panel in axes:
            _scale(panel, largest)
        figure.supxlabel("surviving branches", fontsize=9)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 3))
    return figure


def _draw(
    panel: Axes, rows: Mapping[str, np.ndarray], print_rows: Mapping[str, np.ndarray], *, trees: int
) -> None:
    for stage, counts in rows.items():
        label, colour, marker = STAGE_STYLES[stage]
        levels = np.arange(len(counts))
        alive = counts > 0
        panel.plot(
            np.where(alive, counts, np.nan), levels, color=colour, marker=marker, markersize=4.5,
            linewidth=1.2, label=label, gid=stage,
        )  # fmt: skip
        for level in np.flatnonzero(alive):
            # The physical number stands to the right of its mark, the smaller one of the motion model left.
            first = stage == "physical"
            if not first and counts[level] == rows["physical"][level]:
                continue
            panel.annotate(
                str(int(counts[level])),
                (counts[level], level),
                xytext=(6 if first else -6, 0),
                textcoords="offset points",
                ha="left" if first else "right",
                va="center",
                fontsize=7,
                color=colour,
            )
    for stage, counts in print_rows.items():
        label, colour, marker = STAGE_STYLES[stage]
        panel.plot(
            counts, np.arange(len(counts)), linestyle="none", marker=marker, markersize=8,
            markerfacecolor="none", markeredgecolor=colour, markeredgewidth=0.7,
            label=f"printed: {label}", gid=f"printed {stage}",
        )  # fmt: skip
    depth = len(next(iter(rows.values())))
    panel.plot(
        trees * 2.0 ** np.arange(depth), np.arange(depth), color=MUTED_COLOUR, linestyle=(0, (1, 2)), linewidth=0.9,
        label="if nothing were pruned", gid="full tree",
    )  # fmt: skip


def _scale(panel: Axes, largest: int) -> None:
    """Make the scale double from 1 up to the largest count; the full tree leaves it at the right."""
    top = int(np.ceil(np.log2(largest)))
    panel.set_xscale("log", base=2)
    panel.set_xlim(0.6, 2.0 ** (top + 1.3))
    step = 1 if top <= 6 else 2
    ticks = [2**power for power in range(0, top + 1, step)]
    panel.set_xticks(ticks, [str(tick) for tick in ticks])
    panel.minorticks_off()
    panel.grid(axis="both")
    panel.tick_params(length=0)


def _has_motion(frames: Sequence[ResultFrame]) -> bool:
    return any(tuple(frame.levels["motion"]) != tuple(frame.levels["physical"]) for frame in frames)


def _label(joint: str) -> str:
    return joint.replace("_", " ")


def _check(
    frames: Sequence[ResultFrame],
    printed: Mapping[str, Sequence[Sequence[int]]],
    titles: Sequence[str] | None,
) -> None:
    unknown = set(printed) - set(STAGE_STYLES)
    if unknown:
        raise ViewerError(f"printed: got {', '.join(sorted(unknown))}; expected physical, motion or both")
    for stage, rows in printed.items():
        depths = [len(frame.levels["joint"]) for frame in frames]
        if [len(row) for row in rows] != depths:
            raise ViewerError(
                f"printed[{stage!r}]: got rows of {[len(row) for row in rows]} numbers; expected {depths}, "
                "one a level, one row a frame"
            )
    if titles is not None and len(titles) != len(frames):
        raise ViewerError(f"titles: got {len(titles)}; expected {len(frames)}, one a frame")
