"""Which files faults are planted in, and which tests are asked."""

from __future__ import annotations

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
ROOMS: Final = {
    "tree": ("posekit/tree/*.py",),
    "cameras": ("posekit/cameras/**/*.py",),
    "validators": ("posekit/validators/**/*.py",),
    "closed forms of the figure": tuple(
        f"posekit/body/{name}.py"
        for name in (
            "angles",
            "axes",
            "capsules",
            "closed_form",
            "closing",
            "frames",
            "side",
            "torso_bending",
        )
    ),
    "file schemas": (
        "posekit/formats/own/*_schema.py",
        "posekit/formats/own/schemas.py",
        "posekit/formats/own/*_model*.py",
    ),
}
ASKED_ELSEWHERE: Final = ("benchmarks", "viewer", "display", "batch")
"""Folders of tests that are left out: browsers, other processes and measurements, which a fork cannot hold."""


def files_of_rooms() -> dict[str, list[str]]:
    """Return the files of each room, which have more than a docstring and names to import."""
    return {
        room: sorted(
            {
                str(path.relative_to(ROOT))
                for pattern in patterns
                for path in ROOT.glob(pattern)
                if path.name != "__init__.py"
            }
        )
        for room, patterns in ROOMS.items()
    }


def folders_of_tests() -> list[str]:
    """Return the folders of tests that are asked."""
    return sorted(
        str(path.relative_to(ROOT))
        for path in (ROOT / "tests").iterdir()
        if path.is_dir() and path.name not in ASKED_ELSEWHERE and not path.name.startswith((".", "_"))
    )
