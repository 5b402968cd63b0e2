"""The pictures that frames came from: a photograph, a folder of them, or a video, and which is whose."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Final

import numpy as np
from PIL import Image

from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.safe_io import refusal
from posekit.viewer.overlay.image_file import IMAGE_SUFFIXES, image_size, read_image
from posekit.viewer.video import VIDEO_SUFFIXES, Video

MAX_PICTURES: Final = 1_000_000
"""Files of a folder."""

MAX_INDEX_ERROR: Final = 0.25
"""Of a picture: how far a frame's time may be from that of a video's picture to be told to be it."""


@dataclass(frozen=True, kw_only=True)
class ImageFiles:
    """Photographs in the order of their names, in which numbers count as numbers.

    Parameters
    ----------
    path : Path
        The photograph, or the folder.
    files : tuple of Path
        One file, or those of the folder.
    """

    path: Path
    files: tuple[Path, ...]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.files)

    def size(self, number: int) -> tuple[int, int]:
        """Return the width and height of one, pixels."""
        return image_size(self.files[number])

    def images(self, wanted: Sequence[int]) -> Iterator[Image.Image]:
        """Read some of them."""
        for number in wanted:
            yield read_image(self.files[number])


@dataclass(frozen=True, kw_only=True)
class VideoImages:
    """The pictures of a video.

    Parameters
    ----------
    video : Video
        What was opened.
    """

    video: Video

    @property
    def path(self) -> Path:
        """The file."""
        return self.video.path

    @property
    def count(self) -> int:
        """How many there are."""
        return self.video.count

    def size(self, number: int) -> tuple[int, int]:
        """Return the width and height of all, pixels."""
        del number
        return self.video.size

    def images(self, wanted: Sequence[int]) -> Iterator[Image.Image]:
        """Read some of them, in ascending order."""
        for pixels in self.video.pictures(wanted):
            yield Image.fromarray(pixels)


def frame_pictures(path: Path) -> ImageFiles | VideoImages:
    """Find the pictures in a file or folder.

    Raises
    ------
    InputError
        Where there is none, or where it cannot be read.
    """
    if path.is_dir():
        found = [one for one in path.iterdir() if one.suffix.lower() in IMAGE_SUFFIXES and one.is_file()]
        if not 0 < len(found) <= MAX_PICTURES:
            expected = f"photographs ({', '.join(IMAGE_SUFFIXES)})"
            raise refusal(path, "", f"a folder with {len(found):,} of them", expected, "give another folder")
        return ImageFiles(path=path, files=tuple(sorted(found, key=_order)))
    if path.suffix.lower() in VIDEO_SUFFIXES:
        return VideoImages(video=Video.opened(path))
    image_size(path)
    return ImageFiles(path=path, files=(path,))


@dataclass(frozen=True, kw_only=True)
class Matched:
    """Which picture each frame came from, by number, and how that is known."""

    pictures: tuple[int, ...]
    said: str


def matched(
    source: ImageFiles | VideoImages, times: Array, names: Sequence[str] = (), *, still: bool = False
) -> Matched:
    """Find the picture of each frame.

    Parameters
    ----------
    source : ImageFiles or VideoImages
        The pictures.
    times : array (F,)
        Of the frames, seconds.
    names : sequence of F str
        The files that the frames were detected in; empty where nobody says.
    still : bool
        Whether all frames may be drawn over one photograph.

    Raises
    ------
    InputError
        Where pictures are missing, or where it is not clear which is whose.
    """
    count = len(times)
    if isinstance(source, ImageFiles) and source.path.is_dir() and (named := _by_name(source, names)):
        return named
    if isinstance(source, ImageFiles) and source.count == 1 and (count == 1 or still):
        return Matched(pictures=(0,) * count, said="" if count == 1 else "one picture for all frames")
    if source.count == count:
        return Matched(pictures=tuple(range(count)), said="pictures and frames are matched by their order")
    if isinstance(source, VideoImages) and count < source.count and source.video.rate > 0:
        index = (times - min(float(times[0]), 0.0)) * source.video.rate
        nearest = np.rint(index)
        fits = np.abs(index - nearest).max() < MAX_INDEX_ERROR and (np.diff(nearest) >= 1).all()
        if fits and 0 <= nearest[0] and nearest[-1] < source.count:
            said = f"frames are matched with the video's {source.count} pictures by their time"
            return Matched(pictures=tuple(int(k) for k in nearest), said=said)
    remedy = "give the pictures that the key points were detected in, all of them and no others"
    if source.count == 1:
        remedy = "choose one with --frame"
    got = plural(source.count, "picture")
    raise refusal(source.path, "", got, f"{count}, one a frame", remedy)


def _by_name(source: ImageFiles, names: Sequence[str]) -> Matched | None:
    """Find files by the names that a detector gave, with an ending or without; None where it gave others to all."""
    numbers = {file.stem: k for k, file in enumerate(source.files)}
    numbers |= {file.name: k for k, file in enumerate(source.files)}
    pictures = []
    for name in names:
        given = PurePath(name)
        stem = given.stem if given.suffix.lower() in IMAGE_SUFFIXES else given.name
        pictures.append(numbers.get(given.name, numbers.get(stem, -1)))
    if max(pictures, default=-1) < 0:
        return None
    if -1 in pictures:
        frame = pictures.index(-1)
        raise InputError(
            f"{source.path}: no file {PurePath(names[frame]).name}, which frame {frame} was detected in; expected one "
            "picture a frame; give the folder that the detector read"
        )
    return Matched(pictures=tuple(pictures), said="pictures and frames are matched by file names")


def _order(path: Path) -> list[tuple[int, int | str]]:
    return [(0, int(word)) if word.isdecimal() else (1, word) for word in re.split(r"(\d+)", path.name)]
