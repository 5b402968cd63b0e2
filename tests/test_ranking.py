"""Ranking: laws of the prior and of the probabilities, and SciPy's distributions as oracle."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.special import digamma
from scipy.stats import multivariate_t
from scipy.stats import t as student_t

import posekit
import posekit.geometry as g
from posekit.body import load_figure
from posekit.ranking import Up, centre_of_mass, load_prior, log_terms, softmax
from posekit.ranking.directions import DIRECTION_NAMES, directions, log_room
from posekit.ranking.prior import StudentMixture
from posekit.ranking.prior import digamma as log_gamma_slope
from posekit.ranking.rank import deviation_of_tolerance
from posekit.ranking.standing import LIMB_MASSES, TRUNK_MASS, standing
from posekit.skeleton import JOINTS, SEGMENT_NAMES, other_side

FIGURE = load_figure()
LENGTHS = np.array([FIGURE.lengths[name] for name in SEGMENT_NAMES])


@pytest.fixture(scope="module")
def postures():
    recovery = posekit.recover(posekit.builtin_view("seq2"))
    return recovery.survivors.joints, recovery.survivors.frame


def test_excess_is_scipys_log_density_above_its_mean():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(6, 6))
    scale = A @ A.T + np.eye(6)
    mean = rng.normal(size=6)
    student = StudentMixture(means=mean[None], scale=scale, dof=5.0, share=np.ones(1))
    law = multivariate_t(loc=mean, shape=scale, df=5.0)
    x = law.rvs(50, random_state=1)
    np.testing.assert_allclose(student.excess(x, 6), law.logpdf(x) + law.entropy(), atol=1e-8)
    # Fewer coordinates have the marginal law, and so have unknown ones.
    part = multivariate_t(loc=mean[:4], shape=scale[:4, :4], df=5.0)
    expected = part.logpdf(x[:, :4]) + part.entropy()
    np.testing.assert_allclose(student.excess(x, 4), expected, atol=1e-8)
    hidden = x.copy()
    hidden[:, 4:] = np.nan
    np.testing.assert_allclose(student.excess(hidden, 6), expected, atol=1e-8)


def test_mixture_is_the_sum_of_its_parts():
    rng = np.random.default_rng(1)
    means, share = rng.normal(size=(3, 2)) * 2, np.array([0.2, 0.5, 0.3])
    student = StudentMixture(means=means, scale=np.eye(2), dof=4.0, share=share)
    x = rng.normal(size=(40, 2)) * 3
    density = sum(
        s * multivariate_t(loc=m, shape=np.eye(2), df=4.0).pdf(x) for m, s in zip(means, share, strict=True)
    )
    difference = student.excess(x, 2) - np.log(density)
    np.testing.assert_allclose(difference, difference[0], atol=1e-9)


def test_probabilities_sum_to_one_and_do_not_depend_on_other_frames(postures):
    joints, frame = postures
    terms = log_terms(joints, deviation=0.01, lengths=LENGTHS, up=Up.level())
    every = softmax(np.sum(list(terms.values()), axis=0), frame)
    np.testing.assert_allclose(np.bincount(frame, every), 1.0)
    own = frame == 2
    terms = log_terms(joints[own], deviation=0.01, lengths=LENGTHS, up=Up.level())
    alone = softmax(np.sum(list(terms.values()), axis=0), np.zeros(own.sum(), dtype=int))
    np.testing.assert_allclose(every[own], alone, atol=1e-12)


def test_terms_turn_with_the_camera(postures):
    joints, _ = postures
    angle = 0.4
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    up = Up(direction=np.array([0.1, -1.0, 0.2]), deviation=5.0)
    a = log_terms(joints, deviation=0.01, lengths=LENGTHS, up=up)
    b = log_terms(
        joints @ turn.T, deviation=0.01, lengths=LENGTHS, up=Up(direction=turn @ up.direction, deviation=5.0)
    )
    for name in a:
        np.testing.assert_allclose(a[name], b[name], atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    "hidden", [(), ("right_elbow", "right_wrist"), ("left_knee", "left_ankle", "right_wrist")]
)
def test_left_and_right_are_alike(postures, hidden):
    joints = np.array(postures[0])
    joints[:, [JOINTS.index(name) for name in hidden]] = np.nan
    order = [JOINTS.index(other_side(name)) for name in JOINTS]
    mirrored = joints[:, order] * [-1.0, 1.0, 1.0]
    a, b = (log_terms(one, chi2=np.zeros(len(one)), up=Up.level()) for one in (joints, mirrored))
    for name in a:
        # The prior was fitted with both sides exchanged; its numbers are rounded to a thousandth.
        np.testing.assert_allclose(a[name], b[name], atol=0.05, err_msg=name)


def test_unknown_joints_are_no_evidence(postures):
    joints, _ = postures
    hidden = joints.copy()
    hidden[:, 6:] = np.nan
    found = log_terms(hidden, chi2=np.zeros(len(joints)), up=Up.level())
    for name in ("balance", "contact", "foreshortening"):
        assert np.isfinite(found[name]).all()
    assert (found["contact"] == 0).all()


def test_standing_upright_is_likelier_than_on_the_head(postures):
    joints, _ = postures
    up = log_terms(joints, chi2=np.zeros(len(joints)), up=Up.level())["gravity"]
    down = log_terms(joints, chi2=np.zeros(len(joints)), up=Up(direction=np.array([0.0, 1.0, 0.0])))[
        "gravity"
    ]
    assert (up > down + 3).all()


def test_masses_are_those_of_a_body():
    assert TRUNK_MASS + 2 * sum(share for *_, share, _ in LIMB_MASSES) == pytest.approx(1.0, abs=2e-3)
    body = FIGURE.neutral_points[None, :14]
    low, high = body[0, :, 2].min(), body[0, :, 2].max()
    assert low + 0.5 * (high - low) < centre_of_mass(body)[0, 2] < high


def test_softmax_of_impossible_postures_is_even():
    score = np.array([-np.inf, -np.inf, 0.0, 1000.0, 1000.0])
    np.testing.assert_allclose(softmax(score, np.array([0, 0, 1, 1, 1])), [0.5, 0.5, 0, 0.5, 0.5])


def test_an_unknown_prior_is_refused():
    with pytest.raises(posekit.InputError, match="expected a table"):
        load_prior("nobody")


def test_directions_are_cosines_with_the_torsos_axes(postures):
    joints, _ = postures
    up = np.array([0.6, -0.8, 0.0])
    found = directions(joints, up)
    at = {name: joints[:, k] for k, name in enumerate(JOINTS)}
    z = g.unit(at["neck"] - at["pelvis"])
    left = at["left_shoulder"] - at["right_shoulder"]
    y = g.unit(left - g.dot(left, z)[:, None] * z)
    axes = np.stack([g.cross(y, z), y, z], axis=1)
    hips = g.unit(at["left_hip"] - at["right_hip"])
    down = at["right_hip"] - at["pelvis"]
    down = g.unit(down - g.dot(down, hips)[:, None] * hips)
    for name, own in zip(DIRECTION_NAMES, found.swapaxes(0, 1), strict=True):
        if "-" in name:
            start, end = name.split("-")
            expected = g.unit(at[end] - at[start])
        else:
            expected = {"hips.left": hips, "hips.down": down, "up": np.broadcast_to(up, hips.shape)}[name]
        np.testing.assert_allclose(own, np.einsum("nij,nj->ni", axes, expected), atol=1e-12, err_msg=name)


@pytest.mark.parametrize(("share", "known"), [(0.11, True), (0.09, False)])
def test_a_pelvis_between_the_hips_has_no_downward_direction(share, known):
    joints = FIGURE.neutral_points[None, :14].copy()
    line = joints[0, JOINTS.index("left_hip")] - joints[0, JOINTS.index("right_hip")]
    middle = joints[0, [JOINTS.index("left_hip"), JOINTS.index("right_hip")]].mean(axis=0)
    joints[0, JOINTS.index("pelvis")] = middle + np.array([0.0, 0.0, share * np.linalg.norm(line)])
    assert np.isfinite(directions(joints)[0, 1]).all() == known


def test_no_direction_of_a_segment_is_for_or_against_on_average():
    rng = np.random.default_rng(3)
    joints = np.cumsum(g.unit(rng.normal(size=(20000, 14, 3))), axis=1)  # seen along parallel rays
    joints -= joints.max(axis=1, keepdims=True) + 1
    assert abs(log_room(joints).mean()) < 0.03
    near = FIGURE.neutral_points[None, :14] @ np.array([[0, 0, -1.0], [1, 0, 0], [0, -1, 0]]) + [0, 0, 3.0]
    pointing = near.copy()
    pointing[0, JOINTS.index("left_wrist")] = 0.9 * near[0, JOINTS.index("left_elbow")]
    assert log_room(pointing)[0] < log_room(near)[0] - 0.5
    hidden = near.copy()
    hidden[:, JOINTS.index("left_wrist")] = np.nan
    assert abs(log_room(hidden)[0] - log_room(near)[0]) < 0.6


@pytest.mark.parametrize("x", [0.1, 0.5, 1.0, 2.5, 5.9, 6.1, 40.0])
def test_digamma_is_scipys(x):
    assert log_gamma_slope(x) == pytest.approx(digamma(x), rel=1e-10)


@pytest.mark.parametrize("deviation", [0.0, 15.0])
def test_gravity_is_the_density_of_up_given_the_posture(postures, deviation):
    """A prior of one block: p(up | posture) = p(posture, up) / p(posture), with the scale of up widened by its sine."""
    joints, _ = postures
    rng = np.random.default_rng(2)
    A = 0.3 * rng.normal(size=(6, 6))
    scale, mean = A @ A.T + 0.2 * np.eye(6), 0.3 * rng.normal(size=6)
    names = (DIRECTION_NAMES[4], "up")
    student = StudentMixture(means=mean[None], scale=scale, dof=6.0, share=np.ones(1))
    up = g.unit(np.array([0.1, -1.0, 0.3]))
    found = directions(joints, up)
    prior = replace(load_prior(), blocks=[(names, student, False)])
    posture, gravity = prior.judge(found, np.sin(np.radians(deviation)))
    wide = scale + np.diag([0.0] * 3 + [np.sin(np.radians(deviation)) ** 2] * 3)
    both = multivariate_t(loc=mean, shape=wide, df=6.0)
    alone = multivariate_t(loc=mean[:3], shape=scale[:3, :3], df=6.0)
    x = np.concatenate([found[:, 4], found[:, -1]], axis=1)
    expected = alone.logpdf(x[:, :3]) + alone.entropy()
    np.testing.assert_allclose(posture, expected, atol=1e-9)
    np.testing.assert_allclose(gravity, both.logpdf(x) + both.entropy() - expected, atol=1e-9)
    conditional = replace(prior, blocks=[(names, student, True)])
    np.testing.assert_array_equal(conditional.judge(found, 0.0)[0], 0.0)
    assert (prior.judge(found[:, :-1])[1] == 0).all()


def test_balance_is_the_distance_of_the_centre_of_mass_from_the_feet():
    joints = FIGURE.neutral_points[None, :14].repeat(4, axis=0)
    up = np.array([0.0, 0.0, 1.0])
    ankles = [JOINTS.index("right_ankle"), JOINTS.index("left_ankle")]
    joints[:, ankles, 0] = centre_of_mass(joints)[:, None, 0]
    joints[1, ankles, 0] -= 0.1  # the body leans forward
    joints[2, ankles[0], 1] -= 0.3  # legs apart
    joints[3, ankles[0], 2] += 0.1  # one foot 10 cm up
    off, apart = standing(joints, up)
    middle = centre_of_mass(joints)
    np.testing.assert_allclose(off[:3], abs(middle[:3, 0] - joints[:3, ankles[0], 0]), atol=1e-9)
    assert off[0] < 1e-3 and off[1] > 0.08
    np.testing.assert_allclose(apart, [0, 0, 0, 0.1], atol=1e-12)
    # The higher foot carries exp(-1/2): the support ends that far from the left foot.
    between = np.exp(-0.5) * (joints[3, ankles[0], 1] - joints[3, ankles[1], 1])
    short = abs(middle[3, 1] - joints[3, ankles[1], 1]) - abs(between)
    assert off[3] == pytest.approx(
        np.hypot(max(short, 0.0), middle[3, 0] - joints[3, ankles[0], 0]), abs=1e-9
    )


@pytest.mark.parametrize("missing", ["left_wrist", "right_ankle", "left_knee"])
def test_the_centre_of_mass_leaves_out_parts_that_are_not_seen(missing):
    """Compare with Pinocchio's, whose inertias are de Leva's as well."""
    q = FIGURE.neutral.copy()
    joints = FIGURE.points(q[None])[:, :14]
    whole = pin.centerOfMass(FIGURE.model, FIGURE.model.createData(), q)
    np.testing.assert_allclose(centre_of_mass(joints)[0], whole, atol=5e-3)
    joints[:, JOINTS.index(missing)] = np.nan
    part = centre_of_mass(joints)[0]
    assert np.isfinite(part).all() and 1e-3 < np.linalg.norm(part - whole) < 0.15


def test_a_misfit_is_judged_by_a_student_distribution():
    joints = FIGURE.neutral_points[None, :14].repeat(3, axis=0) + np.array([0, 0, 4.0])
    terms = [
        log_terms(joints, lengths=LENGTHS, length_residual=np.array([0.0, 0.01, 0.03]), deviation=deviation)
        for deviation in (0.0, 0.02)
    ]
    for found, deviation in zip(terms, (0.006, 0.02), strict=True):
        law, weight = student_t(df=4.0, scale=deviation), load_prior().weights["image"]
        fits = 4 * law.logpdf(0.0) + law.logpdf([0.0, 0.01, 0.03]) + 5 * law.entropy()
        np.testing.assert_allclose(found["image"], weight * fits, atol=1e-9)
    assert deviation_of_tolerance(0.044) == pytest.approx(0.02) and deviation_of_tolerance(0.0) == 0.006
    prior = load_prior()
    ratio = (1 + 0.02 / prior.temperature) / (1 + 0.0 / prior.temperature)
    np.testing.assert_allclose(terms[0]["posture"], ratio * terms[1]["posture"], rtol=1e-12)
