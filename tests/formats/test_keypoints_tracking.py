"""People over time: who is who, gaps, crossings, and choosing one; SciPy and COCO's formula as oracles."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints, choose, list_people, track
from posekit.formats.keypoints.persons import select
from posekit.formats.keypoints.track_assignment import assign
from posekit.formats.keypoints.track_similarity import COMPARED_LANDMARKS, FALLOFF_K, area, similarity
from posekit.formats.keypoints.tracking import MAX_PEOPLE
from posekit.formats.skeleton_maps import LANDMARK_ORDER, load_skeleton_map
from posekit.geometry import Array

COCO = load_skeleton_map("coco_17")
BODY = np.array(
    [
        *[(0, -80), (3, -84), (-3, -84), (8, -82), (-8, -82)],
        *[(18, -60), (-18, -60), (24, -30), (-24, -30), (26, 0), (-26, 0)],
        *[(10, 0), (-10, 0), (11, 45), (-11, 45), (12, 90), (-12, 90)],
    ],
    dtype=float,
)
"""Somebody who stands, COCO's 17, 174 pixels tall."""


def walkers(
    starts: np.ndarray, speeds: np.ndarray, frames: int, rng: np.random.Generator, noise: float = 2.0
) -> tuple[KeyPoints, np.ndarray]:
    """Make people who go straight on and swing; the order in each picture is drawn. Return them and who they are."""
    phase = rng.uniform(0, 6, len(starts))
    rows, who, frame = [], [], []
    for f in range(frames):
        swing = (
            20
            * np.sin(0.4 * f + phase)[:, None]
            * np.array([0] * 7 + [0.4, -0.4, 1, -1, 0, 0, 0.5, -0.5, 1, -1])
        )
        for p in rng.permutation(len(starts)):
            points = BODY + starts[p] + speeds[p] * f + rng.normal(0, noise, (17, 2))
            points[:, 0] += swing[p]
            rows.append(points)
            who.append(p)
            frame.append(f)
    keypoints = KeyPoints(
        format="t",
        source="walkers",
        layout=COCO,
        pictures=tuple(map(str, range(frames))),
        frame=np.array(frame),
        points=np.array(rows),
    )
    return keypoints, np.array(who)


def same(found: np.ndarray, who: np.ndarray) -> bool:
    """Tell whether two ways of numbering people are one."""
    pairs = set(zip(found.tolist(), who.tolist(), strict=True))
    return len(pairs) == len(set(found.tolist())) == len(set(who.tolist()))


@given(rows=st.integers(1, 12), more=st.integers(0, 6), seed=st.integers(0, 2**32 - 1), ties=st.booleans())
def test_assignment_is_scipys(rows: int, more: int, seed: int, ties: bool) -> None:
    rng = np.random.default_rng(seed)
    cost: Array = rng.normal(size=(rows, rows + more))
    if ties:
        cost = np.round(cost)
    found = assign(cost)
    assert len(set(found.tolist())) == rows
    best = linear_sum_assignment(cost)
    assert cost[np.arange(rows), found].sum() == pytest.approx(cost[best].sum(), abs=1e-9)


def test_similarity_is_cocos_where_nobody_moves(rng: np.random.Generator) -> None:
    # OKS of cocodataset.org's "Keypoint Evaluation", written down once more: sum of exp(-d^2 / 2 s^2 k^2) over n.
    sigmas = dict(
        zip(
            COCO.points,
            np.array([26, 25, 25, 35, 35, 79, 79, 72, 72, 62, 62, 107, 107, 87, 87, 89, 89]) / 1000,
            strict=True,
        )
    )
    assert [LANDMARK_ORDER[k] for k in COMPARED_LANDMARKS] != list(COCO.points), (
        "the orders differ, the numbers must not"
    )
    np.testing.assert_allclose(FALLOFF_K, [2 * sigmas[LANDMARK_ORDER[k]] for k in COMPARED_LANDMARKS])
    a, b = (BODY + rng.normal(0, 5, (17, 2)) for _ in range(2))
    b[3] = np.nan
    k = 2 * np.array(list(sigmas.values()))
    terms = np.exp(-((a - b) ** 2).sum(axis=1) / (2 * 9000.0 * k**2))
    wanted = np.nanmean(terms)
    order = [COCO.points.index(LANDMARK_ORDER[k]) for k in COMPARED_LANDMARKS]
    found = similarity(a[None, order], b[None, order], np.full((1, 1), 9000.0), np.zeros(1))
    assert found[0, 0] == pytest.approx(wanted)


def test_area_is_that_of_the_box() -> None:
    points = np.array(
        [
            [[0, 0], [10, 40], [np.nan, np.nan]],
            [[0, 0], [0, 40], [np.nan, np.nan]],
            [[5, 5], [np.nan] * 2, [np.nan] * 2],
        ]
    )
    np.testing.assert_allclose(area(points)[:2], [0.53 * 400, 0.53 * 400])
    assert np.isnan(area(points)[2])


@pytest.mark.parametrize("seed", range(8))
def test_people_whose_order_changes_keep_their_numbers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    starts = np.array([(200 + 130 * k, 300) for k in range(5)]) + rng.normal(0, 20, (5, 2))
    keypoints, who = walkers(starts, rng.normal(0, 2, (5, 2)), 40, rng)
    assert same(track(keypoints).person, who)


@pytest.mark.parametrize("speed", [3.0, 6.0, 12.0, 25.0])
@pytest.mark.parametrize("seed", range(4))
def test_people_who_cross_keep_their_numbers(speed: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    starts = np.array([(100.0, 300.0), (100.0 + 40 * speed, 306.0)])
    keypoints, who = walkers(starts, np.array([(speed, 0.0), (-speed, 0.0)]), 40, rng)
    assert same(track(keypoints).person, who)


@pytest.mark.parametrize("gap", [1, 4, 10, 20])
def test_somebody_hidden_for_a_while_is_known_again(gap: int, rng: np.random.Generator) -> None:
    keypoints, who = walkers(
        np.array([(100.0, 300.0), (700.0, 300.0)]), np.array([(4.0, 0.0), (-2.0, 0.0)]), 50, rng
    )
    gone = (who == 0) & (keypoints.frame >= 15) & (keypoints.frame < 15 + gap)
    keypoints, who = select(keypoints, ~gone), who[~gone]
    assert same(track(keypoints).person, who)


@given(seed=st.integers(0, 2**32 - 1), frames=st.integers(1, 20))
def test_one_detection_a_picture_is_one_person_however_far_apart_they_are(seed: int, frames: int) -> None:
    rng = np.random.default_rng(seed)
    alone, _ = walkers(np.zeros((1, 2)), np.zeros((1, 2)), frames, rng)
    places = rng.uniform(0, 4000, (frames, 1, 2)) + rng.uniform(0.2, 5, (frames, 1, 1)) * alone.points
    moved = replace(alone, points=places)
    assert set(track(moved).person.tolist()) == {0}
    assert len(choose(moved)) == frames


def test_people_in_pictures_a_second_apart_keep_their_numbers(rng: np.random.Generator) -> None:
    keypoints, who = walkers(np.array([(100.0, 300.0), (1900.0, 300.0)]), np.zeros((2, 2)), 12, rng)
    keypoints = replace(keypoints, points=keypoints.points + rng.normal(0, 25, (len(who), 1, 2)))
    assert not same(track(keypoints).person, who)
    assert same(track(replace(keypoints, time=np.arange(12.0))).person, who)


def test_somebody_gone_for_longer_than_the_patience_is_new(rng: np.random.Generator) -> None:
    keypoints, _ = walkers(np.array([(100.0, 300.0)]), np.zeros((1, 2)), 50, rng)
    keypoints = select(keypoints, (keypoints.frame < 10) | (keypoints.frame > 20))
    assert len(np.unique(track(keypoints).person)) == 1
    assert len(np.unique(track(keypoints, patience=5).person)) == 2


def test_one_who_leaves_is_not_the_one_who_comes(rng: np.random.Generator) -> None:
    keypoints, who = walkers(np.array([(100.0, 300.0), (600.0, 300.0)]), np.zeros((2, 2)), 20, rng)
    there = np.where(who == 0, keypoints.frame < 10, keypoints.frame >= 10)
    assert same(track(select(keypoints, there)).person, who[there])


def test_points_that_come_and_go_do_not_matter(rng: np.random.Generator) -> None:
    keypoints, who = walkers(
        np.array([(100.0, 300.0), (260.0, 300.0)]), np.array([(3.0, 0.0), (3.0, 0.0)]), 40, rng
    )
    missing = rng.random(keypoints.points.shape[:2]) < 0.5
    keypoints = replace(keypoints, points=np.where(missing[..., None], np.nan, keypoints.points))
    assert same(track(keypoints).person, who)


def test_the_order_in_the_file_does_not_matter(rng: np.random.Generator) -> None:
    keypoints, _ = walkers(
        np.array([(100.0, 300.0), (300.0, 300.0)]), np.array([(3.0, 0.0), (-3.0, 0.0)]), 40, rng
    )
    turned = select(keypoints, np.arange(len(keypoints)))
    order = np.lexsort((-np.arange(len(keypoints)), keypoints.frame))
    turned = replace(keypoints, points=keypoints.points[order])
    assert same(track(turned).person, track(keypoints).person[order])


def test_fractions_are_tracked_as_pixels_are(rng: np.random.Generator) -> None:
    keypoints, who = walkers(
        np.array([(100.0, 300.0), (400.0, 300.0)]), np.array([(3.0, 0.0), (-3.0, 0.0)]), 40, rng
    )
    fractions = replace(keypoints, points=keypoints.points / 1000, normalised=True)
    assert same(track(fractions).person, who)


def test_numbers_of_the_file_stay(rng: np.random.Generator) -> None:
    keypoints, who = walkers(np.array([(100.0, 300.0), (600.0, 300.0)]), np.zeros((2, 2)), 10, rng)
    told = replace(keypoints, person=who + 7)
    assert track(told) is told
    half = replace(keypoints, person=np.where(who == 0, 7, -1))
    assert track(half).person.tolist() == np.where(who == 0, 7, 8).tolist()


def test_nobody_is_tracked_without_complaint() -> None:
    empty = KeyPoints(
        format="t",
        source="t",
        layout=COCO,
        pictures=("a",),
        frame=np.empty(0, int),
        points=np.empty((0, 17, 2)),
    )
    assert len(track(empty)) == len(choose(empty)) == len(list_people(empty)) == 0


def test_people_without_points_or_in_one_point_do_no_harm() -> None:
    points = np.full((4, 17, 2), np.nan)
    points[2:, 3] = 5.0
    keypoints = KeyPoints(
        format="t", source="t", layout=COCO, pictures=("a", "b"), frame=np.array([0, 0, 1, 1]), points=points
    )
    assert (track(keypoints).person >= 0).all()


@pytest.mark.parametrize(("least", "patience"), [(0.0, 3), (1.0, 3), (np.nan, 3), (0.5, -1)])
def test_impossible_bounds_are_refused(least: float, patience: int, rng: np.random.Generator) -> None:
    keypoints, _ = walkers(np.zeros((1, 2)), np.zeros((1, 2)), 2, rng)
    with pytest.raises(InputError, match="tracking asks for"):
        track(keypoints, least=least, patience=patience)


def test_too_many_people_in_a_picture_are_refused() -> None:
    count = MAX_PEOPLE + 1
    keypoints = KeyPoints(
        format="t",
        source="t",
        layout=COCO,
        pictures=("a", "b"),
        frame=np.ones(count, int),
        points=np.zeros((count, 17, 2)),
    )
    with pytest.raises(InputError, match="picture b: got 1,001 people; expected at most 1,000"):
        track(keypoints)


def test_the_work_is_linear_in_the_pictures_and_quick(rng: np.random.Generator) -> None:
    keypoints, who = walkers(np.array([(200.0 * k, 300.0) for k in range(6)]), np.zeros((6, 2)), 300, rng)
    start = time.perf_counter()
    assert same(track(keypoints).person, who)
    assert time.perf_counter() - start < 5


# --- choosing ---------------------------------------------------------------------------------------------


@pytest.fixture
def three(rng: np.random.Generator) -> KeyPoints:
    """A small one who is first and always there, a large one who is there in half of the pictures, a sure one."""
    keypoints, who = walkers(
        np.array([(100.0, 300.0), (600.0, 300.0), (1100.0, 300.0)]), np.zeros((3, 2)), 12, rng
    )
    points = keypoints.points.copy()
    points[who == 1] = (points[who == 1] - [600, 300]) * 3 + [600, 300]
    confidence = np.where(who == 2, 0.9, 0.4)[:, None] * np.ones((1, 17))
    keypoints = replace(keypoints, points=points, confidence=confidence)
    order = np.lexsort((who, keypoints.frame))
    keypoints = replace(keypoints, points=points[order], confidence=confidence[order])
    who = who[order]
    return select(keypoints, (who != 1) | (keypoints.frame % 2 == 0))


@pytest.mark.parametrize(
    ("rule", "pictures", "x"), [("first", 12, 100), ("largest", 6, 600), ("surest", 12, 1100)]
)
def test_somebody_is_chosen_by_a_rule(rule: str, pictures: int, x: float, three: KeyPoints) -> None:
    found = choose(three, rule)
    assert len(found) == len(np.unique(found.frame)) == pictures
    assert found.pictures == three.pictures, "pictures without them keep their place"
    assert abs(np.nanmean(found.points[..., 0]) - x) < 20


@pytest.mark.parametrize("person", [2, "2"])
def test_somebody_is_chosen_by_number(person: int | str, three: KeyPoints) -> None:
    found = choose(three, person)
    assert (found.person == 2).all()
    assert abs(np.nanmean(found.points[..., 0]) - 1100) < 20


@pytest.mark.parametrize(
    ("person", "told"),
    [
        (9, "got 9; expected one of 0, 1, 2"),
        ("tallest", "expected a number, or largest, first, surest"),
        (-1, "expected a number"),
    ],
)
def test_nobody_by_that_name_is_told(person: int | str, told: str, three: KeyPoints) -> None:
    with pytest.raises(InputError, match=told):
        choose(three, person)


def test_somebody_twice_in_a_picture_is_taken_once(three: KeyPoints) -> None:
    doubled = replace(three, person=np.zeros(len(three), int))
    found = choose(doubled, 0)
    assert found.frame.tolist() == list(range(12))
    assert (found.confidence == 0.9).all(), "the surest"


@pytest.mark.parametrize(("rule", "x"), [("first", 100), ("largest", 600), ("surest", 1100)])
def test_in_photographs_somebody_is_chosen_in_each(rule: str, x: float, three: KeyPoints) -> None:
    photographs = replace(select(three, three.frame % 2 == 0), sequence=False)
    found = choose(photographs, rule)
    assert found.frame.tolist() == [0, 2, 4, 6, 8, 10]
    assert abs(np.nanmean(found.points[..., 0]) - x) < 20
    assert len(list_people(photographs)) == len(photographs)


def test_the_list_of_people_says_what_there_is(three: KeyPoints) -> None:
    small, large, sure = list_people(three)
    assert [one.pictures for one in (small, large, sure)] == [12, 6, 12]
    assert [round(one.confidence, 9) for one in (small, large, sure)] == [0.4, 0.4, 0.9]
    assert small.seen == 1.0
    assert (large.first, large.last) == ("0", "10")
    assert large.height == pytest.approx(3 * small.height, rel=0.1)
