"""The compiled loop of anatomical limbs: where it is sure, it says what the judge says."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from posekit.figure import load_figure
from posekit.skeleton import DOFS
from posekit.tree import PASSED, UNSURE
from posekit.validators import Ranges, joint_range, load_ranges
from posekit.validators.anatomical import Anatomy
from posekit.validators.anatomical_checks import AnatomicalLimb

FIGURE = load_figure()
TABLE = load_ranges("anatomical")
assert TABLE.anatomy is not None
ANATOMY: Anatomy = TABLE.anatomy


def without(*angles: str) -> Anatomy:
    return replace(ANATOMY, couplings=tuple(c for c in ANATOMY.couplings if c.angle not in angles))


TABLES = {
    "the table": ANATOMY,
    "no sinus": replace(ANATOMY, sinuses=()),
    "an ellipsoid": replace(ANATOMY, sinuses=(replace(ANATOMY.sinuses[0], power=2.0),)),
    "no couplings": replace(ANATOMY, couplings=()),
    "arms by flexion and abduction": without("shoulder.elevation"),
    "arms by their rotation": without("shoulder.turn"),
    "means": replace(ANATOMY, spreads=0.0),
}


def limbs(anatomy: Anatomy, tolerance: float) -> list[AnatomicalLimb]:
    ranges = Ranges(name="mine", kind="configuration", limits=anatomy.limits(), anatomy=anatomy)
    checks = joint_range(FIGURE, ranges, tolerance=tolerance)
    return [check for check in checks if isinstance(check, AnatomicalLimb)]


def postures(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw postures (n, 19, 3): half with angles around the limits, half with any."""
    limits = np.array([TABLE.limits[dof] for dof in DOFS])
    middle, half = limits.mean(axis=1), np.ptp(limits, axis=1) / 2
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    angles = middle + rng.uniform(-1.1, 1.1, (n, len(DOFS))) * half
    angles[n // 2 :] = rng.uniform(-180, 180, (n - n // 2, len(DOFS)))
    q[:, FIGURE.angle_index] = np.radians(angles)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.asarray(FIGURE.forward_kinematics(q) @ (turn * np.sign(np.linalg.det(turn))).T)


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("tolerance", [0.0, 2.0])
def test_what_is_clear_is_what_the_judge_says(name: str, tolerance: float) -> None:
    points = postures(np.random.default_rng(3), 160)
    unsure = 0
    for check in limbs(TABLES[name], tolerance):
        own = np.ascontiguousarray(points[:, check.points])
        places, presumed = check.screen(own)
        violated = check.judge(own).violated
        first = np.where(violated.any(axis=1), violated.argmax(axis=1), PASSED)
        assert presumed is None
        clear = places != UNSURE
        np.testing.assert_array_equal(places[clear], first[clear])
        unsure += int((~clear).sum())
        assert (first[clear] != PASSED).any() or len(check.where) == 1
        assert (first[clear] == PASSED).any()
    assert unsure < 0.15 * len(points) * 8


def test_what_cannot_be_judged_is_left_to_the_judge() -> None:
    points = postures(np.random.default_rng(4), 6)
    for check in limbs(ANATOMY, 1e-3):
        for k in range(len(check.points)):
            own = np.ascontiguousarray(points[:, check.points])
            own[0, k] = np.nan
            own[1, k] = np.inf
            own[2, :] = own[2, :1]
            with np.errstate(invalid="ignore"):
                places, _ = check.screen(own)
            assert (places[:3] == UNSURE).all()
        assert check.screen(np.empty((0, len(check.points), 3)))[0].shape == (0,)


def test_a_straight_limb_is_left_to_the_judge() -> None:
    q = np.tile(pin.neutral(FIGURE.model), (3, 1))
    q[1, FIGURE.angle_index] += 1e-9
    points = FIGURE.forward_kinematics(q)
    for check in limbs(ANATOMY, 1e-3):
        if len(check.limb) == 3:
            assert (check.screen(np.ascontiguousarray(points[:, check.points]))[0] == UNSURE).all()
