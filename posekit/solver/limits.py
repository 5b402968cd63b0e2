r"""Joint ranges as arrays of numbers, which the solver and the check of joint ranges share.

A limb has four angles. The shoulder or hip has the Euler angles :math:`R_y(\alpha) R_x(\beta) R_z(\gamma)` in the frame
of torso or hips (x forward, y left, z up). The elbow or knee, a hinge, has the angle :math:`\varepsilon` about y. Up to
four sets of these angles give the same directions of the limb's two segments. The limb is within its limits if at least
one set has every angle between its bounds. A bound is a constant or a piecewise linear function of another angle (a
coupling). A range may also shrink if other angles of the joint are near their limits (a joint sinus). If the table of
joint ranges bounds the elevation of the arm, arms are judged by elevation, plane of elevation and axial rotation.
Flexion and abduction are singular for an arm that points sideways.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, degrees, hypot
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body.angles import arm_angles
from posekit.errors import refusal
from posekit.geometry import Array, Flags, Ints, unit
from posekit.skeleton import DOFS, LIMB_JOINTS

#: Ball joints of the four limbs.
LIMBS: Final = ("right_shoulder", "left_shoulder", "right_hip", "left_hip")

#: Joints of the limbs: shoulders and hips, elbows and knees, wrists and ankles.
STARTS, MIDDLES, ENDS = (tuple(limb[k] for limb in LIMB_JOINTS) for k in range(3))

#: Sign of the URDF's axes of flexion, abduction, rotation and hinge, by limb.
SIGNS: Final = np.array([[-1, -1, 1, -1], [-1, 1, -1, -1], [-1, -1, 1, 1], [-1, 1, -1, 1]], dtype=np.float64)

PELVIS_SIGNS: Final = np.array([-1.0, 1.0, -1.0])
KINDS: Final = (
    ("shoulder.flexion", "shoulder.abduction", "shoulder.rotation", "elbow.flexion"),
    ("hip.flexion", "hip.abduction", "hip.rotation", "knee.flexion"),
)
#: Derived angles that couplings use besides the four limb angles, numbered from 4.
READINGS: Final = ("elevation", "plane", "turn", "valgus")

ELEVATION, PLANE, TURN, VALGUS = range(4, 8)

#: Sign of the apparent axial rotation of arms and of legs if the lower segment leaves the hinge's plane away from the
#: body (valgus).
VALGUS_SIGNS: Final = np.array([-1.0, 1.0])

#: Fraction of a range that remains under a sinus if another angle is at its limit (dimensionless).
LEAST_LEFT: Final = 0.1

MAX_COUPLINGS: Final = 12
MAX_KNOTS: Final = 8

#: The numbers as the compiled solver reads them, radians. `role` of a coupling: kind of limb (0 arm, 1 leg), bounded
#: angle, side (0 lower, 1 upper), angle that it depends on, number of knots. `knots`: values of that angle, mean bound,
#: and limit.
LIMITS: Final = np.dtype(
    [
        ("mean", "f8", (2, 4, 2)),
        ("limit", "f8", (4, 4, 2)),
        ("pelvis", "f8", (3, 2)),
        ("sinus", "f8", (2,)),
        ("hip_turn", "f8", (2,)),
        ("by_elevation", "f8"),
        ("between_hips", "f8"),
        ("couplings", "f8"),
        ("role", "f8", (MAX_COUPLINGS, 5)),
        ("knots", "f8", (MAX_COUPLINGS, 3, MAX_KNOTS)),
    ]
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Limits:
    """Joint ranges of pelvis and limbs as numbers.

    Parameters
    ----------
    numbers : record of `LIMITS`
        Joint ranges, radians.
    """

    numbers: NDArray[np.void]

    @staticmethod
    def of(
        ranges: Mapping[str, Any] | None,
        figure_limits: Array,
        *,
        above_hips: float = 0.1,
        pelvis_between_hips: bool = False,
    ) -> Limits:
        """Convert a table of joint ranges to arrays of numbers.

        Parameters
        ----------
        ranges : mapping or None
            A parsed table ``posekit.ranges/1`` of kind ``anatomical``; None to use the figure's own limits.
        figure_limits : array (22, 2)
            Limits of the figure's degrees of freedom in the order of `posekit.skeleton.DOFS`, degrees.
        above_hips : float
            Distance of the pelvis joint from the line between the hips, metres.
        pelvis_between_hips : bool
            Whether the pelvis joint is on the line between the hips. Joint positions then do not show the flexion of
            the pelvis, so any flexion within its range is allowed.

        Returns
        -------
        Limits
        """
        n = np.zeros((), dtype=LIMITS)
        table = np.array(figure_limits, dtype=np.float64)
        means, zeros, spreads = table.copy(), {}, ranges["spreads"] if ranges else 0.0
        for k, dof in enumerate(DOFS):
            joint, angle = dof.split(".")
            sideless = joint.removeprefix("right_").removeprefix("left_")
            one = (ranges or {}).get(sideless, {}).get(angle)
            if one is None:
                continue
            zero = one.get("zero", {"mean": 0.0, "spread": 0.0})
            lean = degrees(atan2(zero.get("pelvis", 0.0), max(above_hips, zero.get("pelvis", 0.0), 1e-9)))
            spread = hypot(zero["spread"], lean) if zero.get("pelvis") else zero["spread"]
            zeros[f"{sideless}.{angle}"] = (zero["mean"], spread)
            for side, (name, sign) in enumerate((("lower", -1), ("upper", 1))):
                means[k, side] = one[name]["mean"] + zero["mean"]
                table[k, side] = means[k, side] + sign * spreads * hypot(one[name]["spread"], spread)
        first = [DOFS.index(f"{limb}.flexion") for limb in LIMBS]
        n["limit"] = np.radians([table[k : k + 4] for k in first])
        n["mean"] = np.radians([means[k : k + 4] for k in first[::2]])
        pelvis = DOFS.index("pelvis.flexion")
        n["pelvis"] = np.radians(table[pelvis : pelvis + 3])
        if pelvis_between_hips:
            n["between_hips"] = 1.0
            n["hip_turn"] = np.radians(figure_limits[pelvis])
        if ranges:
            _couple(n, ranges, zeros)
        return Limits(numbers=n)

    @property
    def names(self) -> list[str]:
        """Names of the 19 angles that have limits: three of the pelvis, then four of each limb."""
        first = "shoulder.elevation" if self.numbers["by_elevation"] else KINDS[0][0]
        angles = [(first, *KINDS[0][1:]), KINDS[1]]
        limbs = [f"{name.split('_')[0]}_{angle}" for k, name in enumerate(LIMBS) for angle in angles[k // 2]]
        return [*DOFS[3:6], *limbs]

    def read(
        self, limb: int, rotations: Array, tolerance: float = 0.0, writing: Ints | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Return the angles of one limb in N postures and their bounds, for all W equivalent sets of angles.

        Parameters
        ----------
        limb : int
            Index in `LIMBS`.
        rotations : array (N, 4)
            The angles that `posekit.body.angles.limb_branch` returns, radians.
        tolerance : float
            Tolerance of the angles that enter the joint sinus, radians.
        writing : int array (N,), optional
            Index of the set of angles to return for each posture; all sets if not given.

        Returns
        -------
        value, lower, upper : array (N, W, 4)
            Flexion (or elevation), abduction, rotation and hinge angle, and their bounds, radians. Bounds are infinite
            for an angle without limits.
        bend : array (N,)
            Absolute value of the sine of the hinge angle.
        """
        n, kind = self.numbers, limb // 2
        arm = kind == 0 and bool(n["by_elevation"])
        a, b, c, e = np.moveaxis(rotations * SIGNS[limb], 1, 0)
        way = np.arange(2 if arm else 4)[None] if writing is None else writing[:, None]
        over, hinge = way // 2, np.where(way % 2, -1.0, 1.0)  # Euler branch, sign of the hinge
        alpha = a[:, None] + np.pi * over
        beta = np.where(over, np.pi - b[:, None], b[:, None])
        gamma = c[:, None] + np.pi * (over ^ (way % 2))
        angles = np.stack(np.broadcast_arrays(alpha, beta, gamma, e[:, None] * hinge), axis=-1)
        middle = n["mean"][kind].mean(axis=-1)
        angles -= 2 * np.pi * np.round((angles - middle) / (2 * np.pi))
        if kind and n["between_hips"]:
            angles[..., 0] -= np.clip(angles[..., 0] - middle[0], *n["hip_turn"])
        readings = [*np.moveaxis(angles, -1, 0)]
        offset = np.zeros(len(a))
        if kind == 0:
            elevation, plane, offset = arm_angles(a, b)
            readings += [elevation[:, None], plane[:, None]]
        lower, upper, turns, outward = self._bounds(limb, angles, readings, tolerance)
        if turns:
            centre = sum(turns.values()) / len(turns)
            raw = angles[..., 2] + offset[:, None] + np.pi * over
            turn = raw - 2 * np.pi * np.round((raw - centre) / (2 * np.pi))
            shift = turn - angles[..., 2]
            angles[..., 2] = turn
            for side, bound in enumerate((lower, upper)):
                bound[..., 2] = turns[side] if side in turns else bound[..., 2] + shift
        lower[..., 2] -= outward[0]
        upper[..., 2] += outward[1]
        if arm:
            angles[..., 0] = readings[4]
        return angles, lower, upper, np.abs(np.sin(rotations[:, 3]))

    def _bounds(
        self, limb: int, angles: Array, readings: list[Array], tolerance: float
    ) -> tuple[Array, Array, dict[int, Array], list[Array]]:
        """Return the bounds of a limb's angles, evaluated where they depend on other angles.

        Returns
        -------
        lower, upper : array (N, W, 4)
            Bounds of the four angles, radians.
        turns : dict of int to array (N, W)
            Bounds of the axial rotation of an arm: key 0 is the lower bound, key 1 the upper bound.
        outward : list of two arrays (N, W)
            Angles by which valgus of elbow or knee widens the lower and the upper bound of rotation, radians.
        """
        n, kind, shape = self.numbers, limb // 2, angles.shape[:2]
        bounds = [np.broadcast_to(n["limit"][limb, :, k], angles.shape).copy() for k in range(2)]
        means = [np.broadcast_to(n["mean"][kind, :, k], angles.shape).copy() for k in range(2)]
        if kind == 0 and n["by_elevation"]:
            bounds[0][..., :2], bounds[1][..., :2] = -np.inf, np.inf
        turns: dict[int, Array] = {}
        outward = [np.zeros(shape), np.zeros(shape)]
        couplings = zip(n["role"][: int(n["couplings"])].astype(int).tolist(), n["knots"], strict=False)
        for (which, target, side, of, count), knots in couplings:
            if which != kind:
                continue
            at, mean, limit = knots[:, :count]
            end = np.broadcast_to(np.interp(readings[of], at, limit), shape)
            if target == TURN:
                turns[side] = end
            elif target == VALGUS:
                sign = 2 * side - 1
                square = float(np.interp(np.pi / 2, at, limit))
                turn, positive = _valgus(angles[..., 3], sign * end, sign * square)
                upward = positive == (sign * VALGUS_SIGNS[kind] > 0)
                outward[0] += np.where(upward, 0.0, turn)
                outward[1] += np.where(upward, turn, 0.0)
            else:
                # A coupling to an unknown angle (NaN) adds no bound.
                pick, column = np.fmin if side else np.fmax, 0 if target == ELEVATION else target
                bounds[side][..., column] = pick(bounds[side][..., column], end)
                middle = np.interp(readings[of], at, mean)
                means[side][..., column] = pick(means[side][..., column], middle)
        if n["sinus"][kind]:
            _round_off(n, limb, angles, bounds, means, tolerance)
        return bounds[0], bounds[1], turns, outward

    def residual(self, limb: int, rotations: Array, writing: Ints | None = None) -> tuple[Array, Ints]:
        r"""Return residuals (N, 4) of angles beyond their limits, radians, and the index (N,) of the angle set used.

        Without `writing`, the set of angles that violates its limits least is used. An axial rotation that exceeds its
        limit by v has the residual :math:`\sin\varepsilon\, v / \sqrt{1 + v^2}`. It vanishes for a straight limb,
        because its axial rotation is undetermined. Flexion is weighted in the same way with :math:`\cos\beta` instead
        of :math:`\sin\varepsilon`.
        """
        value, lower, upper, _ = self.read(limb, rotations, writing=writing)
        above, below = value - upper, lower - value
        over = np.where((above > 0) & (above >= below), above, np.where(below > 0, -below, 0.0))
        over[..., 2] *= np.sin(rotations[:, 3])[:, None] / np.sqrt(1 + over[..., 2] ** 2)
        if limb >= 2 or not self.numbers["by_elevation"]:
            over[..., 0] *= np.cos(rotations[:, 1])[:, None] / np.sqrt(1 + over[..., 0] ** 2)
        if writing is not None:
            return over[:, 0], writing
        best = np.einsum("nwk,nwk->nw", over, over).argmin(axis=1)
        return over[np.arange(len(best)), best], best


def _couple(n: NDArray[Any], ranges: Mapping[str, Any], zeros: dict[str, Any]) -> None:
    """Write the couplings and joint sinuses of a table of joint ranges into the record `n`."""
    couplings = ranges.get("coupling", ())
    longest = max((len(one["points"]) for one in couplings), default=0)
    if len(couplings) > MAX_COUPLINGS or longest > MAX_KNOTS:
        got = f"{len(couplings)} couplings of up to {longest} points"
        raise refusal("ranges", "coupling", got, f"up to {MAX_COUPLINGS} of {MAX_KNOTS} points", "omit some")
    for k, one in enumerate(couplings):
        kind = 0 if one["angle"].split(".")[0] in ("shoulder", "elbow") else 1
        side = int(one["end"] == "upper")
        (shift, spread), (origin, _) = (zeros.get(one[name], (0.0, 0.0)) for name in ("angle", "of"))
        target, of = (_place(kind, one[name]) for name in ("angle", "of"))
        knots = np.array(one["points"], dtype=np.float64).T
        count = knots.shape[1]
        out = (2 * side - 1) * ranges["spreads"] * hypot(one["spread"], spread)
        n["role"][k] = kind, target, side, of, count
        n["knots"][k, :, :count] = np.radians([knots[0] + origin, knots[1] + shift, knots[1] + shift + out])
        n["couplings"] = k + 1
        if target == 4 and side == 1:
            n["by_elevation"] = 1.0
    for one in ranges.get("sinus", ()):
        n["sinus"][int(one["joint"] == "hip")] = one["power"]


def _place(kind: int, angle: str) -> int:
    """Return the index of a limb angle: 0 to 3 for the angles in `KINDS`, 4 to 7 for the angles in `READINGS`."""
    return KINDS[kind].index(angle) if angle in KINDS[kind] else 4 + READINGS.index(angle.split(".")[1])


def _valgus(hinge: Array, end: Array, square: float) -> tuple[Array, Flags]:
    r"""Return the error of axial rotation due to valgus, radians, and whether the hinge bends in its natural direction.

    Axial rotation of the upper segment is computed from the direction of the lower segment. If the lower segment leaves
    the hinge's plane by the angle v, the rotation is wrong by :math:`\arcsin(\sin v / \sin\varepsilon)` at a bend of
    :math:`\varepsilon`. Ranges of rotation are measured at a bend of 90 degrees, so the error at that bend (`square`)
    is subtracted.
    """
    off, sine = np.maximum(end, 0.0), np.sin(hinge)
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.arcsin(np.minimum(np.sin(off) / np.abs(sine), 1.0)) - max(square, 0.0)
    return np.where(off > 0, np.maximum(turn, 0.0), 0.0), ~(sine < 0)


def _round_off(
    n: NDArray[np.void], limb: int, angles: Array, bounds: list[Array], means: list[Array], slack: float
) -> None:
    """Apply a joint sinus: narrow the bounds of abduction and rotation if preceding angles are far from mid-range.

    The distance from mid-range is divided by half the range plus the tolerance `slack`, radians.
    """
    limit, mean, power = n["limit"][limb], n["mean"][limb // 2], n["sinus"][limb // 2]
    used = np.zeros(angles.shape[:2])
    for place in range(3):
        low, high = (m[..., place] if place == 2 else mean[place, k] for k, m in enumerate(means))
        middle = (low + high) / 2
        if place:
            left = np.maximum(1.0 - used, LEAST_LEFT**power) ** (1 / power)
            for bound in bounds:
                bound[..., place] = middle + (bound[..., place] - middle) * left
        if place < 2:
            off = angles[..., place] - middle
            half = np.where(off < 0, middle - limit[place, 0], limit[place, 1] - middle)
            used = used + (np.abs(off) / (half + slack)) ** power


def limb_directions(joints: Array, limb: int) -> tuple[Array, Array]:
    """Return the unit directions of the upper and the lower segment of one limb, both (N, 3)."""
    start, middle, end = joints[:, STARTS[limb]], joints[:, MIDDLES[limb]], joints[:, ENDS[limb]]
    return unit(middle - start), unit(end - middle)
