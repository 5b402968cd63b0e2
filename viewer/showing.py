"""A page shown where somebody is: in the notebook, in the browser, or as a file where there is no screen."""

from __future__ import annotations

import html
import os
import stat
import sys
import tempfile
import time
import webbrowser
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posekit.safe_io.writing import write_text

MOST_PAGES: Final = 20
"""Pages that are kept."""

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
        Where it is to be written; a new file in `shown_folder` if not given.

    Raises
    ------
    InputError
        Where it cannot be written.
    """
    if path is None:
        path = _page_in(shown_folder())
    file = Path(path).absolute()
    write_text(file, [page])
    opened = not in_notebook() and has_screen() and webbrowser.open(file.as_uri())
    return ShownPage(path=file, opened=opened)


def shown_folder() -> Path:
    """Return the one temporary folder of this user's pages, which holds the last `MOST_PAGES`.

    They outlive the process: a browser may open them later.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"posekit-shown-{user}"
    with suppress(OSError):
        folder.mkdir(mode=0o700)
    try:
        found = folder.lstat()
    except OSError:
        return Path(tempfile.mkdtemp(prefix="posekit-"))
    if not stat.S_ISDIR(found.st_mode) or (hasattr(os, "getuid") and found.st_uid != user):
        return Path(tempfile.mkdtemp(prefix="posekit-"))  # somebody else has the name
    return folder


def _page_in(folder: Path) -> Path:
    """Name a new page, and leave out the oldest where there are too many."""
    older = sorted(folder.glob("page-*.html"), key=lambda page: page.name)
    for page in older[: max(len(older) - MOST_PAGES + 1, 0)]:
        page.unlink(missing_ok=True)
    return folder / f"page-{time.time_ns():020d}.html"


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
