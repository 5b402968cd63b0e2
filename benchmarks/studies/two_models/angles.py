"""The angles of a posture, in the order of either model's rotations, and how far they are outside limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from posekit.body import Figure, with_head
from posekit.body.frames import hips_frame, torso_frame
from posekit.geometry import Array, other_branch, other_hinge
from posekit.skeleton import DOFS, HIPS, JOINT, SIDES, TORSO

TO_ISB: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From x forward, y left, z up to x forward, y up, z right."""

PART_DOFS: Final[Mapping[str, tuple[str, ...]]] = {
    "pelvis": ("pelvis.flexion", "pelvis.bending", "pelvis.rotation"),
    **{
        f"{side}_{joint}": (
            *(f"{side}_{joint}.{angle}" for angle in ("flexion", "abduction", "rotation")),
            f"{side}_{hinge}.flexion",
        )
        for side in SIDES
        for joint, hinge in (("shoulder", "elbow"), ("hip", "knee"))
    },
}
"""The angles that place each part, in the order of their rotations; not the neck's: the human has no face."""

JUDGED_DOFS: Final = tuple(dof for dofs in PART_DOFS.values() for dof in dofs)

Angles = Mapping[str, Array]
Limits = Mapping[str, tuple[float, float]]


def figure_limits(figure: Figure) -> dict[str, tuple[float, float]]:
    """Return the figure's limits without the neck's, degrees."""
    lower, upper = np.degrees(figure.limits.lower), np.degrees(figure.limits.upper)
    return {dof: (float(lower[k]), float(upper[k])) for k, dof in enumerate(DOFS) if dof in JUDGED_DOFS}


def angles_of(figure: Figure, q: Array) -> dict[str, Array]:
    """Return the stick figure's angles in configurations (N, nq), degrees, without the neck's."""
    return {dof: np.degrees(q[:, column(figure, dof)]) for dof in JUDGED_DOFS}


def in_human_order(figure: Figure, postures: Array) -> dict[str, Array]:
    r"""Return the stick figure's angles of postures (N, 14, 3), but the pelvis's in the human's order, degrees.

    The stick figure turns the hips in the trunk's frame by flexion, bending, rotation. The human turns the trunk in
    the hips' frame so: :math:`R_{hips}^T R_{trunk} = R_z(-f) R_x(-b) R_y(r)` in the ISB's axes.
    """
    q, _ = figure.configurations(with_head(postures))
    angles = angles_of(figure, q)
    place = np.moveaxis(postures, 1, 0)
    R_torso = torso_frame(*place[[JOINT[name] for name in TORSO]])
    R_hips = hips_frame(*place[[JOINT[name] for name in HIPS]])
    R = TO_ISB @ np.swapaxes(R_hips, 1, 2) @ R_torso @ TO_ISB.T
    angles["pelvis.flexion"] = np.degrees(np.arctan2(R[:, 0, 1], R[:, 1, 1]))
    angles["pelvis.bending"] = np.degrees(-np.arcsin(np.clip(R[:, 2, 1], -1.0, 1.0)))
    angles["pelvis.rotation"] = np.degrees(np.arctan2(-R[:, 2, 0], R[:, 2, 2]))
    return angles


def readings(angles: Angles) -> dict[str, list[Array]]:
    """List, by part, all values of its angles that place the points alike: arrays (N, 3) or (N, 4), degrees.

    A rotation by three successive axes has a second one: half a turn on, mirrored, half a turn on (Diebel 2006,
    Representing Attitude, 5.6). A limb has two more, as it may bend backward after half a turn about itself.
    """
    found: dict[str, list[Array]] = {}
    for part, dofs in PART_DOFS.items():
        way = np.stack([angles[dof] for dof in dofs], axis=1)
        ways = [way, other_branch(way, half_turn=180.0)]
        if len(dofs) > 3:
            ways += [other_hinge(each, half_turn=180.0) for each in ways]
        found[part] = ways
    return found


def excess(angles: Angles, limits: Limits) -> dict[str, Array]:
    """Return, by part, how far its angles are outside limits (N,), degrees, in the reading that is least outside."""
    found = {}
    for part, ways in readings(angles).items():
        lower, upper = np.array([limits[dof] for dof in PART_DOFS[part]]).T
        width, outside = upper - lower, []
        for way in ways:
            past = np.mod(way - lower, 360.0)  # from the lower limit, upward
            outside.append(np.where(past <= width, 0.0, np.minimum(past - width, 360.0 - past)).max(axis=1))
        found[part] = np.asarray(np.min(outside, axis=0))
    return found


def column(figure: Figure, dof: str) -> int:
    """Return where an angle stands in q."""
    return int(figure.angle_index[DOFS.index(dof)])
