"""Write docs/api.md and docs/api/: every module, lowest layer first, a page a package.

    python docs/make_api.py

A page a package: several processes share the work, and what has changed is all that is read and written again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

ROOT = Path(__file__).parents[1]
SECTIONS: Final = (
    ("From Python", "posekit"),
    ("Errors", "posekit.errors"),
    ("Names loaded on demand", "posekit.on_demand"),
    ("Names of joints", "posekit.skeleton"),
    ("How objects show themselves", "posekit.display"),
    ("Vectors and rotations", "posekit.geometry"),
    ("Damped least squares", "posekit.least_squares"),
    ("Settings", "posekit.settings"),
    ("Reading and writing files safely", "posekit.safe_io"),
    ("Tables", "posekit.tables"),
    ("Measures", "posekit.measures"),
    ("Linkages", "posekit.linkages"),
    ("Robots", "posekit.robots"),
    ("The figure", "posekit.body"),
    ("Cameras", "posekit.cameras"),
    ("Compiled loops", "posekit.compiled"),
    ("The interpretation tree", "posekit.tree"),
    ("File formats", "posekit.formats"),
    ("Synthetic views", "posekit.synthesis"),
    ("Views", "posekit.views"),
    ("Joints that are not seen", "posekit.hidden"),
    ("Refinement", "posekit.refinement"),
    ("Ranking", "posekit.ranking"),
    ("Paths through frames", "posekit.following"),
    ("Answers", "posekit.answers"),
    ("Validators", "posekit.validators"),
    ("Viewer", "posekit.viewer"),
    ("Articulated objects", "posekit.objects"),
    ("Recovery", "posekit.recovery"),
    ("Live", "posekit.live"),
    ("The remedy", "posekit.remedy"),
    ("Validation of files", "posekit.validation"),
    ("Conversion", "posekit.conversion"),
    ("Batches", "posekit.batch"),
    ("Inspection", "posekit.inspection"),
    ("Evaluation", "posekit.evaluate"),
    ("The papers", "posekit.papers"),
    ("Samples", "posekit.samples"),
    ("Command line", "posekit.cli"),
    ("The command", "posekit.__main__"),
)
"""Title, and the package or module; those of a package's folders that are packages have pages of their own."""

HEAD: Final = """# Python API

From the lowest layer up; `make layers` holds that none imports one above it.

```{toctree}
:maxdepth: 1

"""


def pages() -> dict[str, str]:
    """Return the text of every page by its path under docs.

    Raises
    ------
    ValueError
        Where a module of posekit would be on no page.
    """
    text: dict[str, str] = {}
    order: list[str] = []
    for title, name in SECTIONS:
        for package, modules in _packages(name).items():
            inside = package.removeprefix(name).lstrip(".").replace(".", ", ")
            path = f"api/{package.removeprefix('posekit.')}.rst"
            order.append(path.removesuffix(".rst"))
            text[path] = _page(f"{title}: {inside}" if inside else title, modules)
    missing = sorted(_top() - {name for _, name in SECTIONS})
    if missing:
        raise ValueError(
            f"{', '.join(missing)}: on no page; expected in SECTIONS of docs/make_api.py; add it"
        )
    return {"api.md": HEAD + "".join(f"{path}\n" for path in order) + "```\n", **text}


def text() -> str:
    """Return the first page, which names the others."""
    return pages()["api.md"]


def write() -> None:
    """Write the pages anew, and remove those of packages that are no more."""
    made = pages()
    docs = ROOT / "docs"
    (docs / "api").mkdir(exist_ok=True)
    for path in (docs / "api").iterdir():
        if f"api/{path.name}" not in made:
            path.unlink()
    for name, text in made.items():
        (docs / name).write_text(text, encoding="utf-8")


def _page(title: str, modules: list[str]) -> str:
    parts = [f"{title}\n{'=' * len(title)}\n"]
    parts += [f"{name}\n{'-' * len(name)}\n\n.. automodule:: {name}\n" for name in modules]
    return "\n".join(parts)


def _packages(name: str) -> dict[str, list[str]]:
    """Return the modules of a package by the package that they are in, itself first; a module is by itself."""
    folder = ROOT / name.replace(".", "/")
    if not folder.is_dir() or name == "posekit":
        return {name: [name]}
    found: dict[str, list[str]] = {}
    for file in sorted(folder.rglob("*.py")):
        parts = (name, *file.relative_to(folder).with_suffix("").parts)
        package = ".".join(parts[:-1])
        found.setdefault(package, [])
        found[package].append(package if parts[-1] == "__init__" else ".".join(parts))
    return {package: sorted(found[package]) for package in sorted(found)}


def _top() -> set[str]:
    """List the modules and packages right inside posekit, but the data's."""
    files = (ROOT / "posekit").glob("*.py")
    folders = (file.parent for file in (ROOT / "posekit").glob("*/__init__.py"))
    names = {file.stem for file in files} | {folder.name for folder in folders}
    return {f"posekit.{name}" for name in names - {"__init__", "urdf"}} | {"posekit"}


if __name__ == "__main__":
    write()
