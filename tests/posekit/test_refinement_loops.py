"""Compiled loops and arrays: the same steps, covariances and survivors."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from posekit.figure import load_figure
from posekit.pipeline import recover, view_of
from posekit.refinement import RootPrior, Sight, kernels, refine
from posekit.refinement import covariance as covariance_
from posekit.refinement import equations as equations_
from posekit.refinement.covariance import covariances
from posekit.refinement.equations import linearise, solve
from posekit.refinement.start import limb_directions, state_of
from posekit.synthesis import random_views
from posekit.tree.compiled import path

FIGURE = load_figure()
UNCOMPILED = SimpleNamespace(steps=kernels.steps, spreads=kernels.spreads)

OPTIONS = {
    "lengths held": {},
    "lengths varied, with the head": {"length_deviation": 0.03, "head": True},
    "an arm unseen": {"unseen": [6, 8]},
}


def seen(n: int, options: dict[str, Any]) -> tuple[Any, Any]:
    """Return a problem and states beside the truth, some limbs beyond their limits."""
    view = random_views(FIGURE, n, np.random.default_rng(2))
    given, image = dict(options), view.with_noise(3.0, np.random.default_rng(3)).image.copy()
    if given.pop("head", False):
        given |= {"head_image": view.head_image, "head_deviation": 1.5}
    image[:, given.pop("unseen", [])] = np.nan
    root = RootPrior.along_ray(view.camera, view.joints_cam[:, 0], depth=0.05)
    sight = Sight(figure=FIGURE, camera=view.camera, image=image, deviation=3.0, root=root, **given)
    joints = view.joints_cam + np.random.default_rng(4).normal(size=view.joints_cam.shape) * 0.05
    problem = sight.problem(np.arange(n), joints[:, 0])
    state = state_of(problem.anatomy, joints, view.head_cam)
    return problem, state._replace(directions=limb_directions(joints, np.tile(np.arange(n), (4, 1)), state))


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS.keys())
@pytest.mark.parametrize("alone", [False, True])
def test_a_step_is_the_same(options: dict[str, Any], alone: bool) -> None:
    problem, state = seen(6, options)
    here = linearise(problem.trunk_alone() if alone else problem, state)
    damping = np.array([1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0])
    with path("plain"):
        step, gain = solve(here, damping)
    with mock.patch.object(equations_, "loops", lambda: UNCOMPILED):
        other, promised = solve(here, damping)
    np.testing.assert_allclose(promised, gain, rtol=1e-11)
    for a, b in zip(step, other, strict=True):
        assert (a is None) == (b is None)
        if a is not None and b is not None:
            np.testing.assert_allclose(b, a, rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS.keys())
def test_covariances_are_the_same(options: dict[str, Any]) -> None:
    problem, state = seen(4, options)
    with path("plain"):
        plain = covariances(problem, state)
    with mock.patch.object(covariance_, "loops", lambda: UNCOMPILED):
        loops = covariances(problem, state)
    np.testing.assert_allclose(loops, plain, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("ranges", ["urdf", "anatomical"])
def test_survivors_are_the_same_compiled(ranges: str) -> None:
    pytest.importorskip("numba")
    scene = random_views(FIGURE, 25, np.random.default_rng(5))
    view = view_of(scene.with_noise(2.0, np.random.default_rng(6)))
    view = replace(view, deviation=2.0, root=scene.joints_cam[:, 0])
    found = []
    for chosen in ("plain", "fast"):
        with path(chosen):
            found.append(recover(view, ranges=ranges))
    for plain, fast in zip(found[0].frames, found[1].frames, strict=True):
        assert plain.branches == fast.branches
        assert plain.rejected == fast.rejected
        assert plain.refined is not None
        assert fast.refined is not None
        np.testing.assert_array_equal(plain.refined.dof, fast.refined.dof)
        np.testing.assert_allclose(plain.joints, fast.joints, atol=1e-8)
        np.testing.assert_allclose(plain.refined.chi2, fast.refined.chi2, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(plain.refined.covariance, fast.refined.covariance, rtol=1e-5, atol=1e-10)


def test_nothing_is_refined_in_both() -> None:
    for chosen in ("plain", "fast"):
        with path(chosen):
            view = random_views(FIGURE, 1, np.random.default_rng(0))
            sight = Sight(figure=FIGURE, camera=view.camera, image=view.image, deviation=1.0)
            refined = refine(sight, np.empty((0, 14, 3)), frame=np.empty(0, dtype=int))
            assert refined.covariance.shape == (0, 14, 3, 3)
