"""Synthetic views of robots: random configurations, projected by a scaled orthographic camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posekit.errors import nearest, refusal, shown
from posekit.geometry import Array

if TYPE_CHECKING:
    from posekit.robots import Robot

#: Scale of the pictures, pixels per metre.
PIXELS_PER_METRE: Final = 500.0


def random_configurations(robot: Robot, n: int, rng: np.random.Generator) -> Array:
    """Draw configurations (n, nq) within the joint limits; a free base has a random rotation.

    Parameters
    ----------
    robot : Robot
        The robot. Angles are uniform within the joint limits; ranges without limits, or of more than one full turn, are
        one full turn.
    n : int
        Number of configurations.
    rng : Generator
        Random number generator.

    Raises
    ------
    InputError
        If n is not positive.
    """
    if n < 1:
        raise refusal("", "frames", str(n), "1 or more", "ask for more")
    model = robot.model
    q = np.tile(robot.neutral, (n, 1))
    # Joints with one angle come first, then joints with cosine and sine, then floating joints.
    for j in sorted(range(1, model.njoints), key=lambda j: model.nqs[j]):
        at, size = model.idx_qs[j], model.nqs[j]
        if size == 1:
            lower, upper = max(model.lowerPositionLimit[at], -1e3), min(model.upperPositionLimit[at], 1e3)
            if upper - lower > 2 * math.pi:  # the range of one turn nearest to zero
                lower = min(max(lower, -math.pi), upper - 2 * math.pi)
                upper = lower + 2 * math.pi
            q[:, at] = rng.uniform(lower, upper, n)
        elif size == 2:
            angle = rng.uniform(-np.pi, np.pi, n)
            q[:, at], q[:, at + 1] = np.cos(angle), np.sin(angle)
        elif size == 7:
            turned = rng.standard_normal((n, 4))
            q[:, at + 3 : at + 7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return robot.with_mimics(q)


def object_view(
    robot: Robot, points: Sequence[str], n: int, rng: np.random.Generator, *, noise: float = 0.0
) -> tuple[Array, Array]:
    """Draw random configurations, each seen from a random direction by a scaled orthographic camera.

    Parameters
    ----------
    robot : Robot
        A robot with a free base.
    points : sequence of P str
        Links or joints whose origins are the image points.
    n : int
        Number of frames.
    rng : Generator
        Random number generator.
    noise : float
        Standard deviation of each coordinate of the image points, pixels.

    Returns
    -------
    image : array (n, P, 2)
        Image points, pixels, y down, at the scale `PIXELS_PER_METRE`.
    truth : array (n, P, 3)
        Positions of the points in the camera frame, metres.

    Raises
    ------
    InputError
        If a point is not a link or joint of the robot.
    """
    from posekit.robots.kinematics import frame_places

    names = [frame.name for frame in robot.model.frames]
    for point in points:
        if point not in names:
            expected = f"a link or joint of {robot.name}"
            raise refusal(robot.name, "points", shown(point), expected, nearest(point, names))
    q = random_configurations(robot, n, rng)
    truth = frame_places(robot.model, q, [names.index(point) for point in points])
    image = truth[..., :2] * PIXELS_PER_METRE
    return image + noise * rng.normal(size=image.shape) if noise else image, truth


def object_document(
    points: Sequence[str], image: Array, truth: Array, *, scale: float | None = None
) -> dict[str, Any]:
    """Return the JSON content of a view of an articulated object (schema ``posekit.view/1``), in metres and pixels.

    Parameters
    ----------
    points : sequence of P str
        Names of the points.
    image, truth : array (F, P, 2) and (F, P, 3)
        Image points, pixels, and true positions, camera frame, metres.
    scale : float, optional
        Pixels per metre; None if the view does not state the scale.
    """
    frames = [
        {
            "time": float(k),
            "image": dict(zip(points, seen.tolist(), strict=True)),
            "truth": dict(zip(points, true.tolist(), strict=True)),
        }
        for k, (seen, true) in enumerate(zip(image, truth, strict=True))
    ]
    camera = {"model": "scaled-orthographic", "scale": scale}
    return {"schema": "posekit.view/1", "unit": "m", "camera": camera, "frames": frames}
