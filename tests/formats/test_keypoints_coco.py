"""COCO's annotations and results: read as a plain loop reads them, written so that they are read again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints
from posekit.formats.keypoints.reading import read_keypoints
from posekit.formats.recognising import recognise
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from tests.detector_files import suiting, write_keypoints

COCO = load_skeleton_map("coco_17")


def annotation(image: object, keypoints: Sequence[object], **more: object) -> dict:
    return {"id": 1, "image_id": image, "category_id": 1, "iscrowd": 0, "keypoints": keypoints} | more


def document(people: list[dict], **more: object) -> dict:
    return {
        "images": [
            {"id": 7, "file_name": "b.jpg", "width": 640, "height": 480},
            {"id": 3, "file_name": "a.jpg", "width": 320, "height": 200},
            {"id": 5, "file_name": "c.jpg", "width": 100, "height": 100},
        ],
        "annotations": people,
        "categories": [{"id": 1, "name": "person", "keypoints": list(COCO.points)}],
    } | more


def save(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def flags(rng: np.random.Generator, count: int = 17) -> list[float]:
    values = np.column_stack([rng.integers(1, 300, (count, 2)), rng.integers(0, 3, count)])
    values[0, 2] = 2
    values[values[:, 2] == 0] = 0
    return [int(value) for value in values.ravel()]


@st.composite
def people(draw: st.DrawFn, layouts: tuple[str, ...]) -> KeyPoints:
    layout = load_skeleton_map(draw(st.sampled_from(layouts)))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    pictures, count = draw(st.integers(1, 4)), draw(st.integers(0, 5))
    shape = (count, len(layout.points))
    points = rng.uniform(-50, 4000, (*shape, 2)).round(draw(st.integers(0, 9)))
    missing = rng.random(shape) < draw(st.floats(0, 1))
    missing[:, 0] = False
    points[missing] = np.nan
    return KeyPoints(
        format="made",
        source="made",
        layout=layout,
        pictures=tuple(f"{number:012d}.jpg" for number in np.cumsum(rng.integers(1, 999, pictures))),
        size=np.where(rng.random((pictures, 1)) < 0.3, np.nan, rng.integers(1, 5000, (pictures, 2))),
        frame=np.sort(rng.integers(0, pictures, count)),
        points=points,
        confidence=np.where(missing, np.nan, rng.random(shape)),
        occluded=~missing & (rng.random(shape) < 0.3),
        score=np.where(rng.random(count) < 0.5, np.nan, rng.random(count)),
        person=rng.integers(-1, 4, count),
    )


@settings(deadline=None, max_examples=40)
@given(people(("coco_17", "halpe_26", "halpe_136", "h36m_17", "body_25", "body_25b", "coco_18")))
def test_annotations_come_back_but_for_times_and_confidences(
    tmp_path_factory: pytest.TempPathFactory, keypoints: KeyPoints
) -> None:
    path = tmp_path_factory.mktemp("out") / "people.json"
    write_keypoints(path, keypoints, "coco")
    assert suiting(path) == ["coco"]
    again = read_keypoints(path)  # the names of the points are in the file
    assert again.layout.name == keypoints.layout.name and again.pictures == keypoints.pictures
    for name in ("frame", "points", "occluded", "score", "person", "size"):
        np.testing.assert_array_equal(getattr(again, name), getattr(keypoints, name), err_msg=name)
    assert np.isnan(again.confidence).all()


@settings(deadline=None, max_examples=40)
@given(people(("coco_17", "halpe_26", "halpe_136", "h36m_17", "body_25")))
def test_results_come_back_but_for_what_a_list_of_people_has_not(
    tmp_path_factory: pytest.TempPathFactory, keypoints: KeyPoints
) -> None:
    path = tmp_path_factory.mktemp("out") / "results.json"
    write_keypoints(path, keypoints, "coco-results")
    if len(keypoints):
        assert suiting(path) == ["coco-results"]
    again = read_keypoints(path, "coco-results", layout=keypoints.layout)
    used = np.unique(keypoints.frame)
    assert again.pictures == tuple(str(int(keypoints.pictures[k].removesuffix(".jpg"))) for k in used)
    np.testing.assert_array_equal(again.frame, np.searchsorted(used, keypoints.frame))
    for name in ("points", "confidence", "person"):
        np.testing.assert_array_equal(getattr(again, name), getattr(keypoints, name), err_msg=name)
    np.testing.assert_array_equal(again.score, np.nan_to_num(keypoints.score, nan=1.0))
    assert not again.occluded.any() and np.isnan(again.size).all()


def test_annotations_are_read_as_a_plain_loop_reads_them(tmp_path: Path, rng: np.random.Generator) -> None:
    given_people = [
        annotation(5, flags(rng)),
        annotation(7, flags(rng), score=0.25, track_id=4),
        annotation(3, flags(rng), iscrowd=1),
        annotation(7, [0] * 51),
        annotation(5, flags(rng)),
    ]
    read = read_keypoints(save(tmp_path / "x.json", document(given_people)))
    assert read.pictures == (
        "b.jpg",
        "a.jpg",
        "c.jpg",
    )  # the file's order; a.jpg has nobody, and keeps its place
    assert read.size.tolist() == [[640, 480], [320, 200], [100, 100]]
    assert read.frame.tolist() == [0, 2, 2]
    assert read.person.tolist() == [4, -1, -1]
    assert read.score[0] == 0.25 and np.isnan(read.score[1:]).all()
    for row, one in enumerate((given_people[1], given_people[0], given_people[4])):
        for k in range(17):
            x, y, v = one["keypoints"][3 * k : 3 * k + 3]
            assert bool(read.occluded[row, k]) == (v == 1)
            assert read.points[row, k].tolist() == [x, y] if v else np.isnan(read.points[row, k]).all()
    assert np.isnan(read.confidence).all() and read.layout is not None and read.layout.name == "coco_17"


def test_a_visible_point_in_the_corner_is_one(tmp_path: Path, rng: np.random.Generator) -> None:
    values = flags(rng)
    values[3:9] = [0, 0, 2, 31, 32, 0]
    read = read_keypoints(save(tmp_path / "x.json", document([annotation(7, values)])))
    assert read.points[0, 1].tolist() == [0, 0] and np.isnan(read.points[0, 2]).all()


def test_a_detectors_confidences_in_place_of_flags_are_kept(tmp_path: Path, rng: np.random.Generator) -> None:
    values = np.column_stack([rng.uniform(1, 300, (17, 2)), rng.uniform(0, 1, 17)])
    values[3], values[4, 2], values[5, 2] = 0, 1.0, 0.0
    read = read_keypoints(save(tmp_path / "x.json", document([annotation(7, values.ravel().tolist())])))
    assert np.isnan(read.points[0, 3]).all() and np.isnan(read.confidence[0, 3])
    assert read.confidence[0, 4] == 1 and not read.occluded.any()
    assert read.points[0, 5].tolist() == values[5, :2].tolist() and read.confidence[0, 5] == 0


def test_the_names_in_the_file_count_before_the_number(tmp_path: Path, rng: np.random.Generator) -> None:
    """17 points in an order of their own are neither COCO's nor Human3.6M's order."""
    order = rng.permutation(17)
    names = [COCO.points[k].replace("left_", "Left-") for k in order]
    values = flags(rng)
    shuffled = [value for k in order for value in values[3 * k : 3 * k + 3]]
    categories = [{"id": 1, "keypoints": names}]
    read = read_keypoints(
        save(tmp_path / "x.json", document([annotation(7, shuffled)], categories=categories))
    )
    plain = read_keypoints(save(tmp_path / "y.json", document([annotation(7, values)])))
    assert read.layout.points == tuple(names)
    np.testing.assert_array_equal(read.landmarks, plain.landmarks)


def test_human36m_is_read_when_named_and_never_guessed(tmp_path: Path, rng: np.random.Generator) -> None:
    values = flags(rng)
    named = [{"id": 1, "keypoints": list(load_skeleton_map("h36m_17").points)}]
    path = save(tmp_path / "x.json", document([annotation(7, values)], categories=named))
    assert read_keypoints(path).layout.name == "h36m_17"
    unnamed = save(tmp_path / "y.json", document([annotation(7, values)], categories=[]))
    assert read_keypoints(unnamed).layout.name == "coco_17"
    assert read_keypoints(unnamed, "coco-h36m_17").layout.name == "h36m_17"
    results = save(tmp_path / "z.json", [{"image_id": 1, "category_id": 1, "keypoints": values, "score": 1}])
    assert read_keypoints(results).layout.name == "coco_17"
    assert read_keypoints(results, "coco-results-h36m_17").layout.name == "h36m_17"


@pytest.mark.parametrize(("count", "name"), [(26, "halpe_26"), (136, "halpe_136"), (18, "coco_18")])
def test_points_without_names_are_what_their_number_says(
    tmp_path: Path, rng: np.random.Generator, count: int, name: str
) -> None:
    values = flags(rng, count)
    one = save(
        tmp_path / "x.json", document([annotation(7, values)], categories=[{"id": 1, "name": "person"}])
    )
    assert read_keypoints(one).layout.name == name
    other = save(tmp_path / "y.json", [{"image_id": 1, "keypoints": values}])
    assert read_keypoints(other).layout.name == name


def test_numbers_that_do_not_tell_name_the_candidates(tmp_path: Path, rng: np.random.Generator) -> None:
    path = save(tmp_path / "x.json", document([annotation(7, flags(rng, 25))], categories=[]))
    with pytest.raises(InputError, match=r"body_25 or body_25b.*--skeleton"):
        read_keypoints(path)
    assert read_keypoints(path, layout=load_skeleton_map("body_25b")).layout.name == "body_25b"
    with pytest.raises(InputError, match=r"24 without names.*--skeleton"):
        read_keypoints(save(tmp_path / "y.json", document([annotation(7, flags(rng, 24))], categories=[])))


def test_a_map_of_ones_own_goes_by_name_or_by_order(tmp_path: Path, rng: np.random.Generator) -> None:
    mine = SkeletonMap(name="mine", points=(), landmarks={"nose": ("tip",), "left_hip": ("hl",)})
    values = [1, 2, 2, 3, 4, 2, 5, 6, 2]
    named = save(
        tmp_path / "x.json",
        document([annotation(7, values)], categories=[{"id": 1, "keypoints": ["hl", "x", "tip"]}]),
    )
    read = read_keypoints(named, layout=mine)
    assert read.layout.points == ("hl", "x", "tip") and read.layout.gather(read.points)[0, 14].tolist() == [
        5,
        6,
    ]
    unnamed = save(tmp_path / "y.json", document([annotation(7, values)], categories=[]))
    with pytest.raises(InputError, match="3 points without names; expected what skeleton map mine names"):
        read_keypoints(unnamed, layout=mine)
    ordered = SkeletonMap(name="mine", points=("a", "b", "c"), landmarks={"nose": ("b",)})
    assert read_keypoints(unnamed, layout=ordered).points[0, 1].tolist() == [3, 4]


def test_of_several_kinds_of_creatures_the_people_are_read(tmp_path: Path, rng: np.random.Generator) -> None:
    categories = [
        {"id": 1, "keypoints": list(COCO.points)},
        {"id": 2, "keypoints": ["nose", "tail", "left_paw"]},
        {"id": 3, "name": "chair"},
    ]
    given_people = [
        annotation(7, [1, 2, 2] * 3, category_id=2),
        annotation(7, flags(rng)),
        {"id": 9, "image_id": 7, "category_id": 3, "bbox": [0, 0, 1, 1]},
    ]
    read = read_keypoints(save(tmp_path / "x.json", document(given_people, categories=categories)))
    assert len(read) == 1 and read.layout.name == "coco_17"
    two = [*categories, {"id": 4, "keypoints": list(load_skeleton_map("h36m_17").points)}]
    both = [annotation(7, flags(rng)), annotation(7, flags(rng), category_id=4)]
    with pytest.raises(InputError, match="2 kinds of people"):
        read_keypoints(save(tmp_path / "y.json", document(both, categories=two)))


def test_a_file_without_images_has_the_pictures_of_its_people(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    given_people = [annotation(12, flags(rng)), annotation(2, flags(rng))]
    content = document(given_people)
    del content["images"]
    read = read_keypoints(save(tmp_path / "x.json", content))
    assert read.pictures == ("2", "12") and read.frame.tolist() == [0, 1]
    np.testing.assert_array_equal(read.points[0, 0], given_people[1]["keypoints"][:2])


def test_pictures_whose_files_have_one_name_are_called_by_their_ids(tmp_path: Path) -> None:
    images = [{"id": 1, "file_name": "x.jpg"}, {"id": 2, "file_name": "x.jpg"}]
    assert read_keypoints(save(tmp_path / "x.json", document([], images=images))).pictures == ("1", "2")


def test_nobody_anywhere_is_no_error(tmp_path: Path) -> None:
    read = read_keypoints(save(tmp_path / "x.json", document([])))
    assert len(read) == 0 and read.points.shape == (0, 17, 2) and len(read.pictures) == 3
    empty = save(tmp_path / "y.json", [])
    assert len(read_keypoints(empty, "coco-results")) == 0


def test_results_are_ordered_by_picture(tmp_path: Path, rng: np.random.Generator) -> None:
    values = [flags(rng) for _ in range(4)]
    found = [
        {"image_id": k, "keypoints": one, "score": k / 10}
        for k, one in zip((10, 2, 7, 2), values, strict=True)
    ]
    read = read_keypoints(save(tmp_path / "x.json", found))
    assert read.pictures == ("2", "7", "10") and read.frame.tolist() == [0, 0, 1, 2]
    assert read.score.tolist() == [0.2, 0.2, 0.7, 1.0]
    np.testing.assert_array_equal(read.points[1, 0], values[3][:2])


def test_results_keep_a_missing_point_missing_and_a_confidence_beyond_one(tmp_path: Path) -> None:
    values = [0, 0, 0.9, 5, 6, 5.5] + [1, 1, 0] * 15
    read = read_keypoints(save(tmp_path / "x.json", [{"image_id": 1, "keypoints": values}]))
    assert np.isnan(read.points[0, 0]).all() and read.confidence[0, 1] == 5.5


def test_pictures_whose_names_are_no_numbers_are_counted(tmp_path: Path, rng: np.random.Generator) -> None:
    keypoints = KeyPoints(
        format="",
        source="",
        layout=COCO,
        pictures=("x.jpg", "y.jpg"),
        frame=np.array([0, 1]),
        points=rng.uniform(5, 9, (2, 17, 2)),
    )
    write_keypoints(tmp_path / "r.json", keypoints, "coco-results")
    assert read_keypoints(tmp_path / "r.json").pictures == ("0", "1")
    write_keypoints(tmp_path / "a.json", keypoints, "coco")
    assert read_keypoints(tmp_path / "a.json").pictures == ("x.jpg", "y.jpg")


V = [1, 2, 2] * 17
DAMAGED = [
    (document([annotation(7, V)], images={"id": 7}), "images: got an object"),
    (document([annotation(7, V)], images=[{"id": 7}, {"id": 7}]), r"images\[1\].id: got 7 twice"),
    (document([annotation(7, V)], images=[{"file_name": "a"}]), r"images\[0\].id"),
    (document([annotation(7, V)], images=[{"id": 7, "width": -3}]), r"images\[0\].width: got -3"),
    (document([annotation(7, V)], images=[{"id": 7, "width": "3"}]), r"images\[0\].width"),
    (
        document([annotation(8, V)]),
        r"annotations\[0\].image_id: got 8; expected the id of one of the 3 images",
    ),
    (document([annotation([7], V)]), r"annotations\[0\].image_id"),
    (document([annotation(True, V)]), r"annotations\[0\].image_id"),
    (document([annotation(7, V), annotation(7, V[:-3])]), "expected 17"),
    (document([annotation(7, V[:-1])]), "50 numbers"),
    (document([annotation(7, [])]), "0 numbers"),
    (document([annotation(7, ["1", 2, 2] * 17)]), 'got "1"'),
    (document([annotation(7, [[1, 2, 2]] * 17)]), "17 numbers|flat list"),
    (document([annotation(7, [1, 2, 3] * 17)]), "v = 3"),
    (document([annotation(7, [1, 2, -1] * 17)]), "v = -1"),
    (document([annotation(7, [1, None, 2] * 17)]), "two numbers"),
    (document([annotation(7, [1e7, 2, 2] * 17)]), "two numbers up to"),
    (document([annotation(7, V, score="high")]), r"score: got \"high\""),
    (document([annotation(7, V, track_id=-7)]), "track_id: got -7"),
    (document([annotation(7, V)], categories=[{"id": 1, "keypoints": ["a"] * 16}]), "16 names for 17"),
    (document([annotation(7, V)], categories=[{"id": 1, "keypoints": ["a"] * 17}]), '"a" twice'),
    (
        document([annotation(7, V)], categories=[{"id": 1, "keypoints": [f"p{k}" for k in range(17)]}]),
        "--skeleton",
    ),
    (document([3]), "annotations"),  # type: ignore[list-item]
    ({"annotations": [{"id": 1, "bbox": [1, 2, 3, 4]}]}, "person_keypoints"),
    ({"images": []}, "annotations"),
    ([], "annotations"),
]


@pytest.mark.parametrize(("content", "said"), DAMAGED)
def test_damaged_annotations_are_told_in_one_line(tmp_path: Path, content: object, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        read_keypoints(save(tmp_path / "x.json", content), "coco")
    assert "\n" not in str(caught.value) and str(caught.value).startswith(str(tmp_path))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"annotations": []}, "a list of people"),
        ([3], r"\[0\]: got 3"),
        ([{"image_id": 1}], r"\[0\]"),
        ([{"keypoints": V}], "image_id: got null"),
        (
            [{"image_id": 1, "keypoints": V}, {"image_id": 1, "keypoints": V * 2}],
            r"\[1\].keypoints: got 34 points",
        ),
        ([{"image_id": 1, "keypoints": V, "score": [1]}], "score"),
    ],
)
def test_damaged_results_are_told_in_one_line(tmp_path: Path, content: object, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        read_keypoints(save(tmp_path / "x.json", content), "coco-results")
    assert "\n" not in str(caught.value)


def test_a_folder_of_one_file_is_read_as_the_file(tmp_path: Path) -> None:
    folder = tmp_path / "annotations"
    folder.mkdir()
    file = save(folder / "coco.json", document([annotation(7, flags(np.random.default_rng(0)))]))
    for format in (None, "coco"):
        found, alone = read_keypoints(folder, format), read_keypoints(file, format)
        np.testing.assert_array_equal(found.points, alone.points)
        assert found.pictures == alone.pictures
    assert [one.name for one in recognise(folder).formats] == ["coco"]
    save(folder / "more.json", document([]))
    with pytest.raises(InputError, match="a folder whose first file"):
        read_keypoints(folder)
