"""``posekit.result/3``: a `Recovery` as JSON, NPZ and Parquet; ``posekit.result/2`` is read by `earlier_result`.

JSON contains one object per posture, with lengths in the file's unit and null for unknown numbers; empty columns are
omitted. NPZ and Parquet contain the survivors' columns under their names, in metres. NPZ also contains the arrays
``frames.*``, ``answer.*`` and ``path.*``. All other fields are in one JSON text, ``about``, which Parquet stores in its
metadata.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import islice
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.files import write_bytes
from posekit.formats import json_file
from posekit.formats.json_file import nullable
from posekit.formats.node import Node, schema_of, undamaged
from posekit.formats.options import Options
from posekit.formats.tables import Table
from posekit.formats.view_file import check_schema
from posekit.geometry import PER_METRE, Array
from posekit.recovery.recovery import Answer, Frames, Paths, Recovery, Survivors
from posekit.skeleton import HEAD_POINTS, JOINTS

RESULT_SCHEMA: Final = "posekit.result/3"
EARLIER_SCHEMA: Final = "posekit.result/2"
#: Tables of a recovery by the prefix of their columns' names, as in ``frames.time``. Survivors' columns have no prefix.
TABLES: Final = {"": Survivors, "frames": Frames, "answer": Answer, "path": Paths}
#: Exponent of length in the unit of each column that depends on it: 1 for metres, -1 for pixels per metre.
POWERS: Final = {"joints": 1, "head": 1, "radius": 1, "scale": -1, "answer.joints": 1, "path.joints": 1}


class Column(NamedTuple):
    """Shape of a column's entries (None: the number of frames, or the length of q), and the entry if unknown."""

    shape: tuple[int | None, ...] = ()
    empty: Any = np.nan


def _declared(key: str) -> dict[str, Any]:
    """Return the metadata of the table fields that declare `key` (shape or entry), by the fields' names in files."""
    return {
        f"{table}.{one.name}".lstrip("."): one.metadata
        for table, kind in TABLES.items()
        for one in fields(kind)
        if key in one.metadata and one.name != "frame"
    }


COLUMNS: Final = {
    **{name: Column(one["shape"], one["fill"]) for name, one in _declared("shape").items()},
    "q": Column((None,)),
    "path.survivor": Column((None,), -1),
    "path.probability": Column(),
    "path.joints": Column((None, len(JOINTS), 3)),
}
#: Columns that are in every file, even if all their values are empty.
NEEDED: Final = (
    *("joints", "q", "probability"),
    *(name for name in COLUMNS if name.startswith(("frames.", "answer."))),
)
#: Lists with one entry per frame, and their empty entries.
LISTS: Final = {name: one["entry"] for name, one in _declared("entry").items()}
#: Fields of a frame's ``camera`` and ``root`` that are lengths.
CAMERA_LENGTHS: Final = ("f", "position")
ROOT_LENGTHS: Final = ("estimate", "deviation", "lower", "upper", "depth")
#: Fields of a recovery that are mappings.
MAPPINGS: Final = ("settings", "tolerances", "lengths", "camera")
ABOUT: Final = ("unit", *MAPPINGS, "source", "joint_names", "configuration_names")


def looks_like(document: Any) -> bool:
    """Return whether a JSON document, NPZ arrays or a Parquet table contain a result."""
    return schema_of(document).startswith("posekit.result/")


def read(document: Any, path: str | Path, options: Options) -> Recovery:
    """Read a result.

    Raises
    ------
    InputError
        If the document is damaged or of another version.
    """
    with undamaged(path, RESULT_SCHEMA), json_file.without_collection():
        if isinstance(document, Table):
            return _of_columns(_table_columns(document), document.about["posekit"], path)
        root = Node(document, path)
        if check_schema(root, RESULT_SCHEMA, EARLIER_SCHEMA) == EARLIER_SCHEMA:
            from posekit.formats.earlier_result import document_of

            root = Node(document_of(root), path)
        if "about" in root.value:
            return _of_columns(document, root.at("about").text(), path)
        return _of_json(root)


def write_json(path: str | Path, recovery: Recovery) -> None:
    """Write a result as JSON with one object per posture."""
    head = {"schema": RESULT_SCHEMA, **plain({field: getattr(recovery, field) for field in ABOUT})}
    head["lengths"] = {name: value * PER_METRE[recovery.unit] for name, value in recovery.lengths.items()}
    tables = _in_unit(recovery)
    if recovery.path is not None:
        head["paths"] = list(_objects(tables["path"]))
    json_file.write(path, head, "frames", _frame_fields(recovery, tables))


def write_npz(path: str | Path, recovery: Recovery) -> None:
    """Write a result as arrays by name."""
    from posekit.formats.npz_file import packed

    about = json.dumps(_about(recovery), allow_nan=False)
    head = {"schema": np.array(RESULT_SCHEMA), "about": np.array(about), "frame": recovery.survivors.frame}
    write_bytes(path, packed({**head, **_arrays(recovery)}))


def write_parquet(path: str | Path, recovery: Recovery) -> None:
    """Write a result as a table of the survivors, with the rest of the result in its metadata."""
    from posekit.formats.parquet import packed_table

    frame = recovery.survivors.frame
    columns, others = {"frame": frame, "time": np.asarray(recovery.frames.time)[frame]}, {}
    for name, values in _arrays(recovery).items():
        table, field = _parted(name)
        if table in ("", "margin"):
            flat = values.reshape(len(frame), int(np.prod(values.shape[1:])))
            names = [f"margin_{field}"] if table else _flat_names(name, flat.shape[1])
            columns |= dict(zip(names, flat.T, strict=True))
        else:
            others[name] = nullable(values)
    about = json.dumps({**_about(recovery), "arrays": others}, allow_nan=False)
    write_bytes(path, packed_table(columns, {"posekit": about}))


def plain(value: Any) -> Any:
    """Convert mappings, sequences and arrays to dicts and lists for JSON, with None for NaN."""
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return nullable(np.asarray(value))
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def _parted(name: str) -> tuple[str, str]:
    """Split a column's name in files into table and field: ``frames.time`` is ("frames", "time")."""
    table, dot, field = name.partition(".")
    return (table, field) if dot else ("", name)


def _held(recovery: Recovery, name: str) -> Any:
    """Return a column or a list of a recovery by its name in files; None if its table is absent."""
    table, field = _parted(name)
    return getattr(getattr(recovery, table or "survivors"), field, None)


def _arrays(recovery: Recovery) -> dict[str, NDArray[Any]]:
    """Return the columns of all tables by name, in metres; omit optional survivors' columns without known values."""
    found = {}
    for name, column in COLUMNS.items():
        if (held := _held(recovery, name)) is not None:
            values = np.asarray(held)
            nothing = np.full_like(values, column.empty)
            silent = np.array_equal(values, nothing, equal_nan=values.dtype.kind == "f")
            if "." in name or name in NEEDED or not silent:
                found[name] = values
    return found | {f"margin.{check}": one for check, one in recovery.survivors.margins.items()}


def _about(recovery: Recovery) -> dict[str, Any]:
    """Return the fields of a result that are not arrays."""
    about = {"schema": RESULT_SCHEMA, **plain({name: getattr(recovery, name) for name in ABOUT})}
    about |= {"frames": {"pictures": list(recovery.frames.pictures)}, "answer": {}}
    for name in LISTS:
        table, field = _parted(name)
        about[table][field] = plain(_held(recovery, name))
    return about


def _in_unit(recovery: Recovery) -> dict[str, dict[str, list[Any]]]:
    """Return the columns of each table as lists in the file's unit; survivors are numbered from 0 in each frame."""
    per, starts = PER_METRE[recovery.unit], np.array([recovery.rows(k).start for k in range(len(recovery))])
    tables: dict[str, dict[str, list[Any]]] = {table: {} for table in (*TABLES, "margin")}
    for name, column in _arrays(recovery).items():
        table, field = _parted(name)
        values = np.where(column >= 0, column - starts, -1) if field == "survivor" else column
        power = POWERS.get(name, 0)
        tables[table][field] = nullable(values * per**power if power else values)
    if tables["margin"]:
        tables[""]["margins"] = list(_objects(tables["margin"]))
    return tables


def _objects(columns: Mapping[str, list[Any]]) -> Iterator[dict[str, Any]]:
    """Yield the rows of columns as dicts."""
    return (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))


def _frame_fields(recovery: Recovery, tables: Mapping[str, dict[str, list[Any]]]) -> Iterator[dict[str, Any]]:
    """Yield the frames as JSON objects in the file's unit."""
    per, frames = PER_METRE[recovery.unit], recovery.frames
    postures, of_frames, of_answer = (_objects(tables[table]) for table in ("", "frames", "answer"))
    for k, (frame, answer) in enumerate(zip(of_frames, of_answer, strict=True)):
        for name in LISTS:
            table, field = _parted(name)
            (frame if table == "frames" else answer)[field] = plain(_held(recovery, name)[k])
        rows = recovery.rows(k)
        answer["survivor"] = answer["survivor"] if answer["survivor"] >= 0 else None
        answer["representatives"] = [row - rows.start for row in answer["representatives"]]
        yield {
            **frame,
            **({"picture": frames.pictures[k]} if frames.pictures else {}),
            "camera": plain(_scaled(frames.camera[k], CAMERA_LENGTHS, per)),
            "root": plain(_scaled(frames.root[k], ROOT_LENGTHS, per)),
            "answer": answer,
            "postures": list(islice(postures, rows.stop - rows.start)),
        }


def _scaled(fields: Mapping[str, Any] | None, lengths: tuple[str, ...], per: float) -> dict[str, Any] | None:
    """Multiply the fields in `lengths`, and with a focal length f the residual, by `per`; divide the scale by it."""
    if fields is None:
        return None
    found = dict(fields)
    for name in (*lengths, *(("residual",) if fields.get("f") is not None else ())):
        if found.get(name) is not None:
            found[name] = np.asarray(found[name], dtype=np.float64) * per
    if found.get("scale") is not None:
        found["scale"] = np.asarray(found["scale"], dtype=np.float64) / per
    return found


def _of_json(root: Node) -> Recovery:
    """Convert a JSON document to a recovery."""
    document, per = root.value, PER_METRE[root.at("unit").text(PER_METRE)]
    frames = document["frames"]
    counts = [len(frame["postures"]) for frame in frames]
    starts = np.cumsum([0, *counts])[:-1]
    tables: dict[str, Sequence[Mapping[str, Any]]] = {
        "": [posture for frame in frames for posture in frame["postures"]],
        "frames": frames,
        "answer": [frame.get("answer") or {} for frame in frames],
        "path": document.get("paths") or [],
    }
    columns: dict[str, Any] = {"frame": np.repeat(np.arange(len(frames)), counts)}
    for name, (shape, empty) in COLUMNS.items():
        table, field = _parted(name)
        if name not in NEEDED and not any(field in one for one in tables[table]):
            continue
        if empty == "":
            columns[name] = np.array([str(one.get(field, empty)) for one in tables[table]])
            continue
        unstated = len(document["configuration_names"] if name == "q" else frames)
        values = _stacked(tables[table], field, *(extent or unstated for extent in shape))
        if field == "survivor":
            values = np.where(values >= 0, values + starts, -1)
        columns[name] = values / per ** POWERS.get(name, 0)
    margins = [posture.get("margins") or {} for posture in tables[""]]
    for check in dict.fromkeys(check for one in margins for check in one):
        columns[f"margin.{check}"] = _stacked(margins, check)
    about = {
        **document,
        "lengths": {name: value / per for name, value in (document.get("lengths") or {}).items()},
        "frames": {"pictures": [frame.get("picture", "") for frame in frames]},
        "answer": {},
    }
    for name in LISTS:
        table, field = _parted(name)
        about[table][field] = [one.get(field) for one in tables[table]]
    for field, lengths in (("camera", CAMERA_LENGTHS), ("root", ROOT_LENGTHS)):
        about["frames"][field] = [_scaled(frame.get(field), lengths, 1 / per) for frame in frames]
    about["answer"]["representatives"] = [
        np.array(rows or [], dtype=np.intp) + start
        for rows, start in zip(about["answer"]["representatives"], starts, strict=True)
    ]
    return _of_columns(columns, about, root.source)


def _stacked(holders: Sequence[Mapping[str, Any]], name: str, *shape: int) -> Array:
    """Gather one field of N objects into an array (N, *shape); NaN for null or absent fields."""
    nothing = np.full(shape, np.nan).tolist() if shape else np.nan
    values = [nothing if (value := one.get(name)) is None else value for one in holders]
    return np.array(values, dtype=np.float64).reshape(len(holders), *shape)


def _flat_names(name: str, width: int) -> list[str]:
    """Return the names of the scalar columns of one array column, as in `Recovery.to_pandas`."""
    if name == "q":
        return [f"q_{k}" for k in range(width)]
    if name in ("joints", "head"):
        points = JOINTS if name == "joints" else HEAD_POINTS
        return [f"{point}_{axis}" for point in points for axis in "xyz"]
    return [f"{joint}_{name}" for joint in JOINTS] if COLUMNS[name].shape else [name]


def _table_columns(table: Table) -> dict[str, Any]:
    """Gather the survivors' array columns from the scalar columns of a table."""
    names = set(table.names)
    frame = table.column("frame").astype(np.intp)
    found: dict[str, Any] = {"frame": frame}
    width = sum(name.removeprefix("q_").isdecimal() for name in names if name.startswith("q_"))
    for name, (shape, empty) in COLUMNS.items():
        flat = _flat_names(name, width)
        if "." in name or not set(flat) <= names:
            continue
        values = np.array([table.texts(one) if empty == "" else table.column(one) for one in flat]).T
        found[name] = values.reshape(len(frame), *(extent or width for extent in shape))
    margins = [name for name in table.names if name.startswith("margin_")]
    return found | {f"margin.{name.removeprefix('margin_')}": table.column(name) for name in margins}


def _of_columns(columns: Mapping[str, Any], about: Any, path: str | Path) -> Recovery:
    """Make a recovery from arrays by name and from all other fields, given as a mapping or as JSON text."""
    if isinstance(about, str):
        about = json_file.parse(about.encode(), f"{path}: about")
    root, arrays = Node(about, path), Node({**(about.get("arrays") or {}), **columns}, path)
    frame = arrays.at("frame").array(None).astype(np.intp)
    rows, count = len(frame), len(_values(arrays, "frames.time", None, None))
    if rows and (frame.min() < 0 or frame.max() >= count or (np.diff(frame) < 0).any()):
        raise arrays.at("frame").refused(f"ascending frames below {count}", "write the result again")
    tables: dict[str, dict[str, Any]] = {table: {} for table in (*TABLES, "margin")}
    length = {"": rows, "frames": count, "answer": count, "path": None}
    for name in {**dict.fromkeys(NEEDED), **arrays.value}:
        table, field = _parted(name)
        if name in COLUMNS:
            tables[table][field] = _values(arrays, name, length[table], None if name == "q" else count)
        elif table == "margin":
            tables[table][field] = arrays.at(name).array(rows, unknown=True)
    if (tables["answer"]["survivor"] >= rows).any():
        raise arrays.at("answer.survivor").refused(f"rows of {rows} postures", "write the result again")
    for name, empty in LISTS.items():
        table, field = _parted(name)
        entries = [empty if one is None else one for one in root.at(table).object().get(field) or ()]
        numbers = isinstance(empty, np.ndarray)
        tables[table][field] = [np.array(one, empty.dtype) for one in entries] if numbers else entries
    pictures = [str(name) for name in root.at("frames").object().get("pictures") or ()]
    if root.at("joint_names").texts() != JOINTS:
        raise root.at("joint_names").refused("the 14 joints in tree order", "write the result again")
    mappings: dict[str, Any] = {name: about.get(name) or {} for name in MAPPINGS}
    return Recovery(
        survivors=Survivors(frame=frame, margins=tables["margin"], **tables[""]),
        frames=Frames(**tables["frames"], pictures=pictures if any(pictures) else ()),
        answer=Answer(**tables["answer"]),
        path=Paths(**tables["path"]) if tables["path"] else None,
        **mappings,
        configuration_names=root.at("configuration_names").texts(),
        unit=root.at("unit").text(PER_METRE),
        source=str(about.get("source") or ""),
    )


def _values(arrays: Node, name: str, rows: int | None, frames: int | None) -> NDArray[Any]:
    """Return the array of a column, with NaN replaced by the column's entry for unknown values."""
    node, (shape, empty) = arrays.at(name), COLUMNS[name]
    if empty == "":
        return np.asarray(node.value)
    values = node.array(rows, *(extent or frames for extent in shape), unknown=True)
    return np.where(np.isnan(values), empty, values).astype(type(empty))
