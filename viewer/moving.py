"""Pictures that move: animated GIF; `posekit.viewer.video` has MP4."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import BinaryIO, Final

from PIL import Image

from posekit.errors import ViewerError
from posekit.viewer.browser.studio import Pixels

DEFAULT_FPS: Final = 10.0
"""Pictures a second where nothing says how many."""


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


def real_time(times: Sequence[float]) -> float:
    """Return the pictures a second that show frames as fast as they were, 0.5 to 100; 10 where nobody knows."""
    span = times[-1] - times[0]
    rate = (len(times) - 1) / span if span > 0 else DEFAULT_FPS  # NaN is not more than 0
    return float(min(max(rate, 0.5), 100.0))


def check_speed(fps: float) -> None:
    """Refuse a number of pictures a second that no player shows."""
    if not 0.01 <= fps <= 100:
        raise ViewerError(f"{fps:g} pictures a second; expected 0.01 to 100")


def _indexed(pixels: Pixels) -> Image.Image:
    """Choose 256 colours for a picture; translucent ones stand on white."""
    picture = Image.fromarray(pixels).convert("RGBA")
    ground = Image.new("RGBA", picture.size, (255, 255, 255, 255))
    ground.alpha_composite(picture)
    return ground.convert("RGB").quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
