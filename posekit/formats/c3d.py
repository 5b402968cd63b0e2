"""C3D: the binary format of motion capture systems (Motion Lab Systems, *The C3D File Format User Guide*, c3d.org).

A file consists of blocks of 512 bytes: a header with the numbers of points, analogue values and frames; parameters in
groups; then the frames. A frame has four numbers for each point (x, y, z, and a residual that is negative if the point
was not seen) and the analogue values. All numbers of a frame are 16-bit integers if the parameter ``POINT:SCALE`` is
positive, 32-bit floats if it is negative. Every count is compared with the length of the file before frames are read.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, refusal, shown
from posekit.files import write_bytes
from posekit.formats.body_checks import points_motion
from posekit.formats.options import Options
from posekit.formats.trc import even_step, one_recording
from posekit.geometry import UNIT_WORDS, UP_WORDS, Array

if TYPE_CHECKING:
    from posekit.motion import Motion

BLOCK: Final = 512
MAX_VALUES: Final = 100_000_000
MAX_PARAMETERS: Final = 10_000
#: Largest number that a word of the header holds.
MAX_COUNT: Final = 65_535
#: Size in bytes of a parameter's value by type: text, byte, 16-bit integer, 32-bit float.
_SIZES: Final = {-1: 1, 1: 1, 2: 2, 4: 4}
_SCREEN_X: Final = {"x": "+Y", "y": "+Z", "z": "+X"}
_REMEDY: Final = "the file is cut off or damaged: export it again"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class C3d:
    """Content of a C3D file.

    Attributes
    ----------
    points : array (T, P, 3)
        Positions in the file's unit; NaN for points that were not seen.
    rate : float
        Frames per second; NaN if the file states no rate.
    parameters : dict
        Lists of text and arrays of numbers by ``GROUP:NAME``.
    kind : str
        NumPy's name of the number type of frames; empty for DEC floats.
    scale : float
        Length of one integer step in the file's unit; 1 for floats.
    start, width : int
        Offset of the first frame in bytes, and count of numbers per frame: four for each point, then analogue values.
    """

    points: Array
    rate: float
    parameters: dict[str, Any]
    kind: str
    scale: float
    start: int
    width: int

    def texts(self, name: str) -> list[str]:
        """Return the texts of a parameter of the group POINT; empty without such a parameter."""
        found = self.parameters.get(f"POINT:{name}", [])
        return found if isinstance(found, list) else []


def parse(data: bytes, source: str) -> C3d:
    """Decode a C3D file.

    Raises
    ------
    InputError
        If the data are not a C3D file, contain no points, are cut off, or state more frames than they contain.
    """

    def damaged(field: str, got: str, expected: str) -> InputError:
        return refusal(source, field, got, expected, _REMEDY)

    if len(data) < 2 * BLOCK or data[1] != 0x50 or data[0] < 2:
        raise damaged("", f"{len(data):,} bytes, first {data[:2].hex()}", "C3D, whose second byte is 50")
    section = (data[0] - 1) * BLOCK
    if section + 4 > len(data) or data[section + 3] not in (84, 85, 86):
        raise damaged("header", f"block {data[0]} of {len(data) // BLOCK}", "a section of parameters")
    processor = data[section + 3]
    order = ">" if processor == 86 else "<"
    count, analogues, first, last, _ = struct.unpack_from(f"{order}5H", data, 2)
    scale, rate = (float(_floats(data[place : place + 4], processor)[0]) for place in (12, 20))
    start = (struct.unpack_from(f"{order}H", data, 16)[0] - 1) * BLOCK
    if count == 0:
        raise damaged("POINT:USED", "no points", "points in space")
    if not section < start <= len(data):
        raise damaged("header", f"frames from byte {start:,}", "frames after the parameters")
    parameters = _parameters(data[:start], section + 4, processor, damaged)
    scale = next(iter(_numbers(parameters, "POINT:SCALE")), scale)
    if not math.isfinite(scale) or scale == 0:
        raise damaged("POINT:SCALE", f"{scale:g}", "a finite number that is not 0")
    width = (4 * count + analogues) * (4 if scale < 0 else 2)
    frames = _frames(parameters, first, last, len(data) - start, width, damaged)
    if frames * width > 4 * MAX_VALUES or len(data) - start < frames * width:
        got = f"{len(data) - start:,} bytes of frames"
        raise damaged("", got, f"{frames * width:,} for {frames:,} frames of {count:,} points")
    body = data[start : start + frames * width]
    values: NDArray[Any] = _floats(body, processor) if scale < 0 else np.frombuffer(body, f"{order}i2")
    values = values.reshape(frames, -1)
    placed = values[:, : 4 * count].reshape(frames, count, 4)
    with np.errstate(invalid="ignore"):  # a NaN of the file is a missing point
        points = placed[..., :3].astype(np.float64)
        points[~(placed[..., 3] >= 0)] = np.nan
    rates = (*_numbers(parameters, "POINT:RATE")[:1], rate)
    rate = next((one for one in rates if math.isfinite(one) and one > 0), math.nan)
    kind = f"{order}i2" if scale > 0 else "" if processor == 85 else f"{order}f4"
    scale = max(scale, 0.0) or 1.0
    shape: dict[str, Any] = {"kind": kind, "scale": scale, "start": start, "width": values.shape[1]}
    return C3d(points=points * scale, rate=rate, parameters=parameters, **shape)


def _floats(data: bytes, processor: int) -> NDArray[np.float32]:
    """Decode 32-bit floats; for DEC floats (processor 85), swap the 16-bit halves and divide the value by 4."""
    if processor != 85:
        return np.frombuffer(data, ">f4" if processor == 86 else "<f4").astype(np.float32)
    words = np.frombuffer(data, "<u2").astype(np.uint32).reshape(-1, 2)
    return (words[:, 0] << 16 | words[:, 1]).view(np.float32) / np.float32(4)


def _numbers(parameters: dict[str, Any], name: str) -> list[float]:
    """Return the numbers of a parameter; an empty list if it is absent or a text."""
    found = parameters.get(name)
    return found.tolist() if isinstance(found, np.ndarray) else []


def _frames(parameters: dict[str, Any], first: int, last: int, held: int, width: int, damaged: Any) -> int:
    """Return the number of frames: from the header or, above 65,535, the largest number that a parameter states."""
    count = last - first + 1
    if count < 1:
        raise damaged("header", f"frames {first} to {last}", "the last not before the first")
    names = ("POINT:FRAMES", "POINT:LONG_FRAMES")
    stated = [int(one) for name in names for one in _numbers(parameters, name)[:1] if 0 <= one < 2**31]
    words = [_numbers(parameters, f"TRIAL:ACTUAL_{name}_FIELD")[:2] for name in ("START", "END")]
    if min(map(len, words)) == 2:
        begin, end = (int(low + 65536 * high) for low, high in words)
        stated.append(end - begin + 1)
    longest = max(stated, default=0)
    if longest > MAX_COUNT:
        return longest
    if last == MAX_COUNT and held - width * count >= width + BLOCK:
        raise damaged("POINT:FRAMES", f"{last:,} frames or more", "the number in POINT:LONG_FRAMES")
    return count


def _parameters(data: bytes, place: int, processor: int, damaged: Any) -> dict[str, Any]:
    """Return parameters by group and name, such as ``POINT:FRAMES``: lists of text, or arrays of numbers.

    The parameters start at byte `place` of the data.
    """
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Any]] = []

    def taken(count: int) -> bytes:
        nonlocal place
        if not 0 <= count <= len(data) - place:
            raise damaged(
                f"parameters, byte {place}", f"a length of {count} bytes", f"0 to {len(data) - place}"
            )
        place += count
        return data[place - count : place]

    while place + 2 <= len(data) and data[place] != 0:
        if len(groups) + len(found) > MAX_PARAMETERS:
            raise damaged("parameters", f"more than {MAX_PARAMETERS:,}", "fewer")
        length, group = struct.unpack("bb", taken(2))
        name = taken(abs(length)).decode("latin-1").strip().upper()
        (offset,) = struct.unpack(">H" if processor == 86 else "<H", taken(2))
        start = place
        if group < 0:
            groups[-group] = name
        else:
            kind, ranks = struct.unpack("bB", taken(2))
            dimensions = tuple(taken(ranks))
            if kind not in _SIZES:
                raise damaged(f"parameters, byte {start}", f"type {kind}", "one of -1, 1, 2, 4")
            value = _value(kind, dimensions, taken(math.prod(dimensions) * _SIZES[kind]), processor)
            found.append((group, name, value))
        if not offset:
            break
        taken(start + offset - 2 - place)  # usually 0 bytes
    for group, name, _ in found:
        if group not in groups:
            raise damaged("parameters", f"{shown(name)} in no group", "a group of each parameter")
    return {f"{groups[group]}:{name}": value for group, name, value in found}


def _value(kind: int, dimensions: tuple[int, ...], data: bytes, processor: int) -> Any:
    if kind == -1:
        length = max(dimensions[0] if dimensions else 1, 1)
        text = data.decode("latin-1")
        return [text[start : start + length].strip(" \0") for start in range(0, len(text), length)]
    if kind == 4:
        return _floats(data, processor).astype(np.float64)
    return np.frombuffer(data, f"{'>' if processor == 86 else '<'}u{kind}").astype(np.float64)


def read(document: C3d, path: str, options: Options) -> Motion:
    """Convert the points of a C3D file to a motion; analogue channels are ignored, and time starts at 0."""
    count = document.points.shape[1]
    labels = ("LABELS", *(f"LABELS{k}" for k in range(2, 258)))
    names = [name for label in labels for name in document.texts(label)]
    names = [name or f"unnamed_{k}" for k, name in enumerate([*names, *[""] * count][:count], 1)]
    if len(set(names)) != len(names):
        names = [name if names.index(name) == k else f"{name}_{k}" for k, name in enumerate(names)]
    word = next(iter(document.texts("UNITS")), "")
    unit = UNIT_WORDS.get(word.casefold(), "")
    if word and not unit:
        options.note(f"POINT:UNITS {shown(word)} is not known")
    return points_motion(
        document.points,
        names,
        path,
        options,
        rate=document.rate,
        unit=unit,
        up=UP_WORDS.get(next(iter(document.texts("Y_SCREEN")), "").casefold(), ""),
        partial=True,
    )


def with_points(data: bytes, document: C3d, points: Array) -> bytes:
    """Return the bytes of a file with new points (T, P, 3), in the file's unit; all other bytes stay the same.

    If a new point is NaN, the file's point is kept. The result is empty for files with DEC floats.
    """
    if not document.kind:
        return b""
    frames, count = points.shape[:2]
    values = np.frombuffer(data, document.kind, frames * document.width, document.start).copy()
    placed = values.reshape(frames, -1)[:, : 4 * count].reshape(frames, count, 4)
    moved = np.isfinite(points).all(axis=-1) & (points != document.points).any(axis=-1)
    numbers = points[moved] / document.scale
    whole = document.kind.endswith("i2")  # the check of the repaired file finds clipped numbers
    placed[moved, :3] = np.clip(np.round(numbers), -32768, 32767) if whole else numbers
    placed[moved, 3] = np.maximum(placed[moved, 3], 0)  # a point that was not seen is known now
    values.reshape(frames, -1)[:, : 4 * count] = placed.reshape(frames, -1)
    return data[: document.start] + values.tobytes() + data[document.start + values.nbytes :]


def write(path: str | Path, motion: Motion) -> None:
    """Write the points of one recording as C3D: 32-bit floats in metres, with unchanged axes.

    The up axis is stored in ``POINT:Y_SCREEN``. A missing point has the residual -1. Times are stored as a rate.

    Raises
    ------
    InputError
        If the motion has no points, several recordings, uneven times, or too many frames.
    """
    points, names, rate = one_recording(motion, "C3D"), motion.joint_names, 1 / even_step(motion, "C3D")
    if len(motion) > MAX_COUNT - 1 or 4 * points.shape[1] * len(motion) > MAX_VALUES:
        raise refusal(motion.source, "", f"{len(motion):,} frames", f"up to {MAX_COUNT - 1:,}", "cut it")
    group: dict[str, tuple[int, Any]] = {
        "USED": (2, [len(names)]),
        "SCALE": (4, [-1.0]),
        "DATA_START": (2, [0]),
        "RATE": (4, [rate]),
        "FRAMES": (2, [len(motion)]),
        "LABELS": (-1, list(names)),
        "DESCRIPTIONS": (-1, [""] * len(names)),
        "UNITS": (-1, ["m"]),
    }
    if motion.up:
        group |= {"X_SCREEN": (-1, [_SCREEN_X[motion.up[1]]]), "Y_SCREEN": (-1, [motion.up.upper()])}
    analogue: dict[str, tuple[int, Any]] = {"USED": (2, [0]), "SCALE": (4, []), "RATE": (4, [0.0])}
    groups = {"POINT": group, "ANALOG": analogue}
    blocks = -(-len(_section(groups)) // BLOCK)
    group["DATA_START"] = (2, [2 + blocks])
    section = bytearray(_section(groups).ljust(blocks * BLOCK, b"\0"))
    section[:4] = bytes((1, 0x50, blocks, 84))
    header = struct.pack("<BBHHHHHfHHf", 2, 0x50, len(names), 0, 1, len(motion), 0, -1.0, 2 + blocks, 0, rate)
    frames = np.zeros((len(motion), len(names), 4), dtype="<f4")
    missing = np.asarray(np.isnan(points).any(axis=-1))
    frames[..., :3] = np.where(missing[..., None], 0.0, points)
    frames[..., 3] = np.where(missing, -1.0, 0.0)
    write_bytes(path, header.ljust(BLOCK, b"\0") + bytes(section) + frames.tobytes())


def _section(groups: dict[str, dict[str, tuple[int, Any]]]) -> bytes:
    """Return the bytes of the parameters, given by group and name as (type, values)."""
    made = b"\0\0\0\0"
    for number, (group, parameters) in enumerate(groups.items(), 1):
        made += struct.pack("bb", len(group), -number) + group.encode() + struct.pack("<HB", 3, 0)
        for name, (kind, values) in parameters.items():
            if kind == -1:
                width = max((len(one) for one in values), default=0) or 1
                body = b"".join(one.encode("ascii", "replace").ljust(width) for one in values)
                dimensions = bytes((width, len(values)))
            else:
                body = np.array(values, dtype={2: "<u2", 4: "<f4"}[kind]).tobytes()
                dimensions = bytes((len(values),)) if len(values) != 1 else b""
            body = struct.pack("bB", kind, len(dimensions)) + dimensions + body + b"\0"
            made += struct.pack("bb", len(name), number) + name.encode()
            made += struct.pack("<H", 2 + len(body)) + body
    return made + b"\0\0"
