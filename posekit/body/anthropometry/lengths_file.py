"""Lengths in files: ``posekit.lengths/1`` (TOML or JSON), and the figure of a ``posekit.view/1``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from posekit.body.anthropometry.body import SegmentLengths
from posekit.errors import FigureError, InputError
from posekit.safe_io import one_line, read_json, read_toml, refusal, shown, write_text

if TYPE_CHECKING:
    from posekit.tables.lengths import FigureTable

LENGTHS_SCHEMA: Final = "posekit.lengths/1"
PER_METRE: Final = {"m": 1.0, "cm": 100.0, "mm": 1000.0}


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
    from posekit.tables.file_model import validated
    from posekit.tables.lengths import LengthsTable, ViewLengthsTable

    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".toml", ".json"):
        raise refusal(path, "", f"the ending {shown(suffix)}", ".toml or .json", "name a file of lengths")
    document = read_toml(path) if suffix == ".toml" else read_json(path)
    schema = document.get("schema") if isinstance(document, dict) else None
    if isinstance(schema, str) and schema.startswith("posekit.view/"):
        view = validated(ViewLengthsTable, document, path)
        return _lengths(view.figure, view.unit, f"the figure of {path.name}", path)
    table = validated(LengthsTable, document, path)
    source = str(path) if table.source is None else table.source
    return _lengths(table, table.unit, source, path, table.deviation)


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
        f'schema = "{LENGTHS_SCHEMA}"',
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


def _lengths(
    table: FigureTable,
    unit: str,
    source: str,
    path: Path,
    deviation: Mapping[str, float] = MappingProxyType({}),
) -> SegmentLengths:
    lengths, off = (
        {name: value / PER_METRE[unit] for name, value in each.items()} for each in (table.lengths, deviation)
    )
    stature = None if table.stature is None else table.stature / PER_METRE[unit]
    try:
        return SegmentLengths(
            lengths=lengths, deviation=off, source=source, measured=tuple(lengths), stature=stature
        )
    except FigureError as error:
        raise InputError(f"{path}: {error}; correct the file") from None
