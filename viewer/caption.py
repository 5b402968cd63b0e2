"""A few words in the corner of a picture."""

from __future__ import annotations

from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from posekit.viewer.browser.studio import Pixels

CAPTION_SHARE: Final = 1 / 36
"""Height of a letter, as a part of the picture's smaller side."""

LEAST_CAPTION: Final = 11
"""Pixels that a letter is high at least."""


def write_caption(picture: Image.Image, text: str) -> None:
    """Write lines of text on a dark ground into the upper left corner of a picture."""
    size = max(LEAST_CAPTION, round(CAPTION_SHARE * min(picture.size)))
    font = ImageFont.load_default(size)
    pen = ImageDraw.Draw(picture, "RGBA")
    left, top, right, bottom = pen.multiline_textbbox((size // 2, size // 2), text, font=font)
    edge = size // 2
    pen.rectangle((left - edge, top - edge, right + edge, bottom + edge), fill=(30, 30, 30, 190))
    pen.multiline_text((edge, edge), text, font=font, fill=(255, 255, 255, 255))


def captioned(pixels: Pixels, text: str) -> Pixels:
    """Return a picture (H, W, 3 or 4) with a caption."""
    if not text:
        return pixels
    picture = Image.fromarray(pixels)
    write_caption(picture, text)
    return np.asarray(picture)
