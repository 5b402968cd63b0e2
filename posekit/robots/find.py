"""Find a robot's files: by the name of a published one, or by path."""

from __future__ import annotations

import importlib.metadata
import os
import sys
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Final

from posekit.robots.names import SHORT_NAMES
from posekit.safe_io import cut, nearest, refusal, shown
from posekit.safe_io.regular_file import check_file
from posekit.safe_io.xml_file import MAX_BYTES

STICK_FIGURE: Final = "stick_figure"
ROBOT_PACKAGE: Final = "example-robot-data"
FOLDERS_OF_URDFS: Final = frozenset(("urdf", "urdfs", "robot", "robots"))
FOLDERS_OF_MESHES: Final = ("meshes", "mesh")
"""A folder of the first kind beside one of the second is one of two in a package."""
_PACKAGE_DEPTH: Final = 4
_URDF: Final = (".urdf", ".xml")


@dataclass(frozen=True, kw_only=True)
class RobotFiles:
    """The files of one robot.

    Parameters
    ----------
    name : str
        The name by which it was asked for, or the file's.
    urdf : Path
        The URDF.
    srdf : Path or None
        The SRDF that belongs to it.
    package_dirs : tuple of Path
        The only directories from which its meshes are taken.
    built_in : bool
        Whether it came with posekit or with example-robot-data.
    """

    name: str
    urdf: Path
    srdf: Path | None
    package_dirs: tuple[Path, ...]
    built_in: bool


def find(
    name_or_path: str | Path,
    *,
    srdf: str | Path | None = None,
    package_dirs: tuple[str | Path, ...] = (),
) -> RobotFiles:
    """Find a robot's URDF, its SRDF and the directories of its meshes.

    Parameters
    ----------
    name_or_path : str or path
        A name of `robot_names` (``human``, ``g1``, ``talos``, ``ur5``, ``panda``, …), ``stick_figure``, or the path
        of a URDF: what ends in ``.urdf`` or ``.xml``, holds a slash, or is no known name but a file.
    srdf : path, optional
        The SRDF; by default the published one, or that of the URDF's own name beside it.
    package_dirs : sequence of path
        Directories that hold its packages, besides the URDF's own. By default those are the URDF's folder, the
        folder above where that holds ``urdf`` or ``robots`` beside ``meshes``, and the nearest one above with a
        ``package.xml``.

    Raises
    ------
    InputError
        Where there is no such robot (the nearest names are listed), file or directory.
    """
    given = tuple(_directory(Path(folder)) for folder in package_dirs)
    wanted = None if srdf is None else Path(srdf)
    name = os.fspath(name_or_path)
    found = _published(name) if isinstance(name_or_path, str) and not _is_path(name) else None
    if found is None:
        if not _is_path(name) and not (isinstance(name_or_path, Path) or _is_file(name)):
            expected = "the name of a robot, or the path of a URDF"
            raise refusal("", "robot", shown(name), expected, _suggestion(name))
        found = _from_path(Path(name))
    return RobotFiles(
        name=found.name,
        urdf=found.urdf,
        srdf=wanted or found.srdf,
        package_dirs=(*given, *found.package_dirs),
        built_in=found.built_in,
    )


def robot_names() -> tuple[str, ...]:
    """List the names that `find` knows in this environment."""
    return (STICK_FIGURE, *sorted(_known_files()))


def robots_folder() -> Path | None:
    """Return the folder of example-robot-data's robots, None where it is not installed.

    The distribution has data alone, under the prefix of its own packager; a system package puts it under
    ``share``.
    """
    places = [Path(sys.prefix) / "share" / ROBOT_PACKAGE / "robots"]
    try:
        files = importlib.metadata.distribution(ROBOT_PACKAGE)
    except importlib.metadata.PackageNotFoundError:
        pass
    else:
        places.insert(0, Path(str(files.locate_file(f"cmeel.prefix/share/{ROBOT_PACKAGE}/robots"))))
    return next((place for place in places if place.is_dir()), None)


def _published(name: str) -> RobotFiles | None:
    if name == STICK_FIGURE:
        folder = Path(str(resources.files("posekit.urdf")))
        return RobotFiles(
            name=name,
            urdf=folder / f"{name}.urdf",
            srdf=folder / f"{name}.srdf",
            package_dirs=(folder,),
            built_in=True,
        )
    known, robots = _known_files(), robots_folder()
    if name not in known or robots is None:
        return None
    urdf, srdf = known[name]
    return RobotFiles(
        name=name,
        urdf=robots / urdf,
        srdf=robots / srdf if srdf else None,
        package_dirs=(robots.parent, robots),
        built_in=True,
    )


@lru_cache(maxsize=1)
def _known_files() -> dict[str, tuple[str, str]]:
    """Map names to URDF and SRDF below the robots' folder: the short names, and those of the other files."""
    robots = robots_folder()
    if robots is None:
        return {}
    known: dict[str, tuple[str, str]] = {}
    for path in sorted(robots.glob("*/*/*.urdf")):
        srdf = path.parents[1] / "srdf" / f"{path.stem}.srdf"
        beside = srdf.relative_to(robots).as_posix() if srdf.is_file() else ""
        known.setdefault(path.stem, (path.relative_to(robots).as_posix(), beside))
    return known | {name: files for name, files in SHORT_NAMES.items() if (robots / files[0]).is_file()}


def _from_path(path: Path) -> RobotFiles:
    if path.name.endswith(".xacro"):
        raise refusal(path, "", "a xacro file", "a URDF", "expand it first: xacro FILE > FILE.urdf")
    check_file(path, limit=MAX_BYTES, too_large="name a robot's URDF")
    folder = path.resolve().parent
    beside = path.with_suffix(".srdf")
    robots = robots_folder()
    built_in = robots is not None and path.resolve().is_relative_to(robots.resolve())
    has_meshes = any((folder.parent / name).is_dir() for name in FOLDERS_OF_MESHES)
    above = [folder.parent] if has_meshes and folder.name in FOLDERS_OF_URDFS else []
    ancestors = folder, *list(folder.parents)[:_PACKAGE_DEPTH]
    package = [place for place in ancestors if (place / "package.xml").is_file()][:1]
    data = [robots.parent, robots] if built_in and robots is not None else []
    return RobotFiles(
        name=path.stem,
        urdf=path,
        srdf=beside if beside.is_file() else None,
        package_dirs=tuple(dict.fromkeys((folder, *above, *package, *data))),
        built_in=built_in,
    )


def _is_path(name: str) -> bool:
    return os.sep in name or "/" in name or name.lower().endswith((*_URDF, ".xacro"))


def _is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except (OSError, ValueError):
        return False


def _suggestion(name: str) -> str:
    if robots_folder() is None:
        return f"install {ROBOT_PACKAGE} for the published robots, or write ./ before a file's name"
    near = nearest(name, robot_names())
    some = f"some names are {', '.join((STICK_FIGURE, 'human', 'simple_humanoid', *SHORT_NAMES))}"
    return near if near.startswith("did") else some


def _directory(path: Path) -> Path:
    try:
        if path.is_dir():
            return path.resolve()
    except (OSError, ValueError):
        pass
    raise refusal(cut(str(path)), "", "no directory", "one that holds packages", "correct package_dirs")
