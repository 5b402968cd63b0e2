"""From motion, or a view with truth, to the pieces of work of an evaluation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import FigureError, InputError
from posekit.evaluate.frame_sampling import FrameSampling, action_names
from posekit.evaluate.method import Method, scaled
from posekit.evaluate.sweep import Sweep, facing, middles
from posekit.evaluate.work import Work
from posekit.formats.own import LeeChenModel, OpenCVModel, View
from posekit.geometry import Array
from posekit.skeleton import JOINTS, POINTS, SIDES
from posekit.synthesis import Capture, clip_lengths
from posekit.synthesis.viewpoints import to_camera

AT_ONCE: Final = 256
"""Frames of a piece of work, about."""

MOST_VIEWS: Final = 1_000_000
"""Frames times cameras times levels of noise: what is kept in memory, below a gigabyte."""


@dataclass(frozen=True, kw_only=True)
class Material:
    """Everything that is evaluated, in pieces.

    Parameters
    ----------
    works : tuple of Work
        The pieces: what one process does at a time.
    clips, actions : tuple of str
        By the clip's number.
    left_out : tuple of str
        What is not evaluated, a line each.
    out_of_picture : int
        Frames, each with its camera, in which not the whole body is in the picture: not evaluated.
    shank : float
        Pixels that the lower leg is long in the picture where it is parallel to it: Wang et al. (2014) count noise in
        it. NaN for a view.
    """

    works: tuple[Work, ...]
    clips: tuple[str, ...]
    actions: tuple[str, ...]
    left_out: tuple[str, ...] = ()
    out_of_picture: int = 0
    shank: float = float("nan")

    @property
    def frames(self) -> int:
        """Count the frames of all pieces."""
        return sum(map(len, self.works))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shots:
    """Frames of one clip as the cameras see them, camera by camera; the axes are cameras, frames."""

    points: Array
    inside: NDArray[np.bool_]
    frame: NDArray[np.intp]
    time: Array


def of_capture(capture: Capture, sampling: FrameSampling, sweep: Sweep, method: Method) -> Material:
    """View motion through virtual cameras.

    Each clip's lengths are its medians over all its frames; the head is not seen. A frame's noise is one draw, as
    large as the level says: the levels differ in nothing else.

    Raises
    ------
    InputError
        Where nothing is left to be evaluated.
    """
    sampling = replace(sampling, consecutive=sampling.consecutive or method.choose is not None)
    works: list[Work] = []
    left_out: list[str] = []
    outside, shanks = 0, []
    chosen = {clip: sampling.rows(capture, clip) for clip in sampling.chosen(capture)}
    views = sum(map(len, chosen.values())) * len(sweep) * len(method.noise)
    if views > MOST_VIEWS:
        raise InputError(
            f"{capture.source}: {views} views; expected at most {MOST_VIEWS}; take fewer --frames-per-clip, a larger "
            "--yaw-step or fewer levels of --noise"
        )
    for clip, rows in chosen.items():
        known = capture.frames_of(clip, complete=True)
        lengths = clip_lengths(capture.points[known])
        try:
            if not len(rows):
                raise InputError("no frame has all 14 joints")
            scaled(tuple(lengths.items()))
        except (FigureError, InputError) as error:
            left_out.append(f"clip {capture.names[clip]}: {error}")
            continue
        shots = _seen(capture, clip, rows, sweep, still=sampling.consecutive)
        outside += int((~shots.inside).sum())
        shanks += [lengths[f"{side}_knee-{side}_ankle"] for side in SIDES]
        works += _works(shots, clip, lengths, sweep, method)
    if not works:
        why = (
            left_out[0]
            if left_out
            else "the person leaves every picture; give a larger --distance or a smaller --f"
        )
        raise InputError(f"{capture.source}: nothing is left to be evaluated: {why}")
    return Material(
        works=tuple(works),
        clips=capture.names,
        actions=action_names(capture),
        left_out=tuple(left_out),
        out_of_picture=outside,
        shank=float(np.median(shanks)) * sweep.f / sweep.distance,
    )


def of_view(view: View, method: Method, name: str = "view") -> Material:
    """Take a view with truth as it is.

    Raises
    ------
    InputError
        Where it has no truth, or noise cannot be added to its image points.
    """
    known = np.flatnonzero(np.isfinite(view.truth).any(axis=(1, 2)))
    if not len(known):
        raise InputError(
            f"{name}: no frame has a truth to compare with; expected some; a view without can be recovered"
        )
    if isinstance(view.camera, LeeChenModel) and any(method.noise):
        raise InputError(
            f"--noise: {max(method.noise):g} pixels; the camera of {name} is lee-chen, whose image points are lengths; "
            "expected 0"
        )
    if method.root == "given":
        neck = view.truth[:, 0]
        view = replace(view, root=np.where(np.isnan(neck), view.root, neck))
    rng = np.random.default_rng((method.seed, 0))
    own = len(view.own_head_names)
    draw = rng.standard_normal((len(view), len(POINTS) + own, 2))
    works = []
    for level, sigma in enumerate(method.noise):
        noisy = _noisy(view, sigma, draw)
        size = len(known) if method.choose is not None else AT_ONCE
        for part in _parts(noisy, known, size):
            works.append(
                Work(
                    view=noisy.take(part),
                    clip=0,
                    noise=sigma,
                    frame=part,
                    yaw=np.full(len(part), np.nan),
                    height=np.full(len(part), np.nan),
                    camera=np.zeros(len(part), dtype=np.intp),
                    seed=(method.seed, 0, level, int(part[0])),
                )
            )
    return Material(works=tuple(works), clips=(name,), actions=(name,))


def _parts(view: View, rows: NDArray[np.intp], size: int) -> list[NDArray[np.intp]]:
    """Cut frames into parts of about this size, each of which shows a neck somewhere, as a view must."""
    parts: list[NDArray[np.intp]] = []
    for part in np.split(rows, range(size, len(rows), size)):
        if parts and not all(np.isfinite(view.image[one, 0]).any() for one in (parts[-1], part)):
            parts[-1] = np.concatenate([parts[-1], part])
        else:
            parts.append(part)
    return parts


def _noisy(view: View, sigma: float, draw: Array) -> View:
    """Move a view's image points; the neck's, where its place is given, says nothing and stays."""
    if sigma == 0:
        return view
    image = view.image + sigma * draw[:, : len(JOINTS)]
    given = np.isfinite(view.root).all(axis=1)
    image[given, 0] = view.image[given, 0]
    return replace(
        view,
        image=image,
        head_image=view.head_image + sigma * draw[:, len(JOINTS) : len(POINTS)],
        own_head_image=view.own_head_image + sigma * draw[:, len(POINTS) :],
        deviation=float(np.hypot(sigma, view.deviation or 0.0)),
    )


def _seen(capture: Capture, clip: int, rows: NDArray[np.intp], sweep: Sweep, *, still: bool) -> _Shots:
    """Look at some frames of a clip from all cameras; from cameras that stand `still`, or go with the person."""
    joints = capture.points[rows, : len(JOINTS)]
    every = capture.points[capture.clip == clip, : len(JOINTS)]
    ground = float(np.nanmin(every @ capture.up))
    if still:
        middle = middles(joints.reshape(1, -1, 3))
        forward = facing(joints[len(joints) // 2, None], capture.up)
    else:
        middle, forward = middles(joints), facing(joints, capture.up)
    placed = sweep.place(middle, forward, capture.up, ground)
    R, position = (np.broadcast_to(each, (each.shape[0], len(rows), *each.shape[2:])) for each in placed)
    points = to_camera(joints, R, position)
    flat = points.reshape(-1, len(JOINTS), 3)
    return _Shots(
        points=points,
        inside=sweep.sphere.fits(flat).reshape(points.shape[:2]) & (points[..., 2] > 0).all(axis=-1),
        frame=rows,
        time=capture.order[rows] / capture.fps[clip],
    )


def _works(
    shots: _Shots, clip: int, lengths: dict[str, float], sweep: Sweep, method: Method
) -> Iterator[Work]:
    cameras, frames = shots.inside.shape
    together = max(1, AT_ONCE // frames)
    draw = np.random.default_rng((method.seed, clip)).standard_normal((cameras, frames, len(JOINTS), 2))
    model = OpenCVModel(K=sweep.camera.K, size=sweep.size)
    for level, sigma in enumerate(method.noise):
        for start in range(0, cameras, together):
            camera, frame = np.nonzero(shots.inside[start : start + together])
            camera += start
            for part in _cut(camera, whole=method.choose is not None):
                at = camera[part], frame[part]
                truth = shots.points[at]
                image = sweep.camera.project(truth)
                if method.root == "auto":
                    image += sigma * draw[at]
                else:
                    image[:, 1:] += sigma * draw[at][:, 1:]
                yield Work(
                    view=View(
                        camera=model,
                        time=shots.time[at[1]],
                        image=image,
                        root=truth[:, 0] if method.root != "auto" else np.empty((0,)),
                        truth=truth,
                        lengths=lengths,
                        deviation=sigma or None,
                    ),
                    clip=clip,
                    noise=sigma,
                    frame=shots.frame[at[1]],
                    yaw=sweep.poses[at[0], 0],
                    height=sweep.poses[at[0], 1],
                    camera=at[0],
                    seed=(method.seed, clip, level, int(at[0][0]), int(at[1][0])),
                )


def _cut(camera: NDArray[np.intp], *, whole: bool) -> list[NDArray[np.intp]]:
    """Cut frames into parts of about `AT_ONCE`; those of one camera stay together where they are followed."""
    if not len(camera):
        return []
    rows = np.arange(len(camera))
    return [rows] if whole else [*np.array_split(rows, -(-len(rows) // AT_ONCE))]
