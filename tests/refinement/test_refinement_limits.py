"""Limits as refinement judges them are those of the figure's closed form: the decomposition that has derivatives."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.body import load_figure
from posekit.body.angles import Limits, ball_angles, limb_angles
from posekit.geometry import other_branch, other_hinge, turned_near, unit
from posekit.refinement.figure_numbers import Bounds
from posekit.refinement.limits import ball_limits, limb_limits
from posekit.refinement.limits import limb_angles as refined_angles
from posekit.skeleton import DOFS

FIGURE = load_figure()
FIRST = tuple(
    DOFS.index(f"{side}_{joint}.flexion") for joint in ("shoulder", "hip") for side in ("right", "left")
)
MANY = 3000


def limits_of(first: int, count: int) -> Limits:
    part = slice(first, first + count)
    each = FIGURE.limits
    return Limits(sign=each.sign[part], lower=each.lower[part], upper=each.upper[part])


def bounds_of(several: list[Limits]) -> Bounds:
    low = np.array([each.sign * each.lower for each in several])
    high = np.array([each.sign * each.upper for each in several])
    return Bounds(lower=np.minimum(low, high), upper=np.maximum(low, high))


def test_angles_of_limbs_are_a_writing_of_the_closed_forms(rng: np.random.Generator) -> None:
    parent = Rotation.random(MANY, random_state=1).as_matrix()
    directions = unit(rng.normal(size=(4, 2, MANY, 3)))
    seen = np.einsum("nij,kpnj->kpni", parent, directions)
    found = refined_angles(
        np.moveaxis(seen, 2, -1), np.broadcast_to(np.moveaxis(parent, 0, -1), (4, 3, 3, MANY))
    )
    for limb, first in enumerate(FIRST):
        limits = limits_of(first, 4)
        expected = limb_angles(directions[limb, 0], directions[limb, 1], limits) * limits.sign
        mine = found.angles[:, limb].T
        ways = [mine, other_branch(mine)]
        ways += [other_hinge(each) for each in ways]
        apart = [np.abs(turned_near(each - expected, 0.0)).max(axis=1) for each in ways]
        np.testing.assert_allclose(np.min(apart, axis=0), 0.0, rtol=0, atol=1e-9)


def test_limbs_are_outside_where_the_closed_form_has_no_configuration(rng: np.random.Generator) -> None:
    directions = unit(rng.normal(size=(4, 2, MANY, 3)))
    upright = np.broadcast_to(np.eye(3)[..., None], (4, 3, 3, MANY))
    several = [limits_of(first, 4) for first in FIRST]
    out = limb_limits(refined_angles(np.moveaxis(directions, 2, -1), upright), bounds_of(several))
    assert out is not None
    outside = np.zeros((4, MANY), dtype=bool)
    outside[out.limb, out.row] = out.cost() > 0
    for limb, limits in enumerate(several):
        violation = limits.violation(limb_angles(directions[limb, 0], directions[limb, 1], limits))
        np.testing.assert_array_equal(outside[limb], violation > 0)
        assert 0.1 < outside[limb].mean() < 0.99


@pytest.mark.parametrize("joint", ["neck", "pelvis"])
def test_parts_are_outside_by_the_closed_forms_angles(joint: str) -> None:
    limits = limits_of(DOFS.index(f"{joint}.flexion"), 3)
    parent, child = (Rotation.random(MANY, random_state=k).as_matrix() for k in (2, 3))
    child[: MANY // 2] = (
        parent[: MANY // 2]
        @ Rotation.from_rotvec(np.random.default_rng(4).normal(size=(MANY // 2, 3)) * 0.3).as_matrix()
    )
    found = ball_limits(np.moveaxis(parent, 0, -1), np.moveaxis(child, 0, -1), bounds_of([limits]))
    inside = found.cost() == 0
    angles = ball_angles(np.swapaxes(parent, 1, 2) @ child, limits)
    np.testing.assert_array_equal(inside, limits.violation(angles) == 0)
    assert 0.02 < inside.mean() < 0.9
    one = inside | (np.abs(angles[:, 1]) < np.pi / 2 - 1e-6)
    expected = limits.sign * (angles - np.clip(angles, limits.lower, limits.upper))
    close = one & (np.abs(expected).max(axis=1) < 1.0)
    np.testing.assert_allclose(found.residual.T[close], expected[close], rtol=0, atol=1e-9)
