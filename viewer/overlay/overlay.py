"""Files with postures drawn over pictures: one picture, an animation, a video, or a folder of pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

from posekit.errors import InputError, ViewerError
from posekit.safe_io.writing import check_target, make_folder, replacing
from posekit.viewer.browser.studio import check_size
from posekit.viewer.moving import check_speed, real_time, write_gif
from posekit.viewer.overlay.figure_painter import DrawnPerson, paint
from posekit.viewer.overlay.frame_pictures import ImageFiles, VideoImages, matched
from posekit.viewer.overlay.overlaid_person import OverlaidPerson
from posekit.viewer.video import Pixels, video_library, write_mp4

OVERLAY_SUFFIXES: Final = (".png", ".jpg", ".gif", ".mp4")
ASPECT_PIXELS: Final = 1.5
"""Pixels by which a picture's height may differ from that of the view's, scaled to its width."""

GIF_SIZE: Final = (800, 800)
"""Pixels that an animated GIF fits into where no size is asked for: photographs make large files."""


@dataclass(frozen=True, kw_only=True)
class Overlay:
    """How pictures are drawn over.

    Parameters
    ----------
    frames : sequence of int, optional
        Of the first person, from 0; by default the first with a posture, or all where it moves.
    size : (int, int), optional
        Pixels that the pictures are to fit into; by default their own.
    fps : float, optional
        Pictures a second; by default as the frames' times say.
    points : bool
        Whether image points are ringed.
    captions : bool
        Whether frames are numbered, and how sure their posture is, is written into the corner.
    """

    frames: Sequence[int] | None = None
    size: tuple[int, int] | None = None
    fps: float | None = None
    points: bool = True
    captions: bool = True


def check_overlay(path: Path, overlay: Overlay) -> None:
    """Refuse what cannot be written before the work that it needs is done.

    Raises
    ------
    ViewerError
        Where the name is of no format, the size too large, or the speed none.
    InputError
        Where the place cannot be written, or a package is missing.
    """
    kind = path.suffix.lower()
    if kind and kind not in OVERLAY_SUFFIXES:
        raise ViewerError(
            f"{path}: the format is {kind}; expected {', '.join(OVERLAY_SUFFIXES)}, or a folder for all pictures"
        )
    if overlay.size is not None:
        check_size(overlay.size, 1)
    if kind:
        check_target(path)
    if kind == ".mp4":
        video_library("writing .mp4")
    if overlay.fps is not None:
        check_speed(overlay.fps)


def write_overlay(
    path: Path,
    people: Sequence[OverlaidPerson],
    source: ImageFiles | VideoImages,
    overlay: Overlay | None = None,
    *,
    progress: Callable[[int], None] | None = None,
) -> tuple[int, list[str]]:
    """Draw people over the pictures that their frames came from.

    Parameters
    ----------
    path : Path
        ``.png``, ``.jpg``: one frame; ``.gif``, ``.mp4``: all of them; a name without an ending is a folder that gets
        a PNG of each.
    people : sequence of OverlaidPerson
        All who are drawn.
    source : ImageFiles or VideoImages
        The pictures.
    overlay : Overlay, optional
        How; as `Overlay` has it if not given.
    progress : callable, optional
        Called with 1 after each picture.

    Returns
    -------
    count, said
        The number of pictures drawn, and how they were matched.

    Raises
    ------
    InputError
        Where pictures are missing, damaged, or of another size than the view's.
    ViewerError
        Where nothing can be drawn.
    """
    overlay, kind = overlay or Overlay(), path.suffix.lower()
    check_overlay(path, overlay)
    if kind == ".gif" and overlay.size is None:
        overlay = replace(overlay, size=GIF_SIZE)
    film = _DrawnFilm(people, source, overlay, moving=kind not in (".png", ".jpg"))
    drawn = film.drawn(progress)
    if not kind:
        make_folder(path)
        count = 0
        for name, picture in zip(film.names(), drawn, strict=True):
            with replacing(path / name) as file:
                picture.save(file, format="PNG")
            count += 1
        return count, film.said
    with replacing(path) as file:
        if kind in (".png", ".jpg"):
            next(drawn).save(file, format="PNG" if kind == ".png" else "JPEG", quality=92)
            return 1, film.said
        moving: Iterator[Pixels] = (np.asarray(picture) for picture in _of_one_size(drawn))
        if kind == ".gif":
            return write_gif(file, moving, fps=film.fps), film.said
        return write_mp4(file, moving, fps=film.fps), film.said


class _DrawnFilm:
    """Which pictures are drawn, and who is in each."""

    def __init__(
        self,
        people: Sequence[OverlaidPerson],
        source: ImageFiles | VideoImages,
        overlay: Overlay,
        *,
        moving: bool,
    ) -> None:
        self.source, self.overlay, self.people = source, overlay, people
        for person in people:
            if not any(len(frame) and frame.sight is not None for frame in person.frames):
                raise ViewerError(
                    f"{person.name}: no posture with a camera that sees it; expected a result beside the view that it "
                    "was recovered from (--view)"
                )
        self.said: list[str] = []
        self.places = self._places(moving=moving)
        self.shots = self._shots(moving=moving)
        self.zooms = self._zooms()
        times = [inside[0][0].frames[inside[0][1]].time for _, inside in self.shots]
        self.fps = overlay.fps or real_time(times)

    def drawn(self, progress: Callable[[int], None] | None) -> Iterator[Image.Image]:
        """Draw them, one after another."""
        images = self.source.images([number for number, _ in self.shots])
        for image, (number, inside) in zip(images, self.shots, strict=True):
            people = [
                DrawnPerson(
                    shown=one.frames[k],
                    figure=one.figure,
                    zoom=self.zooms.get((id(one), image.size), 1.0),
                    points=self.overlay.points and one.detected,
                )
                for one, k in inside
                if len(one.frames[k]) and one.frames[k].sight is not None
            ]
            _check_inside(self.source.path, people, image.size, inside[0][1])
            caption = self._caption(number, inside) if self.overlay.captions else ""
            yield _fitted(paint(image, people, caption=caption), self.overlay.size)
            if progress is not None:
                progress(1)

    def names(self) -> list[str]:
        """Name the files of a folder."""
        numbers = [number for number, _ in self.shots]
        if isinstance(self.source, ImageFiles) and len(set(numbers)) == len(numbers):
            stems = [self.source.files[number].stem for number in numbers]
            if len(set(stems)) == len(stems):
                return [f"{stem}.png" for stem in stems]
        return [f"{inside[0][1]:06}.png" for _, inside in self.shots]

    def _places(self, *, moving: bool) -> list[list[int]]:
        """Find the picture of each frame of each person."""
        found = []
        alone = isinstance(self.source, ImageFiles) and not self.source.path.is_dir()
        for one in self.people:
            if alone and not moving and self.overlay.frames is not None:  # it is of the frame that was chosen
                found.append([0] * len(one.frames))
                continue
            times = np.array([frame.time for frame in one.frames])
            match = matched(self.source, times, one.files, still=moving)
            if match.said and match.said not in self.said:
                self.said.append(match.said)
            found.append(list(match.pictures))
        return found

    def _shots(self, *, moving: bool) -> list[tuple[int, list[tuple[OverlaidPerson, int]]]]:
        """Choose pictures, each with who is in it, in which of their frames."""
        frames = self.overlay.frames
        if self.source.count == 1:  # one photograph, of one frame or of all
            count = min(len(one.frames) for one in self.people)
            frames = range(count) if frames is None else frames
            shots = [(0, [(one, k) for one in self.people]) for k in frames]
        else:
            inside: dict[int, list[tuple[OverlaidPerson, int]]] = {}
            for one, places in zip(self.people, self.places, strict=True):
                for k, number in enumerate(places):
                    inside.setdefault(number, []).append((one, k))
            chosen = sorted(inside) if frames is None else sorted({self.places[0][k] for k in frames})
            shots = [(number, inside[number]) for number in chosen]
        if moving:
            return shots
        filled = [shot for shot in shots if any(len(one.frames[k]) for one, k in shot[1])]
        return (filled or shots)[:1]

    def _zooms(self) -> dict[tuple[int, tuple[int, int]], float]:
        """Hold the pictures' sizes against the views' before any is drawn; say where one is scaled."""
        zooms = {}
        sizes = {number: self.source.size(number) for number in {number for number, _ in self.shots}}
        for number, inside in self.shots:
            size = sizes[number]
            for one, _ in inside:
                if one.size is None or (id(one), size) in zooms:
                    continue
                zoom = size[0] / one.size[0]
                if abs(one.size[1] * zoom - size[1]) > ASPECT_PIXELS:
                    raise InputError(
                        f"{self.source.path}: the picture is {size[0]}x{size[1]}, the view's camera {one.size[0]}x"
                        f"{one.size[1]} pixels; expected that size or all of it scaled; give the picture that the key "
                        "points were detected in"
                    )
                zooms[id(one), size] = zoom
                if zoom != 1.0:
                    self.said.append(f"pictures are the view's, {zoom:.3g} times as large")
        return zooms

    def _caption(self, number: int, inside: Sequence[tuple[OverlaidPerson, int]]) -> str:
        """Say what is said of one person; of several, which picture it is."""
        if len(inside) == 1:
            (one, k), *_ = inside
            return one.frames[k].caption
        files = self.source.files if isinstance(self.source, ImageFiles) else ()
        return f"{files[number].name if files else f'picture {number}'}: {len(inside)} people"


def _check_inside(path: Path, people: Sequence[DrawnPerson], size: tuple[int, int], frame: int) -> None:
    """Refuse a picture in which most image points of a person are not: it is of something else."""
    for person in people:
        points = (person.sight.image + 0.5) * person.zoom
        points = points[np.isfinite(points).all(axis=1)]
        outside = ((points < 0) | (points > size)).any(axis=1)
        if len(points) and outside.mean() > 0.5:
            low, high = points.min(axis=0), points.max(axis=0)
            raise InputError(
                f"{path}: frame {frame}'s image points are at {low[0]:.0f} to {high[0]:.0f}, {low[1]:.0f} to "
                f"{high[1]:.0f} pixels, the picture is {size[0]}x{size[1]}; expected them inside; give the "
                "picture that they were detected in"
            )


def _fitted(picture: Image.Image, size: tuple[int, int] | None) -> Image.Image:
    if size is None:
        return picture
    ratio = min(size[0] / picture.width, size[1] / picture.height)
    fitted = max(1, round(picture.width * ratio)), max(1, round(picture.height * ratio))
    return picture.resize(fitted, Image.Resampling.LANCZOS)


def _of_one_size(pictures: Iterator[Image.Image]) -> Iterator[Image.Image]:
    size = None
    for picture in pictures:
        if size is not None and picture.size != size:
            raise ViewerError(
                f"pictures of {size[0]}x{size[1]} and {picture.width}x{picture.height} pixels make no film; expected "
                "one size; write them into a folder: -o FOLDER"
            )
        size = picture.size
        yield picture
