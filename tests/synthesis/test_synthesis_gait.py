"""The monotone cubic and the gait: laws, an independent oracle, the model's own constants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.synthesis import Gait
from posekit.synthesis.monotone_cubic import PeriodicMonotoneCubic

PHASES = np.linspace(0, 1, 401)


@st.composite
def periodic_points(draw):
    count = draw(st.integers(2, 7))
    widths = np.array([draw(st.integers(1, 50)) for _ in range(count)], dtype=float)
    x = draw(st.floats(-1, 1)) + np.cumsum(widths) / widths.sum() * 0.999
    values = st.sampled_from([-2.0, 0.0, 0.0, 1.0]) | st.floats(-50, 50, allow_subnormal=False)
    return x, np.array([draw(values) for _ in range(count)])


@given(periodic_points())
def test_cubic_passes_through_its_points_every_period(points):
    x, y = points
    curve = PeriodicMonotoneCubic(x=x, y=y)
    for shift in (-2, 0, 1, 3):
        # The place wraps around: rounding of x in the period before or after, times the slope there.
        np.testing.assert_allclose(curve(x + shift), y, rtol=0, atol=1e-7)


@given(periodic_points())
def test_cubic_is_monotone_between_points(points):
    x, y = points
    curve = PeriodicMonotoneCubic(x=x, y=y)
    knots, values = np.append(x, x[0] + 1), np.append(y, y[0])
    for k in range(len(x)):
        steps = np.diff(curve(np.linspace(knots[k], knots[k + 1], 50)[:-1]))
        assert (steps * np.sign(values[k + 1] - values[k]) >= -1e-9).all()


@given(periodic_points())
def test_cubic_is_scipys(points):
    interpolate = pytest.importorskip("scipy.interpolate")
    x, y = points
    tiled = np.concatenate([x - 1, x, x + 1, x + 2])
    oracle = interpolate.PchipInterpolator(tiled, np.tile(y, 4))
    at = x[0] + np.linspace(0, 1, 97)
    np.testing.assert_allclose(PeriodicMonotoneCubic(x=x, y=y)(at), oracle(at), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("x", "y"),
    [([0.0], [1.0]), ([0.0, 1.0], [1.0, 2.0]), ([0.5, 0.2], [1, 2]), ([0, np.nan], [1, 2]), ([0, 0.5], [1])],
)
def test_cubic_refuses_points_that_make_no_period(x, y):
    with pytest.raises(InputError, match=r"curve") as refused:
        PeriodicMonotoneCubic(x=x, y=y)
    assert "\n" not in str(refused.value)


@given(st.floats(0.5, 1.3), st.floats(-3, 3))
def test_gait_is_periodic_and_left_is_half_a_cycle_later(velocity, phase):
    gait = Gait(velocity=velocity)
    now, next_cycle, half = (gait.angles(phase + later) for later in (0.0, 1.0, 0.5))
    for a, b in zip(now, next_cycle, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)
    for name in ("shoulder", "elbow", "hip", "knee"):
        np.testing.assert_allclose(getattr(now, name)[::-1], getattr(half, name), rtol=0, atol=1e-12)
    for name in ("vertical", "fore_aft", "lean"):
        np.testing.assert_allclose(getattr(now, name), getattr(half, name), rtol=0, atol=1e-12)
    for name in ("lateral", "torsion"):
        np.testing.assert_allclose(getattr(now, name), -getattr(half, name), rtol=0, atol=1e-12)


@pytest.mark.parametrize("velocity", [0.5, 0.9, 1.3])
def test_gait_has_the_models_constants(velocity):
    gait = Gait(velocity=velocity)
    u = (velocity - 0.5) / 0.8
    points = {
        "hip": [(-0.1, 25), (0.5, -15), (0.9, 25)],
        "knee": [(0.17, 3), (0.4, 3), (0.75, 70), (1, 3)],
        "elbow": [(0.05, 6 + 8 * u), (0.5 + 0.01 * u, 20 + 24 * u), (0.9, 8 + 9 * u)],
    }
    for joint, pairs in points.items():
        phase, degrees = np.array(pairs).T
        flexion = getattr(gait.angles(phase), joint)[:, 0]
        np.testing.assert_allclose(np.degrees(flexion), degrees, rtol=0, atol=1e-9)
    angles = gait.angles(PHASES)
    assert np.ptp(angles.shoulder[:, 0]) == pytest.approx(np.radians(2 * 9.88 * velocity))
    assert np.ptp(angles.torsion) == pytest.approx(np.radians(8 * velocity))
    assert (angles.lean >= 0).all()
    assert np.degrees(angles.lean.max()) == pytest.approx(4, abs=1e-3)


def test_gait_durations():
    gait = Gait(velocity=1.0)
    assert gait.cycle_length == gait.cycle_duration == 1.346
    assert gait.support_duration == pytest.approx(0.752 * 1.346 - 0.143)
    assert Gait(velocity=0.81).cycle_duration == pytest.approx(1.346 * 0.9 / 0.81)


def test_arm_swings_against_the_leg_of_its_side_and_hips_turn_with_it():
    angles = Gait(velocity=1.0).angles(PHASES)
    hip, shoulder = angles.hip[:, 0] - angles.hip[:, 1], angles.shoulder[:, 0] - angles.shoulder[:, 1]
    assert np.corrcoef(hip, shoulder)[0, 1] < -0.8
    assert np.corrcoef(hip, angles.torsion)[0, 1] > 0.8


@pytest.mark.parametrize("velocity", [0.49, 1.31, -1.0, np.nan, np.inf])
def test_gait_refuses_velocities_outside_mid_gait(velocity):
    with pytest.raises(InputError, match=r"velocity.*0\.5 to 1\.3") as refused:
        Gait(velocity=velocity)
    assert "\n" not in str(refused.value)
