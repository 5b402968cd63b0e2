"""Skeleton maps: every layout against its published order, and the laws of gathering and scattering."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.skeleton_maps import (
    LANDMARK_INDEX,
    LANDMARK_ORDER,
    SkeletonMap,
    find_by_names,
    find_by_order,
    load_skeleton_map,
    skeleton_map_names,
    skeleton_map_of,
)
from posekit.tables.file_model import validated
from posekit.tables.skeleton_map import SkeletonMapTable
from tests.detector_files import scatter

NAMES = skeleton_map_names()
SIDED = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "eye", "ear")

# The places of the right and the left points in each format's order, from the formats' documentation.
COCO = {
    "shoulder": (6, 5),
    "elbow": (8, 7),
    "wrist": (10, 9),
    "hip": (12, 11),
    "knee": (14, 13),
    "ankle": (16, 15),
}
COCO |= {"eye": (2, 1), "ear": (4, 3)}
PLACES = {
    "coco_17": COCO,
    "body_25b": COCO,
    "halpe_26": COCO,
    "halpe_136": COCO,
    "coco_wholebody_133": COCO,
    "body_25": {
        "shoulder": (2, 5),
        "elbow": (3, 6),
        "wrist": (4, 7),
        "hip": (9, 12),
        "knee": (10, 13),
        "ankle": (11, 14),
        "eye": (15, 16),
        "ear": (17, 18),
    },
    "coco_18": {
        "shoulder": (2, 5),
        "elbow": (3, 6),
        "wrist": (4, 7),
        "hip": (8, 11),
        "knee": (9, 12),
        "ankle": (10, 13),
        "eye": (14, 15),
        "ear": (16, 17),
    },
    "mediapipe_33": {
        "shoulder": (12, 11),
        "elbow": (14, 13),
        "wrist": (16, 15),
        "hip": (24, 23),
        "knee": (26, 25),
        "ankle": (28, 27),
        "eye": (5, 2),
        "ear": (8, 7),
    },
    "h36m_17": {
        "shoulder": (14, 11),
        "elbow": (15, 12),
        "wrist": (16, 13),
        "hip": (1, 4),
        "knee": (2, 5),
        "ankle": (3, 6),
    },
}
MIDDLES: dict[str, dict[str, tuple[int, ...]]] = {
    "body_25": {"mid_shoulders": (1,), "mid_hips": (8,)},
    "coco_18": {"mid_shoulders": (1,), "mid_hips": (8, 11)},
    "halpe_26": {"mid_shoulders": (18,), "mid_hips": (19,)},
    "halpe_136": {"mid_shoulders": (18,), "mid_hips": (19,)},
    "h36m_17": {"mid_shoulders": (8,), "mid_hips": (0,)},
}
POINTS = {
    "coco_17": 17,
    "coco_18": 18,
    "body_25": 25,
    "body_25b": 25,
    "halpe_26": 26,
    "halpe_136": 136,
    "coco_wholebody_133": 133,
    "mediapipe_33": 33,
    "h36m_17": 17,
}


@pytest.mark.parametrize("name", sorted(PLACES))
def test_a_layout_has_its_published_order(name: str) -> None:
    layout = load_skeleton_map(name)
    expected: dict[str, tuple[int, ...]] = {
        f"{side}_{part}": (place,)
        for part, both in PLACES[name].items()
        for side, place in zip(("right", "left"), both, strict=True)
    }
    if name != "h36m_17":
        expected["nose"] = (0,)
    shoulders, hips = PLACES[name]["shoulder"], PLACES[name]["hip"]
    middles: dict[str, tuple[int, ...]] = {"mid_shoulders": shoulders, "mid_hips": hips}
    middles |= MIDDLES.get(name, {})
    found = {
        landmark: tuple(layout.points.index(part) for part in parts)
        for landmark, parts in layout.landmarks.items()
    }
    assert {key: set(places) for key, places in found.items()} == {
        key: set(places) for key, places in (expected | middles).items()
    }
    assert len(layout.points) == POINTS[name]
    assert layout.source


def test_every_map_of_a_detector_is_checked_here_or_names_its_own_points() -> None:
    """A built-in map with an order of its own, that no table above speaks of, would go unchecked."""
    ordered = {name for name in NAMES if load_skeleton_map(name).points}
    assert set(POINTS) <= ordered


@pytest.mark.parametrize("name", sorted(POINTS))
def test_no_map_of_a_detector_takes_a_girdle_for_a_joint(name: str) -> None:
    assert not {"neck", "pelvis"} & set(load_skeleton_map(name).landmarks)


@pytest.mark.parametrize("name", sorted(POINTS))
def test_gathering_undoes_scattering(name: str) -> None:
    layout = load_skeleton_map(name)
    rng = np.random.default_rng(1)
    landmarks = rng.normal(size=(3, len(LANDMARK_ORDER), 2))
    for side in ("shoulders", "hips"):
        ends = [LANDMARK_INDEX[f"{which}_{side[:-1]}"] for which in ("right", "left")]
        landmarks[:, LANDMARK_INDEX[f"mid_{side}"]] = landmarks[:, ends].mean(axis=1)
    back = layout.gather(scatter(layout, landmarks))
    placed = [LANDMARK_INDEX[landmark] for landmark in layout.landmarks]
    np.testing.assert_allclose(back[:, placed], landmarks[:, placed], atol=1e-15)
    assert np.isnan(np.delete(back, placed, axis=1)).all()


@pytest.mark.parametrize("name", sorted(POINTS))
def test_exchanging_sides_twice_is_nothing_and_once_exchanges(name: str) -> None:
    layout = load_skeleton_map(name)
    values = np.random.default_rng(2).normal(size=(len(layout.points), 2))
    once, twice = layout.swapped().gather(values), layout.swapped().swapped().gather(values)
    np.testing.assert_array_equal(twice, layout.gather(values))
    plain = layout.gather(values)
    for part in SIDED:
        np.testing.assert_array_equal(
            once[LANDMARK_INDEX[f"left_{part}"]], plain[LANDMARK_INDEX[f"right_{part}"]]
        )
    np.testing.assert_array_equal(once[LANDMARK_INDEX["nose"]], plain[LANDMARK_INDEX["nose"]])


def test_a_mean_of_which_a_point_is_missing_is_missing() -> None:
    layout = load_skeleton_map("coco_17")
    values = np.arange(34.0).reshape(17, 2)
    values[5] = np.nan
    found = layout.gather(values)
    assert np.isnan(found[LANDMARK_INDEX["mid_shoulders"]]).all()
    np.testing.assert_array_equal(found[LANDMARK_INDEX["mid_hips"]], (values[11] + values[12]) / 2)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(st.sampled_from(sorted(POINTS)), st.randoms(use_true_random=False))
def test_a_map_laid_over_shuffled_names_finds_the_same_landmarks(name: str, random) -> None:
    layout = load_skeleton_map(name)
    order = list(range(len(layout.points)))
    random.shuffle(order)
    values = np.random.default_rng(3).normal(size=(len(order), 2))
    names = [layout.points[k].upper().replace("_", " ") for k in order]
    over = layout.over(names)
    assert over.points == tuple(names)
    np.testing.assert_array_equal(over.gather(values[order]), layout.gather(values))
    np.testing.assert_array_equal(layout.gather(values[order], names), layout.gather(values))


def test_a_map_laid_over_fewer_names_leaves_out_what_is_not_there() -> None:
    over = load_skeleton_map("coco_17").over(["left_hip", "right_hip", "tail"])
    assert set(over.landmarks) == {"left_hip", "right_hip", "mid_hips"}


@pytest.mark.parametrize("name", sorted(POINTS))
def test_the_names_of_a_map_find_it_first(name: str) -> None:
    assert find_by_names(load_skeleton_map(name).points)[0].name == name


def test_names_in_another_spelling_and_with_others_beside_them_find_the_nearest_map() -> None:
    names = [
        name.replace("left_", "Left ").replace("right_", "Right ")
        for name in load_skeleton_map("coco_17").points
    ]
    assert find_by_names([*names, "tool"])[0].name == "coco_17"


def test_a_detectors_neck_is_not_taken_for_the_joint_of_that_name() -> None:
    names = [*load_skeleton_map("coco_17").points, "neck", "pelvis"]
    for layout in find_by_names(names, detectors=True):
        assert layout.points and not {"neck", "pelvis"} & set(layout.landmarks)
    assert find_by_names(names, detectors=True)[0].name == "coco_17"


def test_names_of_another_creature_find_nothing() -> None:
    assert find_by_names(["nose", "left_front_paw", "left_back_paw", "root_of_tail", "left_hip"]) == []


def test_a_number_of_points_finds_all_maps_that_have_so_many() -> None:
    assert [one.name for one in find_by_order(17)] == ["coco_17", "h36m_17"]
    assert [one.name for one in find_by_order(25)] == ["body_25", "body_25b"]
    assert find_by_order(24) == []


GOOD = {
    "schema": "posekit.skeleton_map/1",
    "points": ["a", "b", "c"],
    "landmarks": {"nose": "a", "left_hip": "b", "right_hip": "c", "mid_hips": ["b", "c"]},
}


def test_a_good_table_is_a_map() -> None:
    layout = skeleton_map_of(validated(SkeletonMapTable, GOOD, "mine.toml"), "mine.toml")
    assert layout.needed == ("a", "b", "c")
    assert layout.landmarks["mid_hips"] == ("b", "c")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"schema": "posekit.skeleton_map/2"}, "schema"),
        ({"schema": None}, "schema"),
        ({"joints": 3}, "joints"),
        ({"points": "a"}, "points"),
        ({"points": ["a", "b", "c", 1]}, "points"),
        ({"points": ["a", "b", "c", " "]}, "points"),
        ({"points": ["a", "b", "c", "A"]}, "letters and digits"),
        ({"points": ["a", "b", "c", "++"]}, "letters and digits"),
        ({"points": [f"p{k}" for k in range(1001)]}, "points"),
        ({"landmarks": {}}, "landmarks"),
        ({"landmarks": ["a"]}, "landmarks"),
        ({"landmarks": {"noze": "a"}}, "did you mean nose"),
        ({"landmarks": {"nose": "d"}}, "landmarks.nose"),
        ({"landmarks": {"nose": []}}, "landmarks.nose"),
        ({"landmarks": {"nose": [1]}}, "landmarks.nose"),
        ({"landmarks": {"nose": ["a", "a"]}}, "repeated"),
        ({"landmarks": {"left_hip": "a", "right_hip": "a"}}, "of its own for each side"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(change: dict, said: str) -> None:
    with pytest.raises(InputError) as caught:
        skeleton_map_of(validated(SkeletonMapTable, GOOD | change, "mine.toml"), "mine.toml")
    assert said in str(caught.value) and "\n" not in str(caught.value)
    assert str(caught.value).startswith("mine.toml")


def test_a_map_of_ones_own_is_loaded_from_its_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        'schema = "posekit.skeleton_map/1"\npoints = ["Nase"]\n[landmarks]\nnose = "Nase"\n',
        encoding="utf-8",
    )
    layout = load_skeleton_map(file)
    assert isinstance(layout, SkeletonMap) and layout.points == ("Nase",) and layout.name == str(file)


@pytest.mark.parametrize("name", ["coco17", "", "a\0b", "no/such.toml", "x" * 300])
def test_a_map_that_is_not_there_is_refused_in_one_line(name: str) -> None:
    with pytest.raises(InputError) as caught:
        load_skeleton_map(name)
    assert "\n" not in str(caught.value)


def test_feet_are_picked_by_their_names_and_change_sides_with_the_rest() -> None:
    layout = load_skeleton_map("body_25")
    values = np.random.default_rng(0).normal(size=(3, len(layout.points), 2))
    feet = layout.gather_feet(values)
    np.testing.assert_array_equal(feet[:, 0], values[:, layout.points.index("RBigToe")])
    np.testing.assert_array_equal(layout.swapped().gather_feet(values), feet[:, [1, 0, 3, 2]])
    order = np.arange(len(layout.points))[::-1]
    over = layout.over([layout.points[k] for k in order])
    np.testing.assert_array_equal(over.gather_feet(values[:, order]), feet)
    assert np.isnan(load_skeleton_map("coco_17").gather_feet(values[:, :17])).all()
