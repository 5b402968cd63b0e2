"""The figure's forward kinematics against Pinocchio's own, configuration by configuration."""

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import Figure, load_figure
from posekit.body.figure import LINK_OF_POINT
from posekit.skeleton import POINTS

FIGURES = {
    "built in": load_figure(),
    "short": load_figure().from_stature(1.5),
    "lopsided": load_figure().scaled({"right_hip-right_knee": 0.5, "left_elbow-left_wrist": 0.2}),
}


def by_pinocchio(figure: Figure, q: np.ndarray) -> np.ndarray:
    data = figure.model.createData()
    frames = [figure.model.getFrameId(LINK_OF_POINT.get(name, name)) for name in POINTS]
    points = np.empty((len(q), len(POINTS), 3))
    for k, row in enumerate(q):
        pin.framesForwardKinematics(figure.model, data, row)
        points[k] = [data.oMf[frame].translation for frame in frames]
    return points


@pytest.mark.parametrize("name", FIGURES)
def test_points_are_pinocchio_s(name: str) -> None:
    figure = FIGURES[name]
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (700, figure.model.nq))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    np.testing.assert_allclose(figure.forward_kinematics(q), by_pinocchio(figure, q), rtol=0, atol=1e-12)


def test_what_is_not_known_stays_unknown_and_spreads_no_further_than_with_pinocchio() -> None:
    figure = FIGURES["built in"]
    q = np.tile(pin.neutral(figure.model), (figure.model.nq, 1))
    for k in [0, 1, 2, *range(7, figure.model.nq)]:
        q[k, k] = np.nan
    ours, theirs = figure.forward_kinematics(q), by_pinocchio(figure, q)
    np.testing.assert_array_equal(np.isnan(ours).any(axis=-1), np.isnan(theirs).any(axis=-1))
    np.testing.assert_allclose(
        ours[np.isfinite(ours) & np.isfinite(theirs)],
        theirs[np.isfinite(ours) & np.isfinite(theirs)],
        atol=1e-12,
    )


def test_no_configuration_has_no_points() -> None:
    assert FIGURES["built in"].forward_kinematics(np.empty((0, 29))).shape == (0, len(POINTS), 3)
