"""Write docs/api.md: every module, lowest layer first.

python docs/make_api.py
"""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[1]
SECTIONS = (
    ("From Python", "posekit", False),
    ("Errors", "posekit.errors", False),
    ("Intake", "posekit.intake", True),
    ("Skeleton", "posekit.skeleton", False),
    ("Cameras", "posekit.cameras", True),
    ("Measures", "posekit.measures", True),
    ("Head", "posekit.head", True),
    ("Interpretation tree", "posekit.tree", True),
    ("Linkages", "posekit.linkage", True),
    ("Robots", "posekit.robot", True),
    ("Figure", "posekit.figure", True),
    ("Grouping", "posekit.grouping", False),
    ("Synthetic views", "posekit.synthesis", True),
    ("Files", "posekit.files", True),
    ("Joints that are not seen", "posekit.occlusion", True),
    ("Validators", "posekit.validators", True),
    ("Viewer", "posekit.viewer", True),
    ("Whole jobs", "posekit.pipeline", True),
    ("Command line", "posekit.cli", True),
)
"""Title, module, and whether its submodules are listed too."""

HEAD = """# Python API

From the lowest layer up; `make layers` holds that none imports one above it.
"""


def modules(package: str) -> list[str]:
    """List a package and its submodules by name."""
    folder = ROOT / package.replace(".", "/")
    found = [package]
    for file in folder.rglob("*.py"):
        parts = file.relative_to(folder).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        if parts:
            found.append(".".join([package, *parts]))
    return sorted(found)


def text() -> str:
    """Return the whole page."""
    sections = [
        f"\n## {title}\n\n```{{eval-rst}}\n"
        + "".join(f".. automodule:: {name}\n" for name in (modules(module) if deep else [module]))
        + "```\n"
        for title, module, deep in SECTIONS
    ]
    return HEAD + "".join(sections)


if __name__ == "__main__":
    (ROOT / "docs" / "api.md").write_text(text(), encoding="utf-8")
