"""Inverse kinematics with limits: the batched solver against pink's loop, on the same postures of the same model.

    python benchmarks/inverse_kinematics.py [--robot human] [--postures 1000] [--pink 50]

Random configurations inside the limits (clipped to half a turn); targets are their mapped joints. Cold: from nothing
but the targets (pink starts at the neutral configuration, its base where posekit's solution has it). Warm: from the
configuration itself with every joint 0.1 rad off, as along a sequence. Met: no point is 1 mm off, joints within the
limits. pink takes its steps, each a quadratic program, until the posture is met, at most 200. Times and ratios are of
one run on one machine.

pink is no dependency: `pip install pin-pink quadprog` adds it to the table.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import time

import numpy as np
import pinocchio as pin

from posekit.robots import load_robot
from posekit.robots.ik import InverseKinematics
from posekit.robots.joint_map import find_joint_map
from posekit.robots.kinematics import Kinematics

MAX_STEPS = 200
MET_METRES = 1e-3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="human")
    parser.add_argument("--postures", type=int, default=1000)
    parser.add_argument("--pink", type=int, default=50, help="postures for pink's loop")
    options = parser.parse_args()
    model = load_robot(options.robot, geometry=False).model
    kinematics = find_joint_map(model).kinematics(model)
    rng = np.random.default_rng(0)
    q = random_configurations(kinematics, options.postures, rng)
    targets = kinematics.positions(q)
    off = np.zeros((len(q), model.nv))
    off[:, kinematics.space.bounded_v] = rng.choice([-0.1, 0.1], (len(q), len(kinematics.space.bounded_v)))
    near = np.clip(kinematics.space.integrate(q, off), kinematics.space.lower, kinematics.space.upper)

    start = time.perf_counter()
    solver = InverseKinematics(kinematics=kinematics)
    solver.solve(targets[:1])
    print(f"{options.robot}: {len(kinematics.points)} points, {model.nv} degrees of freedom")
    print(f"{'tables of starts, once':34} {time.perf_counter() - start:8.2f} s")
    times = {}
    for way, begin in (("cold", None), ("warm", near)):
        start = time.perf_counter()
        solution = solver.solve(targets, start=begin)
        times[way] = (time.perf_counter() - start) / len(q)
        report(f"posekit, {way}, a batch of {len(q)}", times[way], solution.residual.max(axis=1))
    some = targets[: options.pink]
    start = time.perf_counter()
    worst = [solver.solve(target[None]).residual.max() for target in some]
    report("posekit, cold, one at a time", (time.perf_counter() - start) / len(some), np.array(worst))

    if importlib.util.find_spec("pink") is None or importlib.util.find_spec("quadprog") is None:
        print("pink is not installed, so it is not compared: pip install pin-pink quadprog")
        return
    laid = solver.solve(some).q.copy()
    laid[:, 7:] = np.clip(kinematics.neutral, kinematics.space.lower, kinematics.space.upper)[7:]
    for way, begin in (("cold", laid), ("warm", near)):
        start = time.perf_counter()
        worst = [pink_loop(kinematics, *pair) for pair in zip(some, begin[: len(some)], strict=True)]
        seconds = (time.perf_counter() - start) / len(some)
        report(f"pink, {way}", seconds, np.array(worst))
        print(f"{'':34} {seconds / times[way]:8.1f} times posekit's batch")


def random_configurations(kinematics: Kinematics, n: int, rng: np.random.Generator) -> np.ndarray:
    space = kinematics.space
    dv = np.zeros((n, space.nv))
    for first in space.free_v:
        dv[:, first : first + 6] = rng.normal(size=(n, 6))
    q = space.integrate(np.tile(kinematics.neutral, (n, 1)), dv)
    at = space.bounded_q
    q[:, at] = rng.uniform(
        np.clip(space.lower[at], -np.pi, np.pi), np.clip(space.upper[at], -np.pi, np.pi), (n, len(at))
    )
    return q


def pink_loop(kinematics: Kinematics, targets: np.ndarray, start: np.ndarray) -> float:
    """Step with pink until the posture is met; return the largest distance that is left."""
    pink, tasks, limits = (importlib.import_module(f"pink{part}") for part in ("", ".tasks", ".limits"))
    model = kinematics.model
    # A start on a limit makes pink's program infeasible by rounding: a little inside it is not.
    at, space = kinematics.space.bounded_q, kinematics.space
    start = start.copy()
    start[at] = np.clip(start[at], space.lower[at] + 1e-6, space.upper[at] - 1e-6)
    configuration = pink.Configuration(model, model.createData(), start)
    wanted = []
    for point, target in zip(kinematics.points, targets, strict=True):
        task = tasks.FrameTask(point.sites[0].frame, position_cost=1.0, orientation_cost=0.0, lm_damping=1e-6)
        task.set_target(pin.SE3(np.eye(3), target))
        wanted.append(task)
    bounds = [limits.ConfigurationLimit(model, config_limit_gain=1.0)]
    worst = np.inf
    for _ in range(MAX_STEPS):
        velocity = pink.solve_ik(
            configuration, wanted, 1.0, solver="quadprog", damping=1e-8, limits=bounds, safety_break=False
        )
        configuration.integrate_inplace(velocity, 1.0)
        worst = float(np.linalg.norm(kinematics.positions(configuration.q[None])[0] - targets, axis=1).max())
        if worst < MET_METRES:
            break
    return worst


def report(name: str, seconds: float, worst: np.ndarray) -> None:
    print(
        f"{name:34} {seconds * 1e3:8.2f} ms a posture, {(worst < MET_METRES).mean():6.1%} met, "
        f"median {np.median(worst):.1e} m"
    )


if __name__ == "__main__":
    main()
