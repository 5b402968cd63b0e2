"""Find a robot's files: by the name of a published one, or by path."""

from __future__ import annotations

import importlib.metadata
import sys
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

from posekit.errors import nearest, refusal, shown
from posekit.files import DATA

#: Names of the built-in figure.
FIGURE: Final = ("figure", "stick_figure")
ROBOT_PACKAGE: Final = "example-robot-data"
#: Folders above a URDF in which a ``package.xml`` is looked for.
_PACKAGE_DEPTH: Final = 4


class RobotFiles(NamedTuple):
    """Name, URDF, SRDF and package directories of a robot; whether it was found by its name."""

    name: str
    urdf: Path
    srdf: Path | None
    package_dirs: tuple[Path, ...]
    published: bool


def find(name_or_path: str | Path) -> RobotFiles:
    """Find a robot's URDF, its SRDF and the directories of its meshes.

    Parameters
    ----------
    name_or_path : str or path
        A name of `robot_names`, or the path of a URDF. Names with a slash or a suffix are paths. The packages of a
        path are its own folder, the folder above if that holds meshes, and the nearest one with ``package.xml``.

    Raises
    ------
    InputError
        If there is no such robot; the nearest names are given.
    """
    name = str(name_or_path)
    known = _published() if isinstance(name_or_path, str) else {}
    is_path = "/" in name or name.lower().endswith((".urdf", ".xml")) or Path(name).is_file()
    if name.endswith(".xacro"):
        raise refusal(name, "", "a xacro file", "a URDF", "expand it first: xacro FILE > FILE.urdf")
    if name not in known and not is_path:
        install = f"install {ROBOT_PACKAGE}, or write ./ before a file's name"
        remedy = nearest(name, known) if len(known) > len(FIGURE) else install
        raise refusal("", "robot", shown(name), "the name of a robot or the path of a URDF", remedy)
    path = Path(name)
    urdf, srdf = known.get(name, (path, path.with_suffix(".srdf")))
    folder = urdf.resolve().parent
    has_meshes = any((folder.parent / meshes).is_dir() for meshes in ("meshes", "mesh"))
    ancestors = folder, *list(folder.parents)[:_PACKAGE_DEPTH]
    package = [place for place in ancestors if (place / "package.xml").is_file()][:1]
    places = folder, *([folder.parent] if has_meshes else []), *package
    title = (FIGURE[0] if name in FIGURE else name) if name in known else path.stem
    return RobotFiles(
        title, urdf, srdf if srdf.is_file() else None, tuple(dict.fromkeys(places)), name in known
    )


def robot_names() -> tuple[str, ...]:
    """List the names that `find` knows in this environment."""
    return tuple(sorted(_published()))


@lru_cache(maxsize=1)
def _published() -> dict[str, tuple[Path, Path]]:
    """Map names to the URDF and SRDF files of the figure and, if it is installed, of example-robot-data.

    The distribution has data alone, under the prefix of its packager; a system package puts them under ``share``.
    """
    places = [Path(sys.prefix) / "share" / ROBOT_PACKAGE / "robots"]
    try:
        files = importlib.metadata.distribution(ROBOT_PACKAGE)
        places.insert(0, Path(str(files.locate_file(f"cmeel.prefix/share/{ROBOT_PACKAGE}/robots"))))
    except importlib.metadata.PackageNotFoundError:
        pass
    robots = next((place for place in places if place.is_dir()), places[0])
    known = dict.fromkeys(FIGURE, (DATA / "stick_figure.urdf", DATA / "stick_figure.srdf"))
    for urdf in sorted(robots.glob("*/*/*.urdf")):
        known.setdefault(urdf.stem, (urdf, urdf.parents[1] / "srdf" / f"{urdf.stem}.srdf"))
    short_names = tomllib.loads((DATA / "robots.toml").read_text(encoding="utf-8"))["robots"]
    for name, (short, srdf) in short_names.items():
        urdf = robots / f"{short}.urdf"
        if urdf.is_file():
            known[name] = urdf, urdf.parents[1] / "srdf" / f"{srdf}.srdf"
    return known
