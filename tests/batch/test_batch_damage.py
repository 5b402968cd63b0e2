"""Shards that are damaged are found, whatever was changed; shards of another run are not taken for this one's."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.batch import Recipe, Workers, read_frames, read_shards, run_batch, shard_paths, write_view_table
from posekit.batch.intact import MANIFEST_FILE, is_intact, known_digests
from posekit.batch.run_folder import ASKED_FILE
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.settings import RecoverSettings
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

RECIPE = Recipe(settings=RecoverSettings(checks=("rigid-parts",)), shard_frames=6, rank=False)
ONE = Workers(jobs=1)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return the folder of a run of two shards."""
    views = view_of(random_views(load_figure(), 12, np.random.default_rng(3)))
    write_view_table(tmp_path / "a.parquet", views)
    run_batch([tmp_path / "a.parquet"], tmp_path / "run", RECIPE, ONE)
    return tmp_path / "run"


@pytest.mark.parametrize("noted", [True, False], ids=["digest", "checksums"])
@pytest.mark.parametrize("bits", [1, 160])
def test_no_flipped_bit_is_read_as_a_result(run: Path, noted: bool, bits: int) -> None:
    shard = shard_paths(run)[0]
    whole = shard.read_bytes()
    tables = [table.to_pydict() for table in read_shards(run)]
    known = known_digests(run)
    assert known.keys() == {path.name for path in shard_paths(run)}
    if not noted:
        (run / MANIFEST_FILE).unlink()
        known = {}
    assert is_intact(shard, known)
    rng = np.random.default_rng(bits)
    for _ in range(25):
        changed = bytearray(whole)
        for place in rng.choice(8 * len(whole), bits, replace=False).tolist():
            changed[place // 8] ^= 1 << place % 8
        shard.write_bytes(changed)
        if noted:
            assert not is_intact(shard, known)
        elif is_intact(
            shard, known
        ):  # what no page holds may change what the file says of itself, and no number
            assert repr([table.to_pydict() for table in read_shards(run)]) == repr(tables)
    with pytest.raises(InputError, match=r"posekit batch|undamaged"):
        shard.write_bytes(whole[: len(whole) // 2])
        list(read_shards(run))


def test_a_damaged_shard_is_recovered_anew(run: Path) -> None:
    shard = shard_paths(run)[1]
    whole = shard.read_bytes()
    changed = bytearray(whole)
    changed[len(whole) // 3] ^= 4
    shard.write_bytes(changed)
    summary = run_batch([run.parent / "a.parquet"], run, RECIPE, ONE)
    assert (summary.shards, summary.skipped) == (2, 1)
    assert shard.read_bytes() == whole


def test_inspect_names_a_damaged_shard(run: Path, command: Callable[..., Any]) -> None:
    shard = shard_paths(run)[0]
    changed = bytearray(shard.read_bytes())
    changed[len(changed) // 3] ^= 4
    shard.write_bytes(changed)
    for place in (shard, run):
        outcome = command("inspect", place)
        assert outcome.code == 2
        assert shard.name[:20] in outcome.err


def test_shards_of_another_run_do_not_double_the_frames(run: Path) -> None:
    (run / ASKED_FILE).unlink()
    other = Recipe(
        settings=RecoverSettings(checks=("rigid-parts", "joint-range")), shard_frames=6, rank=False
    )
    with pytest.raises(InputError, match="2 shards of another run"):
        run_batch([run.parent / "a.parquet"], run, other, ONE)
    run_batch([run.parent / "a.parquet"], run, other, ONE, overwrite=True)
    assert sum(table.num_rows for table in read_frames(run)) == 12


TABLE = {"person": 0, "path": "a.parquet", "frames": 12, "head": "{}"}


@pytest.mark.parametrize(
    "change",
    [
        {"name": {"": "a"}},
        {"kind": 5},
        {"warnings": 3},
        {"warnings": [3]},
        {"digest": None},
        {"tables": [5]},
        {"tables": [{**TABLE, "frames": "12"}]},
        {"tables": [{**TABLE, "head": {}}]},
    ],
)
def test_a_damaged_note_of_what_was_opened_is_opened_anew(run: Path, change: dict[str, Any]) -> None:
    (note,) = (run / ".staged").glob("*.json")
    whole = note.read_bytes()
    note.write_text(json.dumps({**json.loads(whole), **change}))
    run_batch([run.parent / "a.parquet"], run, RECIPE, ONE)
    assert note.read_bytes() == whole
