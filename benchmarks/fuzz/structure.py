"""Damage to what a file says, while its grammar stays whole: keys dropped, doubled, retyped, nested, renamed."""

from __future__ import annotations

import copy
import io
import json
import random
from collections.abc import Callable
from typing import Any, Final
from xml.etree import ElementTree

import pyarrow as arrow
from pyarrow import parquet

ODD_WORTHS: Final[tuple[object, ...]] = (
    *(None, True, "", "x", "nan", "1e999", "../..", [], {}, [[]], [None], {"": 0}, -1, 0, -0.0),
    *(2**63, 10**400, 1e308, -1e308, 1e200, 1e-320, float("nan"), float("inf"), [1] * 3000, "\x1b]0;x\x07"),
)
ODD_TEXTS: Final = (
    "",
    "nan",
    "inf",
    "-1",
    "0",
    "1e308",
    "1e999",
    "9" * 400,
    "0 0 0",
    "0 0",
    "world",
    "a b",
    "../..",
    "\u202e",
)


def rearranged(data: bytes, rng: random.Random) -> bytes | None:
    """Return a JSON, XML or Parquet file changed in one to three places of what it says; None of other files."""
    start = data.lstrip()[:1]
    change: Callable[[bytes, random.Random], bytes]
    if data[:4] == b"PAR1":
        change = _table_changed
    elif start in (b"{", b"["):
        change = _document_changed
    elif start == b"<":
        change = _elements_changed
    else:
        return None
    try:
        return change(data, rng)
    except (ValueError, ElementTree.ParseError, arrow.ArrowException):
        return None


def _document_changed(data: bytes, rng: random.Random) -> bytes:
    document = json.loads(data)
    for _ in range(rng.randint(1, 3)):
        holder = document
        while True:
            keys: list[Any] = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
            if not keys:
                break
            key = rng.choice(keys)
            if isinstance(holder[key], dict | list) and holder[key] and rng.random() < 0.8:
                holder = holder[key]
                continue
            _entry_changed(holder, key, rng)
            break
    return json.dumps(document).encode()


def _entry_changed(holder: Any, key: Any, rng: random.Random) -> None:
    kind = rng.choice(("drop", "retype", "retype", "nest", "double", "rename"))
    if kind == "drop":
        del holder[key]
    elif kind == "retype":
        holder[key] = copy.deepcopy(rng.choice(ODD_WORTHS))
    elif kind == "nest":
        holder[key] = {"": holder[key]} if rng.random() < 0.5 else [holder[key]]
    elif isinstance(holder, list):
        holder.insert(rng.randint(0, len(holder)), holder[key])
    elif kind == "double":
        holder[f"{key}2"] = holder[key]
    else:
        holder[rng.choice((f"{key}x", "", key.upper(), "a" * 300))] = holder.pop(key)


def _elements_changed(data: bytes, rng: random.Random) -> bytes:
    root = ElementTree.fromstring(data)
    for _ in range(rng.randint(1, 3)):
        parent = rng.choice([element for element in root.iter() if len(element)] or [root])
        child = rng.choice(list(parent) or [root])
        kind = rng.choice(("drop", "double", "move", "nest", "text", "attribute", "attribute", "lose"))
        if kind == "drop" and child is not root:
            parent.remove(child)
        elif kind in ("double", "move"):
            others = list(root.iter())
            goal = parent if kind == "double" else rng.choice(others)
            goal.append(ElementTree.fromstring(ElementTree.tostring(child)))
        elif kind == "nest":
            child.append(ElementTree.Element(child.tag, child.attrib))
        elif kind == "text":
            child.text = rng.choice(ODD_TEXTS)
        elif child.attrib:
            name = rng.choice(sorted(child.attrib))
            if kind == "lose":
                del child.attrib[name]
            else:
                child.attrib[name] = rng.choice(ODD_TEXTS)
    return ElementTree.tostring(root)


def _table_changed(data: bytes, rng: random.Random) -> bytes:
    table = parquet.read_table(io.BytesIO(data))
    for _ in range(rng.randint(1, 2)):
        place = rng.randrange(table.num_columns) if table.num_columns else 0
        kind = rng.choice(("drop", "rename", "retype", "odd", "odd", "cut", "note"))
        if kind == "cut" or not table.num_columns:
            table = table.slice(rng.randint(0, len(table)), rng.randint(0, len(table)))
        elif kind == "drop":
            table = table.remove_column(place)
        elif kind == "rename":
            names = list(table.column_names)
            names[place] = rng.choice(("", names[0], "x", f"{names[place]}x"))
            table = table.rename_columns(names)
        elif kind == "note":
            notes = {
                key: value if rng.random() < 0.5 else b"{}"
                for key, value in (table.schema.metadata or {}).items()
            }
            table = table.replace_schema_metadata(notes)
        else:
            values = table.column(place).to_pylist()
            if kind == "odd" and values:
                values[rng.randrange(len(values))] = rng.choice(
                    (None, float("nan"), float("inf"), 1e308, -1e308, 1e200)
                )
            else:
                values = [str(value) for value in values]
            table = table.set_column(place, table.column_names[place], arrow.array(values))
    out = io.BytesIO()
    parquet.write_table(table, out)
    return out.getvalue()
