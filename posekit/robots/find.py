"""Find a robot's files by the name of a published robot or by path."""

from __future__ import annotations

import sys
import tomllib
from contextlib import suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Final

from posekit.errors import nearest, refusal, shown
from posekit.files import DATA

#: Names of the built-in figure.
FIGURE: Final = ("figure", "stick_figure")
ROBOT_PACKAGE: Final = "example-robot-data"
#: Number of parent folders of a URDF that can be its package, and names of files or folders that mark a package.
_PACKAGE_DEPTH, _PACKAGE_SIGNS = 4, ("package.xml", "meshes", "mesh")


def find(name_or_path: str | Path) -> tuple[str, Path, Path | None, tuple[Path, ...]]:
    """Find a robot's URDF, its SRDF and the directories of its meshes.

    Parameters
    ----------
    name_or_path : str or path
        A name from `robot_names`, or the path of a URDF. A name with a slash, or with the suffix ``.urdf`` or
        ``.xml``, is a path.

    Returns
    -------
    name : str
    urdf : Path
    srdf : Path or None
    package_dirs : tuple of Path
        The only folders from which meshes are read: the URDF's folder, and each of its four parent folders that
        holds ``package.xml``, ``meshes`` or ``mesh``.

    Raises
    ------
    InputError
        If there is no such robot. The message suggests similar names.
    """
    name = str(name_or_path)
    known = _published() if isinstance(name_or_path, str) else {}
    is_path = "/" in name or name.lower().endswith((".urdf", ".xml")) or Path(name).is_file()
    if name not in known and not is_path:
        install = f"install {ROBOT_PACKAGE}, or write ./ before a file's name"
        remedy = nearest(name, known) if len(known) > len(FIGURE) else install
        raise refusal("", "robot", shown(name), "the name of a robot or the path of a URDF", remedy)
    path = Path(name)
    urdf, srdf = known.get(name, (path, path.with_suffix(".srdf")))
    folder = urdf.resolve().parent
    above = list(folder.parents)[:_PACKAGE_DEPTH]
    packages = [place for place in above if any((place / sign).exists() for sign in _PACKAGE_SIGNS)]
    title = name if name in known else path.stem
    return title, urdf, srdf if srdf.is_file() else None, (folder, *packages)


def robot_names() -> tuple[str, ...]:
    """List the names of robots that `load_robot` finds in this Python environment."""
    return tuple(sorted(_published()))


@lru_cache(maxsize=1)
def _published() -> dict[str, tuple[Path, Path]]:
    """Map names to the URDF and SRDF files of the figure and, if it is installed, of example-robot-data.

    The Python package example-robot-data keeps its files below ``cmeel.prefix``; system packages use ``share``.
    """
    robots = Path(sys.prefix) / "share" / ROBOT_PACKAGE / "robots"
    with suppress(PackageNotFoundError):
        data = distribution(ROBOT_PACKAGE).locate_file(f"cmeel.prefix/share/{ROBOT_PACKAGE}/robots")
        robots = Path(str(data)) if Path(str(data)).is_dir() else robots
    known = dict.fromkeys(FIGURE, (DATA / "stick_figure.urdf", DATA / "stick_figure.srdf"))
    for urdf in sorted(robots.glob("*/*/*.urdf")):
        known.setdefault(urdf.stem, (urdf, urdf.parents[1] / "srdf" / f"{urdf.stem}.srdf"))
    short_names = tomllib.loads((DATA / "robots.toml").read_text(encoding="utf-8"))["robots"]
    for name, (short, srdf) in short_names.items():
        urdf = robots / f"{short}.urdf"
        if urdf.is_file():
            known[name] = urdf, urdf.parents[1] / "srdf" / f"{srdf}.srdf"
    return known
