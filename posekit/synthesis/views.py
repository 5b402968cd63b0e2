"""Synthetic views with true joints: of a walker, of random valid postures, of motion capture; built-in views.

Each function returns a `posekit.cameras.View` whose `truth` has the true joints in the camera frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import Figure, load_figure, scaled_to
from posekit.cameras import LeeChenCamera, PinholeCamera, ScaledOrthographicCamera, View
from posekit.cameras.head import TABLE_A2
from posekit.errors import nearest, refusal, shown
from posekit.geometry import Array, Ints
from posekit.motion import Motion
from posekit.settings import EXACT, ValidateSettings
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS
from posekit.synthesis.cameras import (
    DISTANCE_RANGE,
    default_camera,
    in_picture,
    look_at,
    middle_of,
    place_cameras,
    to_camera,
)
from posekit.synthesis.walker import Walker

#: Distance of the image plane from the centre of projection, metres (Lee & Chen 1985, Table 2: 5 cm).
PAPER_F: Final = 0.05

#: Number of frames of a sequence, and seconds between frames (Lee & Chen 1985, Appendix).
PAPER_FRAMES, PAPER_STEP = 5, 0.2

#: Built-in sequences: the paper's camera position (origin of the image plane in the head-centred frame, metres), and
#: the phase of the first frame, cycles, which the paper does not print.
SEQUENCES: Final = {"seq1": ((4.0, 0.0, 0.0), 0.11), "seq2": ((3.0, 0.0, 3.0), 0.68)}

#: Velocity of the walker in built-in sequences, leg lengths per second. The paper does not print it.
SEQUENCE_VELOCITY: Final = 0.7

#: Up direction in the walker's head-centred frame, and in the world of random postures.
UP_WALKER, UP_RANDOM = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])

#: Smallest fraction of random draws that are valid; below it the limits are refused.
MIN_ACCEPTED: Final = 1e-3


def builtin_view(name: str) -> View:
    """Return a built-in view of the walker, similar to the sequences of Lee & Chen 1985, §4.

    Parameters
    ----------
    name : str
        ``seq1`` (camera ahead of the walker) or ``seq2`` (ahead and to the right).

    Raises
    ------
    InputError
        If no built-in view has this name.

    Examples
    --------
    >>> len(builtin_view("seq1"))
    5
    """
    if name not in SEQUENCES:
        raise refusal("", "view", shown(name), "a built-in view", nearest(name, SEQUENCES))
    camera, phase0 = SEQUENCES[name]
    return walker_view(Walker(velocity=SEQUENCE_VELOCITY), camera=camera, phase0=phase0)


def view_of(
    figure: Figure, camera: PinholeCamera | LeeChenCamera, points_cam: Array, *, time: ArrayLike | None = None
) -> View:
    """Project a figure's points without noise, and return the view with the true joints.

    The view has the segment lengths and head points that differ from those of the built-in figure. It has the neck
    position in frames in which a head point is unknown. A view by a Lee-Chen camera does not have f, and its file is in
    cm.

    Parameters
    ----------
    figure : Figure
        The person.
    camera : PinholeCamera or LeeChenCamera
        Intrinsic parameters; f of a Lee-Chen camera must be given.
    points_cam : array (F, 19, 3)
        Joints and head points, OpenCV camera frame, metres; unknown points are NaN.
    time : array (F,), optional
        Seconds; frame numbers if not given.

    Raises
    ------
    InputError
        If there is no frame, or a point is not in front of the camera.
    """
    behind = np.argwhere(points_cam[..., 2] <= 0)
    if len(behind):
        frame, k = behind[0]
        got = f"depth {points_cam[frame, k, 2]:.3g} m"
        place = f"frames[{frame}].{POINTS[k]}"
        raise refusal("", place, got, "a point in front of the camera", "move the camera away")
    paper = isinstance(camera, LeeChenCamera)
    image, split = camera.project(points_cam), len(JOINTS)
    headless = np.asarray(np.isnan(image[:, split:]).any(axis=(1, 2)))
    standard = load_figure()
    lengths = {
        name: length
        for name, length in figure.lengths.items()
        if not np.isclose(length, standard.lengths[name], rtol=0, atol=1e-12)
    }
    same_head = np.allclose(figure.head_points, standard.head_points, rtol=0, atol=1e-12)
    head = figure.head_points + (TABLE_A2.points[0] if paper else 0.0)
    side = figure.shoulder_side
    return View(
        camera=LeeChenCamera(f=None) if paper else camera,
        time=np.asarray(np.arange(len(points_cam)) if time is None else time, dtype=np.float64),
        image=image[:, :split],
        head_image=image[:, split:],
        root=np.where(headless[:, None], points_cam[:, 0], np.nan),
        truth=points_cam[:, :split],
        lengths=lengths,
        shoulders=side if lengths and side != "undecided" else None,
        head_points=dict(zip(("neck", *HEAD_POINTS), TABLE_A2.points if same_head else head, strict=True))
        if paper or not same_head
        else None,
        unit="cm" if paper else "m",
    )


def with_noise(view: View, sigma: float, rng: np.random.Generator) -> View:
    """Add Gaussian noise to every image point; if `sigma` is in pixels, it is also the `deviation` of the new view.

    Parameters
    ----------
    view : View
        An exact view.
    sigma : float
        Standard deviation of each coordinate: in pixels, or in metres on the image plane of a Lee-Chen camera.
    rng : Generator
        Random number generator.

    Raises
    ------
    InputError
        If sigma is negative or not finite.
    """
    if not 0 <= sigma < np.inf:
        raise refusal("", "noise", f"{sigma:g}", "a standard deviation of 0 or more")
    noise = sigma * rng.standard_normal((len(view), len(POINTS), 2))
    pixels = sigma > 0 and not isinstance(view.camera, LeeChenCamera)
    return replace(
        view,
        image=view.image + noise[:, : len(JOINTS)],
        head_image=view.head_image + noise[:, len(JOINTS) :],
        deviation=sigma if pixels else view.deviation,
    )


def forget_camera(view: View) -> View:
    """Replace the camera of a view by a scaled orthographic camera of unknown scale."""
    names = ("time", "image", "truth", "lengths", "shoulders", "stature", "unit", "deviation")
    known = {name: getattr(view, name) for name in names}
    return View(camera=ScaledOrthographicCamera(scale=None), **known)


def walker_view(
    walker: Walker,
    *,
    camera: ArrayLike = SEQUENCES["seq1"][0],
    target: ArrayLike = (0.0, 0.0, 0.0),
    f: float = PAPER_F,
    frames: int = PAPER_FRAMES,
    dt: float = PAPER_STEP,
    phase0: float = 0.0,
    carried: bool = True,
) -> View:
    """Project a walking figure by the camera model of Lee & Chen 1985.

    Parameters
    ----------
    walker : Walker
        The person and the gait.
    camera : array (3,)
        Camera position by Lee & Chen's definition: origin of the image plane, head-centred frame (x forward, y up, z
        right), metres. The optical centre is at the distance f behind this origin.
    target : array (3,)
        Point on the optical axis, head-centred frame, metres.
    f : float
        Distance from the centre of projection to the image plane, metres.
    frames : int
        Number of frames.
    dt : float
        Seconds between frames.
    phase0 : float
        Phase of the first frame, cycles; at 0 the right foot strikes.
    carried : bool
        Whether the camera moves with the walker's head, as in Lee & Chen 1985. If False, the camera is static, and the
        walker's head is at the position of Lee & Chen's Table A.2 in the first frame.

    Raises
    ------
    InputError
        If a number is out of range, or the walker passes the camera.
    """
    place, aim = np.asarray(camera, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if frames < 1 or not 0 < dt < np.inf or not np.isfinite(phase0):
        got = f"frames {frames}, dt {dt:g} s, phase {phase0:g}"
        raise refusal("", "walker", got, "1 or more frames, a positive dt and a finite phase", "correct them")
    if place.shape != (3,) or aim.shape != (3,) or not np.isfinite([place, aim]).all():
        got = f"position {place.tolist()} and target {aim.tolist()}"
        raise refusal("", "camera", got, "three finite numbers each, metres", "correct them")
    R = look_at(place, aim, UP_WALKER)
    time = dt * np.arange(frames, dtype=np.float64)
    q = walker.configurations(walker.phase(time, phase0))
    if not carried:
        q[:, :3] += walker.travel(time, phase0)
    # The paper's camera position is the middle of the image plane, f in front of the optical centre.
    points = to_camera(walker.figure.forward_kinematics(q), R, place - f * R[2])
    return view_of(walker.figure, LeeChenCamera(f=f), points, time=time)


def random_postures(figure: Figure, n: int, rng: np.random.Generator, ranges: str = "anatomical") -> Array:
    """Draw configurations (n, nq) uniformly inside the figure's limits, and keep those that pass the checks.

    The torso is at the origin, upright, facing +x.

    Parameters
    ----------
    figure : Figure
        The person; angles are drawn between the joint limits of this figure.
    n : int
        Number of postures.
    rng : Generator
        Random number generator; the same seed gives the same postures.
    ranges : str
        Joint ranges of the joint range check, in addition to the figure's limits; ``urdf`` selects the figure's limits
        only.

    Raises
    ------
    InputError
        If n is not positive, or too few draws pass the checks (`MIN_ACCEPTED`).
    """
    if n < 1:
        raise refusal("", "frames", str(n), "1 or more", "ask for more")
    from posekit.validators.body import Body
    from posekit.validators.check import Check
    from posekit.validators.collision import Collision
    from posekit.validators.joint_range import JointRange

    lower, upper = figure.limits.lower, figure.limits.upper
    checks: list[Check] = [Collision()] if ranges == "urdf" else [JointRange(), Collision()]
    settings, slack = ValidateSettings(ranges=ranges), replace(EXACT, angle=0.0)
    kept: list[Array] = []
    found = drawn = 0
    while found < n:
        rate = max(found / drawn, 0.1) if drawn else 1.0
        count = int((n - found) / rate * 1.1) + 16
        q = np.tile(figure.neutral, (count, 1))
        q[:, figure.angle_index] = rng.uniform(lower, upper, (count, len(lower)))
        points = figure.forward_kinematics(q)
        joints, head = points[:, : len(JOINTS)], points[:, len(JOINTS) :]
        body = Body(joints=joints, head=head, base=figure, settings=settings, tolerance=slack, motion=False)
        broken = [check.judge(body).violated.any(axis=1) for check in checks]
        kept.append(q[~np.any(broken, axis=0)])
        found += len(kept[-1])
        drawn += count
        if found < MIN_ACCEPTED * drawn and drawn > 10 / MIN_ACCEPTED:
            got = f"{found} of {drawn} random postures legal and free of collision"
            remedy = "widen the limits or thin the capsules"
            raise refusal("", "ranges", got, f"more than {MIN_ACCEPTED:g} of them", remedy)
    return np.concatenate(kept)[:n]


def random_views(
    n: int,
    rng: np.random.Generator,
    *,
    figure: Figure | None = None,
    camera: PinholeCamera | None = None,
    distance: tuple[float, float] = DISTANCE_RANGE,
    ranges: str = "anatomical",
) -> View:
    """Draw random valid postures, each projected by its own random camera; successive frames are unrelated.

    Parameters
    ----------
    n : int
        Number of postures.
    rng : Generator
        Random number generator; the same seed gives the same views.
    figure : Figure, optional
        The person; the built-in figure if not given.
    camera, distance
        See `place_cameras`.
    ranges : str
        See `random_postures`.

    Raises
    ------
    InputError
        See `random_postures` and `place_cameras`.
    """
    figure, camera = figure or load_figure(), camera or default_camera()
    points = figure.forward_kinematics(random_postures(figure, n, rng, ranges))
    R, position = place_cameras(points, UP_RANDOM, rng, camera=camera, distance=distance)
    return view_of(figure, camera, to_camera(points, R, position))


def mocap_view(
    motion: Motion,
    rng: np.random.Generator,
    *,
    clip: str = "",
    frames: int | None = None,
    dt: float | None = None,
    position: ArrayLike | None = None,
    camera: PinholeCamera | None = None,
    distance: tuple[float, float] = DISTANCE_RANGE,
) -> View:
    """Project one clip by one static camera; the view has the person's median segment lengths in these frames.

    Parameters
    ----------
    motion : Motion
        Motion capture with joint positions and a known up axis.
    rng : Generator
        Random number generator for the camera position if `position` is not given.
    clip : str
        Name of the clip; by default the first clip.
    frames : int, optional
        Number of frames, chosen among frames with a known neck: every `dt` from the first frame, or evenly over the
        clip without `dt`. By default, and if the clip has fewer frames, all frames are used.
    dt : float, optional
        Seconds between frames, rounded to a whole number of the clip's frames.
    position : array (3,), optional
        Optical centre in the motion's world, metres; the camera looks at the middle of the person's path.
    camera, distance
        See `place_cameras`.

    Raises
    ------
    InputError
        If the clip does not exist or has no frame, the up axis is unknown, or the person does not fit into the picture.
    FigureError
        If no rigid torso or hips have distances near the person's medians.
    """
    camera, up = camera or default_camera(), motion.up_vector
    if up is None:
        raise refusal(motion.source or "motion", "up", "no axis", "+x to -z", "give it with --up")
    index = _clip_index(motion, clip)
    rows = _spread(motion, _frames_of(motion, index, JOINTS[:1]), frames, dt)
    points = motion.points(POINTS)[rows]
    path = points.reshape(1, -1, 3)
    if position is None:
        R, centre = (each[0] for each in place_cameras(path, up, rng, camera=camera, distance=distance))
    else:
        centre = np.asarray(position, dtype=np.float64)
        if centre.shape != (3,) or not np.isfinite(centre).all():
            raise refusal("", "camera", shown(centre.tolist()), "three finite numbers, metres")
        R = look_at(centre, middle_of(path)[0], up)
        if not in_picture(camera, to_camera(path, R, centre))[0]:
            got = f"{shown(centre.tolist())}, from which the person leaves the picture"
            remedy = "move the camera away, reduce the focal length or take fewer frames"
            raise refusal("", "camera", got, "the whole path in view", remedy)
    person = scaled_to(points)
    view = view_of(person, camera, to_camera(points, R, centre), time=_seconds(motion, rows))
    return replace(view, camera=replace(camera, R=R, t=-R @ centre, up=motion.up))


def mocap_views(
    motion: Motion,
    n: int,
    rng: np.random.Generator,
    *,
    camera: PinholeCamera | None = None,
    distance: tuple[float, float] = DISTANCE_RANGE,
) -> tuple[View, ...]:
    """Choose n frames evenly over all clips, project each by its own random camera; return one view per clip.

    Parameters
    ----------
    motion : Motion
        Motion capture of one or several clips, with a known up axis.
    n : int
        Number of frames with all 14 joints. Equally many frames are chosen in each clip; of a shorter clip, all frames
        are used.
    rng : Generator
        Random number generator for the camera positions.
    camera, distance
        See `place_cameras`. The view of a clip has the person's median segment lengths in this clip.

    Raises
    ------
    InputError, FigureError
        See `mocap_view`.
    """
    camera, up = camera or default_camera(), motion.up_vector
    clips = [_frames_of(motion, int(index), JOINTS) for index in np.unique(np.asarray(motion.clip))]
    available = sum(map(len, clips))
    if up is None or not 1 <= n <= available:
        expected = f"1 to {available} frames with all joints and a known up axis"
        got = f"{n} frames, up {motion.up!r}"
        raise refusal(motion.source or "motion", "", got, expected, "ask for fewer, or give --up")
    views = []
    points = motion.points(POINTS)
    for frames, share in zip(clips, _shares(n, [len(frames) for frames in clips]), strict=True):
        if share:
            rows = _spread(motion, frames, share, None)
            R, position = place_cameras(points[rows], up, rng, camera=camera, distance=distance)
            seen = to_camera(points[rows], R, position)
            view = view_of(scaled_to(points[frames]), camera, seen, time=_seconds(motion, rows))
            clip = int(np.asarray(motion.clip)[rows[0]])
            views.append(replace(view, source=(*motion.clips, motion.source)[min(clip, len(motion.clips))]))
    return tuple(views)


def _clip_index(motion: Motion, name: str) -> int:
    if name and name not in motion.clips:
        expected = f"one of its {len(motion.clips)} clips"
        raise refusal(motion.source or "motion", "clip", shown(name), expected, nearest(name, motion.clips))
    return list(motion.clips).index(name) if name else int(np.asarray(motion.clip)[0])


def _frames_of(motion: Motion, clip: int, names: Sequence[str]) -> Ints:
    """Return the frames of a clip (row indices of `motion`) in which the named joints are known."""
    known = np.isfinite(motion.points(names)).all(axis=(1, 2)) & (motion.clip == clip)
    return np.flatnonzero(known)


def _seconds(motion: Motion, rows: Ints) -> Array:
    """Return the times (F,) of frames, seconds; frame numbers if the motion has no times."""
    time, frame = np.asarray(motion.time)[rows], np.asarray(motion.frame)[rows]
    return np.asarray(time if np.isfinite(time).all() else frame, dtype=np.float64)


def _spread(motion: Motion, known: Ints, frames: int | None, dt: float | None) -> Ints:
    """Choose frames of a clip: every `dt` seconds from the first frame, or evenly from the first to the last frame."""
    if len(known) == 0:
        raise refusal(motion.source or "motion", "clip", "no frame with a neck", "one", "choose another clip")
    if (frames is not None and frames < 1) or (dt is not None and not 0 < dt < np.inf):
        raise refusal("", "frames", f"{frames} frames, dt {dt} s", "1 or more, dt above 0", "correct them")
    if dt is not None:
        order, clip = np.asarray(motion.frame)[known], np.asarray(motion.clip)
        rate = motion.take(clip == clip[known[0]]).rate or 1.0
        stride = max(1, round(dt * rate))
        return np.asarray(known[(order - order[0]) % stride == 0][:frames])
    if frames is None or frames >= len(known):
        return known
    return np.asarray(known[np.round(np.linspace(0, len(known) - 1, frames)).astype(np.intp)])


def _shares(n: int, available: Sequence[int]) -> list[int]:
    """Distribute n frames evenly over clips; each clip gets at most the number of its `available` frames."""
    shares, left = [0] * len(available), n
    while left > 0:
        open_clips = [k for k, have in enumerate(available) if shares[k] < have]
        each, rest = divmod(left, len(open_clips))
        for place, k in enumerate(open_clips):
            take = min(each + (place < rest), available[k] - shares[k])
            shares[k] += take
            left -= take
    return shares
