"""Linkages by name or from TOML files of schema `posekit.linkage/1`."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from posekit.errors import InputError
from posekit.linkages.linkage import Linkage
from posekit.safe_io.refusal import refusal, shown

if TYPE_CHECKING:
    from posekit.tables.linkage import LinkageTable


def linkage_names() -> tuple[str, ...]:
    """Return the names of the built-in linkages."""
    folder = resources.files("posekit.urdf") / "linkages"
    return tuple(
        sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))
    )


def load_linkage(name: str | Path) -> Linkage:
    """Load a linkage by name (`taylor_human`, `four_bar`, `planar_chain`) or from a TOML file.

    Parameters
    ----------
    name : str or path
        A built-in name, or a file of at most 1e6 bytes.

    Returns
    -------
    Linkage

    Raises
    ------
    InputError
        Where there is neither, or what is there is not what `posekit.linkage/1` says, or describes no object.

    Examples
    --------
    >>> human = load_linkage("taylor_human")
    >>> len(human.points), len(human.segments)
    (12, 11)
    """
    from posekit.tables.linkage import LinkageTable
    from posekit.tables.reading import read_built_in, read_table

    built_in = linkage_names()
    if str(name) in built_in:
        return linkage_of(read_built_in("linkages", str(name), LinkageTable), str(name))
    path = Path(name)
    try:
        there = bool(str(name)) and path.exists()
    except (OSError, ValueError):  # too long for a path, or a NUL in it
        there = False
    if not there:
        raise refusal(
            "", "linkage", shown(str(name)), f"{', '.join(built_in)} or a TOML file", "correct the name"
        )
    return linkage_of(read_table(path, LinkageTable), path)


def linkage_of(table: LinkageTable, source: str | Path) -> Linkage:
    """Make a linkage of its table; its name is the file's, where the table gives none.

    Parameters
    ----------
    table : LinkageTable
        What a file says.
    source : str or path
        The file, for errors.

    Raises
    ------
    InputError
        Where what it says describes no object.
    """
    try:
        return Linkage.from_names(
            name=table.name or Path(source).stem,
            points=table.points,
            segments=table.segments,
            midpoints={middle: (a, b) for middle, (a, b) in table.midpoints.items()},
            coplanar=table.constraints.coplanar,
            perpendicular=[(a, b) for a, b in table.constraints.perpendicular],
            collinear=table.constraints.collinear,
            unit=table.unit,
            height=table.height,
            urdf=table.urdf,
            source=table.source,
        )
    except InputError as error:
        raise InputError(f"{source}: {error}") from None  # the object does not know the file it came from
