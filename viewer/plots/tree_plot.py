"""The interpretation tree itself, with what pruned each branch (Lee & Chen 1985, Fig. 4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from posekit.errors import ViewerError
from posekit.formats.own.result import ResultFrame
from posekit.viewer.plots.plot_file import MUTED_COLOUR, TRUNK_COLOUR, drawing
from posekit.viewer.plots.tree_nodes import Tip, pruned_branches, readable_levels, scale_count, tips

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CHECK_MARKERS: Final = {"rigid_parts": "s", "joint_range": "X", "collision": "^", "walking": "D"}
"""One shape a check; what is no check of these (no solution of the lift, for instance) is a P."""
REASON_COLOURS: Final = (
    "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B", "#7F3FBF", "#B8A500", "#2F4F4F",
)  # fmt: skip
"""Okabe & Ito's palette and four more, for the reasons that took most leaves; the rest is grey."""
OTHER_COLOUR: Final = "#AAAAAA"


def plot_tree(frame: ResultFrame, levels: int | None = None) -> Figure:
    """Draw a frame's tree from the neck down: surviving paths, and where and why the others end.

    Parameters
    ----------
    frame : ResultFrame
        With the detail on pruned branches (`posekit recover --explain`).
    levels : int, optional
        Levels to draw below the neck, 1 to 13; by default as many as can be read.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ViewerError
        Where matplotlib or the detail is missing, the tree is empty, or `levels` is out of range.
    """
    joints = frame.levels["joint"]
    depth = len(joints) - 1
    if levels is not None and not 1 <= levels <= depth:
        raise ViewerError(f"levels: got {levels}; expected 1 to {depth}")
    shown = levels or readable_levels(frame)
    ends = tips(frame, shown)
    if not ends:
        raise ViewerError("the tree is empty: nothing was grown in this frame; was its neck found?")
    lost = Counter[str]()
    for branch, reason in pruned_branches(frame):
        lost[reason] += 2 ** (depth - len(branch))
    colours = dict(zip((reason for reason, _ in lost.most_common()), REASON_COLOURS, strict=False))
    with drawing() as kind:
        width = min(max(8.5, 0.1 * len(ends) + 4.0), 22.0)
        figure = kind(figsize=(width, 1.6 + 0.42 * (shown + 1)), layout="constrained")
        axes = figure.subplots()
        _draw(axes, ends, shown, colours)
        axes.set_ylim(shown + 0.8, -0.6)
        axes.set_xlim(-1.0, len(ends))
        axes.set_yticks(range(shown + 1), [joint.replace("_", " ") for joint in joints[: shown + 1]])
        axes.set_xticks([])
        axes.tick_params(length=0)
        axes.spines[["left", "bottom"]].set_visible(False)
        axes.grid(axis="y")
        deeper = "" if shown == depth else f"; {depth - shown} levels below are not drawn"
        trees = scale_count(frame)
        leaves = f"{2**depth} leaves" if trees == 1 else f"{trees} scales of {2**depth} leaves each"
        axes.set_title(
            f"{frame.time:.3g} s: {leaves}, {len(frame.branches)} survive\n"
            f"left: nearer to the camera, right: farther{deeper}",
            loc="left",
        )
        _legend(figure, lost, colours)
    return figure


def place(ends: Sequence[Tip]) -> dict[str, tuple[float, int]]:
    """Give every node from the root its place (x, level): tips in a row, a parent over its children's mean.

    Parameters
    ----------
    ends : sequence of Tip
        In the order of their branches.
    """
    x: dict[str, float] = {tip.branch: float(index) for index, tip in enumerate(ends)}
    deepest = max(len(tip.branch) for tip in ends)
    for level in range(deepest, 0, -1):
        children: dict[str, list[float]] = {}
        for branch in [branch for branch in x if len(branch) == level]:
            children.setdefault(branch[:-1], []).append(x[branch])
        for parent, places in children.items():
            x[parent] = sum(places) / len(places)
    return {branch: (value, len(branch)) for branch, value in x.items()}


def _draw(axes: Axes, ends: Sequence[Tip], shown: int, colours: dict[str, str]) -> None:
    from matplotlib.collections import LineCollection

    places = place(ends)
    living = {tip.branch[:level] for tip in ends if tip.survivors for level in range(len(tip.branch) + 1)}
    fate = {tip.branch: colours.get(tip.reason, OTHER_COLOUR) for tip in ends if not tip.survivors}
    edges = [branch for branch in places if branch]
    for name, chosen, width in (
        ("pruned", [branch for branch in edges if branch not in living], 0.7),
        ("surviving", [branch for branch in edges if branch in living], 1.5),
    ):
        axes.add_collection(
            LineCollection(
                [(places[branch[:-1]], places[branch]) for branch in chosen],
                colors=[
                    TRUNK_COLOUR if name == "surviving" else fate.get(branch, MUTED_COLOUR)
                    for branch in chosen
                ],
                linewidths=width,
                gid=name,
            )
        )
    for tip in ends:
        x, level = places[tip.branch]
        if tip.survivors:
            axes.plot(x, level, "o", color=TRUNK_COLOUR, markersize=4, gid="survivor", zorder=3)
            if tip.survivors > 1:
                axes.annotate(
                    str(tip.survivors), (x, level), xytext=(0, -6), textcoords="offset points",
                    ha="center", va="top", fontsize=6.5,
                )  # fmt: skip
        elif tip.reason:
            axes.plot(
                x, level, marker_of(tip.reason), color=fate[tip.branch], markersize=4.2, gid="pruned",
                markeredgewidth=0, zorder=3,
            )  # fmt: skip
        else:
            axes.plot(x, level, "|", color=MUTED_COLOUR, markersize=5, gid="dies below", zorder=3)


def marker_of(reason: str) -> str:
    """Return the shape of a reason's check."""
    return CHECK_MARKERS.get(reason.split("/", maxsplit=1)[0], "P")


def words(reason: str) -> str:
    """Spell ``check/where`` for a reader."""
    check, _, where = reason.partition("/")
    spelled = check.replace("_", " ")
    return f"{spelled}: {where.replace('_', ' ').replace('.', ' ')}" if where else spelled


def _legend(figure: Figure, lost: Counter[str], colours: dict[str, str]) -> None:
    from matplotlib.lines import Line2D

    def entry(label: str, colour: str, marker: str) -> Line2D:
        return Line2D([], [], linestyle="none", color=colour, marker=marker, markersize=5, label=label)

    handles = [entry("survivor", TRUNK_COLOUR, "o")]
    handles += [
        entry(f"{words(reason)} ({lost[reason]})", colour, marker_of(reason))
        for reason, colour in colours.items()
    ]
    rest = [reason for reason in lost if reason not in colours]
    if rest:
        handles.append(entry(f"{len(rest)} other reasons ({sum(lost[r] for r in rest)})", OTHER_COLOUR, "P"))
    figure.legend(
        handles=handles, loc="outside right upper", title="pruned by (leaves lost)", alignment="left"
    )
