"""Contradictions between a calibration and its pictures: a different picture size, or people who are not upright."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.cameras import CameraModel, PinholeCamera
from posekit.errors import refusal
from posekit.geometry import Array, unit, up_vector
from posekit.skeleton import POINTS

#: Fraction of points outside the picture above which the calibration's picture size counts as wrong.
OUTSIDE_SHARE: Final = 0.5
#: Shortest and longest accepted focal length, in units of the picture's longer side: angles of view of 170 degrees and
#: of half a degree.
SHORTEST_FOCAL, LONGEST_FOCAL = 0.05, 100.0
#: Largest angle between the upward directions of person and world in the picture for which there is no warning.
UPRIGHT_DEGREES: Final = 45.0
#: Length of the projected unit vector of the world's up axis below which the camera looks up or down.
SEEN_ACROSS: Final = 0.5
#: Height over shoulder width in the picture above which a person is seen from the side; an upright person has about 4.
SEEN_LONG: Final = 2.5


def check_pictures(camera: PinholeCamera, points: Array, size: tuple[int, int] | None) -> None:
    """Refuse a calibration that was made for pictures of another size, or whose unit is not pixels.

    Parameters
    ----------
    camera : PinholeCamera
    points : array (F, 19, 2)
        Pixels.
    size : (int, int), optional
        Width and height of the pictures, if the key points' file states them.
    """
    known = points[~np.isnan(points[..., 0])]
    name = f"camera {camera.name}" if camera.name else "camera"
    if camera.size is not None and len(known):
        outside = ((known < -0.5) | (known > np.array(camera.size) - 0.5)).any(axis=1)
        if size != camera.size if size else outside.mean() > OUTSIDE_SHARE:
            seen = size or tuple(int(side) + 1 for side in known.max(axis=0))
            got = f"{camera.size[0]}x{camera.size[1]} pixels, and key points of pictures of {seen[0]}x{seen[1]} or more"
            raise refusal(name, "size", got, "these pictures' size", "give the calibration of these pictures")
    focal = float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
    side = float(max(camera.size or size or (np.abs(known).max(initial=1.0),)))
    if not SHORTEST_FOCAL * side <= focal <= LONGEST_FOCAL * side:
        expected = f"{SHORTEST_FOCAL:g} to {LONGEST_FOCAL:g} times the picture's longer side"
        raise refusal(name, "K", f"a focal length of {focal:.4g} px", expected, "give K in pixels")


def contradictions(camera: CameraModel, points: Array) -> list[str]:
    """List contradictions: the calibration implies that the person is not upright, or the person is upside down.

    The mean direction from feet to head in the pictures is compared with the projection of the world's up axis. Usual
    causes of a difference are a rotation from camera to world instead of world to camera, a camera axis y that points
    up, and a wrong up axis.

    Parameters
    ----------
    camera : CameraModel
    points : array (F, 19, 2)
        Points of one person, pixels, y down.

    Returns
    -------
    list of str
        One sentence for each contradiction.
    """
    part = {name: points[:, k] for k, name in enumerate(POINTS)}
    middle = {
        name: (part[f"right_{name}"] + part[f"left_{name}"]) / 2 for name in ("shoulder", "hip", "ankle")
    }
    across = part["right_shoulder"] - part["left_shoulder"]
    ways = [middle["shoulder"] - middle["hip"], middle["hip"] - middle["ankle"], across]
    trunk, legs, across = (way[np.isfinite(way).all(axis=1) & way.any(axis=1)] for way in ways)
    person = sum((np.median(unit(way), axis=0) for way in (trunk, legs) if len(way)), np.zeros(2))
    if not person.any():
        return []
    up, calibrated, axis = np.array([0.0, -1.0, 0.0]), "", ""
    if isinstance(camera, PinholeCamera) and camera.R is not None and camera.up:
        up = camera.R @ up_vector(camera.up)
        calibrated, axis = f"the calibration of {camera.name or 'the camera'}", f"its up axis {camera.up}"
    world = up[:2]
    if np.linalg.norm(world) < SEEN_ACROSS:  # the camera looks down, so that upright people appear short
        long = sum(float(np.median(np.linalg.norm(way, axis=1))) for way in (trunk, legs) if len(way))
        if not len(across) or long < SEEN_LONG * float(np.median(np.linalg.norm(across, axis=1))):
            return []
        world = np.array([person[1], -person[0]])  # perpendicular to the person, who appears to lie
    angle = float(np.degrees(np.arccos(np.clip(unit(person) @ unit(world), -1, 1))))
    if calibrated and angle > UPRIGHT_DEGREES:
        stands = "stands on the head" if angle > 180 - UPRIGHT_DEGREES else "lies"
        return [
            f"the person {stands} by {calibrated} ({angle:.0f} degrees from {axis}); check that rotation and "
            "translation map world to camera with y down in the picture, and that this axis points up, unless the "
            "person really does"
        ]
    if angle > 180 - UPRIGHT_DEGREES:
        return [
            "the person is upside down in the pictures; check that y points down in the file, and turn the points if "
            "it does not"
        ]
    return []
