"""The camera of a photograph, guessed from its EXIF data (CIPA DC-008, "Exif 3.0")."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any, Final

from posekit.cameras.calibrated import CalibratedCamera
from posekit.cameras.guesses import FILM_DIAGONAL_MM, FOCAL_DEVIATION, camera_from_focal35
from posekit.formats.cameras.camera_format import CameraFormat
from posekit.safe_io import extra, open_file, refusal

MAX_BYTES: Final = 500_000_000
PICTURE_FORMATS: Final = ("JPEG", "MPO", "TIFF", "PNG", "WEBP")

ORIENTATION_TAG: Final = 0x0112
EXIF_TAG: Final = 0x8769
FOCAL_LENGTH: Final = 0x920A
FOCAL_LENGTH_35: Final = 0xA405
PIXELS_X, PIXELS_Y = 0xA002, 0xA003
PLANE_X, PLANE_Y, PLANE_UNIT = 0xA20E, 0xA20F, 0xA210
DIGITAL_ZOOM: Final = 0xA404
MILLIMETRES_IN_UNIT: Final = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
"""Of the unit of the sensor's resolution: inch, centimetre, and two that cameras use beside the standard."""
QUARTER_TURNS: Final = (5, 6, 7, 8)
"""Orientations that turn a picture by a quarter."""
CROPPED_DEVIATION: Final = 0.2
"""Deviation of f where the picture is not the one that the camera took."""
SAME_SHAPE: Final = 0.01


def read_exif(path: str | Path) -> CalibratedCamera:
    """Guess the camera of a photograph.

    The 35 mm equivalent focal length is taken, or the focal length with the sensor's resolution. The size is that of
    the picture when it is shown upright, which is how OpenCV and detectors read it.

    Parameters
    ----------
    path : path
        A JPEG, TIFF, PNG or WebP file. The picture itself is not decoded.

    Returns
    -------
    CalibratedCamera
        Its `how` says what the guess rests on, its `deviation` how far f may be off: 5 %; more with digital zoom,
        which some cameras have in the equivalent and others not; 20 % where the picture was cut.

    Raises
    ------
    InputError
        Where it is no such file, has no focal length that says an angle of view, or Pillow is not installed.
    """
    path = Path(path)
    image = extra("PIL.Image", "pictures", "reading EXIF")
    with open_file(path, limit=MAX_BYTES, too_large="name a photograph") as file, warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # of Pillow's, about tags that are damaged: what is needed is checked here
        try:
            with image.open(file, formats=PICTURE_FORMATS) as picture:
                width, height = picture.size
                tags = picture.getexif()
                orientation = tags.get(ORIENTATION_TAG)
                exif = dict(tags.get_ifd(EXIF_TAG))
        except (OSError, ValueError, SyntaxError, TypeError, KeyError, ArithmeticError, EOFError) as error:
            reason = str(error).partition("<")[0].strip() or type(error).__name__
            raise refusal(path, "", reason[:80], "a photograph", "name a JPEG that is not damaged") from None
        except image.DecompressionBombError:
            raise refusal(
                path, "", "more pixels than a photograph has", "a photograph", "name another"
            ) from None
    equivalent, basis = _equivalent(exif, path)
    zoom = _number(exif, DIGITAL_ZOOM)
    taken = (_number(exif, PIXELS_X), _number(exif, PIXELS_Y))
    deviation, doubts = FOCAL_DEVIATION, ""
    if zoom is not None and zoom > 1:
        deviation = max(deviation, 1 - 1 / min(zoom, 2.0))
        doubts = f", digital zoom {zoom:g}"
    if None not in taken and not _same_shape((width, height), taken):  # type: ignore[arg-type]
        deviation = max(deviation, CROPPED_DEVIATION)
        doubts += f", cut from {taken[0]:.0f} x {taken[1]:.0f} pixels"
    size = (height, width) if orientation in QUARTER_TURNS else (width, height)
    how = f"a guess from EXIF: {basis}{doubts}, f within {100 * deviation:.0f} %"
    return camera_from_focal35(size, equivalent, name=path.stem, deviation=deviation, how=how)


def _equivalent(exif: dict[int, Any], path: Path) -> tuple[float, str]:
    """Return the 35 mm equivalent, mm, and what it rests on."""
    equivalent = _number(exif, FOCAL_LENGTH_35)
    if equivalent is not None and 1 <= equivalent <= 5000:
        return equivalent, f"{equivalent:g} mm equivalent to 35 mm film"
    focal = _number(exif, FOCAL_LENGTH)
    sensor = _sensor_diagonal(exif)
    if focal is not None and sensor is not None and 1 <= FILM_DIAGONAL_MM * focal / sensor <= 5000:
        return FILM_DIAGONAL_MM * focal / sensor, f"{focal:g} mm on a sensor of {sensor:.1f} mm"
    there = "a focal length but no sensor size" if focal is not None else "none"
    raise refusal(
        path,
        "EXIF focal length",
        there,
        "FocalLengthIn35mmFilm, or FocalLength and FocalPlaneXResolution",
        "give an angle of view or a 35 mm equivalent instead",
    )


def _sensor_diagonal(exif: dict[int, Any]) -> float | None:
    """Return the sensor's diagonal, mm, from its resolution and the picture that was taken."""
    x, y = _number(exif, PLANE_X), _number(exif, PLANE_Y)
    width, height = _number(exif, PIXELS_X), _number(exif, PIXELS_Y)
    unit = MILLIMETRES_IN_UNIT.get(int(_number(exif, PLANE_UNIT) or 2))
    if x is None or width is None or height is None or unit is None:
        return None
    diagonal = unit * math.hypot(width / x, height / (y or x))
    return diagonal if 1 <= diagonal <= 100 else None


def _number(exif: dict[int, Any], tag: int) -> float | None:
    """Return a tag's positive number; None where it is missing or anything else (rationals may divide by zero)."""
    value = exif.get(tag)
    if value is None or isinstance(value, str | bytes | tuple):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def _same_shape(size: tuple[int, int], taken: tuple[float, float]) -> bool:
    """Tell whether a picture has the shape of the one that was taken, lying or standing: then it was only resized."""
    shape, before = max(size) / min(size), max(taken) / min(taken)
    return abs(shape / before - 1) <= SAME_SHAPE


def _read(path: Path, _unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    camera = read_exif(path)
    return {camera.name: camera}


EXIF_FORMAT: Final = CameraFormat(
    name="exif",
    title="a photograph, whose camera is guessed from its EXIF data",
    suffixes=(".jpg", ".jpeg", ".tif", ".tiff", ".webp"),
    looks_like=lambda given: True,
    read=_read,
)
