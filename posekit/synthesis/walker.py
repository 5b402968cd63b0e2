r"""A walking figure, with the gait model of Boulic, Thalmann & Thalmann 1990 (*The Visual Computer* 6:344-358).

The posture is a function of the velocity v (leg lengths per second) and the phase t of the gait cycle. At t = 0 the
right foot touches the ground; the left foot follows at t = 0.5.

Coordinates are in the head-centred frame of Lee & Chen 1985: x is the direction of walking, y is up, z is to the
walker's right, and the head is at the coordinates of their Table A.2. This coordinate frame moves with the walker, as
on a treadmill. The head stays upright and faces forward, so the head points do not move in this frame.

The gait model does not determine all joint angles; posekit chooses the others as follows. The line between the hips
stays level, and the back leans relative to the hips. About the vertical axis, the torso rotates opposite to the hips.
The neck compensates the rotation and the lean of the torso. Arms swing in the sagittal plane of the torso, and legs in
that of the hips, without abduction and axial rotation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import Figure, load_figure
from posekit.cameras.head import TABLE_A2
from posekit.errors import refusal
from posekit.geometry import Array, coordinate_rotation, quaternion_from_rotation
from posekit.skeleton import DOFS, SIDES

#: Range of relative velocities v for which the hip, knee and elbow curves of mid gait hold, leg lengths per second.
VELOCITY_RANGE: Final = (0.5, 1.3)

#: Largest additional lean of the back, radians, forward or backward.
MAX_LEAN: Final = np.radians(30.0)

HIP_FLEXION: Final = ((0.5, -15.0), (0.9, 25.0))
#: Knots (phase, degrees) of the flexion curve of mid gait.
KNEE_FLEXION: Final = ((0.17, 3.0), (0.4, 3.0), (0.75, 70.0), (1.0, 3.0))

#: Rotation from the URDF's axes (x forward, y left, z up) to the head-centred axes (x forward, y up, z right).
R_HEAD_REP103: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, kw_only=True, eq=False)
class Walker:
    """A figure that walks at a constant velocity.

    Parameters
    ----------
    figure : Figure
        Figure of the person; by default the built-in figure (Lee & Chen 1985, Table A.1).
    velocity : float
        Leg lengths per second, 0.5 to 1.3.
    lean : float
        Additional forward lean of the back, radians, at most `MAX_LEAN` forward or backward.

    Raises
    ------
    InputError
        If the velocity or the lean is outside its range.

    Examples
    --------
    >>> walker = Walker(velocity=1.0)
    >>> walker.cycle_duration
    1.346
    >>> walker.configurations([0.0, 0.25]).shape
    (2, 29)
    """

    figure: Figure = field(default_factory=load_figure)
    velocity: float = 1.0
    lean: float = 0.0

    def __post_init__(self) -> None:
        slowest, fastest = VELOCITY_RANGE
        if not slowest <= self.velocity <= fastest:
            got, expected = f"{self.velocity:g} leg lengths/s", f"{slowest:g} to {fastest:g}"
            raise refusal("", "velocity", got, expected, "slower and faster gaits follow other curves")
        if not abs(self.lean) <= MAX_LEAN:
            raise refusal("", "lean", f"{np.degrees(self.lean):g} degrees", "-30 to 30", "reduce it")

    @property
    def cycle_duration(self) -> float:
        """Duration of one gait cycle (two steps), seconds; it covers 1.346 sqrt(`velocity`) leg lengths."""
        return 1.346 * math.sqrt(self.velocity) / self.velocity

    @property
    def leg_length(self) -> float:
        """Mean distance from hip to ankle of both legs, metres; the figure has no feet."""
        lengths = self.figure.lengths
        return sum(lengths[f"{s}_hip-{s}_knee"] + lengths[f"{s}_knee-{s}_ankle"] for s in SIDES) / 2

    def phase(self, time: ArrayLike, phase0: float = 0.0) -> Array:
        """Return the gait phases at given times in seconds; `phase0` is the phase at time 0; a cycle is 1."""
        return phase0 + np.asarray(time, dtype=np.float64) / self.cycle_duration

    def flexion(self, phase: ArrayLike) -> dict[str, Array]:
        """Return the flexion (N, 2) of shoulder, elbow, hip and knee at phases (N,), right and left, radians."""
        t, v = np.asarray(phase, dtype=np.float64), self.velocity
        sides = np.stack([t, t + 0.5], axis=-1)
        u = (v - VELOCITY_RANGE[0]) / (VELOCITY_RANGE[1] - VELOCITY_RANGE[0])
        elbow = ((0.05, 6 + 8 * u), (0.5 + 0.01 * u, 20 + 24 * u), (0.9, 8 + 9 * u))
        degrees = {
            "shoulder": 3 - 4.94 * v - 9.88 * v * np.cos(2 * np.pi * sides),
            "elbow": _curve(elbow, sides),
            "hip": _curve(HIP_FLEXION, sides),
            "knee": _curve(KNEE_FLEXION, sides),
        }
        return {joint: np.radians(values) for joint, values in degrees.items()}

    def configurations(self, phase: ArrayLike) -> Array:
        """Return the configurations (N, nq) at phases (N,) in the head-centred frame: metres, unit quaternion, radians.

        Raises
        ------
        InputError
            If the phases are not finite or do not have the shape (N,).
        """
        phases = np.asarray(phase, dtype=np.float64)
        if phases.ndim != 1 or not np.isfinite(phases).all():
            raise refusal("", "phase", f"shape {phases.shape}", "finite phases (N,)", "give one per frame")
        torsion = self._torsion(phases)
        # The torso rotates opposite to the hips, so that shoulders and hips swing in opposition.
        R_torso = R_HEAD_REP103 @ self._torso(phases)
        R_hips = R_HEAD_REP103 @ coordinate_rotation(2, torsion)
        neck = np.broadcast_to(TABLE_A2.points[0], (len(phases), 3))
        head = neck[:, None] + self.figure.head_points[1:]
        angles = np.zeros((len(phases), len(DOFS)))
        angles[:, :3] = self.figure.ik.neck(R_torso, neck, head)
        angles[:, 3:6] = self.figure.ik.pelvis(R_torso, R_hips)
        for joint, flexion in self.flexion(phases).items():
            for k, side in enumerate(SIDES):
                angles[:, DOFS.index(f"{side}_{joint}.flexion")] = flexion[:, k]
        q = np.empty((len(phases), self.figure.model.nq))
        q[:, :3], q[:, 3:7] = neck, quaternion_from_rotation(R_torso)
        q[:, self.figure.angle_index] = angles
        return q

    def travel(self, time: ArrayLike, phase0: float = 0.0) -> Array:
        """Return the displacement of the neck over the ground since time 0.

        The pelvis moves like the root of the gait model, and the lean of the torso moves the neck relative to the
        pelvis.

        Parameters
        ----------
        time : array (N,)
            Times, seconds.
        phase0 : float
            Gait phase at time 0, cycles.

        Returns
        -------
        array (N, 3)
            Displacement, metres, in the axes of the head-centred frame.
        """
        times = np.concatenate([[0.0], np.asarray(time, dtype=np.float64)])
        t, v = self.phase(times, phase0), self.velocity
        # The coefficients are the paper's, in leg lengths.
        support = 0.752 * self.cycle_duration - 0.143
        early = 0.625 - support / self.cycle_duration
        forward = v * times - 0.021 * _wave(2 * t + 2 * early)
        vertical = -0.015 * v + 0.015 * v * _wave(2 * t - 0.35)
        root = self.leg_length * np.stack([forward, -0.032 * _wave(t - 0.1), vertical], axis=-1)
        place = (root + self._torso(t)[:, :, 2] * self.figure.lengths["neck-pelvis"]) @ R_HEAD_REP103.T
        return np.asarray(place[1:] - place[0])

    def _torsion(self, phase: Array) -> Array:
        """Return the rotation of the hips about the vertical axis, radians; positive if the right hip moves forward.

        The sign is opposite to the sign in Boulic et al., so that the hip of the leading leg moves forward.
        """
        return np.asarray(np.radians(4 * self.velocity * np.cos(2 * np.pi * phase)))

    def _torso(self, phase: Array) -> Array:
        """Return rotation matrices of the torso (N, 3, 3), in axes x forward, y left, z up."""
        tilt = np.radians(2 - 2 * _wave(2 * phase - 0.1))
        return coordinate_rotation(2, -self._torsion(phase)) @ coordinate_rotation(1, tilt + self.lean)


def _wave(turns: Array) -> Array:
    return np.sin(2 * np.pi * turns)


def _curve(knots: Sequence[tuple[float, float]], phase: Array) -> Array:
    """Evaluate the periodic, monotone cubic spline through the knots (phase, value) (Fritsch & Butland 1984)."""
    from scipy.interpolate import PchipInterpolator

    x, y = np.array(knots).T
    # With three periods, each knot of the middle period has neighbours on both sides.
    curve = PchipInterpolator(np.concatenate([x - 1, x, x + 1]), np.tile(y, 3))
    return np.asarray(curve(x[0] + np.mod(phase - x[0], 1.0)))
