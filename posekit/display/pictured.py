"""What a notebook shows of an object: its line, under a small picture of it."""

from __future__ import annotations

import html

from posekit.display.short_repr import ShortRepr


class Pictured(ShortRepr):
    """Print as one line, and show itself in a notebook as a small picture with that line."""

    def _drawing(self) -> str:
        """Return the picture, SVG; empty where there is nothing to draw."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        """Return what Jupyter shows: no script, and nothing that is loaded."""
        return f"<div>{self._drawing()}<br><code>{html.escape(repr(self))}</code></div>"
