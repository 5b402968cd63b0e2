"""Files with pictures: PNG, animated GIF, MP4, and pages to be turned by hand."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

from posekit.errors import ViewerError
from posekit.geometry import Array
from posekit.safe_io.writing import check_target, replacing, write_text
from posekit.viewer.browser.browser import STEP_TIMEOUT_SECONDS
from posekit.viewer.browser.find_browser import find_browser
from posekit.viewer.browser.studio import Pixels, Studio, check_size
from posekit.viewer.caption import captioned
from posekit.viewer.moving import check_speed, write_gif
from posekit.viewer.scene.compose import Composition, Style, compose, row_count
from posekit.viewer.scene.drawn_object import DrawnObject, compose_object
from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown, check_one_scale
from posekit.viewer.scene.eye import CameraEye, Eye
from posekit.viewer.scene.framing import fitted_eye, orbit, view_eye
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.world import upright_world
from posekit.viewer.standalone import standalone_page
from posekit.viewer.video import video_library, write_mp4

MAX_TURN_PICTURES: Final = 10_000
MOVING_SUFFIXES: Final = (".gif", ".mp4")
PICTURE_SUFFIXES: Final = (".png", ".html", *MOVING_SUFFIXES)
AZIMUTH_WITH_CAMERA, DEFAULT_AZIMUTH = 55.0, 35.0
DEFAULT_ELEVATION, ELEVATION_OF_ROWS = 14.0, 30.0
"""Degrees: from where one looks when nothing is said."""


@dataclass(frozen=True, kw_only=True)
class Shot:
    """How pictures are taken.

    Parameters
    ----------
    size : (int, int)
        Width and height, pixels.
    supersample : int
        How many times larger, in both directions, a picture is drawn before it is scaled down.
    azimuth, elevation : float, optional
        Degrees, from where one looks: see `posekit.viewer.scene.compose.fitted_eye`.
    fov : float
        Vertical field of view, degrees.
    eye : Eye, optional
        A pose instead of azimuth and elevation.
    through_view : bool
        Look through the view's own camera instead.
    turntable : int
        Pictures of one turn around the postures; 0 for none.
    fps : float
        Pictures a second.
    timeout : float
        Seconds that one picture may take.
    """

    size: tuple[int, int] = (1280, 720)
    supersample: int = 2
    azimuth: float | None = None
    elevation: float | None = None
    fov: float = 25.0
    eye: Eye | None = None
    through_view: bool = False
    turntable: int = 0
    fps: float = 10.0
    timeout: float = STEP_TIMEOUT_SECONDS


def check_picture(path: str | Path, shot: Shot) -> bool:
    """Refuse what cannot be drawn before the work that it needs is done; return whether it will move.

    Raises
    ------
    ViewerError
        Where the file's name asks for none of png, gif, mp4 and html, or where the picture's size or speed is none.
    InputError
        Where the place cannot be written, or what writes .mp4 is not installed.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in PICTURE_SUFFIXES:
        raise ViewerError(
            f"{path}: the format is {suffix or 'none'}; expected one of {', '.join(PICTURE_SUFFIXES)}"
        )
    check_size(shot.size, shot.supersample)
    check_target(path)
    if suffix == ".mp4":
        video_library("writing .mp4")
    if not 0 <= shot.turntable <= MAX_TURN_PICTURES:
        raise ViewerError(f"a turn of {shot.turntable:,} pictures; expected at most {MAX_TURN_PICTURES:,}")
    if shot.turntable and suffix not in MOVING_SUFFIXES:
        raise ViewerError(f"{path}: a turntable moves; expected {' or '.join(MOVING_SUFFIXES)}")
    if suffix in MOVING_SUFFIXES:
        check_speed(shot.fps)
    if suffix != ".html":
        find_browser()
    return suffix in MOVING_SUFFIXES


def write_picture(
    path: str | Path,
    subject: DrawnSubject | DrawnObject,
    frames: Sequence[Shown] | None = None,
    *,
    style: Style | None = None,
    shot: Shot | None = None,
    title: str = "posekit",
    progress: Callable[[int], None] | None = None,
) -> int:
    """Draw postures into a file, whole or not at all.

    Parameters
    ----------
    path : path
        ``.png`` and ``.html``: the first of the frames; ``.gif`` and ``.mp4``: all of them one after another, or
        a turn around the first.
    subject : DrawnSubject or DrawnObject
        Whose figure, and which world; or an object's segments.
    frames : sequence of Shown, optional
        Those of the subject, or some of them, with some of their postures, or rejected branches.
    style : Style, optional
        How the postures are composed; as `Style` has it if not given.
    shot : Shot, optional
        The picture's size, and from where it is taken; as `Shot` has it if not given.
    title : str
        Of a page.
    progress : callable, optional
        Called with 1 after each picture.

    Returns
    -------
    int
        The number of pictures drawn.

    Raises
    ------
    ViewerError
        Where there is nothing to draw, or no browser draws it.
    InputError
        Where the file cannot be written.
    """
    style, shot = style or Style(), shot or Shot()
    moving = check_picture(path, shot)
    kind = Path(path).suffix.lower()
    frames = [frame for frame in (subject.frames if frames is None else frames) if len(frame)]
    if not frames:
        raise ViewerError("there is no posture in these frames; nothing can be drawn; choose another frame")
    frames = frames if moving and not shot.turntable else frames[:1]
    film = _Film(subject=subject, frames=frames, style=style, shot=shot)
    if kind == ".html":
        write_text(path, [standalone_page(film.compositions[0].scene, eye=film.page_eye(), title=title)])
        return 1
    with replacing(path) as file, Studio(timeout=shot.timeout) as studio:
        pictures = film.pictures(studio, progress)
        if kind == ".gif":
            return write_gif(file, pictures, fps=shot.fps)
        if kind == ".mp4":
            return write_mp4(file, pictures, fps=shot.fps)
        file.write(png(next(pictures)))
    return 1


def png(pixels: Pixels) -> bytes:
    """Return a picture (H, W, 4) as the content of a PNG file."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()


class _Film:
    """Scenes one after another, in one world, and from where they are looked at."""

    def __init__(
        self, subject: DrawnSubject | DrawnObject, frames: Sequence[Shown], style: Style, shot: Shot
    ) -> None:
        self.shot = shot
        alone = style.layout == "superposed" or all(len(frame) == 1 for frame in frames)
        self.with_camera = style.camera and alone and not shot.through_view and frames[0].sight is not None
        self.rows = 1 if alone else max(row_count(len(frame)) for frame in frames)
        if shot.through_view:
            for frame in frames:
                check_one_scale(frame)
        style = replace(style, azimuth=self._angles()["azimuth"], camera=self.with_camera)
        self.world = upright_world(
            np.concatenate([frame.aligned_points.reshape(-1, 3) for frame in frames]), subject.R_cam_world
        )
        stage = None
        if len(frames) > 1:  # the ground is the same in all frames
            stage = self._points([self._compose(frame, subject, style, None) for frame in frames])
        self.compositions = [self._compose(frame, subject, style, stage) for frame in frames]
        self.sights = [frame.sight for frame in frames]
        self.captions = [frame.caption for frame in frames]

    def pictures(self, studio: Studio, progress: Callable[[int], None] | None) -> Iterator[Pixels]:
        """Draw them."""
        still = self.captions[:1] * self.shot.turntable
        for (scene, eye), caption in zip(self._shots(), still or self.captions, strict=True):
            pixels = studio.draw(scene, eye, size=self.shot.size, supersample=self.shot.supersample)
            yield captioned(pixels, caption)
            if progress is not None:
                progress(1)

    def page_eye(self) -> Eye:
        """Return from where a page looks at first: free, whatever was asked."""
        return self.shot.eye or fitted_eye(self._points(self.compositions), self.world, **self._angles())

    def _shots(self) -> Iterator[tuple[Scene, Eye | CameraEye]]:
        shot = self.shot
        if shot.turntable:
            points = self.compositions[0].points
            for eye in orbit(points, self.world, count=shot.turntable, **self._angles()):
                yield self.compositions[0].scene, eye
            return
        eye = self.page_eye()
        for composition, sight in zip(self.compositions, self.sights, strict=True):
            if shot.through_view:
                yield composition.scene, view_eye(sight, self.world, shot.size)
            else:
                yield composition.scene, eye

    def _compose(
        self, frame: Shown, subject: DrawnSubject | DrawnObject, style: Style, stage: Array | None
    ) -> Composition:
        if isinstance(subject, DrawnObject):
            return compose_object(frame, subject, world=self.world, style=style, stage=stage)
        return compose(frame, figure=subject.figure, world=self.world, style=style, stage=stage)

    @staticmethod
    def _points(compositions: Sequence[Composition]) -> Array:
        return np.concatenate([composition.points for composition in compositions])

    def _angles(self) -> dict[str, float]:
        shot = self.shot
        azimuth = AZIMUTH_WITH_CAMERA if self.with_camera else DEFAULT_AZIMUTH
        azimuth = azimuth if shot.azimuth is None else shot.azimuth
        elevation = ELEVATION_OF_ROWS if self.rows > 1 else DEFAULT_ELEVATION
        elevation = elevation if shot.elevation is None else shot.elevation
        return {
            "azimuth": azimuth,
            "elevation": elevation,
            "fov": shot.fov,
            "aspect": shot.size[0] / shot.size[1],
        }
