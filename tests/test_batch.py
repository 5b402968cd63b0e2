"""Batch: every input once, resumable, broken inputs named; the same outputs in one process, several, and on Ray."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.batch import MANIFEST, BatchRun, batch
from posekit.settings import RecoverSettings

SETTINGS = RecoverSettings(checks=("rigid-parts", "joint-range"))


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """A folder with a view, two motions and a broken file."""
    folder = tmp_path / "archive"
    (folder / "sub").mkdir(parents=True)
    view = posekit.builtin_view("seq1")
    posekit.save(view, folder / "view.json")
    standing = np.repeat(posekit.load_figure().neutral_points[None, :14], 10, axis=0)
    motion = posekit.Motion(joints=standing + 1.0, time=np.arange(10) / 30, up="+z")
    posekit.save(motion, folder / "stand.npz")
    posekit.save(replace(motion, joints=standing + 1.1), folder / "sub" / "stand.npz")
    (folder / "broken.bvh").write_text("HIERARCHY\n")
    return folder


def outputs(run: BatchRun) -> set[str]:
    return {entry["output"] for entry in (*run.done, *run.kept)}


EXPECTED = {"view.json.result.npz", "stand.npz.report.json", "sub/stand.npz.report.json"}


def test_every_input_has_one_output_and_a_broken_one_is_named(archive: Path, tmp_path: Path) -> None:
    lines: list[str] = []
    run = batch([archive, archive / "stand.npz"], tmp_path / "out", SETTINGS, say=lines.append)
    assert outputs(run) == EXPECTED
    (failed,) = run.failed
    assert failed["input"] == "broken.bvh"
    assert "broken.bvh" in failed["error"]
    assert len(lines) == len(EXPECTED) + 2
    recovered = posekit.open(tmp_path / "out" / "view.json.result.npz")
    direct = posekit.recover(archive / "view.json", SETTINGS)
    np.testing.assert_array_equal(recovered.survivors.joints, direct.survivors.joints)
    report = posekit.open(tmp_path / "out" / "stand.npz.report.json")
    assert report.ok.all()


def test_a_run_goes_on_where_it_was(archive: Path, tmp_path: Path) -> None:
    target = tmp_path / "out"
    batch(archive, target, SETTINGS)
    manifest = target / MANIFEST
    manifest.write_text(manifest.read_text() + '{"input": "stand.n')  # the process was killed while it wrote
    again = batch(archive, target, SETTINGS)
    assert not again.done
    assert {entry["output"] for entry in again.kept} == EXPECTED
    assert len(again.failed) == 1  # a broken input is tried again


@pytest.mark.parametrize("change", ["output", "input", "settings", "lost"])
def test_what_changed_is_computed_again(archive: Path, tmp_path: Path, change: str) -> None:
    target, settings = tmp_path / "out", SETTINGS
    batch(archive, target, settings)
    if change == "output":
        (target / "stand.npz.report.json").write_text("{}")
    elif change == "lost":
        (target / "stand.npz.report.json").unlink()
    elif change == "input":
        posekit.save(posekit.open(archive / "sub" / "stand.npz"), archive / "stand.npz")
    else:
        settings = replace(settings, checks=("rigid-parts",))
    run = batch(archive, target, settings)
    expected = EXPECTED if change == "settings" else {"stand.npz.report.json"}
    assert {entry["output"] for entry in run.done} == expected
    lines = [json.loads(line) for line in (target / MANIFEST).read_text().splitlines()]
    assert {line["input"] for line in lines} == {"view.json", "stand.npz", "sub/stand.npz", "broken.bvh"}


def test_processes_write_what_one_process_writes(archive: Path, tmp_path: Path) -> None:
    one = batch(archive, tmp_path / "one", SETTINGS)
    many = batch(archive, tmp_path / "many", SETTINGS, jobs=2)
    assert outputs(one) == outputs(many)
    assert {e["input"]: e["sha256"] for e in one.done} == {e["input"]: e["sha256"] for e in many.done}
    assert [e["input"] for e in many.failed] == ["broken.bvh"]


def test_ray_writes_what_one_process_writes(archive: Path, tmp_path: Path) -> None:
    import ray

    one = batch(archive, tmp_path / "one", SETTINGS)
    try:
        on_ray = batch(archive, tmp_path / "ray", SETTINGS, ray="local")
    finally:
        ray.shutdown()
    assert {e["input"]: e["sha256"] for e in one.done} == {e["input"]: e["sha256"] for e in on_ray.done}


def test_an_output_that_is_a_file_is_refused(archive: Path) -> None:
    with pytest.raises(posekit.InputError, match="expected a folder"):
        batch(archive, archive / "stand.npz", SETTINGS)
    with pytest.raises(posekit.InputError, match="no file"):
        batch(archive / "none", archive / "out", SETTINGS)
