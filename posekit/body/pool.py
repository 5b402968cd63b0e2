"""Batched collision verdicts: Pinocchio's pool of models, with coal behind it."""

from __future__ import annotations

import os

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.errors import FigureError
from posekit.geometry import Array

SMALL_BATCH = 2000
"""Configurations below which a second thread costs more than it brings."""


def n_threads() -> int:
    """Return how many threads a pool may use: the cores that this process has, at most two.

    More threads than cores cost ten times the time.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(2, cores)


def make_pool(model: pin.Model, geometry: pin.GeometryModel) -> pin.GeometryPool:
    """Make a pool for `collides`, as large as it may have threads."""
    return pin.GeometryPool(model, geometry, n_threads())


def collides(pool: pin.GeometryPool, q: Array) -> NDArray[np.bool_]:
    """Ask coal which configurations penetrate in a pair that is to be checked.

    Parameters
    ----------
    q : array (nq, N)
        Configurations as columns.

    Raises
    ------
    FigureError
        Where a configuration is not finite: Pinocchio would call it free.
    """
    if not np.isfinite(q).all():
        raise FigureError("a configuration is not finite; whether it collides cannot be said")
    threads = 1 if q.shape[1] < SMALL_BATCH else n_threads()
    verdicts = pin.computeCollisionsInParallel(threads, pool, np.asfortranarray(q), True)
    return np.asarray(verdicts).astype(bool)
