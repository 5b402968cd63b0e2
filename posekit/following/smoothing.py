r"""A path smoothed over time: what noise does to depth is large, and different in each frame.

Each joint is taken to move with a random acceleration, white noise of the spectral density :math:`q`, and to be known
in each frame within its covariance: along its ray much worse than across it (Rauch, Tung & Striebel 1965, "Maximum
likelihood estimates of linear dynamic systems", AIAA J. 3:1445). Then the segments get their lengths back, from the
neck outward.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.following.channels import directions
from posekit.following.kalman import MIN_DEVIATION_METRES, density_of
from posekit.following.motion_model import USUAL_ACCELERATION
from posekit.geometry import Array
from posekit.skeleton import JOINTS, TREE_SEGMENTS

START_DEVIATION: Final = 10.0
"""Metres and metres a second by which a joint may be off, before any frame, from where it is first seen at rest."""


def smooth(
    time: ArrayLike,
    joints: ArrayLike,
    deviation: ArrayLike,
    *,
    acceleration: ArrayLike = USUAL_ACCELERATION,
    root_alone: bool = False,
    lengths_of: Array | None = None,
) -> tuple[Array, Array]:
    """Smooth a path, keeping every segment's length in every frame.

    Parameters
    ----------
    time : array (T,)
        Seconds, ascending.
    joints : array (T, 14, 3)
        A path, camera frame, metres; NaN where not known.
    deviation : float or array broadcastable to (T, 14), or array (T, 14, 3, 3)
        Of each joint, alike in all directions, metres: the root of its covariance's trace; or that covariance, square
        metres. Infinite for what was interpolated.
    acceleration : float or array (14,)
        How large accelerations are, metres a second squared.
    root_alone : bool
        Only the neck is smoothed, and the posture goes with it.
    lengths_of : array (T, 14, 3), optional
        The postures whose segments have the lengths; the path's own if not given.

    Returns
    -------
    joints : array (T, 14, 3)
    deviation : array (T, 14)
        The root of the trace of each joint's covariance, before lengths are restored, metres.

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
    given = np.asarray(deviation, dtype=np.float64)
    try:
        sudden = np.broadcast_to(np.asarray(acceleration, dtype=np.float64), len(JOINTS))
        if given.ndim < 4:
            if not (given >= 0).all():
                raise InputError("deviation must be zero or more")
            spread = np.broadcast_to(given, path.shape[:2])[..., None, None] ** 2 / 3
            given = np.where(np.isinf(spread), np.inf, np.where(np.isinf(spread), 0.0, spread) * np.eye(3))
        given = np.broadcast_to(given, (*path.shape, 3))
    except ValueError:
        raise InputError(
            f"deviation or acceleration does not fit {path.shape[:2]}, frames and joints"
        ) from None
    if not (np.isfinite(sudden) & (sudden > 0)).all():
        raise InputError("acceleration must be positive and finite")
    count = 1 if root_alone else len(JOINTS)
    known = np.asarray(np.isfinite(path).all(axis=2) & np.isfinite(given).all(axis=(2, 3)))
    smoothed, spread = rts(
        times,
        path[:, :count],
        np.where(known[..., None, None], given, 0.0)[:, :count] + MIN_DEVIATION_METRES**2 * np.eye(3),
        known[:, :count],
        density_of(sudden[:count]),
    )
    moved = path.copy()
    moved[:, :count] = np.where(np.isnan(path[:, :count]) | np.isnan(smoothed), path[:, :count], smoothed)
    result = np.full(path.shape[:2], np.nan)
    result[:, :count] = spread
    if root_alone:
        return path + (moved[:, :1] - path[:, :1]), result
    return _with_lengths(moved, path if lengths_of is None else lengths_of), result


def _with_lengths(moved: Array, path: Array) -> Array:
    """Give the segments of postures (T, 14, 3) the lengths that they have in a path."""
    unit, _ = directions(moved)
    _, length = directions(path)
    kept = moved.copy()
    for segment, (start, end) in enumerate(TREE_SEGMENTS):
        placed = kept[:, start] + length[:, segment, None] * unit[:, segment]
        kept[:, end] = np.where(np.isnan(placed), kept[:, end], placed)
    return kept


def rts(
    time: Array, value: Array, covariance: Array, measured: NDArray[np.bool_], density: Array
) -> tuple[Array, Array]:
    """Smooth C points over T frames.

    Parameters
    ----------
    time : array (T,)
        Seconds, ascending.
    value : array (T, C, 3)
        Metres.
    covariance : array (T, C, 3, 3)
        Of what was measured, square metres.
    measured : bool array (T, C)
        Which were.
    density : array (C,)
        Of the random acceleration, square metres a second cubed.

    Returns
    -------
    value, deviation : array (T, C, 3), (T, C)
        NaN where a point was never measured; the root of the trace of its covariance.
    """
    frames, count = value.shape[:2]
    first = np.argmax(measured, axis=0)
    now = np.zeros((count, 6))
    now[:, :3] = np.where(np.asarray(measured.any(axis=0))[:, None], value[first, np.arange(count)], 0.0)
    P = np.broadcast_to(START_DEVIATION**2 * np.eye(6), (count, 6, 6))
    ahead, after = [], []
    for k in range(frames):
        if k:
            F, noise = _moves(float(time[k] - time[k - 1]))
            now = now @ F.T
            P = F @ P @ F.T + density[:, None, None] * noise
        ahead.append((now, P))
        seen = measured[k]
        gain = P[:, :, :3] @ np.linalg.inv(P[:, :3, :3] + covariance[k])
        gain = np.where(seen[:, None, None], gain, 0.0)
        off = np.where(seen[:, None], value[k] - now[:, :3], 0.0)
        now = now + (gain @ off[..., None])[..., 0]
        # Joseph's form keeps covariances symmetric and positive.
        keep = np.eye(6) - gain @ np.eye(3, 6)
        P = keep @ P @ keep.swapaxes(1, 2) + gain @ covariance[k] @ gain.swapaxes(1, 2)
        after.append((now, P))
    mean, spread = np.empty((frames, count, 3)), np.empty((frames, count))
    for k in range(frames - 1, -1, -1):
        if k < frames - 1:
            F, _ = _moves(float(time[k + 1] - time[k]))
            own, own_P = after[k]
            back = np.linalg.solve(ahead[k + 1][1], F @ own_P).swapaxes(1, 2)
            now = own + (back @ (now - ahead[k + 1][0])[..., None])[..., 0]
            P = own_P + back @ (P - ahead[k + 1][1]) @ back.swapaxes(1, 2)
        mean[k] = now[:, :3]
        spread[k] = np.sqrt(np.maximum(np.trace(P[:, :3, :3], axis1=1, axis2=2), 0.0))
    never = np.asarray(~measured.any(axis=0))
    return np.where(never[:, None], np.nan, mean), np.where(never, np.nan, spread)


def _moves(dt: float) -> tuple[Array, Array]:
    """Return how places and velocities go on for a time, and what a random acceleration of density one adds."""
    if not (math.isfinite(dt) and dt > 0):
        raise InputError(f"two frames are {dt!r} s apart; expected ascending times")
    one = np.eye(3)
    F = np.kron(np.array([[1.0, dt], [0.0, 1.0]]), one)
    return F, np.kron(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]), one)
