"""The compiled loop of anatomical limbs: where it is sure, it says what the judge says."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.compiled.verdicts import NO_VIOLATION, NOT_CLEAR
from posekit.skeleton import DOFS, JOINT, SIDES
from posekit.tree import screened
from posekit.validators import Ranges, joint_range, load_ranges
from posekit.validators.anatomical import Anatomy, Coupling
from posekit.validators.anatomical_checks import AnatomicalLimb

FIGURE = load_figure()
TABLE = load_ranges("anatomical")
assert TABLE.anatomy is not None
ANATOMY: Anatomy = TABLE.anatomy


def without(*angles: str) -> Anatomy:
    return replace(ANATOMY, couplings=tuple(c for c in ANATOMY.couplings if c.angle not in angles))


def bounded(angle: str, of: str, *points: tuple[float, float], spread: float = 5.0) -> Coupling:
    return Coupling(angle=angle, side="upper", of=of, points=points, spread=spread)


MORE = (
    bounded("hip.abduction", "hip.rotation", (-40.0, 20.0), (30.0, 45.0)),
    bounded("knee.flexion", "hip.flexion", (-10.0, 110.0), (100.0, 150.0)),
    bounded("elbow.flexion", "shoulder.rotation", (-60.0, 120.0), (0.0, 150.0), (60.0, 130.0)),
    bounded("shoulder.flexion", "elbow.flexion", (0.0, 170.0), (140.0, 120.0)),
)

TABLES = {
    "the table": ANATOMY,
    "no sinus": replace(ANATOMY, sinuses=()),
    "an ellipsoid": replace(ANATOMY, sinuses=(replace(ANATOMY.sinuses[0], power=2.0),)),
    "no couplings": replace(ANATOMY, couplings=()),
    "arms by flexion and abduction": without("shoulder.elevation"),
    "arms by their rotation": without("shoulder.turn"),
    "means": replace(ANATOMY, spreads=0.0),
    "legs by rotation": replace(ANATOMY, couplings=(*ANATOMY.couplings, *MORE[:2])),
    "couplings of rotations": replace(ANATOMY, couplings=(*ANATOMY.couplings, *MORE[:3])),
    "the same, arms by flexion": replace(without("shoulder.elevation"), couplings=MORE),
    "one turn": replace(
        ANATOMY,
        couplings=tuple(c for c in ANATOMY.couplings if (c.angle, c.side) != ("shoulder.turn", "upper")),
    ),
}


ONE_OF_TWO = "couplings of rotations"
"""Where an arm's hinge depends on its rotation, the judge takes that of one branch: screens do not know which."""


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


def compare(check: AnatomicalLimb, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what the screen says of postures, and what the judge; where the screen is sure they are the same."""
    own = np.ascontiguousarray(points[:, check.points])
    with np.errstate(invalid="ignore"):
        places = screened([check.rule], [range(own.shape[1])], own)[0][:, 0]
        violated = check.judge(own).violated
    first = np.where(violated.any(axis=1), violated.argmax(axis=1), NO_VIOLATION)
    assert not check.rule.presumed
    clear = places != NOT_CLEAR
    np.testing.assert_array_equal(places[clear], first[clear])
    return places, first


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("tolerance", [0.0, 2.0])
def test_what_is_clear_is_what_the_judge_says(name: str, tolerance: float) -> None:
    points = postures(np.random.default_rng(3), 160)
    unsure = []
    for check in limbs(TABLES[name], tolerance):
        places, first = compare(check, points)
        assert (first != NO_VIOLATION).any() or len(check.where) == 1
        assert (first == NO_VIOLATION).any()
        unsure.append((places == NOT_CLEAR).mean())
    assert name == ONE_OF_TWO or np.mean(unsure) < 0.1


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("tolerance", [0.0, 1e-3, 2.0])
def test_limbs_whose_end_is_hidden_are_judged_by_what_is_seen(name: str, tolerance: float) -> None:
    points = postures(np.random.default_rng(5), 160)
    points[:, [JOINT[f"{side}_{end}"] for side in SIDES for end in ("wrist", "ankle")]] = np.nan
    lost = 0
    for check in limbs(TABLES[name], tolerance):
        if len(check.limb) == 3:
            places, first = compare(check, points)
            assert name == ONE_OF_TWO or (places == NOT_CLEAR).mean() < 0.02
            lost += int((first != NO_VIOLATION).sum())
    assert lost > 0


@pytest.mark.parametrize("bend", [0.0, 1e-12, 1e-9, 1e-7, 3e-6, 2e-5, 1e-2])
@pytest.mark.parametrize("name", ["the table", "legs by rotation", ONE_OF_TWO])
@pytest.mark.parametrize("tolerance", [0.0, 1e-3, 2.0])
def test_straight_limbs_are_clear_where_their_rotation_is_not_seen(
    tolerance: float, name: str, bend: float
) -> None:
    rng = np.random.default_rng(6)
    limits = np.array([TABLE.limits[dof] for dof in DOFS])
    angles = np.radians(limits[:, 0] + rng.uniform(-0.1, 1.1, (80, len(DOFS))) * np.ptp(limits, axis=1))
    angles[:, [k for k, dof in enumerate(DOFS) if "elbow" in dof or "knee" in dof]] = bend
    q = np.tile(pin.neutral(FIGURE.model), (len(angles), 1))
    q[:, FIGURE.angle_index] = angles
    points = FIGURE.forward_kinematics(q)
    for check in limbs(TABLES[name], tolerance):
        if len(check.limb) == 3:
            places, first = compare(check, points)
            if name == "the table" and bend < np.radians(tolerance) / 1000:
                assert (places == NOT_CLEAR).mean() < 0.01
                assert (first == NO_VIOLATION).any() and (first != NO_VIOLATION).any()
            # What depends on a rotation that could be any is left to the judge.
            if tolerance == 0.0 and bend <= 1e-9:
                assert (places == NOT_CLEAR).all()


@pytest.mark.parametrize("name", TABLES)
def test_angles_at_poles_limits_and_seams_are_never_judged_otherwise(name: str) -> None:
    rng = np.random.default_rng(7)
    limits = np.array([TABLES[name].limits()[dof] for dof in DOFS])
    knots = [knot for coupling in TABLES[name].couplings for knot in np.ravel(coupling.points)]
    values = np.stack(
        [*limits.T, *np.full((22, 8), [0, 90, -90, 180, -115, 45, 60, 24]).T, limits.mean(axis=1)]
    )
    angles = values[rng.integers(0, len(values), (200, 22)), np.arange(22)]
    if knots:
        at_knot = rng.random(angles.shape) < 0.2
        angles[at_knot] = rng.choice(knots, at_knot.sum())
    q = np.tile(pin.neutral(FIGURE.model), (len(angles), 1))
    q[:, FIGURE.angle_index] = np.radians(angles)
    points = FIGURE.forward_kinematics(q)
    points += rng.choice([0.0, 1e-14, 1e-11, 1e-9, 1e-6], (len(points), 1, 1)) * rng.normal(size=points.shape)
    for tolerance in (0.0, 1e-3, 2.0):
        for check in limbs(TABLES[name], tolerance):
            compare(check, points)


def test_what_cannot_be_judged_passes_or_is_left_to_the_judge() -> None:
    points = postures(np.random.default_rng(4), 6)
    for check in limbs(ANATOMY, 1e-3):
        for k, point in enumerate(check.points):
            some = points.copy()
            some[0, point] = np.nan
            some[1, point] = np.inf
            some[2] = some[2, :1]
            places, _ = compare(check, some)
            if k < len(check.points) - 1 or len(check.limb) == 2:
                assert places[0] == NO_VIOLATION
            assert (places[1:3] == NOT_CLEAR).all()
        assert screened([check.rule], [check.points], np.empty((0, 19, 3)))[0].shape == (0, 1)
