"""Views of motion capture: real postures, virtual cameras, the figure's lengths taken from the clip."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.body import Figure, load_figure
from posekit.errors import InputError
from posekit.formats.own.units import check_step
from posekit.geometry import Array
from posekit.robots.stretching import shoulders_are_behind
from posekit.skeleton import SEGMENT_NAMES, SEGMENTS
from posekit.synthesis.camera_sphere import CameraPlacements, CameraSphere
from posekit.synthesis.capture import Capture
from posekit.synthesis.observe import observe
from posekit.synthesis.synthetic_scene import SyntheticScene
from posekit.synthesis.viewpoints import look_at, to_camera


def clip_lengths(points: Array) -> dict[str, float]:
    """Return the median length of each of the 17 segments over frames (F, 19, 3), metres.

    A segment that is never seen whole is left out. Lengths do not tell a torso from its mirror image; points do
    (`posekit.robots.shoulders_are_behind`).
    """
    lengths = {}
    for name, (a, b) in zip(SEGMENT_NAMES, SEGMENTS, strict=True):
        distance = np.linalg.norm(points[:, a] - points[:, b], axis=-1)
        if np.isfinite(distance).any():
            lengths[name] = float(np.nanmedian(distance))
    return lengths


def mocap_scene(
    capture: Capture,
    clip: str,
    rng: np.random.Generator,
    *,
    frames: int | None = None,
    dt: float | None = None,
    position: ArrayLike | None = None,
    sphere: CameraSphere | None = None,
    figure: Figure | None = None,
) -> SyntheticScene:
    """View one clip with one camera that stands still.

    Parameters
    ----------
    capture : Capture
        Recorded motion of one or several clips.
    clip : str
        Its name.
    rng : Generator
        Draws the camera where `position` does not place it.
    frames : int, optional
        How many, those with a neck only: from the first, every `dt`; without `dt`, evenly over the clip. All
        that there are, where neither is given or the clip is shorter.
    dt : float, optional
        Seconds between frames, taken to the nearest whole number of the clip's.
    position : array (3,), optional
        Optical centre in the capture's world, metres; it looks at the middle of the person's way.
    sphere : CameraSphere, optional
        The camera, and where it may stand.
    figure : Figure, optional
        The figure to scale to the clip's median lengths; the built-in one unless told otherwise.

    Raises
    ------
    InputError
        Where the clip is not there or has no such frames, or the person does not fit into the picture.
    FigureError
        Where no torso or hips have lengths near the medians.
    """
    sphere = sphere or CameraSphere()
    index = capture.clip_index(clip)
    known = capture.frames_of(index)
    if len(known) == 0:
        raise InputError(f"{capture.source}: clip {clip!r} has no frame with a neck; choose another clip")
    rows = _spread(capture, index, known, frames, dt)
    points = capture.points[rows]
    way = points.reshape(1, -1, 3)
    if position is None:
        placement = sphere.place(way, capture.up, rng)
        R, centre = placement.R_cam_world[0], placement.position[0]
    else:
        centre = np.asarray(position, dtype=np.float64)
        if centre.shape != (3,) or not np.isfinite(centre).all():
            raise InputError(f"the camera is at {centre.tolist()}; expected three finite numbers, metres")
        middle = (np.nanmin(way[0], axis=0) + np.nanmax(way[0], axis=0)) / 2
        R = look_at(centre, middle, capture.up)
        if not sphere.fits(to_camera(way, R[None], centre[None]))[0]:
            raise InputError(
                f"the person of clip {clip!r} leaves the picture of a camera at {centre.tolist()}; move it "
                "away, lower f or take fewer frames"
            )
    return observe(
        (figure or load_figure()).scaled(clip_lengths(points), behind=shoulders_are_behind(points)),
        sphere.camera,
        points,
        CameraPlacements(
            R_cam_world=np.broadcast_to(R, (len(rows), 3, 3)),
            position=np.broadcast_to(centre, (len(rows), 3)),
        ),
        time=capture.order[rows] / capture.fps[index],
        size=sphere.size,
        labels=(capture.actions[index],) * len(rows),
    )


def mocap_scenes(
    capture: Capture,
    n: int,
    rng: np.random.Generator,
    *,
    sphere: CameraSphere | None = None,
    figure: Figure | None = None,
) -> tuple[SyntheticScene, ...]:
    """Draw n frames evenly over all clips, each seen by a camera of its own.

    Parameters
    ----------
    capture : Capture
        Recorded motion of one or several clips.
    n : int
        Frames; each clip gives its share, n over the number of clips, spread over its length. Only frames
        with all 14 joints are taken, and all of a clip that has fewer than its share.
    rng : Generator
        Seeded by the caller: it draws the cameras.
    sphere : CameraSphere, optional
        Where cameras may stand, and what they are.
    figure : Figure, optional
        The figure to scale to each clip's median lengths.

    Returns
    -------
    tuple of SyntheticScene
        One a clip: independent views of one figure, the clip's action as the label of each.

    Raises
    ------
    InputError, FigureError
        See `mocap_scene`.
    """
    sphere, figure = sphere or CameraSphere(), figure or load_figure()
    clips = [capture.frames_of(index, complete=True) for index in range(len(capture.names))]
    shares = _shares(n, [len(frames) for frames in clips])
    if not 1 <= n <= sum(map(len, clips)):
        raise InputError(
            f"{capture.source}: {n} frames were asked for; expected 1 to {sum(map(len, clips))}, those "
            "with all joints"
        )
    scenes = []
    for index, (frames, share) in enumerate(zip(clips, shares, strict=True)):
        if share == 0:
            continue
        rows = _spread(capture, index, frames, share, None)
        points = capture.points[rows]
        placements = sphere.place(points, capture.up, rng)
        scenes.append(
            observe(
                figure.scaled(
                    clip_lengths(capture.points[frames]), behind=shoulders_are_behind(capture.points[frames])
                ),
                sphere.camera,
                points,
                placements,
                time=capture.order[rows] / capture.fps[index],
                size=sphere.size,
                labels=(capture.actions[index],) * share,
            )
        )
    return tuple(scenes)


def _spread(
    capture: Capture, clip: int, known: NDArray[np.intp], frames: int | None, dt: float | None
) -> NDArray[np.intp]:
    """Choose among a clip's frames: from the first, every dt, or evenly from the first to the last."""
    if frames is not None and frames < 1:
        raise InputError(f"{frames} frames were asked for; ask for one or more")
    if dt is not None:
        check_step(dt)
        stride = max(1, round(dt * float(capture.fps[clip])))
        order = capture.order[known]
        return np.asarray(known[(order - order[0]) % stride == 0][:frames])
    if frames is None or frames >= len(known):
        return known
    if frames == 1:
        return known[:1]
    places: NDArray[np.intp] = np.round(np.linspace(0, len(known) - 1, frames)).astype(np.intp)
    return known[places]


def _shares(n: int, available: list[int]) -> list[int]:
    """Share n out evenly, a clip giving at most what it has."""
    shares = [0] * len(available)
    left = n
    while left > 0 and any(share < have for share, have in zip(shares, available, strict=True)):
        open_clips = [k for k, have in enumerate(available) if shares[k] < have]
        each, rest = divmod(left, len(open_clips))
        for place, k in enumerate(open_clips):
            take = min(each + (place < rest), available[k] - shares[k])
            shares[k] += take
            left -= take
    return shares
