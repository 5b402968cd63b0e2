"""Bodies that will be told as one, foretold from trunks and limbs, against whole bodies one by one."""

from __future__ import annotations

from unittest import mock

import numpy as np
from numpy.typing import NDArray

from posekit.body import load_figure
from posekit.recovery import leaf_search, recover
from posekit.refinement.alike import INDISTINCT_SQUARE, ROUNDING_SQUARE_METRES, alike
from posekit.refinement.refine import BegunRefinement
from posekit.skeleton import LIMB_JOINTS
from posekit.synthesis import random_views
from tests.recovery.test_refiner import noisy


def begun_refinement() -> tuple[BegunRefinement, NDArray[np.intp]]:
    """Return what a recovery of a few views begins with."""
    caught: list[tuple[BegunRefinement, NDArray[np.intp]]] = []

    def catch(begun: BegunRefinement, frame: NDArray[np.intp]) -> NDArray[np.intp]:
        caught.append((begun, frame))
        return alike(begun, frame)

    view = noisy(random_views(load_figure(), 6, np.random.default_rng(3)), 4.0)
    with mock.patch.object(leaf_search, "alike", catch):
        recover(view)
    return caught[0]


def test_bodies_of_one_number_are_of_one_frame_and_near_each_other() -> None:
    begun, frame = begun_refinement()
    number = alike(begun, frame)
    assert 1 < len(np.unique(number)) < len(number)  # some are as others
    joints, checked = begun.joints, 0
    inverse = np.linalg.inv(begun.columns.covariance + ROUNDING_SQUARE_METRES * np.eye(3))
    for one in np.unique(number):
        rows = np.flatnonzero(number == one)
        assert len(np.unique(frame[rows])) == 1
        if len(rows) == 1 or len(np.unique(begun.factors.trunk_of[rows])) > 1:
            continue
        checked += 1
        worst = np.zeros((len(rows), len(rows)))  # of each member from the one whose ellipsoids these are
        for kind, (_, *ends) in enumerate(LIMB_JOINTS):
            column = begun.search.columns.of[kind][begun.factors.limb_of[kind][rows]]
            apart = joints[rows][None, :, ends] - joints[rows][:, None, ends]
            square = np.einsum("abji,ajik,abjk->abj", apart, inverse[column][:, ends], apart)
            worst = np.maximum(worst, square.max(axis=2))
        assert worst.max(axis=1).min() < INDISTINCT_SQUARE
    assert checked > 3
