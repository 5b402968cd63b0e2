"""Table 2 of Lee & Chen 1985 again: the camera and the head from six points."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from posekit.cameras import lee_chen
from posekit.cameras.head import TABLE_A2, HeadPoints, calibrate, dlt
from posekit.geometry import Array
from posekit.papers import lee_chen_printed as printed

F = 0.05
MISPRINTED_EYE_X = -32.168
"""Table A.2(a)'s x of the right eye, centimetres; it does not give its own image point."""


@dataclass(frozen=True, kw_only=True)
class CameraEstimate:
    """One way to the camera, in the paper's terms, centimetres.

    Parameters
    ----------
    way : str
        How the camera was found, as the table's row is called.
    f : float
        Focal length.
    position : array (3,)
        Where the camera stands, head-centred frame.
    off : float
        Distance of the position from (400, 0, 0).
    misfit : str or None
        The head point that was named as not fitting the others.
    """

    way: str
    f: float
    position: Array
    off: float
    misfit: str | None = None


def exact_image(head: HeadPoints = TABLE_A2) -> Array:
    """Project Table A.2(a) exactly into the camera at (400, 0, 0): (6, 2), metres, y down."""
    R = np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])
    points = head.points @ R.T + [0.0, 0.0, 4.0 + F]
    return np.asarray(lee_chen.pinhole(F).project(points[None])[0])


def camera_estimates() -> list[CameraEstimate]:
    """Estimate the camera of frame 1 of SEQ1 in each way that the report sets side by side."""
    rounded = lee_chen.image_from_paper(printed.IMAGE_A2 / 100)
    eye = TABLE_A2.points[TABLE_A2.index("right_eye")] * [0, 1, 1] + [MISPRINTED_EYE_X / 100, 0, 0]
    misprinted = TABLE_A2.with_points({"right_eye": eye})
    return [
        _refined("exact projections, f free", TABLE_A2, exact_image(), None),
        _refined("printed digits, f free", TABLE_A2, rounded, None),
        _refined("printed digits, f = 5 cm known", TABLE_A2, rounded, F),
        _linear("printed digits, linear solution alone", TABLE_A2, rounded),
        _refined("printed digits, right eye as misprinted", misprinted, rounded, None),
        _linear("the same, linear solution alone", misprinted, rounded),
    ]


def exact_tables() -> dict[str, Array]:
    """Return Table 2(a)-(d) from exact projections, in the paper's frames, centimetres."""
    pose = calibrate(TABLE_A2, exact_image())
    R, t, f = pose.R_cam_head[0], pose.t_cam_head[0], float(pose.f[0])
    T = lee_chen.transformation_matrix(R, t * 100, f * 100)
    return {
        "T": T,
        "R": lee_chen.rotation_to_paper(R),
        "position": lee_chen.camera_position(R, t, f) * 100,
        "head": lee_chen.points_to_paper(pose.points_cam[0], f) * 100,
    }


def _refined(way: str, head: HeadPoints, image: Array, f: float | None) -> CameraEstimate:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the report names the misfit in its own column
        pose = calibrate(head, image, f)
    position = lee_chen.camera_position(pose.R_cam_head[0], pose.t_cam_head[0], float(pose.f[0]))
    return _estimate(way, float(pose.f[0]), position, pose.misfit[0])


def _linear(way: str, head: HeadPoints, image: Array) -> CameraEstimate:
    camera = dlt(head, image)
    f = float(camera.f[0])
    return _estimate(way, f, lee_chen.camera_position(camera.R[0], camera.t[0], f), None)


def _estimate(way: str, f: float, position: Array, misfit: str | None) -> CameraEstimate:
    off = float(np.linalg.norm(position - [4.0, 0.0, 0.0]))
    return CameraEstimate(way=way, f=f * 100, position=position * 100, off=off * 100, misfit=misfit)
