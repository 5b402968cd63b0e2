"""Clips as timelines: a row a check, a column a frame, what is rejected and undecided."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from posekit.display.plural import plural
from posekit.errors import ViewerError
from posekit.formats.own.report_clips import ClipVerdict
from posekit.formats.own.report_frames import ClipName
from posekit.formats.own.report_table import worst_first
from posekit.safe_io import one_line
from posekit.safe_io.writing import make_folder, safe_stem
from posekit.viewer.plots.plot_file import FAINT_COLOUR, MUTED_COLOUR, RIGHT_COLOUR, drawing, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INVALID_COLOUR: Final = RIGHT_COLOUR
UNDECIDED_COLOUR: Final = "#9A9A9A"
GOOD_COLOUR: Final = "#56B4E9"
"""The longest good span: sky blue of Okabe & Ito's palette."""

MOST_TIMELINES: Final = 12
"""Clips in one picture, the worst first."""

MOST_TIMELINE_FILES: Final = 1000
"""Pictures in a folder, of the worst clips."""

WIDTH_INCHES: Final = 7.2
ROW_INCHES: Final = 0.24


def plot_timelines(clips: Sequence[ClipVerdict]) -> Figure:
    """Draw clips below each other, each with a row a check that does not let all of its frames pass.

    Parameters
    ----------
    clips : sequence of ClipVerdict
        One to twelve.

    Returns
    -------
    matplotlib.figure.Figure
        Spans are rectangles whose `get_gid` is ``check/place:first-last``.

    Raises
    ------
    ViewerError
        Where matplotlib is not installed, or there are none or too many.
    """
    if not 0 < len(clips) <= MOST_TIMELINES:
        raise ViewerError(
            f"got {len(clips)} clips to draw; expected 1 to {MOST_TIMELINES}; choose some of them"
        )
    rows = [max(len({span.check for span in clip.spans}), 1) for clip in clips]
    heights = [(count + 0.6) * ROW_INCHES for count in rows]
    with drawing() as kind:
        size = WIDTH_INCHES, sum(heights) + 0.62 * len(clips) + 0.4
        figure = kind(figsize=size, layout="constrained")
        axes = figure.subplots(len(clips), 1, squeeze=False, height_ratios=heights).ravel()
        for panel, clip in zip(axes, clips, strict=True):
            _draw(panel, clip)
        axes[-1].set_xlabel("frame")
        _legend(figure)
    return figure


def write_timelines(path: str | Path, clips: Sequence[ClipVerdict]) -> int:
    """Write timelines: into one picture the worst clips, or into a folder a PNG of each clip.

    Parameters
    ----------
    path : path
        A ``.png``, ``.svg`` or ``.pdf``; another name is a folder's.
    clips : sequence of ClipVerdict
        Of any number; the worst twelve are drawn, in a folder the worst 1000.

    Returns
    -------
    int
        How many were drawn.

    Raises
    ------
    ViewerError
        Where matplotlib is not installed, or there is no clip.
    InputError
        Where a file cannot be written.
    """
    bad = worst_first(clips)
    ordered = [*bad, *(clip for clip in clips if clip.verdict == "valid")]
    if Path(path).suffix:
        drawn = ordered[:MOST_TIMELINES]
        save(plot_timelines(drawn), path)
        return len(drawn)
    make_folder(path)
    drawn = ordered[:MOST_TIMELINE_FILES]
    for rank, clip in enumerate(drawn):
        save(plot_timelines([clip]), Path(path) / f"{rank:03}_{_file_name(clip)}.png")
    return len(drawn)


def _draw(panel: Axes, clip: ClipVerdict) -> None:
    checks = list(dict.fromkeys(span.check for span in clip.spans))
    lanes = max(len(checks), 1)
    last = max([clip.frames, *(span.last + 1 for span in clip.spans), *(end + 1 for end in clip.good)])
    for lane in range(lanes):
        panel.barh(lane, last, height=0.8, color="#F1F4F6", zorder=0)
    for span in clip.spans:
        undecided = span.verdict == "undecided"
        style: dict[str, Any] = (
            {"facecolor": "white", "edgecolor": UNDECIDED_COLOUR, "hatch": "//////", "linewidth": 0}
            if undecided
            else {"facecolor": INVALID_COLOUR, "edgecolor": INVALID_COLOUR, "linewidth": 0.8}
        )
        panel.barh(
            checks.index(span.check),
            span.last + 1 - span.first,
            left=span.first,
            height=0.8,
            gid=f"{span.name}:{span.first}-{span.last}",
            **style,
        )
    if clip.good:
        first, end = clip.good
        panel.barh(-0.62, end + 1 - first, left=first, height=0.16, color=GOOD_COLOUR, gid="good")
    panel.set_yticks(range(lanes), checks or ["all checks"])
    panel.set_ylim(lanes - 0.4, -0.8)
    panel.set_xlim(0, last)
    panel.tick_params(axis="y", length=0)
    panel.spines["left"].set_visible(False)
    panel.grid(axis="x", color=FAINT_COLOUR)
    name = one_line(ClipName(clip.file, clip.clip).name)
    shown = f"…{name[-59:]}" if len(name) > 60 else name
    said = f"{clip.verdict}, {clip.invalid + clip.undecided} of {plural(clip.frames, 'frame')} not valid"
    # A dollar sign would begin a formula.
    panel.set_title(f"{shown.replace('$', chr(92) + '$')}: {said}", loc="left")


def _legend(figure: Figure) -> None:
    from matplotlib.patches import Patch

    figure.legend(
        handles=[
            Patch(facecolor=INVALID_COLOUR, label="invalid"),
            Patch(
                facecolor="white", edgecolor=UNDECIDED_COLOUR, hatch="//////", linewidth=0, label="undecided"
            ),
            Patch(facecolor=GOOD_COLOUR, label="longest good span"),
        ],
        loc="outside upper right",
        ncols=3,
        labelcolor=MUTED_COLOUR,
    )


def _file_name(clip: ClipVerdict) -> str:
    """Name a clip's picture."""
    return safe_stem("_".join(filter(None, (Path(clip.file).stem, clip.clip))) or "clip")
