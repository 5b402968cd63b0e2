"""DeepLabCut's CSV: three header rows (scorer, bodyparts, coords), four with individuals.

``deeplabcut.analyze_videos(..., save_as_csv=True)`` and the labelled data of a project (DeepLabCut, docs:
standardDeepLabCut_UserGuide and maDLC_UserGuide): pandas' table with columns (scorer[, individuals], bodyparts,
coords), coords x, y and, of a network, likelihood. An empty field is a point that is missing. The names are the user's.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from posekit.errors import InputError
from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.named_layout import by_names
from posekit.formats.keypoints.rows import LARGEST_NUMBER, DetectionRows
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.geometry import Array
from posekit.safe_io import cut, refusal, shown

HDF5_SUFFIXES = (".h5", ".hdf5", ".hdf")
MAX_COLUMNS = 100_000
HEADER_LEVELS = ("scorer", "individuals", "bodyparts", "coords")


def looks_like(given: GivenFile) -> bool:
    """Tell whether it is CSV with DeepLabCut's header, or HDF5, which has to be saved as CSV first."""
    if given.suffix in HDF5_SUFFIXES:
        return True
    return given.suffix == ".csv" and given.text.lstrip().startswith(("scorer,", '"scorer",'))


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
    """Read DeepLabCut's CSV.

    Raises
    ------
    InputError
        Where it is HDF5, no such table, or its names fit no skeleton map.
    """
    if given.suffix in HDF5_SUFFIXES:
        remedy = "save it with deeplabcut.analyze_videos_converth5_to_csv, or pandas.read_hdf(…).to_csv(…)"
        raise refusal(given.path, "", "HDF5", "DeepLabCut's CSV", remedy)
    reader = csv.reader(given.text.lstrip().splitlines())
    try:
        header, lead = _header(given.path, reader)
        labels, values = _body(given.path, reader, lead, len(header["coords"]))
    except csv.Error as error:
        raise refusal(
            given.path, f"line {reader.line_num}", cut(str(error)), "CSV", "save it again"
        ) from None
    return _people(given.path, header, labels, values, layout)


def _header(path: Path, reader: Iterator[list[str]]) -> tuple[dict[str, list[str]], int]:
    """Return the header's levels without their first fields, and how many those are: the index may have three."""
    levels: dict[str, list[str]] = {}
    for fields in reader:
        name = fields[0].strip() if fields else ""
        if name not in HEADER_LEVELS or name in levels:
            expected = "scorer, (individuals,) bodyparts, coords"
            raise refusal(path, f"line {len(levels) + 1}", shown(name), expected, "save it again")
        levels[name] = [field.strip() for field in fields]
        if name == "coords":
            break
    if not {"bodyparts", "coords"} <= set(levels):
        raise refusal(
            path, "", "a header without bodyparts or coords", "DeepLabCut's header", "save it again"
        )
    coords = levels["coords"]
    lead = next((k for k, coord in enumerate(coords[1:], 1) if coord), len(coords))
    if len({len(fields) for fields in levels.values()}) > 1 or not 0 < len(coords) - lead <= MAX_COLUMNS:
        raise refusal(path, "", "header rows of other lengths, or none", "equally long ones", "save it again")
    for k, coord in enumerate(coords[lead:]):
        if coord not in ("x", "y", "likelihood"):
            raise refusal(
                path, f"coords, column {lead + k + 1}", shown(coord), "x, y, likelihood", "save it again"
            )
    return {name: fields[lead:] for name, fields in levels.items()}, lead


def _body(
    path: Path, reader: Iterator[list[str]], lead: int, columns: int
) -> tuple[list[str], list[list[float]]]:
    labels, values = [], []
    for line, fields in enumerate(reader, 1):
        if not fields:
            continue
        if len(fields) != lead + columns:
            got, expected = f"{len(fields)} fields", f"{lead + columns}, as in the header"
            raise refusal(path, f"row {line} after the header", got, expected, "correct the row")
        labels.append("/".join(fields[:lead]).strip())
        try:
            row = [float(field) if field.strip() else np.nan for field in fields[lead:]]
        except ValueError:
            wrong = next(field for field in fields[lead:] if not _is_number(field))
            got = f"{shown(wrong)}"
            raise refusal(path, f"row {line} after the header", got, "numbers", "correct the row") from None
        values.append(row)
    return labels, values


def _is_number(text: str) -> bool:
    try:
        float(text or "nan")
    except ValueError:
        return False
    return True


def _people(
    path: Path,
    header: dict[str, list[str]],
    labels: list[str],
    values: list[list[float]],
    layout: SkeletonMap | None,
) -> KeyPoints:
    """Make a person of each individual; one whose points place no landmarks is none: a project's unique points."""
    table = np.array(values, dtype=np.float64).reshape(len(labels), len(header["coords"]))
    beyond = np.abs(table) > LARGEST_NUMBER
    if beyond.any():
        row, column = (int(k) for k in np.argwhere(beyond)[0])
        got = shown(float(table[row, column]))
        raise refusal(path, f"row {row + 1} after the header", got, f"at most {LARGEST_NUMBER:g} in size")
    individuals = header.get("individuals") or [""] * len(header["coords"])
    names = {name: _parts(path, header, individuals, name) for name in dict.fromkeys(individuals)}
    fitted = _layout(path, {name: list(parts) for name, parts in names.items()}, layout)
    rows = DetectionRows(str(path))
    for label in labels:
        rows.picture(label)
    for person, (who, parts) in enumerate(names.items()):
        if who in fitted.people:
            points, sure = _columns(table, parts, fitted.map.points)
            for row in map(int, np.flatnonzero(~np.isnan(points[..., 0]).all(axis=1))):
                told = person if len(names) > 1 or who else -1
                rows.add(labels[row], points[row], sure[row], person=told)
    return rows.keypoints("deeplabcut", fitted.map)


def _parts(
    path: Path, header: dict[str, list[str]], individuals: list[str], who: str
) -> dict[str, dict[str, int]]:
    """Return the columns of one individual by body part and coordinate."""
    parts: dict[str, dict[str, int]] = {}
    for column, (name, part, coord) in enumerate(
        zip(individuals, header["bodyparts"], header["coords"], strict=True)
    ):
        if name == who:
            columns = parts.setdefault(part, {})
            if coord in columns:
                got = f"{shown(part)}: {coord} twice"
                raise refusal(path, "bodyparts", got, "each once", "write one scorer's table at a time")
            columns[coord] = column
    for part, columns in parts.items():
        if not {"x", "y"} <= set(columns):
            raise refusal(path, "bodyparts", f"{shown(part)} without x or y", "both", "save it again")
    return parts


class _Fitted:
    """The layout of those individuals that have it."""

    def __init__(self, layout: SkeletonMap, people: list[str]) -> None:
        self.map, self.people = layout, people


def _layout(path: Path, parts: dict[str, list[str]], layout: SkeletonMap | None) -> _Fitted:
    refused: InputError | None = None
    found: _Fitted | None = None
    for who, names in parts.items():
        try:
            fitting = by_names(names, layout, path)
        except InputError as error:
            refused = refused or error
            continue
        if found is None:
            found = _Fitted(fitting, [who])
        elif found.map.points == fitting.points:
            found.people.append(who)
        elif len(fitting.landmarks) > len(found.map.landmarks):
            found = _Fitted(fitting, [who])
    if found is None:
        raise refused or refusal(path, "bodyparts", "none", "one or more", "save it again")
    return found


def _columns(table: Array, parts: dict[str, dict[str, int]], names: tuple[str, ...]) -> tuple[Array, Array]:
    nothing = table.shape[1]
    padded = np.concatenate([table, np.full((len(table), 1), np.nan)], axis=1)
    pick = {
        coord: np.array([parts[name].get(coord, nothing) for name in names], dtype=np.intp)
        for coord in ("x", "y", "likelihood")
    }
    points = np.stack([padded[:, pick["x"]], padded[:, pick["y"]]], axis=-1)
    points[np.isnan(points).any(axis=-1)] = np.nan
    return points, padded[:, pick["likelihood"]]


DEEPLABCUT_FORMAT: Final = KeyPointFormat(
    name="deeplabcut",
    title="DeepLabCut's CSV: scorer, (individuals,) bodyparts, coords",
    suffixes=(".csv", *HDF5_SUFFIXES),
    looks_like=looks_like,
    read=read,
)
