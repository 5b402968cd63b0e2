"""The camera of an uncalibrated picture: the scales it can have, and the root at each (Taylor 2000, section 2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError, PosekitError
from posekit.formats.own import PER_METRE, Family, ScaledOrthographicModel, Unit, View
from posekit.geometry import Array
from posekit.linkages import LinkageFamily as Solutions
from posekit.linkages import Minima, search
from posekit.recovery.body import LiftedBody
from posekit.recovery.fit_camera import CameraFit
from posekit.recovery.likely_scale import likely_scales
from posekit.settings import EXACT_TOLERANCE, PHOTOGRAPH_TOLERANCE, Tolerance
from posekit.settings.scale import Scale, way_of
from posekit.skeleton import HEAD, JOINT

RELATIVE_ROUNDING = 1e-9
"""Of the bound: a scale that is below it by so little is at it."""


def fit_scale(
    view: View,
    body: LiftedBody,
    scale: Scale | None,
    tolerance: Tolerance | None,
    *,
    reasons: Sequence[str] = (),
    refuse: bool = True,
) -> CameraFit:
    """Find the scales that each frame is to be recovered at, and put the root at depth zero.

    Parameters
    ----------
    view : View
        Of a scaled orthographic camera.
    body : Body
        What the points are lifted into: its lengths bound the scale.
    scale : Scale or None
        How to find s; None takes the view's own, or else the least.
    tolerance : Tolerance or None
        By how much segments may be too short for their image at a scale that was measured.
    reasons : sequence of str (F,), optional
        Why nothing can be grown in a frame, where that is known by now; else an empty text.
    refuse : bool
        Whether a view in which no frame has a scale is an error.

    Raises
    ------
    InputError
        Where no frame can have such a scale: the segment that is too short, and the scale that it needs.
    """
    model = view.camera
    if not isinstance(model, ScaledOrthographicModel):
        raise InputError("--scale: the view's camera is calibrated; leave the option out")
    seen = view.image * np.array([model.aspect, 1.0])
    root_image = body.image(seen)[:, 0]
    reasons = [f"frames[{k}]: {reason}" if reason else "" for k, reason in enumerate(reasons)] or [""] * len(
        seen
    )
    families: list[Family | None] = []
    for k, points in enumerate(seen):
        if reasons[k]:
            families.append(None)
            continue
        try:
            if np.isnan(root_image[k]).any():
                raise InputError(
                    f"{body.tree.joints[0]}, from which the tree grows, is not seen; add it, or drop the frame"
                )
            families.append(_family(points, body, way_of(model.scale, scale), tolerance, view.unit))
        except PosekitError as error:
            reasons[k] = f"frames[{k}]: {error}"
            families.append(None)
    if refuse and all(reasons):
        raise InputError(reasons[0])
    chosen = [family.chosen if family else np.array([1.0]) for family in families]
    frame = np.repeat(np.arange(len(seen)), [len(scales) for scales in chosen])
    camera = ScaledOrthographicCamera(scale=np.concatenate(chosen), aspect=model.aspect)
    root = np.zeros((len(frame), 3))
    root[:, :2] = root_image[frame] / np.asarray(camera.scale)[:, None]
    return CameraFit(
        camera=camera,
        frame=frame,
        root=root,
        head=np.full((len(frame), len(HEAD), 3), np.nan),
        pose=None,
        reasons=reasons,
        families=families,
        closed=scale is not None and scale.how == "constraints",
    )


def _family(
    seen: Array, body: LiftedBody, choice: tuple[str, Scale], tolerance: Tolerance | None, unit: Unit
) -> Family:
    """Find the scales of one frame from its joints (14, 2), rescaled to square pixels."""
    name, scale = choice
    linkage = body.linkage
    points = seen[[JOINT[point] for point in linkage.points]]
    solutions = Solutions(linkage=linkage, image=points)
    bound, segment = solutions.minimum_scale, solutions.bounding_segment
    if bound == 0:
        raise InputError("all joints are seen at one point, which fixes no scale; correct the image points")
    minima, curve, deviation = np.empty((0, 2)), np.empty((0, 2)), None
    if scale.how == "constraints":
        found = search(solutions, scale.weights)
        minima = np.stack([found.s, found.residual], axis=-1)
        curve = np.stack([found.curve_s, found.curve_residual], axis=-1)
        chosen = _near_enough(found, tolerance) if len(found) else np.array([bound])
        name = name if len(found) else f"min: {name} fixes no scale here"
    elif scale.how == "min":
        chosen = np.array([bound])
    elif scale.how == "likely":
        found_scale = likely_scales(seen[None], body.figure)
        chosen, deviation = found_scale.scale, float(found_scale.deviation[0])
    else:
        s = float(scale.value or 0.0) / (body.stature if scale.how == "stature" else 1.0)
        longest = float(linkage.lengths[solutions.bounding])
        lost = longest * (bound / s - 1)
        if lost > _allowed(name, tolerance) + RELATIVE_ROUNDING * longest:
            per = PER_METRE[unit]
            raise InputError(
                f"--scale: {s / per:.6g} pixels a {unit} is below {bound / per:.6g}, which {segment} needs: it is "
                f"{lost * 100:.3g} cm too short for its image; give at least {bound / per:.6g}, or --scale min, or "
                "a larger --tangent-tolerance"
            )
        chosen = np.array([s])
    return Family(
        how=name,
        bound=bound,
        segment=segment,
        chosen=chosen,
        deviation=deviation,
        minima_s=minima[:, 0],
        minima_residual=minima[:, 1],
        curve_s=curve[:, 0],
        curve_residual=curve[:, 1],
    )


def _near_enough(found: Minima, tolerance: Tolerance | None) -> Array:
    """Choose among the minima: those without a residual, else those within the tolerance, else the best."""
    rigid = (PHOTOGRAPH_TOLERANCE if tolerance is None else tolerance).rigid
    unit = float(found.constraints.family.linkage.lengths.mean())
    residual = found.residual
    best = float(residual[0])
    limit = EXACT_TOLERANCE.rigid if best <= (EXACT_TOLERANCE.rigid / unit) ** 2 else rigid
    return np.unique(found.s[residual <= max(best, (limit / unit) ** 2)])


def _allowed(how: str, tolerance: Tolerance | None) -> float:
    """Return by how much (m) a segment may be too short: nothing at a scale that was given as exact."""
    if tolerance is not None:
        return tolerance.tangent
    return EXACT_TOLERANCE.tangent if how == "value" else PHOTOGRAPH_TOLERANCE.tangent
