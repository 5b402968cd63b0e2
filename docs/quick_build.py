"""What a thousand generated pages need not do a thousand times: a part of Sphinx's build of this documentation.

Sphinx makes the sidebar of every page anew, of all entries of all pages, and searches all names of posekit for each
short name in a docstring. Pages of source code in one folder have the same sidebar, and a name stands for the same
thing wherever the same module and class ask for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sphinx.application import Sphinx
from sphinx.domains.python import PythonDomain

SOURCES = "_modules/"
"""Where `sphinx.ext.viewcode` puts its pages."""

Key = tuple[str, str, str, str | None]


class Python(PythonDomain):
    """Sphinx's own, but once all pages are read it looks a short name up once for each module and class."""

    endings: frozenset[str] | None = None
    found: dict[Key, list[Any]]

    def index(self) -> None:
        """Let names be looked up quickly: there are no more to come."""
        self.endings = frozenset(name.rpartition(".")[2] for name in self.objects)
        self.found = {}

    def find_obj(
        self, env: Any, modname: str, classname: str, name: str, type: str | None, searchmode: int = 0
    ) -> list[Any]:
        """Return what Sphinx's own returns."""
        if searchmode == 0 or self.endings is None:
            return super().find_obj(env, modname, classname, name, type, searchmode)
        if name.removesuffix("()").rpartition(".")[2] not in self.endings:
            return []
        key = modname, classname, name, type
        if key not in self.found:
            self.found[key] = super().find_obj(env, modname, classname, name, type, searchmode)
        return list(self.found[key])


def index_names(app: Sphinx, env: Any) -> None:
    """Index the names when all are known."""
    env.domains["py"].index()


def share_sidebars(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Let pages of source code in one folder have one sidebar: no entry of it is theirs, and links are relative."""
    if not page.startswith(SOURCES) or "toctree" not in context:
        return
    made: dict[Any, str] = app.made_sidebars  # type: ignore[attr-defined]
    make: Callable[..., str] = context["toctree"]
    folder = page.rpartition("/")[0]

    def shared(**options: Any) -> str:
        key = folder, tuple(sorted(options.items()))
        if key not in made:
            made[key] = make(**options)
        return made[key]

    context["toctree"] = shared


def setup(app: Sphinx) -> dict[str, bool]:
    """Take part in the build."""
    app.made_sidebars = {}  # type: ignore[attr-defined]
    app.add_domain(Python, override=True)
    app.connect("env-updated", index_names)
    app.connect("html-page-context", share_sidebars, priority=100)  # before the theme's
    return {"parallel_read_safe": True, "parallel_write_safe": True}
