"""`posekit reproduce taylor`: the paper's objects and its experiment, beside the print."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posekit.errors import ViewerError
from posekit.formats.markdown import table_lines
from posekit.papers.taylor_constrained import Constrained, constrained_lines
from posekit.papers.taylor_random_views import RandomViews, random_views_lines
from posekit.papers.taylor_rows import TaylorWork, find_taylor
from posekit.papers.taylor_study import Study
from posekit.recovery.taylor_figure.proportions import TABLE_1
from posekit.safe_io.writing import write_json, write_lines


def reproduce_taylor(folder: Path, *, pictures: bool = True, work: TaylorWork | None = None) -> list[str]:
    """Write ``taylor.md`` and ``taylor.json`` into a folder, the curves of Figs. 7b and 8b, and random views.

    Parameters
    ----------
    folder : Path
        Must exist.
    pictures : bool
        Whether to draw the curves too.
    work : TaylorWork, optional
        What was calculated before.

    Returns
    -------
    list of str
        The lines of the report.
    """
    objects, views, study = work or find_taylor()
    lines = [
        "# Taylor 2000, reproduced",
        "",
        "Everything here is synthetic: the paper's pictures and its OptoTrak data are not published. Eq. 3 is printed "
        "upside down; the bound used is s >= sqrt(du^2 + dv^2) / l.",
        "",
        "## Table 1: the relative lengths used",
        "",
        *table_lines(
            ("segment", "relative length"), [(name, f"{length:g}") for name, length in TABLE_1.items()]
        ),
        "## Figs. 7 and 8: constraints that fix the scale (section 3.3)",
        "",
        *constrained_lines(objects),
        *(_curves(folder, objects) if pictures else ()),
        "### From random directions",
        "",
        *random_views_lines(views),
        *(_scatter(folder, views) if pictures else ()),
        *(f"#{line}" if line.startswith("#") else line for line in study.lines()),
    ]
    write_lines(folder / "taylor.md", lines)
    write_json(
        folder / "taylor.json",
        {
            "table1": TABLE_1,
            "objects": [_plain(one) for one in objects],
            "random_views": [one.plain() for one in views],
            **_numbers(study),
        },
    )
    return lines


def _curves(folder: Path, objects: list[Constrained]) -> list[str]:
    """Draw the residual against the scale; return the lines that show it, or why they are missing."""
    from posekit.viewer.plots import plot_curve, save

    lines = []
    for one in objects:
        name = f"taylor.{one.figure.lower().replace('. ', '')}.png"
        try:
            save(
                plot_curve(
                    one.found.curve_s / one.s,
                    one.found.curve_residual,
                    minima=(one.found.s / one.s, one.found.residual),
                    title=f"An object like that of {one.figure}: {one.constraint}",
                ),
                folder / name,
            )
        except ViewerError as error:
            return [f"The curves of Figs. 7b and 8b are left out: {error}", ""]
        lines += [f"![The residual over the scale, as in the paper's {one.figure}b]({name})", ""]
    return lines


def _scatter(folder: Path, views: list[RandomViews]) -> list[str]:
    """Draw every view's error over what the noise allows."""
    from posekit.viewer.plots import plot_noise_bound, save

    studies = [
        (
            f"{one.title[0].upper()}{one.title[1:]}",
            one.constrained.printed,
            one.deviation,
            one.worst,
            one.solvable,
        )
        for one in views
    ]
    try:
        save(plot_noise_bound(studies), folder / "taylor.views.png")
    except ViewerError as error:
        return [f"The picture of the views is left out: {error}", ""]
    return ["![The largest error of each view over what the noise allows](taylor.views.png)", ""]


def _plain(one: Constrained) -> dict[str, object]:
    return {
        "figure": one.figure,
        "constraint": one.constraint,
        "printed_degrees": one.printed,
        "worst_degrees": one.worst.tolist(),
        "true_s": one.s,
        "minima": [
            {"s": s, "residual": r}
            for s, r in zip(one.found.s.tolist(), one.found.residual.tolist(), strict=True)
        ],
        "curve": {"s": one.found.curve_s.tolist(), "residual": one.found.curve_residual.tolist()},
    }


def _numbers(study: Study) -> dict[str, object]:
    """Return the study's figures: survivors of the 2048 flips, and section 3.2's errors."""
    exact = [
        {
            "checks": row.checks,
            "mean": float(np.mean(row.count)),
            "median": float(np.median(row.count)),
            "truth": float(np.mean(row.truth)),
        }
        for row in study.exact
    ]
    return {"pictures": study.pictures, "flips": 2048, "survivors_exact": exact}
