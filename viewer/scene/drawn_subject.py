"""What is to be drawn, frame by frame, whatever kind of file it came from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, load_figure, with_head
from posekit.body.measured import figure_of, measured_person
from posekit.errors import FigureError, ViewerError
from posekit.formats.held_postures import HeldPostures
from posekit.formats.motion.motion_axes import up_rotation
from posekit.formats.own import CameraModel, Inferred, OpenCVModel, Postures, Result, ResultFrame, View
from posekit.formats.own.frame_answer import FrameAnswer
from posekit.geometry import Array
from posekit.skeleton import JOINTS
from posekit.viewer.scene.image_sight import ImageSight
from posekit.viewer.scene.sight_of_view import check_camera, scale_of, sight_of, view_sight

MAX_ROUNDING_ERROR = 1e-2
"""How far a quaternion's length may be off in a file of few digits; of one that is off by more q is calculated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """The postures of one frame.

    Parameters
    ----------
    points : array (N, 19, 3)
        Joints and head, OpenCV camera frame, metres; NaN where unknown.
    q : array (N, nq), optional
        Their configurations.
    groups : int array (N,), optional
        The group that each is of, counted from 0.
    reasons : sequence of N str
        Why each was rejected; empty texts for those that were not.
    sight : ImageSight, optional
        What the camera sees in this frame; of an uncalibrated one, at the first posture's scale.
    scales : array (N,), optional
        The scale of each posture behind an uncalibrated view, pixels a metre.
    inferred : sequence of N mappings
        By joint that was not seen, where it can be; empty where all were seen.
    probability : array (N,), optional
        That each is the one nearest to the truth.
    time : float
        Seconds.
    answer : FrameAnswer, optional
        What is said of the frame first, of all its postures.
    caption : str
        What is written into the picture.
    """

    points: Array
    q: Array | None = None
    groups: NDArray[np.int64] | None = None
    reasons: Sequence[str] = ()
    sight: ImageSight | None = None
    scales: Array | None = None
    inferred: Sequence[Mapping[str, Inferred]] = ()
    probability: Array | None = None
    time: float = 0.0
    answer: FrameAnswer | None = None
    caption: str = ""

    def __len__(self) -> int:
        """Count the postures."""
        return len(self.points)

    @property
    def alignment(self) -> Array:
        """Moves (N, 3), camera frame, metres, that bring postures of several scales to one place.

        An uncalibrated image says where a body is for each scale, as far from the image's corner as the scale
        is small. That corner means nothing: postures keep the place of the first, by the middle of their image.
        """
        moves = np.zeros((len(self), 3))
        if self.scales is not None and self.sight is not None and len(self):
            moves[:, :2] = self.sight.middle * (1 / self.scales[0] - 1 / self.scales[:, None])
        return moves

    @property
    def aligned_points(self) -> Array:
        """The points (N, 19, 3) where they are drawn, camera frame, metres."""
        return np.asarray(self.points + self.alignment[:, None])

    def chosen(self, rows: Sequence[int]) -> Shown:
        """Return the frame with some of its postures."""
        index = np.array(rows, dtype=np.intp)
        sight, scales = self.sight, None if self.scales is None else self.scales[index]
        if sight is not None and scales is not None and len(scales):
            sight = sight.rescaled(float(scales[0]))
        return replace(
            self,
            points=self.points[index],
            q=None if self.q is None else self.q[index],
            groups=None if self.groups is None else self.groups[index],
            reasons=[self.reasons[row] for row in rows] if self.reasons else (),
            sight=sight,
            scales=scales,
            inferred=[self.inferred[row] for row in rows] if self.inferred else (),
            probability=None if self.probability is None else self.probability[index],
            answer=None,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnSubject:
    """All frames, and whose figure it is.

    Parameters
    ----------
    figure : Figure
        Whose capsules are drawn.
    frames : sequence of Shown
        What is drawn of each frame.
    R_cam_world : array (3, 3), optional
        The view's rotation from a world whose z is up.
    """

    figure: Figure
    frames: Sequence[Shown]
    R_cam_world: Array | None = None

    def points(self, frames: Sequence[int] | None = None) -> Array:
        """Return all points of some frames (M, 3)."""
        chosen = self.frames if frames is None else [self.frames[k] for k in frames]
        return np.concatenate([frame.aligned_points.reshape(-1, 3) for frame in chosen])


def subject_of(given: Result | Postures | HeldPostures | View, view: View | None = None) -> DrawnSubject:
    """Gather what is to be drawn.

    Parameters
    ----------
    given : Result, Postures, HeldPostures or View
        The survivors; or postures, all in one frame or each in its own; or a view: its truth, and what its camera sees.
    view : View, optional
        What the result was recovered from: it gives the camera and the person's lengths.

    Raises
    ------
    ViewerError
        Where there is no posture, or the view has other frames or another camera than the result.
    """
    if isinstance(given, View):
        return _of_view(given)
    if isinstance(given, HeldPostures):
        figure, frames = _figure_measured(given.postures), _of_held(given)
    elif isinstance(given, Postures):
        figure, frames = _figure_measured(given), [_of_postures(given)]
    else:
        if view is not None and len(view) != len(given.frames):
            raise ViewerError(
                f"the view has {len(view)} frames, the result {len(given.frames)}; give the view that it was "
                "recovered from"
            )
        if view is not None:
            check_camera(given, view)
        figure = _figure_of(given)
        frames = [_of_frame(frame, figure, view, k, given.camera) for k, frame in enumerate(given.frames)]
    if not any(len(frame) for frame in frames):
        raise ViewerError("there is no posture in any frame; nothing can be drawn; was everything rejected?")
    held = given.camera if isinstance(given, Result) else None
    camera = held if view is None else view.camera
    return DrawnSubject(figure=figure, frames=frames, R_cam_world=_rotation(camera))


def _of_postures(given: Postures) -> Shown:
    joints = np.asarray(given.joints)
    points = with_head(joints) if given.head is None else np.concatenate([joints, given.head], axis=1)
    return Shown(points=points)


def _of_held(given: HeldPostures) -> list[Shown]:
    """Put postures into their frames, up against the camera frame's y where the file says what is up."""
    points = _of_postures(given.postures).points
    if given.up:
        points = points @ up_rotation(given.up, "-y").T
    rows = [np.flatnonzero(given.frame == k) for k in range(int(given.frame.max(initial=-1)) + 1)]
    return [
        Shown(points=points[row], time=float(given.time[row[0]]) if len(row) else float("nan"))
        for row in rows
    ]


def _configurations(frame: ResultFrame, figure: Figure, points: Array) -> Array:
    """Return q of a frame's postures (N, nq), with quaternions of unit length, calculated where the file has none.

    Where noise is known a file has q of the likeliest alone, with few digits.
    """
    q = np.array(frame.q, dtype=np.float64)
    norms = np.linalg.norm(q[:, 3:7], axis=1)
    rounded = np.abs(norms - 1) < MAX_ROUNDING_ERROR
    q[rounded, 3:7] /= norms[rounded, None]
    if not rounded.all():
        q[~rounded] = figure.inverse_kinematics(points[~rounded])
    return q


def _of_frame(
    frame: ResultFrame, figure: Figure, view: View | None, index: int, camera: OpenCVModel | None
) -> Shown:
    points = with_head(np.asarray(frame.joints)).copy()
    q = _configurations(frame, figure, points) if frame.q.shape[1] == figure.model.nq else None
    if q is not None and len(q):
        placed = np.asarray(np.isfinite(q[:, :7]).all(axis=1))
        if placed.any():
            # A result has no head points; they hang on the torso alone, by the neck's angles in q.
            head = figure.forward_kinematics(np.where(np.isnan(q[placed]), 0.0, q[placed]))[:, len(JOINTS) :]
            points[placed, len(JOINTS) :] = head
    return Shown(
        points=points,
        q=q,
        groups=frame.groups,
        sight=sight_of(frame, view, index, camera),
        scales=frame.scales,
        inferred=frame.inferred or (),
        probability=frame.probability,
        time=frame.time,
        answer=frame.answer,
    )


def check_one_scale(shown: Shown) -> None:
    """Refuse to look through the view's camera at postures of several scales: one picture shows those of one.

    Raises
    ------
    ViewerError
        Where there are several; it names some postures of one scale.
    """
    if shown.scales is None or len(np.unique(shown.scales)) < 2:
        return
    same = np.flatnonzero(shown.scales == shown.scales[0])[:9]
    raise ViewerError(
        f"the postures at {shown.time:g} s have {len(np.unique(shown.scales))} scales; expected one to look through "
        f"the view's camera; choose some of one scale, as --posture {','.join(map(str, same.tolist()))}"
    )


def _of_view(view: View) -> DrawnSubject:
    points = with_head(np.asarray(view.truth)).copy()
    unseen = np.isnan(points[:, 0]).any(axis=1)
    points[unseen, 0] = view.root[unseen]
    frames = []
    for k in range(len(view)):
        image = np.concatenate([view.image[k], view.head_image[k]])
        known = np.isfinite(points[k, : len(JOINTS)]).any()
        frames.append(
            Shown(
                points=points[k : k + 1] if known else points[:0],
                sight=view_sight(view, image, None, scale_of(points[k, : len(JOINTS)], view, k)),
                time=float(view.time[k]),
            )
        )
    if not any(len(frame) for frame in frames):
        raise ViewerError(
            "the view holds no posture (neither truth nor root); recover it first and draw the result: "
            "posekit recover VIEW -o RESULT"
        )
    figure = load_figure()
    figure = figure if view.stature is None else figure.from_stature(view.stature)
    return DrawnSubject(figure=figure.scaled(view.lengths), frames=frames, R_cam_world=_rotation(view.camera))


def _figure_measured(given: Postures) -> Figure:
    """Return the built-in figure with the lengths that the postures have in the median."""
    person = measured_person(np.asarray(given.joints))
    return figure_of(load_figure(), person.lengths, person.behind)


def _figure_of(result: Result) -> Figure:
    """Return the built-in figure with the result's lengths; capsules and head grow with them."""
    lengths = result.settings.get("lengths")
    if not isinstance(lengths, dict):
        return load_figure()
    try:
        return load_figure().scaled(lengths)
    except (FigureError, TypeError) as error:
        raise ViewerError(f"settings.lengths of the result: {error}") from None


def _rotation(camera: CameraModel | None) -> Array | None:
    if not isinstance(camera, OpenCVModel) or camera.R is None:
        return None
    return camera.R @ up_rotation(camera.up, "+z").T if camera.up else camera.R
