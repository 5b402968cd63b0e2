"""Which frames show enough of a body for a posture to be recovered."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own import ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.recovery.body import LiftedBody
from posekit.skeleton import JOINT

NO_NECK: Final = "the neck, from which the tree grows, is not seen"
"""Why nothing grows in a calibrated frame that does not show the neck."""

NO_PERSON: Final = "the person is not seen: none of the joints is"
"""Why nothing grows in a frame that does not show the person at all."""

PERSON_LOST, NECK_LOST = "person/not_seen", "neck/not_seen"
TRUNK_LOST, ROOT_LOST = "trunk/not_seen", "root/not_known"
"""What all leaves of a frame are lost to in which nothing grows."""


SHOULDER_JOINTS: Final = ("right_shoulder", "left_shoulder")
"""Joints between which a detector's neck is."""


def neckless(view: View) -> NDArray[np.bool_]:
    """Tell which frames (F,) of a calibrated view do not show the neck; none of an uncalibrated one.

    There another joint may be the root, and the scale is what says why a frame has none (`fit_scale`).
    """
    if isinstance(view.camera, ScaledOrthographicModel):
        return np.zeros(len(view), dtype=np.bool_)
    return np.asarray(np.isnan(view.image[:, 0, 0]))


def why_neckless(image: Array, derived: Collection[str]) -> tuple[str, str]:
    """Say why nothing grows in a calibrated frame without a neck, and in two words what its leaves are lost to.

    Parameters
    ----------
    image : array (14, 2)
        Joints of the frame, NaN where not seen.
    derived : collection of str
        Joints of the view that were put between others: a neck between the shoulders.
    """
    seen = np.isfinite(image[:, 0])
    if not seen.any():
        return NO_PERSON, PERSON_LOST
    lacking = [name for name in SHOULDER_JOINTS if not seen[JOINT[name]]]
    if "neck" not in derived or not lacking:
        return NO_NECK, NECK_LOST
    names = f"{lacking[0]} is" if len(lacking) == 1 else f"{' and '.join(lacking)} are"
    return f"{names} not seen, and the neck, from which the tree grows, is between the shoulders", NECK_LOST


def trunkless(view: View, body: LiftedBody) -> NDArray[np.bool_]:
    """Tell which frames (F,) show none of the joints that hang on the tree's root.

    The root alone is a position and no posture: wrists or knees that are seen beside it have nothing to hang on.
    """
    seen = np.asarray(np.isfinite(body.image(view.image)).all(axis=2))
    return np.asarray(~seen[:, _hanging(body)].any(axis=1))


def with_reasons(reasons: Sequence[str], body: LiftedBody, bare: NDArray[np.bool_]) -> list[str]:
    """Say of `trunkless` frames why nothing grows in them; those that have a reason by now keep it."""
    joints = body.tree.joints
    hanging = ", ".join(joints[k] for k in _hanging(body).tolist())
    says = (
        f"none of {hanging} is seen, so that nothing hangs on the {joints[0]}: there is no posture to recover"
    )
    return [reason or (f"frames[{k}]: {says}" if bare[k] else "") for k, reason in enumerate(reasons)]


def lost_to(view: View, frame: int, *, without_trunk: bool) -> str:
    """Say in two words what a frame is lost to in which nothing grows."""
    calibrated = not isinstance(view.camera, ScaledOrthographicModel)
    if calibrated and np.isnan(view.image[frame, 0, 0]):
        return why_neckless(view.image[frame], view.derived)[1]
    return TRUNK_LOST if without_trunk else ROOT_LOST


def _hanging(body: LiftedBody) -> NDArray[np.intp]:
    """Return the joints whose parent is the root, which is the first."""
    parents = np.asarray(body.tree.parents)
    return np.flatnonzero((parents == 0) & (np.arange(len(parents)) > 0))
