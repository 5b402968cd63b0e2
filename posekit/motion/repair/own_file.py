"""Write a repaired motion into the user's table or arrays; only the numbers that the repair changed are replaced."""

from __future__ import annotations

import io
import pickle
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from posekit.files import read_bytes, text
from posekit.formats.c3d import with_points
from posekit.formats.layout import load_layout
from posekit.formats.npz_file import unpickled
from posekit.formats.open import parsed
from posekit.formats.tables import Table, numbers
from posekit.geometry import Array, turned_near
from posekit.motion.motion import Motion

#: Function of the numbers (T, C) of a file and the names of their columns; it returns repaired numbers (T', C).
Change = Callable[[Array, list[str]], Array]

#: Possible factors from an entry of the motion to a column of a file, and the largest difference between a column and
#: its entry: for frame numbers and seconds, metres, quaternions (in files their length is not exactly 1), radians.
COUNTS: Final = ((1.0,), 1e-6)
LENGTHS: Final = ((1.0, 100.0, 1000.0, 1 / 0.0254), 1e-4)
QUATERNIONS: Final = ((1.0, -1.0), 0.02)
ANGLES: Final = ((1.0, float(np.degrees(1.0))), 1e-3)
#: Number of frames in which columns and entries are compared.
SAMPLE: Final = 40
#: Change of an entry below which its column stays, metres or radians.
TINY: Final = 1e-10
#: Minimum number of significant digits of a changed number: with fewer, rounding could violate a bound.
DIGITS: Final = 7


def in_own_file(
    path: str | Path, before: Motion, after: Motion, rows: NDArray[np.intp]
) -> tuple[bytes, list[str]]:
    """Return the user's table or arrays with the numbers that a repair changed.

    Columns are recognised by their values: the values of a column, or the mean of two markers' columns, equal one
    coordinate or angle of the motion times a unit factor. The change of the entry is then added to the column. All
    other columns and all names are unchanged. Gaps in a column are filled, except gaps of a joint that is the mean of
    two markers.

    Parameters
    ----------
    path : path
        File from which `before` was read.
    before, after : Motion
        Motion before and after the repair, in the order of the file.
    rows : int array (T',)
        Index in `before` of each frame of `after`.

    Returns
    -------
    data : bytes
        Contents of the file; empty if its container cannot be changed in place.
    notes : list of str
        Sentences about unchanged arrays that may depend on the configurations.
    """
    groups = _groups(before, after)
    stale: list[str] = []

    def change(columns: Array, names: list[str]) -> Array:
        out, free = columns[rows], np.arange(columns.shape[1])
        angles = [names.index(name) for name in _euler(before).get("each", ()) if name in names]
        if angles:
            out[:, angles] += _turned(before, after, rows)
            free = np.delete(free, angles)
        for old, new, kind in groups:
            found, factor = _columns_of(columns[:, free], old, *kind)
            entries = [entry for _, entry in found]
            for place, entry in found:
                step = new[:, entry] - old[rows, entry]
                filled = np.isnan(step) & np.isfinite(new[:, entry]) & (entries.count(entry) == 1)
                out[filled, free[place]] = factor * new[filled, entry]
                moving = np.abs(step) > TINY
                out[moving, free[place]] += factor * step[moving]
            free = np.delete(free, [place for place, _ in found])
        if len(free) > len(names) / 2 and before.q is not None:
            stale.extend(dict.fromkeys(names))
        return out

    def change_array(name: str, value: Any) -> Any:
        numeric = isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.ndim
        first = (len(before),) if numeric and value.shape[0] == len(before) else (1, len(before))
        if not numeric or value.shape[: len(first)] != first:
            return value
        flat = value.reshape(len(before), -1).astype(np.float64)
        new = change(flat, [name] * flat.shape[1])
        return new.astype(value.dtype).reshape(*first[:-1], len(rows), *value.shape[len(first) :])

    written, data, (container, document) = b"", read_bytes(path), parsed(path)
    if isinstance(document, Table) and not document.about:
        written = _in_lines(text(data, str(path)), document, len(before), rows, change)
    elif container == "arrays":
        written = _in_arrays(data, str(path), change_array)
    elif container == "c3d" and len(rows) == len(before):
        written = with_points(data, document, change_array("", document.points))
    following = f"left as they were, although they may follow from q: {', '.join(stale)}"
    return written, [following] if stale else []


def _groups(before: Motion, after: Motion) -> list[tuple[Array, Array, Any]]:
    """Return groups of entries that share a unit: values before (T, K) and after (T', K), and possible unit factors."""
    counted = (_counted(before), _counted(after), COUNTS)
    if before.q is None:
        old, new = (np.asarray(one.joints).reshape(-1, 3 * len(one.joint_names)) for one in (before, after))
        return [counted, (old, new, LENGTHS)]
    old, new = np.asarray(before.q), np.asarray(after.q)
    root = 7 if not before.q_names or before.q_names[0] == "x" else 0
    parts = (slice(0, min(root, 3)), LENGTHS), (slice(3, root), QUATERNIONS), (slice(root, None), ANGLES)
    return [counted, *((old[:, own], new[:, own], kind) for own, kind in parts)]


def _counted(motion: Motion) -> Array:
    frame = np.arange(len(motion), dtype=np.float64)
    return np.stack([frame, frame + 1, np.asarray(motion.time)], axis=1)


def _columns_of(
    columns: Array, entries: Array, factors: tuple[float, ...], most: float
) -> tuple[list[tuple[int, int]], float]:
    """Return pairs (column, entry) with equal numbers, and the unit factor that yields the most pairs."""
    some = slice(None, None, max(1, len(columns) // SAMPLE))
    best: tuple[list[tuple[int, int]], float] = [], 1.0
    for factor in factors:
        values = columns[some] / factor
        off = _apart(values[..., None], entries[some, None])
        found: list[tuple[int, int]] = []
        for entry in range(entries.shape[1] if len(off) else 0):
            place = int(np.argmin(off[:, entry]))  # the first free column among equal columns
            if off[place, entry] < most:
                found.append((place, entry))
                off[place] = np.inf
        best = max(best, (found, factor), key=lambda one: len(one[0]))
    found, factor = best
    free = np.setdiff1d(np.arange(columns.shape[1]), [place for place, _ in found])
    if factors is LENGTHS[0] and found and free.size:  # joints between two markers
        values = columns[some][:, free] / factor
        for entry in set(range(entries.shape[1])) - {entry for _, entry in found}:
            off = _apart((values[:, :, None] + values[:, None]) / 2, entries[some, entry, None, None])
            one, other = np.unravel_index(int(np.argmin(off)), off.shape)
            if off[one, other] < most:
                found += [(int(free[one]), entry), (int(free[other]), entry)]
    return found, factor


def _apart(values: Array, wanted: Array) -> Array:
    """Return the largest difference over the frames in which `wanted` is known; infinite if there is no such frame."""
    known, off = np.isfinite(wanted), np.nan_to_num(np.abs(values - wanted), nan=np.inf)
    off = np.where(known, off, 0.0).max(axis=0, initial=0.0)
    return np.where(known.any(axis=0), off, np.inf)


def _euler(motion: Motion) -> dict[str, Any]:
    """Return how the layout describes the Euler angles of the root; empty if the file has no Euler angles."""
    if motion.q is None or not motion.layout:
        return {}
    turn: dict[str, Any] = load_layout(motion.layout).fields.get("rotation", {})
    return turn if "euler" in turn else {}


def _turned(before: Motion, after: Motion, rows: NDArray[np.intp]) -> Array:
    """Return the change (T', 3) of the root's Euler angles, in the unit of the file."""
    turn = _euler(before)
    degrees = turn.get("unit") == "deg"
    old, new = (
        Rotation.from_quat(np.asarray(one.q)[:, 3:7]).as_euler(turn["euler"].upper(), degrees)
        for one in (before, after)
    )
    step = turned_near(new - old[rows], 0.0, half_turn=180.0 if degrees else np.pi)
    return np.asarray(np.where(np.abs(step) > TINY, step, 0.0) * turn.get("signs", 1.0))


def _in_lines(whole: str, table: Table, count: int, rows: NDArray[np.intp], change: Change) -> bytes:
    """Return a text with changes in its last `count` lines of numbers; empty if frames and lines differ in number."""
    lines = whole.splitlines(keepends=True)
    at = [number - 1 for number in table.numbers_of_lines[-count:]]
    apart = table.delimiter or r"\s+"
    parted = [re.split(f"({apart})", lines[k].rstrip("\r\n")) for k in at]
    cells = [[k for k in range(0, len(one), 2) if table.delimiter or one[k]] for one in parted]
    width = max(map(len, cells))
    values = np.full((count, width), np.nan)
    for k, (parts, places) in enumerate(zip(parted, cells, strict=True)):
        values[k, : len(places)] = numbers([parts[place].strip() for place in places])
    if len(table.lines) < count or np.isnan(values).all(axis=1).any():
        return b""
    new = change(values, [*table.names, *[""] * (width - len(table.names))][:width])
    changed = (new != values[rows]) & np.isfinite(new)
    made = []
    for k, row in enumerate(rows.tolist()):
        parts = list(parted[row])
        for column in np.flatnonzero(changed[k]).tolist():
            old = parts[cells[row][column]]
            parts[cells[row][column]] = old.replace(old.strip(), _like(old.strip(), float(new[k, column])))
        end = lines[at[row]]
        made.append("".join(parts) + end[len(end.rstrip("\r\n")) :])
    return "".join([*lines[: at[0]], *made, *lines[at[-1] + 1 :]]).encode()


def _like(cell: str, value: float) -> str:
    """Return a number as text, in the format of a cell: decimals, decimal comma, exponent."""
    mantissa, exponent, _ = cell.lower().replace(",", ".").partition("e")
    decimals = len(mantissa.partition(".")[2])
    if not decimals and value.is_integer():
        return f"{value:.0f}"
    before_point = 1 if exponent else len(f"{abs(value):.0f}")
    written = f"{value:.{max(decimals, DIGITS - before_point)}{exponent or 'f'}}"
    return written.replace(".", ",") if "," in cell else written


def _in_arrays(data: bytes, source: str, change: Callable[[str, Any], Any]) -> bytes:
    """Return an NPZ, NPY or pickle file with changed arrays; other members of an NPZ keep their bytes."""
    file = io.BytesIO()
    if data[:6] == b"\x93NUMPY":
        np.save(file, change("", np.load(io.BytesIO(data), allow_pickle=False)))
        return file.getvalue()
    if data[:2] != b"PK":
        return pickle.dumps(_in_tree(unpickled(data, source), change))
    with zipfile.ZipFile(io.BytesIO(data)) as given, zipfile.ZipFile(file, "w") as made:
        for member in given.infolist():
            held = given.read(member)
            if member.filename.endswith("data.pkl"):  # tensors of PyTorch
                return b""
            try:
                array = np.load(io.BytesIO(held), allow_pickle=False)
            except ValueError:  # of objects, or no array
                array = None
            new = change(member.filename.removesuffix(".npy"), array)
            if new is not array:
                changed = io.BytesIO()
                np.save(changed, new)
                held = changed.getvalue()
            made.writestr(member, held)
    return file.getvalue()


def _in_tree(value: Any, change: Callable[[str, Any], Any], name: str = "") -> Any:
    """Return nested dicts and lists with changed arrays; `name` is the key of the value."""
    if isinstance(value, dict):
        return {key: _in_tree(one, change, str(key)) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_in_tree(one, change, name) for one in value]
    return change(name, value)
