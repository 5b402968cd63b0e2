"""`Sight`: the input of the search for postures: image points, their noise, and the position of each frame's neck."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, LengthUncertainty
from posekit.body.lengths import stature_from_lengths
from posekit.cameras import LeeChenCamera, PinholeCamera, ScaledOrthographicCamera, View
from posekit.cameras.head import HeadPoints, HeadPose, solve_pose
from posekit.cameras.lee_chen import camera_position, rotation_to_paper
from posekit.errors import PosekitError, refusal
from posekit.geometry import Array, Record
from posekit.recovery.objects import parse_scale
from posekit.recovery.scales import SCALE_DEVIATIONS, figure_linkage, likely_scale, point_offsets, scales_of
from posekit.settings import RecoverSettings
from posekit.skeleton import HEAD_POINTS, JOINTS

#: Default standard deviation (pixels) of a detector's key points, and of other image points.
KEY_POINT_PIXELS, UNSTATED_PIXELS = 3.0, 1.0

#: Standard deviation (pixels) of image points that may be exact, in frames without a tree because a joint or the neck
#: is unknown.
SHARP_PIXELS: Final = 0.3

#: Standard deviation (metres) between a detector's key points and the figure's joints at full confidence. It is divided
#: by a power of the confidence (fitted on Pose2Sim's recordings).
JOINT_OFFSET, OFFSET_POWER = 0.012, 0.7

#: Default confidence of a detector's point, and smallest confidences used for the offset in metres and for the noise in
#: pixels.
UNSTATED_CONFIDENCE, LEAST_OFFSET_CONFIDENCE, LEAST_CONFIDENCE = 0.5, 0.05, 0.25

#: Largest accepted distance of a given root from the neck's ray, metres.
ROOT_REFUSED: Final = 0.2

#: Number of head points that determine a camera (Lee & Chen 1985, §2.1).
ENOUGH_HEAD_POINTS: Final = 1 + len(HEAD_POINTS)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Sight(Record):
    """Input of the search for postures: one row per frame, or one row for each possible scale of a frame.

    Parameters
    ----------
    camera : PinholeCamera, LeeChenCamera or ScaledOrthographicCamera
        Camera of all rows.
    frame : int array (H,)
        Frame of each row.
    image : array (H, 14, 2)
        Image points.
    deviation : array (H, 14)
        Standard deviation of each coordinate, in the image's unit.
    root : array (H, 3)
        Position of the neck, metres; NaN if unknown.
    given : bool array (H,)
        True if the view states the position of the neck, and this position is used.
    head : array (H, 5, 3)
        Head points, metres; NaN if unknown.
    size_deviation : array (H,)
        Relative standard deviation of the person's size.
    may_be_exact : bool
        True if no deviation is stated and the points do not come from a detector.
    reasons, cameras, roots
        By frame: the reason why no posture can be recovered, facts about the camera, and the method that located the
        neck.
    """

    camera: PinholeCamera | LeeChenCamera | ScaledOrthographicCamera
    frame: NDArray[np.intp]
    image: Array
    deviation: Array
    root: Array
    given: NDArray[np.bool_]
    head: Array
    size_deviation: Array
    may_be_exact: bool
    reasons: list[str]
    cameras: list[dict[str, Any]]
    roots: list[dict[str, Any] | None]

    def take(self, rows: NDArray[np.intp]) -> Sight:
        """Return some rows."""
        taken: dict[str, Any] = {
            name: held[rows] for name, held in vars(self).items() if isinstance(held, np.ndarray)
        }
        return replace(self, camera=self.camera.take(rows), **taken)

    @property
    def scale(self) -> Array:
        """Scales of a scaled orthographic camera (H,), pixels per metre; NaN for other cameras."""
        return np.broadcast_to(getattr(self.camera, "scale", np.nan), len(self.frame))

    @property
    def middle(self) -> Array:
        """Mean normalised image point of the trunk joints in each row (H, 2)."""
        return np.asarray(np.nanmean(self.camera.normalize(self.image)[:, :6], axis=1))


def sight_of(view: View, person: Figure, settings: RecoverSettings, lengths: LengthUncertainty) -> Sight:
    """Return the image points, their noise and the neck of each frame of a view.

    Raises
    ------
    InputError
        If a setting does not apply to this kind of view, or the data of every frame contradict each other.
    """
    if isinstance(view.camera, ScaledOrthographicCamera):
        if settings.root != "auto":
            raise refusal("", "root", settings.root, "no root: the view has no depth", "leave it out")
        return _photograph(view, person, settings, lengths)
    for name, asked in (("scale", settings.scale), ("proportions", settings.proportions)):
        if asked not in (None, "auto", "figure", "people"):
            raise refusal("", name, str(asked), "an uncalibrated view", "leave it out")
    return _calibrated(view, person, settings, lengths)


def _noise_of(view: View, settings: RecoverSettings) -> tuple[float, bool]:
    """Return the standard deviation (pixels) of image points, and whether a view may be treated as exact."""
    usual = KEY_POINT_PIXELS if view.derived else UNSTATED_PIXELS
    stated = (settings.deviation, view.deviation, settings.length_deviation, view.length_deviation)
    return stated[0] or stated[1] or usual, not (view.derived or settings.refine or any(stated))


def _unseen(view: View) -> list[str]:
    """Return the reason why each frame cannot be recovered; empty if it can be recovered."""
    seen = np.isfinite(view.image[:, :, 0])
    trunk = seen[:, 1:4].any(axis=1)
    reasons = {
        "no joint of the person is seen": ~seen.any(axis=1),
        "no posture can be recovered: neither right_shoulder nor left_shoulder nor pelvis is seen": ~trunk,
    }
    return [str(reason) for reason in np.select(list(reasons.values()), list(reasons), "")]


def _calibrated(view: View, person: Figure, settings: RecoverSettings, lengths: LengthUncertainty) -> Sight:
    """Return the `Sight` of a calibrated view; the neck is given, or computed from six head points."""
    count, model, reasons = len(view), view.camera, _unseen(view)
    pixels, may_be_exact = _noise_of(view, settings)
    assert not isinstance(model, ScaledOrthographicCamera)
    camera, pose = _head_pose(view, model, person, settings)
    root, head = view.root.copy(), np.full((count, len(HEAD_POINTS), 3), np.nan)
    if settings.root in ("head", "torso"):
        root[:] = np.nan
    given = np.asarray(np.isfinite(root).all(axis=1))
    if settings.root == "given" and not given.any():
        raise refusal(
            view.source, "root", "no root in the view", "one per frame", "add it, or leave --root out"
        )
    _check_root(root, view, camera)
    roots: list[dict[str, Any] | None] = [None] * count
    if pose is not None:
        neck, unknown = pose.point("neck"), ~given & (settings.root != "torso")
        root[unknown] = neck[unknown]
        head = person.head_points[1:] @ np.swapaxes(pose.R_cam_head, -1, -2) + root[:, None]
        for k in np.flatnonzero(unknown & pose.found).tolist():
            roots[k] = {"method": "head", "estimate": float(neck[k, 2]), "deviation": None}
        if isinstance(model, LeeChenCamera) and model.f is None:
            reasons = [own or of_head for own, of_head in zip(reasons, pose.reasons, strict=True)]
    # Offsets in metres are converted to pixels by the neck's depth or, if it is unknown, by the person's image size.
    depth, unplaced = root[:, 2].copy(), np.flatnonzero(~np.isfinite(root[:, 2]))
    if len(unplaced):
        depth[unplaced] = 1 / likely_scale(camera.normalize(view.image)[unplaced], person)[0]
    middle = np.nan_to_num(camera.normalize(view.image[:, 0]))
    focal = np.sqrt(np.abs(np.linalg.det(camera.jacobian(middle))))
    # On a metric image plane, a pixel is assumed to be a thousandth of the focal length.
    pixel = 1e-3 * focal if isinstance(model, LeeChenCamera) else np.ones(count)
    per_metre = focal / np.where(depth > 0, depth, 3.0)
    own = JOINT_OFFSET if view.derived else 0.0
    confidence = view.confidence[:, : len(JOINTS)]
    sure = np.clip(np.nan_to_num(confidence, nan=UNSTATED_CONFIDENCE), LEAST_OFFSET_CONFIDENCE, 1.0)
    weight = np.clip(np.nan_to_num(confidence, nan=1.0), LEAST_CONFIDENCE, 1.0)
    offset = own * sure**-OFFSET_POWER * per_metre[:, None]
    return Sight(
        camera=camera,
        frame=np.arange(count),
        image=view.image,
        deviation=np.hypot(pixels * pixel[:, None] / np.sqrt(weight), offset),
        root=root,
        given=given,
        head=head,
        size_deviation=np.full(count, lengths.common),
        may_be_exact=may_be_exact,
        reasons=reasons,
        cameras=[_camera_record(view, pose, k) for k in range(count)],
        roots=roots,
    )


def _head_pose(
    view: View, model: PinholeCamera | LeeChenCamera, person: Figure, settings: RecoverSettings
) -> tuple[PinholeCamera | LeeChenCamera, HeadPose | None]:
    """Return the camera of all frames, and the pose of the head in frames that show six head points."""
    image = np.concatenate([view.image[:, :1], view.head_image, view.own_head_image], axis=1)
    enough = np.isfinite(image).all(axis=2).sum(axis=1) >= ENOUGH_HEAD_POINTS
    unknown = isinstance(model, LeeChenCamera) and model.f is None
    # A neck computed from the shoulders is not a point of the head.
    if "neck" in view.derived or settings.root == "torso" or not enough.any():
        if unknown:
            raise refusal(view.source, "camera.f", "null", "six head points in head_image", "give them, or f")
        return model, None
    stated: Mapping[str, Any] = view.head_points or {}
    origin = np.asarray(stated.get("neck", np.zeros(3)))
    own = dict(zip(("neck", *HEAD_POINTS), origin + person.head_points, strict=True))
    points = HeadPoints.from_mapping({**own, **stated})
    image = np.where(enough[:, None, None], image, np.nan)
    pose = solve_pose(points, image, model)
    return (LeeChenCamera(f=np.where(pose.found, pose.f, 1.0)) if unknown else model), pose


def _check_root(root: Array, view: View, camera: PinholeCamera | LeeChenCamera) -> None:
    """Refuse given positions of the neck behind the camera or far from the ray through its image."""
    _, ray = camera.rays(view.image[:, 0])
    beside = np.linalg.norm(root - (root * ray).sum(axis=1, keepdims=True) * ray, axis=1)
    for k in np.flatnonzero((root[:, 2] <= 0) | (beside > ROOT_REFUSED)).tolist():
        got = f"z = {root[k, 2]:g} m, {beside[k]:.3g} m beside the ray on which the neck is seen"
        expected = "the neck, camera frame, z forward"
        raise refusal(view.source, f"frames[{k}].root", got, expected, "correct it, or leave it out")


def _camera_record(view: View, pose: HeadPose | None, k: int) -> dict[str, Any]:
    """Return facts about the camera of frame k; for a `LeeChenCamera`, in the convention of Lee & Chen's Table 2."""
    model = view.camera
    record: dict[str, Any] = {"f": None, "rotation": None, "position": None, "residual": None}
    if isinstance(model, LeeChenCamera) and model.f is not None:
        record["f"] = float(np.broadcast_to(model.f, len(view))[k])
    if pose is not None and not pose.reasons[k]:
        R, t, f = pose.R_cam_head[k], pose.t_cam_head[k], float(pose.f[k])
        record |= {"residual": float(pose.rms[k]), "rotation": R.tolist(), "position": (-R.T @ t).tolist()}
        if isinstance(model, LeeChenCamera):
            rotation, position = rotation_to_paper(R), camera_position(R, t, f)
            record |= {"f": f, "rotation": rotation.tolist(), "position": position.tolist()}
    if isinstance(model, PinholeCamera) and model.R is not None and model.t is not None:
        record |= {"rotation": model.R.tolist(), "position": (-model.R.T @ model.t).tolist()}
    return record


def _photograph(view: View, person: Figure, settings: RecoverSettings, lengths: LengthUncertainty) -> Sight:
    """Return the `Sight` of uncalibrated pictures: one row per frame, or one row per possible scale of the frame."""
    model, reasons = view.camera, _unseen(view)
    pixels, may_be_exact = _noise_of(view, settings)
    assert isinstance(model, ScaledOrthographicCamera)
    square = view.image * np.array([model.aspect, 1.0])
    text = settings.scale or ("likely" if model.scale is None else None)
    how, value, weights = parse_scale(text) if text is not None else ("value", 0.0, {})
    likely, spread = likely_scale(square, person)
    deviation = np.where(how == "likely", spread, SCALE_DEVIATIONS.get(how, lengths.common))
    stature = settings.stature or view.stature or stature_from_lengths(person.lengths)
    own = np.nan if model.scale is None else np.asarray(model.scale)
    stated = {"likely": likely, "value": value or own, "stature": value / stature}.get(how, np.nan)
    of_frame = np.broadcast_to(stated, len(view))
    strict = may_be_exact and how in ("value", "stature")
    rows: list[int] = []
    scales: list[float] = []
    errors: list[PosekitError] = []
    cameras: list[dict[str, Any]] = [{} for _ in reasons]
    linkage = figure_linkage(person)
    for k in [k for k, reason in enumerate(reasons) if not reason]:
        try:
            chosen, cameras[k] = scales_of(square[k], linkage, how, weights, float(of_frame[k]), strict)
        except PosekitError as error:
            reasons[k] = str(error)
            errors.append(error)
            continue
        rows += [k] * len(chosen)
        scales += chosen
    if errors and not rows:
        raise errors[0]
    frame, scale = np.array(rows, dtype=np.intp), np.array(scales)
    confidence = np.clip(np.nan_to_num(view.confidence[frame, : len(JOINTS)], nan=1.0), LEAST_CONFIDENCE, 1.0)
    off = point_offsets(square[frame], scale)
    root = np.zeros((len(frame), 3))
    root[:, :2] = square[frame, 0] / scale[:, None]
    return Sight(
        camera=ScaledOrthographicCamera(scale=scale, aspect=model.aspect),
        frame=frame,
        image=view.image[frame],
        deviation=np.hypot(pixels, scale[:, None] * off) / np.sqrt(confidence),
        root=root,
        given=np.zeros(len(frame), dtype=np.bool_),
        head=np.full((len(frame), len(HEAD_POINTS), 3), np.nan),
        size_deviation=np.hypot(np.broadcast_to(deviation, len(view))[frame], lengths.common),
        may_be_exact=may_be_exact and how != "likely",
        reasons=reasons,
        cameras=cameras,
        roots=[None] * len(view),
    )
