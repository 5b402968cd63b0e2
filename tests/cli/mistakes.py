"""Mistakes that people make at the command line, and the folder in which they make them."""

from __future__ import annotations

import json
import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image

from posekit.samples import write_samples


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """A command with a mistake, and words that the answer has.

    Parameters
    ----------
    group : str
        What it is about.
    what : str
        The mistake.
    command : str
        What is typed after ``posekit``, words parted by spaces.
    says : tuple of str
        Words of the one line: what is wrong, what is expected, what to do.
    """

    group: str
    what: str
    command: str
    says: tuple[str, ...]


def mistakes() -> list[Mistake]:
    """Read the table."""
    table = tomllib.loads((Path(__file__).parent / "mistakes.toml").read_text(encoding="utf-8"))
    return [
        Mistake(group=group, what=row["what"], command=row["command"], says=tuple(row["says"]))
        for group, rows in table.items()
        for row in rows
    ]


MISTAKES: Final = mistakes()


def lay_out(folder: Path, result: Any, report: str) -> None:
    """Write the files among which the mistakes are made.

    Parameters
    ----------
    folder : Path
        An empty one.
    result : Path
        A result, NPZ.
    report : str
        A report of validation, JSON.
    """
    write_samples(folder)
    shutil.copy(result, folder / "postures.npz")
    (folder / "report.json").write_text(report, encoding="utf-8")
    (folder / "empty").mkdir()
    (folder / "empty.json").write_bytes(b"")
    Image.fromarray(np.zeros((8, 8, 3), dtype=np.uint8)).save(folder / "picture.png")
    (folder / "walk.mp4").write_bytes(b"\x00\x00\x00\x20ftypisom\x00\x00\x02\x00" + bytes(64))
    (folder / "notes.md").write_text("# Notes\n\nThe walk looks fine.\n", encoding="utf-8")
    (folder / "walk.csv").write_text("name,age\nAnna,31\n", encoding="utf-8")
    nobody = {"version": 1.3, "people": []}
    coco = {
        "images": [{"id": 1, "file_name": "a.jpg", "width": 640, "height": 480}],
        "categories": [{"id": 1, "name": "horse"}],
        "annotations": [
            {"id": 1, "image_id": 1, "category_id": 1, "bbox": [10, 10, 90, 90], "area": 8100, "iscrowd": 0}
        ],
    }
    named = json.loads((folder / "walk.json").read_text(encoding="utf-8"))
    named["frames"][0]["image"]["left_elbo"] = named["frames"][0]["image"].pop("left_elbow")
    seen = json.loads((folder / "walk.json").read_text(encoding="utf-8"))
    for frame in seen["frames"]:
        frame.pop("truth", None)
    for name, document in {
        "seen.json": seen,
        "package.json": {"name": "web", "version": "1.0.0", "dependencies": {"react": "^18"}},
        "horses.json": coco,
        "named.json": named,
        "intrinsics.json": {"fx": 900.0, "fy": 900.0, "cx": 640.0, "cy": 360.0},
        "nobody/a_000000000000_keypoints.json": nobody,
        "nobody/a_000000000001_keypoints.json": nobody,
        "mixed/package.json": {"name": "web"},
        "mixed/notes.json": [1, 2, 3],
    }.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(json.dumps(document), encoding="utf-8")
