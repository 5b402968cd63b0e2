"""Anatomical ranges of a limb laid out flat, as `posekit.compiled.anatomical_kernels` takes them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from posekit.compiled.anatomical_kernels import AT_COUPLED, AT_JUDGED, AT_TURN, AT_VALGUS, BEYOND_ALL
from posekit.geometry import Array
from posekit.tables.angles import SIDEWAYS_ANGLES
from posekit.validators.anatomical import OUTWARD_SIGNS, Anatomy
from posekit.validators.anatomical_limb import (
    BALL_ANGLES,
    ELEVATION_ANGLE,
    HINGE_OF_BALL,
    LEAST_LEFT,
    LIMIT_SIDES,
    PLANE_ANGLE,
    ROTATION_INDEX,
    TURN_ANGLE,
    judged_names,
)
from posekit.validators.anatomical_shoulder import SEAM_DEGREES


def limb_numbers(
    anatomy: Anatomy,
    joint: str,
    signs: Array,
    *,
    rigid: int,
    tolerance: float,
    unseen: float,
    turn: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Lay out the ranges of a limb.

    Parameters
    ----------
    anatomy : Anatomy
        The table of ranges and couplings.
    joint : {"shoulder", "hip"}
        The ball joint of the limb.
    signs : array (4,) or (2,)
        Of the angles that are known, as `posekit.body.angles.Limits` has them: all four, or the first two.
    rigid : int
        The part that the limb hangs on, by `posekit.compiled.rigid_kernels.rigid_frame`.
    tolerance, unseen : float
        Degrees by which a direction may be off, and the tolerance from which on a rotation is not seen.
    turn : tuple of 2 float
        See `posekit.validators.anatomical_limb.limb_walls`.

    Returns
    -------
    array (N,)
        As `posekit.compiled.anatomical_kernels` says; ends are beyond all where the table bounds an angle otherwise.
    """
    count, arm = len(signs), joint == "shoulder"
    names = (*(f"{joint}.{angle}" for angle in BALL_ANGLES), f"{HINGE_OF_BALL[joint]}.flexion")
    readings = (*names[:count], *([""] * (4 - count)), *((ELEVATION_ANGLE, PLANE_ANGLE) if arm else ()))
    judged = judged_names(anatomy, joint, count)
    ends = _ends(anatomy, names, count, by_elevation=ELEVATION_ANGLE in judged)
    alone = {TURN_ANGLE: AT_TURN} if arm and count == 4 else {}
    alone |= {
        angle: AT_VALGUS for angle, hinge in SIDEWAYS_ANGLES.items() if hinge == names[3] and count == 4
    }
    couplings = _couplings(anatomy, readings, alone)
    branches = 2
    if (
        ELEVATION_ANGLE in judged
        and ends[ROTATION_INDEX, 1] <= -BEYOND_ALL
        and ends[ROTATION_INDEX, 3] >= BEYOND_ALL
    ):
        # Elevation and turn are the same in both branches of the ball joint: the judge has but one, either.
        ball = names[: ROTATION_INDEX + 1]
        branches = 0 if any(c.of in ball or c.angle in ball for c in anatomy.couplings) else 1
    sinus = anatomy.sinus_of(joint)
    power = sinus.power if sinus else 0.0
    places = np.zeros(AT_COUPLED - AT_JUDGED)
    places[0] = len(judged)
    places[1 : len(judged) + 1] = [readings.index(name) for name in judged]
    return np.concatenate(
        [
            [rigid, count == 4, arm, branches],
            [power, LEAST_LEFT**power, SEAM_DEGREES, tolerance, unseen],
            turn,
            np.pad(signs, (0, 4 - count)),
            np.ravel(ends),
            places,
            couplings,
        ]
    )


def _ends(anatomy: Anatomy, names: tuple[str, ...], count: int, *, by_elevation: bool) -> Array:
    """Return the own ends of four angles: middle; lower mean and limit; upper mean and limit (4, 5)."""
    ends = np.empty((4, 5))
    for k, name in enumerate(names):
        (lower, below), (upper, above) = (anatomy.motions[name].end(side) for side in LIMIT_SIDES)
        low, high = lower - anatomy.spreads * below, upper + anatomy.spreads * above
        ends[k] = (lower + upper) / 2, lower, low, upper, high
        if k >= count or (by_elevation and k < ROTATION_INDEX):
            ends[k, 1:] = -BEYOND_ALL, -BEYOND_ALL, BEYOND_ALL, BEYOND_ALL
        for side, outward in OUTWARD_SIGNS.items():
            if name == "shoulder.rotation" and any(c.side == side for c in anatomy.couplings_of(TURN_ANGLE)):
                first = 1 if outward < 0 else 3
                ends[k, first : first + 2] = outward * BEYOND_ALL
    return ends


def _couplings(anatomy: Anatomy, readings: tuple[str, ...], alone: Mapping[str, int]) -> Array:
    """Return how many couplings bound one of some readings by another, then each with its knots, figure's degrees.

    What is bounded `alone`, without being judged itself, has a number of its own.
    """
    rows: list[Array] = []
    for coupling in anatomy.couplings:
        if coupling.angle not in (*readings, *alone) or coupling.of not in readings:
            continue
        zero = anatomy.motions[coupling.of].zero.mean if coupling.of in anatomy.motions else 0.0
        at = np.array(coupling.points)[:, 0] + zero
        mean, spread = anatomy.coupled(coupling, at)
        bounded = alone[coupling.angle] if coupling.angle in alone else readings.index(coupling.angle)
        row = [
            bounded,
            readings.index(coupling.of),
            OUTWARD_SIGNS[coupling.side],
            anatomy.spreads * spread,
            len(at),
        ]
        rows += [np.array(row), np.ravel(np.stack([at, mean], axis=-1))]
    return np.concatenate([[len(rows) // 2], *rows])
