"""Names of a package that are loaded when they are first used, so that a command loads what it runs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def on_demand(package: str, names: Mapping[str, tuple[str, ...]]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package that loads the modules behind its names when those are first used.

    No such name may be that of a module of the package: the import system sets those itself.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    names : mapping of str to tuple of str
        By module of the package, what the package offers of it.
    """
    home = {name: f"{package}.{module}" for module, offered in names.items() for name in offered}

    def load(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(home[name]), name)
        setattr(sys.modules[package], name, value)  # the next time it is simply there
        return value

    return load
