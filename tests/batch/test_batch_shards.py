"""A shard's rows are what `recover` finds in its frames, each frame once, whatever it is cut out of."""

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from posekit.batch import Recipe, Shard, run_shard, write_view_table
from posekit.batch.durable import PARTS_FOLDER
from posekit.batch.image_rows import ImageRows, head_text, nothing_seen, read_head
from posekit.batch.shard import SHARDS_FOLDER, finished, portions, shards_of
from posekit.batch.staging import STAGED_FOLDER, Staged, Staging, stage
from posekit.batch.view_table import open_view_table, read_rows, write_rows
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.motion.survivors import COORDINATE_COLUMNS
from posekit.formats.motion.survivors_files import read_survivors
from posekit.formats.own import View, read_view, write_view
from posekit.recovery import recover
from posekit.recovery.recovery import Recovery
from posekit.settings import MEASURED_TOLERANCE, PartialTolerance, RecoverSettings
from posekit.settings.scale import parse_scale
from posekit.skeleton import JOINTS
from posekit.synthesis import random_views
from posekit.views.builtin import builtin_view, forget_camera, view_of
from posekit.views.opening import open_views
from posekit.views.source import Source
from tests.detector_files import view_keypoints, write_keypoints


def seen(count: int, seed: int = 0) -> View:
    return view_of(random_views(load_figure(), count, np.random.default_rng(seed)))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "run"
    for name in (SHARDS_FOLDER, STAGED_FOLDER, PARTS_FOLDER):
        (place / name).mkdir(parents=True)
    return place


def opened(path: Path, folder: Path, recipe: Recipe) -> Staged:
    return stage(Staging(name=path.name, path=path, folder=folder, recipe=recipe, reading="r"))


def shards(path: Path, folder: Path, recipe: Recipe) -> list[Shard]:
    return list(shards_of(opened(path, folder, recipe), recipe, "settings", folder))


def table(path: Path, folder: Path, recipe: Recipe) -> pd.DataFrame:
    made = shards(path, folder, recipe)
    for shard in made:
        run_shard(shard)
    return pd.concat([pd.read_parquet(shard.path) for shard in made], ignore_index=True)


def assert_same(rows: pd.DataFrame, recovery: Recovery, allowed: float = 0.0) -> None:
    """Compare the rows of frames that have survivors with a recovery's."""
    rows = rows[rows.survivor >= 0]
    joints = np.concatenate([frame.joints for frame in recovery.frames]).reshape(-1, len(COORDINATE_COLUMNS))
    assert rows.branches.tolist() == [code for frame in recovery.frames for code in frame.branches]
    np.testing.assert_allclose(rows[list(COORDINATE_COLUMNS)].to_numpy(), joints, rtol=0, atol=allowed)
    residual = np.concatenate([frame.length_residual for frame in recovery.frames])
    np.testing.assert_allclose(rows.length_residual, residual, rtol=0, atol=allowed)


def test_survivors_are_those_of_recover(tmp_path: Path, folder: Path) -> None:
    view = seen(12)
    write_view_table(tmp_path / "view.parquet", view)
    rows = table(tmp_path / "view.parquet", folder, Recipe(q=True, margins=True))
    recovery = recover(view)
    assert_same(rows, recovery)
    names = [f"q.{name}" for name in recovery.figure.configuration_names]
    np.testing.assert_array_equal(rows[names].to_numpy(), np.concatenate([f.q for f in recovery.frames]))
    for check in ("rigid_parts", "joint_range", "collision"):
        margin = np.concatenate([frame.margins[check] for frame in recovery.frames])
        np.testing.assert_array_equal(rows[f"margin.{check}"], np.where(np.isinf(margin), np.nan, margin))
    np.testing.assert_array_equal(rows.probability, np.concatenate(recovery.probability))
    np.testing.assert_allclose(rows.groupby("frame").probability.sum(), 1)
    each = rows.drop_duplicates("frame")
    assert each.survivors.tolist() == [len(frame) for frame in recovery.frames]
    assert [json.loads(text) for text in each.rejected] == [frame.rejected for frame in recovery.frames]
    assert set(each.judged) == {"exact"}


@pytest.mark.parametrize("how", ["uncalibrated", "placed", "lee-chen", "tolerant"])
def test_every_kind_of_view(how: str, tmp_path: Path, folder: Path) -> None:
    view, recipe = seen(4, 1), Recipe()
    options: dict[str, Any] = {}
    if how == "uncalibrated":
        view, recipe = forget_camera(view), Recipe(settings=RecoverSettings(scale="closure"))
        options = {"scale": parse_scale("closure")}
    elif how == "placed":
        view = replace(view, root=np.empty(0), head_image=np.empty(0), deviation=2.0)
    elif how == "lee-chen":
        view = builtin_view("seq1")
    else:
        recipe = Recipe(
            settings=RecoverSettings(
                tolerance=PartialTolerance(rigid=0.02), checks=("rigid-parts", "joint-range")
            )
        )
        options = {
            "checks": ("rigid-parts", "joint-range"),
            "tolerance": replace(MEASURED_TOLERANCE, rigid=0.02, hips=1.0),
        }
    write_view(tmp_path / "view.json", view)
    rows = table(tmp_path / "view.json", folder, recipe)
    recovery = recover(read_view(tmp_path / "view.json"), **options)
    assert_same(rows, recovery)
    assert rows.frame.unique().tolist() == list(range(len(view)))
    if how == "uncalibrated":
        scales = np.concatenate([frame.scales for frame in recovery.frames])
        np.testing.assert_array_equal(rows[rows.survivor >= 0].scale, scales)
    else:
        assert rows.scale.isna().all()


def test_a_deviation_is_refused_where_it_has_no_effect() -> None:
    recipe = Recipe(source=Source(deviation=2.0))
    recipe.check_view(seen(1))
    recipe.check_view(forget_camera(seen(1)))
    with pytest.raises(InputError, match="--deviation: the view's camera is lee-chen"):
        recipe.check_view(builtin_view("seq1"))


def test_where_it_is_cut_changes_nothing(tmp_path: Path, folder: Path) -> None:
    view = seen(23, 2)
    write_view_table(tmp_path / "view.parquet", view, group=5)
    whole = table(tmp_path / "view.parquet", folder, Recipe())
    pieces = table(tmp_path / "view.parquet", folder, Recipe(shard_frames=7))
    texts = [name for name in whole if whole[name].dtype.kind not in "fi"]
    numbers = [name for name in whole if name not in texts]
    pd.testing.assert_frame_equal(whole[texts].astype(str), pieces[texts].astype(str))
    np.testing.assert_allclose(whole[numbers], pieces[numbers], rtol=0, atol=1e-12)


def test_the_same_frames_give_the_same_bytes(tmp_path: Path, folder: Path) -> None:
    write_view_table(tmp_path / "view.parquet", seen(5))
    (shard,) = shards(tmp_path / "view.parquet", folder, Recipe())
    run_shard(shard)
    first = shard.path.read_bytes()
    run_shard(shard)
    assert shard.path.read_bytes() == first
    assert list((folder / PARTS_FOLDER).iterdir()) == []
    said = finished(shard, {})
    assert said is not None and said.frames == 5
    shard.path.write_bytes(first[:-9])
    assert finished(shard, {}) is None


def test_a_frame_without_survivors_is_a_row_with_its_reason(tmp_path: Path, folder: Path) -> None:
    view = seen(6)
    image = view.image.copy()
    image[2] += 3000 * np.arange(14)[:, None]  # no body is so long
    rows = ImageRows.of_view(replace(view, image=image, head_image=np.empty(0)))
    rows.points[4, 0] = np.nan
    path = tmp_path / "view.parquet"
    with path.open("wb") as file:
        write_rows(file, head_text(view), [rows])
    found = table(path, folder, Recipe())
    each = found.drop_duplicates("frame").set_index("frame")
    assert each.index.tolist() == list(range(6))
    assert each.survivors.tolist()[2] == each.survivors.tolist()[4] == 0
    assert sum(json.loads(each.rejected[2]).values()) == 8192
    assert each.reason[4] == "the neck, from which the tree grows, is not seen"
    assert json.loads(each.rejected[4]) == {"neck/not_seen": 8192}
    empty = found[found.survivor == -1]
    assert empty.frame.tolist() == [2, 4]
    assert empty[list(COORDINATE_COLUMNS)].isna().all(axis=None)
    kept = [0, 1, 3, 5]
    alone = recover(rows.part(np.array(kept)).view(view))
    assert_same(found, alone, allowed=1e-12)


def test_frames_that_cannot_be_recovered_each_have_their_own_reason(tmp_path: Path, folder: Path) -> None:
    view = seen(2)
    image = view.image * np.array([40, 1600])[:, None, None]  # far outside any picture
    write_view_table(
        tmp_path / "view.parquet",
        replace(view, image=image, head_image=np.empty(0), root=np.empty(0), truth=np.empty(0)),
    )
    found = table(tmp_path / "view.parquet", folder, Recipe(settings=RecoverSettings(length_deviation=0.0)))
    assert found.frame.tolist() == [0, 1]
    assert (found.survivor == -1).all()
    assert all(found.reason) and not found.reason.str.startswith("frames[").any()


def test_frames_that_take_much_memory_are_recovered_in_small_pieces() -> None:
    rows = nothing_seen(np.arange(250), np.zeros(250))
    rows.points[:] = 1.0

    def sizes(*, noisy: bool = False) -> list[int]:
        pieces = list(portions(rows, noisy=noisy))
        assert [piece.start for piece in pieces[1:]] == [piece.stop for piece in pieces[:-1]]
        assert (pieces[0].start, pieces[-1].stop) == (0, 250)
        return [piece.stop - piece.start for piece in pieces]

    assert sizes() == [250]
    assert sizes(noisy=True) == [166, 84]
    rows.points[100:103, 6:] = np.nan  # no arms and legs in three of them
    assert sizes() == [100, 1, 1, 1, 147]
    rows.points[150:] = np.nan  # nothing is grown where nobody is seen
    assert sizes() == [100, 1, 1, 1, 147]


def test_a_view_table_keeps_every_bit(tmp_path: Path) -> None:
    view = replace(
        seen(9, 3), deviation=1.25, derived=("neck",), stature=1.71, lengths={"pelvis-right_hip": 0.1}
    )
    write_view_table(tmp_path / "view.parquet", view, group=4)
    made = open_view_table(tmp_path / "view.parquet")
    parts = list(read_rows(made.path, 2, 9))
    assert [len(part) for part in parts] == [2, 4, 1]
    for name in ("points", "confidence", "root", "time", "frame"):
        both = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(
            both, getattr(ImageRows.of_view(view), name)[2:], strict=name != "frame"
        )
    back_view = parts[0].view(read_head(made.head))
    assert back_view.lengths == view.lengths and back_view.stature == view.stature
    assert back_view.derived == view.derived and back_view.deviation == view.deviation
    np.testing.assert_array_equal(back_view.camera.K, view.camera.K)  # type: ignore[union-attr]


def test_arrays_and_columns_say_the_same(tmp_path: Path, folder: Path) -> None:
    view = seen(4)
    write_view_table(tmp_path / "view.parquet", view)
    np.savez(
        tmp_path / "view.npz",
        image=view.image,
        head_image=view.head_image,
        root=view.root,
        time=view.time,
        view=head_text(view),
    )
    a, b = (table(tmp_path / f"view.{suffix}", folder, Recipe()) for suffix in ("parquet", "npz"))
    pd.testing.assert_frame_equal(a.drop(columns="input"), b.drop(columns="input"))


@pytest.fixture
def detections(tmp_path: Path) -> Path:
    """A folder of what OpenPose writes, of six pictures; nobody is in the third."""
    place = tmp_path / "openpose"
    write_keypoints(place, view_keypoints(seen(6), "openpose"), "openpose")
    third = sorted(place.iterdir())[2]
    document = json.loads(third.read_text())
    third.write_text(json.dumps({**document, "people": []}))
    return place


def test_pictures_of_nobody_are_frames_too(detections: Path, folder: Path) -> None:
    source = Source(stature=1.75, rate=25.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (one,) = open_views(detections, source)
        rows = table(detections, folder, Recipe(source=source))
        recovery = recover(one.view)
    each = rows.drop_duplicates("frame")
    assert each.frame.tolist() == [0, 1, 2, 3, 4, 5]
    np.testing.assert_allclose(each.time, np.arange(6) / 25)
    assert each.reason.tolist()[2] == "no joint is seen"
    assert_same(rows, recovery, allowed=1e-9)
    assert (rows[rows.survivor >= 0].inferred == "").all()


def test_warnings_number_frames_as_the_recording_does(tmp_path: Path, folder: Path) -> None:
    view = seen(9)
    head = view.head_image.copy()
    head[7, 0] += 60.0
    write_view_table(tmp_path / "views.parquet", replace(view, head_image=head))
    one, two, three = shards(tmp_path / "views.parquet", folder, Recipe(shard_frames=3))
    assert not (run_shard(one).warnings or run_shard(two).warnings)
    (line,) = run_shard(three).warnings
    assert "in 1 of 3 frames, most in frames[7]:" in line


def test_image_points_without_a_camera_are_key_points(tmp_path: Path, folder: Path) -> None:
    """The same points as arrays and as a detector's file are the same view."""
    view = seen(5, 4)
    found = view_keypoints(view, "coco-results")
    write_keypoints(tmp_path / "coco.json", found, "coco-results")
    unknown = np.full_like(view.image[:, 0], np.nan)
    image = view.image.copy()
    image[:, [0, 3]] = unknown[:, None]  # COCO has neither neck nor pelvis
    image = np.round(image, 2)
    np.savez(tmp_path / "points.npz", image=image, head_image=np.round(view.head_image, 2))
    source = Source(fov=65.0, size=(1920, 1080), stature=1.75)
    recipe = Recipe(source=source)
    (one,) = open_views(tmp_path / "coco.json", replace(source, format="coco-results"))
    head = read_head(opened(tmp_path / "points.npz", folder, recipe).tables[0].head)
    assert head.derived == one.view.derived == ("neck", "pelvis")
    assert head.lengths == one.view.lengths
    laid = next(read_rows(Path(opened(tmp_path / "points.npz", folder, recipe).tables[0].path), 0, 5))
    np.testing.assert_allclose(laid.points[:, :14], one.view.image, atol=0.011)


def test_results_are_tables_of_survivors(tmp_path: Path, folder: Path) -> None:
    write_view_table(tmp_path / "view.parquet", seen(3))
    (shard,) = shards(tmp_path / "view.parquet", folder, Recipe())
    said = run_shard(shard)
    back = read_survivors(shard.path)
    assert len(back) == said.survivors
    assert back.joints.shape == (said.survivors, 14, 3)
    assert pq.read_metadata(shard.path).row_group(0).num_rows == said.survivors


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"frame": [0, 2, 2, 3]}, "frame: got 2 after 2"),
        ({"frame": [0, 1, None, 3]}, "frame: got null"),
        ({"time": [0.0, None, 1.0, 2.0]}, "time: got null"),
        ({"neck_u": ["a", "b", "c", "d"]}, "neck_u: got (large_)?string"),
        ({"neck_u": [1.0, float("inf"), 1.0, 1.0]}, "infinite"),
    ],
)
def test_bad_tables_are_refused_in_a_line(columns: dict, says: str, tmp_path: Path, folder: Path) -> None:
    write_view_table(tmp_path / "good.parquet", seen(4))
    good = pq.read_table(tmp_path / "good.parquet")
    changed = good.to_pandas().assign(**columns)
    made = pa.Table.from_pandas(changed, preserve_index=False)
    pq.write_table(made.replace_schema_metadata(good.schema.metadata), tmp_path / "bad.parquet")
    with pytest.raises(InputError, match=says) as caught:
        table(tmp_path / "bad.parquet", folder, Recipe())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"settings": RecoverSettings(scale="closure")}, "--scale: the view's camera is calibrated"),
        ({"settings": RecoverSettings(proportions="taylor")}, "--proportions: taylor is for uncalibrated"),
        ({"source": Source(fov=60.0)}, "--fov: .* is a view"),
        ({"source": Source(proportions="winter")}, "--proportions: 'winter'"),
    ],
)
def test_options_that_do_not_fit_are_refused_before_the_work(
    options: dict, says: str, tmp_path: Path, folder: Path
) -> None:
    write_view_table(tmp_path / "view.parquet", seen(1))
    with pytest.raises(InputError, match=says):
        opened(tmp_path / "view.parquet", folder, Recipe(**options))


def test_motion_is_no_input(tmp_path: Path, folder: Path) -> None:
    np.savez(tmp_path / "motion.npz", joints=np.zeros((2, 14, 3)), joint_names=np.array(JOINTS))
    with pytest.raises(InputError, match="expected a view or key points"):
        opened(tmp_path / "motion.npz", folder, Recipe())


def test_other_versions_are_refused() -> None:
    with pytest.raises(InputError, match=r"numpy is .*; expected 0\.1"):
        Recipe(made_with={"numpy": "0.1"}).check_versions()
