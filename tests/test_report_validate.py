"""Reports and `validate`: one table of findings, decisions about clips, files and folders."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest

import posekit
from posekit.errors import InputError
from posekit.motion import Motion
from posekit.motion.validation import keep_clips
from posekit.validators.report import joined

FIGURE = posekit.load_figure()
STANDING = FIGURE.neutral_points[:14]


def clip(frames: int = 60, broken: slice | None = None) -> Motion:
    """Return a person who moves an arm; in some frames the other elbow is bent too far."""
    q = np.tile(FIGURE.neutral, (frames, 1))
    names = list(FIGURE.configuration_names)
    q[:, names.index("right_shoulder_flexion")] = 0.8 + 0.5 * np.sin(np.arange(frames) / 6)
    q[:, names.index("left_elbow_flexion")] = 0.6
    if broken is not None:
        q[broken, names.index("left_elbow_flexion")] = np.radians(178.0)
    joints = FIGURE.points(q)
    joints[..., 2] -= joints[..., 2].min() - 0.066
    return Motion(joints=joints, time=np.arange(frames) / 30, up="+z")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "clips"
    path.mkdir()
    for name, broken in (("a", None), ("b", slice(20, 26)), ("c", None)):
        posekit.save(clip(broken=broken), path / f"{name}.npz")
    (path / "d.bvh").write_text("HIERARCHY\nnothing", encoding="utf-8")
    return path


def test_columns_of_the_table_agree_with_masks_and_margins() -> None:
    report = posekit.validate(clip(broken=slice(20, 26)))
    table = report.to_pandas()
    assert list(table) == "clip frame time check place value lower upper unit margin verdict".split()
    invalid = table[table.verdict == "invalid"]
    assert sorted(set(invalid.frame)) == np.flatnonzero(report.invalid).tolist()
    assert (invalid.margin < 0).all()
    beyond = np.fmin(invalid.value - invalid.lower, invalid.upper - invalid.value)
    np.testing.assert_allclose(beyond, invalid.margin)
    assert ((report.worst < 0) == report.invalid).all() and not (report.ok & report.invalid).any()
    (span,) = [one for one in report.spans if one.check == "joint-range"]
    assert (span.first, span.last, span.frames, span.place) == (20, 25, 6, "left_elbow.flexion")


def test_severity_tells_a_slight_overlap_from_a_deep_one() -> None:
    def report_of(gap: float) -> Any:
        joints = STANDING.copy()
        direction = joints[11] - joints[10]
        joints[[11, 13]] -= direction / np.linalg.norm(direction) * (np.linalg.norm(direction) - gap)
        return posekit.Validator(settings=posekit.ValidateSettings(checks=["collision"], strict=True)).check(
            joints
        )

    radius = sum(one.radius for one in FIGURE.capsules if one.link.endswith("shank"))
    slight, deep = report_of(radius - 0.0005), report_of(radius - 0.03)
    assert slight.clips[0].severity < 0.5
    assert deep.clips[0].severity > 2
    assert deep.table()["value"].min() == pytest.approx(-0.03, abs=2e-3)


def test_a_posture_is_a_batch_of_one_and_shapes_are_told_apart() -> None:
    validator = posekit.Validator()
    for given in (STANDING, STANDING[None], FIGURE.neutral, FIGURE.neutral[None], FIGURE.neutral_points):
        assert validator.check(given).ok.tolist() == [True]
    unknown = np.stack([STANDING, np.full((14, 3), np.nan)])
    report = validator.check(unknown)
    assert report.verdicts == ["valid", "undecided"]
    for wrong in (np.zeros((3, 13, 3)), np.zeros(5), "standing", STANDING * 1e9):
        with pytest.raises(InputError, match="expected"):
            validator.check(wrong)  # type: ignore[arg-type]


def test_assert_valid_raises_with_the_first_reasons(tmp_path: Path) -> None:
    posekit.assert_valid(STANDING)
    path = tmp_path / "broken.npz"
    posekit.save(clip(broken=slice(3, 5)), path)
    for given in (clip(broken=slice(3, 5)), path):
        with pytest.raises(AssertionError, match=r"2 of 60 postures are not valid: .*left_elbow"):
            posekit.assert_valid(given)


def test_the_same_verdicts_through_every_door(tmp_path: Path) -> None:
    motion = clip(broken=slice(20, 26))
    path = tmp_path / "clip.npz"
    posekit.save(motion, path)
    verdicts = [
        report.verdicts
        for report in (
            posekit.validate(path),
            posekit.validate(motion),
            posekit.validate(motion.joints, rate=30, up="+z"),
            posekit.Validator().check(motion),
        )
    ]
    assert verdicts[0].count("invalid") >= 6
    assert all(one == verdicts[0] for one in verdicts)


def test_a_folder_is_decided_clip_by_clip(folder: Path) -> None:
    report = posekit.validate(folder)
    assert report.decision.startswith("keep 2 of 4 clips; ") and "1 unreadable" in report.decision
    assert [Path(one.file).name for one in report.clips] == ["a.npz", "b.npz", "c.npz"]
    assert [one.decision == "keep" for one in report.clips] == [True, False, True]
    assert "d.bvh" in report.refused[0]
    first, *lines = report.summary().splitlines()
    assert first == report.decision and any(line.startswith("joint-range") for line in lines)


def test_kept_clips_are_copied_unchanged_or_cut(folder: Path, tmp_path: Path) -> None:
    report = posekit.validate(folder, keep=tmp_path / "kept", keep_spans=1.0)
    assert (tmp_path / "kept/a.npz").read_bytes() == (folder / "a.npz").read_bytes()
    cut = posekit.open(tmp_path / "kept/b.npz")
    good = report.clips[1].good
    assert good is not None and len(cut) == good[1] - good[0] + 1 < 60
    assert posekit.validate(cut).ok.all()
    rows = list(csv.DictReader((tmp_path / "kept/clips.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["written"] for row in rows] == ["a.npz", "b.npz", "c.npz"]
    assert rows[1]["reason"] == report.clips[1].reason
    with pytest.raises(InputError, match="new or empty folder"):
        keep_clips(report, tmp_path / "kept")


@pytest.mark.parametrize("read", ["csv", "parquet"])
def test_the_clips_of_a_report_are_a_table(folder: Path, read: str) -> None:
    report = posekit.validate(folder)
    report.save(folder / f"clips.{read}", clips=True)
    table = getattr(pandas, f"read_{read}")(folder / f"clips.{read}")
    assert table.decision.tolist() == [one.decision for one in report.clips]
    assert table.invalid.tolist() == [one.invalid for one in report.clips]
    assert [Path(name).stem for name in table.file] == ["a", "b", "c"]


@pytest.mark.parametrize("name", ["report.json", "report.npz", "report.parquet"])
def test_reports_in_files_have_equal_findings(name: str, folder: Path, tmp_path: Path) -> None:
    report = posekit.validate(folder)
    report.save(tmp_path / name)
    again = posekit.open(tmp_path / name)
    assert again.decision == report.decision and again.verdicts == report.verdicts
    for column, values in report.table().items():
        np.testing.assert_array_equal(again.table()[column], values)


def test_joined_reports_match_checks_and_places_by_name() -> None:
    one = posekit.validate(clip(broken=slice(20, 26)), checks=["joint-range", "collision"])
    other = posekit.validate(clip(broken=slice(5, 7)), checks=["collision", "swap", "joint-range"])
    both = joined([one, other])
    assert both.verdicts == [*one.verdicts, *other.verdicts]
    assert both.table()["place"].tolist() == [*one.table()["place"], *other.table()["place"]]


@pytest.mark.parametrize("changes", [{}, {"deviation": 2.0}, {"length_deviation": 0.02}])
def test_what_recover_wrote_is_valid_by_its_own_settings(changes: dict[str, float], tmp_path: Path) -> None:
    recovery = posekit.recover(posekit.builtin_view("seq1").take(slice(0, 1)), **changes)
    path = tmp_path / "result.json"
    recovery.save(path)
    report = posekit.validate(path)
    assert len(report) == len(recovery.survivors) > 0
    assert report.ok.all(), report.summary()


@pytest.mark.parametrize("given", ["nothing.bvh", "no_folder/*.bvh"])
def test_paths_that_do_not_exist_are_refused_in_one_line(given: str) -> None:
    with pytest.raises(InputError, match="expected a file, a folder") as error:
        posekit.validate(given)
    assert "\n" not in str(error.value)
