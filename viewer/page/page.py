"""One standalone page a result: turn the scene, choose a survivor, move through the frames, read the reasons."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import numpy as np

from posekit.formats.held_postures import HeldPostures
from posekit.formats.own.postures import Postures
from posekit.formats.own.result import Result
from posekit.formats.own.view import View
from posekit.safe_io.writing import write_text
from posekit.viewer.page.data import page_data
from posekit.viewer.scene.eye import Eye
from posekit.viewer.scene.scene import Scene
from posekit.viewer.standalone import script_json, standalone_page

START_EYE = Eye(position=np.array([-2.6, -3.0, 1.7]), target=np.array([0.0, 0.0, 0.85]))
"""Until the page's own script has measured the postures."""

PAGE_SCRIPTS = ("lift.js", "panel.js", "scale.js")
"""In the order that they need each other; ``scene.js`` runs after them."""


def page_html(
    given: Result | Postures | HeldPostures,
    view: View | None = None,
    *,
    title: str = "posekit",
    frames: Sequence[int] | None = None,
) -> str:
    """Make the page, as text; see `write_page`."""
    data = page_data(given, view, title=title, frames=frames)
    scripts = "\n".join(_file(name) for name in PAGE_SCRIPTS)
    panel = f"<script>\nconst DATA = {script_json(data)};\n{scripts}\npage.chooseFrame(0);\n</script>"
    return standalone_page(
        Scene(),
        eye=START_EYE,
        title=f"{title} - posekit" if title != "posekit" else title,
        style=_file("page.css"),
        body=f"{_file('page.html')}\n{panel}",
        script=_file("scene.js"),
    )


def write_page(
    path: str | Path,
    given: Result | Postures | HeldPostures,
    view: View | None = None,
    *,
    title: str = "",
    frames: Sequence[int] | None = None,
) -> None:
    """Write the interactive page of a result: one HTML file that loads nothing, about 1 MB and the postures.

    Parameters
    ----------
    path : path
        The HTML file.
    given : Result, Postures or HeldPostures
        Postures are shown as the survivors of a single frame, or of their frames.
    view : View, optional
        What the result was recovered from: the page then shows the image too and, where it is known, the truth.
    title : str
        Shown on top; by default the file's name.
    frames : sequence of int, optional
        Which frames, from 0; all by default.

    Raises
    ------
    ViewerError
        Where there is no posture at all, too many for one page, or the view has other frames.
    InputError
        Where the file cannot be written.
    """
    text = page_html(given, view, title=title or Path(path).stem, frames=frames)
    write_text(path, [text])


def _file(name: str) -> str:
    return (resources.files("posekit.viewer.page") / name).read_text(encoding="utf-8")
