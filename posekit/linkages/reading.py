"""Linkages by name or from TOML files of schema `posekit.linkage/1`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from posekit.errors import InputError
from posekit.linkages.linkage import Linkage

if TYPE_CHECKING:
    from posekit.tables.linkage import LinkageTable


def linkage_names() -> tuple[str, ...]:
    """Return the names of the built-in linkages."""
    from posekit.tables.reading import built_in_names

    return built_in_names("linkages")


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
    from posekit.tables.reading import named_table

    return named_table(name, LinkageTable, linkage_of, folder="linkages", what="linkage")


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
