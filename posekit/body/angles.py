r"""Compute joint angles of a posture in closed form; joint limits decide between the Euler branches.

A ball joint of the figure is three revolute joints, :math:`R = R_y(\alpha) R_x(\beta) R_z(\gamma)` in the parent's
frame (x forward, y left, z up); the hinge after it (elbow or knee) rotates about y by :math:`\varepsilon`. At zero
angles a limb hangs along -z, so that its upper segment points along :math:`R(-e_z) = (-\sin\alpha \cos\beta, \sin\beta,
-\cos\alpha \cos\beta)`.

Functions return the angles of the URDF's joints: the angles of the formula, times -1 if the URDF's axis points along
-x, -y or -z. An angle is free if the posture does not determine it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from posekit.body.frames import trunk_frames
from posekit.geometry import Array, Flags, cross, fit_rotation, unit
from posekit.geometry.rotations import coordinate_rotation, relative_rotation, rotate_back, turned_near
from posekit.skeleton import DOFS, HEAD, JOINT, SIDES

#: Sine below which an angle counts as free, because the limb is straight or points along the abduction axis.
#:
#: A change of a free angle moves the limb's end by less than this sine times the limb's length.
FREE_ANGLE_SINE: Final = 1e-6

#: Sine of a limb's bend below which the bend is a rounding error; the axial rotation is then set to zero.
STRAIGHT_LIMB_SINE: Final = 1e-10

#: Violation of limits up to which a free angle is left unchanged; smaller than the tolerance of the joint-range check.
NEGLIGIBLE_VIOLATION_RADIANS: Final = 1e-5

#: Difference of violations below which two Euler branches tie, radians. If the hinge has the largest violation, the
#: violations of both branches differ only by rounding.
TIED_ANGLES_RADIANS: Final = 1e-8

#: Number of angles of a whole limb: three of its ball joint and one of its hinge.
N_LIMB_ANGLES: Final = 4

#: Plane of elevation, radians, at which an arm's axial turn is discontinuous: behind the back, toward the other arm.
SEAM: Final = np.radians(-115.0)

HIP_FLEXIONS: Final = tuple(DOFS.index(f"{side}_hip.flexion") for side in SIDES)
PELVIS_FLEXION: Final = DOFS.index("pelvis.flexion")

#: Index of the first angle, and indices of the three joints, of each limb: right arm, left arm, right leg, left leg.
LIMBS: Final = tuple(
    (6 + 8 * k + 4 * i, tuple(JOINT[f"{side}_{name}"] for name in names))
    for k, names in enumerate((("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")))
    for i, side in enumerate(SIDES)
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Limits:
    """Axis signs and angle limits of K consecutive revolute joints.

    Parameters
    ----------
    sign : array (K,) or (N, K)
        +1 or -1: the joint's URDF axis is the coordinate axis x, y or z times this sign.
    lower, upper : array (K,) or (N, K)
        Radians.
    """

    sign: Array
    lower: Array
    upper: Array

    def part(self, first: int, count: int) -> Limits:
        """Return the limits of `count` consecutive revolute joints, from index `first`."""
        part = (..., slice(first, first + count))
        return Limits(sign=self.sign[part], lower=self.lower[part], upper=self.upper[part])

    def take(self, rows: Flags) -> Limits:
        """Return the limits of the limbs that a mask (N,) selects."""
        return Limits(sign=self.sign[rows], lower=self.lower[rows], upper=self.upper[rows])

    def clip(self, k: int, angle: Array | float) -> Array:
        """Clip the k-th angle to its limits."""
        return np.clip(angle, self.lower[..., k], self.upper[..., k])

    def nearest_turn(self, angles: Array) -> Array:
        """Add full turns so that each angle (..., K) lies within half a turn of the middle of its limits."""
        return turned_near(angles, (self.lower + self.upper) / 2)

    def cost(self, angles: Array) -> Array:
        """Return the cost (...) of Euler branches (..., K): the largest violation of a limit, radians.

        For a whole limb (K = 4), the violation by the axial rotation is multiplied by the sine of the hinge angle.
        Axial rotation hardly moves the lower segment of an almost straight limb.
        """
        outside = np.maximum(np.maximum(self.lower - angles, angles - self.upper), 0.0)
        if self.sign.shape[-1] == N_LIMB_ANGLES:
            outside[..., 2] *= np.abs(np.sin(angles[..., 3]))
        return np.asarray(outside.max(axis=-1))

    def violation(self, angles: Array) -> Array:
        """Return the largest violation (...) of the limits by angles (..., K), radians; 0 if all are inside."""
        return np.asarray(np.maximum(np.maximum(self.lower - angles, angles - self.upper), 0.0).max(axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedForm:
    """Closed-form inverse kinematics of the figure.

    Parameters
    ----------
    limits : Limits
        Limits of all 22 angles. Of two Euler branches, the branch with the smaller violation of these limits is used.
        An angle that the posture does not determine is set inside its limits.
    head_offsets : array (5, 3)
        Vectors from the neck to the head points, in the head link's frame, metres.
    middle_pelvis : bool
        Whether the pelvis joint is between the hips. If so, the direction from neck to pelvis determines the
        orientation of the hips link. The pelvis then gets the smallest flexion that keeps both hip flexions inside
        their limits, if possible.
    """

    limits: Limits
    head_offsets: Array
    middle_pelvis: bool = False

    def with_limits(self, lower: Array, upper: Array) -> ClosedForm:
        """Return a copy with other limits (22,) of the figure's angles, radians."""
        return replace(self, limits=Limits(sign=self.limits.sign, lower=lower, upper=upper))

    def angles(self, points: Array) -> Array:
        """Compute the 22 angles of postures.

        Parameters
        ----------
        points : array (N, 19, 3)
            Joints and head points, metres, any right-handed frame; NaN marks an unknown point.

        Returns
        -------
        array (N, 22)
            Radians, in the order of `posekit.skeleton.DOFS`; NaN if the points that determine an angle are unknown.
        """
        R_torso, R_hips = trunk_frames(points, self.middle_pelvis)
        angles = np.empty((len(points), len(DOFS)))
        angles[:, :3] = self.neck(R_torso, points[:, 0], points[:, HEAD])
        angles[:, 3:6] = self.pelvis(R_torso, R_hips)
        # The four limbs are stacked along the first axis.
        starts, middles, ends = (
            list(joints) for joints in zip(*(joints for _, joints in LIMBS), strict=True)
        )
        R_parents = np.concatenate([R_torso, R_torso, R_hips, R_hips])
        lines = (points[:, to] - points[:, of] for of, to in ((starts, middles), (middles, ends)))
        upper, lower = (rotate_back(R_parents, unit(np.swapaxes(one, 0, 1).reshape(-1, 3))) for one in lines)
        shape, own = (len(LIMBS), len(points), N_LIMB_ANGLES), self._choosing.part(6, 16)
        sign, low, high = (
            np.repeat(one.reshape(len(LIMBS), -1), len(points), axis=0)
            for one in (own.sign, own.lower, own.upper)
        )
        found = limb_angles(upper, lower, Limits(sign=sign, lower=low, upper=high))
        angles[:, 6:] = np.swapaxes(found.reshape(shape), 0, 1).reshape(len(points), len(DOFS) - 6)
        if self.middle_pelvis:
            self._share_flexion(angles, R_torso, R_hips)
        return angles

    def head_frame(self, neck: Array, head: Array) -> Array:
        """Fit the figure's head to head points (N, 5, 3); return R_cam_head (N, 3, 3), NaN if a point is unknown."""
        return fit_rotation(self.head_offsets, head - neck[:, None])

    def neck(self, R_torso: Array, neck: Array, head: Array) -> Array:
        """Compute flexion, bending and rotation of the neck (N, 3), radians, from the head points (N, 5, 3)."""
        angles = np.full((len(neck), 3), np.nan)
        seen = np.isfinite(head).all(axis=(1, 2))
        if seen.any():
            R_head = self.head_frame(neck[seen], head[seen])
            angles[seen] = ball_angles(relative_rotation(R_torso[seen], R_head), self.limits.part(0, 3))
        return angles

    def pelvis(self, R_torso: Array, R_hips: Array) -> Array:
        """Compute flexion, bending and rotation of the pelvis (N, 3), radians."""
        return ball_angles(relative_rotation(R_torso, R_hips), self.limits.part(3, 3))

    @cached_property
    def _choosing(self) -> Limits:
        """Limits for the choice of Euler branches; if the pelvis is between the hips, they add pelvis to hip flexion.

        Rotating the hips link about the line between the hips changes only hip flexion. The posture therefore does not
        determine how the flexion divides between pelvis and hips.
        """
        if not self.middle_pelvis:
            return self.limits
        lower, upper = self.limits.lower.copy(), self.limits.upper.copy()
        low, high = self._pelvis_turn
        for hip in HIP_FLEXIONS:
            lower[hip] += low
            upper[hip] += high
        return Limits(sign=self.limits.sign, lower=lower, upper=upper)

    @property
    def _pelvis_turn(self) -> tuple[float, float]:
        """Lower and upper limit of pelvis flexion, radians, in the sign convention of hip flexion."""
        sign = self.limits.sign[PELVIS_FLEXION] * self.limits.sign[HIP_FLEXIONS[0]]
        ends = (sign * self.limits.lower[PELVIS_FLEXION], sign * self.limits.upper[PELVIS_FLEXION])
        return min(ends), max(ends)

    def _share_flexion(self, angles: Array, R_torso: Array, R_hips: Array) -> None:
        """Set, in angles (N, 22), the smallest pelvis flexion that brings both hip flexions into their limits."""
        low, high = self._pelvis_turn
        least, most = np.full(len(angles), low), np.full(len(angles), high)
        for k in HIP_FLEXIONS:
            flexion = np.where(np.isnan(angles[:, k]), 0.0, angles[:, k])
            least = np.maximum(least, flexion - self.limits.upper[k])
            most = np.minimum(most, flexion - self.limits.lower[k])
        turn = np.clip(0.0, np.minimum(least, most), np.maximum(least, most))
        rows = np.flatnonzero(turn)
        if rows.size:
            angles[rows[:, None], HIP_FLEXIONS] -= turn[rows, None]
            turned = R_hips[rows] @ coordinate_rotation(1, self.limits.sign[HIP_FLEXIONS[0]] * turn[rows])
            angles[rows, 3:6] = self.pelvis(R_torso[rows], turned)


def ball_angles(R: Array, limits: Limits) -> Array:
    """Decompose rotations (N, 3, 3) of a link relative to its parent into three angles (N, 3), radians.

    Of the two Euler branches, the branch with the smaller violation of the limits is returned.
    """
    return _least_violating(np.stack([ball_branch(R, k) for k in range(2)]) * limits.sign, limits)


def ball_branch(R: Array, branch: int = 0) -> Array:
    """Return the three angles (N, 3) of rotations (N, 3, 3) in one Euler branch; branch 0 has cos beta >= 0."""
    alpha, beta = direction_branches(-R[:, :, 2])[branch].T
    # gamma is computed from alpha and beta: if alpha is free (beta = +-90 deg), gamma compensates for its value.
    x, y, _ = into_ball(R[:, :, 0], alpha, beta).T
    return np.stack([alpha, beta, np.arctan2(y, x)], axis=-1)


def limb_branch(R_parent: Array, upper: Array, lower: Array) -> Array:
    """Return angles of limbs (N, 4), radians: alpha, beta, gamma with cos beta >= 0, and hinge angle epsilon >= 0.

    Parameters
    ----------
    R_parent : array (N, 3, 3)
        Frame of torso or hips, R_cam_torso or R_cam_hips.
    upper, lower : array (N, 3)
        Unit directions of the upper and the lower segment, camera frame.
    """
    alpha, beta = direction_branches(rotate_back(R_parent, upper))[0].T
    x, y, z = into_ball(rotate_back(R_parent, lower), alpha, beta).T
    return np.stack([alpha, beta, np.arctan2(-y, -x), np.arctan2(np.sqrt(x * x + y * y), -z)], axis=1)


def limb_angles(upper: Array, lower: Array, limits: Limits) -> Array:
    r"""Compute a limb's angles: three of the ball joint (shoulder or hip) and one of the hinge (elbow or knee).

    There are four solutions: two Euler branches times two signs of the hinge angle. A straight limb does not determine
    its axial rotation. An upper segment along the abduction axis does not determine the first angle. If no solution is
    inside the limits, an undetermined angle is changed to bring a solution inside.

    Parameters
    ----------
    upper, lower : array (N, 3)
        Unit directions of the upper and the lower segment in the frame of torso or hips.
    limits : Limits
        Limits of the four revolute joints of each limb (N, 4): ball joint, then hinge.

    Returns
    -------
    array (N, 4)
        Radians; NaN if `upper` is unknown. If only `lower` is unknown, only axial rotation and hinge angle are NaN.
    """
    angles = np.full((len(upper), N_LIMB_ANGLES), np.nan)
    both = np.asarray(np.isfinite(upper).all(axis=1) & np.isfinite(lower).all(axis=1))
    if not both.all():
        angles[~both, :2] = _upper_angles(upper[~both], limits.part(0, 2).take(~both))
        upper, lower, limits = upper[both], lower[both], limits.take(both)
    branches = direction_branches(upper)
    candidates = []
    for k in range(2):
        alpha, beta = branches[k, :, 0], branches[k, :, 1]
        local = into_ball(lower, alpha, beta)
        candidates += [_hinge_branch(local, alpha, beta, side, limits) for side in (1.0, -1.0)]
    found = _least_violating(np.stack(candidates), limits)
    free = _along_abduction_axis(upper) | _parallel(upper, lower)
    free &= limits.violation(found) > NEGLIGIBLE_VIOLATION_RADIANS
    if free.any():
        found[free] = _turn_free_angles(upper[free], lower[free], found[free], limits.take(free))
    angles[both] = found
    return angles


def _upper_angles(upper: Array, limits: Limits) -> Array:
    """Compute flexion and abduction (N, 2) from upper-segment directions (N, 3) if the lower segment is unknown."""
    angles = _least_violating(direction_branches(upper) * limits.sign, limits)
    angles[:, 0] = np.where(_along_abduction_axis(upper), limits.clip(0, angles[:, 0]), angles[:, 0])
    return angles


def arm_angles(flexion: Array, abduction: Array) -> tuple[Array, Array, Array]:
    r"""Return elevation, plane of elevation, and axial turn (N,), radians, of an arm whose third joint angle is zero.

    The axial turn is the difference of two twists, which are rotation angles about the arm's axis. The first is the
    twist of the swing-twist decomposition, :math:`-2\operatorname{atan2}(\sin\frac\alpha2\sin\frac\beta2,
    \cos\frac\alpha2\cos\frac\beta2)`. The second is the twist of an arm that moves around the vertical, :math:`(1 -
    \cos e)(90^\circ - p)`, with elevation e and plane of elevation p.
    """
    forward, outward = np.sin(flexion) * np.cos(abduction), np.sin(abduction)
    down = np.cos(flexion) * np.cos(abduction)
    elevation, plane = np.arctan2(np.hypot(forward, outward), down), np.arctan2(outward, forward)
    a, b = flexion / 2, abduction / 2
    twist = -2 * np.arctan2(np.sin(a) * np.sin(b), np.cos(a) * np.cos(b))
    from_side = np.pi / 2 - np.where(plane < SEAM, plane + 2 * np.pi, plane)
    return elevation, plane, twist - (1 - np.cos(elevation)) * from_side


def other_branch(angles: Array) -> Array:
    r"""Return the angles of the same rotation in the other Euler branch.

    The angles change by :math:`(\alpha, \beta, \gamma) \to (\alpha + \pi, \pi - \beta, \gamma + \pi)` for rotations
    about three mutually perpendicular axes (Diebel 2006, *Representing Attitude*, §5.6). The first two angles of both
    branches give the same direction of the third axis. A fourth angle, of a hinge, is unchanged.

    Parameters
    ----------
    angles : array (..., K)
        Two, three or four angles, radians.
    """
    turned = angles.copy()
    turned[..., 0:3:2] += np.pi
    turned[..., 1] = np.pi - angles[..., 1]
    return turned


def continuous(angles: Array) -> Array:
    """Replace Euler angles (T, J, 3) by angles of the same rotations that change least from frame to frame.

    The first frame is unchanged. Full turns, and jumps to the other Euler branch (a + pi, pi - b, c + pi), are removed
    (Diebel 2006, *Representing Attitude*, section 5.6).
    """
    angles = np.array(angles, dtype=np.float64)
    if len(angles) < 2:
        return angles
    # Whether the branch changes between two frames does not depend on the branch of the first: changes add modulo 2.
    step = turned_near(np.diff(angles, axis=0), 0.0)
    other = turned_near(other_branch(angles[1:]) - angles[:-1], 0.0)
    odd = np.zeros(angles.shape[:2], dtype=bool)
    odd[1:] = np.cumsum((other**2).sum(axis=-1) < (step**2).sum(axis=-1), axis=0) % 2 == 1
    angles[odd] = other_branch(angles[odd])
    return np.unwrap(angles, axis=0)


def _hinge_branch(local: Array, alpha: Array, beta: Array, side: float, limits: Limits) -> Array:
    """Return the four angles (N, 4) of limbs, radians, in the solution whose hinge angle has the sign `side`."""
    across = np.hypot(local[:, 0], local[:, 1])
    gamma = np.where(across < STRAIGHT_LIMB_SINE, 0.0, np.arctan2(-side * local[:, 1], -side * local[:, 0]))
    epsilon = side * np.arctan2(across, -local[:, 2])
    return limits.nearest_turn(np.stack([alpha, beta, gamma, epsilon], axis=-1) * limits.sign)


def _turn_free_angles(upper: Array, lower: Array, angles: Array, limits: Limits) -> Array:
    r"""Return the angles (N, 4) of limbs; undetermined angles are changed if that reduces the violation of the limits.

    A straight limb's axial rotation is clipped to its limits. At beta = +-90 deg, :math:`R_y(\alpha) R_x(\beta)
    R_z(\gamma)` depends only on :math:`\gamma \mp \alpha`, so many pairs of alpha and gamma give the same rotation. If
    any pair is inside the limits, then so is a pair with alpha zero, or with alpha or gamma at a limit.
    """
    branches = direction_branches(upper)
    pinned, straight = _along_abduction_axis(upper), _parallel(upper, lower)
    sign, low, high = limits.sign.T, limits.lower.T, limits.upper.T
    candidates = [angles]
    for k in range(2):
        beta = branches[k, :, 1]
        at_zero = into_ball(lower, np.zeros(len(beta)), beta)
        for side in (1.0, -1.0):
            gamma = np.arctan2(-side * at_zero[:, 1], -side * at_zero[:, 0])
            turned = [sign[0] * limits.clip(0, 0.0), sign[0] * low[0], sign[0] * high[0]]
            turned += [np.sign(np.sin(beta)) * (sign[2] * bound - gamma) for bound in (low[2], high[2])]
            for alpha in (branches[k, :, 0], *(np.where(pinned, alpha, np.nan) for alpha in turned)):
                branch = _hinge_branch(into_ball(lower, alpha, beta), alpha, beta, side, limits)
                branch[:, 2] = np.where(straight, limits.clip(2, branch[:, 2]), branch[:, 2])
                candidates.append(branch)
    return _least_violating(np.stack(candidates), limits)


def _parallel(upper: Array, lower: Array) -> Flags:
    """Return a mask (N,) of straight or folded limbs, whose two segment directions (N, 3) are parallel."""
    return np.asarray(np.linalg.norm(cross(upper, lower), axis=-1) < FREE_ANGLE_SINE)


def _along_abduction_axis(upper: Array) -> Flags:
    """Return a mask (N,) of the directions (N, 3) that are parallel to the abduction axis."""
    return np.asarray(np.hypot(upper[:, 0], upper[:, 2]) < FREE_ANGLE_SINE)


def direction_branches(upper: Array) -> Array:
    """Return the angles alpha and beta (2, N, 2) of upper-segment directions (N, 3) in both Euler branches."""
    alpha = np.arctan2(-upper[:, 0], 0.0 - upper[:, 2])  # alpha is 0 along the abduction axis
    beta = np.arctan2(upper[:, 1], np.hypot(upper[:, 0], upper[:, 2]))
    first = np.stack([alpha, beta], axis=-1)
    return np.stack([first, other_branch(first)])


def into_ball(lower: Array, alpha: Array, beta: Array) -> Array:
    """Convert directions (N, 3) to the frame after the rotations alpha and beta: (R_y(alpha) R_x(beta))^T lower."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    x, y, z = lower[:, 0], lower[:, 1], lower[:, 2]
    forward = sa * x + ca * z
    return np.stack([ca * x - sa * z, cb * y + sb * forward, -sb * y + cb * forward], axis=-1)


def _least_violating(candidates: Array, limits: Limits) -> Array:
    """Return, of B branches (B, N, K), the branch (N, K) with the smallest violation of limits; the first in a tie."""
    angles = limits.nearest_turn(candidates)
    violation = limits.cost(angles)
    violation = np.where(np.isnan(violation), np.inf, violation)
    least = violation.min(axis=0)
    best = np.argmax(violation <= least + np.where(least > 0, TIED_ANGLES_RADIANS, 0.0), axis=0)
    return np.asarray(angles[best, np.arange(len(best))])
