"""A pelvis in the middle of the hips, as most data sets have it: the spine turns the hips about their own line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import Figure, load_figure
from posekit.body.frames import hips_frame, torso_frame
from posekit.recovery import recover
from posekit.refinement.figure_numbers import FigureNumbers
from posekit.refinement.start import state_of
from posekit.refinement.state import turned_by_spine
from posekit.skeleton import DOFS, HIPS, JOINT, TORSO
from posekit.synthesis import random_views
from posekit.validators import Validator
from posekit.views.builtin import view_of

FIGURE = load_figure()
WIDTH = 0.24


def with_pelvis(above: float) -> Figure:
    """Make the figure whose pelvis joint is so far above the middle of its hips, metres."""
    reach = float(np.hypot(WIDTH / 2, above))
    return FIGURE.scaled({"right_hip-left_hip": WIDTH, "pelvis-right_hip": reach, "pelvis-left_hip": reach})


MIDDLE = with_pelvis(0.0)


def postures(figure: Figure, n: int, seed: int = 5) -> np.ndarray:
    """Draw legal postures whose hips are turned as the spine has them: more their joints cannot tell."""
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(figure.model), (n, 1))
    q[:, :3] = rng.normal(size=(n, 3)) * 0.3 + [0, 0, 4]
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = figure.limits
    q[:, figure.angle_index] = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    return figure.forward_kinematics(q)


@pytest.mark.parametrize("above", [0.0, 1e-4, 0.02])
def test_such_a_figure_is_made_written_and_read(above: float, tmp_path: Path) -> None:
    figure = with_pelvis(above)
    assert figure.pelvis_between_hips
    assert not figure.moved_lengths
    figure.write(tmp_path / "figure.urdf")
    again = load_figure(tmp_path / "figure.urdf")
    assert again.pelvis_between_hips
    model = pin.buildModelFromUrdf(str(tmp_path / "figure.urdf"), pin.JointModelFreeFlyer())
    assert model.nq == FIGURE.model.nq
    assert len(again.capsules) == len(FIGURE.capsules)


def test_a_pelvis_above_the_hips_is_none_of_them() -> None:
    assert not FIGURE.pelvis_between_hips
    assert not with_pelvis(0.03).pelvis_between_hips


def test_configurations_give_the_joints_back() -> None:
    points = postures(MIDDLE, 200)
    found = MIDDLE.configurations(points)
    assert np.isfinite(found.q).all()
    assert found.distance.max() < 1e-9


def test_the_hips_are_upright_as_the_torso_is_and_left_is_their_line() -> None:
    points = postures(MIDDLE, 50)
    R_torso = torso_frame(*(points[:, JOINT[name]] for name in TORSO))
    R = hips_frame(*(points[:, JOINT[name]] for name in (*HIPS, "neck")))
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12)
    assert np.einsum("ni,ni->n", R[:, :, 2], R_torso[:, :, 2]).min() > 0
    np.testing.assert_allclose(np.einsum("ni,ni->n", R[:, :, 0], R_torso[:, :, 2]), 0, atol=1e-12)
    line = points[:, JOINT["left_hip"]] - points[:, JOINT["right_hip"]]
    np.testing.assert_allclose(R[:, :, 1], line / np.linalg.norm(line, axis=1, keepdims=True), atol=1e-12)


def test_a_small_move_of_the_joints_is_a_small_turn_of_the_hips(rng: np.random.Generator) -> None:
    points = postures(MIDDLE, 100)
    columns = [JOINT[name] for name in (*HIPS, "neck")]
    moved = points + 1e-6 * rng.normal(size=points.shape)
    turn = [hips_frame(*np.moveaxis(each[:, columns], 1, 0)) for each in (points, moved)]
    assert np.abs(turn[1] - turn[0]).max() < 1e-4


def test_states_turn_hips_as_frames_do() -> None:
    points = postures(MIDDLE, 30)
    state = state_of(FigureNumbers.of(MIDDLE), points[:, :14])
    R = hips_frame(*(points[:, JOINT[name]] for name in (*HIPS, "neck")))
    np.testing.assert_allclose(np.moveaxis(state.hips, -1, 0), R, atol=1e-12)
    np.testing.assert_allclose(turned_by_spine(state.torso, state.hips), state.hips, atol=1e-12)


def test_a_pelvis_is_flexed_where_that_brings_the_hips_inside_their_limits() -> None:
    q = np.tile(pin.neutral(MIDDLE.model), (3, 1))
    places = dict(zip(DOFS, MIDDLE.angle_index, strict=True))
    lower, upper = (dict(zip(DOFS, ends, strict=True)) for ends in (MIDDLE.limits.lower, MIDDLE.limits.upper))
    flexed = np.radians([60.0, 60.0, -25.0])
    q[:, places["pelvis.flexion"]] = flexed
    q[:2, places["pelvis.bending"]] = 0.3
    for side, part in (("right", 0.95), ("left", 0.8)):
        name = f"{side}_hip.flexion"
        q[:2, places[name]] = part * upper[name]
        q[2, places[name]] = part * lower[name]
    points = MIDDLE.forward_kinematics(q)
    found = MIDDLE.configurations(points)
    assert found.distance.max() < 1e-9
    angles = found.q[:, MIDDLE.angle_index]
    assert (angles >= MIDDLE.limits.lower - 1e-9).all()
    assert (angles <= MIDDLE.limits.upper + 1e-9).all()
    turned = found.q[:, places["pelvis.flexion"]]
    assert (np.abs(turned) < np.abs(flexed) + 0.1).all()
    assert (turned * flexed > 0).all()


def test_every_legal_posture_passes_the_ranges() -> None:
    points = postures(MIDDLE, 300)
    report = Validator(MIDDLE, ranges="urdf", checks=("joint-range",)).check(points[:, :14])
    rejected = {
        where
        for judgement in report.judgements
        for where, bad in zip(judgement.where, judgement.violated.T, strict=True)
        if bad.any()
    }
    # What bends and turns between spine and hips is told in other angles where the pelvis is flexed as well.
    assert rejected <= {"pelvis.bending", "pelvis.rotation", "pelvis.flexion"}


@pytest.mark.parametrize("ranges", ["urdf", "table1", "anatomical"])
def test_standing_is_valid(ranges: str) -> None:
    joints = MIDDLE.neutral_points[None, :14]
    report = Validator(MIDDLE, ranges=ranges).check(joints)
    assert report.verdicts == ["valid"]
    assert report.fk_distance.max() < 1e-9


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_views_are_recovered_with_the_truth_among_them(noise: float, rng: np.random.Generator) -> None:
    scene = random_views(MIDDLE, 24, np.random.default_rng(7))
    scene = scene.select(Validator(MIDDLE, ranges="urdf", strict=True).check(scene.joints_cam).valid)
    assert len(scene) >= 12
    headless = np.full((len(scene), 5, 2), np.nan)
    view = replace(view_of(scene), head_image=headless, root=scene.joints_cam[:, 0])
    if noise:
        image = view.image + noise * rng.normal(size=view.image.shape)
        view = replace(view, image=image, deviation=noise, length_deviation=0.0)
    recovery = recover(view, ranges="urdf")
    errors = [
        np.linalg.norm(frame.joints - truth, axis=-1).mean(axis=1).min()
        for frame, truth in zip(recovery.frames, scene.joints_cam, strict=True)
    ]
    assert {frame.judged for frame in recovery.frames} == {"refined" if noise else "exact"}
    assert max(errors) < (0.1 if noise else 1e-6)
    assert np.median(errors) < (0.03 if noise else 1e-6)
