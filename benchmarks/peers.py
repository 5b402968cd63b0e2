"""The same jobs with posekit and with other programs, in one run: verdicts, collisions, inverse kinematics.

    python -m benchmarks.peers [--states 2000] [--postures 200]

Collisions of the figure: Pinocchio's batched call, MuJoCo if it is installed, and `Validator.check`, which also judges
limits and names every finding. Inverse kinematics of the robot `human`: the batch of `Robot.configurations`, and a loop
of damped least squares in Pinocchio, clipped to the limits, as in usual scripts. A posture is met if every point is
within 1 mm.
"""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.common import least, parser, table, timed
from benchmarks.robots import states
from posekit.body import load_figure
from posekit.geometry import Array
from posekit.robots import Robot, load_robot
from posekit.validators import Validator

MET_METRES = 1e-3
MAX_STEPS, DAMPING = 100, 1e-6


def with_mujoco(robot: Robot, q: Array) -> Any:
    """Return a call that counts the contacts of configurations in MuJoCo; None if it cannot load the URDF."""
    if importlib.util.find_spec("mujoco") is None:
        return None
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_string(robot.urdf)
    except ValueError as error:
        print(f"MuJoCo cannot load {robot.name}: {error}")
        return None
    data = mujoco.MjData(model)

    def judge() -> int:
        count = 0
        for row in q:
            data.qpos[:] = row[-model.nq :]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            count += data.ncon > 0
        return count

    return judge


def loop(robot: Robot, targets: Array, starts: Array) -> Array:
    """Solve each posture by damped least squares on finite differences of the robot's points."""
    model, found = robot.model, starts.copy()
    data, eps = model.createData(), 1e-6
    for k, target in enumerate(targets):
        q = found[k]
        for _ in range(MAX_STEPS):
            here = robot.points(q[None])[0]
            error = np.nan_to_num(target - here).ravel()
            if np.abs(error).max() < MET_METRES / 10:
                break
            moved = np.stack([pin.integrate(model, q, eps * one) for one in np.eye(model.nv)])
            J = np.nan_to_num((robot.points(moved) - here) / eps).reshape(model.nv, -1).T
            step = np.linalg.solve(J.T @ J + DAMPING * np.eye(model.nv), J.T @ error)
            q = pin.integrate(model, q, step * min(1.0, 0.5 / np.abs(step).max()))
            q[7:] = np.clip(q[7:], robot.lower[7:], robot.upper[7:])
        found[k] = q
    pin.forwardKinematics(model, data, found[-1])
    return found


def met(robot: Robot, q: Array, targets: Array) -> float:
    """Return the share of postures whose points are all met."""
    away = np.linalg.norm(np.nan_to_num(robot.points(q) - targets), axis=-1).max(axis=1)
    return float((away < MET_METRES).mean())


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--states", type=int, default=2000)
    made.add_argument("--postures", type=int, default=200)
    made.add_argument("--loop", type=int, default=10, help="postures for the loop")
    given = made.parse_args()
    rng, figure = np.random.default_rng(given.seed), load_figure()
    q = states(figure, given.states, 0.5, rng)
    columns, pool = np.asfortranarray(q.T), pin.GeometryPool(figure.model, figure.geometry, 1)
    by_q, by_joints, joints = Validator(figure), Validator(), figure.points(q)[:, :14]
    ways = {
        "figure: Pinocchio's pool, first contact": lambda: pin.computeCollisionsInParallel(
            1, pool, columns, True
        ),
        "figure: Validator.check(q)": lambda: by_q.check(q),
        "figure: Validator.check(joints), ranges too": lambda: by_joints.check(joints),
    }
    mujoco = with_mujoco(figure, q)
    if mujoco:
        ways["figure: MuJoCo's loop, all contacts"] = mujoco
    spent = least(ways, 3)
    base = spent["figure: Pinocchio's pool, first contact"]
    rows = [(n, f"{1e6 * t / given.states:.1f}", f"{t / base:.2f}") for n, t in spent.items()]
    print(table(("way", "µs a state", "ratio"), rows))

    human = load_robot("human", bodies="none")
    goal = states(human, given.postures, 0.5, rng)
    targets, few = human.points(goal), given.loop
    near = goal.copy()
    near[:, 7:] = np.clip(
        goal[:, 7:] + rng.choice([-0.1, 0.1], near[:, 7:].shape), human.lower[7:], human.upper[7:]
    )
    found: dict[str, Array] = {}
    seconds = {
        "Robot.configurations, cold": timed(lambda: found.update(cold=human.configurations(targets)[0]))
        / given.postures,
        "Robot.configurations, warm": timed(
            lambda: found.update(warm=human.configurations(targets, start=near)[0])
        )
        / given.postures,
        "a loop in Pinocchio, warm": timed(lambda: found.update(loop=loop(human, targets[:few], near[:few])))
        / few,
    }
    shares = [met(human, one, targets[: len(one)]) for one in found.values()]
    print(
        table(
            ("inverse kinematics of human", "ms a posture", "met"),
            [
                (name, f"{1000 * t:.2f}", f"{share:.0%}")
                for (name, t), share in zip(seconds.items(), shares, strict=True)
            ],
        )
    )


if __name__ == "__main__":
    main()
