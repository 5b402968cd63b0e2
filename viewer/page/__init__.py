"""Write interactive pages of results, motions and reports: single HTML files that work offline."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Final

from posekit.files import write_bytes
from posekit.viewer.page.data import page_data

#: Scripts of a page; each script uses the scripts before it.
SCRIPTS: Final = ("sight.js", "panel.js", "tables.js", "scene.js", "play.js")

#: Content security policy: the page loads no other files.
POLICY: Final = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"


def write_page(
    source: Any,
    path: Path,
    *,
    view: Any = None,
    frame: int | tuple[int, int] | None = None,
    urdf: str = "",
) -> None:
    """Write the page of a result, a motion, postures or a report.

    Parameters
    ----------
    source : Recovery, Motion or Report
        A motion is checked with the default checks, and its page shows the findings.
    path : path
        HTML file to write.
    view : View, Motion or sequence of Motion, optional
        View of a result; or the motions of a report, in the same order.
    frame : int or (int, int), optional
        Frame, or first and last frame, numbered from 0. Default: all frames.
    urdf : str
        URDF, or name of a robot; default: the robot that the motion names.

    Raises
    ------
    InputError
        If there is nothing to show, or the file cannot be written.
    """
    data = page_data(source, path.stem, view=view, frame=frame, urdf=urdf)
    write_bytes(path, page_html(data).encode())


def page_html(data: Mapping[str, Any]) -> str:
    """Return the page of `posekit.viewer.page.data.page_data` as text."""
    # Text from files must not end the script element or start a comment.
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for letter in "<>&\u2028\u2029":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    parts = {
        "policy": POLICY,
        "title": html.escape(f"{data['title']} - posekit"),
        "style": _file("page.css"),
        "scripts": "\n".join(_file(name) for name in SCRIPTS),
        "data": text,
    }
    return re.sub(r"\{(policy|title|style|scripts|data)\}", lambda found: parts[found[1]], _file("page.html"))


def _file(name: str) -> str:
    return (resources.files("posekit.viewer.page") / name).read_text(encoding="utf-8")
