"""Anatomical ranges of a limb laid out in plain arrays, as `posekit.validators.anatomical_kernels` takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.validators.anatomical import OUTWARD, Anatomy
from posekit.validators.anatomical_kernels import AT_TURN, BEYOND_ALL
from posekit.validators.anatomical_limb import (
    BALL,
    ELEVATION,
    ENDS,
    HINGES,
    LEAST_LEFT,
    PLANE,
    TURN,
    judged_names,
)
from posekit.validators.anatomical_shoulder import SEAM


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbTable:
    """Anatomical ranges of a limb as the kernel takes them.

    Parameters
    ----------
    ends : array (4, 5)
        Of each of the four angles: the middle between the means; lower mean and limit; upper mean and limit, degrees.
        Beyond all where the table bounds the angle otherwise.
    couplings : array (C, 4)
        What is bounded (an angle, the elevation or the turn), by which reading, -1 for a lower and 1 for an upper end,
        and how far the limit is beyond the mean.
    starts : int array (C + 1,)
        Where each coupling's knots start.
    knots : array (K, 2)
        Reading and mean end, in the figure's degrees.
    judged : int array (P,)
        The reading at each place of the check.
    settings : array (5,)
        Power of the sinus, 0 without one, and what it leaves at least; the plane at which the turn is cut; tolerance,
        and the tolerance from which on a rotation is not seen; degrees.
    """

    ends: Array
    couplings: Array
    starts: NDArray[np.int64]
    knots: Array
    judged: NDArray[np.int64]
    settings: Array

    @classmethod
    def of(cls, anatomy: Anatomy, joint: str, count: int, *, tolerance: float, unseen: float) -> LimbTable:
        """Lay out the ranges of a limb, of which `count` of four angles are known: 2 or 4; tolerances in degrees."""
        names = (*(f"{joint}.{angle}" for angle in BALL), f"{HINGES[joint]}.flexion")
        readings = (
            *names[:count],
            *([""] * (4 - count)),
            *((ELEVATION, PLANE) if joint == "shoulder" else ()),
        )
        judged = judged_names(anatomy, joint, count)
        by_elevation = ELEVATION in judged
        ends = np.empty((4, 5))
        for k, name in enumerate(names):
            (lower, below), (upper, above) = (anatomy.motions[name].end(side) for side in ENDS)
            low, high = lower - anatomy.spreads * below, upper + anatomy.spreads * above
            ends[k] = (lower + upper) / 2, lower, low, upper, high
            if k >= count or (by_elevation and k < BALL.index("rotation")):
                ends[k, 1:] = -BEYOND_ALL, -BEYOND_ALL, BEYOND_ALL, BEYOND_ALL
            for side, outward in OUTWARD.items():
                if name == "shoulder.rotation" and any(c.side == side for c in anatomy.couplings_of(TURN)):
                    first = 1 if outward < 0 else 3
                    ends[k, first : first + 2] = outward * BEYOND_ALL
        rows, starts, knots = [], [0], []
        for coupling in anatomy.couplings:
            bounded = (*readings, TURN if joint == "shoulder" and count == 4 else "")
            if coupling.angle not in bounded or coupling.of not in readings:
                continue
            zero = anatomy.motions[coupling.of].zero.mean if coupling.of in anatomy.motions else 0.0
            points = np.array(coupling.points)
            mean, spread = anatomy.coupled(coupling, points[:, 0] + zero)
            knots.append(np.stack([points[:, 0] + zero, mean], axis=-1))
            starts.append(starts[-1] + len(points))
            at = AT_TURN if coupling.angle == TURN else bounded.index(coupling.angle)
            rows.append([at, readings.index(coupling.of), OUTWARD[coupling.side], anatomy.spreads * spread])
        sinus = anatomy.sinus_of(joint)
        return cls(
            ends=ends,
            couplings=np.array(rows, dtype=np.float64).reshape(-1, 4),
            starts=np.array(starts, dtype=np.int64),
            knots=np.concatenate([np.empty((0, 2)), *knots]),
            judged=np.array([readings.index(name) for name in judged], dtype=np.int64),
            settings=np.array([sinus.power if sinus else 0.0, LEAST_LEFT, SEAM, tolerance, unseen]),
        )
