"""Rules for a torso that gives, fitted on all clips but the one they judge: for `benchmarks/torso.py`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from torso_views import Torsos, per_spine_length  # type: ignore[import-not-found]  # the script beside this one

from posekit.settings import MEASURED_TOLERANCE
from posekit.skeleton import RIGID_SEGMENTS

Floats = NDArray[np.float64]
Kept = NDArray[np.bool_]

TORSO_QUANTILE = 0.995
MIN_SPREAD_METRES = 0.005
"""Metres: least spread of a distance. The shoulders and hips of these recordings are rods; people's are not."""

SWEEP_FACTORS = (0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 6.0)
CHOSEN_TOLERANCES = np.array([MEASURED_TOLERANCE.distances.of(segment) for segment in RIGID_SEGMENTS])

BENDING_BASIS = np.array([[1.0, 0, 0, 0], [0, 0.5, 0.5, 0], [0, 0.5, -0.5, 0], [0, 0, 0, 1.0]])
"""Takes the four distances to width, shrug (both sides longer), side bend (one longer, one shorter) and hips."""


def crossed(torsos: Torsos, fit: Callable[[NDArray[np.bool_]], Floats]) -> Floats:
    """Fit on the true torsos of all clips but one, for each in turn; return what was fitted, by torso (T, …)."""
    clips = np.unique(torsos.clip)
    fitted = {clip: fit(torsos.branch & (torsos.clip != clip)) for clip in clips}
    return np.asarray(np.stack([fitted[clip] for clip in clips])[np.searchsorted(clips, torsos.clip)])


def uniform(torsos: Torsos) -> list[tuple[str, Kept]]:
    off = np.abs(torsos.off).max(axis=1)
    return [(f"{t * 100:g} cm", off <= t) for t in (0.005, 0.0075, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.08)]


def spread(off: Floats, rows: NDArray[np.bool_]) -> Floats:
    return np.asarray(np.maximum(np.quantile(np.abs(off[rows]), TORSO_QUANTILE, axis=0), MIN_SPREAD_METRES))


def earned(torsos: Torsos) -> list[tuple[str, Kept]]:
    """One bound a distance: so many times its spread."""
    spreads = crossed(torsos, lambda rows: spread(torsos.off, rows))
    times = (np.abs(torsos.off) / spreads).max(axis=1)
    return [(f"{k:g} spreads", times <= k) for k in SWEEP_FACTORS]


def hips_alone(torsos: Torsos) -> list[tuple[str, Kept]]:
    """Shoulders and sides as chosen; the hips from all that they are given to nearly nothing."""
    off = np.abs(torsos.off)
    others = (off[:, :3] <= CHOSEN_TOLERANCES[:3]).all(axis=1)
    return [
        (f"hips {t * 100:g} cm", others & (off[:, 3] <= t))
        for t in (0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02)
    ]


def one_sided(torsos: Torsos) -> list[tuple[str, Kept]]:
    """Likewise, longer and shorter each by its own spread."""

    def fit(rows: NDArray[np.bool_]) -> Floats:
        ends = np.quantile(torsos.off[rows], [1 - TORSO_QUANTILE, TORSO_QUANTILE], axis=0)
        return np.stack([np.minimum(ends[0], -MIN_SPREAD_METRES), np.maximum(ends[1], MIN_SPREAD_METRES)])

    ends = crossed(torsos, fit)
    times = np.maximum(torsos.off / ends[:, 0], torsos.off / ends[:, 1]).max(axis=1)
    return [(f"{k:g} spreads", times <= k) for k in SWEEP_FACTORS]


def bending(torsos: Torsos) -> list[tuple[str, Kept]]:
    """One bound for width, shrug, side bend and hips each."""
    off = torsos.off @ BENDING_BASIS.T
    times = (np.abs(off) / crossed(torsos, lambda rows: spread(off, rows))).max(axis=1)
    return [(f"{k:g} spreads", times <= k) for k in SWEEP_FACTORS]


def mahalanobis(torsos: Torsos) -> list[tuple[str, Kept]]:
    """All four at once, by their covariance; the floor is two deviations."""

    def fit(rows: NDArray[np.bool_]) -> Floats:
        off = torsos.off[rows]
        return np.asarray(np.linalg.inv(off.T @ off / len(off) + (MIN_SPREAD_METRES / 2) ** 2 * np.eye(4)))

    weight = crossed(torsos, fit)
    away = np.sqrt(np.einsum("ni,nij,nj->n", torsos.off, weight, torsos.off))
    return [(f"{k:g} deviations", away <= k) for k in (1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0)]


def sliding_spine(torsos: Torsos) -> list[tuple[str, Kept]]:
    """Bounds as chosen for shoulders and sides; hips as near as a spine that gives so much allows, to first order."""
    rate = np.abs(per_spine_length(torsos.joints)[:, 3])
    off = np.abs(torsos.off)
    sides = (off[:, :3] <= CHOSEN_TOLERANCES[:3]).all(axis=1)
    return [
        (f"{give * 1000:g} mm", sides & (off[:, 3] <= 0.002 + np.minimum(rate * give, 0.03)))
        for give in (0.0, 0.0005, 0.001, 0.002, 0.004, 0.008)
    ]


TORSO_RULES: dict[str, Callable[[Torsos], list[tuple[str, Kept]]]] = {
    "a: one tolerance for all": uniform,
    "b: one for each distance": earned,
    "b: the same, one-sided": one_sided,
    "b: 3 cm, but hips": hips_alone,
    "c: width, shrug, bend, hips": bending,
    "c: their covariance": mahalanobis,
    "d: a spine that gives": sliding_spine,
}
