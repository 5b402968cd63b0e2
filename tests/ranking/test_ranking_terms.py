"""What each term says, against independent calculations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from posekit.body import load_figure, stature_from_lengths
from posekit.body.frames import hips_frame, torso_frame
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking import (
    Depth,
    RankingEvidence,
    Up,
    centre_of_mass,
    deviation_of_noise,
    deviation_of_tolerance,
    load_prior,
    rank,
)
from posekit.ranking.directions import DIRECTION_NAMES, LIMB_SEGMENTS, directions
from posekit.ranking.evidence import DEFAULT_DEVIATION_METRES
from posekit.ranking.foreshortening import log_room
from posekit.ranking.ground import standing
from posekit.ranking.image_term import MIN_DEVIATION_METRES
from posekit.ranking.posture_prior import WEIGHT_NAMES
from posekit.ranking.student import StudentMixture, digamma
from posekit.skeleton import JOINT, JOINTS
from posekit.synthesis import random_postures

FIGURE = load_figure()
LENGTHS = FIGURE.lengths
STANDING = FIGURE.neutral_points[:14].copy()
UP = np.array([0.0, 0.0, 1.0])
POSTURE_ITSELF = ["posture", "foreshortening"]


def columns(postures: Array) -> Array:
    return np.ascontiguousarray(np.atleast_3d(postures).reshape(-1, 14, 3).transpose(1, 2, 0))


def random_joints(count: int, seed: int = 0) -> Array:
    return FIGURE.forward_kinematics(random_postures(FIGURE, count, np.random.default_rng(seed)))[:, :14]


@pytest.mark.parametrize("x", [0.1, 0.5, 1.0, 2.0, 4.5, 11.99, 12.0, 40.0])
def test_digamma_is_scipys(x: float) -> None:
    assert digamma(x) == pytest.approx(special.digamma(x), rel=1e-13, abs=1e-13)


def test_students_excess_is_scipys_density_over_its_mean() -> None:
    rng = np.random.default_rng(0)
    a = rng.normal(size=(5, 5))
    student = StudentMixture(means=rng.normal(size=5), scale=a @ a.T + np.eye(5), dof=4.0)
    x = rng.normal(size=(5, 8)) * 3
    for count in (2, 5):
        law = stats.multivariate_t(student.means[0, :count], student.scale[:count, :count], df=4.0)
        wanted = law.logpdf(x[:count].T) + law.entropy()
        np.testing.assert_allclose(student.excess(x, (count,))[0], wanted, rtol=1e-9, atol=1e-9)


def test_unknown_coordinates_are_left_out() -> None:
    rng = np.random.default_rng(1)
    a = rng.normal(size=(6, 6))
    student = StudentMixture(means=rng.normal(size=6), scale=a @ a.T + np.eye(6), dof=3.0)
    x = rng.normal(size=(6, 9))
    x[1, ::2] = np.nan
    x[5, ::3] = np.nan
    found = student.excess(x, (4, 6))
    for k in range(9):
        for row, count in enumerate((4, 6)):
            known = np.flatnonzero(np.isfinite(x[:count, k]))
            law = stats.multivariate_t(student.means[0, known], student.scale[np.ix_(known, known)], df=3.0)
            assert found[row, k] == pytest.approx(law.logpdf(x[known, k]) + law.entropy(), abs=1e-9)
    assert (student.excess(np.full((6, 2), np.nan), (4, 6)) == 0).all()


def test_the_mean_excess_of_draws_is_zero() -> None:
    student = StudentMixture(means=np.zeros(3), scale=np.diag([1.0, 4.0, 0.1]), dof=5.0)
    draws = stats.multivariate_t(student.means[0], student.scale, df=5.0, seed=2).rvs(40_000)
    assert student.excess(draws.T, (3,)).mean() == pytest.approx(0.0, abs=0.03)


def mixture(seed: int, size: int = 4, count: int = 5, dof: float = 4.0) -> StudentMixture:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(size, size))
    return StudentMixture(
        means=rng.normal(size=(count, size)) * 4,
        share=rng.uniform(0.2, 1, count),
        scale=a @ a.T + np.eye(size),
        dof=dof,
    )


@pytest.mark.parametrize("dof", [4.0, 5.0, 4.3, 300.0])
def test_a_mixture_is_as_dense_as_its_parts_together(dof: float) -> None:
    """Differences of the log-density are those of the sum of scipy's densities, near and far."""
    one = mixture(3, dof=dof)
    x = np.random.default_rng(4).normal(size=(4, 700)) * np.geomspace(0.1, 50, 700)
    for count in (2, 4):
        laws = [stats.multivariate_t(m[:count], one.scale[:count, :count], df=dof) for m in one.means]
        parts = np.array([law.logpdf(x[:count].T) for law in laws]) + np.log(one.shares)[:, None]
        wanted = special.logsumexp(parts, axis=0)
        found = one.excess(x, (count,))[0]
        np.testing.assert_allclose(found - found[0], wanted - wanted[0], rtol=1e-8, atol=1e-8)


def test_equal_parts_are_one() -> None:
    one = mixture(5, count=1)
    thrice = replace(one, means=np.repeat(one.means, 3, axis=0), share=np.array([1.0, 2.0, 3.0]))
    x = np.random.default_rng(6).normal(size=(4, 20)) * 3
    x[2, ::3] = np.nan
    np.testing.assert_allclose(thrice.excess(x, (2, 4)), one.excess(x, (2, 4)), rtol=1e-9, atol=1e-9)
    assert (one.moments.scale == one.scale).all()


def test_the_moments_of_a_mixture_are_those_of_its_draws() -> None:
    one = mixture(7, dof=6.0)
    rng = np.random.default_rng(8)
    which = rng.choice(5, 60_000, p=one.shares)
    normal = rng.multivariate_normal(np.zeros(4), one.scale, size=60_000)
    draws = one.means[which] + normal
    np.testing.assert_allclose(one.moments.means[0], draws.mean(axis=0), rtol=0, atol=0.1)
    np.testing.assert_allclose(one.moments.scale, np.cov(draws.T), rtol=0.05, atol=0.4)


def test_foreshortening_is_zero_on_average_and_more_beside_the_picture() -> None:
    """Far away rays are parallel; limbs whose segments point evenly everywhere say nothing on average."""
    rng = np.random.default_rng(9)
    joints = np.zeros((14, 3, 40_000))
    for start, end in LIMB_SEGMENTS:
        vector = rng.normal(size=(3, 40_000))
        joints[end] = joints[start] + vector / np.linalg.norm(vector, axis=0)
    joints[:, 2] += 1e6
    room = log_room(joints)
    assert room.mean() == pytest.approx(0.0, abs=0.03)
    flat, deep = np.zeros((14, 3, 1)), np.zeros((14, 3, 1))
    for k, (_, end) in enumerate(LIMB_SEGMENTS):
        flat[end, 0], deep[end, 2] = k + 1, k + 1
    flat[:, 2] += 1e6
    deep[:, 2] += 1e6
    assert log_room(flat)[0] >= room.max()
    assert log_room(deep)[0] <= room.min() + 1e-6
    # A photograph's rays are parallel wherever the body is put.
    np.testing.assert_allclose(log_room(flat - 1e6), log_room(flat), rtol=0, atol=1e-4)
    flat[LIMB_SEGMENTS[1][1]] = np.nan
    assert np.isfinite(log_room(flat)).all()


def test_directions_are_those_of_the_figures_frames() -> None:
    joints = random_joints(20)
    found = directions(columns(joints), np.tile(UP[:, None], 20))
    R = torso_frame(*(joints[:, k] for k in range(4)))
    hips = hips_frame(*(joints[:, JOINT[name]] for name in ("pelvis", "right_hip", "left_hip")))
    np.testing.assert_allclose(found[0].T, np.einsum("nji,nj->ni", R, hips[:, :, 1]), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[1].T, np.einsum("nji,nj->ni", R, -hips[:, :, 2]), rtol=0, atol=1e-12)
    for k, name in enumerate(DIRECTION_NAMES[2:10], 2):
        start, end = (JOINT[joint] for joint in name.split("-"))
        along = joints[:, end] - joints[:, start]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        np.testing.assert_allclose(found[k].T, np.einsum("nji,nj->ni", R, along), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[10].T, np.einsum("nji,j->ni", R, UP), rtol=0, atol=1e-12)


def test_the_centre_of_mass_of_who_stands_is_above_the_hips() -> None:
    """Some 55 to 57 % of stature above the soles (Winter 2009); the figure's ankles are 4 % above them."""
    centre = centre_of_mass(columns(STANDING))[:, 0]
    stature = stature_from_lengths(LENGTHS)
    ankle = STANDING[JOINT["right_ankle"], 2]
    assert 0.49 < (centre[2] - ankle) / stature < 0.57
    assert centre[1] == pytest.approx(0.0, abs=1e-12)


def test_the_centre_of_mass_moves_with_a_limb_by_its_share() -> None:
    moved = STANDING.copy()
    moved[JOINT["left_ankle"]] += [0.3, 0.0, 0.0]
    shift = (centre_of_mass(columns(moved)) - centre_of_mass(columns(STANDING)))[:, 0]
    assert shift[0] == pytest.approx(0.3 * (0.0457 * 0.4374 + 0.0133), rel=1e-3)


def test_a_missing_hand_is_left_out_of_the_centre_of_mass() -> None:
    lacking = STANDING.copy()
    lacking[JOINT["left_wrist"]] = np.nan
    centre, whole = centre_of_mass(columns(lacking))[:, 0], centre_of_mass(columns(STANDING))[:, 0]
    assert np.isfinite(centre).all()
    assert np.linalg.norm(centre - whole) < 0.02
    lacking[JOINT["neck"]] = np.nan
    assert np.isnan(centre_of_mass(columns(lacking))).all()


def test_who_stands_is_in_balance_and_who_leans_is_not() -> None:
    off, apart = standing(columns(STANDING), UP[:, None])
    assert apart[0] == pytest.approx(0.0, abs=1e-12)
    angle = np.radians(20)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    leaning, _ = standing(columns(STANDING @ turn.T), UP[:, None])
    height = centre_of_mass(columns(STANDING))[2, 0] - STANDING[JOINT["right_ankle"], 2]
    assert off[0] < 0.10
    assert abs(leaning[0] - height * np.sin(angle)) < 0.12


def test_on_one_leg_the_support_is_that_foot() -> None:
    raised = STANDING.copy()
    raised[JOINT["left_ankle"], 2] += 1.0
    off, apart = standing(columns(raised), UP[:, None])
    centre = centre_of_mass(columns(raised))[:, 0]
    assert apart[0] == pytest.approx(1.0)
    away = np.hypot(*(centre - raised[JOINT["right_ankle"]])[:2])
    assert off[0] == pytest.approx(away, abs=1e-3)


def test_the_support_by_trying_all_of_its_points() -> None:
    joints = random_joints(40, 7)
    off, _ = standing(columns(joints), UP[:, None])
    centre = centre_of_mass(columns(joints)).T
    for posture, middle, found in zip(joints, centre, off, strict=True):
        feet = sorted(
            (posture[JOINT["right_ankle"]], posture[JOINT["left_ankle"]]), key=lambda p: float(p[2])
        )
        rise = float(feet[1][2] - feet[0][2])
        reach = np.exp(-(rise**2) / (2 * 0.1**2))
        places = feet[0][:2] + np.linspace(0, reach, 2001)[:, None] * (feet[1] - feet[0])[:2]
        assert found == pytest.approx(np.linalg.norm(places - middle[:2], axis=1).min(), abs=1e-3)


def test_between_the_feet_is_over_the_support() -> None:
    wide = STANDING.copy()
    wide[JOINT["right_ankle"]] = [0.0, -0.4, 0.0]
    wide[JOINT["left_ankle"]] = [0.0, 0.4, 0.0]
    wide[:, 0] = 0.0
    assert standing(columns(wide), UP[:, None])[0][0] == pytest.approx(0.0, abs=1e-12)


def test_gravity_prefers_who_stands_upright() -> None:
    turn = np.diag([1.0, -1.0, -1.0])
    both = np.stack([STANDING, STANDING @ turn.T])
    ranking = rank(RankingEvidence.of(both, LENGTHS, up=Up(direction=UP)))
    assert ranking.terms["gravity"][0] > ranking.terms["gravity"][1] + 1
    assert ranking.terms["posture"][0] == pytest.approx(ranking.terms["posture"][1])
    assert ranking.probability[0] > 0.9


def test_a_less_certain_up_says_less() -> None:
    turn = np.diag([1.0, -1.0, -1.0])
    both = np.stack([STANDING, STANDING @ turn.T])
    gaps = [
        float(
            np.ptp(
                rank(RankingEvidence.of(both, LENGTHS, up=Up(direction=UP, deviation=angle))).terms["gravity"]
            )
        )
        for angle in (0.0, 20.0, 60.0)
    ]
    assert gaps[0] > gaps[1] > gaps[2] > 0


def test_the_prior_prefers_a_standing_person_to_broken_ones() -> None:
    """Knees that bend forward, elbows that bend backward."""
    backward = STANDING.copy()
    for joint, wrong in (("right_ankle", 0.35), ("left_ankle", 0.35), ("right_wrist", -0.25)):
        backward[JOINT[joint], 0] += wrong
        backward[JOINT[joint], 2] += 0.2
    ranking = rank(RankingEvidence.of(np.stack([STANDING, backward]), LENGTHS), without=["image"])
    assert ranking.probability[0] > 0.8


def test_the_posture_counts_less_the_farther_survivors_are_off() -> None:
    joints = random_joints(2)
    prior = load_prior()
    exact, rough = (
        rank(RankingEvidence.of(joints, deviation=value)).terms["posture"] for value in (0.0, 0.04)
    )
    np.testing.assert_allclose(rough, exact / (1 + 0.04 / prior.temperature), rtol=1e-12)


def test_the_image_prefers_who_has_the_persons_lengths() -> None:
    stretched = STANDING.copy()
    stretched[JOINT["right_shoulder"], 1] -= 0.03
    both = np.stack([STANDING, stretched])
    ranking = rank(RankingEvidence.of(both, LENGTHS, length_residual=np.zeros(2)), without=["posture"])
    assert ranking.probability[0] > ranking.probability[1]
    less = rank(
        RankingEvidence.of(both, LENGTHS, length_residual=np.zeros(2), deviation=0.1), without=["posture"]
    )
    assert less.probability[0] < ranking.probability[0]
    short = rank(
        RankingEvidence.of(np.stack([STANDING, STANDING]), LENGTHS, length_residual=[0.0, 0.02]),
        without=["posture"],
    )
    assert short.probability[0] > 0.6


def test_the_image_is_a_t_distribution_of_each_misfit() -> None:
    joints = random_joints(6) + np.random.default_rng(3).normal(scale=0.02, size=(6, 14, 3))
    residual = np.linspace(0, 0.05, 6)
    deviation = 0.02
    ranking = rank(RankingEvidence.of(joints, LENGTHS, length_residual=residual, deviation=deviation))
    pairs = [
        ("right_shoulder", "left_shoulder"),
        ("right_shoulder", "pelvis"),
        ("left_shoulder", "pelvis"),
        ("right_hip", "left_hip"),
    ]
    law = stats.t(df=4.0, scale=deviation)
    wanted = law.logpdf(residual) + law.entropy()
    for a, b in pairs:
        name = "-".join(sorted((a, b), key=JOINTS.index))
        off = np.linalg.norm(joints[:, JOINT[a]] - joints[:, JOINT[b]], axis=1) - LENGTHS[name]
        wanted = wanted + law.logpdf(off) + law.entropy()
    np.testing.assert_allclose(ranking.terms["image"], load_prior().weights["image"] * wanted, rtol=1e-9)


def test_a_torso_is_no_more_rigid_than_torsos_are() -> None:
    joints = random_joints(3)
    one, other = (
        rank(RankingEvidence.of(joints, LENGTHS, deviation=value)).terms["image"]
        for value in (0.0, MIN_DEVIATION_METRES)
    )
    np.testing.assert_allclose(one, other, rtol=0, atol=0)


def test_chi2_is_the_images_term_where_there_is_one() -> None:
    joints = random_joints(4)
    chi2 = np.array([1.0, 5.0, np.nan, np.inf])
    ranking = rank(RankingEvidence.of(joints, LENGTHS, chi2=chi2), without=POSTURE_ITSELF)
    weight = load_prior().weights_of(refined=True)["image"]
    weight /= 1 + (DEFAULT_DEVIATION_METRES / load_prior().image_temperature) ** 2
    assert ranking.terms["image"][:2].tolist() == pytest.approx([-0.5 * weight, -2.5 * weight])
    assert ranking.terms["image"][2] == -np.inf  # as bad as the worst of its frame
    assert ranking.probability[2:].tolist() == [0, 0]
    finite = rank(RankingEvidence.of(joints[:3], chi2=chi2[:3]), without=POSTURE_ITSELF)
    assert finite.terms["image"][2] == finite.terms["image"][1]
    nothing = rank(RankingEvidence.of(joints[:2], chi2=np.full(2, np.nan)), without=POSTURE_ITSELF)
    assert nothing.probability.tolist() == [0.5, 0.5]
    hopeless = rank(RankingEvidence.of(joints[:2], chi2=np.full(2, np.inf)), without=["posture"])
    assert hopeless.probability.tolist() == [0.5, 0.5]


def test_depth_prefers_what_is_where_it_was_told_to_be() -> None:
    joints = STANDING + np.array([[[0.0, 0.0, z]] for z in (3.0, 3.2, 4.0)])
    depth = Depth(estimate=np.array([3.2]), deviation=np.array([0.1]))
    ranking = rank(RankingEvidence.of(joints, depth=depth), without=["posture"])
    neck = joints[:, 0, 2]
    law = stats.t(df=4.0, loc=3.2, scale=0.1)
    wanted = law.logpdf(neck) + stats.t(df=4.0, scale=0.1).entropy()
    np.testing.assert_allclose(ranking.terms["depth"], load_prior().weights["depth"] * wanted, rtol=1e-9)
    unheard = Depth(estimate=np.array([np.nan]), deviation=np.array([np.nan]))
    unknown = rank(RankingEvidence.of(joints, depth=unheard), without=["posture"])
    assert (unknown.terms["depth"] == 0).all()


def test_terms_from_outside() -> None:
    joints = random_joints(4)
    frame = np.array([0, 0, 1, 1])
    ranking = rank(
        RankingEvidence.of(joints, frame=frame),
        without=["posture"],
        extra={"mine": [0.0, np.log(3.0), np.nan, -2.0], "theirs": lambda postures: np.zeros(len(postures))},
    )
    assert ranking.probability.tolist() == pytest.approx([0.25, 0.75, 0.5, 0.5])
    assert set(ranking.terms) == {"mine", "theirs"}
    less = rank(
        RankingEvidence.of(joints, frame=frame), without=["posture", "mine"], extra={"mine": np.zeros(4)}
    )
    assert not less.terms


def test_contact_prefers_feet_on_one_level() -> None:
    raised = STANDING.copy()
    raised[JOINT["left_ankle"], 2] += 0.2
    prior = replace(load_prior(), weights=dict.fromkeys(WEIGHT_NAMES, 2.0))
    terms = rank(RankingEvidence.of(np.stack([STANDING, raised]), up=Up(direction=UP)), prior=prior).terms[
        "contact"
    ]
    assert terms[0] == pytest.approx(2 * prior.contact.usual)
    assert terms[0] - terms[1] == pytest.approx(2 * np.log1p((0.2 / prior.contact.scale) ** 2))


def test_level_says_that_it_is_assumed() -> None:
    assert Up.level(10).says == "assumed: a level camera, within 10 degrees"
    R = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # y of the camera is down
    np.testing.assert_allclose(Up.of_camera(R, [0, 0, 1]).direction, [0, -1, 0], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"direction": [0, 0, 0]}, "without a direction"),
        ({"direction": [np.nan, 0, 1]}, "without a direction"),
        ({"direction": [np.inf, 0, 1]}, "without a direction"),
        ({"direction": [0, 1]}, "shape"),
        ({"direction": np.ones((2, 2, 3))}, "shape"),
        ({"direction": UP, "deviation": 90.0}, "90"),
        ({"direction": UP, "deviation": -1.0}, "deviation"),
        ({"direction": UP, "deviation": np.nan}, "deviation"),
    ],
)
def test_no_direction_is_refused(given: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        Up(**given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("estimate", "deviation"),
    [([1.0], [0.0]), ([1.0], [-1.0]), ([np.inf], [1.0]), ([1.0, 2.0], [1.0]), (1.0, 1.0)],
)
def test_no_depth_is_refused(estimate: object, deviation: object) -> None:
    with pytest.raises(InputError, match="depth"):
        Depth(estimate=estimate, deviation=deviation)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"joints": np.zeros((2, 19, 3))}, r"joints has shape \(2, 19, 3\); expected \(N, 14, 3\)"),
        ({"joints": "abc"}, "no array of numbers"),
        ({"joints": np.full((2, 14, 3), np.inf)}, "beyond"),
        ({"joints": np.full((2, 14, 3), 1e200)}, "beyond"),
        ({"frame": [0, -1]}, "whole numbers"),
        ({"frame": [0.0, 1.0]}, "whole numbers"),
        ({"frame": [0]}, "whole numbers"),
        ({"frame": [0, 3], "deviation": [0.1, 0.1]}, "deviation has shape"),
        ({"deviation": np.nan}, "finite metres"),
        ({"deviation": -0.1}, "finite metres"),
        ({"frame": [0, 3], "up": Up(direction=np.ones((2, 3)))}, "up is given for 2 frames; expected 4"),
        (
            {"frame": [0, 3], "depth": Depth(estimate=np.ones(1), deviation=np.ones(1))},
            "depth is given for 1",
        ),
        ({"length_residual": [0.0]}, "length_residual has shape"),
        ({"chi2": [0.0]}, "chi2 has shape"),
        ({"chi2": [-1.0, 1.0]}, "negative"),
        ({"lengths": {}}, "is missing"),
        ({"lengths": {**LENGTHS, "right_hip-left_hip": np.nan}}, "right_hip-left_hip"),
        ({"without": ["postures"]}, "'postures' is no term.*posture"),
        ({"extra": {"image": np.zeros(2)}}, "a term already"),
        ({"extra": {"mine": np.zeros(3)}}, "mine has shape"),
        ({"extra": {"mine": [np.inf, 0.0]}}, "infinite"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, object], says: str) -> None:
    options: dict[str, object] = {"joints": np.zeros((2, 14, 3))} | given
    others = {name: options.pop(name) for name in ("extra", "without", "prior") if name in options}
    with pytest.raises(InputError, match=says) as caught:
        rank(RankingEvidence.of(**options), **others)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_the_deviation_of_survivors() -> None:
    assert deviation_of_noise(0.0, 0.003) == pytest.approx(MIN_DEVIATION_METRES)
    np.testing.assert_allclose(
        deviation_of_noise([2.0, 4.0], 0.002), np.hypot(MIN_DEVIATION_METRES, [0.008, 0.016]), rtol=1e-12
    )
    # 2 px of 2 mm, 6 mm of a torso, and 5 % of 60 cm.
    assert deviation_of_noise(2.0, 0.002, 0.05) == pytest.approx(np.sqrt(0.008**2 + 0.006**2 + 0.03**2))
    np.testing.assert_allclose(
        deviation_of_tolerance([0.0, 1e-8, 0.22]),
        [MIN_DEVIATION_METRES, MIN_DEVIATION_METRES, 0.1],
        rtol=1e-12,
    )
    for wrong in (-1.0, np.nan, np.inf):
        with pytest.raises(InputError):
            deviation_of_noise(wrong, 0.002)
        with pytest.raises(InputError):
            deviation_of_noise(2.0, wrong)
        with pytest.raises(InputError, match="deviations of lengths"):
            deviation_of_noise(2.0, 0.002, wrong)
        with pytest.raises(InputError):
            deviation_of_tolerance(wrong)
