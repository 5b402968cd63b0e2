"""What is in a C3D file: its parameters and the frames of its points, by NumPy alone.

The layout is that of Motion Lab Systems' *C3D File Format User Guide* (c3d.org): blocks of 512 bytes; a header whose
words count points, analogue values and frames; parameters; then the frames, each with four numbers a point (x, y, z and
a word of residual and cameras, negative where the point was not seen) and the analogue values, as 16-bit integers
where the scale is positive and as 32-bit floats where it is negative. Here every count is compared with the file's
length before anything is read: native readers of C3D trust them and crash, or leave frames out.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.motion.c3d_parameters import DAMAGED_REMEDY, Parameter, ParameterSection, Processor
from posekit.geometry import Array
from posekit.safe_io import refusal

_BLOCK: Final = 512
_MANY: Final = 65535
"""The most frames that a header can count."""
MAX_VALUES: Final = 100_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class C3dContent:
    """Points and parameters.

    Parameters
    ----------
    points : array (T, P, 3)
        In the file's unit; NaN where a point was not seen.
    rate : float
        Frames a second as the header says.
    parameters : mapping
        By group and name, ``POINT:LABELS``.
    """

    points: Array
    rate: float
    parameters: Mapping[str, Parameter]


def decode_c3d(path: str | Path, data: bytes) -> C3dContent:
    """Decode a C3D file.

    Raises
    ------
    InputError
        Where it is no C3D file, holds no points, is cut off, or says more than it holds.
    """
    if len(data) < 2 * _BLOCK or data[1] != 0x50 or data[0] < 2:
        got = f"{len(data):,} bytes that begin with {data[:2].hex()}"
        raise refusal(path, "", got, "a C3D file, whose second byte is 50", "check the format")
    section = (data[0] - 1) * _BLOCK
    if section + 4 > len(data) or data[section + 3] not in (84, 85, 86):
        got = f"parameters in block {data[0]} of {len(data) // _BLOCK}"
        raise refusal(path, "header", got, "a section of parameters of a known processor", DAMAGED_REMEDY)
    processor = Processor(code=data[section + 3])
    points, analogues, first, last, _ = struct.unpack_from(f"{processor.order}5H", data, 2)
    scale, rate = (float(processor.floats(data[place : place + 4])[0]) for place in (12, 20))
    start = (struct.unpack_from(f"{processor.order}H", data, 16)[0] - 1) * _BLOCK
    if points == 0:
        raise refusal(
            path, "POINT:USED", "no points", "points in space", "analogue channels alone are no motion"
        )
    if not section < start <= len(data):
        raise refusal(
            path, "header", f"frames from byte {start:,}", "frames after the parameters", DAMAGED_REMEDY
        )
    parameters = ParameterSection(path, data, section, start, processor).read()
    told = parameters.get("POINT:SCALE")
    if told is not None and told.kind == 4 and len(told.numbers):
        scale = float(told.numbers[0])
    if not np.isfinite(scale) or scale == 0:
        raise refusal(path, "POINT:SCALE", f"{scale:g}", "a finite number that is not 0", DAMAGED_REMEDY)
    width = (4 * points + analogues) * (4 if scale < 0 else 2)
    frames = _frames(path, parameters, first, last, len(data) - start, width)
    if frames * width > 4 * MAX_VALUES:
        got = f"{frames:,} frames of {points:,} points"
        raise refusal(path, "header", got, f"at most {MAX_VALUES:,} numbers", "split it by frames")
    if len(data) - start < frames * width:
        got = f"{len(data) - start:,} bytes of frames"
        expected = f"{frames * width:,} for {frames:,} frames of {points:,} points"
        raise refusal(path, "", got, expected, DAMAGED_REMEDY)
    body = data[start : start + frames * width]
    values: NDArray[Any] = processor.floats(body) if scale < 0 else processor.integers(body, 2)
    values = values.reshape(frames, -1)[:, : 4 * points].reshape(frames, points, 4)
    with np.errstate(invalid="ignore"):  # what is no number is missing, or refused by its name
        found = values[..., :3].astype(np.float64)
        found[~(values[..., 3] >= 0)] = np.nan
    if scale > 0:
        found *= scale
    return C3dContent(points=found, rate=rate, parameters=parameters)


def _frames(
    path: str | Path, parameters: Mapping[str, Parameter], first: int, last: int, held: int, width: int
) -> int:
    """Return the number of frames: a header counts to 65,535, and what is longer says so in one of three other ways."""
    count = last - first + 1
    if count < 1:
        raise refusal(
            path, "header", f"frames {first} to {last}", "the last not before the first", DAMAGED_REMEDY
        )
    told = [
        int(parameters[name].numbers[0])
        for name in ("POINT:FRAMES", "POINT:LONG_FRAMES")
        if name in parameters and len(parameters[name].numbers) and 0 <= parameters[name].numbers[0] < 2**31
    ]
    ends = [parameters.get(f"TRIAL:ACTUAL_{name}_FIELD") for name in ("START", "END")]
    words = [end.numbers for end in ends if end is not None and end.kind == 2 and len(end.numbers) >= 2]
    if len(words) == 2:
        begin, end = (int(low + 65536 * high) for low, high in (word[:2] for word in words))
        told.append(end - begin + 1)
    longest = max(told, default=0)
    if longest > _MANY:
        return longest
    if last == _MANY and held - width * count >= width + _BLOCK:
        got = f"frames up to {last:,}, and {held:,} bytes of them"
        expected = f"{width * count:,} bytes, or the number in POINT:LONG_FRAMES"
        raise refusal(path, "POINT:FRAMES", got, expected, "split the trial where it was exported")
    return count
