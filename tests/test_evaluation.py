"""Evaluation where the truth is known: errors, calibration, regions and sweeps."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from posekit.cameras import LeeChenCamera
from posekit.errors import InputError
from posekit.evaluation import (
    MEASURES,
    Evaluation,
    correct_poses_score,
    evaluate,
    evaluate_method,
    posture_errors,
    reliability,
    true_branch,
    truth_of,
    with_truth,
)
from posekit.geometry import rotation_from_vector
from posekit.motion import Motion
from posekit.recovery import Answer, Frames, Paths, Recovery, Survivors
from posekit.skeleton import JOINTS, PARENTS, POINTS
from posekit.synthesis import Walker, builtin_view, mocap_view

TRUTH = builtin_view("seq1").truth


def result(offsets: tuple[float, ...], *, sure_of: str = "position", radius: float = 0.02) -> Recovery:
    """Return a result whose survivors are the truth moved to the right by offsets, metres, in every frame."""
    frames, each = len(TRUTH), len(offsets)
    joints = np.repeat(TRUTH, each, axis=0) + np.tile(offsets, frames)[:, None, None] * [1.0, 0.0, 0.0]
    nothing = np.zeros((frames, len(JOINTS) - 1))
    return Recovery(
        survivors=Survivors(
            frame=np.repeat(np.arange(frames), each),
            joints=joints,
            q=np.zeros((len(joints), 29)),
            probability=np.tile(np.linspace(0.6, 0.4, each), frames),
            branch=np.repeat(true_branch(TRUTH), each),
            radius=np.full((len(joints), len(JOINTS)), radius),
        ),
        frames=Frames(time=np.arange(frames) / 10, levels=[(1,) * len(JOINTS)] * frames),
        answer=Answer(
            joints=TRUTH + np.array([offsets[0], 0, 0]),
            sure=np.full(frames, 0.75),
            sure_of=[sure_of] * frames,
            survivor=np.arange(frames) * each,
            nearer=nothing.astype(np.intp),
            nearer_sure=nothing + 0.9,
        ),
        camera={"model": "opencv"},
    )


def test_errors_are_those_of_the_survivors() -> None:
    found = evaluate(result((0.10, 0.03)), TRUTH)
    columns = found.columns
    assert np.allclose(columns["best_mpjpe"], 0.03) and np.allclose(columns["first_mpjpe"], 0.10)
    assert np.allclose(columns["answer_worst"], 0.10) and np.allclose(columns["best_centred"], 0, atol=1e-12)
    assert set(np.unique(columns["random_mpjpe"].round(6))) <= {0.03, 0.1}
    summary = found.summary()
    assert summary["retained"] == {"10 mm": 0.0, "35 mm": 1.0, "branch": 1.0}
    assert summary["error_mm"]["first"]["mpjpe"]["median"] == pytest.approx(100)
    assert summary["survivors"]["median"] == 2 and "path" not in summary["error_mm"]


def test_the_likeliest_path_is_compared_with_the_truth() -> None:
    found = result((0.10, 0.03))
    joints = TRUTH + np.array([[[[0.02, 0.0, 0.0]]], [[[0.5, 0.0, 0.0]]]])
    paths = Paths(survivor=np.zeros(joints.shape[:2]), probability=np.array([0.7, 0.3]), joints=joints)
    followed = evaluate(replace(found, path=paths), TRUTH)
    assert followed.columns["path_mpjpe"] == pytest.approx(0.02) and followed.columns[
        "path_worst"
    ] == pytest.approx(0.02)
    assert followed.summary()["error_mm"]["path"]["mpjpe"]["median"] == pytest.approx(20)


def test_similarities_and_shifts_do_not_count_in_aligned_measures() -> None:
    R = rotation_from_vector(np.array([0.3, -0.2, 0.5]))
    moved = 1.2 * TRUTH @ R.T + [0.1, 0.2, 0.3]
    errors = dict(zip(MEASURES, posture_errors(moved, TRUTH).T, strict=True))
    assert np.allclose(errors["pa"], 0, atol=1e-9) and np.allclose(errors["worst_pa"], 0, atol=1e-9)
    assert (errors["mpjpe"] > errors["centred"]).all() and (errors["centred"] > 0.05).all()
    hidden = TRUTH.copy()
    hidden[:, 3:] = np.nan
    assert np.isfinite(posture_errors(hidden, TRUTH)).all()
    assert np.isnan(posture_errors(hidden * np.nan, TRUTH)).all()


@pytest.mark.parametrize(
    ("offset", "of", "true"),
    [(0.04, "position", 1.0), (0.06, "position", 0.0), (0.5, "relative to the neck", 1.0)],
)
def test_sure_is_compared_with_what_it_claims(offset: float, of: str, true: float) -> None:
    found = evaluate(result((offset,), sure_of=of), TRUTH)
    assert (found.columns["sure_true"] == true).all()
    stated = found.summary()["calibration"]["sure"]
    assert stated["ece"] == pytest.approx(abs(0.75 - true)) and stated["entries"] == len(TRUTH)


@pytest.mark.parametrize(("radius", "share"), [(0.02, 0.0), (0.04, 1.0)])
def test_regions_hold_a_joint_if_it_is_within_its_radius(radius: float, share: float) -> None:
    assert evaluate(result((0.03,), radius=radius), TRUTH).summary()["regions"] == share


def test_exact_results_have_no_regions() -> None:
    assert evaluate(result((0.03,), radius=0.0), TRUTH).summary()["regions"] is None


def test_the_true_branch_is_the_one_that_lifts_the_truth() -> None:
    camera, view = LeeChenCamera(f=0.05), builtin_view("seq2")
    for truth, image, code in zip(view.truth, view.image, true_branch(view.truth), strict=True):
        for joint in range(1, len(JOINTS)):
            length = np.asarray(np.linalg.norm(truth[joint] - truth[PARENTS[joint]]))
            rays = camera.rays(image[joint])
            ends = camera.lift(truth[PARENTS[joint]], rays, length, tolerance=1e-9).points
            away = np.linalg.norm(ends - truth[joint], axis=-1)
            if np.ptp(away) > 1e-6:
                assert code[joint - 1] == str(int(np.argmin(away)))


def test_reliability_of_stated_probabilities() -> None:
    rng = np.random.default_rng(0)
    p = rng.uniform(size=20_000)
    honest = reliability(p, (rng.uniform(size=len(p)) < p).astype(float))
    boasting = reliability(np.full(100, 0.95), np.tile([1.0, 0.0], 50))
    assert honest is not None and honest["ece"] < 0.02 and len(honest["bins"]) == 10
    assert boasting is not None and boasting["ece"] == pytest.approx(0.45)
    assert reliability(np.array([np.nan]), np.array([1.0])) is None


def test_correct_poses_score_is_the_area_under_the_curve() -> None:
    worst = np.array([0.0, 0.1, 0.4, np.nan])
    thresholds = np.linspace(0, 0.3, 3_001)
    curve = [(np.nan_to_num(worst, nan=np.inf) < threshold).mean() for threshold in thresholds]
    assert correct_poses_score(worst) == pytest.approx(1000 * np.trapezoid(curve, thresholds), abs=0.2)


def test_evaluations_are_joined_summarised_and_written(tmp_path: Path) -> None:
    parts = [
        evaluate(result((offset,)), TRUTH).with_keys(noise=noise)
        for noise, offset in ((0.0, 0.0), (2.0, 0.05))
    ]
    found = Evaluation.joined(parts, {"seed": 0})
    by_noise = [found.summary(rows)["retained"]["10 mm"] for _, rows in found.conditions(["noise"])]
    assert by_noise == [1.0, 0.0] and len(found) == 2 * len(TRUTH)
    found.save(tmp_path / "e.json")
    document = json.loads((tmp_path / "e.json").read_text())
    assert document["schema"] == "posekit.evaluation/2" and len(document["frames"]) == len(found)
    assert [one["noise"] for one in document["conditions"]] == [0.0, 2.0]
    found.save(tmp_path / "e.csv")
    rows = list(csv.DictReader((tmp_path / "e.csv").read_text().splitlines()))
    assert np.allclose([float(row["best_mpjpe"]) for row in rows], found.columns["best_mpjpe"])
    assert len(found.table().splitlines()) == 4
    with pytest.raises(InputError, match="a name in"):
        found.save(tmp_path / "e.txt")


def walking() -> Motion:
    """Return a motion of a walker, up +y."""
    walker, time = Walker(), np.arange(30) / 30
    q = walker.configurations(walker.phase(time))
    return Motion(
        joints=walker.figure.forward_kinematics(q), joint_names=POINTS, time=time, up="+y", clips=["walk"]
    )


@pytest.mark.parametrize("late", [0.0, 0.1])
def test_motion_becomes_the_truth_of_a_view_in_other_axes(late: float) -> None:
    motion = walking()
    seen = mocap_view(motion, np.random.default_rng(5), frames=6, dt=1 / 30, position=(3.0, 1.5, 5.0))
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # z up instead of y up
    other = Motion(
        joints=motion.points(POINTS) @ turn.T,
        joint_names=POINTS,
        time=np.asarray(motion.time) + late,
        up="+z",
    )
    view, note = with_truth(replace(seen, truth=np.empty(0)), other)
    assert np.allclose(view.truth, seen.truth, atol=1e-9) and "6 of 6 frames" in note
    upside_down = Motion(joints=-motion.points(POINTS) * 0.2 + 9, joint_names=POINTS, time=motion.time)
    with pytest.raises(InputError, match="from the image"):
        with_truth(seen, upside_down)
    with pytest.raises(InputError, match="R and t"):
        with_truth(builtin_view("seq1"), motion)
    hidden = Motion(joints=np.full_like(other.joints, np.nan), joint_names=POINTS, time=motion.time)
    with pytest.raises(InputError, match="no frame"):
        with_truth(seen, hidden)


def test_motion_becomes_the_truth_of_a_result() -> None:
    motion = walking()
    seen = mocap_view(motion, np.random.default_rng(5), frames=5, dt=1 / 30, position=(3.0, 1.5, 5.0))
    found = replace(
        result((0.0,)),
        survivors=Survivors(
            frame=np.arange(5), joints=seen.truth, q=np.zeros((5, 29)), probability=np.ones(5)
        ),
        camera=seen.camera.fields("cm"),
        unit="cm",
    )
    truth, note = truth_of(found, motion)
    assert np.allclose(truth, seen.truth, atol=1e-6) and note
    assert np.allclose(evaluate(found, motion).columns["best_mpjpe"], 0, atol=1e-6)
    assert np.array_equal(truth_of(found, seen)[0], seen.truth)


def test_a_method_is_evaluated_at_levels_of_noise() -> None:
    found = evaluate_method(walking(), noise=(0.0, 1.0), views=2)
    exact, noisy = (found.summary(rows) for _, rows in found.conditions(["noise"]))
    assert exact["retained"]["10 mm"] == 1.0 and noisy["without_survivor"] == 0
    assert exact["error_mm"]["best"]["pa"]["median"] < 0.1 < noisy["error_mm"]["best"]["pa"]["median"] < 60


def test_a_view_that_is_refused_has_no_survivor_in_any_frame() -> None:
    view = builtin_view("seq1")
    outside = replace(view, camera=LeeChenCamera(f=None), head_image=view.head_image * np.nan)
    found = evaluate_method([({"name": "a"}, view), ({"name": "b"}, outside)], noise=(0.0,))
    assert found.columns["name"].tolist() == ["a"] * len(view) + ["b"] * len(view)
    assert found.columns["survivors"][len(view) :].tolist() == [0] * len(view)
    assert found.summary()["without_survivor"] == len(view)


@pytest.mark.parametrize(
    "mistake",
    [
        lambda: evaluate(result((0.0,)), TRUTH[:2]),
        lambda: evaluate(result((0.0,)), TRUTH * np.nan),
        lambda: evaluate_method([], noise=(0.0,)),
        lambda: evaluate_method(builtin_view("seq1"), noise=(1.0,)),
        lambda: evaluate_method(builtin_view("seq1"), noise=(0.0, 0.0)),
    ],
)
def test_impossible_evaluations_are_refused_in_one_line(mistake: Callable[[], object]) -> None:
    with pytest.raises(InputError) as refused:
        mistake()
    assert "expected" in str(refused.value) and "\n" not in str(refused.value)
