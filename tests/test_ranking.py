"""Ranking: laws of the prior and of the probabilities, and SciPy's distributions as oracle."""

import numpy as np
import pytest
from scipy.stats import multivariate_t

import posekit
from posekit.body import load_figure
from posekit.ranking import Up, centre_of_mass, load_prior, log_terms, rank, softmax
from posekit.ranking.prior import StudentMixture
from posekit.ranking.standing import LIMB_MASSES, TRUNK_MASS
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
    every = rank(joints, frame, deviation=0.01, lengths=LENGTHS, up=Up.level())
    np.testing.assert_allclose(np.bincount(frame, every), 1.0)
    own = frame == 2
    alone = rank(joints[own], np.zeros(own.sum(), dtype=int), deviation=0.01, lengths=LENGTHS, up=Up.level())
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


def test_left_and_right_are_alike(postures):
    joints, _ = postures
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
