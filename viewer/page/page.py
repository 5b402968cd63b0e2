"""One standalone page a result: turn the scene, choose a survivor, move through the frames, read the reasons."""

from __future__ import annotations

import html
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from posekit.formats.held_postures import HeldPostures
from posekit.formats.own.postures import Postures
from posekit.formats.own.result import Result
from posekit.formats.own.view import View
from posekit.safe_io.writing import write_text
from posekit.viewer.page.data import page_data
from posekit.viewer.page.findings_page import PageFindings
from posekit.viewer.standalone import CONTENT_POLICY, script_json

PAGE_SCRIPTS = (
    "unpack.js",
    "lift.js",
    "panel.js",
    "tables.js",
    "scale.js",
    "hand.js",
    "sight.js",
    "scene.js",
    "play.js",
)
"""In the order that they need each other."""


def page_html(
    given: Result | Postures | HeldPostures,
    view: View | None = None,
    *,
    title: str = "posekit",
    frames: Sequence[int] | None = None,
    findings: PageFindings | None = None,
    served: bool = False,
) -> str:
    """Make the page, as text; see `write_page`. Where it is `served`, its frames have pages beside it."""
    data = page_data(given, view, title=title, frames=frames, findings=findings) | {"served": served}
    return _file("page.html").format(
        policy=CONTENT_POLICY,
        title=html.escape(f"{title} - posekit" if title != "posekit" else title),
        style=_file("page.css"),
        data=script_json(data),
        scripts="\n".join(_file(name) for name in PAGE_SCRIPTS),
    )


def write_page(
    path: str | Path,
    given: Result | Postures | HeldPostures,
    view: View | None = None,
    *,
    title: str = "",
    frames: Sequence[int] | None = None,
    findings: PageFindings | None = None,
) -> None:
    """Write the interactive page of a result: one HTML file that loads nothing, 10 MB at most.

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
    findings : PageFindings, optional
        What checks found in postures that are no result's (`posekit.validation.page_findings`).

    Raises
    ------
    ViewerError
        Where there is no posture at all, or the view has other frames.
    InputError
        Where the file cannot be written.
    """
    text = page_html(given, view, title=title or Path(path).stem, frames=frames, findings=findings)
    write_text(path, [text])


def _file(name: str) -> str:
    return (resources.files("posekit.viewer.page") / name).read_text(encoding="utf-8")
