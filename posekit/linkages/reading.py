"""Linkages by name or from TOML files of schema `posekit.linkage/1`."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any, NoReturn

from posekit.errors import InputError
from posekit.linkages.linkage import Linkage
from posekit.safe_io.refusal import nearest, refusal, shown
from posekit.safe_io.text_file import read_text
from posekit.safe_io.toml_file import parse_toml

LINKAGES_SCHEMA = "posekit.linkage/1"
MAX_BYTES = 1_000_000

LINKAGE_FIELDS = (
    "schema",
    "name",
    "source",
    "unit",
    "height",
    "urdf",
    "points",
    "midpoints",
    "segments",
    "constraints",
)
WRITTEN_CONSTRAINTS = ("coplanar", "perpendicular", "collinear")


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
    built_in = linkage_names()
    if str(name) in built_in:
        text = (resources.files("posekit.urdf") / "linkages" / f"{name}.toml").read_text(encoding="utf-8")
        return parse_linkage(text, str(name))
    path = Path(name)
    try:
        there = bool(str(name)) and path.exists()
    except (OSError, ValueError):  # too long for a path, or a NUL in it
        there = False
    if not there:
        raise refusal(
            "", "linkage", shown(str(name)), f"{', '.join(built_in)} or a TOML file", "correct the name"
        )
    return parse_linkage(read_text(path, limit=MAX_BYTES), path)


def parse_linkage(text: str, source: str | Path) -> Linkage:
    """Parse the TOML of a linkage that came from `source`; its name is the file's, where it gives none."""
    table = parse_toml(text, source)
    schema = table.get("schema")
    if schema != LINKAGES_SCHEMA:
        raise refusal(
            source,
            "schema",
            shown(schema),
            f'"{LINKAGES_SCHEMA}"',
            f'write schema = "{LINKAGES_SCHEMA}" in the first line',
        )
    for field in table:
        if field not in LINKAGE_FIELDS:
            raise refusal(
                source, field, "a field that is not known", "one that is", nearest(field, LINKAGE_FIELDS)
            )
    constraints = _table(source, "constraints", table.get("constraints", {}))
    for field in constraints:
        if field not in WRITTEN_CONSTRAINTS:
            raise refusal(
                source,
                f"constraints.{field}",
                "a kind that is not known",
                ", ".join(WRITTEN_CONSTRAINTS),
                nearest(field, WRITTEN_CONSTRAINTS),
            )
    try:
        return Linkage.from_names(
            name=_text(source, "name", table.get("name", Path(source).stem)),
            points=_names(source, "points", table.get("points")),
            segments={
                segment: _number(source, f"segments.{segment}", length)
                for segment, length in _table(source, "segments", table.get("segments")).items()
            },
            midpoints={
                middle: _pair(source, f"midpoints.{middle}", ends)
                for middle, ends in _table(source, "midpoints", table.get("midpoints", {})).items()
            },
            coplanar=_groups(source, "constraints.coplanar", constraints.get("coplanar", [])),
            perpendicular=[
                _pair(source, f"constraints.perpendicular[{number}]", pair)
                for number, pair in enumerate(
                    _groups(source, "constraints.perpendicular", constraints.get("perpendicular", []))
                )
            ],
            collinear=_groups(source, "constraints.collinear", constraints.get("collinear", [])),
            unit=None if "unit" not in table else _number(source, "unit", table["unit"]),
            height=None if "height" not in table else _number(source, "height", table["height"]),
            urdf=None if "urdf" not in table else _text(source, "urdf", table["urdf"]),
            source=_text(source, "source", table.get("source", "")),
        )
    except InputError as error:
        # What the object itself is refused for does not know the file it came from.
        if str(error).startswith("linkage "):
            raise InputError(f"{source}: {error}") from None
        raise


def _refuse(source: str | Path, field: str, value: object, expected: str) -> NoReturn:
    raise refusal(source, field, "nothing" if value is None else shown(value), expected, "correct it")


def _text(source: str | Path, field: str, value: object) -> str:
    if not isinstance(value, str) or not value.isprintable():
        _refuse(source, field, value, "a text on one line")
    return value


def _number(source: str | Path, field: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        _refuse(source, field, value, "a number")
    return float(value)


def _table(source: str | Path, field: str, value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        _refuse(source, field, value, f"a table, [{field}]")
    return value


def _names(source: str | Path, field: str, value: object) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        _refuse(source, field, value, "a list of names")
    return value


def _pair(source: str | Path, field: str, value: object) -> tuple[str, str]:
    names = _names(source, field, value)
    if len(names) != 2:
        _refuse(source, field, value, "a list of two names")
    return names[0], names[1]


def _groups(source: str | Path, field: str, value: object) -> list[list[str]]:
    if not isinstance(value, list):
        _refuse(source, field, value, "a list of lists of names")
    return [_names(source, f"{field}[{number}]", group) for number, group in enumerate(value)]
