"""A photograph from outside: read within bounds, upright, in RGB."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from PIL import Image, ImageOps, UnidentifiedImageError

from posekit.safe_io import cut, open_file, refusal

IMAGE_SUFFIXES: Final = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
IMAGE_FORMATS: Final = ("BMP", "JPEG", "PNG", "TIFF", "WEBP")
"""What Pillow is asked for: no format that another program would be started for."""

MAX_IMAGE_BYTES: Final = 500_000_000
MAX_IMAGE_PIXELS: Final = 120_000_000
"""Pixels of a photograph, more than cameras take: a small file may unpack into many."""


def image_size(path: Path) -> tuple[int, int]:
    """Return the width and height, pixels, of a photograph as it is shown, without unpacking it.

    Raises
    ------
    InputError
        Where it is none, or too large.
    """
    with _opened(path) as image:
        turned = image.getexif().get(0x0112, 1) in (5, 6, 7, 8)  # the orientation: on its side
        return (image.height, image.width) if turned else image.size


def read_image(path: Path) -> Image.Image:
    """Read a photograph in RGB, upright as its EXIF says, which is how detectors read it.

    Raises
    ------
    InputError
        Where it is none, is damaged, or too large.
    """
    with _opened(path) as image:
        upright: Image.Image = ImageOps.exif_transpose(image)
        return upright.convert("RGB")


@contextmanager
def _opened(path: Path) -> Iterator[Image.Image]:
    expected = "a photograph: " + ", ".join(IMAGE_SUFFIXES)
    with open_file(path, limit=MAX_IMAGE_BYTES, too_large="scale it down") as file:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of metadata, and of sizes below the bound here
                with Image.open(file, formats=IMAGE_FORMATS) as image:
                    if image.width * image.height > MAX_IMAGE_PIXELS:
                        raise Image.DecompressionBombError(f"{image.width}x{image.height} pixels")
                    yield image
        except Image.DecompressionBombError as error:
            most = f"at most {MAX_IMAGE_PIXELS:,} pixels"
            raise refusal(path, "", cut(str(error)), most, "scale it down") from None
        except UnidentifiedImageError:
            raise refusal(path, "", "another kind of file", expected, "give the picture itself") from None
        except (OSError, SyntaxError, ValueError, EOFError) as error:
            raise refusal(path, "", cut(str(error)), expected, "save it again; it is damaged") from None
