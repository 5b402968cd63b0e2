"""Videos, read and written by PyAV: FFmpeg's libraries in a package, no program that has to be on PATH."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import ViewerError
from posekit.safe_io import cut, extra, open_file, refusal

Pixels = NDArray[np.uint8]

VIDEO_SUFFIXES: Final = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".webm")
"""What the files are called that are read as videos."""

VIDEO_CONTAINERS: Final = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi"
"""FFmpeg's names of what may be in them: play lists, which name other files and addresses, are not."""

VIDEO_ENCODERS: Final = ("libx264", "libopenh264", "mpeg4")
"""The first that the package was built with writes: H.264 if it can."""

MAX_VIDEO_BYTES: Final = 50_000_000_000
MAX_VIDEO_PIXELS: Final = 40_000_000
"""Pixels of one picture of a video, 8K and a little more: a file may claim any size, and each needs memory."""

H264_OPTIONS: Final = {"crf": "18", "preset": "veryfast"}
"""x264's constant rate factor, below which no difference is seen; slower presets write hardly smaller files."""


def video_library(what: str) -> ModuleType:
    """Import PyAV, or say how it is installed.

    Raises
    ------
    InputError
        Where it is not installed.
    """
    return extra("av", "video", what)


def write_mp4(file: BinaryIO, pictures: Iterable[Pixels], *, fps: float) -> int:
    """Write an MP4 (H.264, the colours that all players know) into an open file; return the number of pictures.

    Raises
    ------
    InputError
        Where PyAV is not installed.
    ViewerError
        Where it fails, or there is no picture.
    """
    av = video_library("writing .mp4")
    rate = Fraction(fps).limit_denominator(1001)
    count = 0
    with _refused_by(av, ViewerError, "the video cannot be written", "write a .gif"):
        container = av.open(file, mode="w", format="mp4")
        stream: Any = None
        for pixels in pictures:
            even = _even(pixels)
            if stream is None:
                encoder = next(name for name in VIDEO_ENCODERS if name in av.codecs_available)
                stream = container.add_stream(encoder, rate=rate)
                stream.height, stream.width = even.shape[:2]
                stream.pix_fmt = "yuv420p"
                stream.options = dict(H264_OPTIONS) if encoder == "libx264" else {}
            container.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
            count += 1
        if stream is None:
            raise ViewerError("no picture to animate; expected at least one frame with a posture")
        container.mux(stream.encode(None))
        container.close()
    return count


@dataclass(frozen=True, kw_only=True)
class Video:
    """A video's pictures, read one after another.

    Parameters
    ----------
    path : Path
        The file.
    size : (int, int)
        Width and height as it is shown, pixels.
    rate : float
        Pictures a second.
    count : int
        Pictures.
    """

    path: Path
    size: tuple[int, int]
    rate: float
    count: int

    @staticmethod
    def opened(path: Path) -> Video:
        """Look into a file.

        Raises
        ------
        InputError
            Where it cannot be read, is no video, has no picture, or PyAV is not installed.
        """
        with _reading(path) as (_, container, stream):
            count = sum(1 for packet in container.demux(stream) if packet.size)
        first = None
        if count:
            with _reading(path) as (_, container, stream):
                first = next(container.decode(stream), None)
                rate = float(stream.average_rate or stream.guessed_rate or 0)
        if first is None:
            got = "a video without pictures"
            raise refusal(path, "", got, "at least one", "check how it was recorded")
        sides = (first.width, first.height) if first.rotation % 180 == 0 else (first.height, first.width)
        return Video(path=path, size=sides, rate=rate, count=count)

    def pictures(self, wanted: Sequence[int]) -> Iterator[Pixels]:
        """Read pictures (H, W, 3) by their numbers from 0, which ascend; one may be wanted several times.

        They stand upright, as players show them, where the camera noted how it was held.

        Raises
        ------
        InputError
            Where one cannot be read.
        """
        left = list(wanted)
        with _reading(self.path) as (_, container, stream):
            stream.thread_type = "AUTO"
            for number, frame in enumerate(container.decode(stream)):
                if not left:
                    return
                if number != left[0]:
                    continue
                pixels = np.rot90(frame.to_ndarray(format="rgb24"), k=frame.rotation // 90)
                while left and left[0] == number:
                    left.pop(0)
                    yield pixels
        if left:
            got = f"no picture {left[0]}"
            raise refusal(self.path, "", got, f"{self.count} that can be read", "encode it again")


@contextmanager
def _reading(path: Path) -> Iterator[tuple[ModuleType, Any, Any]]:
    """Open a file's first video stream; no other file or address can be named by it."""
    av = video_library("reading a video")
    expected = "a video of " + ", ".join(VIDEO_SUFFIXES)
    with open_file(path, limit=MAX_VIDEO_BYTES) as file:
        try:
            with av.open(file, options={"format_whitelist": VIDEO_CONTAINERS}) as container:
                stream = next(iter(container.streams.video), None)
                if stream is None:
                    raise refusal(path, "", "a file without pictures", expected, "give another file")
                if stream.width * stream.height > MAX_VIDEO_PIXELS:
                    got, most = f"{stream.width}x{stream.height} pixels", f"at most {MAX_VIDEO_PIXELS:,}"
                    raise refusal(path, "", got, most, "scale it down")
                yield av, container, stream
        except av.FFmpegError as error:
            got = cut(str(error.strerror or error))
            raise refusal(path, "", got, expected, "check that it plays, or encode it again") from None


@contextmanager
def _refused_by(av: ModuleType, kind: type[ViewerError], what: str, remedy: str) -> Iterator[None]:
    try:
        yield
    except av.FFmpegError as error:
        raise kind(f"{what}: {cut(str(error.strerror or error))}; {remedy}") from None


def _even(pixels: Pixels) -> Pixels:
    """Return a picture (H, W, 3 or 4) in RGB with even sides, which H.264's colours need: white is added."""
    height, width = pixels.shape[:2]
    added = [(0, height % 2), (0, width % 2), (0, 0)]
    return np.ascontiguousarray(np.pad(pixels[..., :3], added, constant_values=255))
