"""Find a robot's files: by the name of a published one, or by path."""

from __future__ import annotations

import sys
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

from posekit.errors import cut, nearest, refusal, shown
from posekit.files import DATA

#: Names of the built-in figure.
FIGURE: Final = ("figure", "stick_figure")
ROBOT_PACKAGE: Final = "example-robot-data"
#: Folders above a URDF in which a ``package.xml`` is looked for.
_PACKAGE_DEPTH: Final = 4


class RobotFiles(NamedTuple):
    """Name, URDF, SRDF and package directories of a robot; whether example-robot-data or posekit has it."""

    name: str
    urdf: Path
    srdf: Path | None
    package_dirs: tuple[Path, ...]
    built_in: bool


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
    if name in FIGURE:
        urdf = DATA / "stick_figure.urdf"
        return RobotFiles(FIGURE[0], urdf, urdf.with_suffix(".srdf"), (DATA,), True)
    known = _published() if isinstance(name_or_path, str) else {}
    if name in known:
        urdf, srdf = known[name]
        robots = urdf.parents[2]
        return RobotFiles(name, urdf, srdf if srdf.is_file() else None, (robots.parent, robots), True)
    if name.endswith(".xacro"):
        raise refusal(name, "", "a xacro file", "a URDF", "expand it first: xacro FILE > FILE.urdf")
    if not ("/" in name or name.lower().endswith((".urdf", ".xml")) or Path(name).is_file()):
        some = nearest(name, known)
        if not some.startswith("did"):
            some = f"some names are {', '.join((FIGURE[0], 'human', *_short_names()))}"
        remedy = some if known else f"install {ROBOT_PACKAGE}, or write ./ before a file's name"
        raise refusal("", "robot", shown(name), "the name of a robot or the path of a URDF", remedy)
    return _from_path(Path(name))


def robot_names() -> tuple[str, ...]:
    """List the names that `find` knows in this environment."""
    return (FIGURE[0], *sorted(_published()))


def directory(path: str | Path) -> Path:
    """Return a directory that holds packages, with symbolic links followed; refuse anything else."""
    if not Path(path).is_dir():
        raise refusal(cut(str(path)), "package_dirs", "no directory", "one that holds packages", "correct it")
    return Path(path).resolve()


@lru_cache(maxsize=1)
def _short_names() -> dict[str, list[str]]:
    text = (DATA / "robots.toml").read_text(encoding="utf-8")
    table: dict[str, list[str]] = tomllib.loads(text)["robots"]
    return table


@lru_cache(maxsize=1)
def _published() -> dict[str, tuple[Path, Path]]:
    """Map names to the URDF and SRDF files of example-robot-data; empty if it is not installed.

    The distribution has data alone, under the prefix of its packager; a system package puts them under ``share``.
    """
    from importlib.metadata import PackageNotFoundError, distribution

    places = [Path(sys.prefix) / "share" / ROBOT_PACKAGE / "robots"]
    try:
        files = distribution(ROBOT_PACKAGE)
        places.insert(0, Path(str(files.locate_file(f"cmeel.prefix/share/{ROBOT_PACKAGE}/robots"))))
    except PackageNotFoundError:
        pass
    robots = next((place for place in places if place.is_dir()), None)
    if robots is None:
        return {}
    known: dict[str, tuple[Path, Path]] = {}
    for urdf in sorted(robots.glob("*/*/*.urdf")):
        known.setdefault(urdf.stem, (urdf, urdf.parents[1] / "srdf" / f"{urdf.stem}.srdf"))
    for name, (short, srdf) in _short_names().items():
        urdf = robots / f"{short}.urdf"
        if urdf.is_file():
            known[name] = urdf, urdf.parents[1] / "srdf" / f"{srdf}.srdf"
    return known


def _from_path(path: Path) -> RobotFiles:
    folder = path.resolve().parent
    built_in = next((f for f in folder.parents if (f.parent.name, f.name) == (ROBOT_PACKAGE, "robots")), None)
    has_meshes = any((folder.parent / name).is_dir() for name in ("meshes", "mesh"))
    ancestors = folder, *list(folder.parents)[:_PACKAGE_DEPTH]
    package = [place for place in ancestors if (place / "package.xml").is_file()][:1]
    places = [folder, *([folder.parent] if has_meshes else []), *package]
    if built_in is not None:
        places += [built_in.parent, built_in]
    srdf = path.with_suffix(".srdf")
    return RobotFiles(
        name=path.stem,
        urdf=path,
        srdf=srdf if srdf.is_file() else None,
        package_dirs=tuple(dict.fromkeys(places)),
        built_in=built_in is not None,
    )
