r"""Distances smoothed over time: what noise does to depth is large, and different in each frame.

Each joint's distance from the camera is taken to move with a random acceleration, white noise of the spectral density
:math:`q`, and to be known in each frame within its deviation (Rauch, Tung & Striebel 1965, "Maximum likelihood
estimates of linear dynamic systems", AIAA J. 3:1445). It stays on its ray. Then the segments get their lengths back,
from the neck outward, which takes joints off their rays again, by as much as the smoothing changed lengths.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.following.channels import directions
from posekit.following.motion_model import USUAL_ACCELERATION
from posekit.geometry import Array
from posekit.skeleton import JOINTS, TREE_SEGMENTS

ACCELERATION_CORRELATION_SECONDS: Final = 0.05
"""Seconds over which an acceleration lasts: q is its square times this."""

MIN_DEVIATION_METRES: Final = 1e-4
"""The least standard deviation that a joint is given, metres: no distance is known better."""


def smooth(
    time: ArrayLike,
    joints: ArrayLike,
    deviation: ArrayLike,
    *,
    acceleration: ArrayLike = USUAL_ACCELERATION,
    root_alone: bool = False,
) -> tuple[Array, Array]:
    """Smooth a path's distances from the camera, keeping every segment's length in every frame.

    Parameters
    ----------
    time : array (T,)
        Seconds, ascending.
    joints : array (T, 14, 3)
        A path, camera frame, metres; NaN where not known.
    deviation : float or array broadcastable to (T, 14)
        Of each joint along its ray, metres; infinite for what was interpolated.
    acceleration : float or array (14,)
        How large accelerations are, metres a second squared.
    root_alone : bool
        Only the neck's distance is smoothed, and the posture goes with it.

    Returns
    -------
    joints : array (T, 14, 3)
    deviation : array (T, 14)
        Of the smoothed distances, before lengths are restored, metres.

    Raises
    ------
    InputError
        Where a shape is wrong, times do not ascend, or a number is impossible.
    """
    times = np.asarray(time, dtype=np.float64)
    path = np.array(joints, dtype=np.float64)
    if path.ndim != 3 or path.shape[1:] != (len(JOINTS), 3) or np.isinf(path).any():
        raise InputError(
            f"joints have shape {path.shape}; expected (T, {len(JOINTS)}, 3), finite or NaN, metres"
        )
    if times.shape != path.shape[:1] or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise InputError(f"time has shape {times.shape}; expected {path.shape[:1]}, ascending, seconds")
    try:
        given = np.broadcast_to(np.asarray(deviation, dtype=np.float64), path.shape[:2])
        sudden = np.broadcast_to(np.asarray(acceleration, dtype=np.float64), len(JOINTS))
    except ValueError:
        raise InputError(
            f"deviation or acceleration does not fit {path.shape[:2]}, frames and joints"
        ) from None
    if not (given >= 0).all() or not (np.isfinite(sudden) & (sudden > 0)).all():
        raise InputError("deviation must be zero or more, and acceleration positive and finite")
    count = 1 if root_alone else len(JOINTS)
    distance = np.linalg.norm(path, axis=2)
    known = np.isfinite(distance) & (distance > 0)
    variance = np.where(known, np.maximum(given, MIN_DEVIATION_METRES) ** 2, np.inf)
    smoothed, spread = rts(
        times,
        np.where(known, distance, 0.0)[:, :count],
        variance[:, :count],
        ACCELERATION_CORRELATION_SECONDS * sudden[:count] ** 2,
    )
    ratio = np.where(known[:, :count], smoothed / np.where(known[:, :count], distance[:, :count], 1.0), 1.0)
    moved = path.copy()
    moved[:, :count] *= ratio[:, :, None]
    result = np.concatenate([spread, np.full((len(times), len(JOINTS) - count), np.nan)], axis=1)
    if root_alone:
        return path + (moved[:, :1] - path[:, :1]), result
    return _with_lengths(moved, path), result


def _with_lengths(moved: Array, path: Array) -> Array:
    """Give the segments of postures (T, 14, 3) the lengths that they have in a path."""
    unit, _ = directions(moved)
    _, length = directions(path)
    kept = moved.copy()
    for segment, (start, end) in enumerate(TREE_SEGMENTS):
        placed = kept[:, start] + length[:, segment, None] * unit[:, segment]
        kept[:, end] = np.where(np.isnan(placed), kept[:, end], placed)
    return kept


def rts(time: Array, value: Array, variance: Array, density: Array) -> tuple[Array, Array]:
    """Smooth C quantities that move with white-noise acceleration.

    Parameters
    ----------
    time : array (T,)
        Ascending.
    value, variance : array (T, C)
        What was measured; an infinite variance where nothing was.
    density : array (C,)
        Spectral density of the acceleration, per second.

    Returns
    -------
    value, deviation : array (T, C)
        NaN where a quantity was never measured.
    """
    frames, count = value.shape
    measured = np.isfinite(variance)
    mean = np.zeros((frames, count, 2))
    covariance = np.zeros((frames, count, 2, 2))
    ahead_mean, ahead = np.zeros_like(mean), np.zeros_like(covariance)
    now = np.zeros((count, 2))
    first = np.argmax(measured, axis=0)
    now[:, 0] = value[first, np.arange(count)]
    P = np.zeros((count, 2, 2))
    P[:, 0, 0], P[:, 1, 1] = 1e6, 1e6  # nothing is known before the first frame
    for k in range(frames):
        if k:
            dt = float(time[k] - time[k - 1])
            F, noise = _moves(dt)
            now = now @ F.T
            P = F @ P @ F.T + density[:, None, None] * noise
        ahead_mean[k], ahead[k] = now, P
        seen = measured[k]
        total = P[:, 0, 0] + np.where(seen, variance[k], 1.0)
        gain = np.where(seen[:, None], P[:, :, 0] / total[:, None], 0.0)
        now = now + gain * (value[k] - now[:, 0])[:, None]
        # Joseph's form keeps covariances symmetric and positive.
        keep = np.eye(2) - gain[:, :, None] * np.array([1.0, 0.0])
        noise = np.where(seen, variance[k], 0.0)[:, None, None] * gain[:, :, None] * gain[:, None, :]
        P = keep @ P @ keep.transpose(0, 2, 1) + noise
        mean[k], covariance[k] = now, P
    for k in range(frames - 2, -1, -1):
        F, _ = _moves(float(time[k + 1] - time[k]))
        gain_back = np.linalg.solve(ahead[k + 1], F @ covariance[k]).transpose(0, 2, 1)
        mean[k] += (gain_back @ (mean[k + 1] - ahead_mean[k + 1])[..., None])[..., 0]
        covariance[k] += gain_back @ (covariance[k + 1] - ahead[k + 1]) @ gain_back.transpose(0, 2, 1)
    none = ~measured.any(axis=0)
    spread = np.sqrt(np.maximum(covariance[:, :, 0, 0], 0.0))
    return np.where(none, np.nan, mean[:, :, 0]), np.where(none, np.nan, spread)


def _moves(dt: float) -> tuple[Array, Array]:
    if not (math.isfinite(dt) and dt > 0):
        raise InputError(f"two frames are {dt!r} s apart; expected ascending times")
    F = np.array([[1.0, dt], [0.0, 1.0]])
    return F, np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
