"""Random legal postures, and views of them from everywhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.settings import DEFAULT_RANGES
from posekit.synthesis.camera_sphere import CameraSphere
from posekit.synthesis.observe import observe
from posekit.synthesis.synthetic_scene import SyntheticScene
from posekit.tree import Check
from posekit.validators.joint_range import joint_range
from posekit.validators.ranges import URDF_RANGES, Ranges, load_ranges

UP_TORSO = np.array([0.0, 0.0, 1.0])
"""Up in the torso's frame at which the postures stand."""

LEAST_ACCEPTED = 1e-3
"""Fraction of draws free of collision below which it is said that the limits leave nothing to draw."""


def random_postures(
    figure: Figure, n: int, rng: np.random.Generator, ranges: str | Ranges = DEFAULT_RANGES
) -> Array:
    """Draw configurations uniform inside all limits of the figure, rejected until legal and free of collision.

    Parameters
    ----------
    figure : Figure
        `Figure.with_limits` narrows the ranges.
    n : int
        How many postures are drawn.
    rng : Generator
        The same seed gives the same postures.
    ranges : str or Ranges
        The joint ranges that they keep to beside the figure's limits: with ``urdf`` those are all.

    Returns
    -------
    array (n, nq)
        The torso at the origin, upright, facing +x.

    Raises
    ------
    InputError
        Where n is not positive, or hardly any posture inside the limits is legal and free of collision.
    """
    if n < 1:
        raise InputError(f"{n} postures were asked for; ask for one or more")
    lower, upper = figure.limits.lower, figure.limits.upper
    table = load_ranges(ranges) if isinstance(ranges, str) else ranges
    checks = [] if table is URDF_RANGES else joint_range(figure, table, tolerance=0.0)
    kept: list[Array] = []
    found = drawn = 0
    while found < n:
        missing = n - found
        rate = max(found / drawn, 0.1) if drawn else 1.0
        count = int(missing / rate * 1.1) + 16
        q = np.tile(pin.neutral(figure.model), (count, 1))
        q[:, figure.angle_index] = rng.uniform(lower, upper, (count, len(lower)))
        q = q[_legal(figure, checks, q)]
        kept.append(q[~figure.collides(q)])
        found += len(kept[-1])
        drawn += count
        if found < LEAST_ACCEPTED * drawn and drawn > 10 / LEAST_ACCEPTED:
            raise InputError(
                f"{found} of {drawn} random postures inside the limits are legal and free of collision; expected more "
                f"than {LEAST_ACCEPTED:g} of them; widen the limits or thin the capsules"
            )
    return np.concatenate(kept)[:n]


def _legal(figure: Figure, checks: Sequence[Check], q: Array) -> NDArray[np.bool_]:
    """Tell which configurations (N, nq) no check rejects (N,)."""
    points = figure.forward_kinematics(q)
    legal = np.ones(len(q), dtype=bool)
    for check in checks:
        legal[legal] = ~check.judge(points[legal][:, list(check.points)]).violated.any(axis=1)
    return legal


def random_views(
    figure: Figure,
    n: int,
    rng: np.random.Generator,
    sphere: CameraSphere | None = None,
    ranges: str | Ranges = DEFAULT_RANGES,
) -> SyntheticScene:
    """Draw random legal postures, each seen by its own camera.

    Parameters
    ----------
    figure : Figure
        The person: lengths, limits and capsules.
    n : int
        How many postures are drawn, each seen by a camera of its own.
    rng : Generator
        The same seed gives the same views.
    sphere : CameraSphere, optional
        Where cameras may stand, and what they are.
    ranges : str or Ranges
        See `random_postures`.

    Returns
    -------
    SyntheticScene
        n independent frames, all points in front of their camera and inside the picture.

    Raises
    ------
    InputError
        See `random_postures` and `CameraSphere.place`.
    """
    sphere = sphere or CameraSphere()
    q = random_postures(figure, n, rng, ranges)
    points = figure.forward_kinematics(q)
    placements = sphere.place(points, UP_TORSO, rng)
    return observe(figure, sphere.camera, points, placements, q=q, size=sphere.size)
