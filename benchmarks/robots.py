"""Validation of a robot's configurations, compared with loops over Pinocchio's functions on the same states.

    python -m benchmarks.robots [--robot g1] [--states 2000] [--verdicts 20000] [--spread 0.5] [--data DIR]

With `--data` states are from files of motion; otherwise they are uniform in a share of the joints' ranges about the
middle. Methods: `pin.computeCollisions` per state, stopped at the first contact; Pinocchio's broad phase over the
meshes, and over their convex hulls; `Validator.check` with every finding. Verdicts on collision must equal those of
`pin.computeCollisions` in all states.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import posekit
from benchmarks.common import data_of, files_below, least, parser, table
from posekit.errors import PosekitError
from posekit.geometry import Array
from posekit.motion import Motion
from posekit.robots import Robot, load_robot
from posekit.validators import Validator


def states(robot: Robot, count: int, spread: float, rng: np.random.Generator) -> Array:
    """Draw configurations (count, nq) in a share of each range about its middle; the root does not move."""
    q = np.tile(robot.neutral, (count, 1))
    bounded = (
        np.isfinite(robot.lower) & np.isfinite(robot.upper) & (np.arange(q.shape[1]) >= 7 * robot.free_flyer)
    )
    low, high = robot.lower[bounded], robot.upper[bounded]
    middle, half = (low + high) / 2, spread * (high - low) / 2
    q[:, bounded] = rng.uniform(middle - half, middle + half, (count, int(bounded.sum())))
    return q


def recorded(robot: Robot, name: str, paths: list[Path], count: int) -> Array:
    """Take configurations evenly from files of the robot's motion."""
    found = []
    for file in files_below(paths):
        try:
            motion = posekit.open(file, urdf=name)
        except PosekitError:
            continue
        if isinstance(motion, Motion) and motion.q is not None and motion.q.shape[1] == robot.model.nq:
            found.append(motion.q[np.isfinite(motion.q).all(axis=1)])
    q = np.concatenate(found)
    return q[np.linspace(0, len(q) - 1, count).astype(np.intp)]


def pairwise(robot: Robot, geometry: pin.GeometryModel, q: Array) -> NDArray[np.bool_]:
    """Call `pin.computeCollisions` for each state, up to its first contact."""
    model = robot.model
    data, geometry_data = model.createData(), geometry.createData()
    return np.array([pin.computeCollisions(model, data, geometry, geometry_data, row, True) for row in q])


def broad_phase(robot: Robot, geometry: pin.GeometryModel, q: Array) -> NDArray[np.bool_]:
    """Test collisions with Pinocchio's dynamic tree of bounding boxes of some bodies."""
    model = robot.model
    data, geometry_data = model.createData(), geometry.createData()
    manager = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(model, geometry, geometry_data)
    return np.array([pin.computeCollisions(model, data, manager, row, True) for row in q])


def hulls_of(geometry: pin.GeometryModel) -> pin.GeometryModel:
    """Copy a geometry with each mesh replaced by its convex hull."""
    hulls = geometry.copy()
    for body in hulls.geometryObjects:
        if hasattr(body.geometry, "buildConvexHull"):
            body.geometry.buildConvexHull(True, "Qt")
            body.geometry = body.geometry.convex
    return hulls


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--robot", default="g1")
    made.add_argument("--states", type=int, default=2000)
    made.add_argument("--verdicts", type=int, default=0)
    made.add_argument("--spread", type=float, default=0.5)
    made.add_argument("--repeats", type=int, default=3)
    given = made.parse_args()
    robot, rng = load_robot(given.robot), np.random.default_rng(given.seed)
    drawn = states(robot, given.states, given.spread, rng)
    q = recorded(robot, given.robot, data_of(given), given.states) if data_of(given) else drawn
    validator = Validator(robot)
    geometry: pin.GeometryModel = robot.geometry
    hulls = hulls_of(geometry)
    ways = {
        "pin.computeCollisions": lambda: pairwise(robot, geometry, q),
        "broad phase, meshes": lambda: broad_phase(robot, geometry, q),
        "broad phase, hulls": lambda: broad_phase(robot, hulls, q),
        "Validator.check": lambda: validator.check(q),
    }
    spent = least(ways, given.repeats)
    rate = {name: len(q) / seconds for name, seconds in spent.items()}
    base = rate["broad phase, meshes"]
    pairs, bodies = len(geometry.collisionPairs), geometry.ngeoms
    hit = pairwise(robot, geometry, q)
    print(f"{robot.name}: {bodies} bodies, {pairs} pairs, {hit.mean():.0%} of states in collision")
    rows = [(name, f"{each:.0f}", f"{each / base:.2f}") for name, each in rate.items()]
    print(table(("way", "states a second", "beside the broad phase over meshes"), rows))
    many = states(robot, given.verdicts, given.spread, rng) if given.verdicts else q
    expected, report = pairwise(robot, geometry, many), validator.check(many)
    column = report.findings["check"] == report.checks.index("collision")
    found = np.zeros(len(many), dtype=np.bool_)
    found[report.findings["row"][column]] = True
    print(f"verdicts on collision identical in {int((found == expected).sum())} of {len(many)} states")


if __name__ == "__main__":
    main()
