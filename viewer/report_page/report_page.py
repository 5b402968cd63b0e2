"""One standalone page a report; it loads nothing, and is some MB at most."""

from __future__ import annotations

import html
import re
from importlib import resources
from pathlib import Path
from typing import Final

from posekit.formats.own.report import ValidationReport
from posekit.safe_io.writing import write_text
from posekit.viewer.report_page.page_report import page_report
from posekit.viewer.standalone import script_json

REPORT_POLICY: Final = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'"
"""The browser itself refuses to load anything at all."""


def report_page_html(report: ValidationReport, *, title: str = "Validation") -> str:
    """Make the page, as text; see `write_report_page`."""
    parts = {
        "policy": REPORT_POLICY,
        "title": html.escape(title),
        "style": _file("report.css"),
        "scripts": "\n".join((_file("stick.js"), _file("report.js"))),
        "data": script_json(page_report(report, title=title)),
    }
    # In one pass: what is put in is not looked through again.
    return re.sub(
        r"\{(policy|title|style|scripts|data)\}", lambda found: parts[found[1]], _file("report.html")
    )


def write_report_page(path: str | Path, report: ValidationReport, *, title: str = "") -> None:
    """Write the page of a report: one HTML file, whole or not at all.

    Parameters
    ----------
    path : path
        The HTML file.
    report : ValidationReport
        Of clips, with their stills, or of postures alone.
    title : str
        Shown on top; by default the file's name.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    write_text(path, [report_page_html(report, title=title or Path(path).stem)])


def _file(name: str) -> str:
    return (resources.files("posekit.viewer.report_page") / name).read_text(encoding="utf-8")
