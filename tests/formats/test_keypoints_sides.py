"""Left and right the wrong way round: noticed on walks from all directions, not cried where all is as labelled."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.formats.keypoints import KeyPoints, check_sides, swap
from posekit.formats.keypoints.persons import select
from posekit.formats.keypoints.side_flips import LIMB_GROUPS, flips
from posekit.formats.keypoints.side_gait import gait_evidence
from posekit.formats.keypoints.sides import SURE_EVIDENCE
from posekit.formats.skeleton_maps import LANDMARK_INDEX, load_skeleton_map, skeleton_map_of
from posekit.synthesis import SyntheticScene, Walker, random_views, walker_scene
from posekit.tables.file_model import validated
from posekit.tables.skeleton_map import SkeletonMapTable
from tests.detector_files import scatter

COCO = load_skeleton_map("coco_17")
FACE = slice(0, 5)
ARMS, LEGS = slice(5, 11), slice(11, 17)


def seen(scene: SyntheticScene, rng: np.random.Generator, *, head: bool, noise: float = 0.005) -> KeyPoints:
    """Make COCO's key points of a scene: noise in heights of the person; the 1985 camera's are a thousand a metre."""
    landmarks = np.full((len(scene), len(LANDMARK_INDEX), 2), np.nan)
    landmarks[:, :19] = np.concatenate([scene.image, scene.head_image], axis=1) * (
        1000 if scene.lee_chen_f else 1
    )
    points = scatter(COCO, landmarks)
    points += rng.normal(0, noise * np.median(np.ptp(points[..., 1], axis=1)), points.shape)
    if not head:
        points[:, FACE] = np.nan
    return KeyPoints(
        format="t",
        source="walk",
        layout=COCO,
        pictures=tuple(map(str, range(len(scene)))),
        frame=np.arange(len(scene)),
        points=points,
    )


@cache
def walks(carried: bool, frames: int, dt: float) -> tuple[SyntheticScene, ...]:
    """See a walker from 12 directions, from the hips' height and from above the head, 4 to 7 m away."""
    rng = np.random.default_rng(8)
    scenes = []
    for k in range(24):
        angle, height = 2 * np.pi * k / 12 + 0.1, (-0.3, 0.8)[k // 12]
        distance = rng.uniform(4, 7)
        scenes.append(
            walker_scene(
                Walker(velocity=(0.7, 1.1)[k % 2]),
                camera=(distance * np.cos(angle), height, distance * np.sin(angle)),
                target=(0.0, -0.7, 0.0),
                frames=frames,
                dt=dt,
                phase0=rng.random(),
                carried=carried,
            )
        )
    return tuple(scenes)


def exchanged(keypoints: KeyPoints, part: slice, rows: slice = slice(None)) -> KeyPoints:
    """Exchange left and right of some of COCO's points, which come left before right."""
    points = keypoints.points.copy()
    pairs = points[rows, part].reshape(-1, (part.stop - part.start) // 2, 2, 2)
    points[rows, part] = pairs[:, :, ::-1].reshape(points[rows, part].shape)
    return replace(keypoints, points=points)


# --- the exchange -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "coco_17",
        "body_25",
        "body_25b",
        "coco_18",
        "halpe_136",
        "h36m_17",
        "mediapipe_33",
        "coco_wholebody_133",
    ],
)
def test_an_exchange_is_that_of_the_skeleton_map_and_twice_is_nothing(
    name: str, rng: np.random.Generator
) -> None:
    layout = load_skeleton_map(name)
    points = rng.uniform(1, 900, (3, len(layout.points), 2))
    there = KeyPoints(
        format="t",
        source="t",
        layout=layout,
        pictures=("a", "b", "c"),
        frame=np.arange(3),
        points=points,
        confidence=rng.random(points.shape[:2]),
    )
    turned = swap(there)
    np.testing.assert_array_equal(turned.landmarks, layout.swapped().gather(points))
    assert turned.layout is layout, "what is written has the names on the other points"
    np.testing.assert_array_equal(swap(turned).points, points)
    np.testing.assert_array_equal(swap(turned).confidence, there.confidence)
    sided = [k for k, point in enumerate(layout.points) if point.startswith(("left", "right", "LB", "RB"))]
    assert not (turned.points[:, sided] == points[:, sided]).any(), "feet, hands and toes too"


def test_sides_of_several_points_are_exchanged_too() -> None:
    table = {
        "schema": "posekit.skeleton_map/1",
        "points": ["a1", "a2", "b1", "b2", "c"],
        "landmarks": {"left_wrist": ["a1", "a2"], "right_wrist": ["b1", "b2"], "nose": "c"},
    }
    layout = skeleton_map_of(validated(SkeletonMapTable, table, "markers"), "markers")
    points = np.arange(10.0).reshape(1, 5, 2)
    there = KeyPoints(
        format="t", source="t", layout=layout, pictures=("a",), frame=np.zeros(1, int), points=points
    )
    np.testing.assert_array_equal(swap(there).points[0], points[0, [2, 3, 0, 1, 4]])
    other = {**table, "landmarks": {"left_wrist": "a1", "right_wrist": ["b1", "b2"]}}
    uneven = skeleton_map_of(validated(SkeletonMapTable, other, "markers"), "markers")
    there = replace(there, layout=uneven)
    np.testing.assert_array_equal(swap(there).landmarks, uneven.swapped().gather(points))


# --- all pictures -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("head", [True, False])
def test_a_swap_is_noticed_on_walks_from_all_directions(head: bool) -> None:
    rng = np.random.default_rng(1)
    noticed = 0
    for scene in walks(False, 24, 0.08):
        there = seen(scene, rng, head=head)
        assert check_sides(there).verdict != "swapped"
        found = check_sides(swap(there))
        noticed += found.verdict == "swapped" and found.part == "body"
    assert noticed >= 23, f"{noticed} of 24"


@pytest.mark.parametrize(("frames", "dt", "least"), [(5, 0.2, 4), (10, 0.1, 6), (40, 0.06, 17)])
def test_who_walks_on_the_spot_is_noticed_mostly_and_never_wrongly(
    frames: int, dt: float, least: int
) -> None:
    rng = np.random.default_rng(2)
    noticed = 0
    for scene in walks(True, frames, dt):
        there = seen(scene, rng, head=False)
        assert check_sides(there).verdict != "swapped"
        noticed += check_sides(swap(there)).verdict == "swapped"
    assert noticed >= least, f"{noticed} of 24"


def test_the_evidence_turns_its_sign_with_the_sides() -> None:
    rng = np.random.default_rng(3)
    for scene in walks(False, 24, 0.08)[::5]:
        there = seen(scene, rng, head=True)
        one, other = (gait_evidence(kp.landmarks, kp.frame) for kp in (there, swap(there)))
        assert one.keys() == other.keys()
        np.testing.assert_allclose(list(one.values()), [-worth for worth in other.values()], atol=1e-9)


def test_the_evidence_is_that_of_fractions_too() -> None:
    there = seen(walks(False, 24, 0.08)[3], np.random.default_rng(4), head=True)
    small = replace(there, points=there.points / 1000, normalised=True)
    assert check_sides(small).strength == pytest.approx(check_sides(there).strength)


def test_points_that_are_missing_change_no_verdict_to_its_opposite() -> None:
    rng = np.random.default_rng(5)
    for scene in walks(False, 24, 0.08)[::3]:
        there = seen(scene, rng, head=True)
        missing = rng.random(there.points.shape[:2]) < 0.1
        there = replace(there, points=np.where(missing[..., None], np.nan, there.points))
        assert check_sides(there).verdict != "swapped"
        assert check_sides(swap(there)).verdict != "as labelled"


def test_postures_that_are_no_walk_raise_no_alarm() -> None:
    rng = np.random.default_rng(6)
    scene = random_views(load_figure(), 200, rng)
    there = seen(scene, rng, head=False)
    alone = [check_sides(select(there, [k])).verdict for k in range(60)]
    assert alone.count("swapped") == 0
    assert check_sides(there).verdict != "swapped"
    assert check_sides(there).pictures == (), "pictures that have nothing to do with each other"
    assert check_sides(replace(there, sequence=False)).verdict != "swapped"


@pytest.mark.parametrize(("part", "name"), [(LEGS, "legs"), (ARMS, "arms")])
def test_one_half_swapped_is_noticed_and_named(part: slice, name: str) -> None:
    rng = np.random.default_rng(7)
    named = []
    for scene in walks(False, 24, 0.08):
        found = check_sides(exchanged(seen(scene, rng, head=True), part))
        named.append(found.part)
    front = [k for k in range(24) if abs(np.cos(2 * np.pi * (k % 12) / 12 + 0.1)) > 0.8]
    assert all(named[k] == name for k in front), named
    assert (
        check_sides(exchanged(seen(walks(False, 24, 0.08)[0], rng, head=False), part)).part == "arms or legs"
    )


def test_a_body_swapped_under_a_face_that_is_not() -> None:
    there = seen(walks(True, 5, 0.2)[0], np.random.default_rng(9), head=True)
    found = check_sides(exchanged(exchanged(there, ARMS), LEGS))
    assert (found.verdict, found.part) == ("swapped", "body or face")
    assert "swapped (body or face)" in found.warnings[0]


# --- faces ------------------------------------------------------------------------------------------------


def front(sure: float = 0.9, up: float = 1.0) -> KeyPoints:
    """Return somebody who faces the camera, the face surer than usual or not."""
    x = np.array([0, 3, -3, 8, -8, 18, -18, 24, -24, 26, -26, 10, -10, 11, -11, 12, -12], dtype=float)
    y = np.array([-80, -84, -84, -82, -82, -60, -60, -30, -30, 0, 0, 0, 0, 45, 45, 90, 90], dtype=float)
    confidence = np.full((1, 17), 0.8)
    confidence[0, :3] = sure
    return KeyPoints(
        format="t",
        source="photo",
        layout=COCO,
        pictures=("photo",),
        frame=np.zeros(1, int),
        points=np.stack([up * x, up * y], axis=-1)[None] + 200,
        confidence=confidence,
    )


def test_a_face_that_is_seen_tells_in_one_picture() -> None:
    assert check_sides(front()).verdict == "as labelled"
    found = check_sides(swap(front()))
    assert (found.verdict, found.part, dict(found.evidence)) == ("swapped", "body", {"face": 3.0})


def test_a_face_that_is_not_seen_tells_that_it_is_turned_away() -> None:
    assert check_sides(front(0.05)).verdict == "swapped", "right at the left, from behind"
    assert check_sides(swap(front(0.05))).verdict == "as labelled"


def test_a_head_outside_the_picture_tells_nothing() -> None:
    there = front()
    points = there.points.copy()
    points[:, FACE] = np.nan
    assert check_sides(replace(there, points=points)).verdict == "unknown"


def test_confidences_that_are_all_the_same_tell_nothing() -> None:
    assert check_sides(front(0.8)).verdict == check_sides(swap(front(0.8))).verdict == "unknown"


def test_a_face_that_is_put_on_every_head_tells_nothing() -> None:
    """MediaPipe is sure of eyes, nose and ears from behind, and less of limbs that are hidden."""
    there = front(0.8)
    confidence = np.linspace(0.3, 0.9, there.confidence.size).reshape(there.confidence.shape)
    confidence[:, FACE] = 1.0
    sure = replace(there, confidence=confidence)
    assert check_sides(sure).verdict == check_sides(swap(sure)).verdict == "unknown"


def test_who_stands_on_their_hands_raises_no_alarm() -> None:
    assert check_sides(front(up=-1.0)).verdict == "unknown"


def test_faces_of_several_people_are_weighed_together() -> None:
    many = [front() for _ in range(4)] + [swap(front())]
    together = KeyPoints(
        format="t",
        source="photos",
        layout=COCO,
        pictures=tuple("abcde"),
        frame=np.arange(5),
        points=np.concatenate([one.points + 1000 * k for k, one in enumerate(many)]),
        confidence=np.concatenate([one.confidence for one in many]),
    )
    assert check_sides(together).verdict == "as labelled"


# --- single pictures --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("group", "part"), [("legs", LEGS), ("arms", ARMS)])
@pytest.mark.parametrize("long", [1, 3])
def test_a_jump_is_found_where_it_is(group: str, part: slice, long: int) -> None:
    rng = np.random.default_rng(10)
    for scene in walks(False, 24, 0.08)[::4]:
        there = seen(scene, rng, head=True)
        assert check_sides(there).pictures == ()
        sides = np.linalg.norm(there.points[:, part.start] - there.points[:, part.start + 1], axis=1)
        at = int(np.argmax(sides[4:18])) + 4  # where both sides are apart: else nothing jumps
        found = check_sides(exchanged(there, part, slice(at, at + long)))
        jumped = {"legs": found.legs, "arms": found.arms}
        assert np.flatnonzero(jumped.pop(group)).tolist() == list(range(at, at + long))
        assert not next(iter(jumped.values())).any()
        assert found.pictures == tuple(map(str, range(at, at + long)))
        assert f"jump in {long} pictures" in found.warnings[-1]


def test_legs_do_not_jump_where_shoulders_go_with_them() -> None:
    """Somebody turned round, and the elbows and wrists of a detector stayed: hips against shoulders would be wrong."""
    alone, together = 0, 0
    for scene in walks(False, 24, 0.08)[::2]:
        there = exchanged(seen(scene, np.random.default_rng(13), head=False), LEGS, slice(10, 13))
        alone += int(check_sides(there).legs[10:13].sum())
        turned = check_sides(exchanged(there, slice(5, 7), slice(10, 13)))
        together += int((turned.legs & ~turned.arms)[10:13].sum())
    assert alone > 10
    assert together < alone / 3


@given(seed=st.integers(0, 2**32 - 1))
def test_the_signs_are_the_best_there_are(seed: int) -> None:
    from itertools import product

    from posekit.formats.keypoints.side_flips import _bends, _signs

    d = np.random.default_rng(seed).normal(size=(7, 2))
    best = min(_bends(d * np.array(signs)[:, None]).sum() for signs in product((1, -1), repeat=7))
    assert _bends(d * _signs(d)[:, None]).sum() == pytest.approx(best)


def test_jumps_are_put_right_before_the_walk_is_judged() -> None:
    rng = np.random.default_rng(11)
    there = seen(walks(False, 24, 0.08)[3], rng, head=False)
    broken = exchanged(there, LEGS, slice(8, 10))
    assert check_sides(broken).verdict == "as labelled"
    assert check_sides(swap(broken)).verdict == "swapped"


def test_a_gap_in_the_pictures_is_no_jump() -> None:
    there = seen(walks(True, 40, 0.06)[3], np.random.default_rng(12), head=False)
    gone = select(there, (there.frame < 13) | (there.frame > 22))
    for parts in LIMB_GROUPS.values():
        assert not flips(gone.landmarks, gone.frame, parts).any()


# --- nothing to see ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [0, 1, 2, 30])
@pytest.mark.parametrize("value", [np.nan, 5.0])
def test_nobody_and_people_in_one_point_are_unknown(count: int, value: float) -> None:
    there = KeyPoints(
        format="t",
        source="t",
        layout=COCO,
        pictures=tuple(map(str, range(30))),
        frame=np.arange(count),
        points=np.full((count, 17, 2), value),
    )
    found = check_sides(there)
    assert (found.verdict, found.pictures, found.warnings) == ("unknown", (), ())
    assert abs(found.strength) < SURE_EVIDENCE


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0, 0.95))
def test_any_points_are_judged_without_complaint(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 300, (12, 17, 2)) * rng.choice([1e-6, 1, 300])
    points[rng.random((12, 17)) < share] = np.nan
    there = KeyPoints(
        format="t",
        source="t",
        layout=COCO,
        pictures=tuple("abcdef"),
        frame=np.sort(rng.integers(0, 6, 12)),
        points=points,
        confidence=np.where(np.isnan(points[..., 0]), np.nan, rng.random((12, 17))),
    )
    found = check_sides(there)
    assert np.isfinite(found.strength)
    assert all("\n" not in line for line in found.warnings)
