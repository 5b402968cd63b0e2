"""What a format of cameras declares."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from posekit.formats.format import Content, Format

if TYPE_CHECKING:
    from posekit.cameras.calibrated import CalibratedCamera

ReadCameras: TypeAlias = "Callable[[Path, str | float | None], dict[str, CalibratedCamera]]"
WriteCameras: TypeAlias = "Callable[[Path, Mapping[str, CalibratedCamera]], None]"


@dataclass(frozen=True, kw_only=True)
class CameraFormat(Format):
    """A format of cameras: calibrations, or the camera of a photograph.

    Parameters
    ----------
    read : callable
        ``read(path, unit)`` returns the cameras by name, at least one; `unit` is what translations are in: ``m``,
        ``cm``, ``mm``, metres as a number, or None for the format's custom.
    write : callable, optional
        ``write(path, cameras)`` writes cameras by name, whole or not at all. Missing where the format is only read.
    write_suffixes : tuple of str
        The ends of the names of files that are written so.
    """

    holds: Content = Content.CAMERAS
    read: ReadCameras
    write: WriteCameras | None = None
    write_suffixes: tuple[str, ...] = ()


def has_intrinsics(document: object) -> bool:
    """Tell whether a document has intrinsics, in itself or one level below.

    Parameters
    ----------
    document : object
        What a JSON file holds.
    """
    inner = list(document.values()) if isinstance(document, dict) else document
    below = [one for one in inner if isinstance(one, dict)] if isinstance(inner, list) else []
    top = [document] if isinstance(document, dict) else []
    return any(is_intrinsics(str(name)) for one in [*top, *below] for name in one)


def is_intrinsics(name: str) -> bool:
    """Tell whether a name is a camera matrix's: ``K``, ``camera_matrix``, ``intrinsics``, and so on.

    Parameters
    ----------
    name : str
        The name of a field or an array, in upper or lower case.
    """
    name = name.casefold()
    return name in ("k", "mtx", "m") or "matrix" in name or "intrinsic" in name
