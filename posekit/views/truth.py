"""Truth from another file: its world is turned to the camera's, and its frames are matched to the pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Final

import numpy as np

from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.formats.own import CameraModel, OpenCVModel, View
from posekit.geometry import Array
from posekit.skeleton import JOINTS

REFUSED_ERROR_SHARE: Final = 0.2
"""Fraction of the person's height in the image by which a truth may miss the key points before it is another's."""


def _turns() -> Array:
    """Return the 24 rotations (24, 3, 3) that map axes to axes."""
    found = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) > 0:
                found.append(turn)
    return np.array(found)


AXIS_TURNS: Final = _turns()


@dataclass(frozen=True, kw_only=True)
class AlignedTruth:
    """How a truth was laid onto a view.

    Parameters
    ----------
    turn : str
        Which axes of the truth are x, y and z of the camera's world, as ``(z, x, y)``.
    error : float
        Median distance in the image between the truth and the key points, pixels.
    frames : int
        How many of the view's frames have a truth.
    """

    turn: str
    error: float
    frames: int


def with_truth(view: View, joints: Array, time: Array) -> tuple[View, AlignedTruth]:
    """Give a view its truth from motion capture of the same seconds.

    Axes are reconciled by the image: of the 24 ways to lay one set of axes onto another, the one whose projection is
    nearest to the key points. Lengths are metres in both.

    Parameters
    ----------
    view : View
        Of a camera with R and t.
    joints : array (T, 14, 3)
        In the truth's own world, metres; NaN where not known.
    time : array (T,)
        Seconds; the first frame is the view's second 0.

    Raises
    ------
    InputError
        Where the camera has no R and t, no frame matches, or no turn brings the truth near the key points.
    """
    true = np.full((len(view), len(JOINTS), 3), np.nan)
    since = time - time[0]
    steps = [float(np.median(np.diff(each))) for each in (since, view.time) if len(each) > 1]
    nearest = np.abs(since[None] - view.time[:, None]).argmin(axis=1)
    matched = np.abs(since[nearest] - view.time) <= 0.51 * min(steps, default=np.inf)
    true[matched] = joints[nearest[matched]]
    if not np.isfinite(true).any():
        raise InputError(
            f"--truth: none of its {len(time)} frames is at the time of a picture; expected the same seconds from the "
            "first picture on; say the pictures' rate with --fps"
        )
    turned, told = turned_before(view.camera, view.image, true)
    return replace(view, truth=turned), replace(told, frames=int(matched.sum()))


def turned_before(model: CameraModel | None, image: Array, true: Array) -> tuple[Array, AlignedTruth]:
    """Turn a truth's axes into those of the camera's world, by the image, and bring it into the camera's frame.

    Parameters
    ----------
    model : OpenCVModel
        Its place in the world is known.
    image : array (F, 14, 2)
        Where the joints are seen, pixels; NaN where not known.
    true : array (F, 14, 3)
        In the truth's own world, metres; NaN where not known.

    Returns
    -------
    joints, told
        In the camera's frame (F, 14, 3), metres, and how they were laid.

    Raises
    ------
    InputError
        Where the camera has no R and t, or no turn brings the truth near the image.
    """
    if not isinstance(model, OpenCVModel) or model.R is None or model.t is None:
        raise InputError(
            "--truth: the camera's place in the world is not known; expected R and t: give a calibration that has them"
        )
    camera = PinholeCamera(K=model.K, distortion=model.distortion)
    turned = np.einsum("kij,fpj->kfpi", AXIS_TURNS, true) @ model.R.T + model.t
    away = np.linalg.norm(camera.project(turned) - image, axis=-1).reshape(len(AXIS_TURNS), -1)
    in_front = np.isfinite(away).sum(axis=1)
    errors = [
        float(np.nanmedian(row)) if n == max(in_front) > 0 else np.inf
        for row, n in zip(away, in_front, strict=True)
    ]
    best = int(np.argmin(errors))
    seen = image[np.isfinite(image[..., 1]).any(axis=1), :, 1]
    height = float(np.median(np.nanmax(seen, axis=1) - np.nanmin(seen, axis=1)))
    if not errors[best] <= REFUSED_ERROR_SHARE * height:
        raise InputError(
            f"--truth: misses the key points by {errors[best]:.3g} px (median) however its axes are turned; expected "
            "the same person, camera and seconds; check --person, --camera and --fps"
        )
    turn = AXIS_TURNS[best]
    names = [("" if row[abs(row).argmax()] > 0 else "-") + "xyz"[int(abs(row).argmax())] for row in turn]
    frames = int(np.isfinite(true).any(axis=(1, 2)).sum())
    return turned[best], AlignedTruth(turn=f"({', '.join(names)})", error=errors[best], frames=frames)
