"""Results as Parquet: a table of bodies to other programs, the whole result to posekit."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import posekit
from posekit.body import load_figure
from posekit.errors import InputError, TooLargeError
from posekit.formats.motion.survivors_files import read_survivors
from posekit.formats.own import Result, ScaledOrthographicModel, View, read_result, result_parquet
from posekit.formats.own.result import RESULT_SCHEMA
from posekit.formats.own.result_npz import pack_result
from posekit.recovery import result_output
from posekit.recovery.result import result_of
from posekit.synthesis import random_views
from posekit.views.builtin import view_of


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    scene = random_views(load_figure(), 3, np.random.default_rng(5))
    view = replace(view_of(scene), root=scene.joints_cam[:, 0])
    off = np.random.default_rng(6).normal(0, 0.5, (3, 19, 2))
    noisy = replace(
        view, image=view.image + off[:, :14], head_image=view.head_image + off[:, 14:], deviation=0.5
    )
    image = view.image.copy()
    image[1, 8:] = image[1, :1]
    photograph = View(
        camera=ScaledOrthographicModel(scale=None),
        time=view.time[:2],
        image=200 * scene.joints_cam[:2, :, :2],
    )
    exact, lost, refined, scaled = (
        posekit.recover(one) for one in (view, replace(view, image=image), noisy, photograph)
    )
    empty = result_of(lost)
    return {
        "exact": result_of(exact, unit="mm", explain=True),
        "a frame without a posture": empty,
        "no posture": replace(empty, frames=empty.frames[1:2]),
        "refined, followed": result_of(refined, following=posekit.follow(refined, k=2)),
        "uncalibrated": result_of(scaled),
    }


KINDS = ("exact", "a frame without a posture", "no posture", "refined, followed", "uncalibrated")


def packed(result: Result) -> bytes:
    """Return all that a result holds: the same arrays are the same bytes."""
    file = io.BytesIO()
    pack_result(file, result)
    return file.getvalue()


@pytest.mark.parametrize("kind", KINDS)
def test_it_holds_what_npz_does(results: dict[str, Result], kind: str, tmp_path: Path) -> None:
    for suffix in ("npz", "parquet"):
        posekit.write_result(tmp_path / f"r.{suffix}", results[kind])
    read = posekit.open(tmp_path / "r.parquet")
    assert isinstance(read, Result)
    assert (read.paths is None) == (kind != "refined, followed")
    assert packed(read) == packed(read_result(tmp_path / "r.npz"))


def test_a_recovery_saves_what_is_written_of_its_result(tmp_path: Path) -> None:
    recovery = posekit.recover(posekit.builtin_view("seq1"))
    recovery.save(tmp_path / "saved.parquet")
    posekit.write_result(tmp_path / "r.parquet", result_of(recovery))
    assert (tmp_path / "saved.parquet").read_bytes() == (tmp_path / "r.parquet").read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_others_read_a_row_a_body(results: dict[str, Result], kind: str, tmp_path: Path) -> None:
    result = results[kind]
    posekit.write_result(tmp_path / "r.parquet", result)
    table = pd.read_parquet(tmp_path / "r.parquet")
    counts = [len(frame.joints) for frame in result.frames]
    assert table["frame"].tolist() == np.repeat(np.arange(len(counts)), counts).tolist()
    assert table.shape[0] == pq.read_metadata(tmp_path / "r.parquet").num_rows == sum(counts)
    if sum(counts):
        posekit.convert(result, tmp_path / "t.parquet", posture="all")
        pd.testing.assert_frame_equal(table, pd.read_parquet(tmp_path / "t.parquet"))


def test_what_is_packed_counts_and_not_the_table(results: dict[str, Result], tmp_path: Path) -> None:
    path = tmp_path / "r.parquet"
    result_parquet.write_result_parquet(
        path, results["exact"], result_output.table_of(results["uncalibrated"])
    )
    assert packed(posekit.open(path)) == packed(results["exact"])


def test_every_changed_byte_of_a_column_is_noticed(results: dict[str, Result], tmp_path: Path) -> None:
    path = tmp_path / "r.parquet"
    posekit.write_result(path, results["exact"])
    data = path.read_bytes()
    column = pq.read_metadata(path).row_group(0).column(3)
    end = (column.dictionary_page_offset or column.data_page_offset) + column.total_compressed_size
    for place in range(end - 20, end):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
        with pytest.raises(InputError, match="undamaged Parquet file"):
            read_survivors(path)


def told(path: Path, value: bytes) -> Path:
    """Write a table of survivors that says something else of its result."""
    table = pq.read_table(path)
    with pq.ParquetWriter(path, table.schema) as writer:
        writer.write_table(table)
        writer.add_key_value_metadata({RESULT_SCHEMA: value})
    return path


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda data: b"", "archive"),
        (lambda data: b"no base64 at all", "expected an NPZ in base64"),
        (lambda data: b"\xff" * 40, "expected an NPZ in base64"),
        (lambda data: base64.b64encode(b"PAR1 is no zip"), "expected an undamaged .npz archive"),
        (lambda data: base64.b64encode(data[: len(data) // 2]), "expected an undamaged .npz archive"),
        (lambda data: base64.b64encode(data[:900] + b"\0" * 99 + data[999:]), "r.parquet: "),
    ],
)
def test_a_damaged_pack_is_refused_in_one_line(
    results: dict[str, Result], damage: Callable[[bytes], bytes], says: str, tmp_path: Path, command: Any
) -> None:
    path = tmp_path / "r.parquet"
    posekit.write_result(path, results["exact"])
    told(path, damage(packed(results["exact"])))
    done = command("inspect", path)
    assert (done.code, done.out) == (2, "")
    assert done.err.count("\n") == 1
    assert says in done.err


def test_the_bounds_of_npz_are_its_own(
    results: dict[str, Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.parquet"
    posekit.write_result(path, results["exact"])
    monkeypatch.setattr(result_parquet, "MAX_PADDED", 1000)
    with pytest.raises(InputError, match=r"r\.parquet: got .* of arrays when unpacked; expected at most"):
        read_result(path)


def test_a_table_alone_is_no_result(results: dict[str, Result], tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    posekit.convert(results["exact"], path, posture="all")
    assert not isinstance(posekit.open(path), Result)
    with pytest.raises(InputError, match=r"t\.parquet: metadata: got none of a result"):
        read_result(path)


def test_the_largest_text_that_pyarrow_reads_is_the_bound(tmp_path: Path) -> None:
    text = "A" * (result_parquet.MAX_PACKED // 3 * 4)
    for path, value in ((tmp_path / "most", text), (tmp_path / "more", text + "A")):
        table = pa.table({"frame": [0]})
        with pq.ParquetWriter(path, table.schema) as writer:
            writer.write_table(table)
            writer.add_key_value_metadata({RESULT_SCHEMA: value})
    assert len(pq.read_metadata(tmp_path / "most").metadata[RESULT_SCHEMA.encode()]) == len(text)
    with pytest.raises(OSError, match="size limit"):
        pq.read_metadata(tmp_path / "more")


def test_a_larger_result_is_not_written(
    results: dict[str, Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(result_parquet, "MAX_PACKED", 1000)
    with pytest.raises(TooLargeError, match=r"r\.parquet: got a result of .*; name it \.npz"):
        posekit.write_result(tmp_path / "r.parquet", results["exact"])
    assert list(tmp_path.iterdir()) == []


def test_without_pyarrow_it_is_refused_before_the_work(
    tmp_path: Path, command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("posekit.safe_io.extras.import_module", missing)
    done = command("recover", tmp_path / "no view.json", "-o", tmp_path / "r.parquet")
    assert (done.code, done.out) == (2, "")
    assert "writing Parquet needs pyarrow.parquet, which is not installed; run: pip install" in done.err
