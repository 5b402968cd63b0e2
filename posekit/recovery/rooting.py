"""Where the neck is put where neither the view nor a head of six points says it, and what a result says of that."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, LengthUncertainty
from posekit.cameras import PinholeCamera
from posekit.formats.own import LeeChenModel, Root, View
from posekit.recovery.noise import FOREARM_METRES
from posekit.settings import Rooting, Tolerance
from posekit.settings.rooting import DETECTED_DEVIATION, DETECTED_OFFSET
from posekit.skeleton import SEGMENTS, segment_name

if TYPE_CHECKING:
    from posekit.cameras.neck import NeckPlacement

DEFAULT_DEVIATION_PIXELS: Final = 2.0
"""Standard deviation (px) of image points of which the view says none, unless a detector saw them."""

IMAGE_PLANE_DEVIATION: Final = 1e-3
"""The same on the image plane of a `lee-chen` camera, as a fraction of f: some 2 pixels of most cameras."""

TOLERANCE_STEP_METRES: Final = 0.02
"""Metres to which tolerances are rounded up, so that frames of nearly the same are grown together."""


def place_roots(
    view: View,
    camera: PinholeCamera,
    figure: Figure,
    frames: NDArray[np.intp],
    rooting: Rooting,
    tolerance: Tolerance | None,
    uncertainty: LengthUncertainty | None = None,
) -> list[NeckPlacement]:
    """Place the neck in some frames of a view (`posekit.cameras.neck.place`).

    A view with derived joints is a detector's, whose points are farther off, of a body that gives. Where lengths as
    they are leave no place, their joints are taken to be off by as much as lengths are.
    """
    from posekit.cameras.neck import place

    detected = bool(view.derived)
    deviation = (
        rooting.deviation or view.deviation or (DETECTED_DEVIATION if detected else DEFAULT_DEVIATION_PIXELS)
    )
    if isinstance(view.camera, LeeChenModel):
        deviation = IMAGE_PLANE_DEVIATION * float(view.camera.f or 1.0)
    K = camera.K if camera.K.ndim == 2 else camera.K[frames]
    offset = DETECTED_OFFSET if detected else 0.0

    def placed(rows: NDArray[np.intp], offset: float) -> list[NeckPlacement]:
        return place(
            PinholeCamera(K=K if K.ndim == 2 else K[rows], distortion=camera.distortion),
            figure,
            view.image[frames[rows]],
            np.concatenate([view.head_image, view.own_head_image], axis=1)[frames[rows]],
            own_head=view.own_head(),
            method=rooting.method,
            deviation=deviation,
            offset=offset,
            tolerance=None if tolerance is None else tolerance.rigid,
            tangent=None if tolerance is None else tolerance.tangent,
        )

    found = placed(np.arange(len(frames)), offset)
    nowhere = np.array([k for k, one in enumerate(found) if not len(one.necks)], dtype=np.intp)
    if len(nowhere) and uncertainty is not None and not uncertainty.exact:
        off = max(
            uncertainty.own[segment_name(pair)] * figure.lengths[segment_name(pair)] for pair in SEGMENTS
        )
        for k, one in zip(nowhere.tolist(), placed(nowhere, math.hypot(offset, off)), strict=True):
            found[k] = one
    return found


def tolerance_of(placement: NeckPlacement) -> Tolerance:
    """Return what a tree that grows from a placed neck is judged with: as far off as its image points let it be."""
    step = TOLERANCE_STEP_METRES
    rigid, tangent = (step * math.ceil(value / step) for value in (placement.tolerance, placement.tangent))
    angle = math.degrees(math.atan2(tangent, FOREARM_METRES))
    return Tolerance(rigid=rigid, tangent=tangent, placement=False, angle=angle)


def root_of(placement: NeckPlacement) -> Root:
    """Say in a result how the neck was found."""
    curve = placement.curve[np.isfinite(placement.curve[:, 1])]
    return Root(
        method=placement.method,
        chosen=placement.depths,
        residual=placement.residual if math.isfinite(placement.residual) else math.nan,
        residual_unit=placement.unit,
        estimate=placement.estimate,
        deviation=placement.deviation,
        lower=placement.lower,
        upper=placement.upper,
        segment=placement.segment,
        intervals=placement.intervals,
        minima_depth=placement.minima[:, 0],
        minima_residual=placement.minima[:, 1],
        curve_depth=curve[:, 0],
        curve_residual=curve[:, 1],
        note="; ".join([*([placement.reason] if placement.reason else []), *placement.notes]),
    )
