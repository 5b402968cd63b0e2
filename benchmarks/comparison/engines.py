"""Collision engines on the same configurations of the figure: what each costs, and where verdicts differ.

Each is asked the same: do any of these pairs of capsules penetrate, each configuration anew, one thread, stopping at
the first where the engine can. Those without a batched call are asked from Python, as a user would.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.comparison.export import mjcf, urdf
from benchmarks.comparison.measure import Chart, Section, Sizes, least, microseconds, version
from posekit.body import Figure, load_figure

Array = NDArray[np.float64]
Verdicts = NDArray[np.bool_]

TOUCHING_METRES = 1e-6
"""Metres: two engines may differ about bodies that are so near to touching."""


class Engine(NamedTuple):
    """An engine: what it is called, and what judges configurations (N, nq)."""

    name: str
    judge: Callable[[Array], Verdicts]


def engines(figure: Figure) -> tuple[list[Engine], list[str]]:
    """Make all engines that are installed, and say which are not."""
    found, missing = [pool(figure), loop(figure)], []
    for name, package, make in (
        ("MuJoCo", "mujoco", with_mujoco),
        ("PyBullet", "pybullet", with_pybullet),
        ("python-fcl", "python-fcl", with_fcl),
    ):
        if version(package):
            found.append(make(figure))
        else:
            missing.append(f"{name}: {package} is not installed")
    return found, missing


def pool(figure: Figure) -> Engine:
    """Pinocchio's batched call: coal's verdicts, the reference."""
    geometry_pool = pin.GeometryPool(figure.model, figure.geometry, 1)

    def judge(q: Array) -> Verdicts:
        return np.asarray(pin.computeCollisionsInParallel(1, geometry_pool, q.T, True)).astype(bool)

    return Engine("pool", judge)


def loop(figure: Figure) -> Engine:
    """Make the same calls one by one, from Python."""
    model, geometry = figure.model, figure.geometry
    data, geometry_data = model.createData(), geometry.createData()

    def judge(q: Array) -> Verdicts:
        return np.array([pin.computeCollisions(model, data, geometry, geometry_data, one, True) for one in q])

    return Engine("Python loop", judge)


def with_mujoco(figure: Figure) -> Engine:
    """MuJoCo's kinematics and narrow phase, without dynamics."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(figure.model, figure.geometry))
    data = mujoco.MjData(model)
    own = figure.model
    order = [0, 1, 2, 6, 3, 4, 5]  # its quaternions begin with w
    place = np.empty(own.nq, dtype=np.intp)
    place[:7] = order
    for joint in range(2, own.njoints):
        place[model.joint(own.names[joint]).qposadr[0]] = own.idx_qs[joint]

    def judge(q: Array) -> Verdicts:
        verdicts = np.zeros(len(q), dtype=bool)
        for k, one in enumerate(q[:, place]):
            data.qpos[:] = one
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            verdicts[k] = data.ncon > 0
        return verdicts

    return Engine("MuJoCo", judge)


def with_pybullet(figure: Figure) -> Engine:
    """Bullet's discrete detection between links."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    model, geometry = figure.model, figure.geometry
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "figure.urdf"
        path.write_text(urdf(model, geometry), encoding="utf-8")
        body = pybullet.loadURDF(str(path), flags=pybullet.URDF_USE_SELF_COLLISION, physicsClientId=client)
    joints = range(pybullet.getNumJoints(body, physicsClientId=client))
    link = {pybullet.getBodyInfo(body, physicsClientId=client)[0].decode(): -1}
    index = []
    for joint in joints:
        info = pybullet.getJointInfo(body, joint, physicsClientId=client)
        link[info[12].decode()] = joint
        index.append(int(model.idx_qs[model.getJointId(info[1].decode())]))
    # One link a joint here: pairs of bodies are pairs of links where no joint carries two of them.
    carrier = [link[model.names[one.parentJoint]] for one in geometry.geometryObjects]
    wanted = {(carrier[pair.first], carrier[pair.second]) for pair in geometry.collisionPairs}
    if len(set(carrier)) != len(carrier):
        raise SystemExit(
            "PyBullet: two bodies on one joint; pairs of links would be more than those asked for"
        )
    for a in (-1, *joints):
        for b in range(a + 1, len(joints)):
            on = int((a, b) in wanted or (b, a) in wanted)
            pybullet.setCollisionFilterPair(body, body, a, b, on, physicsClientId=client)

    def judge(q: Array) -> Verdicts:
        verdicts = np.zeros(len(q), dtype=bool)
        reset, detect = pybullet.resetJointStatesMultiDof, pybullet.performCollisionDetection
        for k, one in enumerate(q):
            pybullet.resetBasePositionAndOrientation(body, one[:3], one[3:7], physicsClientId=client)
            reset(body, list(joints), [[one[at]] for at in index], physicsClientId=client)
            detect(physicsClientId=client)
            # Points that are no contact any more are kept for a while, with the distance they have now.
            found = pybullet.getContactPoints(body, body, physicsClientId=client)
            verdicts[k] = any(point[8] < 0 for point in found)
        return verdicts

    return Engine("PyBullet", judge)


def with_fcl(figure: Figure) -> Engine:
    """FCL through python-fcl, placed by Pinocchio's forward kinematics: it has none of its own."""
    import fcl

    model, geometry = figure.model, figure.geometry
    data, geometry_data = model.createData(), geometry.createData()
    bodies = [
        fcl.CollisionObject(fcl.Capsule(one.geometry.radius, 2 * one.geometry.halfLength))
        for one in geometry.geometryObjects
    ]
    pairs = [(bodies[pair.first], bodies[pair.second]) for pair in geometry.collisionPairs]

    def judge(q: Array) -> Verdicts:
        verdicts = np.zeros(len(q), dtype=bool)
        for k, one in enumerate(q):
            pin.updateGeometryPlacements(model, data, geometry, geometry_data, one)
            for body, place in zip(bodies, geometry_data.oMg, strict=True):
                body.setTransform(fcl.Transform(place.rotation, place.translation))
            verdicts[k] = any(fcl.collide(a, b) for a, b in pairs)
        return verdicts

    return Engine("python-fcl", judge)


def random_configurations(figure: Figure, count: int, seed: int = 0) -> Array:
    """Draw configurations within the limits; many collide."""
    q = np.tile(pin.neutral(figure.model), (count, 1))
    limits = figure.limits
    q[:, figure.angle_index] = np.random.default_rng(seed).uniform(
        limits.lower, limits.upper, (count, len(limits.lower))
    )
    return q


def least_distances(figure: Figure, q: Array) -> Array:
    """Return the least distance of all pairs in each configuration, metres; negative is penetration."""
    model, geometry = figure.model, figure.geometry
    data, geometry_data = model.createData(), geometry.createData()
    found = []
    for one in q:
        pair = pin.computeDistances(model, data, geometry, geometry_data, one)
        found.append(geometry_data.distanceResults[pair].min_distance)
    return np.array(found)


class Comparison(NamedTuple):
    """Verdicts beside the reference's: how many are equal, and the distances (m) where they are not."""

    equal: int
    asked: int
    touching: int
    distances: Array


def compare(figure: Figure, q: Array, verdicts: Verdicts, reference: Verdicts) -> Comparison:
    """Compare verdicts; where bodies nearly touch, differing is counted apart."""
    wrong = np.flatnonzero(verdicts != reference)
    distances = least_distances(figure, q[wrong])
    touch = np.abs(distances) <= TOUCHING_METRES
    return Comparison(
        equal=len(q) - len(wrong), asked=len(q), touching=int(touch.sum()), distances=distances[~touch]
    )


def section(sizes: Sizes) -> Section:
    """Measure the engines."""
    figure = load_figure()
    q = random_configurations(figure, sizes.configurations)
    few = q[: sizes.slow]
    found, missing = engines(figure)
    reference = found[0].judge(few)
    compared = {one.name: compare(figure, few, one.judge(few), reference) for one in found}
    costs = least({one.name: (lambda one=one: one.judge(few)) for one in found}, sizes.repeats)  # type: ignore[misc]
    base = costs["pool"].cpu
    rows = [
        (
            name,
            microseconds(cost.cpu, len(few)),
            f"{cost.cpu / base:.1f}",
            f"{compared[name].equal} of {len(few)}",
            _said(compared[name]),
        )
        for name, cost in costs.items()
    ]
    return Section(
        title="Collision engines",
        text=f"{len(few)} random configurations within the stick figure's limits, {len(figure.collision_pairs)} pairs "
        f"of capsules, {reference.mean():.0%} collide; one thread each.",
        head=("engine", "µs a configuration", "times the pool", "verdicts as the pool's", "where not"),
        rows=rows,
        ratios={f"pool against {name}": cost.cpu / base for name, cost in costs.items() if name != "pool"},
        charts=(
            Chart(
                name="engines",
                title="Judging a configuration",
                y="µs of one core",
                bars={name: cost.cpu / len(few) * 1e6 for name, cost in costs.items()},
                log="y",
            ),
        ),
        left_out=tuple(missing),
    )


def _said(one: Comparison) -> str:
    parts = []
    if one.touching:
        parts.append(f"{one.touching} within {TOUCHING_METRES:g} m of touching")
    if len(one.distances):
        parts.append(", ".join(f"{distance:.2g} m" for distance in one.distances[:5]))
    return "; ".join(parts)
