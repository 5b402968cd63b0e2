"""DeepLabCut: one person and several, names of one's own, labelled data, and damage; pandas as the writer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints
from posekit.formats.keypoints.reading import read_keypoints
from posekit.formats.skeleton_maps import load_skeleton_map, skeleton_map_of
from posekit.tables.file_model import validated
from posekit.tables.skeleton_map import SkeletonMapTable
from tests.detector_files import suiting, write_keypoints

COCO = load_skeleton_map("coco_17")


def table(
    parts: tuple[str, ...], values: np.ndarray, people: tuple[str, ...] = (), coords: str = "x y likelihood"
) -> pd.DataFrame:
    """Make the table that DeepLabCut makes (frames, people or none, parts, coords)."""
    levels = [["DLC_resnet50"], *([list(people)] if people else []), list(parts), coords.split()]
    names = ["scorer", *(["individuals"] if people else []), "bodyparts", "coords"]
    columns = pd.MultiIndex.from_product(levels, names=names)
    return pd.DataFrame(values.reshape(len(values), -1), columns=columns)


@given(seed=st.integers(0, 2**32 - 1), several=st.booleans())
def test_what_is_written_is_read_again(seed: int, several: bool, tmp_path_factory: Any) -> None:
    rng = np.random.default_rng(seed)
    people = 2 if several else 1
    rows = np.array([(f, p) for f in range(6) for p in range(people) if rng.random() < 0.7]).reshape(-1, 2)
    if several:  # both are there, so that their numbers stay
        rows = np.unique(np.concatenate([rows, [[0, 0], [0, 1]]]), axis=0)
    count = (len(rows), 17)
    points = np.where(rng.random((*count, 1)) < 0.2, np.nan, rng.uniform(-9, 2000, (*count, 2)))
    points[:, 0] = 5.0  # nobody is without any point
    there = KeyPoints(
        format="test",
        source="test",
        layout=COCO,
        pictures=tuple(map(str, range(6))),
        frame=rows[:, 0],
        points=points,
        confidence=np.where(np.isnan(points[..., 0]), np.nan, rng.random(count)),
        person=rows[:, 1] if several else np.full(len(rows), -1),
    )
    path = tmp_path_factory.mktemp("dlc") / "video.csv"
    write_keypoints(path, there, "deeplabcut")
    assert suiting(path) == ["deeplabcut"]
    back = read_keypoints(path)
    assert (back.layout.name, back.pictures) == ("coco_17", there.pictures)
    for name in ("frame", "points", "confidence", "person"):
        np.testing.assert_array_equal(getattr(back, name), getattr(there, name))


def test_pandas_reads_what_is_written(tmp_path: Path) -> None:
    points = np.random.default_rng(1).uniform(0, 99, (3, 17, 2))
    there = KeyPoints(
        format="t", source="t", layout=COCO, pictures=("0", "1", "2"), frame=np.arange(3), points=points
    )
    write_keypoints(tmp_path / "v.csv", there, "deeplabcut")
    frame = pd.read_csv(tmp_path / "v.csv", header=[0, 1, 2], index_col=0)
    assert frame.columns.names == ["scorer", "bodyparts", "coords"]
    np.testing.assert_array_equal(frame["posekit"]["left_knee"][["x", "y"]].to_numpy(), points[:, 13])


def test_pandas_tables_are_read(tmp_path: Path) -> None:
    values = np.random.default_rng(2).uniform(1, 500, (4, 17, 3))
    values[1, 3] = np.nan
    table(COCO.points, values).to_csv(tmp_path / "v.csv")
    found = read_keypoints(tmp_path / "v.csv")
    np.testing.assert_array_equal(found.points, values[..., :2])
    np.testing.assert_array_equal(found.confidence, values[..., 2])
    assert (found.person == -1).all()


def test_individuals_are_people_and_unique_points_are_none(tmp_path: Path) -> None:
    values = np.random.default_rng(3).uniform(1, 500, (3, 2, 17, 3))
    values[2, 1] = np.nan
    both = table(COCO.points, values, ("anna", "ben"))
    single = table(("corner",), np.ones((3, 1, 3)), ("single",))
    pd.concat([single, both], axis=1).to_csv(tmp_path / "v.csv")
    found = read_keypoints(tmp_path / "v.csv")
    assert found.frame.tolist() == [0, 0, 1, 1, 2]
    assert found.person.tolist() == [1, 2, 1, 2, 1]
    np.testing.assert_array_equal(found.points[1], values[0, 1, :, :2])


@pytest.mark.parametrize("split", [False, True])
def test_labelled_data_is_named_by_its_pictures(split: bool, tmp_path: Path) -> None:
    values = np.random.default_rng(4).uniform(1, 500, (2, 17, 2))
    frame = table(COCO.points, values, coords="x y")
    names = [("labeled-data", "walk", "img10.png"), ("labeled-data", "walk", "img2.png")]
    frame.index = pd.MultiIndex.from_tuples(names) if split else pd.Index(["/".join(name) for name in names])
    frame.to_csv(tmp_path / "CollectedData_anna.csv")
    found = read_keypoints(tmp_path / "CollectedData_anna.csv")
    assert found.pictures == ("labeled-data/walk/img2.png", "labeled-data/walk/img10.png")
    np.testing.assert_array_equal(found.points[1], values[0])
    assert np.isnan(found.confidence).all()


def test_names_are_found_in_any_spelling_and_in_part(tmp_path: Path) -> None:
    parts = ("Right Hip", "RightKnee", "right-ankle", "Left Hip", "LeftKnee", "left.ankle", "my toe")
    values = np.random.default_rng(5).uniform(1, 500, (2, 7, 3))
    table(parts, values).to_csv(tmp_path / "v.csv")
    found = read_keypoints(tmp_path / "v.csv")
    assert found.layout.points == parts
    assert set(found.layout.landmarks) >= {"right_knee", "left_ankle", "mid_hips"}
    assert found.landmarks[0, 10].tolist() == values[0, 1, :2].tolist()  # the right knee


def test_names_of_ones_own_need_a_map(tmp_path: Path) -> None:
    table(("snout", "tail", "paw", "ear"), np.ones((1, 4, 3))).to_csv(tmp_path / "v.csv")
    with pytest.raises(InputError, match="any built-in skeleton map; write a skeleton map"):
        read_keypoints(tmp_path / "v.csv")
    own = {"nose": "snout", "left_ear": "ear", "left_wrist": "paw", "pelvis": "tail"}
    layout = skeleton_map_of(
        validated(SkeletonMapTable, {"schema": "posekit.skeleton_map/1", "landmarks": own}, "own"), "own"
    )
    assert np.isfinite(read_keypoints(tmp_path / "v.csv", layout=layout).landmarks[0, :, 0]).sum() == 4


def test_hdf5_is_refused_with_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "v.h5"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    assert suiting(path) == ["deeplabcut"]
    with pytest.raises(InputError, match="got HDF5; expected DeepLabCut's CSV; save it with"):
        read_keypoints(path)


HEAD = "scorer,a,a,a\nbodyparts,nose,nose,nose\ncoords,x,y,likelihood\n"
BAD = {
    "short row": (HEAD + "0,1,2\n", "row 1 after the header: got 3 fields; expected 4"),
    "text": (HEAD + "0,1,b,3\n", 'got "b"; expected numbers'),
    "infinity": (HEAD + "0,1,inf,3\n", "Infinity; expected at most"),
    "huge": (HEAD + "0,1,1e12,3\n", "expected at most"),
    "no coords": ("scorer,a\nbodyparts,nose\n0,1\n", r'line 3: got "0"'),
    "other coords": (HEAD.replace("likelihood", "z") + "0,1,2,3\n", 'column 4: got "z"'),
    "x twice": ("scorer,a,a\nbodyparts,nose,nose\ncoords,x,x\n0,1,2\n", "x twice"),
    "no y": ("scorer,a\nbodyparts,nose\ncoords,x\n0,1\n", "without x or y"),
    "header rows of two lengths": ("scorer,a\nbodyparts,nose,nose\ncoords,x,y\n", "of other lengths"),
    "no columns": ("scorer,\nbodyparts,\ncoords,\n", "other lengths, or none"),
    "header alone": ("scorer,a,a\n", "without bodyparts or coords"),
}


@pytest.mark.parametrize("case", BAD)
def test_damage_is_told_in_one_line(case: str, tmp_path: Path) -> None:
    text, told = BAD[case]
    (tmp_path / "v.csv").write_text(text)
    with pytest.raises(InputError, match=told) as caught:
        read_keypoints(tmp_path / "v.csv", "deeplabcut")
    assert "\n" not in str(caught.value)
