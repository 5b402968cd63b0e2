"""Laws of ranking: what the probabilities must not depend on, and what they must."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from posekit.body import load_figure
from posekit.geometry import Array
from posekit.ranking import TERM_NAMES, Depth, Ranking, RankingEvidence, Up, load_prior, rank
from posekit.ranking.posture_prior import WEIGHT_NAMES
from posekit.skeleton import JOINT, JOINTS
from posekit.synthesis import random_postures

FIGURE = load_figure()
LENGTHS = FIGURE.lengths
PRIOR = replace(load_prior(), weights=dict.fromkeys(WEIGHT_NAMES, 1.0))
"""With every term counting."""
SWAPPED = [
    JOINT[name.replace("right_", "?_").replace("left_", "right_").replace("?_", "left_")] for name in JOINTS
]
COUNT, FRAMES = 120, 7


def survivors(count: int = COUNT, seed: int = 3) -> tuple[Array, NDArray[np.intp], Array]:
    """Return random postures before a camera, a little out of shape, their frames and their length residuals."""
    rng = np.random.default_rng(seed)
    q = random_postures(FIGURE, count, rng)
    joints = FIGURE.forward_kinematics(q)[:, :14] + rng.normal(scale=0.01, size=(count, 14, 3))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    residual = np.where(rng.random(count) < 0.3, rng.uniform(0, 0.03, count), 0.0)
    return np.asarray(joints @ turn.T + [0, 0, 4.0]), rng.integers(0, FRAMES, count), residual


def ups(seed: int = 4) -> Array:
    return np.asarray(np.random.default_rng(seed).normal(size=(FRAMES, 3)))


def ranked(joints: Array, frame: NDArray[np.intp], residual: Array, **given: object) -> Ranking:
    options = {"up": Up(direction=ups()), "deviation": np.linspace(0.006, 0.05, FRAMES)} | given
    others = {name: options.pop(name) for name in ("prior", "extra", "without") if name in options}
    evidence = RankingEvidence.of(joints, LENGTHS, frame=frame, length_residual=residual, **options)  # type: ignore[arg-type]
    return rank(evidence, **({"prior": PRIOR} | others))  # type: ignore[arg-type]


def test_probabilities_of_a_frame_sum_to_one() -> None:
    joints, frame, residual = survivors()
    ranking = ranked(joints, frame, residual)
    assert ((ranking.probability >= 0) & (ranking.probability <= 1)).all()
    sums = np.bincount(frame, weights=ranking.probability, minlength=FRAMES)
    np.testing.assert_allclose(sums, 1.0, rtol=0, atol=1e-12)


def test_they_are_the_exponential_of_the_terms() -> None:
    joints, frame, residual = survivors()
    ranking = ranked(joints, frame, residual)
    score = np.sum(list(ranking.terms.values()), axis=0)
    for k in range(FRAMES):
        mine = frame == k
        weight = np.exp(score[mine] - score[mine].max())
        np.testing.assert_allclose(ranking.probability[mine], weight / weight.sum(), rtol=1e-9)


def test_permuting_survivors_permutes_probabilities() -> None:
    joints, frame, residual = survivors(5000)  # more than are computed together
    order = np.random.default_rng(1).permutation(5000)
    here, there = ranked(joints, frame, residual), ranked(joints[order], frame[order], residual[order])
    np.testing.assert_allclose(there.probability, here.probability[order], rtol=1e-9)
    for name, values in here.terms.items():
        np.testing.assert_allclose(there.terms[name], values[order], rtol=1e-9, atol=1e-9)


def test_frames_are_ranked_by_themselves() -> None:
    joints, frame, residual = survivors()
    together = ranked(joints, frame, residual)
    for k in (0, FRAMES - 1):
        mine = frame == k
        alone = rank(
            RankingEvidence.of(
                joints[mine],
                LENGTHS,
                length_residual=residual[mine],
                up=Up(direction=ups()[k]),
                deviation=np.linspace(0.006, 0.05, FRAMES)[k],
            ),
            prior=PRIOR,
        )
        np.testing.assert_allclose(alone.probability, together.probability[mine], rtol=1e-9)
        np.testing.assert_allclose(together.of(k).probability, together.probability[mine], rtol=0)


@pytest.mark.parametrize("seed", range(3))
def test_a_rigid_motion_of_everything_changes_nothing_but_how_it_is_seen(seed: int) -> None:
    joints, frame, residual = survivors()
    unseen = ["foreshortening"]
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    moved = joints @ turn.T + rng.normal(size=3)
    here = ranked(joints, frame, residual, without=unseen)
    there = ranked(moved, frame, residual, up=Up(direction=ups() @ turn.T), without=unseen)
    np.testing.assert_allclose(there.probability, here.probability, rtol=1e-6, atol=1e-12)
    for name, values in here.terms.items():
        np.testing.assert_allclose(there.terms[name], values, rtol=0, atol=1e-8)


def test_a_camera_that_rolls_changes_nothing() -> None:
    joints, frame, residual = survivors()
    roll = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    here = ranked(joints, frame, residual)
    there = ranked(joints @ roll.T, frame, residual, up=Up(direction=ups() @ roll.T))
    np.testing.assert_allclose(there.probability, here.probability, rtol=1e-6, atol=1e-12)


def test_turning_the_body_but_not_up_changes_gravity_alone() -> None:
    joints, frame, residual = survivors()
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    here, there = ranked(joints, frame, residual), ranked(joints @ turn.T, frame, residual)
    np.testing.assert_allclose(there.terms["posture"], here.terms["posture"], rtol=0, atol=1e-8)
    np.testing.assert_allclose(there.terms["image"], here.terms["image"], rtol=0, atol=1e-8)
    assert np.abs(there.terms["gravity"] - here.terms["gravity"]).max() > 0.1
    assert np.abs(there.terms["balance"] - here.terms["balance"]).max() > 0.1
    assert np.abs(there.terms["contact"] - here.terms["contact"]).max() > 0.1


def test_a_mirror_changes_nothing() -> None:
    """A mirror exchanges left and right; people are alike on both sides."""
    joints, frame, residual = survivors()
    mirror = np.array([-1.0, 1.0, 1.0])
    here = ranked(joints, frame, residual)
    there = ranked((joints * mirror)[:, SWAPPED], frame, residual, up=Up(direction=ups() * mirror))
    np.testing.assert_allclose(there.probability, here.probability, rtol=1e-6, atol=1e-12)
    for name, values in here.terms.items():
        np.testing.assert_allclose(there.terms[name], values, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", TERM_NAMES)
def test_a_term_left_out_leaves_the_others_as_they_are(name: str) -> None:
    joints, frame, residual = survivors()
    depth = Depth(estimate=np.full(FRAMES, 4.0), deviation=np.full(FRAMES, 0.1))
    whole = ranked(joints, frame, residual, depth=depth)
    part = ranked(joints, frame, residual, depth=depth, without=[name])
    assert set(whole.terms) == set(TERM_NAMES)
    assert set(part.terms) == set(TERM_NAMES) - {name}
    for other, values in part.terms.items():
        np.testing.assert_allclose(values, whole.terms[other], rtol=0, atol=1e-9)


def test_without_up_the_posture_is_judged_as_with_it() -> None:
    joints, frame, residual = survivors()
    with_up, without = ranked(joints, frame, residual), ranked(joints, frame, residual, up=None)
    assert set(without.terms) == {"image", "posture", "foreshortening"}
    np.testing.assert_allclose(without.terms["posture"], with_up.terms["posture"], rtol=0, atol=1e-9)
    assert without.up == ""
    assert with_up.up == "known"


def test_without_anything_to_go_by_all_are_equal() -> None:
    joints, frame, _ = survivors()
    ranking = rank(RankingEvidence.of(joints, frame=frame), without=TERM_NAMES)
    np.testing.assert_allclose(ranking.probability, 1.0 / np.bincount(frame)[frame], rtol=1e-12)
    assert not ranking.terms


@pytest.mark.parametrize("joint", JOINTS)
def test_an_unknown_joint_drops_out(joint: str) -> None:
    joints, frame, residual = survivors()
    joints[::2, JOINT[joint]] = np.nan
    ranking = ranked(joints, frame, residual)
    assert np.isfinite(ranking.probability).all()
    assert all(np.isfinite(values).all() for values in ranking.terms.values())
    whole = ranked(joints[1::2], frame[1::2], residual[1::2])
    for name, values in ranking.terms.items():
        np.testing.assert_allclose(values[1::2], whole.terms[name], rtol=0, atol=1e-9)


def test_what_does_not_hang_on_an_unknown_joint_is_not_changed_by_it() -> None:
    """Where every survivor lacks the left arm, its terms are those of the rest: the image's stay as they were."""
    joints, frame, residual = survivors()
    armless = joints.copy()
    armless[:, [JOINT["left_elbow"], JOINT["left_wrist"]]] = np.nan
    here, there = ranked(joints, frame, residual), ranked(armless, frame, residual)
    for name in ("image", "contact"):
        np.testing.assert_allclose(there.terms[name], here.terms[name], rtol=0, atol=1e-9)
    waved = joints.copy()
    waved[:, JOINT["left_elbow"]] += 0.1
    waved[:, [JOINT["left_elbow"], JOINT["left_wrist"]]] = np.nan
    np.testing.assert_allclose(ranked(waved, frame, residual).probability, there.probability, rtol=1e-12)


def test_nothing_known_at_all_is_equal() -> None:
    joints = np.full((5, 14, 3), np.nan)
    ranking = rank(
        RankingEvidence.of(
            joints,
            LENGTHS,
            length_residual=np.full(5, np.nan),
            up=Up.level(),
            depth=Depth(estimate=np.array([np.nan]), deviation=np.array([np.nan])),
        )
    )
    np.testing.assert_allclose(ranking.probability, 0.2, rtol=1e-12)
    assert all((values == 0).all() for values in ranking.terms.values())


def test_an_unknown_up_of_a_frame_says_nothing_there() -> None:
    joints, frame, residual = survivors()
    upward = ups()
    upward[2] = np.nan
    ranking = ranked(joints, frame, residual, up=Up(direction=upward))
    for name in ("gravity", "balance", "contact"):
        np.testing.assert_allclose(ranking.terms[name][frame == 2], 0.0, rtol=0, atol=1e-9)
        assert np.abs(ranking.terms[name][frame != 2]).max() > 0.1


def test_order_is_by_frame_and_probability() -> None:
    joints, frame, residual = survivors()
    ranking = ranked(joints, frame, residual)
    assert np.array_equal(np.sort(ranking.order), np.arange(COUNT))
    assert (np.diff(frame[ranking.order]) >= 0).all()
    same = np.diff(frame[ranking.order]) == 0
    assert (np.diff(ranking.probability[ranking.order])[same] <= 0).all()
    first = ranking.first(FRAMES + 2)
    assert first[FRAMES:].tolist() == [-1, -1]
    for k in range(FRAMES):
        mine = np.flatnonzero(frame == k)
        assert first[k] == mine[np.argmax(ranking.probability[mine])]


def test_no_survivors_at_all() -> None:
    ranking = rank(
        RankingEvidence.of(np.empty((0, 14, 3)), LENGTHS, frame=np.empty(0, dtype=int), up=Up.level())
    )
    assert len(ranking) == 0
    assert len(ranking.probability) == 0
    assert ranking.first(2).tolist() == [-1, -1]


def test_one_survivor_is_certain() -> None:
    joints, _, residual = survivors(1)
    assert rank(
        RankingEvidence.of(joints, LENGTHS, length_residual=residual, up=Up.level())
    ).probability.tolist() == [1.0]


def test_results_are_read_only() -> None:
    joints, frame, residual = survivors()
    mine = frame.copy()
    ranking = ranked(joints, mine, residual)
    mine[0] = 0
    with pytest.raises(ValueError, match="read-only"):
        ranking.probability[0] = 1.0
    with pytest.raises(TypeError):
        ranking.terms["image"] = ranking.probability  # type: ignore[index]
