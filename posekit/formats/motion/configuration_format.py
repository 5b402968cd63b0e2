"""What a format of a robot's configurations declares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from posekit.formats.format import Content, Format

if TYPE_CHECKING:
    from posekit.formats.own import NamedConfigurations

ReadConfigurations: TypeAlias = "Callable[[Path], NamedConfigurations]"


@dataclass(frozen=True, kw_only=True)
class ConfigurationFormat(Format):
    """A format of configurations of a robot over time.

    Parameters
    ----------
    read : callable
        ``read(path)`` reads a file.
    """

    holds: Content = Content.CONFIGURATIONS
    read: ReadConfigurations
