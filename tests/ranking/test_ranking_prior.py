"""Priors: fitted, written, read; the weights of terms."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from benchmarks.studies.prior_fitting import DIRECTION_BLOCKS, fit_prior
from benchmarks.studies.weight_fitting import fit_weights
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking import TERM_NAMES, Prior, Ranking, RankingEvidence, Up, load_prior, rank, write_prior
from posekit.ranking.directions import DIRECTION_NAMES, directions, mirrored
from posekit.ranking.posture_prior import WEIGHT_NAMES
from posekit.ranking.prior_file import BUILT_IN, prior_lines
from posekit.ranking.ranking import softmax
from posekit.skeleton import JOINT, JOINTS
from posekit.synthesis import random_postures

FIGURE = load_figure()
UP = np.array([0.0, 0.0, 1.0])


def postures(count: int = 400, seed: int = 0) -> Array:
    return FIGURE.forward_kinematics(random_postures(FIGURE, count, np.random.default_rng(seed)))[:, :14]


def test_the_built_in_prior_is_small_and_says_where_it_is_from() -> None:
    for name in BUILT_IN:
        path = resources.files("posekit.urdf") / "priors" / f"{name}.toml"
        assert len(path.read_bytes()) < 50_000
        prior = load_prior(name)
        assert "mocap.cs.cmu.edu" in prior.source
        assert "EIA-0196217" in prior.source
        judged = [n for block in prior.blocks for n in (["up"] if block.conditional else block.names)]
        assert sorted(judged) == sorted(DIRECTION_NAMES)
    assert "pybullet" in load_prior().source


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_built_in_prior_is_symmetric(name: str) -> None:
    """It takes the mirrored body for as likely, but for the rounding of its table."""
    prior = load_prior(name)
    found = directions(np.ascontiguousarray(postures(200).transpose(1, 2, 0)), np.tile(UP[:, None], 200))
    for one, other in zip(prior.judge(found), prior.judge(mirrored(found)), strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=0.03)


def test_a_mirror_twice_is_none() -> None:
    found = directions(np.ascontiguousarray(postures(20).transpose(1, 2, 0)), UP[:, None] * np.ones(20))
    np.testing.assert_allclose(mirrored(mirrored(found)), found, rtol=0, atol=0)


def test_mirrored_directions_are_those_of_mirrored_postures() -> None:
    joints = postures(20)
    swapped = [JOINT[n.replace("right", "?").replace("left", "right").replace("?", "left")] for n in JOINTS]
    image = (joints * [1, -1, 1])[:, swapped]
    here = directions(np.ascontiguousarray(joints.transpose(1, 2, 0)), np.tile(UP[:, None], 20))
    there = directions(np.ascontiguousarray(image.transpose(1, 2, 0)), np.tile(UP[:, None], 20))
    np.testing.assert_allclose(mirrored(here), there, rtol=0, atol=1e-12)


def test_a_fitted_prior_has_the_moments_of_its_postures() -> None:
    joints = postures()
    prior = fit_prior(joints, UP, blocks=[shape._replace(middles=1, blur=0.2) for shape in DIRECTION_BLOCKS])
    found = directions(np.ascontiguousarray(joints.transpose(1, 2, 0)), np.tile(UP[:, None], len(joints)))
    both = np.concatenate([found, mirrored(found)], axis=2).reshape(33, -1)
    for block in prior.blocks:
        part = both[block.rows]
        np.testing.assert_allclose(block.student.means[0], part.mean(axis=1), rtol=0, atol=1e-12)
        wanted = np.cov(part, bias=True) + 0.04 * np.eye(len(part))
        np.testing.assert_allclose(block.student.scale, wanted, rtol=0, atol=1e-12)


def test_a_fitted_mixture_is_symmetric_and_knows_apart_what_it_was_made_of() -> None:
    """Between two postures that it saw, their mean is none."""
    seen = postures(2, 5)
    rng = np.random.default_rng(0)
    joints = np.repeat(seen, 30, axis=0) + rng.normal(scale=0.01, size=(60, 14, 3))
    prior = fit_prior(joints, UP, blocks=[DIRECTION_BLOCKS[1]._replace(middles=4)])
    one = fit_prior(joints, UP, blocks=[DIRECTION_BLOCKS[1]._replace(middles=1)])
    (block,) = prior.blocks
    assert len(block.student.means) == 4
    found = directions(np.ascontiguousarray(joints.transpose(1, 2, 0)), np.tile(UP[:, None], 60))
    middle = (found[..., :1] + found[..., 30:31]) / 2
    assert prior.judge(middle)[0] < prior.judge(found)[0].min()
    assert one.judge(middle)[0] > one.judge(found)[0].min()
    for x, y in zip(prior.judge(found), prior.judge(mirrored(found)), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=1e-6)


def test_weights_of_postures_are_as_many_postures() -> None:
    joints = postures(50)
    twice = np.concatenate([joints, joints[:10]])
    share = np.ones(50)
    share[:10] = 2
    one, other = fit_prior(twice, UP), fit_prior(joints, UP, share)
    for a, b in zip(one.blocks, other.blocks, strict=True):
        np.testing.assert_allclose(a.student.scale, b.student.scale, rtol=0, atol=1e-12)
    assert one.balance.usual == pytest.approx(other.balance.usual)


def test_incomplete_postures_are_left_out() -> None:
    joints = postures(50)
    holed = np.concatenate([joints, joints[:5]])
    holed[50:, JOINT["left_knee"]] = np.nan
    a, b = fit_prior(joints, UP), fit_prior(holed, UP)
    np.testing.assert_allclose(a.blocks[1].student.means, b.blocks[1].student.means, rtol=0, atol=1e-12)
    with pytest.raises(InputError, match="no posture has all joints"):
        fit_prior(np.full((3, 14, 3), np.nan), UP)


def test_its_own_postures_are_above_strangers() -> None:
    """Half of the bent ones are fitted; the other half are more likely than random postures."""
    near = postures(400, 1)[:, :, :] * 1.0
    q = random_postures(FIGURE, 400, np.random.default_rng(2))
    q[:, FIGURE.angle_index] *= 0.1
    calm = FIGURE.forward_kinematics(q)[:, :14]
    prior = fit_prior(calm[:200], UP)
    inside = rank(RankingEvidence.of(calm[200:]), prior=prior).terms["posture"]
    outside = rank(RankingEvidence.of(near), prior=prior).terms["posture"]
    assert np.median(inside) > np.quantile(outside, 0.99)


@pytest.mark.parametrize("share", [np.ones(3), -np.ones(5), np.full(5, np.nan)])
def test_impossible_weights_of_postures_are_refused(share: Array) -> None:
    with pytest.raises(InputError, match="weight"):
        fit_prior(postures(5), UP, share)


def test_a_prior_is_written_and_read_again(tmp_path: Path) -> None:
    prior = replace(
        fit_prior(postures(), UP, source='a "quoted"\nsource'), weights=dict.fromkeys(WEIGHT_NAMES, 0.25)
    )
    path = tmp_path / "mine.toml"
    write_prior(path, prior)
    again = load_prior(path)
    assert again.source == "a 'quoted' source"
    assert again.weights == prior.weights
    assert again.balance.usual == pytest.approx(prior.balance.usual, rel=1e-3)
    joints = postures(100, 5)
    here, there = (
        rank(RankingEvidence.of(joints, up=Up(direction=UP)), prior=one).terms for one in (prior, again)
    )
    for name, values in here.items():
        np.testing.assert_allclose(there[name], values, rtol=0, atol=0.05)
    assert list(prior_lines(again)) == list(prior_lines(load_prior(path)))


def table(**changed: str) -> str:
    entries = {
        "schema": 'schema = "posekit.posture_prior/1"',
        "dof": "dof = 4",
        "temperature": "temperature = 0.008",
        "weights": "[weights]\n" + "\n".join(f"{name} = 1.0" for name in WEIGHT_NAMES),
        "balance": "[balance]\nscale = 0.1\nusual = 0.5",
        "contact": "[contact]\nscale = 0.1\nusual = 0.5",
        "block": '[[block]]\ndirections = ["up"]\nmean = [0, 0, 1]\nscale = [[1], [0, 1], [0, 0, 1]]',
    } | changed
    return "\n".join(entries.values()) + "\n"


def test_a_prior_need_not_have_all_directions(tmp_path: Path) -> None:
    path = tmp_path / "up.toml"
    path.write_text(table(), encoding="utf-8")
    prior = load_prior(path)
    joints = postures(3)
    joints[1] = joints[1] * [-1, 1, -1]  # upside down
    ranking = rank(RankingEvidence.of(joints, up=Up(direction=UP)), prior=prior)
    assert (ranking.terms["posture"] == 0).all()
    assert np.ptp(ranking.terms["gravity"]) > 0
    assert (rank(RankingEvidence.of(joints), prior=prior).terms["posture"] == 0).all()


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"schema": 'schema = "posekit.ranges/1"'}, "schema"),
        ({"dof": "dof = 0"}, "dof"),
        ({"dof": 'dof = "4"'}, "dof"),
        ({"dof": "dof = nan"}, "finite"),
        ({"temperature": "temperature = 0"}, "temperature"),
        ({"temperature": "temperature = true"}, "temperature"),
        ({"weights": "[weights]\nimage = 1"}, "weights of image; expected image, posture"),
        ({"weights": "weights = 3"}, "weights"),
        ({"weights": "[weights]\nluck = 1\n" + "\n".join(f"{n} = 1" for n in WEIGHT_NAMES)}, "luck"),
        ({"weights": "[weights]\n" + "\n".join(f"{n} = -1" for n in WEIGHT_NAMES)}, "weights.image is -1.0"),
        ({"balance": "[balance]\nscale = 0\nusual = 0"}, "balance.scale"),
        ({"balance": "[balance]\nscale = 0.1"}, "balance.usual"),
        ({"contact": "[contact]\nscale = 1"}, "contact.usual"),
        ({"block": ""}, "block"),
        ({"block": '[[block]]\ndirections = ["up"]'}, r"block\[0\]\.mean: got nothing; expected this field"),
        ({"block": '[[block]]\ndirections = ["down"]\nmean = [0,0,1]\nscale = [[1],[0,1],[0,0,1]]'}, "down"),
        ({"block": "[[block]]\ndirections = [1]\nmean = [0,0,1]\nscale = [[1],[0,1],[0,0,1]]"}, "directions"),
        ({"block": '[[block]]\ndirections = ["up"]\nmean = [0,1]\nscale = [[1],[0,1],[0,0,1]]'}, "mean"),
        ({"block": '[[block]]\ndirections = ["up"]\nmean = [0,0,true]\nscale = [[1],[0,1],[0,0,1]]'}, "mean"),
        ({"block": '[[block]]\ndirections = ["up"]\nmean = [0,0,1]\nscale = [[1],[0,1],[0,1]]'}, "scale"),
        (
            {"block": '[[block]]\ndirections = ["up"]\nmean = [0,0,1]\nscale = [[1],[2,1],[0,0,1]]'},
            "positive definite",
        ),
        (
            {
                "block": '[[block]]\ndirections = ["up", "up"]\nmean = [0,0,1,0,0,1]\nscale = [[1],[0,1],[0,0,1]]'
            },
            "scale",
        ),
        ({"extra": "[luck]\nscale = 1"}, "luck"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path: Path, changed: dict[str, str], says: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(table(**changed), encoding="utf-8")
    with pytest.raises(InputError, match=says) as caught:
        load_prior(path)
    assert "\n" not in str(caught.value)
    assert "bad.toml" in str(caught.value)


def test_the_same_direction_in_two_blocks_is_refused(tmp_path: Path) -> None:
    block = '[[block]]\ndirections = ["up"]\nmean = [0, 0, 1]\nscale = [[1], [0, 1], [0, 0, 1]]\n'
    path = tmp_path / "bad.toml"
    path.write_text(table(block=block + block), encoding="utf-8")
    with pytest.raises(InputError, match="more than one block"):
        load_prior(path)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(InputError, match="cmu"):
        load_prior("cmo")
    with pytest.raises(InputError):
        load_prior("not_there.toml")


def drawn(weights: Array, seed: int, frames: int = 3000) -> tuple[Ranking, Array]:
    """Draw terms of eight survivors a frame, and one of them by the probability that the weights give."""
    rng = np.random.default_rng(seed)
    frame = np.repeat(np.arange(frames), 8)
    terms = rng.normal(size=(len(frame), len(weights)))
    p = softmax(terms @ weights, frame).reshape(frames, 8)
    chosen = (p.cumsum(axis=1) < rng.random(frames)[:, None]).sum(axis=1) + 8 * np.arange(frames)
    shuffle = rng.permutation(len(frame))
    place = np.argsort(shuffle)
    named = {f"t{k}": terms[shuffle, k].copy() for k in range(len(weights))}
    ranking = Ranking(probability=np.full(len(frame), 0.125), frame=frame[shuffle], terms=named)
    return ranking, place[chosen]


def test_weights_are_found_again() -> None:
    wanted = np.array([0.3, 1.2, 0.0])
    ranking, chosen = drawn(wanted, 0)
    found = fit_weights([ranking], [chosen])
    assert [found[f"t{k}"] for k in range(3)] == pytest.approx(wanted.tolist(), abs=0.08)


def test_no_weight_is_negative() -> None:
    ranking, chosen = drawn(np.array([1.0, -1.0]), 1)
    found = fit_weights([ranking], [chosen])
    assert found["t1"] == 0.0
    assert found["t0"] > 0.5


def test_fitted_weights_are_the_most_likely() -> None:
    ranking, chosen = drawn(np.array([0.5, 0.8]), 2, frames=300)
    found = fit_weights([ranking], [chosen])
    best = np.array([found["t0"], found["t1"]])

    def loss(weights: Array) -> float:
        score = np.stack([ranking.terms["t0"], ranking.terms["t1"]], axis=1) @ weights
        p = softmax(score, ranking.frame)[chosen]
        return float(-np.log(p).mean() + 1e-3 * weights @ weights)

    for step in np.random.default_rng(3).normal(scale=0.02, size=(20, 2)):
        assert loss(best) <= loss(best + step) + 1e-12


def test_frames_that_went_astray_do_not_blunt_the_weights() -> None:
    wanted = np.array([1.5, 3.0])
    ranking, chosen = drawn(wanted, 6)
    rng = np.random.default_rng(7)
    lost = rng.random(len(chosen)) < 0.1
    others = np.array([rng.choice(np.flatnonzero(ranking.frame == k)) for k in np.flatnonzero(lost)])
    chosen[lost] = others
    blunt, sharp = (
        np.array(list(fit_weights([ranking], [chosen], astray=astray).values())) for astray in (False, True)
    )
    assert (blunt < 0.75 * wanted).all()
    assert sharp == pytest.approx(wanted, rel=0.1)


def test_frames_without_a_truth_do_not_count() -> None:
    ranking, chosen = drawn(np.array([1.0]), 4, frames=200)
    half = chosen.copy()
    half[100:] = -1
    part = ranking.frame < 100
    alone = Ranking(
        probability=ranking.probability[part],
        frame=ranking.frame[part],
        terms={"t0": ranking.terms["t0"][part]},
    )
    place = np.cumsum(part) - 1
    one, other = fit_weights([ranking], [half]), fit_weights([alone], [place[chosen[:100]]])
    assert one["t0"] == pytest.approx(other["t0"], rel=1e-9)


def test_a_truth_of_another_frame_is_refused() -> None:
    ranking, chosen = drawn(np.array([1.0]), 5, frames=10)
    with pytest.raises(InputError, match="not of its frame"):
        fit_weights([ranking], [chosen[::-1]])
    with pytest.raises(InputError, match="not of its frame"):
        fit_weights([ranking], [np.array([10_000])])
    with pytest.raises(InputError, match="no terms or no frames"):
        fit_weights([ranking], [np.full(10, -1)])


def test_weights_must_be_of_the_terms() -> None:
    prior = load_prior()
    with pytest.raises(InputError, match="weights of"):
        replace(prior, weights=dict.fromkeys(TERM_NAMES, 1.0))
    assert isinstance(prior, Prior)
