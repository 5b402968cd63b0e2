"""Find the Chromium or Chrome that is installed on this machine."""

from __future__ import annotations

import os
import shutil
from typing import Final

from posekit.errors import ViewerError

BROWSER_VARIABLE: Final = "POSEKIT_BROWSER"
BROWSER_NAMES: Final = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "chrome-headless-shell",
    "microsoft-edge",
)
BROWSER_REMEDY: Final = (
    f"install one (Debian, Ubuntu: apt-get install chromium) or name its program in {BROWSER_VARIABLE}; "
    "pages (.html) and plots need none"
)


def find_browser() -> str:
    """Return the program's path: from ``POSEKIT_BROWSER``, else the first of `BROWSER_NAMES` on PATH.

    Raises
    ------
    ViewerError
        Where there is none, or where the variable names none.
    """
    named = os.environ.get(BROWSER_VARIABLE)
    if named:
        found = shutil.which(named)
        if found is None:
            raise ViewerError(
                f"{BROWSER_VARIABLE}: {named!r} is no program that can be run; {BROWSER_REMEDY}"
            )
        return found
    for name in BROWSER_NAMES:
        found = shutil.which(name)
        if found is not None:
            return found
    raise ViewerError(
        f"no browser to draw with: none of {', '.join(BROWSER_NAMES)} is on PATH; {BROWSER_REMEDY}"
    )
