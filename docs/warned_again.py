"""A page with a warning is read again by the next build: a part of Sphinx's build of this documentation.

Sphinx reads what has changed, so the same command would fail once and then say that all is well.
"""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.logging import NAMESPACE, is_suppressed_warning

NOTE = "warned.json"


class Places(logging.Handler):
    """Notes where warnings are: the handler before it, which prints them, has spelled that out."""

    def __init__(self, app: Sphinx) -> None:
        super().__init__(logging.WARNING)
        self.places: set[str] = set()
        self.suppressed = app.config.suppress_warnings

    def emit(self, record: logging.LogRecord) -> None:
        """Note one; nowhere is everywhere."""
        kind, inside = (getattr(record, name, None) for name in ("type", "subtype"))
        if not is_suppressed_warning(kind, inside, self.suppressed):
            self.places.add(str(getattr(record, "location", None) or ""))


def outdated(app: Sphinx, env: Any, added: set[str], changed: set[str], removed: set[str]) -> list[str]:
    """Return the pages that the last build warned of, by themselves or by what they are made of."""
    note = Path(app.doctreedir, NOTE)
    if not note.is_file():
        return []
    files = {place.partition(":")[0] for place in json.loads(note.read_text(encoding="utf-8"))}
    pages = env.found_docs - added - removed
    if "" in files:
        return sorted(pages)
    resolved = {Path(file).resolve() for file in files}
    return [page for page in sorted(pages) if resolved & _made_of(app, env, page)]


def note_places(app: Sphinx, exception: Exception | None) -> None:
    """Write down where this build warned."""
    places: set[str] = app.warned_places.places  # type: ignore[attr-defined]
    Path(app.doctreedir, NOTE).write_text(json.dumps(sorted(places)), encoding="utf-8")


def _made_of(app: Sphinx, env: Any, page: str) -> set[Path]:
    files = (Path(app.srcdir, file).resolve() for file in env.dependencies.get(page, ()))
    return {Path(env.doc2path(page)).resolve(), *files}


def setup(app: Sphinx) -> dict[str, bool]:
    """Take part in the build."""
    app.warned_places = Places(app)  # type: ignore[attr-defined]
    logging.getLogger(NAMESPACE).addHandler(app.warned_places)  # type: ignore[attr-defined]
    app.connect("env-get-outdated", outdated)
    app.connect("build-finished", note_places)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
