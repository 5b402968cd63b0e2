"""Lengths in files: ``posekit.lengths/1`` (TOML or JSON), and the figure of a ``posekit.view/1``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from posekit.body.anthropometry.body import SegmentLengths
from posekit.errors import FigureError, InputError
from posekit.safe_io import cut, nearest, one_line, read_json, read_toml, refusal, shown, write_text
from posekit.skeleton import SEGMENT_NAMES

SCHEMA: Final = "posekit.lengths/1"
VIEW: Final = "posekit.view/"
FIELDS: Final = ("schema", "unit", "source", "stature", "lengths", "deviation")
PER_METRE: Final = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
LONGEST: Final = 3.0
"""Metres that a segment may have; longer is another unit."""


def _both_sides() -> dict[str, tuple[str, ...]]:
    """Name what stands for both sides: ``elbow-wrist``, ``neck-shoulder``, ``shoulder-pelvis``."""
    names: dict[str, tuple[str, ...]] = {}
    for name in SEGMENT_NAMES:
        if not all(end.startswith("left_") for end in name.split("-")):  # one side names the pair
            plain = name.replace("right_", "").replace("left_", "")
            pair = tuple(dict.fromkeys((name, name.replace("right_", "left_"))))
            if plain != name and len(pair) == 2 and all(one in SEGMENT_NAMES for one in pair):
                names[plain] = pair
    return names


BOTH_SIDES: Final = _both_sides()
"""Names without a side, and the two segments that they stand for."""


def read_lengths(path: str | Path) -> SegmentLengths:
    """Read a person's lengths.

    Parameters
    ----------
    path : path
        TOML or JSON of schema ``posekit.lengths/1``: ``unit`` (m, cm, mm), ``source``, ``lengths`` by segment name,
        optionally ``stature`` and ``deviation``. A name without a side, as ``elbow-wrist``, stands for both. Or JSON of
        schema ``posekit.view/1``, whose ``figure`` is taken.

    Returns
    -------
    SegmentLengths
        Those that the file has, metres: `posekit.body.Figure.scaled` takes some as well as all.

    Raises
    ------
    InputError
        Where the file cannot be read, or is not what its schema says.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".toml", ".json"):
        raise refusal(path, "", f"the ending {shown(suffix)}", ".toml or .json", "name a file of lengths")
    table = read_toml(path) if suffix == ".toml" else read_json(path)
    if not isinstance(table, dict):
        raise refusal(path, "", shown(table), f'an object with schema "{SCHEMA}"', "name a file of lengths")
    schema = table.get("schema")
    if isinstance(schema, str) and schema.startswith(VIEW):
        figure = table.get("figure")
        if not isinstance(figure, dict) or not (figure.get("lengths") or figure.get("stature")):
            raise refusal(
                path, "figure.lengths", shown(figure), "lengths or a stature", "name a view that has them"
            )
        table = {"unit": table.get("unit"), "source": f"the figure of {path.name}"} | {
            name: figure[name] for name in ("lengths", "stature") if figure.get(name) is not None
        }
        return _parsed(table, path, "figure.")
    if schema != SCHEMA:
        raise refusal(path, "schema", shown(schema), f'"{SCHEMA}"', "name it in the first line")
    for field in table:
        if field not in FIELDS:
            raise refusal(path, cut(one_line(field)), "an unknown entry", ", ".join(FIELDS), "remove it")
    return _parsed(table, path, "")


def write_lengths(path: str | Path, lengths: SegmentLengths, *, unit: str = "m") -> None:
    """Write lengths as TOML of schema ``posekit.lengths/1``; `read_lengths` gives them back.

    Raises
    ------
    InputError
        Where the unit is not m, cm or mm, the ending is not ``.toml``, or the file cannot be written.
    """
    path = Path(path)
    if unit not in PER_METRE:
        raise refusal("", "unit", shown(unit), ", ".join(PER_METRE), "choose one of them")
    if path.suffix.lower() != ".toml":
        raise refusal(path, "", f"the ending {shown(path.suffix)}", ".toml", "name it so")
    scale = PER_METRE[unit]
    lines = [
        f'schema = "{SCHEMA}"',
        f'unit = "{unit}"',
        f"source = {json.dumps(one_line(lengths.source), ensure_ascii=False)}",
    ]
    if lengths.stature is not None:
        lines.append(f"stature = {lengths.stature * scale!r}")
    lines += ["", "[lengths]", *(f'"{name}" = {value * scale!r}' for name, value in lengths.lengths.items())]
    off = {name: value for name, value in lengths.deviation.items() if value > 0}
    if off:
        lines += ["", "[deviation]", *(f'"{name}" = {value * scale!r}' for name, value in off.items())]
    write_text(path, (f"{line}\n" for line in lines))


def _parsed(table: Mapping[str, Any], path: Path, place: str) -> SegmentLengths:
    unit = table.get("unit")
    if not isinstance(unit, str) or unit not in PER_METRE:
        got = "nothing" if unit is None else shown(unit)
        raise refusal(path, "unit", got, ", ".join(PER_METRE), "say what the lengths are in")
    source = table.get("source", str(path))
    if not isinstance(source, str):
        raise refusal(path, "source", shown(source), "a text", "say where the lengths come from")
    stature = table.get("stature")
    if stature is not None:
        stature = _number(stature, path, f"{place}stature") / PER_METRE[unit]
    lengths = _named(table.get("lengths", {}), path, f"{place}lengths", unit)
    deviation = _named(table.get("deviation", {}), path, f"{place}deviation", unit)
    if not lengths and stature is None:
        raise refusal(path, f"{place}lengths", "no length", "one or more, or a stature", "add them")
    extra = sorted(set(deviation) - set(lengths))
    if extra:
        raise refusal(
            path, f"deviation.{extra[0]}", "a deviation without its length", "both", "add the length"
        )
    try:
        return SegmentLengths(
            lengths=lengths, deviation=deviation, source=source, measured=tuple(lengths), stature=stature
        )
    except FigureError as error:
        raise InputError(f"{path}: {error}; correct the file") from None


def _named(table: object, path: Path, field: str, unit: str) -> dict[str, float]:
    if not isinstance(table, dict):
        raise refusal(path, field, shown(table), "a table of segments", f"write [{field}] above them")
    values: dict[str, float] = {}
    for key, entry in table.items():
        names = BOTH_SIDES.get(key, (key,))
        place = f"{field}.{cut(one_line(str(key)))}"
        if names[0] not in SEGMENT_NAMES:
            raise refusal(path, place, "an unknown segment", "a known one", nearest(key, SEGMENT_NAMES))
        number = _number(entry, path, place)
        if number / PER_METRE[unit] > LONGEST:
            raise refusal(
                path, place, f"{number:g} {unit}", f"at most {LONGEST:g} m", "correct it, or the unit"
            )
        for name in names:
            if name in values:
                raise refusal(path, place, f"{name} twice", "once", "drop the name without a side")
            values[name] = number / PER_METRE[unit]
    return values


def _number(value: object, path: Path, field: str) -> float:
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not (math.isfinite(value) and value > 0)
    ):
        raise refusal(path, field, shown(value), "a positive number", "correct it")
    return float(value)
