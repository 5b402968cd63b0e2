"""Pictures that move: animated GIF, and MP4 where ffmpeg is there."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from PIL import Image

from posekit.errors import ViewerError
from posekit.viewer.browser.studio import Pixels

FFMPEG_TIME = 300.0
"""Seconds that ffmpeg may take after the last picture."""


def write_gif(file: BinaryIO, pictures: Iterable[Pixels], *, fps: float) -> int:
    """Write an animated GIF that repeats for ever; return the number of pictures.

    GIF counts hundredths of a second, and players want two of them at least: 30 pictures a second become 33.

    Raises
    ------
    ViewerError
        Where there is no picture or the speed is none.
    """
    check_speed(fps)
    frames = [_indexed(pixels) for pixels in pictures]
    if not frames:
        raise ViewerError("no picture to animate; expected at least one frame with a posture")
    frames[0].save(
        file,
        format="GIF",
        save_all=True,
        append_images=frames[1:],
        duration=max(round(100 / fps), 2) * 10,
        loop=0,
        disposal=2,
    )
    return len(frames)


def find_ffmpeg() -> str:
    """Return ffmpeg's path.

    Raises
    ------
    ViewerError
        Where it is not on PATH.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        raise ViewerError(
            "no ffmpeg on PATH, which .mp4 needs; install it (Debian, Ubuntu: apt-get install ffmpeg), or write a .gif"
        )
    return found


def write_mp4(file: BinaryIO, pictures: Iterable[Pixels], *, fps: float) -> int:
    """Write an MP4 (H.264) with ffmpeg; return the number of pictures.

    Raises
    ------
    ViewerError
        Where ffmpeg is missing or fails, there is no picture, or the speed is none.
    """
    check_speed(fps)
    program = find_ffmpeg()
    with tempfile.TemporaryDirectory(prefix="posekit-mp4-") as folder:
        made = Path(folder) / "film.mp4"
        count = _encode(program, made, iter(pictures), fps)
        with made.open("rb") as film:
            shutil.copyfileobj(film, file)
    return count


def _encode(program: str, made: Path, pictures: Iterator[Pixels], fps: float) -> int:
    first = next(pictures, None)
    if first is None:
        raise ViewerError("no picture to animate; expected at least one frame with a posture")
    height, width = first.shape[:2]
    command = [program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-"]
    # H.264 with the colours that all players know needs even sides.
    command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-c:v", "libx264", "-crf", "18"]
    command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(made)]
    log = made.with_name("log")
    count = 0
    with log.open("wb") as said, subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said) as process:
        try:
            if process.stdin is not None:
                for pixels in _with(first, pictures):
                    process.stdin.write(pixels[..., :3].tobytes())
                    count += 1
                process.stdin.close()
            process.wait(timeout=FFMPEG_TIME)
        except (BrokenPipeError, subprocess.TimeoutExpired):
            pass  # what ffmpeg said is reported below
        finally:
            if process.poll() is None:
                process.kill()
    if process.returncode != 0 or not made.is_file():
        lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        why = lines[-1][-160:] if lines else f"it ended with {process.returncode}"
        raise ViewerError(f"{os.fspath(program)} failed: {why}; write a .gif, or install a complete ffmpeg")
    return count


def _with(first: Pixels, others: Iterator[Pixels]) -> Iterator[Pixels]:
    yield first
    yield from others


def check_speed(fps: float) -> None:
    """Refuse a number of pictures a second that no player shows."""
    if not 0 < fps <= 100:
        raise ViewerError(f"{fps:g} pictures a second; expected more than 0 and at most 100")


def _indexed(pixels: Pixels) -> Image.Image:
    """Choose 256 colours for a picture; translucent ones stand on white."""
    picture = Image.fromarray(pixels)
    ground = Image.new("RGBA", picture.size, (255, 255, 255, 255))
    ground.alpha_composite(picture)
    return ground.convert("RGB").quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
