"""Which frames show enough of a body for a posture to be recovered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from posekit.files import View
from posekit.pipeline.body import Body
from posekit.pipeline.fit_camera import CameraFit


def trunkless(view: View, body: Body) -> NDArray[np.bool_]:
    """Tell which frames (F,) show none of the joints that hang on the tree's root.

    The root alone is a position and no posture: wrists or knees that are seen beside it have nothing to hang on.
    """
    seen = np.asarray(np.isfinite(body.image(view.image)).all(axis=2))
    return np.asarray(~seen[:, _hanging(body)].any(axis=1))


def with_reasons(fit: CameraFit, body: Body, bare: NDArray[np.bool_]) -> CameraFit:
    """Say of `trunkless` frames why nothing grows in them; those that have a reason by now keep it."""
    if not bare.any():
        return fit
    joints = body.tree.joints
    hanging = ", ".join(joints[k] for k in _hanging(body).tolist())
    says = (
        f"none of {hanging} is seen, so that nothing hangs on the {joints[0]}: there is no posture to recover"
    )
    reasons = [reason or (f"frames[{k}]: {says}" if bare[k] else "") for k, reason in enumerate(fit.reasons)]
    return replace(fit, reasons=reasons)


def _hanging(body: Body) -> NDArray[np.intp]:
    """Return the joints whose parent is the root, which is the first."""
    parents = np.asarray(body.tree.parents)
    return np.flatnonzero((parents == 0) & (np.arange(len(parents)) > 0))
