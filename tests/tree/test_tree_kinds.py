"""Functions of the tree are given and return what their annotations say, to the dtype."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from posekit.skeleton import PARENTS
from posekit.tree import Leaves, enumerate_leaves
from posekit.tree.factors import factor_postures
from posekit.tree.screening import screened
from tests.annotated import watched
from tests.tree import test_tree_fast as scenes

CASES = (
    scenes.noisy,
    scenes.hidden,
    scenes.measured,
    scenes.at_the_limits,
    scenes.empty_frames,
    scenes.uncalibrated,
    scenes.no_view,
    scenes.another_tree,
)


@pytest.mark.parametrize("case", CASES, ids=lambda case: str(case.__name__))
def test_trees_are_what_annotations_say(
    case: Callable[[], tuple[Leaves, Leaves]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scenes, "VIEWS", 8)
    with watched("posekit.tree") as wrong:
        for leaves in case():
            for ask in (
                leaves.counts,
                leaves.offsets,
                leaves.branches,
                leaves.rejected,
                leaves.length_residual,
            ):
                ask()
            leaves.alike((2,))
            assert all(len(one.value) == len(one.lower) == len(one.upper) for one in leaves.pruned)
            if case is not scenes.another_tree:
                factor_postures(leaves.frame.astype(np.intp), leaves.postures())
    assert wrong == set()


def test_enumerated_leaves_are_what_annotations_say() -> None:
    points = scenes.postures(1, 1)[0]
    with watched("posekit.tree") as wrong:
        enumerate_leaves(
            scenes.CAMERA,
            points[0],
            scenes.CAMERA.project(points[:6]),
            parents=PARENTS[:6],
            lengths=scenes.LENGTHS[:6],
            tolerance=1e-9,
        )
    assert wrong == set()


def test_screens_give_what_is_to_be_confirmed_where_it_is_asked_for() -> None:
    points = scenes.postures(2, 40, beyond=1.0)
    rules = [(check.rule, check.points) for check in scenes.checks() if check.rule and check.rule.presumed]
    kinds, of = [rule for rule, _ in rules], [each for _, each in rules]
    with watched("posekit.tree") as wrong:
        places, nothing = screened(kinds, of, points)
        again, presumed = screened(kinds, of, points, presuming=True)
        none, _ = screened(kinds, of, points[:0])
    assert wrong == set()
    np.testing.assert_array_equal(places, again)
    assert (
        nothing.size == 0 and presumed.shape == ((places >= 0).sum(), kinds[0].presumed) and len(presumed) > 0
    )
    assert none.shape == (0, len(kinds))
