"""COLMAP's text model: ``cameras.txt`` and ``images.txt`` (COLMAP documentation, "Output Format", "Camera Models").

The middle of COLMAP's first pixel is (0.5, 0.5), of OpenCV's (0, 0): half a pixel comes off the principal point.
Reconstruction from pictures knows no scale: translations are in a unit of its own, and are taken only where the caller
says how many metres that is.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.cameras.calibrated import CalibratedCamera
from posekit.cameras.rotation import rotation_from_wxyz
from posekit.errors import CameraError, InputError
from posekit.formats.cameras.camera_format import CameraFormat
from posekit.formats.cameras.fields import MAX_CAMERAS, made, metres_of
from posekit.geometry import Array
from posekit.safe_io import cut, nearest, one_line, read_text, refusal, shown

MAX_BYTES: Final = 200_000_000
"""``images.txt`` lists every point of every picture."""

MODEL_PARAMETERS: Final[dict[str, tuple[str, ...]]] = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
"""Parameters of each model that is read, in the file's order."""
OTHER_MODELS: Final = (
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE",
)
FISHEYE_PARAMETERS: Final = ("k1", "k2", "k3", "k4")
LENS_PARAMETERS: Final = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def read_colmap(path: Path, unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    """Read a model; see `posekit.formats.cameras.read_cameras`.

    Parameters
    ----------
    path : path
        ``cameras.txt``: the cameras by their number, without poses. ``images.txt``, or the folder of both: a camera
        a picture, by the picture's name, with its pose.
    unit : str or float, optional
        Metres in the model's unit; without it cameras have rotations but no translations.
    """
    folder = path if path.is_dir() else path.parent
    images = folder / "images.txt"
    if path.is_dir():
        wants_images = images.exists()
        cameras = folder / "cameras.txt"
    else:
        wants_images = path.name.lower() == "images.txt"
        images, cameras = (path, folder / "cameras.txt") if wants_images else (images, path)
    intrinsics = _read_cameras(cameras)
    if not wants_images:
        return {name: made(cameras, name, **one) for name, one in intrinsics.items()}
    return _read_images(images, intrinsics, unit)


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the lines that are no comments, with their numbers, as words."""
    text = read_text(
        path, limit=MAX_BYTES, too_large="leave out the points: they are the second line of each picture"
    )
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.startswith("#"):
            yield number, line.split()


def _read_cameras(path: Path) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for number, words in _rows(path):
        if not words:
            continue
        place = f"line {number}"
        if len(words) < 5:
            expected = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS, as in COLMAP's cameras.txt"
            remedy = "correct the file, or name a calibration in TOML, YAML, XML, JSON or NPZ"
            raise refusal(path, place, shown(" ".join(words)), expected, remedy)
        name, model = words[0], words[1]
        if model in OTHER_MODELS or model not in MODEL_PARAMETERS:
            remedy = (
                "undistort with COLMAP's image_undistorter"
                if model in OTHER_MODELS
                else nearest(model, MODEL_PARAMETERS)
            )
            raise refusal(
                path, place, f"the model {cut(one_line(model))}", ", ".join(MODEL_PARAMETERS), remedy
            )
        names = MODEL_PARAMETERS[model]
        width, height, *values = _numbers(words[2:], path, place)
        if len(values) != len(names):
            got, expected = f"{len(values)} parameters", f"{len(names)} for {model}: {', '.join(names)}"
            raise refusal(path, place, got, expected, "correct the file")
        if name in found:
            raise refusal(
                path, place, f"camera {cut(one_line(name))} twice", "each once", "remove one of the two"
            )
        if not (width.is_integer() and height.is_integer()):
            raise refusal(path, place, f"{width:g} x {height:g}", "whole pixels", "correct the file")
        found[name] = _parameters(model, dict(zip(names, values, strict=True))) | {
            "size": (int(width), int(height))
        }
        if len(found) > MAX_CAMERAS:
            raise refusal(
                path, "", f"more than {MAX_CAMERAS:,} cameras", f"at most {MAX_CAMERAS:,}", "split it"
            )
    if not found:
        raise refusal(path, "", "no camera", "a line a camera", "check that it is COLMAP's cameras.txt")
    return found


def _parameters(model: str, given: dict[str, float]) -> dict[str, Any]:
    fx, fy = given.get("fx", given.get("f", np.nan)), given.get("fy", given.get("f", np.nan))
    K = np.array([[fx, 0.0, given["cx"] - 0.5], [0.0, fy, given["cy"] - 0.5], [0.0, 0.0, 1.0]])
    fisheye = model == "OPENCV_FISHEYE"
    order = FISHEYE_PARAMETERS if fisheye else LENS_PARAMETERS
    values = [given.get(name, 0.0) for name in order] if any(name in given for name in order) else []
    if not fisheye and not any(values[5:]):
        values = values[:5]
    return {"K": K, "distortion": np.array(values), "fisheye": fisheye}


def _read_images(
    path: Path, intrinsics: dict[str, dict[str, Any]], unit: str | float | None
) -> dict[str, CalibratedCamera]:
    found: dict[str, CalibratedCamera] = {}
    is_pose = True
    for number, words in _rows(path):
        place = f"line {number}"
        if not is_pose:  # the picture's points, which may be none: an empty line
            is_pose = True
            continue
        if not words:
            continue
        if len(words) < 10:
            expected = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
            raise refusal(
                path, place, f"{len(words)} words", expected, "correct the file: two lines a picture"
            )
        values = np.array(_numbers(words[1:8], path, place))
        camera, name = words[8], " ".join(words[9:])
        if camera not in intrinsics:
            known = [one_line(one) for one in list(intrinsics)[:20]]
            raise refusal(
                path, place, f"camera {cut(one_line(camera))}", "one of cameras.txt", nearest(camera, known)
            )
        if name in found:
            raise refusal(
                path, place, f"the picture {shown(name)} twice", "each once", "remove one of the two"
            )
        found[name] = made(path, name, **intrinsics[camera], **_pose(values, unit, path, place))
        is_pose = False
        if len(found) > MAX_CAMERAS:
            raise refusal(
                path, "", f"more than {MAX_CAMERAS:,} pictures", f"at most {MAX_CAMERAS:,}", "split it"
            )
    if not found:
        raise refusal(path, "", "no picture", "two lines a picture", "check that it is COLMAP's images.txt")
    return found


def _pose(values: Array, unit: str | float | None, path: Path, place: str) -> dict[str, Any]:
    try:
        R = rotation_from_wxyz(values[:4])
    except CameraError as error:
        raise InputError(f"{path}: {place}: {error}; correct the file") from None
    return {"R": R, "t": None if unit is None else values[4:] * metres_of(unit)}


def _numbers(words: list[str], path: Path, place: str) -> list[float]:
    values = []
    for word in words:
        try:
            value = float("nan" if "_" in word else word)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise refusal(path, place, shown(word), "a finite number", "correct the file")
        values.append(value)
    return values


COLMAP_FORMAT: Final = CameraFormat(
    name="colmap",
    title="COLMAP's cameras.txt, images.txt, or the folder of both",
    suffixes=(".txt",),
    folder=True,
    looks_like=lambda given: not given.is_folder or (given.path / "cameras.txt").is_file(),
    read=read_colmap,
)
