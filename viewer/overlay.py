"""Draw bodies over photographs and films with the camera of the view: capsules by depth, bones, image points."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Any, Final

import numpy as np

from posekit.body import Figure, load_figure, scaled_to, with_head
from posekit.cameras import LeeChenCamera, PinholeCamera, ScaledOrthographicCamera, View
from posekit.errors import InputError, refusal
from posekit.geometry import Array, cross
from posekit.recovery import Recovery
from posekit.skeleton import POINTS, TREE_SEGMENTS
from posekit.validators import Report
from posekit.viewer.files import Pixels, av_library, pillow
from posekit.viewer.subjects import COLOURS, frame_rows, frame_with_postures, side

IMAGES: Final = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
FILMS: Final = (".avi", ".mkv", ".mov", ".mp4", ".webm")

BODY_OPACITY: Final = 0.5
#: Opacity of the body, and of the bones of alternative postures.
OTHER_OPACITY: Final = 0.45

#: Supersampling factor, for smooth edges.
FINER: Final = 2

#: Number of points on the rim of a sphere, and number of corners of a capsule's outline.
RIM_POINTS, CORNERS = 24, 48

#: Points (19, 3) in the camera frame, metres, and the scale of a scaled orthographic camera.
Posture = tuple[Array, float]


def overlaid(
    source: Any,
    pictures: Path,
    *,
    view: View | None,
    frame: int | tuple[int, int] | None,
    which: str,
    moving: bool,
) -> tuple[Iterator[Pixels], float | None]:
    """Return pictures with bodies drawn over them, and the number of pictures per second.

    Parameters
    ----------
    source : Recovery, View with truth, or Motion in the world of the view's camera
    pictures : Path
        Picture, folder of pictures or film. Each picture is matched to a frame by its name, otherwise
        by its number or time.
    view : View
        Camera and image points. If the source is a view, pass the source here too.
    frame : int or (int, int), optional
        Frames to draw.
    which : str
        ``all`` also draws the alternative postures of a result.
    moving : bool
        Draw all frames instead of only the first.

    Raises
    ------
    InputError
        If the view or its pictures are missing, or if the numbers of frames and pictures differ.
    """
    view = source if isinstance(source, View) else view
    if isinstance(source, Report):
        raise refusal("render", "--over", "a report", "a result, a view or a motion", "choose one of these")
    if view is None or isinstance(view.camera, LeeChenCamera):
        got = "no view" if view is None else "a camera whose image is in metres"
        raise refusal("render", "--over", got, "a view with image points in pixels", "give it with --view")
    if isinstance(source, Recovery):
        figure, postures = load_figure().scaled(source.lengths), _of_recovery(source, which)
        if frame is None and not moving:
            frame = frame_with_postures(source, None)
    else:
        figure, postures = _of_joints(source, view)
    if len(postures) != len(view):
        raise refusal(
            "render", "--view", f"{len(view)} frames", f"{len(postures)}", "give the view of the source"
        )
    rows = frame_rows(len(view), frame, view.source)
    numbers, read = _matched(pictures, view)
    rows = rows if moving else rows[:1]
    images = read([numbers[row] for row in rows])
    step = np.diff(view.time)
    rate = 1 / float(np.median(step)) if len(step) and np.median(step) > 0 else None
    return (
        np.asarray(_painted(image, postures[row], figure, view, row))
        for image, row in zip(images, rows.tolist(), strict=True)
    ), rate


def _of_recovery(recovery: Recovery, which: str) -> list[list[Posture]]:
    """Return the postures of each frame; the caller draws the first as a body, the others as bones."""
    table, answer, found = recovery.survivors, recovery.answer, []
    scale, head = np.asarray(table.scale), np.asarray(table.head)
    for k, best in enumerate(np.asarray(answer.survivor).tolist()):
        every = range(recovery.rows(k).start, recovery.rows(k).stop)
        others = every if which == "all" else answer.representatives[k].tolist()
        rows = [] if best < 0 else [best, *(row for row in others if row != best)]
        whole = [with_head(table.joints[row][None], head[row][None])[0] for row in rows]
        found.append([(points, float(scale[row])) for points, row in zip(whole, rows, strict=True)])
    return found


def _of_joints(source: Any, view: View) -> tuple[Figure, list[list[Posture]]]:
    """Return the true joints of a view, or a motion in the camera frame."""
    camera, joints = view.camera, source.truth if isinstance(source, View) else source.figure_joints
    if not isinstance(source, View) and isinstance(camera, PinholeCamera) and camera.R is not None:
        joints = joints @ camera.R.T + (0.0 if camera.t is None else camera.t)
    whole = with_head(np.asarray(joints))
    return scaled_to(joints), [[(one, np.nan)] if np.isfinite(one).any() else [] for one in whole]


def _painted(image: Any, postures: list[Posture], figure: Figure, view: View, row: int) -> Any:
    """Paint the first posture as a body, the other postures as bones, and the image points as rings."""
    from PIL import Image, ImageDraw

    zoom = FINER
    if isinstance(view.camera, PinholeCamera) and view.camera.size is not None:
        zoom = FINER * image.width / view.camera.size[0]
    camera = view.camera.take(np.array([row]))

    def seen(points: Array, scale: float) -> Array:
        used = camera
        if isinstance(camera, ScaledOrthographicCamera) and np.isfinite(scale):
            used = replace(camera, scale=scale)
        return np.asarray(np.clip((used.project(points[None])[0] + 0.5) * zoom - 0.5, -1e5, 1e5))

    fine = image.resize((image.width * FINER, image.height * FINER), Image.Resampling.BILINEAR)
    solid = fine.copy()
    detected = (np.concatenate([view.image[row], view.head_image[row]]) + 0.5) * zoom - 0.5
    known = detected[np.isfinite(detected).all(axis=1)]
    width = max(FINER, round(0.008 * float(np.ptp(known, axis=0).max()))) if len(known) else 2 * FINER
    if postures:
        pen = ImageDraw.Draw(solid)
        for name, outline in _outlines(figure, *postures[0], seen, view.camera.perspective):
            colour = COLOURS[side(name)]
            corners = [tuple(one) for one in outline]
            pen.polygon(corners, fill=colour, outline=tuple(part * 2 // 5 for part in colour))
    bones = Image.blend(fine, solid, BODY_OPACITY)
    pen = ImageDraw.Draw(bones, "RGBA")
    for k in reversed(range(len(postures))):
        places = seen(*postures[k])
        alpha, wide = (255, width) if k == 0 else (round(255 * OTHER_OPACITY), max(1, width // 2))
        for a, b in TREE_SEGMENTS:
            if np.isfinite(places[[a, b]]).all():
                shade = (*COLOURS[side(POINTS[b])], alpha)
                pen.line([tuple(places[a]), tuple(places[b])], fill=shade, width=wide)
    for x, y in known:
        for radius, grey in ((1.8 * width, "#141414"), (1.8 * width - FINER, "#ffffff")):
            pen.ellipse((x - radius, y - radius, x + radius, y + radius), outline=grey, width=FINER)
    return bones.reduce(FINER)


def _outlines(
    figure: Figure, points: Array, scale: float, seen: Any, perspective: bool
) -> list[tuple[str, Array]]:
    """Return the name and outline (48, 2) of each capsule of a posture, the farthest first.

    An outline is the convex hull of the images of the capsule's two spheres, computed in 48 directions. For a camera at
    the origin, the visible rim of a sphere with radius r and centre c is a circle normal to c with centre
    c (1 - r^2 / |c|^2) and radius r sqrt(1 - r^2 / |c|^2). For parallel rays, the circle has centre c and radius r.
    """
    turns = 2 * np.pi * np.arange(CORNERS) / CORNERS
    directions, found = np.stack([np.cos(turns), np.sin(turns)]), []
    for capsule in figure.capsules:
        middle, axis = capsule.place(points[None])
        ends = np.concatenate([middle - capsule.half_length * axis, middle + capsule.half_length * axis])
        rims = np.concatenate([_rim(end, capsule.radius, perspective) for end in ends])
        places = seen(rims, scale)
        if np.isfinite(places).all():
            hull = places[np.argmax(places @ directions, axis=0)]
            found.append((float(ends[:, 2].mean()), capsule.link, hull))
    return [one[1:] for one in sorted(found, key=lambda one: -one[0])]


def _rim(middle: Array, radius: float, perspective: bool) -> Array:
    """Return points (24, 3) on the visible rim of a sphere; NaN if the camera is inside the sphere."""
    away = float(np.linalg.norm(middle))
    forward, shrunk = np.array([0.0, 0.0, 1.0]), 1.0
    if perspective:
        forward, shrunk = middle / away, 1 - (radius / away) ** 2 if middle[2] > radius else np.nan
    across = cross(forward, np.array([0.0, 1.0, 1e-3]))
    across /= np.linalg.norm(across)
    turns = 2 * np.pi * np.arange(RIM_POINTS)[:, None] / RIM_POINTS
    ring = np.cos(turns) * across + np.sin(turns) * cross(forward, across)
    return np.asarray(middle * shrunk + radius * np.sqrt(shrunk) * ring)


def _matched(path: Path, view: View) -> tuple[list[int], Any]:
    """Return the picture number of each frame, and a function that reads pictures with given ascending numbers."""
    if path.suffix.lower() in FILMS and path.is_file():
        count, rate = _film_facts(path)
        numbers = list(range(len(view)))
        if count != len(view) and rate:
            numbers = np.rint((view.time - min(float(view.time[0]), 0.0)) * rate).astype(int).tolist()
        if max(numbers) >= count or len(set(numbers)) < len(numbers):
            expected = f"{len(view)}, one per frame"
            raise refusal(path, "", f"{count} pictures", expected, "give the film of the view")
        return numbers, lambda wanted: _film(path, wanted)
    given = path.iterdir() if path.is_dir() else [path]
    files = sorted((one for one in given if one.suffix.lower() in IMAGES), key=_order)
    if not files or not files[0].is_file():
        expected = f"a folder, a film, or one of {', '.join(IMAGES)}"
        raise refusal(path, "", "no picture", expected, "choose another file")
    numbers = _by_name(files, view.pictures) or list(range(len(view)))
    if len(files) == 1:
        numbers = [0] * len(view)
    elif max(numbers) >= len(files):
        expected = f"{len(view)}, one per frame"
        raise refusal(path, "", f"{len(files)} pictures", expected, "give the pictures of the view")
    return numbers, lambda wanted: (_photograph(files[number]) for number in wanted)


def _by_name(files: list[Path], names: tuple[str, ...]) -> list[int] | None:
    """Find files by the picture names in a detector's file, with or without suffix."""
    places = {one.stem: k for k, one in enumerate(files)} | {one.name: k for k, one in enumerate(files)}
    found = [places.get(PurePath(name).name, places.get(PurePath(name).stem, -1)) for name in names]
    return found if found and min(found) >= 0 else None


def _order(path: Path) -> list[tuple[int, int | str]]:
    """Return a sorting key of a file name; numbers in names are compared by value."""
    return [(0, int(word)) if word.isdecimal() else (1, word) for word in re.split(r"(\d+)", path.name)]


def _photograph(path: Path) -> Any:
    """Read a picture as RGB, rotated by its orientation tag, as detectors do."""
    from PIL import ImageOps

    try:
        with pillow().open(path) as image:
            return ImageOps.exif_transpose(image).convert("RGB")
    except (OSError, ValueError) as error:
        raise refusal(path, "", str(error), "a photograph", "save it again") from None


def _film_facts(path: Path) -> tuple[int, float]:
    av = av_library()
    try:
        with av.open(str(path)) as film:
            stream = film.streams.video[0]
            count = stream.frames or sum(1 for _ in film.decode(stream))
            return count, float(stream.average_rate or 0)
    except (av.FFmpegError, IndexError) as error:
        raise InputError(f"{path}: got {error}; expected a film; save it again") from None


def _film(path: Path, wanted: list[int]) -> Iterator[Any]:
    """Read the pictures with the given ascending numbers from a film."""
    with av_library().open(str(path)) as film:
        left = list(wanted)
        for number, picture in enumerate(film.decode(video=0)):
            if left and number == left[0]:
                left.pop(0)
                yield picture.to_image()
