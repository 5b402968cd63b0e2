"""One frame of a sequence: its survivors, what each costs, how sure its joints are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import JOINTS

MAX_COORDINATE_METRES = 1e6
"""Metres beyond which a joint is taken for a mistake."""

MAX_SECONDS = 1e12
"""Seconds, of either sign, beyond which a time is taken for a mistake: thirty thousand years."""

MAX_DEVIATION_METRES = 1e3
"""Metres beyond which a standard deviation is taken for a mistake."""


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurvivorFrame:
    """The N survivors of one frame; N may be 0.

    Parameters
    ----------
    time : float
        Seconds.
    joints : array (N, 14, 3)
        Camera frame, metres; NaN where a joint is not known. A survivor without any joint is never chosen.
    cost : array (N,), optional
        Minus the logarithm of each survivor's probability; zero if not given, infinite for an impossible one.
    deviation : array (N, 14), optional
        Standard deviation of each joint, metres, the root of its covariance's trace; what the covariance says if not
        given, zero without one. It may be NaN where the joint is.
    covariance : array (N, 14, 3, 3), optional
        Of each joint, square metres; that deviation in all directions alike if not given.
    branches : sequence of str (N,), optional
        The branch code of each, near 0 and far 1.

    Raises
    ------
    InputError
        Where a shape is wrong or a number impossible.

    Examples
    --------
    >>> SurvivorFrame(time=0.0, joints=np.zeros((2, 14, 3))).cost.tolist()
    [0.0, 0.0]
    """

    time: float
    joints: Array
    cost: Array = field(default_factory=_none)
    deviation: Array = field(default_factory=_none)
    covariance: Array = field(default_factory=_none)
    branches: Sequence[str] = ()

    def __post_init__(self) -> None:
        where = f"frame at {self.time!r} s"
        if not abs(self.time) <= MAX_SECONDS:
            fault = "beyond what is a time" if math.isfinite(self.time) else "not finite"
            raise InputError(f"{where}: the time is {fault}; give every frame its time in seconds")
        joints = np.array(self.joints, dtype=np.float64)
        if joints.ndim != 3 or joints.shape[1:] != (len(JOINTS), 3):
            raise InputError(
                f"{where}: joints have shape {joints.shape}; expected (N, {len(JOINTS)}, 3), metres"
            )
        partly = np.asarray(np.isnan(joints).any(axis=2))
        if (np.abs(np.where(partly[..., None], 0.0, joints)) > MAX_COORDINATE_METRES).any() or np.isinf(
            joints
        ).any():
            raise InputError(
                f"{where}: a joint is farther than {MAX_COORDINATE_METRES:g} m; expected metres, NaN where not known"
            )
        joints[partly] = np.nan
        n = len(joints)
        cost = _filled("cost", self.cost, (n,), where)
        if np.isnan(cost).any() or (cost == -np.inf).any():
            raise InputError(
                f"{where}: a cost is {'NaN' if np.isnan(cost).any() else '-inf'}; expected -log probability"
            )
        told = np.asarray(self.covariance, dtype=np.float64)
        covariance = _filled("covariance", told, (n, len(JOINTS), 3, 3), where)
        deviation = _filled("deviation", self.deviation, (n, len(JOINTS)), where)
        if np.asarray(self.deviation).shape == (0,):
            deviation = np.sqrt(np.trace(covariance, axis1=2, axis2=3))
        elif told.shape == (0,):
            covariance = (deviation**2 / 3)[..., None, None] * np.eye(3)
        covariance[partly] = 0.0
        deviation[partly] = 0.0
        if not ((deviation >= 0) & (deviation <= MAX_DEVIATION_METRES)).all():
            raise InputError(
                f"{where}: a deviation is negative, NaN or above {MAX_DEVIATION_METRES:g} m; expected metres"
            )
        branches = tuple(self.branches)
        if branches and len(branches) != n:
            raise InputError(
                f"{where}: {len(branches)} branch codes for {n} survivors; expected one each, or none"
            )
        for name, value in (
            ("joints", joints),
            ("cost", cost),
            ("deviation", deviation),
            ("covariance", covariance),
        ):
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        object.__setattr__(self, "branches", branches)

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.joints)


def _filled(name: str, given: Array, shape: tuple[int, ...], where: str) -> Array:
    array = np.array(given, dtype=np.float64)
    if array.shape == (0,) and shape[0] != 0:
        return np.zeros(shape)
    if array.shape != shape and not (array.size == 0 and shape[0] == 0):
        raise InputError(f"{where}: {name} has shape {array.shape}; expected {shape}")
    return array.reshape(shape)


def check_frames(frames: Sequence[SurvivorFrame]) -> None:
    """Check that there are frames and that their times ascend.

    Raises
    ------
    InputError
        Otherwise.
    """
    if not frames:
        raise InputError("a sequence has no frames; give at least one")
    for k in range(1, len(frames)):
        check_order(frames[k - 1].time, frames[k].time, k)


def check_order(before: float, after: float, number: int) -> None:
    """Check that a frame comes after the one before it, so late that speeds are finite."""
    if not after - before > 1e-6:
        raise InputError(
            f"frame {number} is at {after:g} s, the one before at {before:g} s; expected ascending times, "
            "more than a microsecond apart; leave out a picture that is given twice"
        )
