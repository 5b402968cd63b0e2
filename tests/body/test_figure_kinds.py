"""Functions of the figure are given and return what their annotations say, to the dtype."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.body.measured import measured_person
from posekit.synthesis import random_postures
from tests.annotated import watched


@pytest.mark.parametrize("behind", [False, True])
def test_figures_and_their_configurations_are_what_annotations_say(behind: bool) -> None:
    figure = load_figure()
    points = figure.forward_kinematics(random_postures(figure, 8, np.random.default_rng(51)))
    points[0, 8], points[1, 14:] = np.nan, np.nan
    with watched("posekit.body") as wrong:
        other = figure.scaled({name: 1.03 * length for name, length in figure.lengths.items()}, behind=behind)
        for one in (figure, other):
            for some in (points, points[:0]):
                found = one.configurations(some)
                again = one.forward_kinematics(found.q)
                assert again.shape == some.shape
        measured_person(points[:, :14])
    assert wrong == set()
