"""The sample folder: the same every time, and what each file is said to be is what posekit makes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.formats.own import ValidationReport
from posekit.samples import write_samples
from posekit.samples.robot_squat import ARM_IN_TRUNK, ELBOW_BEYOND, FEET_IN_GROUND
from posekit.samples.walking_person import ELBOW_BENT_BACK, JUMPED_FROM


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    write_samples(folder)
    return folder


def content(folder: Path) -> dict[str, bytes]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    # An NPZ is a ZIP archive, which says when it was written.
    return {
        str(path.relative_to(folder)): path.read_bytes()
        if path.suffix != ".npz"
        else b"".join(values.tobytes() for values in np.load(path).values())
        for path in files
    }


def test_the_folder_is_small_and_the_same_every_time(folder: Path, tmp_path: Path) -> None:
    contents = write_samples(tmp_path / "again")
    assert content(tmp_path / "again") == content(folder)
    assert sorted(path.name for path in folder.iterdir()) == sorted(name.rstrip("/") for name in contents)
    assert sum(map(len, content(folder).values())) < 400_000


def failing(report: ValidationReport) -> dict[str, set[int]]:
    found: dict[str, set[int]] = {}
    for number, posture in enumerate(report.postures):
        for finding in posture.findings:
            if finding.verdict == "invalid":
                found.setdefault(finding.check, set()).add(number if posture.index is None else posture.index)
    return found


def test_the_walk_is_valid_and_its_bvh_has_the_mistakes_that_were_made(folder: Path) -> None:
    assert failing(posekit.validate(folder / "walk.npz")) == {}
    found = failing(posekit.validate(folder / "jump.bvh"))
    assert found["joint_range"] == set(range(ELBOW_BENT_BACK.start, ELBOW_BENT_BACK.stop))
    assert found["teleport"] == {JUMPED_FROM}


def test_the_robot_has_its_mistakes_and_no_others(folder: Path) -> None:
    found = failing(posekit.validate(folder / "robot.npz", urdf="g1"))
    made = {"joint_range": ELBOW_BEYOND, "collision": ARM_IN_TRUNK, "penetration": FEET_IN_GROUND}
    assert set(found) == set(made)
    for check, frames in made.items():
        assert found[check] < set(range(frames.start, frames.stop))


def test_the_truth_of_the_photograph_is_among_its_survivors(folder: Path) -> None:
    recovery = posekit.recover(posekit.open(folder / "photo.json"))
    assert len(recovery.frames[0]) > 0


def test_what_the_detector_wrote_is_seen_by_its_camera(folder: Path) -> None:
    source = posekit.Source(camera=f"{folder / 'calibration.toml'}:cam_01", stature=1.75)
    (person,) = posekit.open_views(folder / "keypoints", source)
    assert len(person.view) == 12
    assert np.isfinite(person.view.image).all()


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file; expected a folder"):
        write_samples(tmp_path / "file")
