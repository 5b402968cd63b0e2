"""What `posekit validate` says of a clip with a defect that is written to a file: of postures, units and axes."""

from __future__ import annotations

import io
import json
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from posekit.cli import main as command_line
from posekit.skeleton import HEAD_POINTS, JOINTS
from posekit.validators.motion import MotionClip

FOUND_IN_FILES: Final = ("joint-range", "unit", "up")
"""Names of what checks over time do not judge, but the reader of a file, or the checks of its postures."""

SAID_OF_UNIT: Final = ("unit: got the file's own word",)
SAID_OF_UP: Final = ("by the file's own word, though bodies stand along", "up: got")
"""What is said where a file's own word is not that of its points."""


def rejected_in_file(clip: MotionClip) -> dict[str, NDArray[np.bool_]]:
    """Write a clip to a file that says metres and +y up, and say which frames (T,) are rejected by what.

    A file whose unit or whose way up is named is rejected in all its frames.
    """
    every = np.ones(len(clip), dtype=np.bool_)
    with TemporaryDirectory() as folder:
        path, report = Path(folder) / "clip.npz", Path(folder) / "report.json"
        _write(path, clip)
        said = _said("validate", str(path), "-o", str(report))
        frames = {}
        if any(words in said for words in SAID_OF_UNIT):
            frames["unit"] = every
        if any(words in said for words in SAID_OF_UP):
            frames["up"] = every
        if report.exists():
            frames.update(_postures(report, len(clip)))
        return frames


def _write(path: Path, clip: MotionClip) -> None:
    np.savez(
        path,
        joints=np.concatenate([clip.joints, clip.head, clip.feet[:, :2]], axis=1),
        joint_names=np.array([_cmu_name(name) for name in (*JOINTS, *HEAD_POINTS, "right_toe", "left_toe")]),
        clip=np.zeros(len(clip), dtype=np.int64),
        clip_names=np.array(["clip"]),
        clip_action=np.array(["some"]),
        clip_fps=np.array([clip.rate]),
        unit="m",
        up="+y",
    )


def _cmu_name(name: str) -> str:
    """Name a joint as files of CMU's motion do: toes have a name there."""
    return name.replace("right_", "r_").replace("left_", "l_")


def _said(*arguments: str) -> str:
    """Run a command and return what it prints."""
    out = io.StringIO()
    with mock.patch.object(sys, "argv", ["posekit", *arguments]), redirect_stdout(out), redirect_stderr(out):
        try:
            command_line()
        except SystemExit as ended:
            out.write(str(ended.code or ""))
    return out.getvalue()


def _postures(report: Path, count: int) -> dict[str, NDArray[np.bool_]]:
    frames: dict[str, NDArray[np.bool_]] = {}
    for posture in json.loads(report.read_text())["postures"]:
        for finding in posture.get("findings", ()):
            if finding["verdict"] == "invalid":
                name = finding["check"].replace("_", "-")
                frames.setdefault(name, np.zeros(count, dtype=np.bool_))[posture["frame"]] = True
    return frames
