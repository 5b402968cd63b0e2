"""Taylor's objects from random directions: the sensitivity tells which views can be solved."""

from dataclasses import replace

import numpy as np
import pytest

from posekit.linkages import LinkageFamily, name_nearer, search
from posekit.measures import joint_angles
from posekit.papers.taylor_constrained import OBJECT_SIZE_PIXELS, constrained, triples_of
from posekit.papers.taylor_random_views import random_views_lines, view_at_random
from posekit.papers.taylor_sensitivity import ConstrainedChain


@pytest.fixture(scope="module")
def objects():
    return constrained(pictures=2)


@pytest.mark.parametrize("which", [0, 1])
def test_the_sensitivity_is_the_derivative_of_the_search(objects, which, rng):
    """Differences of the whole search, by every image coordinate, against the closed form."""
    one = objects[which]
    closed = one.constraint == "closure"
    chain = ConstrainedChain(
        linkage=one.linkage,
        planes=[] if closed else [one.linkage.coplanar[0]],
        triples=triples_of(len(one.points), closed=closed),
    )
    s = OBJECT_SIZE_PIXELS / float(np.linalg.norm(np.ptp(one.points[:, :2], axis=0)))
    flips = LinkageFamily(linkage=one.linkage, image=one.points[:, :2] * s).flips_of(one.points)
    nearer, step = name_nearer(one.linkage, flips), 1e-3

    def angles(moved):
        family = LinkageFamily(linkage=one.linkage, image=one.points[:, :2] * s + moved)
        found = search(family, {one.constraint: 1.0}, nearer=nearer)
        nearest = found.s[np.abs(found.s - s).argmin()]
        return joint_angles(family.points(nearest, flips), chain.triples)

    columns = []
    for k in range(one.points[:, :2].size):
        moved = np.zeros(one.points[:, :2].size)
        moved[k] = step
        columns.append((angles(moved.reshape(-1, 2)) - angles(-moved.reshape(-1, 2))) / (2 * step))
    numeric = np.stack(columns, axis=1)
    moves = chain.sensitivity(one.points, s)
    np.testing.assert_allclose(moves @ moves.T, numeric @ numeric.T, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("posed", [False, True])
@pytest.mark.parametrize("which", [0, 1])
def test_as_many_views_are_within_the_bound_as_the_noise_allows(objects, which, posed):
    views = view_at_random(objects[which], 300, seed=1, posed=posed)
    expected = views.chance.sum()
    allowed = 4 * np.sqrt((views.chance * (1 - views.chance)).sum())
    # A few views are folds, which first order does not see.
    assert abs(views.plain()["within"] - expected) < allowed + 10
    assert views.within(views.solvable) >= 0.9
    assert views.within(views.solvable) > views.within(~views.solvable)
    text = "\n".join(random_views_lines([views]))
    assert f"{views.solvable.sum()} of 300 random views can be solved" in text


def test_depth_moves_without_bound_where_a_segment_lies_in_the_picture(objects):
    chain = ConstrainedChain(linkage=objects[1].linkage, planes=[], triples=[(0, 1, 2)])
    points = np.cumsum(np.ones((6, 3)), axis=0)
    assert chain.depth_factors(points)[0] == pytest.approx(np.sqrt(2))
    points[1:, 2] += points[0, 2] - points[1, 2]
    assert chain.depth_factors(points)[0] == np.inf


def test_a_scale_that_is_not_found_is_not_within(objects):
    views = view_at_random(objects[0], 20)
    lost = replace(views, worst=np.full(20, np.inf))
    assert lost.within(lost.chance >= 0) == 0
