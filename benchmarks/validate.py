"""Validating configurations against the bare calls behind it, and postures through inverse kinematics.

    python benchmarks/validate.py [--configurations 100000] [--postures 500] [--motion 100000] [--clips 1000]

Bare is one call of Pinocchio's `computeCollisionsInParallel` and one vectorised comparison with the limits, on the same
configurations, as many threads, in the same run; the ways take turns, and the least processor time of each counts:
what else runs on a shared machine only adds. `verdicts` is `Validator.check(q=…)`, whose margins are made when they
are looked at; these, the pairs that touch, and the nearest pair, are asked for on top. Ratios are of one run.

`motion` is frames in time, clips of a thousand, judged by all checks of postures and over time into one report,
given as configurations of a robot, or as positions of the stick figure; bare is the same as above on those frames.
`memory` is the most that the process took for so many clips of positions, and for the first tenth of them.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from posekit.body import load_figure
from posekit.body.pool import make_pool, n_threads
from posekit.formats.held import HeldPostures
from posekit.formats.own import NamedConfigurations, Postures
from posekit.robots import load_robot
from posekit.robots.joint_map import postures_of
from posekit.validation import ReportBuilder, WantedDetail
from posekit.validators import Validator

N_REPEATS = 7
RATE, CLIP_FRAMES = 50.0, 1000


def least(ways: dict[str, Callable[[], object]], repeats: int = N_REPEATS) -> dict[str, float]:
    """Time each way in turn, and return the least of each, seconds."""
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            start = time.process_time()
            way()
            seconds[name].append(time.process_time() - start)
    return {name: min(values) for name, values in seconds.items()}


def configurations(name: str, bodies: str, n: int) -> None:
    robot = load_robot(name)
    validator = Validator(robot, checks=("joint-range", "collision"), bodies=bodies)
    subject = validator._robot.models.own.subject
    model, geometry = subject.model, subject.geometry
    q = np.tile(pin.neutral(model), (n, 1))
    lower, upper = robot.lower[7:], robot.upper[7:]
    q[:, 7:] = np.random.default_rng(0).uniform(lower - 0.01, upper + 0.01, (n, len(lower)))
    columns, pool = np.asfortranarray(q.T), make_pool(model, geometry)

    def bare() -> np.ndarray:
        hit = np.asarray(pin.computeCollisionsInParallel(n_threads(), pool, columns, True)).astype(bool)
        return hit | ((q[:, 7:] < lower) | (q[:, 7:] > upper)).any(axis=1)

    expected, report = bare(), validator.check(q=q)
    near = np.abs(report.worst) < 0.01  # the tolerance of the limits, and rounding
    assert (report.invalid == expected)[~near].all(), "verdicts differ"
    seconds = least(
        {
            "bare": bare,
            "verdicts": lambda: validator.check(q=q).undecided,
            "margins": lambda: validator.check(q=q).worst,
        }
    )
    failing = q[np.flatnonzero(report.invalid)[:1000]]
    start = time.process_time()
    found = validator.check(q=failing).contacts()
    contacts = time.process_time() - start
    few = q[:1000]
    some = validator.check(q=few)
    start = time.process_time()
    some.contacts(nearest=not validator._robot.models.own.collision.has_meshes)
    nearest = time.process_time() - start
    print(
        f"{name:14} {len(subject.pair_names):4} pairs, {n} configurations, {report.invalid.mean():.0%} invalid: bare "
        f"{seconds['bare'] / n * 1e6:.2f} us each, verdicts {seconds['verdicts'] / n * 1e6:.2f} us, ratio "
        f"{seconds['verdicts'] / seconds['bare']:.2f}, with margins {seconds['margins'] / seconds['bare']:.2f}; naming "
        f"{len(found)} contacts {contacts / max(len(failing), 1) * 1e6:.1f} us for each that fails, "
        f"the nearest pair of every one {nearest / len(few) * 1e6:.0f} us"
    )


def postures(name: str, n: int) -> None:
    validator = Validator(name, lengths="model", bodies="capsules")
    robot = validator.robot
    assert robot is not None
    q = np.tile(pin.neutral(robot.model), (n, 1))
    q[:, 7:] = np.random.default_rng(1).uniform(robot.lower[7:], robot.upper[7:], (n, robot.model.nq - 7))
    kinematics = validator._robot.models.kinematics
    joints = postures_of(kinematics.positions(q), kinematics)[:, :14]
    validator.check(joints[:1])
    start = time.perf_counter()
    report = validator.check(joints)
    seconds = time.perf_counter() - start
    limits = next(one for one in report.judgements if one.check == "joint_range")
    worst = np.fmax.reduce(report.residual, axis=1)
    print(
        f"{name:14} {n} legal postures by their joints: {seconds / n * 1e3:.1f} ms each, "
        f"{(worst < 1e-3).mean():.1%} within 1 mm, {limits.violated.any(axis=1).mean():.1%} rejected for limits, "
        f"{np.isnan(limits.worst).mean():.1%} undecided"
    )


def moving(lower: np.ndarray, upper: np.ndarray, n: int) -> np.ndarray:
    """Return joint angles (n, len(lower)) that swing by a tenth of their ranges around zero, at 0.1 to 0.5 Hz.

    Where a range begins at zero they swing inside it: limbs that are straight to the last digit, for frames on end, are
    of no recording.
    """
    rng = np.random.default_rng(2)
    phase = np.arange(n)[:, None] / RATE * 2 * np.pi * rng.uniform(0.1, 0.5, len(lower))
    swing = 0.1 * (upper - lower)
    middle = np.clip(0.0, lower + swing, upper - swing)
    return np.asarray(middle + swing * np.sin(phase + rng.uniform(0, 2 * np.pi, len(lower))))


def motion(name: str, bodies: str, n: int) -> None:
    robot = load_robot(name)
    stick = name == "stick_figure"
    own = Validator(robot, bodies=bodies)
    subject = own._robot.models.own.subject
    model, geometry = subject.model, subject.geometry
    lower, upper = robot.lower[7:], robot.upper[7:]
    q = np.tile(pin.neutral(model), (n, 1))
    q[:, 7:] = moving(lower, upper, n)
    time_of = np.arange(n) / RATE
    columns, pool = np.asfortranarray(q.T), make_pool(model, geometry)
    validator = Validator(ground=-2.0) if stick else own
    joints = load_figure().forward_kinematics(q)[:, :14] if stick else np.empty(0)

    def bare() -> np.ndarray:
        hit = np.asarray(pin.computeCollisionsInParallel(n_threads(), pool, columns, True)).astype(bool)
        return hit | ((q[:, 7:] < lower) | (q[:, 7:] > upper)).any(axis=1)

    def judged() -> int:
        built = ReportBuilder(WantedDetail(detail="verdicts", files=n // CLIP_FRAMES))
        for first in range(0, n, CLIP_FRAMES):
            rows = slice(first, first + CLIP_FRAMES)
            given = (
                posture_clip(joints[rows]) if stick else NamedConfigurations(q=q[rows], time=time_of[rows])
            )
            built.add(validator, given, file=str(first))
        return len(built.report())

    judged()
    seconds = least({"bare": bare, "motion": judged}, 2)
    print(
        f"{name:14} {n} frames of motion, {len(subject.pair_names)} pairs: bare {seconds['bare'] / n * 1e6:.2f} us "
        f"each, with all checks {seconds['motion'] / n * 1e6:.1f} us, ratio {seconds['motion'] / seconds['bare']:.2f}"
    )


def posture_clip(joints: np.ndarray) -> HeldPostures:
    frame = np.arange(len(joints))
    held = HeldPostures(
        postures=Postures(joints=joints), frame=frame, clip=0 * frame, time=frame / RATE, up="+z"
    )
    return held


def memory(clips: int) -> None:
    lower, upper = (
        np.asarray(one) for one in (load_robot("stick_figure").lower, load_robot("stick_figure").upper)
    )
    figure = load_figure()
    validator, frames = Validator(), 50
    q = np.tile(pin.neutral(figure.model), (frames, 1))
    q[:, 7:] = moving(lower[7:], upper[7:], frames)
    joints = figure.forward_kinematics(q)[:, :14]
    most = []
    built = ReportBuilder(WantedDetail(detail="margins", files=clips))
    for k in range(clips):
        built.add(validator, posture_clip(joints * (1 + 1e-4 * (k % 100))), file=f"clips/walk{k}.npz")
        if k + 1 in (clips // 10, clips):
            most.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    print(
        f"{clips} clips of {frames} frames: at most {most[0]:.0f} MiB for the first tenth, {most[1]:.0f} MiB for all"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--configurations", type=int, default=100_000)
    parser.add_argument("--postures", type=int, default=500)
    parser.add_argument("--motion", type=int, default=100_000)
    parser.add_argument("--clips", type=int, default=1000)
    given = parser.parse_args()
    memory(given.clips)
    motion("g1", "urdf", given.motion // 10)
    motion("human", "capsules", given.motion)
    motion("stick_figure", "urdf", given.motion)
    configurations("stick_figure", "urdf", given.configurations)
    configurations("human", "capsules", given.configurations)
    configurations("talos", "urdf", given.configurations // 50)
    for name in ("human", "talos", "simple_humanoid", "g1"):
        postures(name, given.postures)


if __name__ == "__main__":
    main()
