"""Which format a file is in: by its structure, never by its name; and the type that all formats become."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints import KeyPoints, reading
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.reading import (
    chosen,
    is_format,
    key_point_formats,
    read_keypoints,
)
from posekit.formats.skeleton_maps import load_skeleton_map, skeleton_map_names
from tests.detector_files import suiting

COCO = load_skeleton_map("coco_17")
PERSON = [40, 50, 2] * 17
FILES = {
    "openpose": {"version": 1.3, "people": [{"pose_keypoints_2d": [9, 9, 0.5] * 18}]},
    "coco": {"images": [{"id": 1}], "annotations": [{"image_id": 1, "keypoints": PERSON}]},
    "coco-results": [{"image_id": 1, "category_id": 1, "keypoints": PERSON, "score": 1.0}],
    "coco-wholebody": [{"image_id": 1, "keypoints": PERSON, "foot_kpts": [9, 9, 1] * 6}],
}


def made(**more: object) -> KeyPoints:
    values: dict = {
        "format": "made",
        "source": "made.json",
        "layout": COCO,
        "pictures": ("a", "b"),
        "frame": np.array([0, 1, 1]),
        "points": np.arange(102.0).reshape(3, 17, 2),
    }
    return KeyPoints(**(values | more))


@pytest.mark.parametrize("name", sorted(FILES))
@pytest.mark.parametrize("file", ["x.json", "results.txt", "noending", "openpose_coco.JSON"])
def test_a_file_is_one_format_whatever_it_is_called(tmp_path: Path, name: str, file: str) -> None:
    path = tmp_path / file
    path.write_text("\n " + json.dumps(FILES[name]), encoding="utf-8")
    assert suiting(path) == [name]
    assert read_keypoints(path).format == name


def test_every_format_says_what_it_is() -> None:
    for name, one in key_point_formats().items():
        assert one.name == name and one.title and "\n" not in one.title
        assert set(one.skeletons) <= set(skeleton_map_names())


def test_a_file_that_could_be_several_formats_names_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(given: GivenFile, layout: object) -> KeyPoints:
        raise AssertionError("an ambiguous file was read")

    twins = {
        name: KeyPointFormat(name=name, title=name, looks_like=lambda given: True, read=never)
        for name in ("left", "right")
    }
    monkeypatch.setattr(reading, "key_point_formats", lambda: twins)
    (tmp_path / "x.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"a file that is left or right.*--format"):
        read_keypoints(tmp_path / "x.json")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"cameras": [], "frames": 3, "people_": {}}', r'3 entries \("cameras", "frames", "people_"\)'),
        ("[]", r"got \[\]"),
        ('[{"x": 1}, {"x": 2}]', r'a list of 2 entries, the first an object of 1 entries \("x"\)'),
        ("3", "got 3"),
        ("null", "got null"),
        ('{"people": [{"name": "x"}]}', '"people"'),
    ],
)
def test_a_file_of_no_format_is_described(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "x.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        read_keypoints(tmp_path / "x.json")
    assert "openpose, coco, coco-results" in str(caught.value) and "\n" not in str(caught.value)


def test_other_files_are_described_too(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text('[cam_01]\nname = "a"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"a text that begins with \"\[cam_01\]\""):
        read_keypoints(tmp_path / "x.toml")
    (tmp_path / "x.bin").write_bytes(b"\xff\xfe\x00\x01" * 9)
    with pytest.raises(InputError, match="neither JSON nor text"):
        read_keypoints(tmp_path / "x.bin")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.json").write_text('{"x": 1}', encoding="utf-8")
    with pytest.raises(InputError, match=r"a folder whose first file, a\.json, is an object"):
        read_keypoints(tmp_path / "in")


@pytest.mark.parametrize("name", sorted(FILES))
@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_a_truncated_file_is_told_with_its_line_and_column(tmp_path: Path, name: str, share: float) -> None:
    text = json.dumps(FILES[name], indent=1)
    cut = text[: int(share * (len(text) - 3))]
    (tmp_path / "x.json").write_text(cut, encoding="utf-8")
    for format in (None, name):
        with pytest.raises(InputError, match=r"line \d+ column \d+") as caught:
            read_keypoints(tmp_path / "x.json", format)
        assert f"line {cut.count(chr(10)) + 1} " in str(caught.value)


@pytest.mark.parametrize("file", ["big.json", "big.csv", "big"])
def test_a_file_of_two_gigabytes_is_refused_unread(
    tmp_path: Path, file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (tmp_path / file).open("wb") as sparse:
        sparse.truncate(2_000_000_000)

    def never(descriptor: int, *_: object) -> object:
        raise AssertionError("opened")

    monkeypatch.setattr(os, "fdopen", never)
    with pytest.raises(InputError, match=r"2,000\.0 MB; expected at most 500 MB; split"):
        read_keypoints(tmp_path / file)


ODD: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    1.5,
    1e308,
    10**300,
    "",
    "x",
    [],
    {},
    [[]],
    [None],
    {"keypoints": []},
    [1, 2, 3],
)


def mutated(content: Any, rng: np.random.Generator) -> Any:
    """Put something odd in the place of a node, at random depth, or take the node away."""
    content = json.loads(json.dumps(content))
    node = content
    while True:
        keys = (
            list(node) if isinstance(node, dict) else list(range(len(node))) if isinstance(node, list) else []
        )
        if not keys:
            return content
        key = keys[rng.integers(min(len(keys), 8))]
        inside = node[key]
        if isinstance(inside, dict | list) and inside and rng.random() < 0.7:
            node = inside
        elif rng.random() < 0.2:
            del node[key]
            return content
        else:
            node[key] = ODD[rng.integers(len(ODD))]
            return content


@pytest.mark.parametrize("name", sorted(FILES))
def test_whatever_is_wrong_in_a_file_is_one_line(tmp_path: Path, name: str, rng: np.random.Generator) -> None:
    refused = 0
    for _ in range(40):
        content = mutated(FILES[name], rng)
        (tmp_path / "x.json").write_text(json.dumps(content), encoding="utf-8")
        for format in (None, *sorted(FILES)):
            try:
                read_keypoints(tmp_path / "x.json", format)
            except InputError as error:
                refused += 1
                assert "\n" not in str(error), content
    assert refused > 80  # four of five readings are of another format


@pytest.mark.parametrize("name", ["gone.json", "gone", "x" * 300, "a\0b"])
def test_a_file_that_is_not_there_is_one_line(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="a readable file") as caught:
        read_keypoints(f"{tmp_path}/{name}")
    assert "\n" not in str(caught.value)


def test_a_device_and_an_empty_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_bytes(b"")
    with pytest.raises(InputError, match="an empty file"):
        read_keypoints(tmp_path / "x.json")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="a pipe or a device"):
        read_keypoints(tmp_path / "pipe")


def test_a_format_may_be_named_with_a_layout() -> None:
    assert chosen("openpose")[1] is None
    one, layout = chosen("coco-results-h36m_17")
    assert one.name == "coco-results" and layout is not None and layout.name == "h36m_17"
    assert chosen("coco-halpe_26")[0].name == "coco"
    assert is_format("coco-halpe_26") and is_format("coco") and not is_format("coco-halpe_27")
    for wrong, said in {
        "openpose-body25": "did you mean openpose-body_25",
        "opnpose": "did you mean openpose",
        "openpose-h36m_17": "openpose",
        "": "valid names are",
        "coco-": "coco",
    }.items():
        with pytest.raises(InputError, match=said):
            chosen(wrong)


def test_the_users_map_counts_before_the_one_named_with_the_format(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text(json.dumps(FILES["coco-results"]), encoding="utf-8")
    layout = load_skeleton_map("coco_17")
    assert read_keypoints(tmp_path / "x.json", "coco-results-h36m_17", layout).layout is layout


def test_what_is_not_given_is_not_known() -> None:
    one = made()
    assert np.isnan(one.confidence).all() and np.isnan(one.size).all() and np.isnan(one.time).all()
    assert (one.person == -1).all() and not one.occluded.any() and np.isnan(one.score).all() and len(one) == 3
    with pytest.raises(ValueError, match="read-only"):
        one.points[0, 0, 0] = 1.0


def with_point(*value: float) -> np.ndarray:
    points = np.arange(102.0).reshape(3, 17, 2)
    points[2, 3] = value
    return points


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"points": with_point(np.inf, 3)}, r"b: left_ear: got \[inf, 3.0\]"),
        ({"points": with_point(np.nan, 3)}, r"b: left_ear: got \[nan, 3.0\]"),
        ({"points": with_point(2e6, 3)}, "left_ear"),
        ({"points": np.zeros((3, 16, 2))}, "shape"),
        ({"frame": np.array([0, 1])}, "shape"),
        ({"frame": np.array([1, 0, 1])}, "order of their pictures"),
        ({"frame": np.array([0, 1, 2])}, "order of their pictures"),
        ({"frame": np.array([-1, 0, 1])}, "order of their pictures"),
        ({"size": np.array([[1.0, 2.0], [0.0, 3.0]])}, "b: size: got 0.0"),
        ({"size": np.array([[np.inf, 2.0], [1.0, 3.0]])}, "a: size: got inf"),
        ({"time": np.array([0.0, np.inf])}, "b: time"),
        ({"confidence": np.full((3, 17), np.inf)}, "a: confidence"),
        ({"score": np.array([0.0, 1.0, -np.inf])}, "b: score"),
        ({"person": np.array([0, 1, -2])}, "b: person: got -2"),
    ],
)
def test_key_points_that_cannot_be_are_refused(more: dict, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        made(**more)
    assert str(caught.value).startswith("made.json") and "\n" not in str(caught.value)


def test_a_large_file_of_people_is_read(tmp_path: Path) -> None:
    """The bounds on lists and objects leave room for the largest published files: 6 of them a person."""
    person = {
        "image_id": 1,
        "keypoints": PERSON,
        "bbox": [1, 2, 3, 4],
        "segmentation": [[1, 2, 3], [4, 5, 6]],
    }
    content = {"images": [{"id": 1}], "annotations": [person] * 20_000}
    (tmp_path / "x.json").write_text(json.dumps(content), encoding="utf-8")
    assert len(read_keypoints(tmp_path / "x.json")) == 20_000
