"""Plausibility of angles: a density, flat inside, the same however a posture is written."""

from dataclasses import replace

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.skeleton import DOFS, SIDES
from posekit.validators import load_ranges
from posekit.validators.anatomical import Anatomy
from posekit.validators.anatomical_limb import writings
from posekit.validators.anatomical_plausibility import plausibility

TABLE = load_ranges("anatomical")
assert TABLE.anatomy is not None
ANATOMY: Anatomy = TABLE.anatomy
STANDING = np.zeros(22)
for _side in SIDES:
    STANDING[DOFS.index(f"{_side}_elbow.flexion")] = 60.0
    STANDING[DOFS.index(f"{_side}_knee.flexion")] = 70.0


def log_density(degrees: np.ndarray) -> np.ndarray:
    return plausibility(np.radians(degrees), ANATOMY)


def varied(dof: str, values: np.ndarray) -> np.ndarray:
    degrees = np.tile(STANDING, (len(values), 1))
    degrees[:, DOFS.index(dof)] = values
    return degrees


# What a coupling bounds is no density of one angle alone; rotations count by the bend; arms by their elevation.
FREE = [
    dof
    for dof in DOFS
    if dof.split("_")[-1]
    not in ("shoulder.flexion", "shoulder.abduction", "shoulder.rotation", "hip.rotation")
]


# A hinge bent a little backward is also a limb turned by half a turn: the more plausible of the two counts.
@pytest.mark.parametrize("dof", [dof for dof in FREE if "elbow" not in dof])
def test_it_is_a_density_over_each_angle(dof: str) -> None:
    values = np.linspace(-180.0, 180.0, 7201)
    logs = log_density(varied(dof, values))[:, DOFS.index(dof)]
    (lower, below), (upper, above) = (ANATOMY.motion(dof).end(side) for side in ("lower", "upper"))
    near = (values > lower - 6 * below) & (values < upper + 6 * above)
    density = np.where(near, np.exp(logs), 0.0)
    assert density.sum() * 0.05 == pytest.approx(1.0, abs=0.01)
    inside = (values >= lower) & (values <= upper)
    assert np.ptp(logs[inside]) == pytest.approx(0.0, abs=1e-9)
    one = log_density(varied(dof, np.array([upper + above, lower - below])))[:, DOFS.index(dof)]
    np.testing.assert_allclose(one - logs[inside][0], -0.5, atol=1e-9)


def test_it_is_the_postures_however_the_angles_are_written(rng: np.random.Generator) -> None:
    degrees = rng.uniform(-180, 180, (300, 22))
    expected = log_density(degrees)
    for joint, count in (("right_shoulder", 4), ("left_hip", 4), ("neck", 3), ("pelvis", 3)):
        first = DOFS.index(f"{joint}.flexion")
        limb = degrees[:, first : first + count]
        if count == 4:
            others = writings(limb)
        else:
            a, b, c = limb.T
            others = np.stack([np.stack([a + 180, 180 - b, c + 180], axis=-1)], axis=1)
        for k in range(others.shape[1]):
            written = degrees.copy()
            written[:, first : first + count] = others[:, k] + 360.0 * rng.integers(-1, 2, others[:, k].shape)
            np.testing.assert_allclose(log_density(written).sum(axis=1), expected.sum(axis=1), atol=1e-6)


def test_further_out_is_never_more_plausible() -> None:
    for dof in FREE:
        (lower, below), (upper, above) = (ANATOMY.motion(dof).end(side) for side in ("lower", "upper"))
        for start, step in ((upper, above), (lower, -below)):
            values = start + step * np.linspace(0, 3.7, 30)  # knees: short of half a turn
            logs = log_density(varied(dof, values)).sum(axis=1)
            assert (np.diff(logs) <= 1e-12).all()
            assert logs[-1] < logs[0] - 3


def test_couplings_count_at_the_angle_that_they_bound() -> None:
    hip, knee = DOFS.index("right_hip.flexion"), DOFS.index("right_knee.flexion")
    kick = varied("right_hip.flexion", np.array([110.0, 110.0]))
    kick[:, knee] = [0.0, 100.0]
    straight, bent = log_density(kick)
    assert straight[hip] < bent[hip] - 3
    np.testing.assert_allclose(np.delete(straight, hip), np.delete(bent, hip))
    arm = varied("right_shoulder.flexion", np.array([-62.0, -100.0]))
    near, beyond = log_density(arm)
    assert beyond[DOFS.index("right_shoulder.flexion")] < near[DOFS.index("right_shoulder.flexion")] - 3
    turned = varied("right_shoulder.rotation", np.array([60.0, 150.0]))
    here, there = log_density(turned)
    assert there[DOFS.index("right_shoulder.rotation")] < here[DOFS.index("right_shoulder.rotation")] - 3


def test_a_straight_limb_does_not_show_its_rotation() -> None:
    turned = varied("left_shoulder.rotation", np.array([0.0, 150.0]))
    turned[:, DOFS.index("left_elbow.flexion")] = 0.0
    straight = log_density(turned)
    np.testing.assert_allclose(straight[0], straight[1], atol=1e-12)


def test_couplings_and_spreads_only_narrow(rng: np.random.Generator) -> None:
    degrees = rng.uniform(-120, 120, (200, 22))
    hips = [DOFS.index(f"{side}_hip.flexion") for side in SIDES]
    bare = replace(ANATOMY, couplings=tuple(c for c in ANATOMY.couplings if c.angle != "hip.flexion"))
    with_, without = (plausibility(np.radians(degrees), table)[:, hips] for table in (ANATOMY, bare))
    assert (with_ <= without + 1e-9).mean() > 0.95  # where another writing is not the better one
    assert (with_ < without - 1).any()
    np.testing.assert_array_equal(
        plausibility(np.radians(degrees), replace(ANATOMY, spreads=3.0)), log_density(degrees)
    )


def test_what_is_unknown_stays_unknown() -> None:
    degrees = np.tile(STANDING, (3, 1))
    degrees[0, DOFS.index("right_elbow.flexion")] = np.nan
    degrees[0, DOFS.index("right_shoulder.rotation")] = np.nan
    degrees[1, 3:6] = np.nan
    logs = log_density(degrees)
    np.testing.assert_array_equal(np.isnan(logs), np.isnan(degrees))
    np.testing.assert_allclose(logs[0][~np.isnan(logs[0])], logs[2][~np.isnan(logs[0])])


def test_no_postures_and_wrong_shapes() -> None:
    assert plausibility(np.empty((0, 22)), ANATOMY).shape == (0, 22)
    for shape in ((22,), (3, 29), (2, 2, 22)):
        with pytest.raises(InputError, match="expected \\(N, 22\\)"):
            plausibility(np.zeros(shape), ANATOMY)
