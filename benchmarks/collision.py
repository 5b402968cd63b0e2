"""Collision checking: Pinocchio's batch call against the plain Python loop, on the same configurations.

    python benchmarks/collision.py [--configurations 20000]

Random configurations inside all limits; verdicts must be equal. Also the same postures judged pair by pair, as the
interpretation tree does it, through models of two free capsules. Ratios are of one run on one machine.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import pinocchio as pin

from posekit.body import load_figure
from posekit.validators import collision


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--configurations", type=int, default=20_000)
    n = parser.parse_args().configurations
    figure, rng = load_figure(), np.random.default_rng(0)
    q = np.tile(pin.neutral(figure.model), (n, 1))
    lower, upper = figure.limits.lower, figure.limits.upper
    q[:, figure.angle_index] = rng.uniform(lower, upper, (n, len(lower)))
    points, columns = figure.forward_kinematics(q), np.asfortranarray(q.T)
    model, geometry = figure.model, figure.geometry
    data, geometry_data = model.createData(), geometry.createData()
    pool = pin.GeometryPool(model, geometry, 2)
    checks = collision(figure)

    def loop() -> np.ndarray:
        return np.array([pin.computeCollisions(model, data, geometry, geometry_data, row, True) for row in q])

    def batch(threads: int) -> np.ndarray:
        return np.asarray(pin.computeCollisionsInParallel(threads, pool, columns, True)).astype(bool)

    def pairs() -> np.ndarray:
        verdict = np.zeros(n, dtype=bool)
        for check in checks:
            verdict |= check.judge(points[:, list(check.points)]).violated[:, 0]
        return verdict

    ways = (
        ("Python loop over computeCollisions", loop),
        ("computeCollisionsInParallel, 1 thread", lambda: batch(1)),
        ("computeCollisionsInParallel, 2 threads", lambda: batch(2)),
        ("pair by pair, spheres then coal", pairs),
    )
    reference, first = None, 0.0
    for name, way in ways:
        way()
        start = time.perf_counter()
        verdict = way()
        seconds = time.perf_counter() - start
        reference = verdict if reference is None else reference
        first = first or seconds
        same = int((verdict == reference).sum())
        print(
            f"{name:40} {seconds / n * 1e6:7.2f} us {first / seconds:6.2f} x   verdicts equal: {same} of {n}"
        )
    print(
        f"{len(figure.collision_pairs)} pairs; {reference.mean():.1%} collide"
        if reference is not None
        else ""
    )


if __name__ == "__main__":
    main()
