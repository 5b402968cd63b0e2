"""Optional packages: what to install where one is missing."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from posekit.errors import InputError


def extra(module: str, name: str, what: str) -> ModuleType:
    """Import an optional package.

    Parameters
    ----------
    module : str
        As it is imported, ``ezc3d``.
    name : str
        The extra of posekit that brings it, ``c3d``.
    what : str
        What needs it, as ``reading C3D``.

    Raises
    ------
    InputError
        Where it is not installed, with the command that installs it.
    """
    try:
        return import_module(module)
    except ImportError:
        raise InputError(
            f"{what} needs {module}, which is not installed; run: pip install 'posekit[{name}]'"
        ) from None
