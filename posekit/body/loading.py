"""The built-in figure, and figures from files."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

from posekit.body.figure import Figure
from posekit.body.urdf import as_figure_error, parse, read_text
from posekit.robots.second_reader import compare_readers
from posekit.robots.untrusted import probe


@lru_cache(maxsize=1)
def _built_in() -> Figure:
    folder = resources.files("posekit.urdf")
    return Figure(
        urdf=(folder / "stick_figure.urdf").read_text(encoding="utf-8"),
        srdf=(folder / "stick_figure.srdf").read_text(encoding="utf-8"),
    )


def load_figure(path: str | Path | None = None, *, untrusted: bool = True) -> Figure:
    """Load the built-in figure (Lee & Chen 1985, Tables A.1 and A.2), or one that `Figure.write` wrote.

    Parameters
    ----------
    path : path, optional
        A URDF with the stick figure's joints; an SRDF of the same name beside it, or the built-in one.
    untrusted : bool
        Whether a file is loaded in a child process first, with limits on memory and time.

    Raises
    ------
    FigureError
        Where the file cannot be read or is not a stick figure; or how the child process ended.
    """
    if path is None:
        return _built_in()
    path = Path(path)
    beside = path.with_suffix(".srdf")
    urdf, srdf = read_text(path), read_text(beside) if beside.exists() else _built_in().srdf
    parse(urdf, str(path))  # what can be said without a child is said at once
    if untrusted:
        with as_figure_error():
            probe(_settings(urdf, path), compare=True)
    figure = Figure(urdf=urdf, srdf=srdf, source=str(path))
    with as_figure_error():
        compare_readers(figure.urdf, figure.model, figure.source)
    return figure


def _settings(urdf: str, path: Path) -> dict[str, Any]:
    """Describe the figure to the child as any robot; its SRDF is checked with the figure."""
    return {
        "urdf": urdf,
        "srdf": None,
        "name": path.stem,
        "source": str(path),
        "package_dirs": (),
        "free_flyer": True,
        "with_geometry": True,
        "with_visuals": False,
        "shared_srdf": False,
    }
