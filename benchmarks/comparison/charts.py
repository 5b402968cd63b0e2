"""The report's charts, in the style of the other pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.comparison.measure import Chart
from posekit.viewer.plots import save
from posekit.viewer.plots.plot_file import LEFT_COLOUR, MUTED_COLOUR, RIGHT_COLOUR, drawing

LINE_COLOURS = (LEFT_COLOUR, RIGHT_COLOUR, MUTED_COLOUR)
LINE_MARKS = ("o", "s", "^")


def draw(chart: Chart, folder: Path, suffix: str = ".svg") -> str:
    """Draw a chart into a folder and return the file's name."""
    with drawing() as kind:
        rows = len(chart.bars)
        figure = kind(figsize=(5.6, 0.9 + 0.3 * rows if rows else 3.0), layout="constrained")
        axes = figure.subplots()
        _bars(axes, chart) if rows else _lines(axes, chart)
        axes.set_title(chart.title)
    name = f"benchmarks-{chart.name}{suffix}"
    save(figure, folder / name)
    return name


def _bars(axes: Any, chart: Chart) -> None:
    names, values = list(chart.bars), list(chart.bars.values())
    at = np.arange(len(names))[::-1]
    axes.barh(at, values, height=0.62, color=LEFT_COLOUR)
    axes.set_yticks(at, names)
    axes.set_xlabel(chart.y)
    if chart.log:
        axes.set_xscale("log")
    for place, value in zip(at, values, strict=True):
        axes.annotate(
            _short(value), (value, place), xytext=(3, 0), textcoords="offset points", va="center", fontsize=8
        )
    axes.margins(x=0.16)
    axes.grid(visible=True, axis="x")


def _lines(axes: Any, chart: Chart) -> None:
    for line, colour, mark in zip(chart.lines, LINE_COLOURS, LINE_MARKS, strict=False):
        axes.plot(line.x, line.y, color=colour, marker=mark, ms=4, lw=1.3, label=line.name)
    axes.set_xlabel(chart.x)
    axes.set_ylabel(chart.y)
    if chart.log in ("y", "both"):
        axes.set_yscale("log")
    if chart.log == "both":
        axes.set_xscale("log")
    axes.grid(visible=True)
    axes.legend()


def _short(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
