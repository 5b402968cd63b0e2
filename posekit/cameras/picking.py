"""From detections to the view of one person: who it is, which points count, and what contradicts the calibration."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posekit.cameras.pinhole import PinholeCamera
from posekit.cameras.scaled_orthographic import ScaledOrthographicCamera
from posekit.cameras.tracking import areas, track
from posekit.cameras.view import CameraModel, View
from posekit.errors import refusal, shown
from posekit.geometry import Array, Ints, up_vector
from posekit.skeleton import HEAD, JOINT, JOINTS, POINTS

if TYPE_CHECKING:
    from posekit.cameras.detections import Detections

#: Ways to choose a person without a number.
RULES: Final = ("largest", "surest", "first")
#: Frames a second of a film if neither the file nor the user gives them.
ASSUMED_RATE: Final = 30.0
#: Median coordinate up to which points are fractions of the picture.
FRACTIONS_UP_TO: Final = 3.0
#: Confidence below which a point outside the picture is a tracker's invention (MediaPipe places all 33 landmarks).
INVENTED_BELOW: Final = 0.3
#: Share of points outside the picture from which the picture's size is another's.
OUTSIDE_SHARE: Final = 0.5
#: Shortest focal length, of the picture's longer side: a view of 170 degrees.
SHORTEST_FOCAL: Final = 0.05
#: Longest focal length, of the picture's longer side: a view of half a degree.
LONGEST_FOCAL: Final = 100.0
#: Angle between the person's and the world's upward direction in the picture up to which there is no warning.
UPRIGHT_DEGREES: Final = 45.0
#: Length of the projected unit vector of the world's up axis below which the camera looks up or down.
SEEN_ACROSS: Final = 0.5
#: Height over shoulder width in the picture from which a person is seen from the side; about 4 of an upright one.
SEEN_LONG: Final = 2.5


def points_of(detections: Detections) -> Array:
    """Return the points (N, 19, 2) of joints and head in posekit's order; NaN for those that the layout lacks."""
    return _in_order(detections, detections.points)


def _in_order(detections: Detections, values: Array) -> Array:
    found = np.full((len(values), len(POINTS), *values.shape[2:]), np.nan)
    place = {name: k for k, name in enumerate(detections.names)}
    have = [k for k, name in enumerate(POINTS) if name in place]
    found[:, have] = values[:, [place[POINTS[k]] for k in have]]
    return found


def persons(detections: Detections) -> Ints:
    """Return the person of each detection (N,): the file's own number, else that of tracking.

    In a collection of photographs everybody is somebody else.
    """
    person = np.array(detections.person, dtype=np.intp)
    unknown = person < 0
    if not unknown.any():
        return person
    first = int(person.max(initial=-1)) + 1
    if not detections.film:
        person[unknown] = first + np.arange(int(unknown.sum()))
        return person
    points, frame = points_of(detections)[unknown], detections.frame[unknown]
    person[unknown] = track(points, frame, first, detections.source, detections.time)
    return person


def chosen(detections: Detections, person: str = "", camera_name: str = "") -> Ints:
    """Choose the rows of one person, at most one in a picture.

    Parameters
    ----------
    detections : Detections
    person : str
        Number of a person; ``largest``: who fills most of the pictures; ``surest``: whose confidences sum to most;
        ``first``: the first in the first picture with anybody. ``largest`` by default. In a collection of photographs
        a rule chooses in each.
    camera_name : str
        Name of the camera: its number chooses among the cameras of one file.

    Raises
    ------
    InputError
        If there is no such person.
    """
    numbers, frame = persons(detections), detections.frame
    if not len(numbers):
        raise refusal(detections.source, "person", "nobody in any picture", "a person", "give another file")
    if detections.by_camera and not person.isdecimal():
        ending = re.search(r"\d+\Z", camera_name)
        there = sorted(set(numbers.tolist()))
        if ending is None or int(ending[0]) not in there:
            got = f"points of cameras {', '.join(map(str, there))}"
            remedy = f"give --camera FILE:cam_{there[0]}, or --person"
            raise refusal(detections.source, "person", got, "one of them", remedy)
        person = ending[0]
    rule, worth = person or "largest", -np.arange(len(frame), dtype=np.float64)
    if rule == "largest":
        worth = np.sqrt(np.nan_to_num(areas(points_of(detections))))
    elif rule != "first":
        sure = np.nan_to_num(detections.confidence, nan=1.0)
        worth = np.where(np.isnan(detections.points[..., 0]), 0.0, sure).sum(axis=1)
    if rule in RULES and not detections.film:
        rows = np.arange(len(frame))
    elif rule in RULES:
        people, which = np.unique(numbers, return_inverse=True)
        most = people[int(np.bincount(which, weights=worth).argmax())]
        rows = np.flatnonzero(numbers == (numbers[0] if rule == "first" else most))
    else:
        rows = np.flatnonzero(numbers == (int(rule) if rule.isdecimal() else -1))
        if not len(rows):
            listed = ", ".join(map(str, np.unique(numbers)[:10]))
            expected = f"{', '.join(RULES)}, or a person's number: {listed}"
            remedy = "see who they are with posekit inspect"
            raise refusal(detections.source, "person", shown(rule), expected, remedy)
    rows = rows[np.lexsort((-worth[rows], frame[rows]))]
    return np.asarray(rows[np.diff(frame[rows], prepend=-1) > 0])


def view_of(
    detections: Detections,
    camera: CameraModel,
    person: str,
    rate: float | None,
    min_confidence: float,
    known: Mapping[str, Any],
) -> View:
    """Make the view of one person; see `Detections.view`.

    A film's frames are its pictures, with those that do not show the person; of a collection of photographs only
    those that show the person are kept. Points that a tracker put outside the picture with little confidence are not
    seen. A person who does not stand upright by the calibration is a warning.

    Raises
    ------
    InputError
        If nobody is seen, points are fractions of a picture of unknown size, or the calibration is another picture's.
    """
    size = camera.size if isinstance(camera, PinholeCamera) else None
    rows = chosen(detections, person, camera.name if isinstance(camera, PinholeCamera) else "")
    points = _in_pixels(detections, points_of(detections)[rows], size)
    if isinstance(camera, PinholeCamera):
        _check_picture(detections, camera, points)
    sure = _in_order(detections, detections.confidence)[rows]
    with np.errstate(invalid="ignore"):
        unseen = sure < min_confidence
        pictured = size or detections.size
        if pictured is not None:
            outside = (points < -0.5).any(axis=-1) | (points > np.array(pictured) - 0.5).any(axis=-1)
            unseen |= outside & (sure < INVENTED_BELOW)
    points[unseen] = np.nan
    sure[np.isnan(points[..., 0])] = np.nan
    frame = np.asarray(detections.frame)[rows]
    count = max(len(detections.pictures), int(frame.max()) + 1)
    image, confidence = np.full((count, len(POINTS), 2), np.nan), np.full((count, len(POINTS)), np.nan)
    image[frame], confidence[frame] = points, sure
    seen = ~np.isnan(image[:, : len(JOINTS), 0])
    if not (seen.any() if isinstance(camera, ScaledOrthographicCamera) else seen[:, JOINT["neck"]].any()):
        got = f"no shoulders in any of {count} pictures"
        remedy = "choose another --person or --min-confidence"
        raise refusal(detections.source, "person", got, "both shoulders", remedy)
    for line in (
        *(f"{detections.source}: {line}" for line in detections.warnings),
        *calibration_warnings(camera, points, detections.source),
    ):
        warnings.warn(line, UserWarning, stacklevel=3)
    kept = seen.any(axis=1) | detections.film
    even = np.arange(count) / (rate or detections.rate or ASSUMED_RATE)
    time = even if detections.time is None else np.asarray(detections.time)
    return View(
        camera=camera,
        time=time[kept],
        image=image[kept, : len(JOINTS)],
        head_image=image[kept][:, HEAD],
        confidence=confidence[kept],
        **known,
        derived=tuple(name for name in detections.derived if name in JOINTS and seen[:, JOINT[name]].any()),
        source=detections.source,
        pictures=tuple(np.array(detections.pictures)[kept]) if len(detections.pictures) == count else (),
        layout=detections.layout,
    )


def _in_pixels(detections: Detections, points: Array, size: tuple[int, int] | None) -> Array:
    """Turn fractions of the picture into pixels."""
    known = points[~np.isnan(points[..., 0])]
    if not len(known) or float(np.median(np.abs(known))) > FRACTIONS_UP_TO:
        return points.copy()
    size = size or detections.size
    if size is None:
        got = "points that are fractions of the picture"
        raise refusal(detections.source, "size", got, "the picture's size", "give a camera with its size")
    return np.asarray(points * np.array(size, dtype=np.float64))


def _check_picture(detections: Detections, camera: PinholeCamera, points: Array) -> None:
    """Refuse a calibration of pictures of another size, or in another unit than pixels."""
    known = points[~np.isnan(points[..., 0])]
    name = f"camera {camera.name}" if camera.name else "camera"
    if camera.size is not None and len(known):
        stated = detections.size
        outside = (known < -0.5).any(axis=1) | (known > np.array(camera.size) - 0.5).any(axis=1)
        if outside.mean() > OUTSIDE_SHARE if stated is None else stated != camera.size:
            seen = stated or tuple(int(side) + 1 for side in known.max(axis=0))
            got = f"{camera.size[0]}x{camera.size[1]} pixels, and key points of pictures of {seen[0]}x{seen[1]} or more"
            if stated is not None and stated[::-1] == camera.size:
                got = f"{camera.size[0]}x{camera.size[1]} pixels, width and height exchanged"
            raise refusal(name, "size", got, "these pictures' size", "give the calibration of these pictures")
    focal = float(np.sqrt(camera.K[0, 0] * camera.K[1, 1]))
    side = float(max(camera.size or detections.size or (np.abs(known).max(initial=1.0),)))
    if not SHORTEST_FOCAL * side <= focal <= LONGEST_FOCAL * side:
        expected = f"{SHORTEST_FOCAL:g} to {LONGEST_FOCAL:g} times the picture's longer side"
        raise refusal(name, "K", f"a focal length of {focal:.4g} px", expected, "give K in pixels")


def calibration_warnings(camera: CameraModel, points: Array, source: str = "") -> list[str]:
    """Tell if a person does not stand upright by the camera's calibration, or is upside down in the picture.

    The mean direction from feet to head in the pictures is compared with the projection of the world's up axis. A
    calibration that is camera-to-world, has y up in the camera, or another up axis turns that direction.

    Parameters
    ----------
    camera : CameraModel
    points : array (F, 19, 2)
        One person's, pixels, y down.
    source : str
        File of the key points.

    Returns
    -------
    list of str
        One sentence a contradiction.
    """

    def middle(part: str) -> Array:
        return (points[:, POINTS.index(f"right_{part}")] + points[:, POINTS.index(f"left_{part}")]) / 2

    ways = [middle("shoulder") - middle("hip"), middle("hip") - middle("ankle")]
    long = np.array([float(np.nanmedian(np.hypot(*way.T))) if np.isfinite(way).any() else 0 for way in ways])
    person = np.zeros(2)
    for way, extent in zip(ways, long, strict=True):
        known = way[np.isfinite(way).all(axis=1)]
        if len(known) and extent > 0:
            person += np.median(known / np.linalg.norm(known, axis=1, keepdims=True), axis=0)
    if not np.linalg.norm(person) > 0:
        return []
    world = np.array([0.0, -1.0])
    calibrated = isinstance(camera, PinholeCamera) and camera.R is not None and bool(camera.up)
    if calibrated and isinstance(camera, PinholeCamera):
        world = (camera.R @ up_vector(camera.up))[:2]  # type: ignore[operator]
        if np.linalg.norm(world) < SEEN_ACROSS:  # the camera looks down: upright people are seen short
            across = points[:, POINTS.index("right_shoulder")] - points[:, POINTS.index("left_shoulder")]
            width = np.hypot(*across[np.isfinite(across).all(axis=1)].T)
            if not len(width) or long.sum() < SEEN_LONG * float(np.median(width)):
                return []
            world = np.array([person[1], -person[0]])  # at a right angle to the person, who lies
    cosine = float(person @ world / (np.linalg.norm(person) * np.linalg.norm(world)))
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    if calibrated and isinstance(camera, PinholeCamera) and angle > UPRIGHT_DEGREES:
        stands = "stands on the head" if angle > 180 - UPRIGHT_DEGREES else "lies"
        return [
            f"{source}: the person {stands} by the calibration of {camera.name or 'the camera'} ({angle:.0f} degrees "
            f"from its up axis {camera.up}); check that rotation and translation map world to camera with y down in "
            "the picture, and that this axis points up, unless the person really does"
        ]
    if not calibrated and angle > 180 - UPRIGHT_DEGREES:
        return [
            f"{source}: the person is upside down in the pictures; check that y points down in the file, and turn the "
            "points if it does not"
        ]
    return []
