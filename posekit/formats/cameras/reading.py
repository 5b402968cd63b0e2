"""Cameras from files: which format a file is in, and the formats by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from posekit.cameras.calibrated import CalibratedCamera
from posekit.errors import InputError
from posekit.formats.cameras.colmap import read_colmap
from posekit.formats.cameras.exif import read_exif
from posekit.formats.cameras.fields import cameras_of, metres_of
from posekit.formats.cameras.opencv_file import read_opencv, write_opencv
from posekit.formats.cameras.pose2sim import read_pose2sim, write_pose2sim
from posekit.safe_io import nearest, open_npz, refusal, shown

MAX_BYTES: Final = 10_000_000
ANIPOSE_UNIT: Final = "mm"


def read_npz(path: Path, unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    """Read the arrays of an NPZ (``K``, ``dist``, ``R``, ``t``, … as `posekit.formats.cameras.fields` has them)."""
    fields: dict[str, Any] = {}
    with open_npz(path, limit=MAX_BYTES) as archive:
        for name in archive.names:
            values = archive.array(name, "iufU", None)
            fields[name] = values.item() if values.size == 1 else values
    return cameras_of(fields, path, path.stem, unit)


def _read_anipose(path: Path, unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    return read_pose2sim(path, ANIPOSE_UNIT if unit is None else unit)


def _read_exif(path: Path, _unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    camera = read_exif(path)
    return {camera.name: camera}


FORMATS: Final[Mapping[str, Callable[[Path, str | float | None], dict[str, CalibratedCamera]]]] = (
    MappingProxyType(
        {
            "opencv": read_opencv,
            "npz": read_npz,
            "pose2sim": read_pose2sim,
            "anipose": _read_anipose,
            "colmap": read_colmap,
            "exif": _read_exif,
        }
    )
)
"""Formats by name."""

SUFFIXES: Final[Mapping[str, str]] = MappingProxyType(
    {
        ".yaml": "opencv",
        ".yml": "opencv",
        ".xml": "opencv",
        ".json": "opencv",
        ".npz": "npz",
        ".toml": "pose2sim",
        ".txt": "colmap",
        ".jpg": "exif",
        ".jpeg": "exif",
        ".tif": "exif",
        ".tiff": "exif",
        ".webp": "exif",
    }
)


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
        One of `FORMATS`; by the file's ending if not given.
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
    if format is None:
        format = "colmap" if path.is_dir() else SUFFIXES.get(path.suffix.lower())
    if format is None:
        expected = f"a camera's file: {', '.join(SUFFIXES)}, or COLMAP's folder"
        raise refusal(
            path, "", f"the ending {shown(path.suffix)}", expected, f"name the format: {', '.join(FORMATS)}"
        )
    if format not in FORMATS:
        raise refusal("", "format", shown(format), "a known format", nearest(format, FORMATS))
    return FORMATS[format](path, unit)


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
    if suffix == ".toml":
        write_pose2sim(path, dict(cameras))
    elif suffix in (".yaml", ".yml"):
        if len(cameras) > 1:
            raise refusal(
                path, "", f"{len(cameras)} cameras", "one a YAML file", "write one each, or a .toml"
            )
        write_opencv(path, next(iter(cameras.values())))
    else:
        raise refusal(path, "", f"the ending {shown(suffix)}", ".toml, .yaml or .yml", "choose one of them")
