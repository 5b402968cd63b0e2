"""Every mistake at the command line gets one line that says what is wrong and what to do, and exit code 2."""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.cli.main import main
from posekit.samples import samples

TABLE = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))
MISTAKES = [(row["what"], row["command"], row["says"]) for rows in TABLE.values() for row in rows]


def lay_out(folder: Path) -> None:
    """Write the files among which the mistakes are made."""
    samples(folder)
    posekit.recover(posekit.builtin_view("seq1")).save(folder / "postures.npz")
    posekit.validate(np.repeat(posekit.load_figure().neutral_points[None, :14], 3, axis=0)).save(
        folder / "report.json"
    )
    (folder / "angles.mot").write_text("angles\ninDegrees=yes\nendheader\ntime\tknee_angle_r\n0.0\t5.0\n")
    (folder / "walk.glb").write_bytes(b"glTF\x02\x00\x00\x00")
    (folder / "empty").mkdir()
    (folder / "empty.json").write_bytes(b"")
    (folder / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(64))
    (folder / "walk.mp4").write_bytes(b"\x00\x00\x00\x20ftypisom\x00\x00\x02\x00" + bytes(64))
    (folder / "notes.md").write_text("# Notes\n\nThe walk looks fine.\n", encoding="utf-8")
    columns = posekit.load_robot("g1", bodies="none").configuration_names
    (folder / "header.csv").write_text(",".join(columns) + "\n", encoding="utf-8")
    (folder / "walk.csv").write_text("name,age\nAnna,31\n", encoding="utf-8")
    named = json.loads((folder / "walk.json").read_text(encoding="utf-8"))
    named["frames"][0]["image"]["left_elbo"] = named["frames"][0]["image"].pop("left_elbow")
    seen = json.loads((folder / "walk.json").read_text(encoding="utf-8"))
    for frame in seen["frames"]:
        frame.pop("truth", None)
    nobody = {"version": 1.3, "people": []}
    horse = {"id": 1, "image_id": 1, "category_id": 1, "bbox": [10, 10, 90, 90], "area": 8100, "iscrowd": 0}
    picture = {"id": 1, "file_name": "a.jpg", "width": 640, "height": 480}
    documents: dict[str, Any] = {
        "seen.json": seen,
        "package.json": {"name": "web", "version": "1.0.0", "dependencies": {"react": "^18"}},
        "horses.json": {
            "images": [picture],
            "categories": [{"id": 1, "name": "horse"}],
            "annotations": [horse],
        },
        "named.json": named,
        "intrinsics.json": {"fx": 900.0, "fy": 900.0, "cx": 640.0, "cy": 360.0},
        "nobody/a_000000000000_keypoints.json": nobody,
        "nobody/a_000000000001_keypoints.json": nobody,
        "mixed/package.json": {"name": "web"},
        "mixed/notes.json": [1, 2, 3],
    }
    for name, document in documents.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(json.dumps(document), encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return a folder with the samples and files of other programs."""
    made: Path = tmp_path_factory.mktemp("mistakes")
    lay_out(made)
    yield made


def files(folder: Path) -> set[str]:
    """List all files of a folder."""
    return {str(path) for path in folder.rglob("*")}


@pytest.mark.parametrize(("what", "command", "says"), MISTAKES, ids=[one[0] for one in MISTAKES])
def test_a_mistake_is_one_line_with_its_remedy(
    folder: Path,
    what: str,
    command: str,
    says: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["posekit", *command.split()])
    before = files(folder)
    with pytest.raises(SystemExit) as ended:
        main()
    printed = capfd.readouterr()
    lines = printed.err.strip().split("\n")
    assert ended.value.code == 2, printed.err
    assert len(lines) == 1, printed.err
    assert lines[0].startswith("posekit: error: ")
    assert "Traceback" not in printed.err
    for words in says:
        assert words in lines[0]
    assert files(folder) == before
