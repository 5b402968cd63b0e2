"""A run goes on where another was, does nothing twice, and keeps what fails apart; here in this process."""

import errno
import json
import os
import resource
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.batch import (
    Finished,
    Progress,
    Recipe,
    Shard,
    Workers,
    read_frames,
    read_shards,
    run_batch,
    run_shard,
    shard_paths,
    staging,
    write_view_table,
)
from posekit.batch import run as run_module
from posekit.batch.durable import PARTS_FOLDER
from posekit.batch.pool import Outcome, attempt
from posekit.batch.run_folder import run_folder
from posekit.batch.staging import STAGED_FOLDER
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.own import View, write_view
from posekit.settings import MEASURED_TOLERANCE, RecoverSettings, Rooting
from posekit.synthesis import random_views
from posekit.views.builtin import view_of
from posekit.views.source import Source
from tests.detector_files import view_keypoints, write_keypoints

RECIPE = Recipe(settings=RecoverSettings(checks=("rigid-parts",)), shard_frames=4, rank=False)


class HerePool:
    """A pool that is this process."""

    def __init__(self, jobs: int, retries: int) -> None:
        self.jobs = jobs

    def __enter__(self) -> "HerePool":
        return self

    def __exit__(self, *error: object) -> None:
        return None

    def run(self, work: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Outcome[Any, Any]]:
        for item in items:
            report = attempt(work, item)
            yield Outcome(item=item, value=report.value, error=report.error, fatal=report.fatal)


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_module, "LocalPool", HerePool)


def seen(count: int, seed: int = 0) -> View:
    return view_of(random_views(load_figure(), count, np.random.default_rng(seed)))


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three recordings of 9, 6 and 1 frames, in folders."""
    place = tmp_path_factory.mktemp("archive")
    (place / "b").mkdir()
    write_view_table(place / "a.parquet", seen(9))
    write_view(place / "b" / "a.json", seen(6, 1))
    write_view_table(place / "c.parquet", seen(1, 2))
    (place / "notes.txt").write_text("not an input")
    (place / ".hidden.json").write_text("{")
    return place


WHOLE = {("a.parquet", k) for k in range(9)} | {("b/a.json", k) for k in range(6)} | {("c.parquet", 0)}


def frames(folder: Path) -> Counter[tuple[str, int]]:
    """Count how often each frame is in the results."""
    found: Counter[tuple[str, int]] = Counter()
    for table in read_frames(folder):
        found.update(zip(table.column("input").to_pylist(), table.column("frame").to_pylist(), strict=True))
    return found


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in shard_paths(folder)}


def test_every_frame_comes_once_and_only_what_is_missing_is_done(archive: Path, tmp_path: Path) -> None:
    told: list[Progress] = []
    summary = run_batch([archive], tmp_path / "out", RECIPE, progress=told.append)
    assert (summary.inputs, summary.shards, summary.skipped, summary.frames) == (3, 6, 0, 16)
    assert frames(tmp_path / "out") == dict.fromkeys(WHOLE, 1)
    assert summary.survivors == sum(
        sum(one >= 0 for one in table.column("survivor").to_pylist())
        for table in read_shards(tmp_path / "out")
    )
    assert told[-1] == Progress(stage="recovering", done=16, total=16)
    assert not list((tmp_path / "out" / STAGED_FOLDER).glob("*.parquet"))
    before = contents(tmp_path / "out")
    times = {path: path.stat().st_mtime_ns for path in shard_paths(tmp_path / "out")}
    again = run_batch([archive], tmp_path / "out", RECIPE, work=_never)
    assert (again.shards, again.skipped, again.frames) == (6, 6, 16)
    assert times == {path: path.stat().st_mtime_ns for path in shard_paths(tmp_path / "out")}
    lost = [shard_paths(tmp_path / "out")[k] for k in (1, 4)]
    lost[0].unlink()
    lost[1].write_bytes(lost[1].read_bytes()[:-100])
    mended = run_batch([archive / "b", archive / "a.parquet", archive], tmp_path / "out", RECIPE)
    assert (mended.shards, mended.skipped) == (6, 4)
    assert contents(tmp_path / "out") == before


def _never(shard: Shard) -> Finished:
    raise AssertionError("it was done before")


def test_a_new_input_joins_the_others(archive: Path, tmp_path: Path) -> None:
    place = tmp_path / "grows"
    place.mkdir()
    (place / "a.parquet").write_bytes((archive / "a.parquet").read_bytes())
    run_batch([place], tmp_path / "out", RECIPE)
    (place / "c.parquet").write_bytes((archive / "c.parquet").read_bytes())
    summary = run_batch([place], tmp_path / "out", RECIPE)
    assert (summary.shards, summary.skipped) == (4, 3)
    assert set(frames(tmp_path / "out").values()) == {1}


def test_people_of_photographs_are_in_their_own_alone(tmp_path: Path) -> None:
    pictures = [{"id": k, "file_name": f"{k}.jpg", "width": 640, "height": 480 + k} for k in range(3)]
    points = [number for j in range(17) for number in (20.0 * j, 10.0 * j + 7 * (j % 3), 2)]
    people = [{"id": k, "image_id": k, "category_id": 1, "keypoints": points} for k in range(3)]
    coco = {"images": pictures, "annotations": people, "categories": [{"id": 1, "name": "person"}]}
    (tmp_path / "coco.json").write_text(json.dumps(coco))
    recipe = Recipe(source=Source(person="all"))
    run_batch([tmp_path / "coco.json"], tmp_path / "out", recipe)
    assert sorted(frames(tmp_path / "out").elements()) == [("coco.json", k) for k in range(3)]


def test_a_bad_input_is_named_and_the_rest_is_done(archive: Path, tmp_path: Path) -> None:
    bad = tmp_path / "in"
    bad.mkdir()
    (bad / "a.parquet").write_bytes((archive / "a.parquet").read_bytes())
    (bad / "broken.parquet").write_bytes((archive / "a.parquet").read_bytes()[:-40])
    (bad / "view.json").write_text('{"schema": "posekit.view/1", "unit": ')
    (bad / "motion.csv").write_text("hello")
    summary = run_batch([bad], tmp_path / "out", RECIPE)
    assert summary.frames == 9
    assert {one.input for one in summary.failures} == {"broken.parquet", "view.json", "motion.csv"}
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    by_name = {one["input"]: one for one in manifest["failed"]}
    assert by_name.keys() == {"broken.parquet", "view.json", "motion.csv"}
    assert "pyarrow" in by_name["broken.parquet"]["error"]
    assert all("\n" not in one["error"] and one["frames"] is None for one in manifest["failed"])
    (bad / "broken.parquet").write_bytes((archive / "c.parquet").read_bytes())
    assert len(run_batch([bad], tmp_path / "out", RECIPE).failures) == 2


def _fails_at_four(shard: Shard) -> Finished:
    if shard.start == 4 and shard.input == "a.parquet":
        raise ZeroDivisionError("a defect")
    return run_shard(shard)


def test_a_shard_that_fails_is_named_with_its_frames(archive: Path, tmp_path: Path) -> None:
    summary = run_batch([archive], tmp_path / "out", RECIPE, work=_fails_at_four)
    (failure,) = summary.failures
    assert (failure.input, failure.start, failure.stop) == ("a.parquet", 4, 8)
    assert failure.error == "unexpected ZeroDivisionError: a defect"
    assert summary.planned - summary.frames == 4
    assert set(frames(tmp_path / "out")) == WHOLE - {("a.parquet", k) for k in range(4, 8)}
    mended = run_batch([archive], tmp_path / "out", RECIPE)
    assert mended.failures == () and frames(tmp_path / "out") == dict.fromkeys(WHOLE, 1)


def test_other_settings_are_refused_unless_asked(archive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run_batch([archive], out, RECIPE)
    other = Recipe(settings=RecoverSettings(checks=("rigid-parts",)), shard_frames=5, rank=False)
    before = contents(out)
    with pytest.raises(InputError, match=r"other settings \(shard_frames: 4 there, 5 now\).*--overwrite"):
        run_batch([archive], out, other)
    assert contents(out) == before
    summary = run_batch([archive], out, other, overwrite=True)
    assert summary.skipped == 0 and not before.keys() & contents(out).keys()
    assert frames(out) == dict.fromkeys(WHOLE, 1)


def test_an_input_that_changed_is_refused_unless_asked(archive: Path, tmp_path: Path) -> None:
    place, out = tmp_path / "in", tmp_path / "out"
    place.mkdir()
    (place / "a.parquet").write_bytes((archive / "a.parquet").read_bytes())
    (place / "b.parquet").write_bytes((archive / "c.parquet").read_bytes())
    run_batch([place], out, RECIPE)
    write_view_table(place / "b.parquet", seen(3, 7))
    with pytest.raises(InputError, match=r"b\.parquet has changed"):
        run_batch([place], out, RECIPE)
    assert run_batch([place], out, RECIPE, overwrite=True).skipped == 3
    assert sum(frames(out).values()) == 12
    (place / "b.parquet").rename(place / "d.parquet")
    with pytest.raises(InputError, match=r"d\.parquet is there already as b\.parquet"):
        run_batch([place], out, RECIPE)


def test_formats_are_not_mixed_by_mistake(archive: Path, tmp_path: Path) -> None:
    place = tmp_path / "in"
    place.mkdir()
    (place / "a.parquet").write_bytes((archive / "a.parquet").read_bytes())
    write_keypoints(place / "k", view_keypoints(seen(2), "openpose"), "openpose")
    recipe = Recipe(settings=RecoverSettings(checks=("rigid-parts",)), shard_frames=4, rank=False)
    with pytest.raises(
        InputError, match=r"k: got key points: openpose, body_25, and a\.parquet is views; .*--mixed"
    ):
        run_batch([place], tmp_path / "out", recipe)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        summary = run_batch([place], tmp_path / "out", recipe, mixed=True)
    assert summary.frames == 11


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda place: [place / "absent"], "no such file or folder"),
        (lambda place: [place], "no input"),
        (lambda place: [place / ("x" * 300)], "File name too long"),
    ],
)
def test_no_input_is_refused(make: Callable[[Path], list[Path]], says: str, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "notes.txt").write_text("nothing")
    with pytest.raises(InputError, match=says) as caught:
        run_batch(make(tmp_path / "in"), tmp_path / "out", RECIPE)
    assert "\n" not in str(caught.value) and not (tmp_path / "out").exists()


def test_only_bad_inputs_are_an_error(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("{}")
    (tmp_path / "b.json").write_text("[")
    with pytest.raises(InputError, match=r"a\.json.*\(and 1 more\)"):
        run_batch([tmp_path / "a.json", tmp_path / "b.json"], tmp_path / "out", RECIPE)
    assert not (tmp_path / "out").exists()
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match=r"a\.json"):
        run_batch([tmp_path / "a.json"], tmp_path / "out", RECIPE)
    assert not list((tmp_path / "out").iterdir())


def test_a_folder_that_cannot_be_listed_is_refused(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = Path.iterdir

    def denied(path: Path) -> Iterator[Path]:
        if path.name == "b":  # as another user's folder: the tests may run as one who may read all
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return listed(path)

    monkeypatch.setattr(Path, "iterdir", denied)
    with pytest.raises(InputError, match=r"b: got Permission denied; expected a readable folder"):
        run_batch([archive], tmp_path / "out", RECIPE)


def test_what_is_not_a_run_is_left_alone(archive: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.txt").write_text("mine")
    with pytest.raises(InputError, match=r"a folder that holds chapter\.txt"):
        run_batch([archive], tmp_path / "thesis", RECIPE)
    with pytest.raises(InputError, match="a file; expected a folder"):
        run_batch([archive], tmp_path / "thesis" / "chapter.txt", RECIPE)
    run_batch([archive / "c.parquet"], tmp_path / "out", RECIPE)
    (tmp_path / "out" / "batch.json").write_text("{}")
    with pytest.raises(InputError, match="a damaged note"):
        run_batch([archive / "c.parquet"], tmp_path / "out", RECIPE)


def test_two_runs_do_not_write_into_one_folder(archive: Path, tmp_path: Path) -> None:
    with run_folder(tmp_path / "out"), pytest.raises(InputError, match="another run is writing there"):
        run_batch([archive], tmp_path / "out", RECIPE)
    assert run_batch([archive], tmp_path / "out", RECIPE).frames == 16


def test_results_in_the_archive_are_no_inputs(archive: Path, tmp_path: Path) -> None:
    place = tmp_path / "in"
    place.mkdir()
    (place / "c.parquet").write_bytes((archive / "c.parquet").read_bytes())
    for _ in range(2):
        assert run_batch([place], place / "out", RECIPE).inputs == 1


def test_a_full_disk_is_an_error_and_nothing_half_written_counts(archive: Path, tmp_path: Path) -> None:
    """The system itself refuses to let a file grow, as a full disk does."""
    out = tmp_path / "out"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    large = Recipe(settings=RecoverSettings(checks=("rigid-parts",)), shard_frames=9, rank=False)
    run_batch([archive / "a.parquet"], tmp_path / "enough", large)
    (written,) = shard_paths(tmp_path / "enough")
    resource.setrlimit(resource.RLIMIT_FSIZE, (written.stat().st_size - 1, hard))
    try:
        with pytest.raises(InputError, match=r"a\.p0.*File too large.*make space"):
            run_batch([archive / "a.parquet"], out, large)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert shard_paths(out) == [] and list((out / PARTS_FOLDER).iterdir()) == []
    assert run_batch([archive / "a.parquet"], out, large).frames == 9


@pytest.mark.parametrize(
    ("of", "call"),
    [(staging, "write_rows"), (os, "fsync"), (Path, "replace")],
    ids=["staging", "fsync", "replace"],
)
def test_a_disk_that_fails_leaves_nothing(
    of: Any, call: str, archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    run_batch([archive / "c.parquet"], out, RECIPE)
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def refuse(*arguments: object, **options: object) -> None:
        raise full

    with monkeypatch.context() as patch:
        patch.setattr(of, call, refuse)
        with pytest.raises(InputError, match="No space left on device"):
            run_batch([archive], out, RECIPE)
    assert len(shard_paths(out)) == 1 and list((out / PARTS_FOLDER).iterdir()) == []
    assert run_batch([archive], out, RECIPE).frames == 16


def test_a_run_in_another_thread_works(archive: Path, tmp_path: Path) -> None:
    done: list[int] = []
    thread = threading.Thread(
        target=lambda: done.append(run_batch([archive / "c.parquet"], tmp_path / "out", RECIPE).frames)
    )
    thread.start()
    thread.join()
    assert done == [1]


@pytest.mark.parametrize(
    ("options", "says"),
    [({"jobs": 0}, "--jobs: 0"), ({"retries": -1}, "--retries: -1")],
)
def test_impossible_numbers_are_refused(options: dict, says: str) -> None:
    with pytest.raises(InputError, match=says):
        Workers(**options)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"scale": "big"}, "--scale"),
        ({"rooting": {"method": "feet"}}, "--root: 'feet'"),
        ({"ranges": "none.toml"}, "none.toml"),
        ({"tolerance": {"rigid": -1.0}}, "--rigid-tolerance"),
        ({"checks": ["gravity"]}, "--checks: 'gravity'"),
        ({"group": 0.05}, "a batch groups nothing"),
        ({"nearer": []}, "a batch groups nothing"),
        ({"scale": {"how": "min"}}, "a batch groups nothing"),
        ({"tolerance": asdict(MEASURED_TOLERANCE)}, "a batch groups nothing"),
    ],
)
def test_impossible_recipes_are_refused(options: dict, says: str) -> None:
    with pytest.raises(InputError, match=says):
        Recipe(settings=RecoverSettings.from_json(options))


def test_a_shard_has_frames() -> None:
    with pytest.raises(InputError, match="--shard-frames: 0"):
        Recipe(shard_frames=0)


@pytest.mark.parametrize("deviation", [None, 3.0])
def test_a_deviation_of_source_or_root_is_both(deviation: float | None) -> None:
    by_root = Recipe(
        settings=RecoverSettings(rooting=Rooting(deviation=2.0)), source=Source(deviation=deviation)
    )
    assert by_root.source.deviation == by_root.settings.rooting.deviation == (deviation or 2.0)


def test_the_command_line(archive: Path, tmp_path: Path, command: Callable[..., Any]) -> None:
    out = tmp_path / "out"
    arguments = ("batch", archive, "-o", out, "--shard-frames", 4, "--checks", "rigid-parts", "--no-rank")
    done = command(*arguments, "--progress")
    assert done.code == 0
    assert "16 frames of 3 inputs in 6 shards: " in done.out and "16 of 16 frames" in done.err
    assert "6 shards, 6 of them from before" in command(*arguments).out
    refused = command(*arguments[:5], 5)
    assert refused.code == 2 and refused.err.count("\n") == 1 and "other settings" in refused.err
    (tmp_path / "bad.json").write_text("{")  # outside the archive: the others keep their names
    failed = command(*arguments, tmp_path / "bad.json")
    assert failed.code == 1 and "bad.json failed: " in failed.err and str(out / "manifest.json") in failed.err
    nowhere = command(*arguments, "--cluster", "127.0.0.1:1")
    assert nowhere.code == 2 and "--cluster: 127.0.0.1:1: nothing answers there" in nowhere.err
