"""What the tests of objects share: robots with postures that their limits allow."""

import numpy as np
import pinocchio as pin
import pytest

from posekit.objects import (
    load_object,
)
from posekit.robots.kinematics import Kinematics, body_points


@pytest.fixture(scope="module")
def robots():
    """Return a way to draw a robot by name, with postures within its limits (n, P, 3), metres."""
    found = {}

    def of(name, n=3, seed=0):
        if name not in found:
            found[name] = load_object(name)
        thing = found[name]
        assert thing.robot is not None
        model = thing.robot.model
        kinematics = Kinematics(model=model, points=body_points(thing.linkage.points))
        rng = np.random.default_rng(seed)
        q = np.tile(pin.neutral(model), (n, 1))
        for at in kinematics.space.bounded_q:
            lower, upper = np.clip([kinematics.space.lower[at], kinematics.space.upper[at]], -np.pi, np.pi)
            q[:, at] = rng.uniform(lower, upper, n)
        turned = rng.standard_normal((n, 4))
        q[:, 3:7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        return thing, kinematics.positions(q)

    return of
