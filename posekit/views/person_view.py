"""From one person's key points to a view: the landmarks that a detector has, and the two joints that it has not."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.body.lengths import hips_points, torso_points
from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints
from posekit.formats.own import CameraModel, ScaledOrthographicModel, Unit, View
from posekit.formats.skeleton_maps import LANDMARK_INDEX
from posekit.geometry import Array
from posekit.skeleton import HEAD, JOINT, JOINTS, POINTS

ASSUMED_VIEW_RATE: Final = 30.0
"""Frames a second that are assumed where neither the file nor the user says."""

MIDDLE_LANDMARKS: Final = ("mid_shoulders", "mid_hips")


def person_view(
    keypoints: KeyPoints,
    camera: CameraModel,
    person: Figure,
    *,
    rate: float | None = None,
    minimum_confidence: float = 0.0,
    deviation: float | None = None,
    length_deviation: float | None = None,
    unit: Unit = "m",
) -> View:
    """Make a view of one person's key points.

    The neck that a detector lacks is put at the middle of the shoulders, the pelvis on the line from there to the
    middle of the hips where the figure's own is when it stands straight. Both are put in the image: a bent spine and
    the perspective of turned girdles move them by a centimetre or two.

    Parameters
    ----------
    keypoints : KeyPoints
        At most one detection a picture, in pixels.
    camera : OpenCVModel or ScaledOrthographicModel
        The camera that saw them.
    person : Figure
        With the person's lengths.
    rate : float, optional
        Frames a second, where the file has no times.
    minimum_confidence : float
        Points that are less sure count as not seen; those without a confidence are kept.
    deviation : float, optional
        Standard deviation of each coordinate of the points, pixels.
    length_deviation : float, optional
        Relative standard deviation of the person's lengths.
    unit : {"m", "cm", "mm"}
        Of the view's file.

    Returns
    -------
    View
        Of all pictures of a sequence, those included that do not show the person: frames are pictures, in number and
        in time. Of a collection of photographs, in which nobody is in all, those that show any joint of the person.

    Raises
    ------
    InputError
        Where points are fractions of a picture of unknown size, a picture has two people, or no picture has a neck.
    """
    if keypoints.normalised:
        raise InputError(
            f"{keypoints.source}: points are fractions of the picture, whose size is not known; expected pixels; "
            "give --size WIDTHxHEIGHT"
        )
    if (np.diff(keypoints.frame) == 0).any():
        row = int(np.argmax(np.diff(keypoints.frame) == 0))
        picture = keypoints.pictures[int(keypoints.frame[row])]
        raise InputError(
            f"{keypoints.source}: {picture}: more than one person; expected one; choose with --person"
        )
    found = keypoints.landmarks
    sure = keypoints.landmark_confidence
    found[sure < minimum_confidence] = np.nan
    sure = np.where(np.isnan(found[..., 0]), np.nan, sure)
    derived = _complete(found, sure, person)
    count = len(keypoints.pictures)
    points = np.full((count, len(POINTS), 2), np.nan)
    confidence = np.full((count, len(POINTS)), np.nan)
    points[keypoints.frame] = found[:, : len(POINTS)]
    confidence[keypoints.frame] = sure[:, : len(POINTS)]
    seen = np.isfinite(points[:, : len(JOINTS), 0])
    needs_neck = not isinstance(camera, ScaledOrthographicModel)
    if not (seen[:, JOINT["neck"]] if needs_neck else seen).any():
        needed = "both shoulders, between which the neck is, are" if needs_neck else "joints are"
        raise InputError(
            f"{keypoints.source}: {needed} seen in none of {plural(count, 'picture')}; expected at least one; "
            "choose another "
            "--person, or a smaller --min-confidence"
        )
    kept = seen.any(axis=1) | keypoints.sequence
    return View(
        camera=camera,
        time=times(keypoints, rate)[kept],
        image=points[kept, : len(JOINTS)],
        head_image=points[kept][:, HEAD],
        confidence=confidence[kept],
        deviation=deviation,
        length_deviation=length_deviation,
        derived=derived,
        lengths=person.lengths,
        unit=unit,
    )


def times(keypoints: KeyPoints, rate: float | None) -> Array:
    """Return the time of each picture (F,): the file's own, unless a rate is given or it has none."""
    if rate is None and np.isfinite(keypoints.time).all():
        return keypoints.time
    return np.arange(len(keypoints.pictures)) / (rate or ASSUMED_VIEW_RATE)


def _complete(found: Array, sure: Array, person: Figure) -> tuple[str, ...]:
    """Put neck and pelvis into landmarks (D, 21, 2) that lack them, and their confidence (D, 21); say which."""
    derived = []
    shoulders, hips = (found[:, LANDMARK_INDEX[name]] for name in MIDDLE_LANDMARKS)
    fraction = pelvis_fraction(person)
    places = {"neck": shoulders, "pelvis": shoulders + fraction * (hips - shoulders)}
    both = sure[:, [LANDMARK_INDEX[name] for name in MIDDLE_LANDMARKS]]
    certain = {"neck": both[:, 0], "pelvis": both.mean(axis=1)}
    for name, place in places.items():
        lacking = np.isnan(found[:, LANDMARK_INDEX[name], 0])
        if np.isfinite(place[lacking]).any():
            derived.append(name)
        found[lacking, LANDMARK_INDEX[name]] = place[lacking]
        sure[lacking, LANDMARK_INDEX[name]] = certain[name][lacking]
    return tuple(derived)


def pelvis_fraction(person: Figure) -> float:
    """Tell where the pelvis joint is on a straight spine: 0 between the shoulders, 1 between the hips."""
    _, right, left, pelvis = torso_points(person.lengths)
    _, right_hip, left_hip = hips_points(person.lengths)
    above = float(np.linalg.norm((right + left) / 2 - pelvis))
    below = float(np.linalg.norm((right_hip + left_hip) / 2))
    return above / (above + below)
