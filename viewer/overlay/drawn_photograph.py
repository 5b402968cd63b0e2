"""Photographs of a person who was never there: the truth of a view, painted as its camera would have seen it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image, ImageDraw

from posekit.errors import InputError
from posekit.formats.own import OpenCVModel, View
from posekit.geometry import Array
from posekit.safe_io.writing import check_target, make_folder, replacing
from posekit.viewer.overlay.figure_painter import DrawnPerson, outlines
from posekit.viewer.scene.drawn_subject import subject_of
from posekit.viewer.video import Pixels, video_library, write_mp4

MAX_DRAWN_PIXELS: Final = 40_000_000
DEFAULT_RATE: Final = 10.0
"""Pictures a second of a video of one frame."""

SKY_RGB: Final = (206, 216, 224)
FLOOR_RGB: Final = (172, 164, 152)
CLOTHES_RGB: Final = {
    "head": (224, 184, 154),
    "torso": (74, 94, 120),
    "upper_arm": (84, 106, 134),
    "forearm": (216, 176, 146),
    "hips": (58, 58, 66),
    "thigh": (66, 66, 76),
    "shank": (76, 76, 88),
}
"""What a body is dressed in, by part: both sides alike, as in a photograph."""


def check_photographs(path: Path, view: View) -> tuple[int, int]:
    """Refuse what cannot be drawn; return the pictures' size, pixels.

    Raises
    ------
    InputError
        Where the view's camera says no size in pixels, or the place cannot be written.
    """
    camera = view.camera
    size = camera.size if isinstance(camera, OpenCVModel) else None
    if size is None or size[0] * size[1] > MAX_DRAWN_PIXELS:
        raise InputError(
            f"{path}: the view's camera says no size in pixels that can be drawn; expected a calibrated one of at most "
            f"{MAX_DRAWN_PIXELS:,} pixels"
        )
    if path.suffix.lower() == ".mp4":
        video_library("writing .mp4")
        check_target(path)
    elif path.suffix:
        raise InputError(f"{path}: the format is {path.suffix}; expected .mp4, or a folder without an ending")
    return size


def write_photographs(path: Path, view: View) -> int:
    """Write what the view's camera would have seen, as a video (``.mp4``) or into a folder; return how many.

    Parameters
    ----------
    path : Path
        The video, or the folder: ``000000.png`` and on.
    view : View
        With truth, and a calibrated camera that says its size.

    Raises
    ------
    InputError
        Where it cannot be drawn or written.
    """
    size = check_photographs(path, view)
    pictures = photographs(view, size)
    if path.suffix:
        span = float(view.time[-1] - view.time[0])
        fps = min((len(view) - 1) / span, 100.0) if span > 0 else DEFAULT_RATE
        with replacing(path) as file:
            moving: Iterator[Pixels] = (np.asarray(picture) for picture in pictures)
            return write_mp4(file, moving, fps=fps)
    make_folder(path)
    for k, picture in enumerate(pictures):
        with replacing(path / f"{k:06}.png") as file:
            picture.save(file, format="PNG")
    return len(view)


def photographs(view: View, size: tuple[int, int]) -> Iterator[Image.Image]:
    """Paint the frames of a view, one after another; a frame without truth shows nobody."""
    subject = subject_of(view)
    empty = _empty(size, view, subject.R_cam_world)
    for shown in subject.frames:
        picture = empty.copy()
        if len(shown) and shown.sight is not None:
            person = DrawnPerson(shown=shown, figure=subject.figure)
            pen = ImageDraw.Draw(picture)
            for _, link, outline in outlines(person):
                clothes = CLOTHES_RGB[link.removeprefix("right_").removeprefix("left_")]
                corners = [(float(x), float(y)) for x, y in np.clip(outline, -1e5, 1e5)]
                pen.polygon(corners, fill=clothes, outline=tuple(value * 3 // 4 for value in clothes))
        yield picture


def _empty(size: tuple[int, int], view: View, R_cam_world: Array | None) -> Image.Image:
    """Return a plain in which nobody is, its horizon where the camera sees it; one that is not placed is level."""
    assert isinstance(view.camera, OpenCVModel)
    up = np.array([0.0, -1.0, 0.0]) if R_cam_world is None else R_cam_world[:, 2]
    # The ray through a pixel, K^-1 (u, v, 1), points above the horizon where its part along up is positive.
    across, down, rest = np.linalg.solve(np.asarray(view.camera.K).T, up)
    u, v = np.arange(size[0]), np.arange(size[1])
    above = across * u + (down * v)[:, None] + rest > 0
    return Image.fromarray(np.where(above[..., None], SKY_RGB, FLOOR_RGB).astype(np.uint8))
