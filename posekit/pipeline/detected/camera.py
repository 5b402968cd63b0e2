"""The camera of a detector's pictures: calibrated, guessed, or none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from posekit.calibration import (
    CalibratedCamera,
    camera_from_focal35,
    camera_from_fov,
    choose_camera,
    needs_undistortion,
    pinhole_of,
    read_cameras,
    undistorted,
)
from posekit.errors import InputError
from posekit.files import CameraModel, OpenCVModel, ScaledOrthographicModel
from posekit.keypoints import KeyPoints
from posekit.pipeline.detected.source import Source


class Sighting(NamedTuple):
    """Key points, and the camera that saw them.

    Attributes
    ----------
    keypoints : KeyPoints
        In pixels of `camera`: undistorted where the lens needs it.
    camera : OpenCVModel or ScaledOrthographicModel
    says : str
        What camera it is, in a line.
    """

    keypoints: KeyPoints
    camera: CameraModel
    says: str


def sighting(keypoints: KeyPoints, source: Source) -> Sighting:
    """Find the camera, and bring the key points into its pixels.

    Raises
    ------
    InputError
        Where the calibration cannot be read, has several cameras and none is named, is of pictures of another size,
        or a size is needed that neither the file nor `--size` says.
    """
    keypoints = in_pixels(keypoints, source.size)
    if source.camera:
        path, name = split_camera(source.camera)
        camera = choose_camera(read_cameras(path), name or None)
    elif source.fov is not None:
        camera = camera_from_fov(_size(keypoints, source, "--fov"), source.fov, "horizontal")
    elif source.focal35 is not None:
        camera = camera_from_focal35(_size(keypoints, source, "--focal35"), source.focal35)
    else:
        model = ScaledOrthographicModel(scale=None)
        return Sighting(keypoints, model, "no camera: scaled orthographic, the scale is not known")
    _check_size(camera, keypoints)
    return Sighting(_ideal(keypoints, camera), _model(camera), _says(camera))


def in_pixels(keypoints: KeyPoints, size: tuple[int, int] | None) -> KeyPoints:
    """Turn fractions of the picture into pixels, where its size is known by now."""
    if not keypoints.normalised:
        return keypoints
    sizes = (
        keypoints.size if size is None else np.broadcast_to(np.array(size, dtype=float), keypoints.size.shape)
    )
    if np.isnan(sizes).any():
        return keypoints
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
    if len(sizes) != 1 or np.isnan(sizes).any():
        raise InputError(
            f"{option}: the size of the pictures is not known from {keypoints.source}; expected one size; give "
            "--size WIDTHxHEIGHT"
        )
    return int(sizes[0, 0]), int(sizes[0, 1])


def _check_size(camera: CalibratedCamera, keypoints: KeyPoints) -> None:
    """Refuse a calibration of pictures of another size than those of the key points."""
    known = keypoints.size[np.isfinite(keypoints.size).all(axis=1)]
    if camera.size is not None and len(known) and (known != camera.size).any():
        width, height = (int(side) for side in known[(known != camera.size).any(axis=1)][0])
        raise InputError(
            f"--camera: {camera.name} is calibrated for {camera.size[0]}x{camera.size[1]} pixels, and pictures of "
            f"{keypoints.source} are {width}x{height}; give the calibration of these pictures"
        )


def _ideal(keypoints: KeyPoints, camera: CalibratedCamera) -> KeyPoints:
    return (
        replace(keypoints, points=undistorted(keypoints.points, camera))
        if needs_undistortion(camera)
        else keypoints
    )


def _model(camera: CalibratedCamera) -> OpenCVModel:
    pinhole = pinhole_of(camera)
    return OpenCVModel(K=pinhole.K, distortion=pinhole.distortion, R=camera.R, t=camera.t, size=camera.size)


def _says(camera: CalibratedCamera) -> str:
    f = float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
    more = f", f {camera.deviation * 100:.0f} % uncertain" if camera.deviation else ""
    place = "" if camera.R is not None and camera.t is not None else ", its place in the world is not known"
    return f"camera {camera.name}: {camera.how}{more}, f {f:.0f} px{place}"
