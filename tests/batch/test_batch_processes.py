"""Real processes: killed, crashed, interrupted; what is left is mended to the same bytes."""

import json
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.batch import (
    Recipe,
    Workers,
    digests,
    read_frames,
    run_batch,
    run_shard,
    shard_paths,
    write_view_table,
)
from posekit.batch.durable import PARTS_FOLDER
from posekit.batch.shard import shards_of
from posekit.batch.staging import Staging, stage
from posekit.body import load_figure
from posekit.settings import RecoverSettings
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

RECIPE = Recipe(settings=RecoverSettings(checks=("rigid-parts",)), shard_frames=2, rank=False)
OPTIONS = ("--checks", "rigid-parts", "--shard-frames", "2", "--no-rank")
FRAMES = 160
POISON, KILLED = 4, 8

# Pinocchio looks up what its table of pairs, made too early, does not have: memory that is not its own.
CRASHING = f"""
import os, pathlib, signal
import pinocchio as pin
from posekit.body import load_figure
from posekit.batch import run_shard

def shard(one):
    marker = pathlib.Path(os.environ["BATCH_TEST_MARKER"])
    if one.start == {KILLED} and "BATCH_TEST_POISON" not in os.environ and not marker.exists():
        marker.write_text("")
        os.kill(os.getpid(), signal.SIGKILL)
    if one.start == {POISON} and "BATCH_TEST_POISON" in os.environ:
        model = load_figure().model
        data = model.createData()
        pin.updateFramePlacement(model, data, 10**9)
    return run_shard(one)
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("archive")
    view = view_of(random_views(load_figure(), FRAMES, np.random.default_rng(0)))
    write_view_table(place / "long.parquet", view)
    short = view_of(random_views(load_figure(), 12, np.random.default_rng(0)))
    write_view_table(place / "short.parquet", short)
    return place


@pytest.fixture
def crashing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A shard's work that dies once, and of another shard always: a module that processes can import."""
    place = tmp_path / "modules"
    place.mkdir()
    (place / "crashing_shard.py").write_text(CRASHING)
    monkeypatch.syspath_prepend(place)
    monkeypatch.setenv("PYTHONPATH", str(place))
    monkeypatch.setenv("BATCH_TEST_MARKER", str(tmp_path / "marker"))
    import crashing_shard  # type: ignore[import-not-found]

    return crashing_shard.shard


def assert_whole(archive: Path, folder: Path, name: str, count: int) -> None:
    """Compare a run's files with those that this process makes of the same input, and count its frames."""
    found: Counter[int] = Counter()
    for table in read_frames(folder):
        found.update(table.column("frame").to_pylist())
    assert found == dict.fromkeys(range(count), 1)
    reference = folder.parent / "reference"
    for part in ("shards", ".staged", PARTS_FOLDER):
        (reference / part).mkdir(parents=True, exist_ok=True)
    settings = digests.of_values(RECIPE.document())
    staged = stage(Staging(name=name, path=archive / name, folder=reference, recipe=RECIPE, reading=""))
    made = list(shards_of(staged, RECIPE, settings, reference))
    assert [shard.name for shard in made] == [path.name for path in shard_paths(folder)]
    for shard in made[:3] + made[-3:]:
        run_shard(shard)
        assert shard.path.read_bytes() == (folder / "shards" / shard.name).read_bytes()


def test_what_crashes_is_named_and_the_rest_is_done(
    archive: Path, tmp_path: Path, crashing: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    monkeypatch.setenv("BATCH_TEST_POISON", "1")
    summary = run_batch([archive / "short.parquet"], out, RECIPE, Workers(jobs=2, retries=1), work=crashing)
    (failure,) = summary.failures
    assert (failure.start, failure.stop, failure.attempts, failure.died) == (POISON, POISON + 2, 2, True)
    assert failure.error == "its process was ended by signal 11 (SIGSEGV)"
    assert summary.frames == 10 and len(shard_paths(out)) == 5
    assert list((out / PARTS_FOLDER).iterdir()) == []
    (named,) = json.loads((out / "manifest.json").read_text())["failed"]
    assert named["shard"].startswith("short.p0.0000000004-0000000006.") and named["killed_its_process"]


def start(archive: Path, out: Path) -> subprocess.Popen[str]:
    # Where tests run in the background, Ctrl-C is switched off for all that is started from there.
    code = "import signal; signal.signal(2, signal.default_int_handler); from posekit.cli import main; main()"
    arguments = ["batch", str(archive / "long.parquet"), "-o", str(out), "--jobs", "1", *OPTIONS]
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
    )


def wait_for(count: int, out: Path) -> None:
    """Wait until there are so many shards."""
    for _ in range(6000):
        if (out / "shards").is_dir() and len(shard_paths(out)) >= count:
            return
        time.sleep(0.01)
    raise AssertionError("the run makes no progress")


def test_interrupted_and_killed_and_run_to_the_end(archive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = start(archive, out)
    wait_for(1, out)
    first.send_signal(signal.SIGINT)
    assert (
        first.communicate(timeout=30)[1] == f"posekit: error: interrupted; run it again to go on in {out}\n"
    )
    assert first.returncode == 130
    assert list((out / PARTS_FOLDER).iterdir()) == []
    there = len(shard_paths(out))
    assert 1 <= there < FRAMES // 2
    second = start(archive, out)
    wait_for(there + 2, out)
    children = Path(f"/proc/{second.pid}/task/{second.pid}/children").read_text().split()
    second.send_signal(signal.SIGKILL)
    second.communicate(timeout=30)
    for _ in range(1000):  # its worker ends by itself
        if not any(Path(f"/proc/{child}").exists() for child in children):
            break
        time.sleep(0.01)
    else:
        raise AssertionError("a worker outlived its run")
    there = len(shard_paths(out))
    assert there < FRAMES // 2
    summary = run_batch([archive / "long.parquet"], out, RECIPE, Workers(jobs=1))
    assert (summary.skipped, summary.frames) == (there, FRAMES)
    assert_whole(archive, out, "long.parquet", FRAMES)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_while_a_process_is_started_is_one_line(archive: Path, tmp_path: Path, name: str) -> None:
    program = f"""
import os, signal, sys
from multiprocessing import util
from posekit.cli.main import main
signal.signal(signal.SIGINT, signal.default_int_handler)
spawn = util.spawnv_passfds
def spawned(path, arguments, handles):
    number = spawn(path, arguments, handles)
    if b"--multiprocessing-fork" in arguments or "--multiprocessing-fork" in arguments:
        os.kill(os.getpid(), signal.{name})
    return number
util.spawnv_passfds = spawned
main()
"""
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-c",
        program,
        "batch",
        str(archive / "short.parquet"),
        "-o",
        str(out),
        *OPTIONS,
    ]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ended.stderr == f"posekit: error: interrupted; run it again to go on in {out}\n"
    assert ended.returncode == 130


def test_a_ray_cluster_one_worker_of_which_is_killed_gives_the_same_bytes(
    archive: Path, tmp_path: Path, crashing: Any
) -> None:
    pytest.importorskip("ray")
    out = tmp_path / "out"
    summary = run_batch(
        [archive / "short.parquet"], out, RECIPE, Workers(jobs=2, cluster="local"), work=crashing
    )
    assert (tmp_path / "marker").exists()
    assert (summary.frames, summary.failures) == (12, ())
    assert_whole(archive, out, "short.parquet", 12)
