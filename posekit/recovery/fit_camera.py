"""From a view's camera and head to what the tree needs: a camera, the neck, and the head's points, per frame."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, LengthUncertainty
from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera, lee_chen
from posekit.compiled.compiling import n_threads
from posekit.display.short_repr import ShortRepr
from posekit.errors import HeadError, InputError
from posekit.formats.own import Family, LeeChenModel, OpenCVModel, ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.recovery.observed import neckless, why_neckless
from posekit.recovery.rooting import place_roots
from posekit.settings import Rooting, Tolerance
from posekit.skeleton import HEAD, HEAD_POINTS

if TYPE_CHECKING:
    from posekit.cameras.head import HeadPose
    from posekit.cameras.neck import NeckPlacement

ENOUGH_POINTS = 1 + len(HEAD_POINTS)
"""Points of the head that tell its camera (Lee & Chen 1985, §2.1): neck, nose, eyes and ears, or others for them."""

ROOT_WARNED, ROOT_REFUSED = 0.005, 0.2
"""Metres that a given root may lie beside the neck's ray before it is warned of, and refused."""


@dataclass(frozen=True, kw_only=True)
class CameraFit(ShortRepr):
    """The camera of F frames, and where it sees the root and the head, in H hypotheses.

    A calibrated frame is one hypothesis, or as many as depths were taken for its neck; an uncalibrated one as many as
    scales were.

    Parameters
    ----------
    camera : PinholeCamera or ScaledOrthographicCamera
        Its first axis, where it has one, counts hypotheses.
    frame : int array (H,)
        The frame of each hypothesis, in order.
    root : array (H, 3)
        The tree's root, camera frame, metres; NaN where it is not known.
    head : array (H, 5, 3)
        The head's points; NaN where the head was not seen.
    pose : HeadPose or None
        The recovered head, where there was one to see.
    reasons : list of str
        For each frame why its root is not known, or an empty text.
    families : list of Family, optional
        For each uncalibrated frame the scales that it can have; None where the reason says why.
    placements : list of NeckPlacement or None, optional
        For each calibrated frame how its neck was placed; None where it was given or six head points told.
    closed : bool
        Whether scales were fitted to close the rigid parts.
    """

    camera: PinholeCamera | ScaledOrthographicCamera
    frame: NDArray[np.intp]
    root: Array
    head: Array
    pose: HeadPose | None
    reasons: list[str]
    families: list[Family | None] | None = None
    placements: list[NeckPlacement | None] | None = None
    closed: bool = False

    def cameras(self, part: NDArray[np.intp]) -> Camera:
        """Return the camera of some hypotheses."""
        if isinstance(self.camera, ScaledOrthographicCamera):
            return ScaledOrthographicCamera(
                scale=np.asarray(self.camera.scale)[part], aspect=self.camera.aspect
            )
        K = self.camera.K
        if K.ndim == 2:
            return self.camera
        return PinholeCamera(K=K[self.frame[part]], distortion=self.camera.distortion)


def fit_camera(
    view: View,
    figure: Figure,
    rooting: Rooting | None = None,
    tolerance: Tolerance | None = None,
    uncertainty: LengthUncertainty | None = None,
) -> CameraFit:
    """Find the camera from the head (§2.1), or the head from a known camera.

    A root that the view gives comes before the head's neck; the head then turns with the recovered rotation
    about that root. Where neither tells it, and the camera is known, the neck is placed (`posekit.cameras.neck`).
    Frames that do not show the neck are as if they were not there, but for their reason.

    Parameters
    ----------
    view : View
        Of a calibrated camera, or of one that the head tells.
    figure : Figure
        The person's.
    rooting : Rooting, optional
        How to place the neck; a method other than ``auto`` is used even where six head points are seen.
    tolerance : Tolerance, optional
        What may be off, where it is not to be derived from the deviation of the image points.
    uncertainty : LengthUncertainty, optional
        How well the figure's lengths are known; exactly if not given.

    Raises
    ------
    InputError
        Where the camera's model cannot be used, or no frame's neck can be found.
    """
    n = len(view.time)
    shown = ~neckless(view)
    image = np.concatenate([view.image[:, :1], view.head_image, view.own_head_image], axis=1)
    image[~shown] = np.nan
    seen = np.isfinite(image).all(axis=-1).sum(axis=1) >= ENOUGH_POINTS
    rooting = rooting or Rooting()
    # A neck that was put between the shoulders is no point of the head. Where all necks are given, it is only turned.
    trusted = rooting.trust_head or np.isfinite(view.root[shown]).all()
    if "neck" in view.derived or rooting.method != "auto" or not trusted:
        seen[:] = False
    model = view.camera
    camera, pose = _head_pose(view, figure, image, worth=bool(seen.any()))
    root = np.where(shown[:, None], view.root, np.nan)
    head = np.full((n, len(HEAD), 3), np.nan)
    reasons = [""] * n
    for k in np.flatnonzero(~shown).tolist():
        reasons[k] = f"frames[{k}]: {why_neckless(view.image[k], view.derived)[0]}"
    if pose is not None:
        neck = pose.point("neck")
        unknown = np.isnan(root).any(axis=1)
        root[unknown] = neck[unknown]
        head = figure.head_points[1:] @ np.swapaxes(pose.R_cam_head, -1, -2) + root[:, None]
    if isinstance(model, LeeChenModel) and model.f is None and pose is not None:
        root[~pose.found] = (
            np.nan
        )  # a given root is of no use where f, which the head would tell, is not known
    _check_root(np.where(np.isnan(root), np.nan, view.root), view, camera)
    if isinstance(model, LeeChenModel) and model.f is None:
        placements = _unplaced(root, pose, reasons)
    else:
        for k in np.flatnonzero(seen & np.isnan(root).any(axis=1)).tolist():
            reasons[k] = f"frames[{k}]: {pose.reasons[k] if pose is not None else ''}"

        def places(frames: NDArray[np.intp]) -> list[NeckPlacement]:
            return place_roots(view, camera, figure, frames, rooting, tolerance, uncertainty)

        placements = _placed(view, root, places, reasons)
    if not any(placements):
        return CameraFit(camera=camera, frame=np.arange(n), root=root, head=head, pose=pose, reasons=reasons)
    necks = [root[k : k + 1] if one is None or reasons[k] else one.necks for k, one in enumerate(placements)]
    frame = np.repeat(np.arange(n), [len(each) for each in necks])
    return CameraFit(
        camera=camera,
        frame=frame,
        root=np.concatenate(necks),
        head=head[frame],
        pose=pose,
        reasons=reasons,
        placements=placements,
    )


def _head_pose(
    view: View, figure: Figure, image: Array, *, worth: bool
) -> tuple[PinholeCamera, HeadPose | None]:
    """Find the camera, and where it sees the head (F, 6 + K, 2) where that is worth it or tells the focal length."""
    model = view.camera
    if isinstance(model, ScaledOrthographicModel):
        raise InputError("camera.model is scaled-orthographic, which has no head to fit; use fit_scale")
    unknown = isinstance(model, LeeChenModel) and model.f is None
    pose: HeadPose | None = None
    if worth or unknown or view.head_points:
        from posekit.cameras.head import HeadPoints, calibrate, solve_pose

        given = dict(view.head_points or {})
        names = ("neck", *HEAD_POINTS)
        # The figure's points count from its neck, the view's from where they were measured.
        origin = np.asarray(given.get("neck", np.zeros(3)))
        every = {name: origin + at for name, at in zip(names, figure.head_points, strict=True)} | given
        # Points that nobody measured nor sees are no part of this head: one of its own may lie there.
        used = [
            k
            for k, name in enumerate(every)
            if name in given or len(given) < ENOUGH_POINTS or np.isfinite(image[:, k, 0]).any()
        ]
        image = image[:, used]
        points = HeadPoints.from_mapping({name: every[name] for k, name in enumerate(every) if k in used})
        if isinstance(model, LeeChenModel) and (worth or unknown):
            pose = calibrate(points, image, f=model.f, threads=n_threads())
        elif isinstance(model, OpenCVModel) and worth:
            camera = PinholeCamera(K=model.K, distortion=model.distortion)
            return camera, solve_pose(points, image, camera, threads=n_threads())
    if isinstance(model, OpenCVModel):
        return PinholeCamera(K=model.K, distortion=model.distortion), None
    return lee_chen.pinhole(_recovered_f(pose) if model.f is None else model.f), pose


def _unplaced(root: Array, pose: HeadPose | None, reasons: list[str]) -> list[NeckPlacement | None]:
    """Say of frames without a neck why: where the head that would tell f is not seen, nothing can be placed."""
    asked = [k for k, reason in enumerate(reasons) if not reason]
    for k in asked:
        if np.isnan(root[k]).any():
            why = (pose and pose.reasons[k]) or "its head is not seen, and so its camera is not known"
            reasons[k] = f"frames[{k}]: {why}"
    if all(reasons):
        raise HeadError(
            f"{reasons[asked[0]]}; give six head points in head_image (with the neck in image), or f and root"
        )
    return [None] * len(reasons)


def _placed(
    view: View, root: Array, places: Callable[[NDArray[np.intp]], list[NeckPlacement]], reasons: list[str]
) -> list[NeckPlacement | None]:
    """Place the necks that are not known by now, and say of the others that they need not be."""
    placements: list[NeckPlacement | None] = [None] * len(reasons)
    without = np.asarray(np.isnan(root).any(axis=1))
    unknown = np.flatnonzero(without & np.array([not reason for reason in reasons]))
    found = places(unknown) if len(unknown) else []
    for k, placement in zip(unknown.tolist(), found, strict=True):
        placements[k] = placement
        if not len(placement.necks):
            reasons[k] = f"frames[{k}]: {placement.reason}"
    if all(reasons):
        first = reasons[int(np.argmax(~neckless(view)))]
        raise InputError(
            f"{first}; lengths, camera or image points may be wrong, as no frame's neck fits them: correct them, "
            "or give root"
        )
    return placements


def _check_root(root: Array, view: View, camera: PinholeCamera) -> None:
    """Refuse given roots that are behind the camera or far from the neck's ray, and warn of those beside it."""
    given = np.isfinite(root).all(axis=1)
    if not given.any():
        return
    behind = np.flatnonzero(given & (root[:, 2] <= 0))
    if len(behind):
        k = int(behind[0])
        raise InputError(
            f"frames[{k}].root: {root[k].tolist()} m is behind the camera; expected z > 0: x right, y down, "
            "z forward"
        )
    rays = camera.normalize(view.image[:, 0])
    rays = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    along = np.einsum("fi,fi->f", root, rays)
    beside = np.where(given, np.linalg.norm(root - along[:, None] * rays, axis=1), 0.0)
    k = int(np.nanargmax(beside))
    if beside[k] > ROOT_REFUSED:
        raise InputError(
            f"frames[{k}].root: {root[k].tolist()} m is {beside[k]:.3g} m beside the ray on which the neck is seen; "
            "expected the neck, in the view's unit, OpenCV camera frame; correct it, or leave it out where a head "
            "is seen"
        )
    noise = (
        0.0 if view.deviation is None else 3 * view.deviation * root[k, 2] / float(camera.K[..., 0, 0].min())
    )
    if beside[k] > max(ROOT_WARNED, noise):
        warnings.warn(
            f"frames[{k}].root is {beside[k] * 100:.2g} cm beside the ray on which the neck is seen; "
            "the postures start from it as it is given",
            UserWarning,
            stacklevel=4,
        )


def _recovered_f(pose: HeadPose | None) -> Array:
    """Return f of each frame; 1 m, in frames that are not grown, where the head gave none."""
    if pose is None:
        raise HeadError("camera.f is null and no head is seen; give f, or six head points in head_image")
    return np.where(pose.found, pose.f, 1.0)
