"""The built-in figure, and figures from files."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from pathlib import Path

from posekit.figure.figure import Figure
from posekit.figure.urdf import as_figure_error, read_text
from posekit.robot.second_reader import compare_readers


@lru_cache(maxsize=1)
def _built_in() -> Figure:
    folder = resources.files("posekit.urdf")
    return Figure(
        urdf=(folder / "stick_figure.urdf").read_text(encoding="utf-8"),
        srdf=(folder / "stick_figure.srdf").read_text(encoding="utf-8"),
    )


def load_figure(path: str | Path | None = None) -> Figure:
    """Load the built-in figure (Lee & Chen 1985, Tables A.1 and A.2), or one that `Figure.write` wrote.

    Parameters
    ----------
    path : path, optional
        A URDF with the stick figure's joints; an SRDF of the same name beside it, or the built-in one.

    Raises
    ------
    FigureError
        Where the file cannot be read or is not a stick figure.
    """
    if path is None:
        return _built_in()
    path = Path(path)
    srdf = path.with_suffix(".srdf")
    figure = Figure(
        urdf=read_text(path),
        srdf=read_text(srdf) if srdf.exists() else _built_in().srdf,
        source=str(path),
    )
    with as_figure_error():
        compare_readers(figure.urdf, figure.model, figure.source)
    return figure
