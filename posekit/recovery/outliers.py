"""Key points that are no joint's: a wrist on the other wrist, an ankle that jumps to something else and back.

A point that is off by many deviations says nothing of its joint: it is taken for not seen, and the joint is where the
rest leaves it. Two things tell: a point that leaves its way for a picture or two of a video (Hampel 1974, "The
influence curve and its role in robust estimation", JASA 69:383: so many median deviations from the median of its
neighbours), and a frame that has no posture unless the point is left out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.formats.own import View
from posekit.geometry import Array
from posekit.recovery.fit_camera import fit_camera
from posekit.skeleton import JOINT, JOINTS

if TYPE_CHECKING:
    from posekit.recovery.refiner import Refiner
    from posekit.recovery.trees import FrameTrees

DOUBTED_JOINTS: Final = tuple(
    f"{side}_{joint}" for joint in ("wrist", "ankle", "elbow", "knee") for side in ("right", "left")
)
"""Joints whose points may be no joint's, in the order in which frames are asked: those that move most first."""

FEW_FRAMES: Final = 3
"""Frames without a posture, and ..."""

FEW_SHARE: Final = 0.15
"""... what share of them, up to which they are asked without single points."""

NEIGHBOUR_PICTURES: Final = 2
"""Pictures before and after with which a picture is compared."""

VIDEO_SECONDS: Final = 0.1
"""Seconds between pictures up to which neighbours tell where a point is."""

JUMP_DEVIATIONS: Final = 6.0
"""Deviations of a point, and beside them ..."""

JUMP_SPREADS: Final = 4.0
"""... median distances of its neighbours from their median, beyond which it jumps."""


def grow_trusted(refiner: Refiner, frames: NDArray[np.intp]) -> dict[int, FrameTrees]:
    """Grow frames of a detector's view: points that jump are left out, and what else keeps a frame from any posture.

    Trees name the joints of the points that were not believed. A frame that has no posture without any one of its
    points stays as it was.
    """
    jumping = jumps(refiner.grower.view, point_deviations(refiner))
    jumping[np.setdiff1d(np.arange(len(jumping)), frames)] = False
    jumpy: NDArray[np.intp] = np.flatnonzero(jumping.any(axis=1))
    trees = refiner.grow(np.setdiff1d(frames, jumpy))
    if len(jumpy):
        found = _placed_without(refiner, jumping, jumpy) or refiner.grow(jumpy)
        trees |= {k: replace(one, outliers=_names(jumping[k])) for k, one in found.items()}
    lost = [k for k in frames.tolist() if not trees[k].survivors]
    if len(lost) > max(FEW_FRAMES, FEW_SHARE * len(frames)):
        return trees  # of so many not a point is off, but the body
    for name in DOUBTED_JOINTS:
        doubted = np.array([k for k in lost if _seen(refiner, k, name)], dtype=np.intp)
        if len(doubted):
            without = jumping.copy()
            without[doubted, JOINT[name]] = True
            for k, one in _placed_without(refiner, without, doubted).items():
                if one.survivors:
                    trees[k] = replace(one, outliers=_names(without[k]))
                    lost.remove(k)
    return trees


def unseen(refiner: Refiner, points: NDArray[np.bool_]) -> Refiner:
    """Return what takes some points (F, 14) of its view for not seen."""
    if not points.any():
        return refiner
    view = refiner.grower.view
    image = np.where(points[..., None], np.nan, view.image)
    return replace(refiner, grower=replace(refiner.grower, view=replace(view, image=image)))


def _placed_without(
    refiner: Refiner, points: NDArray[np.bool_], frames: NDArray[np.intp]
) -> dict[int, FrameTrees]:
    """Grow some frames without some of their points, their necks placed without them too: nothing where none can be."""
    blind = unseen(refiner, points)
    view, asked = blind.grower.view, refiner.grower.settings.rooting
    alone = np.full_like(view.image, np.nan)
    alone[frames] = view.image[frames]
    try:
        fit = fit_camera(
            replace(view, image=alone), blind.grower.body.figure, asked, None, refiner.noise.lengths
        )
    except InputError:
        return {}
    return replace(blind, grower=replace(blind.grower, fit=fit)).grow(frames)


def point_deviations(refiner: Refiner) -> Array:
    """Return the standard deviation of each point (F, 14), pixels; NaN in frames whose neck is nowhere."""
    view, fit = refiner.grower.view, refiner.fit
    out = np.full((len(view), len(JOINTS)), np.nan)
    rows = np.flatnonzero(np.isfinite(fit.root).all(axis=1))
    if len(rows):
        K = np.broadcast_to(fit.cameras(rows).K, (len(rows), 3, 3))  # type: ignore[attr-defined]
        focal = np.sqrt(K[:, 0, 0] * K[:, 1, 1])
        frames = fit.frame[rows]
        out[frames] = refiner.noise.of_points(view, frames, fit.root[rows, 2], focal)[:, : len(JOINTS)]
    return out


def jumps(view: View, deviation: Array) -> NDArray[np.bool_]:
    """Tell which points of limbs (F, 14) leave their way for a picture or two of a video, and come back.

    Parameters
    ----------
    view : View
        In the order of time.
    deviation : array (F, 14)
        Standard deviations of the points, pixels.
    """
    count, width = len(view), 2 * NEIGHBOUR_PICTURES + 1
    out = np.zeros((count, len(JOINTS)), dtype=np.bool_)
    if count < width or float(np.median(np.diff(view.time))) > VIDEO_SECONDS:
        return out
    doubted = [JOINT[name] for name in DOUBTED_JOINTS]
    first = np.clip(np.arange(count) - NEIGHBOUR_PICTURES, 0, count - width)
    window = view.image[first[:, None] + np.arange(width)][:, :, doubted]
    known = np.isfinite(window).all(axis=(1, 3))
    middle = np.median(window, axis=1, keepdims=True)
    spread = np.median(np.linalg.norm(window - middle, axis=3), axis=1)
    off = np.linalg.norm(view.image[:, doubted] - middle[:, 0], axis=2)
    with np.errstate(invalid="ignore"):
        out[:, doubted] = known & (off > JUMP_DEVIATIONS * deviation[:, doubted] + JUMP_SPREADS * spread)
    return out


def _names(points: NDArray[np.bool_]) -> tuple[str, ...]:
    return tuple(JOINTS[j] for j in np.flatnonzero(points))


def _seen(refiner: Refiner, frame: int, joint: str) -> bool:
    return bool(np.isfinite(refiner.grower.view.image[frame, JOINT[joint], 0]))
