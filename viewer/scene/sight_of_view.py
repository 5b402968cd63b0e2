"""What the camera of a frame sees: of a result with its view, of a result alone, of a view with its truth."""

from __future__ import annotations

import numpy as np

from posekit.cameras import PinholeCamera, ScaledOrthographicCamera, lee_chen
from posekit.errors import ViewerError
from posekit.formats.own import LeeChenModel, OpenCVModel, Result, ResultFrame, ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS
from posekit.viewer.scene.image_sight import ImageSight

ON_RAY = 1e-6
"""Metres across the image within which all positions of a joint are one image point."""


def sight_of(
    frame: ResultFrame, view: View | None, index: int, camera: OpenCVModel | None = None
) -> ImageSight | None:
    """Return what a frame's camera sees: the view's image, or without a view that of the first survivor.

    Parameters
    ----------
    frame : ResultFrame
        The survivors.
    view : View, optional
        What they were recovered from.
    index : int
        The frame's number in the view.
    camera : OpenCVModel, optional
        The calibrated camera that the result holds.
    """
    f = frame.camera["f"]
    scale = float(frame.scales[0]) if frame.scales is not None and len(frame.scales) else None
    if view is not None:
        image = np.concatenate([view.image[index], view.head_image[index]])
        return view_sight(view, image, f, scale)
    if scale is not None:
        uncalibrated = ScaledOrthographicCamera(scale=scale)
        image = uncalibrated.project(frame.joints[:1])[0]
        image[[JOINT[name] for name in hidden(frame)]] = np.nan
        return ImageSight(camera=uncalibrated, image=image)
    if camera is not None and len(frame.joints):
        pinhole = PinholeCamera(K=camera.K, distortion=camera.distortion)
        image = pinhole.project(frame.joints[:1])[0]
        image[[JOINT[name] for name in hidden(frame)]] = np.nan
        return ImageSight(camera=pinhole, image=image, size=camera.size)
    if f is None or len(frame.joints) == 0:
        return None
    one = lee_chen.pinhole(f)
    return ImageSight(camera=one, image=one.project(frame.joints[:1])[0])  # all survivors have one image


def view_sight(view: View, image: Array, f: float | None, scale: float | None) -> ImageSight | None:
    """Return the view's camera with an image; None where f or the scale is not known."""
    model = view.camera
    if isinstance(model, OpenCVModel):
        return ImageSight(
            camera=PinholeCamera(K=model.K, distortion=model.distortion), image=image, size=model.size
        )
    if isinstance(model, LeeChenModel):
        f = model.f if f is None else f
        return None if f is None else ImageSight(camera=lee_chen.pinhole(f), image=image)
    scale = model.scale if scale is None else scale
    if scale is None or not np.isfinite(image).all(axis=1).any():
        return None
    return ImageSight(camera=ScaledOrthographicCamera(scale=scale, aspect=model.aspect), image=image)


def scale_of(truth: Array, view: View, index: int) -> float | None:
    """Measure the scale of an uncalibrated view whose truth is known: its image by its truth, least squares."""
    model = view.camera
    if not isinstance(model, ScaledOrthographicModel) or model.scale is not None:
        return None
    image = view.image[index] * [model.aspect, 1.0]
    both = np.isfinite(truth).all(axis=1) & np.isfinite(image).all(axis=1)
    if both.sum() < 2:
        return None
    seen, flat = (values[both] - values[both].mean(axis=0) for values in (image, truth[:, :2]))
    extent = float((flat * flat).sum())
    scale = float((seen * flat).sum()) / extent if extent > 0 else 0.0
    return scale if np.isfinite(scale) and scale > 0 else None


def hidden(frame: ResultFrame) -> list[str]:
    """Name the joints of which the image shows nothing: those that are inferred, and not along a ray alone."""
    found: dict[str, bool] = {}
    for joints in frame.inferred or ():
        for name, one in joints.items():
            on_ray = bool((one.upper - one.lower)[:2].max() < ON_RAY < one.upper[2] - one.lower[2])
            found[name] = found.get(name, True) and not on_ray
    return [name for name in JOINTS if found.get(name)]


def check_camera(result: Result, view: View) -> None:
    """Refuse a view of a calibrated camera beside an uncalibrated result, and the reverse.

    Raises
    ------
    ViewerError
        Where they do not go together.
    """
    uncalibrated = any(frame.family is not None for frame in result.frames)
    if uncalibrated != isinstance(view.camera, ScaledOrthographicModel):
        was, other = ("an uncalibrated", "calibrated") if uncalibrated else ("a calibrated", "uncalibrated")
        raise ViewerError(
            f"the result is of {was} picture, the view's camera is {other}; give the view that it was recovered from"
        )
