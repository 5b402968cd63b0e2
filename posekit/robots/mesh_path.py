"""Where a mesh's name leads: into the model's own directories, or nowhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from posekit.errors import InputError
from posekit.safe_io import cut, refusal, shown


def resolve_mesh(name: str, package_dirs: Sequence[Path], source: str, place: str) -> Path:
    """Find a mesh inside the model's directories.

    Parameters
    ----------
    name : str
        As the URDF writes it: ``package://PACKAGE/…``, ``file:///…``, absolute or relative. A package is a folder
        of that name in one of `package_dirs`, or one of them itself.
    package_dirs : sequence of Path
        The only directories from which meshes are taken; relative names count from each of them in turn.
    source, place : str
        The file and the link, for errors.

    Returns
    -------
    Path
        The file, with symbolic links followed.

    Raises
    ------
    InputError
        Where there is no such file, or it lies outside of `package_dirs` once links and ``..`` are followed.
    """
    try:
        for candidate in _candidates(name, package_dirs, source, place):
            if candidate.exists():
                return _inside(name, candidate.resolve(strict=True), package_dirs, source, place)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise _refused(name, cut(reason), source, place) from None
    raise _refused(name, "no such file there", source, place)


def _candidates(name: str, package_dirs: Sequence[Path], source: str, place: str) -> Iterator[Path]:
    scheme, mark, rest = name.partition("://")
    if not mark:
        rest = name
    elif scheme == "package":
        rest = rest.lstrip("/")
        package, _, inner = rest.partition("/")
        yield from (folder / inner for folder in package_dirs if folder.name == package and inner)
    elif scheme == "file":
        rest = "/" + rest.lstrip("/")
    else:
        expected = "package://, file:// or a path"
        raise refusal(source, place, f"the mesh {shown(name)}", expected, "copy the mesh beside the URDF")
    yield from (folder / rest for folder in package_dirs)


def _inside(name: str, found: Path, package_dirs: Sequence[Path], source: str, place: str) -> Path:
    if any(found.is_relative_to(folder.resolve()) for folder in package_dirs):
        return found
    raise _refused(name, "outside of them", source, place)


def _refused(name: str, why: str, source: str, place: str) -> InputError:
    expected = "a mesh inside the model's package directories"
    remedy = "put the mesh there, or name the directory that holds the package (package_dirs)"
    return refusal(source, place, f"the mesh {shown(name)}: {why}", expected, remedy)
