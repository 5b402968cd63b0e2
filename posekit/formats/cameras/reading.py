"""Cameras from files: which format a file is in, and the formats by name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from posekit.cameras.calibrated import CalibratedCamera
from posekit.errors import InputError
from posekit.formats.cameras.camera_format import CameraFormat
from posekit.formats.cameras.fields import metres_of
from posekit.formats.format import Content
from posekit.formats.registry import FOLDER_SUFFIX, formats, with_suffix
from posekit.safe_io import nearest, refusal, shown


def camera_formats() -> dict[str, CameraFormat]:
    """Return the formats of cameras by name."""
    return {one.name: one for one in formats(Content.CAMERAS) if isinstance(one, CameraFormat)}


def read_cameras(
    path: str | Path, format: str | None = None, *, unit: str | float | None = None
) -> dict[str, CalibratedCamera]:
    """Read the cameras of a file.

    Parameters
    ----------
    path : path
        OpenCV's YAML, XML or JSON, NPZ, a ``posekit.view/1``; Pose2Sim's or Anipose's TOML; COLMAP's ``cameras.txt`` or
        ``images.txt`` or their folder; a photograph, whose camera is guessed.
    format : str, optional
        One of `camera_formats`; by the file's ending if not given.
    unit : str or float, optional
        What translations are in: m, cm, mm, or metres as a number. By default metres, millimetres in the format
        ``anipose``; in COLMAP's model there is no default, and without it cameras have no translation.

    Returns
    -------
    dict
        Cameras by name, in the file's order; at least one.

    Raises
    ------
    InputError
        Where the file cannot be read, is damaged, holds no camera or an impossible one.
    """
    path = Path(path)
    if unit is not None:
        metres_of(unit)
    known = camera_formats()
    if format is not None and format not in known:
        raise refusal("", "format", shown(format), "a known format", nearest(format, known))
    return (known[format] if format is not None else _by_suffix(path)).read(path, unit)


def _by_suffix(path: Path) -> CameraFormat:
    """Choose the format by the end of the name alone, so that the reader can say what is wrong with the file."""
    suffix = FOLDER_SUFFIX if path.is_dir() else path.suffix.lower()
    found = [one for one in with_suffix(suffix) if isinstance(one, CameraFormat)]
    if not found:
        known = camera_formats()
        ends = ", ".join(end for one in known.values() for end in one.suffixes)
        expected = f"a camera's file: {ends}, or COLMAP's folder"
        got = f"the ending {shown(path.suffix)}"
        raise refusal(path, "", got, expected, f"name the format: {', '.join(known)}")
    return found[0]


def write_cameras(path: str | Path, cameras: Mapping[str, CalibratedCamera]) -> None:
    """Write cameras: ``.toml`` as Pose2Sim has them, ``.yaml`` or ``.yml`` one camera as OpenCV has it.

    Raises
    ------
    InputError
        Where the ending is another, there is no camera, several for OpenCV's, or the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if not cameras:
        raise InputError(f"{path}: no camera to write; give one or more")
    for one in camera_formats().values():
        if one.write is not None and suffix in one.write_suffixes:
            return one.write(path, cameras)
    raise refusal(path, "", f"the ending {shown(suffix)}", ".toml, .yaml or .yml", "choose one of them")
