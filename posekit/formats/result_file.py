"""``posekit.result/3``: a `Recovery` as JSON, NPZ and Parquet; ``posekit.result/2`` is read by `earlier_result`.

JSON has an object a posture, lengths in the file's unit, null for unknown numbers; columns that hold nothing are left
out. NPZ and Parquet have the columns of the survivors under their names, metres: NPZ also ``frames.*``, ``answer.*``
and ``path.*`` arrays. Everything else is one JSON text, ``about``, which Parquet keeps in its metadata.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
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
from posekit.skeleton import HEAD_POINTS, JOINTS, TREE_SEGMENTS

RESULT_SCHEMA: Final = "posekit.result/3"
EARLIER_SCHEMA: Final = "posekit.result/2"


class Column(NamedTuple):
    """Shape of a row's value (None: number of frames, or size of q), its empty value, and its power of length."""

    shape: tuple[int | None, ...] = ()
    empty: Any = np.nan
    power: int = 0


#: Columns of the survivors, in the order of JSON, then the arrays of the other tables.
COLUMNS: Final = {
    "joints": Column((len(JOINTS), 3), power=1),
    "head": Column((len(HEAD_POINTS), 3), power=1),
    "q": Column((None,)),
    "probability": Column(),
    "chi2": Column(empty=0.0),
    "branch": Column(empty=""),
    "group": Column(empty=-1),
    "radius": Column((len(JOINTS),), 0.0, power=1),
    "inferred": Column((len(JOINTS),), False),
    "scale": Column(power=-1),
    "frames.time": Column(),
    "frames.unlisted": Column(empty=0),
    "frames.unlisted_probability": Column(empty=0.0),
    "answer.joints": Column((len(JOINTS), 3), power=1),
    "answer.sure": Column(),
    "answer.survivor": Column(empty=-1),
    "answer.nearer": Column((len(TREE_SEGMENTS),), 0),
    "answer.nearer_sure": Column((len(TREE_SEGMENTS),)),
    "path.survivor": Column((None,), -1),
    "path.probability": Column(),
    "path.joints": Column((None, len(JOINTS), 3), power=1),
}
OF_SURVIVORS: Final = [name for name in COLUMNS if "." not in name]
#: Columns that are there even if they say nothing.
NEEDED: Final = ("joints", "q", "probability")
CAMERA_LENGTHS: Final = ("f", "position")
#: Fields of a frame's ``camera`` and ``root`` that are lengths.
ROOT_LENGTHS: Final = ("estimate", "deviation", "lower", "upper", "depth")
#: Fields of a recovery beside its tables.
MAPPINGS: Final = ("settings", "tolerances", "lengths", "camera")
ABOUT: Final = ("unit", *MAPPINGS, "source", "joint_names", "configuration_names")
#: Lists with an entry a frame, and the entry that says nothing.
FRAME_FILL: Final[dict[str, Any]] = {
    **{"camera": {}, "rejected": {}, "levels": (), "reason": "", "judged": "", "root": None}
}
FRAME_LISTS: Final = ("pictures", *FRAME_FILL)
ANSWER_LISTS: Final = ("sure_of", "representatives", "represented")


def looks_like(document: Any) -> bool:
    """Tell whether a JSON document, NPZ arrays or a Parquet table hold a result."""
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
    """Write a result as JSON, an object a posture."""
    head = {"schema": RESULT_SCHEMA, **plain({field: getattr(recovery, field) for field in ABOUT})}
    head["lengths"] = {name: value * PER_METRE[recovery.unit] for name, value in recovery.lengths.items()}
    if recovery.path is not None:
        head["paths"] = _paths_fields(recovery)
    json_file.write(path, head, "frames", _frame_fields(recovery))


def write_npz(path: str | Path, recovery: Recovery) -> None:
    """Write a result as arrays by name."""
    from posekit.formats.npz_file import packed

    about = json.dumps(_about(recovery), allow_nan=False)
    arrays = {"schema": np.array(RESULT_SCHEMA), "about": np.array(about), **_arrays(recovery)}
    write_bytes(path, packed(arrays))


def write_parquet(path: str | Path, recovery: Recovery) -> None:
    """Write a result as a table of the survivors, everything else in its metadata."""
    from posekit.formats.parquet import packed_table

    tables = {name: nullable(values) for name, values in _other_arrays(recovery).items()}
    about = json.dumps({**_about(recovery), "arrays": tables}, allow_nan=False)
    write_bytes(path, packed_table(_flat(recovery), {"posekit": about}))


def plain(value: Any) -> Any:
    """Turn mappings, sequences and arrays into what JSON spells, with None for NaN."""
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return nullable(np.asarray(value))
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def _columns(recovery: Recovery) -> dict[str, NDArray[Any]]:
    """Return the survivors' columns that say something, without margins."""
    found = {}
    for name in OF_SURVIVORS:
        values, empty = getattr(recovery.survivors, name), COLUMNS[name].empty
        unknown = isinstance(empty, float) and np.isnan(empty)
        silent = np.isnan(values) if unknown else values == empty
        if name in NEEDED or not silent.all():
            found[name] = values
    return found


def _frame_fields(recovery: Recovery) -> Iterator[dict[str, Any]]:
    """Yield the frames as JSON objects in the file's unit; the survivors of each frame are numbered from 0."""
    per, frames, tables = PER_METRE[recovery.unit], recovery.frames, _other_arrays(recovery)
    columns = {
        name: nullable(values * per**power if (power := COLUMNS[name].power) else values)
        for name, values in (_columns(recovery) | tables).items()
    }
    of_survivors, of_frames, of_answer = (
        {name.rpartition(".")[2]: one for name, one in columns.items() if name.rpartition(".")[0] == table}
        for table in ("", "frames", "answer")
    )
    checks = list(recovery.survivors.margins)
    margins = list(zip(*map(nullable, recovery.survivors.margins.values()), strict=True))
    for k in range(len(recovery)):
        rows = recovery.rows(k)
        held = zip(*(values[rows] for values in of_survivors.values()), strict=True)
        postures = [dict(zip(of_survivors, row, strict=True)) for row in held]
        for posture, one in zip(postures, margins[rows], strict=False):
            posture["margins"] = dict(zip(checks, one, strict=True))
        answer = {name: values[k] for name, values in of_answer.items()}
        answer |= {name: plain(getattr(recovery.answer, name)[k]) for name in ANSWER_LISTS}
        answer["survivor"] = answer["survivor"] - rows.start if answer["survivor"] >= 0 else None
        answer["representatives"] = [row - rows.start for row in answer["representatives"]]
        yield {
            **{name: values[k] for name, values in of_frames.items()},
            **({"picture": frames.pictures[k]} if frames.pictures else {}),
            **{name: plain(getattr(frames, name)[k]) for name in FRAME_FILL},
            "camera": plain(_scaled(frames.camera[k], CAMERA_LENGTHS, per)),
            "root": plain(_scaled(frames.root[k], ROOT_LENGTHS, per)),
            "answer": answer,
            "postures": postures,
        }


def _scaled(fields: Mapping[str, Any] | None, lengths: tuple[str, ...], per: float) -> dict[str, Any] | None:
    """Multiply the lengths among a frame's fields; a residual is a length if the camera has an f, else pixels."""
    if fields is None:
        return None
    found = dict(fields)
    for name in (*lengths, *(("residual",) if fields.get("f") is not None else ())):
        if found.get(name) is not None:
            found[name] = np.asarray(found[name], dtype=np.float64) * per
    if found.get("scale") is not None:
        found["scale"] = np.asarray(found["scale"], dtype=np.float64) / per
    return found


def _paths_fields(recovery: Recovery) -> list[dict[str, Any]]:
    starts = np.array([recovery.rows(k).start for k in range(len(recovery))])
    path, per = recovery.path, PER_METRE[recovery.unit]
    assert path is not None  # only called where there are paths
    local = np.where(path.survivor >= 0, path.survivor - starts, -1)
    columns = path.probability.tolist(), local.tolist(), nullable(path.joints * per)
    return [
        dict(zip(("probability", "survivor", "joints"), row, strict=True))
        for row in zip(*columns, strict=True)
    ]


def _of_json(root: Node) -> Recovery:
    """Make a recovery of a JSON document."""
    document, per = root.value, PER_METRE[root.at("unit").text(PER_METRE)]
    frames, nq = document["frames"], len(document["configuration_names"])
    held = [frame["postures"] for frame in frames]
    postures = [posture for each in held for posture in each]
    answers, paths = [frame.get("answer") or {} for frame in frames], document.get("paths") or []
    starts = np.cumsum([0, *map(len, held)])
    columns: dict[str, Any] = {"frame": np.repeat(np.arange(len(frames)), np.diff(starts))}
    for name, (shape, empty, power) in COLUMNS.items():
        table, _, field = name.rpartition(".")
        holders = {"": postures, "frames": frames, "answer": answers, "path": paths}[table]
        if empty == "":
            columns[name] = np.array([str(one.get(field, empty)) for one in holders])
        elif table in ("frames", "answer") or name in NEEDED or any(field in one for one in holders):
            extents = [extent or (nq if name == "q" else len(frames)) for extent in shape]
            columns[name] = _stacked(holders, field, *extents) / per**power
    margins = [posture.get("margins") or {} for posture in postures]
    for check in dict.fromkeys(check for one in margins for check in one):
        columns[f"margin.{check}"] = _stacked(margins, check)
    columns["answer.survivor"] = columns["answer.survivor"] + starts[:-1]
    if paths:
        local = columns["path.survivor"]
        columns["path.survivor"] = np.where(local >= 0, local + starts[:-1], -1)
    about = {name: document.get(name) for name in ABOUT}
    about["lengths"] = {name: value / per for name, value in (about["lengths"] or {}).items()}
    about["frames"] = {name: [frame.get(name) for frame in frames] for name in FRAME_LISTS}
    about["frames"] |= {
        "pictures": [frame.get("picture", "") for frame in frames],
        "camera": [_scaled(frame.get("camera") or {}, CAMERA_LENGTHS, 1 / per) for frame in frames],
        "root": [_scaled(frame.get("root"), ROOT_LENGTHS, 1 / per) for frame in frames],
    }
    about["answer"] = {
        "sure_of": [one.get("sure_of", "") for one in answers],
        "represented": [one.get("represented") or [] for one in answers],
        "representatives": [
            np.array(one.get("representatives") or [], dtype=np.intp) + start
            for one, start in zip(answers, starts[:-1], strict=True)
        ],
    }
    return _of_columns(columns, about, root.source)


def _stacked(holders: Sequence[Mapping[str, Any]], name: str, *shape: int) -> Array:
    """Gather one field of many objects into an array (N, *shape); NaN where it is null or absent."""
    nothing = np.full(shape, np.nan).tolist() if shape else np.nan
    values = [nothing if (value := one.get(name)) is None else value for one in holders]
    return np.array(values, dtype=np.float64).reshape(len(holders), *shape)


def _about(recovery: Recovery) -> dict[str, Any]:
    """Return everything that is not an array."""
    return {
        "schema": RESULT_SCHEMA,
        **plain({name: getattr(recovery, name) for name in ABOUT}),
        "frames": plain({name: getattr(recovery.frames, name) for name in FRAME_LISTS}),
        "answer": plain({name: getattr(recovery.answer, name) for name in ANSWER_LISTS}),
    }


def _arrays(recovery: Recovery) -> dict[str, NDArray[Any]]:
    """Return all arrays by name, metres."""
    return {
        "frame": recovery.survivors.frame,
        **_columns(recovery),
        **{f"margin.{check}": values for check, values in recovery.survivors.margins.items()},
        **_other_arrays(recovery),
    }


def _other_arrays(recovery: Recovery) -> dict[str, NDArray[Any]]:
    """Return the arrays of frames, answer and paths, metres."""
    fields = (name.partition(".") for name in COLUMNS if "." in name)
    return {
        f"{table}.{field}": np.asarray(getattr(getattr(recovery, table), field))
        for table, _, field in fields
        if getattr(recovery, table) is not None
    }


def _flat(recovery: Recovery) -> dict[str, NDArray[Any]]:
    """Return the survivors as flat columns, named as `Recovery.to_pandas` names them."""
    frame = recovery.survivors.frame
    found = {"frame": frame, "time": np.asarray(recovery.frames.time)[frame]}
    for name, values in _columns(recovery).items():
        flat = values.reshape(len(frame), int(np.prod(values.shape[1:])))
        found |= dict(zip(_flat_names(name, flat.shape[1]), flat.T, strict=True))
    return found | {f"margin_{check}": values for check, values in recovery.survivors.margins.items()}


def _flat_names(name: str, width: int) -> list[str]:
    """Name the flat columns of one column of the survivors."""
    if name == "q":
        return [f"q_{k}" for k in range(width)]
    if name in ("joints", "head"):
        points = JOINTS if name == "joints" else HEAD_POINTS
        return [f"{point}_{axis}" for point in points for axis in "xyz"]
    return [f"{joint}_{name}" for joint in JOINTS] if COLUMNS[name].shape else [name]


def _table_columns(table: Table) -> dict[str, Any]:
    """Gather the survivors' columns of a flat table."""
    names = set(table.names)
    frame = table.column("frame").astype(np.intp)
    found: dict[str, Any] = {"frame": frame}
    width = sum(name.removeprefix("q_").isdecimal() for name in names if name.startswith("q_"))
    for name in OF_SURVIVORS:
        flat = _flat_names(name, width)
        if name == "branch" and name in names:
            found[name] = np.array(table.texts(name))
        elif set(flat) <= names:
            values = np.array([table.column(one) for one in flat]).T
            found[name] = values.reshape(len(frame), *(extent or width for extent in COLUMNS[name].shape))
    margins = [name for name in table.names if name.startswith("margin_")]
    return found | {f"margin.{name.removeprefix('margin_')}": table.column(name) for name in margins}


def _of_columns(columns: Mapping[str, Any], about: Any, path: str | Path) -> Recovery:
    """Make a recovery from arrays by name and from all other fields, a mapping or one JSON text."""
    if isinstance(about, str):
        about = json_file.parse(about.encode(), f"{path}: about")
    root, held = Node(about, path), {**dict(about.get("arrays") or {}), **columns}
    arrays = Node(held, path)
    frame = arrays.at("frame").array(None).astype(np.intp)
    rows, count = len(frame), len(_values(arrays, "frames.time", None, None))
    if rows and (frame.min() < 0 or frame.max() >= count or (np.diff(frame) < 0).any()):
        raise arrays.at("frame").refused(f"ascending frames below {count}", "write the result again")
    tables: dict[str, dict[str, Any]] = {"": {"frame": frame}, "frames": {}, "answer": {}, "path": {}}
    length = {"": rows, "frames": count, "answer": count, "path": None}
    for name in COLUMNS:
        table, _, field = name.rpartition(".")
        if name in held or table in ("frames", "answer") or name in NEEDED:
            frames = None if name == "q" else count
            tables[table][field] = _values(arrays, name, length[table], frames)
    if (tables["answer"]["survivor"] >= rows).any():
        raise arrays.at("answer.survivor").refused(f"rows of {rows} postures", "write the result again")
    margins = {
        name.removeprefix("margin."): arrays.at(name).array(rows, unknown=True)
        for name in held
        if name.startswith("margin.")
    }
    of_frames, of_answer = root.at("frames").object(), root.at("answer").object()
    lists: dict[str, Any] = {
        name: [empty if one is None else one for one in of_frames.get(name) or [empty] * count]
        for name, empty in FRAME_FILL.items()
    }
    pictures = [str(name) for name in of_frames.get("pictures") or ()]
    if root.at("joint_names").texts() != JOINTS:
        raise root.at("joint_names").refused("the 14 joints in tree order", "write the result again")
    mappings: dict[str, Any] = {name: about.get(name) or {} for name in MAPPINGS}
    return Recovery(
        survivors=Survivors(**tables[""], margins=margins),
        frames=Frames(**tables["frames"], pictures=pictures if any(pictures) else (), **lists),
        answer=Answer(
            **tables["answer"],
            sure_of=of_answer.get("sure_of") or (),
            representatives=[np.array(one, np.intp) for one in of_answer.get("representatives") or ()],
            represented=[np.array(one, np.float64) for one in of_answer.get("represented") or ()],
        ),
        path=Paths(**tables["path"]) if tables["path"] else None,
        **mappings,
        configuration_names=root.at("configuration_names").texts(),
        unit=root.at("unit").text(PER_METRE),
        source=str(about.get("source") or ""),
    )


def _values(arrays: Node, name: str, rows: int | None, frames: int | None) -> NDArray[Any]:
    """Return the array of a column; numbers that are not known have the value that says nothing."""
    node, (shape, empty, _) = arrays.at(name), COLUMNS[name]
    if empty == "":
        return np.asarray(node.value)
    if isinstance(node.value, np.ndarray) and node.value.dtype.kind == "b":
        node = Node(node.value.astype(np.float64), node.source, node.place)
    values = node.array(rows, *(extent or frames for extent in shape), unknown=True)
    return np.where(np.isnan(values), empty, values).astype(type(empty))
