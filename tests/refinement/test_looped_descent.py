"""Compiled searches, values and quadratics are what the steps over all postures at once come to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posekit.body import Figure, load_figure
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.compiled import (
    block_kernels,
    limb_block_kernels,
    limb_limit_kernels,
    posture_kernels,
    posture_numbers,
    table_kernels,
    trunk_block_kernels,
)
from posekit.least_squares import MIN_PROMISE
from posekit.recovery.limb_walls import LimbWalls
from posekit.refinement import ObservedFrames, RootPrior
from posekit.refinement import covariance as covariance_module
from posekit.refinement.covariance import joint_system, stepped_system
from posekit.refinement.descent import REFINEMENT_DAMPING, descend, stepped_descent
from posekit.refinement.equations import DIAGONAL_FLOOR, MAX_CHI2, chains_of, chi2_of, evaluate
from posekit.refinement.figure_numbers import LIMB_ENDS, LIMB_MIDDLES, LIMB_STARTS
from posekit.refinement.joint_step import limb_tables, stepped_limb_tables, stepped_trunk_tables, trunk_tables
from posekit.refinement.limb_descent import fit_limbs, stepped_limbs
from posekit.refinement.limb_terms import chi2_of_limbs, limb_chi2
from posekit.refinement.limits import MIN_COSINE
from posekit.refinement.looped_descent import looped_descent, settings_of
from posekit.refinement.problem import BEHIND_CAMERA_RESIDUAL, RefinementProblem
from posekit.refinement.start import limb_directions, state_of
from posekit.refinement.state import PostureState
from posekit.refinement.trunk_terms import SPINE_TURN_DEVIATION
from posekit.refinement.walls import MAX_SLOPE, REACH_RADIANS, STEP_RADIANS
from posekit.synthesis import random_views
from posekit.validators import load_ranges
from posekit.validators.joint_range import joint_range

N = 24

LENS = np.array([-0.21, 0.08, 1e-3, -2e-3, 0.01])

WAYS: Mapping[str, Mapping[str, Any]] = {
    "boxes of angles": {},
    "anatomical ranges": {"walls": "anatomical"},
    "without limits": {"limit_deviation": np.inf},
    "lengths varied": {"length_deviation": 0.03, "walls": "anatomical"},
    "a forearm varied": {"length_deviation": {"right_elbow-right_wrist": 0.05}},
    "the head seen": {"head": True, "length_deviation": 0.02},
    "through a lens": {"camera": "lens", "walls": "anatomical"},
    "without perspective": {"camera": "orthographic"},
    "a pelvis between the hips": {"middle": True, "walls": "anatomical"},
    "some joints not seen": {"hidden": True, "walls": "anatomical", "length_deviation": 0.03},
}


def figure_of(given: Mapping[str, Any]) -> Figure:
    figure = load_figure()
    if not given.get("middle"):
        return figure
    half = figure.lengths["right_hip-left_hip"] / 2
    return figure.scaled({"pelvis-right_hip": half, "pelvis-left_hip": half})


def problem_of(
    given: Mapping[str, Any], rng: np.random.Generator, *, noise: float = 4.0
) -> tuple[RefinementProblem, PostureState]:
    """Return postures seen with noise, some beyond their limits, and where a search begins."""
    figure = figure_of(given)
    scene = random_views(figure, N, np.random.default_rng(11), ranges="urdf")
    camera: PinholeCamera | ScaledOrthographicCamera = scene.camera
    if given.get("camera") == "lens":
        camera = replace(scene.camera, distortion=LENS)
    elif given.get("camera") == "orthographic":
        camera = ScaledOrthographicCamera(scale=np.full(N, 400.0), aspect=1.1)
    image = camera.project(scene.joints_cam) + rng.normal(scale=noise, size=(N, 14, 2))
    if given.get("hidden"):
        image[rng.random(image.shape[:2]) < 0.15] = np.nan
    walls = None
    if "walls" in given:
        walls = LimbWalls.of(figure, joint_range(figure, load_ranges(given["walls"]), tolerance=1.0), 1.0)
    more: dict[str, Any] = {}
    if given.get("head"):
        head = scene.head_image + rng.normal(scale=noise, size=scene.head_image.shape)
        more = {"head_image": head, "head_deviation": 2.0}
    observed = ObservedFrames(
        figure=figure,
        camera=camera,
        image=image,
        deviation=2.0,
        root=RootPrior(
            mean=scene.joints_cam[:, 0], covariance=np.tile(np.diag([1e-4, 1e-4, 1e-2]), (N, 1, 1))
        ),
        walls=walls,
        length_deviation=given.get("length_deviation", 0.0),
        limit_deviation=given.get("limit_deviation", 2.0),
        **more,
    )
    problem = observed.problem(np.arange(N), scene.joints_cam[:, 0])
    postures = scene.joints_cam + rng.normal(scale=0.03, size=scene.joints_cam.shape)
    state = state_of(problem.anatomy, postures, scene.head_cam)
    return problem, state._replace(directions=limb_directions(postures, np.tile(np.arange(N), (4, 1)), state))


@pytest.mark.parametrize("alone", [False, True], ids=["whole", "trunks"])
@pytest.mark.parametrize("given", WAYS.values(), ids=WAYS.keys())
def test_searches_take_the_same_steps(
    given: Mapping[str, Any], alone: bool, rng: np.random.Generator
) -> None:
    problem, start = problem_of(given, rng)
    problem = problem.trunk_alone() if alone else problem
    before = start.copy()
    found, expected = descend(problem, start), stepped_descent(problem, start)
    for mine, theirs in zip(start, before, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    for count in ("steps", "settled", "folds", "active"):
        np.testing.assert_array_equal(getattr(found, count), getattr(expected, count))
    np.testing.assert_allclose(found.chi2, expected.chi2, rtol=1e-6, atol=1e-6)
    for mine, theirs in zip(found.state, expected.state, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-5)
    assert found.steps.max() > 2 and found.settled.mean() > 0.5


def test_what_is_hopeless_and_what_has_no_steps_left_ends_alike(rng: np.random.Generator) -> None:
    problem, start = problem_of(WAYS["anatomical ranges"], rng, noise=30.0)
    ends: tuple[dict[str, Any], ...] = ({"hopeless": 20.0}, {"steps": 2}, {"precision": 5.0})
    for told in ends:
        found, expected = descend(problem, start, **told), stepped_descent(problem, start, **told)
        np.testing.assert_array_equal(found.steps, expected.steps)
        np.testing.assert_array_equal(found.settled, expected.settled)
        np.testing.assert_allclose(found.chi2, expected.chi2, rtol=1e-6)


@pytest.mark.parametrize("given", WAYS.values(), ids=WAYS.keys())
def test_limbs_by_themselves_end_alike(given: Mapping[str, Any], rng: np.random.Generator) -> None:
    problem, start = problem_of(given, rng)
    told: dict[str, Any] = {"steps": 6, "precision": 1e-2, "hopeless": 250.0}
    used = rng.random((4, N)) < 0.8
    ended = []
    for fit in (fit_limbs, stepped_limbs):
        chains = chains_of(problem, start)
        chains = chains._replace(directions=chains.directions.copy(), lengths=chains.lengths.copy())
        chi2 = chi2_of_limbs(problem, chains)
        np.testing.assert_allclose(chi2, limb_chi2(problem, chains)[0], rtol=1e-9, atol=1e-12)
        begun = chi2.copy()
        # Each by itself: beside others that go on, a limb that is done would be looked at again.
        for limb in range(4):
            one = np.zeros_like(used)
            one[limb] = used[limb]
            fit(problem, chains, chi2, one, **told)
        np.testing.assert_array_equal(chi2[~used], begun[~used])
        assert (chi2 <= begun).all() and (chi2[used] < begun[used]).mean() > 0.5
        ended.append((chi2, chains.directions, chains.lengths))
    for mine, theirs in zip(*ended, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-5)


@pytest.mark.parametrize("given", WAYS.values(), ids=WAYS.keys())
def test_values_quadratics_and_covariances_are_the_same(
    given: Mapping[str, Any], rng: np.random.Generator
) -> None:
    problem, state = problem_of(given, rng)
    np.testing.assert_allclose(chi2_of(problem, state), evaluate(problem, state)[0], rtol=1e-9)
    trunks = trunk_tables(problem, state), stepped_trunk_tables(problem, state)
    chains = chains_of(problem, state)
    limbs = limb_tables(problem, state, chains), stepped_limb_tables(problem, state, chains)
    for mine, theirs in [*zip(*trunks, strict=True), *zip(*limbs, strict=True)]:
        scale = max(float(np.abs(theirs).max(initial=0.0)), 1e-300)
        np.testing.assert_allclose(mine / scale, theirs / scale, rtol=0, atol=1e-6)
    gain = rng.normal(size=(3, N))
    known, expected = joint_system(problem, state, gain), stepped_system(problem, state, gain)
    assert known.turns == expected.turns
    np.testing.assert_allclose(known.looped(), expected.summed(), rtol=1e-5, atol=1e-9)


def test_joints_behind_the_camera_are_infinitely_off(rng: np.random.Generator) -> None:
    problem, state = problem_of(WAYS["boxes of angles"], rng)
    state.root[2, :3] = -5.0
    chi2 = chi2_of(problem, state)
    np.testing.assert_array_equal(np.isinf(chi2), np.arange(N) < 3)
    found = descend(problem, state)
    np.testing.assert_array_equal(np.isinf(found.chi2), np.arange(N) < 3)
    np.testing.assert_array_equal(found.steps[:3], 0)


def test_limbs_at_singular_places_are_left_to_the_judge(rng: np.random.Generator) -> None:
    problem, start = problem_of(WAYS["anatomical ranges"], rng)
    start.directions[0, 1, :, 5] = start.directions[0, 0, :, 5]  # an elbow that is straight to the last bit
    settings = settings_of(REFINEMENT_DAMPING, DIAGONAL_FLOOR, 20, 1e-2, np.inf)
    looped = looped_descent(problem, start, settings)
    assert looped is not None
    np.testing.assert_array_equal(np.flatnonzero(looped[-1]), [5])
    found, expected = descend(problem, start), stepped_descent(problem, start)
    np.testing.assert_allclose(found.chi2, expected.chi2, rtol=1e-6)
    np.testing.assert_allclose(chi2_of(problem, start), evaluate(problem, start)[0], rtol=1e-9)


def test_ranges_that_no_loop_knows_have_none(rng: np.random.Generator) -> None:
    problem, start = problem_of({"walls": "table1"}, rng)
    settings = settings_of(REFINEMENT_DAMPING, DIAGONAL_FLOOR, 20, 1e-2, np.inf)
    assert looped_descent(problem, start, settings) is None
    assert np.isfinite(descend(problem, start).chi2).all()


def test_constants_of_loops_are_those_of_refinement() -> None:
    limits, trunks, tables = limb_limit_kernels, trunk_block_kernels, table_kernels
    assert limb_block_kernels.FAR_BEHIND == BEHIND_CAMERA_RESIDUAL
    assert block_kernels.LEAST_PROMISE == MIN_PROMISE
    assert limits.LEAST_SECOND_COSINE == trunks.LEAST_BALL_COSINE == MIN_COSINE
    assert (limits.WALL_STEP, limits.WALL_SLOPE, limits.WALL_REACH) == (
        STEP_RADIANS,
        MAX_SLOPE,
        REACH_RADIANS,
    )
    assert (posture_numbers.LIMB_STARTS, posture_numbers.LIMB_MIDDLES, posture_numbers.LIMB_ENDS) == (
        LIMB_STARTS,
        LIMB_MIDDLES,
        LIMB_ENDS,
    )
    assert trunks.SPINE_WEIGHT == 1 / SPINE_TURN_DEVIATION
    assert posture_kernels.BEYOND_COUNTING == MAX_CHI2
    assert tables.ANGLE_INFORMATION == pytest.approx(covariance_module.UNKNOWN_ANGLE_RADIANS**-2)
    assert tables.PLACE_INFORMATION == pytest.approx(covariance_module.UNKNOWN_PLACE_METRES**-2)
    assert tables.MOST_TURN_INFORMATION == covariance_module.MAX_TURN_INFORMATION
    assert tables.LEAST_LENGTH == covariance_module.MIN_LENGTH
