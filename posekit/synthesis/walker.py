"""A walking figure: Boulic, Thalmann & Thalmann's gait on the stick figure.

The frame is the paper's head-centred one: x the moving direction, y up, z to the walker's right, and the head
at the coordinates of Table A.2. It is carried along with the walker, as on a treadmill, and the head is kept
upright and facing forward, so that its points rest.

What the model leaves open is decided here. The hips stay level and the back leans against them, by 0 to 4
degrees and what a walker leans besides; the torso turns against the hips, by as much as they turn
(`COUNTER_TORSION`); the neck undoes both. Arms swing in planes of the torso, legs in planes of the hips, without
abduction and axial rotation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import Figure, load_figure
from posekit.cameras.head.points import TABLE_A2
from posekit.errors import InputError
from posekit.geometry import Array, coordinate_rotation, quaternion_from_rotation
from posekit.skeleton import DOFS, SIDES
from posekit.synthesis.gait import Gait, GaitAngles

COUNTER_TORSION = 1.0
"""How far the torso turns against the hips, as a fraction of the hips' torsion."""

MOST_LEAN = np.radians(30.0)
"""Radians by which a walker leans besides at most, either way."""

NECK_HEAD_CENTRED = TABLE_A2.points[0]
"""The neck in the head-centred frame, metres (Table A.2a)."""

R_HEAD_REP103 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From the URDF's axes (x forward, y left, z up) to the head-centred frame's (x forward, y up, z right)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Walker:
    """A figure that walks at one velocity.

    Parameters
    ----------
    figure : Figure
        The built-in one (Table A.1) unless told otherwise.
    velocity : float
        Leg lengths a second, 0.5 to 1.3 (Boulic et al. 1990, mid gait).
    lean : float
        How far the back leans forward besides, radians, at most `MOST_LEAN`; negative is backward.

    Raises
    ------
    InputError
        Where the velocity or the lean lies outside.

    Examples
    --------
    >>> walker = Walker(velocity=1.0)
    >>> walker.configurations([0.0, 0.25]).shape
    (2, 29)
    """

    figure: Figure = field(default_factory=load_figure)
    velocity: float = 1.0
    lean: float = 0.0

    def __post_init__(self) -> None:
        _ = self.gait
        if not abs(self.lean) <= MOST_LEAN:
            raise InputError(
                f"the walker leans by {np.degrees(self.lean):g} degrees; expected {-np.degrees(MOST_LEAN):g} to "
                f"{np.degrees(MOST_LEAN):g}"
            )

    @cached_property
    def gait(self) -> Gait:
        """The gait at this velocity."""
        return Gait(velocity=self.velocity)

    @property
    def leg_length(self) -> float:
        """Hip to ankle, the mean of both sides, metres: the figure has no feet."""
        lengths = self.figure.lengths
        thighs = sum(lengths[f"{side}_hip-{side}_knee"] for side in SIDES)
        shanks = sum(lengths[f"{side}_knee-{side}_ankle"] for side in SIDES)
        return (thighs + shanks) / 2

    def phase(self, time: ArrayLike, phase0: float = 0.0) -> Array:
        """Return the phases at times (s) of a walk that is at `phase0` at time 0."""
        return phase0 + np.asarray(time, dtype=np.float64) / self.gait.cycle_duration

    def configurations(self, phase: ArrayLike) -> Array:
        """Return the configurations at phases (N,).

        Returns
        -------
        array (N, nq)
            Head-centred frame: metres, unit quaternion, radians.
        """
        phases = np.asarray(phase, dtype=np.float64)
        if phases.ndim != 1 or not np.isfinite(phases).all():
            raise InputError(f"phases must be finite, of shape (N,); got shape {phases.shape}")
        gait = self.gait.angles(phases)
        # The torso turns against the hips, so that shoulders and hips swing in opposition.
        R_torso = R_HEAD_REP103 @ self._torso(gait)
        R_hips = R_HEAD_REP103 @ _turned(gait.torsion, np.zeros_like(gait.torsion))
        neck = np.broadcast_to(NECK_HEAD_CENTRED, (len(phases), 3))
        head = neck[:, None] + self.figure.head_points[1:]
        angles = np.zeros((len(phases), len(DOFS)))
        angles[:, :3] = self.figure.ik.neck(R_torso, neck, head)
        angles[:, 3:6] = self.figure.ik.pelvis(R_torso, R_hips)
        for k, side in enumerate(SIDES):
            for joint in ("shoulder", "elbow", "hip", "knee"):
                angles[:, DOFS.index(f"{side}_{joint}.flexion")] = getattr(gait, joint)[:, k]
        q = np.empty((len(phases), self.figure.model.nq))
        q[:, :3], q[:, 3:7] = neck, quaternion_from_rotation(R_torso)
        q[:, self.figure.angle_index] = angles
        return q

    def travel(self, time: ArrayLike, phase0: float = 0.0) -> Array:
        """Return how far the neck has moved over the ground since time 0.

        The pelvis follows the model's root; the torso's lean carries the neck.

        Parameters
        ----------
        time : array (N,)
            Seconds.

        Returns
        -------
        array (N, 3)
            Metres, axes of the head-centred frame.
        """
        times = np.concatenate([[0.0], np.asarray(time, dtype=np.float64)])
        gait = self.gait.angles(self.phase(times, phase0))
        up = self._torso(gait)[:, :, 2]
        back = up * self.figure.lengths["neck-pelvis"]
        place: Array = (self._root(times, gait) + back) @ R_HEAD_REP103.T
        return np.asarray(place[1:] - place[0])

    def _torso(self, gait: GaitAngles) -> Array:
        """Return the torso's rotations (N, 3, 3), REP-103 axes."""
        return _turned(-COUNTER_TORSION * gait.torsion, gait.lean + self.lean)

    def _root(self, time: Array, gait: GaitAngles) -> Array:
        """Return the root's path (N, 3) in REP-103 axes, metres."""
        forward = self.velocity * time + gait.fore_aft
        return self.leg_length * np.stack([forward, gait.lateral, gait.vertical], axis=-1)


def _turned(yaw: Array, pitch: Array) -> Array:
    """Return R_z(yaw) R_y(pitch) (N, 3, 3): turned to the left, leaning forward."""
    return coordinate_rotation(2, yaw) @ coordinate_rotation(1, pitch)
