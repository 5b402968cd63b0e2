"""Checks as soft limits: they say what the checks say, and their derivatives are those of differences."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from posekit.body import Figure, load_figure
from posekit.body.frames import hips_frame, torso_frame
from posekit.geometry import unit
from posekit.recovery.limb_walls import LimbWalls
from posekit.refinement import ObservedFrames
from posekit.refinement.equations import evaluate, linearise
from posekit.refinement.start import limb_directions, state_of
from posekit.refinement.state import PostureStep, moved
from posekit.refinement.trunk_terms import start_jacobian
from posekit.skeleton import HIPS, JOINT, LIMB_JOINTS, TORSO
from posekit.synthesis import SyntheticScene, random_views
from posekit.validators import judge, load_ranges
from posekit.validators.joint_range import joint_range

N = 80
RANGES = ("table1", "anatomical")


@cache
def figure() -> Figure:
    return load_figure()


@cache
def scene() -> SyntheticScene:
    return random_views(figure(), N, np.random.default_rng(3), ranges="urdf")


def walls_of(name: str) -> LimbWalls:
    ranges = load_ranges(name)
    walls = LimbWalls.of(figure(), joint_range(figure(), ranges, tolerance=1.0), 1.0)
    assert walls is not None
    return walls


def test_boxes_of_the_figures_own_angles_need_none() -> None:
    ranges = load_ranges("urdf")
    assert LimbWalls.of(figure(), joint_range(figure(), ranges), 1.0) is None
    assert LimbWalls.of(figure(), [], 1.0) is None


@pytest.mark.parametrize("name", RANGES)
def test_they_are_beyond_where_the_checks_say_so(name: str) -> None:
    walls, joints = walls_of(name), scene().joints_cam
    torso = torso_frame(*(joints[:, JOINT[each]] for each in TORSO))
    hips = hips_frame(*(joints[:, JOINT[each]] for each in HIPS))
    outside = np.zeros((N, 4), dtype=bool)
    for limb, (start, middle, end) in enumerate(LIMB_JOINTS):
        part = torso if limb < 2 or walls.on_torso else hips
        upper, lower = (
            np.einsum("nij,ni->nj", part, unit(joints[:, b] - joints[:, a]))
            for a, b in ((start, middle), (middle, end))
        )
        above, below = walls.beyond(limb, upper, lower)
        outside[:, limb] = (np.maximum(above, below) > 1e-9).any(axis=0)
    points = np.concatenate([joints, scene().head_cam], axis=1)
    (found,) = judge(joint_range(figure(), load_ranges(name), tolerance=1.0), points)
    for limb in range(4):
        names = tuple(
            f"{side}_{joint}."
            for side in [("right", "left")[limb % 2]]
            for joint in (("shoulder", "elbow") if limb < 2 else ("hip", "knee"))
        )
        own = [k for k, where in enumerate(found.where) if where.startswith(names)]
        np.testing.assert_array_equal(outside[:, limb], (found.margin[:, own] < -1e-7).any(axis=1))
    assert 0.05 < outside.mean() < 0.95


@pytest.mark.parametrize("limb", range(4))
def test_the_compiled_loop_finds_what_the_checks_say(limb: int, rng: np.random.Generator) -> None:
    """Also near singular places: straight limbs, and upper segments along the axis of abduction or straight up."""
    walls = walls_of("anatomical")
    upper, lower = unit(rng.standard_normal((2, 4000, 3)))
    near = 10.0 ** rng.uniform(-9, 0, (1000, 1)) * rng.standard_normal((1000, 3))
    axis = rng.choice([-1.0, 1.0], (1000, 1)) * np.eye(3)[rng.integers(1, 3, 1000)]
    lower[:1000] = unit(upper[:1000] + near)
    upper[1000:2000] = unit(axis + near)
    loop = walls.looped(limb, upper, lower)
    assert loop is not None
    for compiled, judged in zip(loop, walls.judged(limb, upper, lower), strict=True):
        np.testing.assert_array_equal(np.isfinite(compiled), np.isfinite(judged))
        np.testing.assert_allclose(compiled, judged, rtol=0, atol=1e-9)


def test_limbs_that_other_checks_judge_have_no_loop() -> None:
    assert walls_of("table1").looped(0, np.eye(3), np.eye(3)) is None


@pytest.mark.parametrize("name", RANGES)
def test_the_gradient_is_that_of_finite_differences(name: str, rng: np.random.Generator) -> None:
    view = scene()
    # Nothing but walls counts: image points are all but unknown.
    sight = ObservedFrames(
        figure=figure(),
        camera=view.camera,
        image=view.image,
        deviation=1e5,
        walls=walls_of(name),
        head_image=view.head_image,
        head_deviation=1e5,
    )
    problem = sight.problem(np.arange(N), view.joints_cam[:, 0])
    state = state_of(problem.anatomy, view.joints_cam, view.head_cam)
    rows = np.tile(np.arange(N), (4, 1))
    state = state._replace(directions=limb_directions(view.joints_cam, rows, state))
    here = linearise(problem, state)
    assert here.limbs is not None
    assert here.head is not None
    tangents = here.limbs.tangents
    step = PostureStep(rng.normal(size=(9, N)), rng.normal(size=(4, 4, N)), rng.normal(size=(3, N)))
    assert step.limbs is not None
    assert step.head is not None
    trunk, limbs, head = here.trunk, here.limbs, here.head
    slope = np.einsum("cn,cn->n", trunk.gradient, step.trunk)
    slope += np.einsum("jin,jicn,cn->n", trunk.pull, trunk.jacobian, step.trunk)
    slope += np.einsum("uln,uln->n", limbs.gradient, step.limbs)
    slope += np.einsum("iln,licn,cn->n", limbs.start_gradient, start_jacobian(trunk), step.trunk)
    slope += np.einsum("in,in->n", head.gradient, step.head)
    slope += np.einsum("in,in->n", head.trunk_gradient, step.trunk[:6])

    def chi2(h: float) -> np.ndarray:
        part = PostureStep(*(h * array for array in step if array is not None))
        return np.asarray(evaluate(problem, moved(state, part, tangents))[0])

    difference = (chi2(1e-6) - chi2(-1e-6)) / 4e-6
    off = np.abs(slope - difference) > 1e-3 * (1.0 + np.abs(slope))
    # A few stand at an edge, where another wall or another way to write the limb takes over.
    assert off.mean() <= 0.05
    assert (np.abs(slope) > 1.0).mean() > 0.3


@pytest.mark.parametrize("name", RANGES)
def test_what_is_not_known_is_beyond_nothing(name: str) -> None:
    walls = walls_of(name)
    nothing = np.full((2, 3), np.nan)
    for limb in range(4):
        above, below = walls.beyond(limb, nothing, nothing)
        assert (above == -np.inf).all()
        assert (below == -np.inf).all()
