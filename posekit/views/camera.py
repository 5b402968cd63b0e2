"""The camera of a detector's pictures: calibrated, guessed, or none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from posekit.cameras.calibrated import CalibratedCamera, choose_camera, needs_undistortion, pinhole_of
from posekit.cameras.guesses import camera_from_focal35, camera_from_fov
from posekit.cameras.undistortion import undistorted
from posekit.errors import InputError
from posekit.formats.cameras import read_cameras
from posekit.formats.keypoints import KeyPoints
from posekit.formats.own import CameraModel, OpenCVModel, ScaledOrthographicModel
from posekit.safe_io import shown
from posekit.views.source import Source

SHORTEST_FOCAL, LONGEST_FOCAL = 0.05, 100.0
"""Focal lengths that a picture can have, of its longer side: a view of 170 degrees, and one of half a degree."""

OUTSIDE_SHARE: Final = 0.5
"""Of all points, from which on they were not seen in pictures of the size that leaves them outside."""

MAX_CAMERAS_LISTED: Final = 8
"""Names of cameras that are listed."""


class SightedKeyPoints(NamedTuple):
    """Key points, and the camera that saw them.

    Attributes
    ----------
    keypoints : KeyPoints
        In pixels of `camera`: undistorted where the lens needs it.
    camera : OpenCVModel or ScaledOrthographicModel
        The camera that saw them.
    says : str
        What camera it is, in a line.
    """

    keypoints: KeyPoints
    camera: CameraModel
    says: str


def sighting(keypoints: KeyPoints, source: Source) -> SightedKeyPoints:
    """Find the camera, and bring the key points into its pixels.

    Raises
    ------
    InputError
        Where the calibration cannot be read, has several cameras and none is named, is of pictures of another size,
        or a size is needed that neither the file nor `--size` says.
    """
    keypoints = in_pixels(keypoints, source.size)
    if keypoints.normalised:
        raise InputError(
            f"{keypoints.source}: points are fractions of the picture, whose size is not known; expected pixels; "
            "give --size WIDTHxHEIGHT"
        )
    if source.camera:
        camera = named_camera(source.camera)
    elif source.fov is not None:
        camera = camera_from_fov(_size(keypoints, source, "--fov"), source.fov, "horizontal")
    elif source.focal35 is not None:
        camera = camera_from_focal35(_size(keypoints, source, "--focal35"), source.focal35)
    else:
        model = ScaledOrthographicModel(scale=None)
        return SightedKeyPoints(keypoints, model, "no camera: scaled orthographic, the scale is not known")
    _check_size(camera, keypoints)
    _check_unit(camera, keypoints)
    return SightedKeyPoints(_ideal(keypoints, camera), model_of(camera), _says(camera))


def in_pixels(keypoints: KeyPoints, size: tuple[int, int] | None) -> KeyPoints:
    """Turn fractions of the picture into pixels, where its size is known by now.

    Raises
    ------
    InputError
        Where the file says another size, or points say so.
    """
    sizes = keypoints.size
    if size is not None:
        other = (np.isfinite(sizes) & (sizes != size)).any(axis=1)
        if other.any():
            width, height = sizes[int(np.argmax(other))]
            raise InputError(
                f"--size: {size[0]}x{size[1]}, but {keypoints.source} says {width:g}x{height:g} of "
                f"{keypoints.pictures[int(np.argmax(other))]}; expected the pictures' own; leave it out"
            )
        if not keypoints.normalised and outside(keypoints, size) > OUTSIDE_SHARE:
            right, below = np.nanmax(keypoints.points, axis=(0, 1))
            raise InputError(
                f"--size: {size[0]}x{size[1]}, and most points of {keypoints.source} lie outside, as far as "
                f"({right:.0f}, {below:.0f}); expected the pictures' own size; correct it"
            )
        sizes = np.broadcast_to(np.array(size, dtype=float), sizes.shape)
    if not keypoints.normalised or np.isnan(sizes).any():
        return replace(keypoints, size=sizes)
    points = keypoints.points * sizes[keypoints.frame][:, None]
    return replace(keypoints, points=points, size=sizes, normalised=False)


def split_camera(text: str) -> tuple[Path, str]:
    """Split FILE[:NAME]; a colon that is part of an existing file's name stays there."""
    if Path(text).exists():
        return Path(text), ""
    file, colon, name = text.rpartition(":")
    return (Path(file), name) if colon and file else (Path(text), "")


def _size(keypoints: KeyPoints, source: Source, option: str) -> tuple[int, int]:
    if source.size is not None:
        return source.size
    sizes = np.unique(keypoints.size, axis=0)
    if len(sizes) > 1 and np.isfinite(sizes).all():
        raise InputError(
            f"{option}: the pictures of {keypoints.source} are of {len(sizes)} sizes, and one camera has one; expected "
            "pictures of one size; split the file"
        )
    if len(sizes) != 1 or np.isnan(sizes).any():
        raise InputError(
            f"{option}: the size of the pictures is not known from {keypoints.source}; expected one size; give "
            "--size WIDTHxHEIGHT"
        )
    return int(sizes[0, 0]), int(sizes[0, 1])


def named_camera(text: str) -> CalibratedCamera:
    """Read the camera that an option names."""
    path, name = split_camera(text)
    cameras = read_cameras(path)
    if len(cameras) > 1 and name not in cameras:
        there = ", ".join(list(cameras)[:MAX_CAMERAS_LISTED]) + (
            ", …" if len(cameras) > MAX_CAMERAS_LISTED else ""
        )
        got = f"no camera {shown(name)}, but " if name else ""
        raise InputError(
            f"--camera: {path} has {got}{len(cameras)} cameras ({there}); expected one of them; name it, as "
            f"{path}:{next(iter(cameras))}"
        )
    return choose_camera(cameras, name or None)


def _check_size(camera: CalibratedCamera, keypoints: KeyPoints) -> None:
    """Refuse a calibration of pictures of another size than those of the key points.

    Where nobody says how large the pictures are, points outside tell: detectors put fewer there than inside.
    """
    if camera.size is None:
        return
    calibrated = f"--camera: {camera.name} is calibrated for {camera.size[0]}x{camera.size[1]} pixels"
    known = keypoints.size[np.isfinite(keypoints.size).all(axis=1)]
    if (known != camera.size).any():
        width, height = (int(side) for side in known[(known != camera.size).any(axis=1)][0])
        remedy = "give the calibration of these pictures"
        if (height, width) == tuple(camera.size):
            remedy = (
                "width and height are exchanged: correct --size, or turn the pictures as the camera was held"
            )
        raise InputError(f"{calibrated}, and pictures of {keypoints.source} are {width}x{height}; {remedy}")
    if outside(keypoints, camera.size) > OUTSIDE_SHARE and not len(known):
        right, below = np.nanmax(keypoints.points, axis=(0, 1))
        raise InputError(
            f"{calibrated}, and most points of {keypoints.source} lie outside, as far as ({right:.0f}, {below:.0f}); "
            "give the calibration of these pictures"
        )


def outside(keypoints: KeyPoints, size: tuple[int, int]) -> float:
    """Return the fraction of all points that lie outside a picture of that size."""
    there = keypoints.points[np.isfinite(keypoints.points[..., 0])]
    beyond = (there < -0.5) | (there > np.array(size) - 0.5)
    return float(beyond.any(axis=1).mean()) if len(there) else 0.0


def _check_unit(camera: CalibratedCamera, keypoints: KeyPoints) -> None:
    """Refuse intrinsics that are no pixels: millimetres, or fractions of the picture."""
    f = float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
    sizes = np.array(camera.size, dtype=float) if camera.size is not None else keypoints.size
    side = float(np.nanmax(sizes, initial=0.0)) or float(np.nanmax(np.abs(keypoints.points), initial=0.0))
    if not SHORTEST_FOCAL * side <= f <= LONGEST_FOCAL * side:
        raise InputError(
            f"--camera: {camera.name} has a focal length of {f:.4g} pixels, in pictures about {side:.0f} pixels wide "
            f"or high; expected {SHORTEST_FOCAL:g} to {LONGEST_FOCAL:g} times that; give K in pixels, not in "
            "millimetres or parts"
        )


def _ideal(keypoints: KeyPoints, camera: CalibratedCamera) -> KeyPoints:
    return (
        replace(keypoints, points=undistorted(keypoints.points, camera))
        if needs_undistortion(camera)
        else keypoints
    )


def model_of(camera: CalibratedCamera) -> OpenCVModel:
    """Return what a view says of a camera, whose points are undistorted where its lens needs it."""
    pinhole = pinhole_of(camera)
    return OpenCVModel(
        K=pinhole.K,
        distortion=pinhole.distortion,
        R=camera.R,
        t=camera.t,
        size=camera.size,
        up=camera.up if camera.R is not None else "",
    )


def _says(camera: CalibratedCamera) -> str:
    f = float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
    place = "" if camera.R is not None and camera.t is not None else ", its place in the world is not known"
    return f"camera {camera.name}: {camera.how}, f {f:.0f} px{place}"
