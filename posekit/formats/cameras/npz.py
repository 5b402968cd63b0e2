"""Cameras in the arrays of an NPZ: ``K``, ``dist``, ``R``, ``t``, … as `posekit.formats.cameras.fields` has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from posekit.cameras.calibrated import CalibratedCamera
from posekit.formats.cameras.camera_format import CameraFormat, is_intrinsics
from posekit.formats.cameras.fields import cameras_of
from posekit.formats.given_file import GivenFile
from posekit.safe_io import open_npz

MAX_BYTES: Final = 10_000_000


def read_npz(path: Path, unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    """Read the camera of an NPZ.

    Parameters
    ----------
    path : Path
        The file.
    unit : str or float, optional
        What translations are in: ``m``, ``cm``, ``mm``, or metres as a number.

    Raises
    ------
    InputError
        Where it is damaged, or holds no camera.
    """
    fields: dict[str, Any] = {}
    with open_npz(path, limit=MAX_BYTES) as archive:
        for name in archive.names:
            values = archive.array(name, "iufU", None)
            fields[name] = values.item() if values.size == 1 else values
    return cameras_of(fields, path, path.stem, unit)


def _looks_like(given: GivenFile) -> bool:
    return "joints" not in given.arrays and any(map(is_intrinsics, given.arrays))


NPZ_CAMERA_FORMAT: Final = CameraFormat(
    name="npz",
    title="NPZ, NumPy arrays with intrinsics",
    suffixes=(".npz",),
    looks_like=_looks_like,
    read=read_npz,
)
