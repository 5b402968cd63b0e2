"""Numbers that decide who is who in a film and whether a calibration is that of its pictures, from both sides."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import posekit
from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.skeleton import JOINT, POINTS
from tests.test_published import COCO

WIDTH, HEIGHT, FOCAL = 1280, 720, 1000.0
FIGURE = posekit.load_figure()
FORWARD, LEFT, UP = FIGURE.neutral_points.T
PERSON = np.stack([LEFT, -UP], axis=1) / 4.0 * FOCAL
PERSON += np.array([WIDTH, HEIGHT]) / 2 - (PERSON.min(axis=0) + PERSON.max(axis=0)) / 2
"""Key points (19, 2) of a person 4 m in front of a camera, pixels, y down."""


def area(points: np.ndarray) -> float:
    """Return the area of a person: 0.53 of the box around the points that are compared, at least a quarter as wide."""
    width, height = np.ptp(
        points[[k for k, name in enumerate(POINTS) if name not in ("neck", "pelvis")]], axis=0
    )
    return 0.53 * height * max(width, height / 4)


def similarity(away: float, motion: float) -> float:
    """Return the similarity of two places, `away` apart in square roots of the area, by COCO's deviations."""
    spread = np.array(
        [2 * COCO[name.rpartition("_")[2]] for name in POINTS if name not in ("neck", "pelvis")]
    )
    return float(np.exp(-(away**2) / (2 * (spread**2 + motion**2))).mean())


def people(rows: list[tuple[int, np.ndarray]], time: list[float] | None = None) -> list[int]:
    """Return who is who in rows of a picture's number and a person's points."""
    frame, points = [k for k, _ in rows], np.stack([row for _, row in rows])
    return posekit.Detections(points=points, names=POINTS, frame=frame, time=time).people().tolist()


@pytest.mark.parametrize(("before", "fresh"), [(1, 3.0), (2, 1.0)], ids=["seen once", "seen twice"])
@pytest.mark.parametrize("gap", [1, 4, 12])
@pytest.mark.parametrize("timed", [False, True])
def test_who_moves_as_far_as_people_do_is_the_same_person(
    before: int, fresh: float, gap: int, timed: bool
) -> None:
    """A person moves by 0.12 a picture, thrice as far if the velocity is not known; 8 pictures are looked ahead.

    A picture of a video lasts 1/30 s: a longer step counts as several pictures.
    """
    motion = 0.12 * fresh * min(gap, 8)
    bound = brentq(lambda away: similarity(away, motion) - 0.15, 0.01, 20.0)
    velocity = np.array([5.0, 0.0])
    other = PERSON + np.array([5e4, 0.0])
    for share in (0.99, 1.01):
        rows = [(k, person) for k in range(before) for person in (PERSON + k * velocity, other)]
        ahead = (before - 1 + (min(gap, 8) if before > 1 else 0)) * velocity
        last = before if timed else before - 1 + gap
        time = [*(k / 30 for k in range(before)), (before - 1 + gap) / 30] if timed else None
        there = PERSON + ahead + share * bound * np.sqrt(area(PERSON)) * np.array([0.6, 0.8])
        rows += [(last, there), (last, other)]
        assert people(rows, time) == [0, 1] * before + ([0, 1] if share < 1 else [2, 1])


@pytest.mark.parametrize(("gap", "same"), [(31, True), (32, False)])
@pytest.mark.parametrize("alone", [True, False])
def test_an_unseen_person_is_kept_for_thirty_pictures(gap: int, same: bool, alone: bool) -> None:
    other = PERSON + np.array([5e4, 0.0])
    rows = [(k, person) for k in (0, 1, 1 + gap) for person in (PERSON, other)[: 1 if alone else 2]]
    assert (len(set(people(rows))) == (1 if alone else 2)) is same


@pytest.mark.parametrize(("jumps", "tracked"), [(9, True), (11, False)])
def test_one_person_a_picture_who_moves_farther_than_in_a_video_is_one_person(
    jumps: int, tracked: bool
) -> None:
    """Three quarters of the steps are shorter than 0.12 square roots of the area in a video."""
    steps = np.full(40, 0.11)
    steps[:: 40 // jumps][:jumps] = 30.0
    way = np.concatenate([[0.0], np.cumsum(steps)]) * np.sqrt(area(PERSON))
    found = people([(k, PERSON + np.array([one, 0.0])) for k, one in enumerate(way)])
    assert (len(set(found)) > 1) is tracked


# Calibrations


def about(axis: str, degrees: float) -> np.ndarray:
    return np.asarray(Rotation.from_euler(axis, degrees, degrees=True).as_matrix())


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    middle = np.array([WIDTH, HEIGHT]) / 2
    return np.asarray(middle + (points - middle) @ about("z", degrees)[:2, :2].T)


STANDING = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Rotation of a camera that looks along x, z up."""


def told(points: np.ndarray = PERSON, R: np.ndarray | None = None, **camera: Any) -> str:
    """Return the warnings or the refusal about a person by a calibration, z up."""
    seen = posekit.Detections(points=points[None], names=POINTS, frame=[0], source="x")
    placed = {} if R is None else {"R": R, "t": [0.0, 0.0, 4.0], "up": "+z"}
    about = {"K": [[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]], "size": (WIDTH, HEIGHT)}
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        try:
            seen.view(PinholeCamera(**{**about, **placed, **camera}))
        except InputError as error:
            return str(error)
    return " ".join(str(one.message) for one in found)


def seen_from_above(pitch: float, length: float = 1.0) -> str:
    """Return what is told of a person who lies across the picture; the camera looks down by an angle."""
    part = PERSON.copy()
    part[:, 1] = PERSON[:, 1].mean() + length * (PERSON[:, 1] - PERSON[:, 1].mean())
    return told(turned(part, 90.0), about("x", -pitch) @ STANDING)


def moved(outside: int) -> np.ndarray:
    """Return a person with some points to the right of the picture."""
    points = PERSON.copy()
    points[:outside, 0] += WIDTH
    return points


def K(focal: float) -> list[list[float]]:
    return [[focal, 0, WIDTH / 2], [0, focal, HEIGHT / 2], [0, 0, 1]]


def middle(part: str) -> np.ndarray:
    return np.asarray((PERSON[JOINT[f"right_{part}"]] + PERSON[JOINT[f"left_{part}"]]) / 2)


LONG = sum(float(np.linalg.norm(middle(a) - middle(b))) for a, b in (("shoulder", "hip"), ("hip", "ankle")))
WIDE = float(np.linalg.norm(PERSON[JOINT["right_shoulder"]] - PERSON[JOINT["left_shoulder"]]))


@pytest.mark.parametrize(
    ("finds", "inside", "outside"),
    [
        (lambda roll: "the person lies" in told(R=about("z", roll) @ STANDING), 44.9, 45.1),
        (lambda roll: "stands on the head" in told(R=about("z", roll) @ STANDING), 134.9, 135.1),
        (lambda turn: "upside down" in told(turned(PERSON, turn)), 134.9, 135.1),
        # Beyond 60 degrees the camera looks down, where upright people are seen short.
        (lambda pitch: not seen_from_above(pitch, 0.5), 59.9, 60.1),
        (lambda ratio: bool(seen_from_above(80.0, ratio * WIDE / LONG)), 2.49, 2.51),
        (lambda points: "key points of pictures of" in told(moved(int(points))), 9, 10),
        (lambda focal: not told(K=K(focal)), 0.0499 * WIDTH, 0.0501 * WIDTH),
        (lambda focal: bool(told(K=K(focal))), 99.9 * WIDTH, 100.1 * WIDTH),
    ],
)
def test_a_number_decides_at_its_bound(finds: Callable[[float], bool], inside: float, outside: float) -> None:
    assert [finds(inside), finds(outside)] == [False, True]


def seen(points: np.ndarray, confidence: float = 0.9, **about: Any) -> posekit.View:
    """Return the view of a person by a scaled orthographic camera."""
    sure = np.full((1, len(POINTS)), confidence)
    found = posekit.Detections(points=points[None], names=POINTS, frame=[0], confidence=sure, **about)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return found.view()


@pytest.mark.parametrize(("largest", "scaled"), [(2.99, True), (3.01, False)])
def test_small_coordinates_are_fractions_of_the_picture(largest: float, scaled: bool) -> None:
    points = largest * PERSON / np.median(PERSON)
    view = seen(points, size=(WIDTH, HEIGHT))
    factor = np.array([WIDTH, HEIGHT]) if scaled else np.ones(2)
    np.testing.assert_allclose(view.image[0], points[:14] * factor)


@pytest.mark.parametrize(("confidence", "kept"), [(0.29, False), (0.31, True)])
@pytest.mark.parametrize("beyond", [-0.6, WIDTH - 0.4])
def test_uncertain_points_outside_the_picture_are_invented(
    beyond: float, confidence: float, kept: bool
) -> None:
    points = PERSON.copy()
    for place, there in ((beyond, kept), (min(max(beyond, -0.4), WIDTH - 0.6), True)):
        points[JOINT["left_wrist"], 0] = place
        view = seen(points, confidence, size=(WIDTH, HEIGHT))
        assert np.isfinite(view.image[0, JOINT["left_wrist"]]).all() == there
        assert np.isfinite(view.image[0]).all(axis=1).sum() == 13 + there


@pytest.mark.parametrize(("rate", "expected"), [(None, 30.0), (50.0, 50.0)])
def test_a_film_without_a_rate_has_thirty_pictures_a_second(rate: float | None, expected: float) -> None:
    points = np.repeat(PERSON[None], 4, axis=0)
    film = posekit.Detections(points=points, names=POINTS, frame=np.arange(4), rate=rate)
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        np.testing.assert_allclose(film.view().time, np.arange(4) / expected)
    said = [str(one.message) for one in raised]
    assert any("30 pictures a second are assumed" in line for line in said) is (rate is None)
    np.testing.assert_allclose(film.view(rate=25.0).time, np.arange(4) / 25)


@pytest.mark.parametrize(("farthest", "refused"), [(1e6, False), (1.001e6, True)])
def test_points_are_within_a_million_pixels(farthest: float, refused: bool) -> None:
    points = PERSON.copy()
    points[3, 1] = -farthest
    try:
        assert len(posekit.Detections(points=points[None], names=POINTS, frame=[0])) and not refused
    except InputError:
        assert refused


def test_a_tracker_without_a_camera_is_a_webcam_with_five_pixels_of_noise() -> None:
    """A usual webcam has 78 degrees from corner to corner (Logitech C920, data sheet)."""
    posture = 0.3 * np.asarray(posekit.load_figure().neutral_points[:14]) @ about("x", 90).T + [0.0, 0.0, 1.5]
    size, focal = (1280, 720), np.hypot(1280, 720) / 2 / np.tan(np.radians(39.0))
    camera = PinholeCamera(K=np.array([[focal, 0, 639.5], [0, focal, 359.5], [0, 0, 1.0]]), size=size)
    points = camera.project(posture) + np.random.default_rng(0).normal(0, 2.0, (14, 2))
    trackers = (
        posekit.Tracker(size=size, stature=0.6),
        posekit.Tracker(camera=camera, stature=0.6, deviation=5.0, lag=5),
        posekit.Tracker(size=size, stature=0.6, deviation=8.0),
    )
    usual, stated, other = (one.update(points, 0.0) for one in trackers)
    np.testing.assert_array_equal(usual.joints, stated.joints)
    assert usual.survivors and not np.allclose(usual.joints, other.joints)
    later = [trackers[0].update(points + k, k / 30).path for k in range(1, 6)]
    assert [one is None for one in later] == [True] * 4 + [False]


def test_rows_without_a_person_or_a_confidence_are_of_people_to_be_told_apart() -> None:
    names = ("nose", "neck")
    found = posekit.Detections(names=names, points=np.ones((3, 2, 2)), frame=[0, 0, 2])
    assert found.person.tolist() == [-1] * 3 and np.isnan(found.confidence).all()
    rest = posekit.Detections(
        names=names, points=np.ones((3, 2, 2)), frame=[0, 1, 2], person=[4, -1, -1], film=False
    )
    assert rest.people().tolist() == [4, 5, 6]
    for wrong, field in (
        ({"person": [1, 2, 3]}, "person"),
        ({"confidence": [[1.0]]}, "confidence"),
    ):
        with pytest.raises(InputError, match=f"{field}: got shape"):
            posekit.Detections(**{"names": names, "points": np.ones((2, 2, 2)), "frame": [0, 1], **wrong})
    with pytest.raises(InputError, match="frame: got unsorted"):
        posekit.Detections(names=names, points=np.ones((2, 2, 2)), frame=[1, 0])
