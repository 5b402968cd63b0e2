"""From a view back to key points, for other programs."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints, chosen
from posekit.formats.own import LeeChenModel, OpenCVModel, View
from posekit.formats.skeleton_maps import LANDMARK, LANDMARKS, load_skeleton_map
from posekit.geometry import Array
from posekit.skeleton import HEAD, JOINT, JOINTS

UNNAMED: Final = "coco_17"
"""The names that points are given in a format whose files name them as their users like."""


def view_keypoints(view: View, format: str, skeleton: str = "") -> KeyPoints:
    """Make key points of a view's image points.

    Parameters
    ----------
    view : View
        In pixels.
    format : str
        The format they are for: its first skeleton map is taken if none is named.
    skeleton : str
        A skeleton map by name or file. What it has no point for is left out: mostly neck and pelvis.

    Raises
    ------
    InputError
        Where the view's image points are no pixels.
    """
    if isinstance(view.camera, LeeChenModel):
        raise InputError(
            "camera.model is lee-chen, whose image points are lengths; expected pixels: an opencv camera"
        )
    one, layout = chosen(format)
    if skeleton:
        layout = load_skeleton_map(skeleton)
    elif layout is None:
        layout = load_skeleton_map(one.skeletons[0] if one.skeletons else UNNAMED)
    points = _landmarks(np.concatenate([view.image, view.head_image], axis=1))
    sure = _landmarks(view.confidence[..., None])
    size = view.camera.size if isinstance(view.camera, OpenCVModel) else None
    known = np.full((len(view), 2), np.nan if size is None else 0.0) + (size or (0.0, 0.0))
    return KeyPoints(
        format=format,
        source="view",
        layout=layout,
        pictures=tuple(f"{k:06d}" for k in range(len(view))),
        size=known,
        time=view.time,
        frame=np.arange(len(view)),
        person=np.zeros(len(view), dtype=np.intp),
        points=layout.scatter(points),
        confidence=layout.scatter(sure)[..., 0],
    )


def _landmarks(values: Array) -> Array:
    """Add the girdles' middles to joints and head points (F, 19, n)."""
    found = np.full((len(values), len(LANDMARKS), values.shape[-1]), np.nan)
    found[:, : len(JOINTS) + len(HEAD)] = values
    for middle, part in (("mid_shoulders", "shoulder"), ("mid_hips", "hip")):
        sides = [JOINT[f"{side}_{part}"] for side in ("right", "left")]
        found[:, LANDMARK[middle]] = values[:, sides].mean(axis=1)
    return found
