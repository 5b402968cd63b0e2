"""`posekit inspect` on posekit's own files: results, batches, shards, evaluations; and on damaged ones."""

import json
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.batch import Recipe, read_frames, run_batch, shard_paths
from posekit.batch import run as run_module
from posekit.batch.pool import Outcome, attempt
from posekit.body import load_figure
from posekit.formats.own import write_view
from posekit.inspection.telling import counts_line, settings_line
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.settings import RecoverSettings
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

Run = Callable[..., Any]


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


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a batch of three shards and a failure, as a run leaves it."""
    pytest.importorskip("pyarrow")
    folder = tmp_path_factory.mktemp("batch")
    archive = folder / "archive"
    archive.mkdir()
    write_view(archive / "a.json", view_of(random_views(load_figure(), 5, np.random.default_rng(0))))
    (archive / "b.json").write_text('{"schema": "posekit.view/1"}', encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_module, "LocalPool", HerePool)
        settings = RecoverSettings(checks=("rigid-parts", "joint-range"))
        run_batch([archive], folder / "run", Recipe(settings=settings, shard_frames=2))
    return folder / "run"


@pytest.fixture
def run_folder(made: Path, tmp_path: Path) -> Path:
    """Return a copy of it, to be damaged."""
    shutil.copytree(made, tmp_path / "run")
    return tmp_path / "run"


def told(command: Run, path: Path) -> str:
    done = command("inspect", path)
    assert done.code == 0, done.err
    assert done.err == ""
    return str(done.out)


def refused(command: Run, path: Path) -> str:
    done = command("inspect", path)
    assert done.code == 2, done
    assert done.out == ""
    assert done.err.startswith("posekit: error: ")
    assert done.err.count("\n") == 1
    return str(done.err)


# --- results -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_a_followed_and_refined_result(command: Run, tmp_path: Path, suffix: str) -> None:
    view, out = tmp_path / "v.json", tmp_path / f"r.{suffix}"
    assert command("synth", "random", "-o", view, "--frames", "3", "--noise", "2").code == 0
    document = json.loads(view.read_text(encoding="utf-8"))
    for frame in document["frames"]:
        frame["root"] = frame["truth"]["neck"]
    del document["frames"][1]["image"]["neck"]
    view.write_text(json.dumps(document), encoding="utf-8")
    assert command("recover", view, "-o", out, "--follow", "2", "--length-deviation", "0.015").code == 0
    text = told(command, out)
    assert "a result (posekit.result/2)" in text
    assert "3 frames, " in text
    assert "least 0, " in text
    assert "none in 1\n" in text
    assert "not recovered, 1 frame: the neck, from which the tree grows, is not seen" in text
    assert "judged as refined in 2 frames" in text
    assert (
        "refined in 2 frames with a deviation of 2 px, the body's size known to 0.015 of itself; "
        "chi2 a degree of freedom: median " in text
    )
    assert "ranked (up: " in text
    assert "2 paths: the first " in text
    assert command("recover", view, "-o", out, "--follow", "1", "--length-deviation", "0.015").code == 0
    assert "1 path: how sure is not asked (--follow 2), 1 of 3 frames bridged" in told(command, out)
    assert "derived" not in told(command, view)
    assert "1 of 3 frames bridged" in text
    assert "; posekit " in text


def test_an_exact_result_is_told_as_one(command: Run, tmp_path: Path) -> None:
    assert command("synth", "random", "-o", tmp_path / "v.json", "--frames", "2").code == 0
    assert command("recover", tmp_path / "v.json", "-o", tmp_path / "r.json").code == 0
    text = told(command, tmp_path / "r.json")
    for line in ("judged as exact in 2 frames", "not refined", "no paths through the frames"):
        assert line in text.splitlines()


def test_the_hash_is_of_what_was_asked() -> None:
    """Other frames of the same settings have the same; another setting has another."""
    views = [view_of(random_views(load_figure(), 2, np.random.default_rng(seed))) for seed in (0, 1)]
    one, other = (result_of(recover(view)).settings for view in views)
    looser = result_of(recover(views[0], contact_margin=-0.01)).settings
    assert settings_line(one) == settings_line({**other, "judged": [], "unrecovered": {"why": [0]}})
    assert settings_line(one).partition(";")[0] != settings_line(looser).partition(";")[0]


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.lists(st.integers(0, 40), min_size=1, max_size=30))
def test_counts_are_numpys(counts: list[int]) -> None:
    line = counts_line(counts)
    assert (
        f"least {min(counts)}, median {np.median(counts):g}, most {max(counts)}, none in {counts.count(0)}"
        in line
    )
    assert f" {sum(counts)} posture" in line


@pytest.mark.parametrize(
    "settings",
    [
        {"judged": 7, "unrecovered": [1], "noise": "x", "ranking": 3, "checks": "all", "versions": []},
        {"judged": [None, {}], "unrecovered": {"a": 1}, "noise": {"deviation": "?"}, "ranking": {"up": []}},
        {},
    ],
)
def test_settings_of_any_kind_are_survived(command: Run, tmp_path: Path, settings: dict[str, Any]) -> None:
    assert command("synth", "random", "-o", tmp_path / "v.json", "--frames", "1").code == 0
    assert command("recover", tmp_path / "v.json", "-o", tmp_path / "r.json").code == 0
    document = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    (tmp_path / "r.json").write_text(json.dumps({**document, "settings": settings}), encoding="utf-8")
    assert "1 frame, " in told(command, tmp_path / "r.json")


# --- batches -----------------------------------------------------------------------------------------------


def test_a_batch_says_what_its_shards_hold(command: Run, made: Path) -> None:
    counts = [int(n) for table in read_frames(made) for n in table.column("survivors").to_pylist()]
    for path in (made, made / "shards", made / "manifest.json", made / "batch.json"):
        text = told(command, path)
        assert "results of a batch (posekit.batch/1)" in text
        assert "1 input; 3 of 3 shards done, 5 of 5 frames, 1 failure\n" in text
        assert counts_line(counts) in text
        assert "failed: b.json: " in text
        assert (
            f"settings {json.loads((made / 'batch.json').read_text())['hash']}; checks rigid-parts, joint"
            in text
        )


def test_a_shard_says_what_it_holds(command: Run, made: Path) -> None:
    first, *_ = shard_paths(made)
    counts = [int(n) for n in next(read_frames(made)).column("survivors").to_pylist()]
    text = told(command, first)
    assert "one shard (posekit.batch_shard/1)" in text
    assert "a.json, person 0, rows 0 to 1" in text
    assert counts_line(counts) in text
    assert "judged as exact in 2 frames" in text
    assert "with probabilities; settings " in text


def test_an_unfinished_batch_says_so(command: Run, run_folder: Path) -> None:
    shard_paths(run_folder)[1].unlink()
    assert "2 of 3 shards done, 3 of 5 frames" in told(command, run_folder)
    (run_folder / "manifest.json").unlink()
    text = told(command, run_folder)
    assert "2 shards done, 3 frames" in text
    assert "has not come to its first note" in text
    for shard in shard_paths(run_folder):
        shard.unlink()
    assert "0 shards done, 0 frames" in told(command, run_folder)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("manifest.json", "{"),
        ("manifest.json", "[]"),
        ("manifest.json", '{"schema": "posekit.batch_manifest/1", "failed": [1]}'),
        ("manifest.json", '{"schema": "posekit.batch_manifest/2", "failed": []}'),
        ("batch.json", "{}"),
        (
            "batch.json",
            '{"schema": "posekit.batch/1", "hash": 1, "settings": [1], "inputs": {}, "root": "x"}',
        ),
        ("shard", "PAR1"),
        ("shard", ""),
    ],
)
def test_a_damaged_batch_is_one_line(command: Run, run_folder: Path, name: str, content: str) -> None:
    path = shard_paths(run_folder)[0] if name == "shard" else run_folder / name
    path.write_text(content, encoding="utf-8")
    assert str(path) in refused(command, run_folder)


def test_a_shard_that_is_cut_off_or_of_something_else_is_one_line(command: Run, run_folder: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    first, second, third = shard_paths(run_folder)
    first.write_bytes(first.read_bytes()[:-100])
    assert str(first) in refused(command, first)
    pq.write_table(pa.table({"survivors": [1.0]}).replace_schema_metadata({"posekit.batch": "{}"}), second)
    assert "a damaged shard" in refused(command, second)
    good = pq.read_table(third)
    bad = good.set_column(good.schema.get_field_index("survivors"), "survivors", pa.array([-3] * len(good)))
    pq.write_table(bad.replace_schema_metadata({"posekit.batch": "{}"}), third)
    assert "a damaged shard" in refused(command, third)


# --- evaluations and reports -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def evaluation(command: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("evaluation")
    assert command("synth", "random", "-o", folder / "v.json", "--frames", "2").code == 0
    outputs = ("-o", folder / "e.json", "-o", folder / "e.md")
    assert command("evaluate", folder / "v.json", *outputs, "--noise", "0,1").code == 0
    return folder / "e.json"


def test_an_evaluation_is_told_by_added_noise(command: Run, evaluation: Path) -> None:
    text = told(command, evaluation)
    assert "an evaluation (posekit.evaluation/1)" in text
    assert "added noise 0 px: 2 views, truth within 10 mm in 100.0%, its branch in 100.0%" in text
    assert "added noise 1 px: 2 views" in text
    assert "| added noise |" in evaluation.with_suffix(".md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "damage",
    [
        lambda d: {"schema": d["schema"]},
        lambda d: {**d, "by_noise": [{}]},
        lambda d: {**d, "frames": "many"},
        lambda d: {**d, "settings": 3},
        lambda d: {**d, "by_noise": [{**d["by_noise"][0], "survivors": None}]},
        lambda d: {**d, "frames": float(10**300) * 10},
    ],
)
def test_a_damaged_evaluation_is_one_line(
    command: Run, evaluation: Path, tmp_path: Path, damage: Any
) -> None:
    document = damage(json.loads(evaluation.read_text(encoding="utf-8")))
    path = tmp_path / "e.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    assert str(path) in refused(command, path)


def test_reports_and_objects_are_told(command: Run, tmp_path: Path) -> None:
    view, result, report = (tmp_path / name for name in ("v.json", "r.json", "report.json"))
    assert command("synth", "random", "-o", view, "--frames", "1").code == 0
    assert command("recover", view, "-o", result).code == 0
    assert command("validate", result, "-o", report).code == 0
    text = told(command, report)
    assert "a report of validation (posekit.report/1)" in text
    assert " valid, 0 invalid, 0 undecided" in text
    assert command("synth", "object", "panda", "-o", view, "--frames", "1").code == 0
    assert command("recover", view, "-o", result, "--linkage", "panda").code == 0
    assert "postures of panda in 1 frame" in told(command, result)
