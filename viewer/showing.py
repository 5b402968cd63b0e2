"""A page shown where somebody is: in the notebook, in the browser, or as a file where there is no screen."""

from __future__ import annotations

import html
import os
import sys
import tempfile
import webbrowser
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posekit.safe_io.writing import write_text

FRAME_PIXELS: Final = 560
"""Height of a page in a notebook."""


@dataclass(frozen=True, kw_only=True)
class ShownPage:
    """A page that was written: its place where it is printed, the page itself in a notebook.

    Parameters
    ----------
    path : Path
        The file.
    opened : bool
        Whether a browser was asked to open it.
    """

    path: Path
    opened: bool = False

    def __repr__(self) -> str:
        """Say where the page is."""
        how = "opened in the browser" if self.opened else "no screen was found here; open it in a browser"
        return f"{self.path}  ({how})"

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own, which may load nothing."""
        page = html.escape(self.path.read_text(encoding="utf-8"))
        return (
            f'<iframe srcdoc="{page}" sandbox="allow-scripts" width="100%" height="{FRAME_PIXELS}" '
            'style="border:0"></iframe>'
        )


def show_page(page: str, path: str | Path | None = None) -> ShownPage:
    """Write a page, and open it in the browser where there is a screen and no notebook shows it.

    Parameters
    ----------
    page : str
        HTML.
    path : path, optional
        Where it is to be written; a new temporary file if not given.

    Raises
    ------
    InputError
        Where it cannot be written.
    """
    if path is None:
        path = Path(tempfile.mkdtemp(prefix="posekit-")) / "page.html"
    file = Path(path).absolute()
    write_text(file, [page])
    opened = not in_notebook() and has_screen() and webbrowser.open(file.as_uri())
    return ShownPage(path=file, opened=opened)


def has_screen() -> bool:
    """Whether a browser would have a window; without one, a text browser would take the terminal over."""
    return sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )


def in_notebook() -> bool:
    """Whether this process answers a notebook."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and hasattr(shell, "kernel")
