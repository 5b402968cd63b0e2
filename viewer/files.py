"""Encode pictures as PNG, GIF and MP4."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from fractions import Fraction
from importlib import import_module
from itertools import chain
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError

Pixels = NDArray[np.uint8]

#: Largest number of pictures per second. Faster recordings are subsampled and keep their speed.
FASTEST: Final = {".gif": 20.0, ".mp4": 60.0}

#: Pictures per second of an animation with unknown rate.
USUAL_RATE: Final = 10.0


def stride(suffix: str, rate: float | None) -> int:
    """Return N so that an animation shows every Nth frame of a recording."""
    return max(1, int(np.ceil((rate or USUAL_RATE) / FASTEST[suffix] - 1e-6))) if suffix in FASTEST else 1


def encoded(frames: Iterable[Pixels], suffix: str, rate: float | None) -> bytes:
    """Return the first picture as PNG, or all pictures as an animation.

    Parameters
    ----------
    frames : iterable of uint8 array (height, width, 3)
    suffix : {".png", ".gif", ".mp4"}
    rate : float or None
        Pictures per second; 10 if None.

    Raises
    ------
    InputError
        If Pillow, or av for films, is not installed.
    """
    Image = pillow()
    buffer, rate = io.BytesIO(), rate or USUAL_RATE
    stream = iter(frames)
    if suffix == ".png":
        Image.fromarray(next(stream)).save(buffer, format="png")
    elif suffix == ".gif":
        # One palette for all pictures, so that colours do not flicker.
        first = Image.fromarray(next(stream)).quantize(128, dither=Image.Dither.NONE)
        rest = (Image.fromarray(one).quantize(palette=first, dither=Image.Dither.NONE) for one in stream)
        step = max(round(1000 / rate), 20)
        first.save(buffer, format="gif", save_all=True, append_images=rest, duration=step, loop=0)
    else:
        _encode_mp4(buffer, stream, rate)
    return buffer.getvalue()


def library(name: str, package: str, extra: str) -> Any:
    """Import a module of an optional package.

    Raises
    ------
    InputError
        If the package is not installed; the message names posekit's extra to install.
    """
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            f"render: got no package {package}; expected it for this format; pip install 'posekit[{extra}]'"
        ) from None


def pillow() -> Any:
    """Return the module ``PIL.Image``."""
    return library("PIL.Image", "pillow", "pictures")


def av_library() -> Any:
    """Return the module ``av``."""
    return library("av", "av", "video")


def _encode_mp4(buffer: io.BytesIO, frames: Iterator[Pixels], rate: float) -> None:
    """Write H.264, or MPEG-4 if no H.264 encoder is available."""
    av = av_library()
    encoder = next(name for name in ("libx264", "libopenh264", "mpeg4") if name in av.codecs_available)
    first = next(frames)
    height, width = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2  # 4:2:0 needs even sides
    with av.open(buffer, mode="w", format="mp4") as container:
        stream = container.add_stream(encoder, rate=Fraction(rate).limit_denominator(1001))
        stream.pix_fmt, stream.height, stream.width = "yuv420p", height, width
        for pixels in chain([first], frames):
            even = np.ascontiguousarray(pixels[:height, :width])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(even, "rgb24")))
        container.mux(stream.encode(None))
