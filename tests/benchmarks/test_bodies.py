"""The figures of `benchmarks/bodies.py`: what they count is what they say."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.stats import chi2

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def bodies(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Import from the folder of benchmarks, which is not installed."""
    monkeypatch.syspath_prepend(str(ROOT))
    return importlib.import_module("benchmarks.bodies")


def test_ellipsoids_of_the_noise_itself_hold_ninety_five_percent(bodies) -> None:
    rng = np.random.default_rng(0)
    root = np.array([[0.02, 0.0, 0.0], [0.01, 0.05, 0.0], [0.0, 0.02, 0.1]])
    off = rng.standard_normal((40_000, 3)) @ root.T
    assert bodies.holds(off, np.broadcast_to(root @ root.T, (len(off), 3, 3))) == pytest.approx(
        0.95, abs=0.005
    )


def test_a_common_size_is_taken_out_of_covariances(bodies) -> None:
    x = np.array([[0.5, 0.2, 4.0]])
    own = 0.01**2 * np.eye(3)[None]
    common = 0.03**2 * x[:, :, None] * x[:, None, :]
    np.testing.assert_allclose(bodies.less(own + common, common), own, atol=1e-12)


def test_a_mirrored_limb_is_another_branch_and_a_level_one_is_either(bodies) -> None:
    from posekit.body import load_figure
    from posekit.skeleton import JOINT

    truth = load_figure().neutral_points[:14] @ np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]) + [0, 0, 4.0]
    arm, wrist = JOINT["left_elbow"], JOINT["left_wrist"]
    truth[wrist] = truth[arm] + [0.0, 0.1, 0.2]
    other, level = truth.copy(), truth.copy()
    other[wrist, 2] -= 0.4
    assert bodies.same_branch(np.array([truth, other]), truth).tolist() == [True, False]
    level[wrist] = truth[arm] + [0.0, 0.25, 0.01]
    assert bodies.same_branch(np.array([truth, other]), level).tolist() == [True, True]


def test_lengths_are_off_by_what_a_condition_says(bodies) -> None:
    right = {"neck-pelvis": 0.5, "right_hip-right_knee": 0.4}
    short = bodies.Condition(group="lengths", lengths="5 % short").given(right, np.random.default_rng(0))
    assert short == pytest.approx({name: 0.95 * value for name, value in right.items()})
    each = [
        bodies.Condition(group="lengths", lengths="3 % each").given(right, np.random.default_rng(k))
        for k in range(2000)
    ]
    off = np.array([[one[name] / right[name] - 1 for name in right] for one in each])
    assert off.std(axis=0) == pytest.approx(0.03, rel=0.1)
    assert abs(np.corrcoef(off.T)[0, 1]) < chi2.ppf(0.999, 1) ** 0.5 / len(each) ** 0.5
