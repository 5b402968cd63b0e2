"""The linearised problem: gradients by finite differences, covariances by Pinocchio's Jacobian, freedom by rank."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import Figure, load_figure
from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.refinement import ObservedFrames, RootPrior, project, refine
from posekit.refinement.covariance import joint_system
from posekit.refinement.equations import evaluate, linearise, solve
from posekit.refinement.freedom import degrees_of_freedom
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.start import limb_directions, state_of
from posekit.refinement.state import PostureState, PostureStep, head_points, moved, place
from posekit.refinement.trunk_terms import start_jacobian
from posekit.skeleton import JOINTS
from posekit.synthesis import SyntheticScene, random_views

N = 60


@cache
def figure() -> Figure:
    return load_figure()


@cache
def scene() -> SyntheticScene:
    return random_views(figure(), N, np.random.default_rng(7), ranges="urdf")


def sight_of(
    view: SyntheticScene, pixels: float, camera: Camera | None = None, **other: object
) -> ObservedFrames:
    root = RootPrior(
        mean=view.joints_cam[:, 0] + 0.01, covariance=np.tile(np.diag([4e-4, 9e-4, 1e-2]), (len(view), 1, 1))
    )
    camera = camera or view.camera
    image = camera.project(view.joints_cam)
    return ObservedFrames(
        figure=view.figure,
        camera=camera,
        image=image,
        deviation=pixels,
        root=root,
        **other,  # type: ignore[arg-type]
    )


def somewhere(
    problem: RefinementProblem, view: SyntheticScene, rng: np.random.Generator, scale: float
) -> PostureState:
    """Return states away from the truth: torsos, limbs and heads turned, roots shifted, lengths changed."""
    state = state_of(problem.anatomy, view.joints_cam, view.head_cam)
    rows = np.tile(np.arange(len(view)), (4, 1))
    state = state._replace(directions=limb_directions(view.joints_cam, rows, state))
    tangents = linearise(problem, state).limbs
    assert tangents is not None
    return moved(state, random_step(problem, len(view), rng, scale), tangents.tangents)


def random_step(problem: RefinementProblem, n: int, rng: np.random.Generator, scale: float) -> PostureStep:
    trunk = rng.normal(size=(problem.trunk_width, n)) * scale
    trunk[9:] *= 0.1
    limbs = rng.normal(size=(problem.limb_width, 4, n)) * scale
    return PostureStep(
        trunk, limbs, rng.normal(size=(3, n)) * scale if problem.head_image is not None else None
    )


def slope_along(problem: RefinementProblem, state: PostureState, step: PostureStep) -> np.ndarray:
    """Return the derivative of chi2 / 2 along a step, from the linearised terms."""
    here = linearise(problem, state)
    trunk, limbs, head = here.trunk, here.limbs, here.head
    assert limbs is not None and step.limbs is not None
    slope = np.einsum("cn,cn->n", trunk.gradient, step.trunk)
    slope += np.einsum("jin,jicn,cn->n", trunk.pull, trunk.jacobian, step.trunk)
    slope += np.einsum("uln,uln->n", limbs.gradient, step.limbs)
    slope += np.einsum("iln,licn,cn->n", limbs.start_gradient, start_jacobian(trunk), step.trunk)
    if head is not None and step.head is not None:
        slope += np.einsum("in,in->n", head.gradient, step.head)
        slope += np.einsum("in,in->n", head.trunk_gradient, step.trunk[:6])
    return np.asarray(slope)


OPTIONS = {
    "lengths held": {},
    "lengths varied": {"length_deviation": 0.03},
    "only a forearm": {"length_deviation": {"right_elbow-right_wrist": 0.05}},
    "without limits": {"limit_deviation": np.inf},
    "with the head": {"head": True},
}


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS.keys())
def test_the_gradient_is_that_of_finite_differences(
    options: dict[str, object], rng: np.random.Generator
) -> None:
    view = scene()
    given = dict(options)
    if given.pop("head", False):
        given |= {"head_image": view.head_image, "head_deviation": 1.5}
    problem = sight_of(view, 2.0, None, **given).problem(np.arange(N), view.joints_cam[:, 0])
    state = somewhere(problem, view, rng, 0.2)
    tangents = linearise(problem, state).limbs
    assert tangents is not None
    step = random_step(problem, N, rng, 1.0)

    def chi2(h: float) -> np.ndarray:
        part = PostureStep(*(None if array is None else h * array for array in step))  # type: ignore[arg-type]
        return np.asarray(evaluate(problem, moved(state, part, tangents.tangents))[0])

    slope = slope_along(problem, state, step)
    difference = (chi2(1e-6) - chi2(-1e-6)) / 4e-6
    np.testing.assert_allclose(slope, difference, rtol=2e-5, atol=1e-3 * np.abs(slope).max() / 100)


def test_both_ways_to_chi2_agree(rng: np.random.Generator) -> None:
    view = scene()
    problem = sight_of(view, 2.0, head_image=view.head_image).problem(np.arange(N), view.joints_cam[:, 0])
    state = somewhere(problem, view, rng, 0.3)
    here = linearise(problem, state)
    assert here.limbs is not None and here.head is not None
    total = here.trunk.chi2 + here.limbs.chi2.sum(axis=0) + here.head.chi2
    np.testing.assert_allclose(evaluate(problem, state)[0], total, rtol=1e-12)


def test_the_arrow_solves_what_the_whole_matrix_would(rng: np.random.Generator) -> None:
    # The normal equations by finite differences of all residuals' gradient, solved at once.
    view = scene().select(np.arange(6))
    problem = sight_of(view, 2.0, limit_deviation=np.inf).problem(np.arange(6), view.joints_cam[:, 0])
    state = somewhere(problem, view, rng, 1e-3)
    here = linearise(problem, state)
    assert here.limbs is not None
    found, _ = solve(here, 0.0)
    assert found.limbs is not None
    tangents, columns = here.limbs.tangents, []
    for unknown in range(9 + 16):
        flat = np.zeros((25, 6))
        flat[unknown] = 1.0

        def residuals(h: float, flat: np.ndarray = flat) -> np.ndarray:
            at = moved(state, PostureStep(h * flat[:9], h * flat[9:].reshape(4, 4, 6)), tangents)
            joints = place(at)
            seen = problem.image_residuals(joints, slice(0, 14))
            root = np.einsum("ijn,jn->in", problem.root_weight, at.root - problem.root)
            return np.concatenate([seen.reshape(28, 6), root])

        columns.append((residuals(1e-6) - residuals(-1e-6)) / 2e-6)
    J = np.stack(columns, axis=1)
    r = np.concatenate(
        [
            problem.image_residuals(place(state), slice(0, 14)).reshape(28, 6),
            np.einsum("ijn,jn->in", problem.root_weight, state.root - problem.root),
        ]
    )
    for n in range(6):
        step = np.linalg.lstsq(J[..., n], -r[:, n], rcond=None)[0]
        mine = np.concatenate([found.trunk[:, n], found.limbs[..., n].ravel()])
        # Curvature of turning is in the arrow and not in J'J: small, near the truth.
        np.testing.assert_allclose(
            J[..., n] @ mine, J[..., n] @ step, atol=0.05 * np.abs(r[:, n]).max() + 1e-6
        )


def pinocchio_jacobian(q: np.ndarray) -> np.ndarray:
    """Return how the 14 joints move along v, world aligned (14, 3, nv)."""
    model = figure().model
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.framesForwardKinematics(model, data, q)
    from posekit.body.figure import LINK_OF_POINT

    return np.array(
        [
            pin.getFrameJacobian(
                model, data, model.getFrameId(LINK_OF_POINT.get(name, name)), pin.LOCAL_WORLD_ALIGNED
            )[:3]
            for name in JOINTS
        ]
    )


def test_covariances_are_those_of_pinocchios_jacobian() -> None:
    # With little noise the terms of second order vanish: (J'J)^-1 mapped through the joints is all.
    view = scene()
    pixels = 1e-5
    root = RootPrior(mean=view.joints_cam[:, 0], covariance=np.tile(1e-12 * np.eye(3), (N, 1, 1)))
    sight = ObservedFrames(
        figure=figure(),
        camera=view.camera,
        image=view.image,
        deviation=pixels,
        root=root,
        limit_deviation=np.inf,
    )
    refined = refine(sight, view.joints_cam)
    q = refined.q
    _, A = project(view.camera, view.joints_cam)
    apart = []
    for n in range(N):
        J = pinocchio_jacobian(q[n])
        J = J[..., np.abs(J).max(axis=(0, 1)) > 1e-9]
        rows = np.einsum("jci,jik->jck", A[n] / pixels, J).reshape(28, -1)
        rows = np.concatenate([rows, J[0] / 1e-6])
        C = np.einsum("jik,kl,jml->jim", J, np.linalg.inv(rows.T @ rows), J)
        scale = np.trace(C, axis1=1, axis2=2)[:, None, None]
        apart.append(np.abs(refined.covariance[n] - C) / scale)
    # Beside a right angle to the ray the second order tells all the same.
    assert np.median(apart) < 1e-3 and np.mean(np.array(apart) < 0.02) > 0.98


@pytest.mark.parametrize("varied", [0.0, 0.02])
@pytest.mark.parametrize("limits", [2.0, np.inf])
def test_the_compiled_loop_finds_the_same_covariances(
    varied: float, limits: float, rng: np.random.Generator
) -> None:
    view = scene()
    sight = sight_of(view, 1.0, limit_deviation=limits, length_deviation=varied)
    problem = sight.problem(np.arange(N), view.joints_cam[:, 0])
    state = somewhere(problem, view, rng, 0.1)
    for gain in (None, rng.standard_normal((3, N))):
        system = joint_system(problem, state, gain)
        expected = system.summed()
        scale = np.trace(expected, axis1=2, axis2=3)[..., None, None]
        np.testing.assert_allclose(system.looped() / scale, expected / scale, rtol=0, atol=1e-9)
        assert (scale > 0).all()


@pytest.mark.parametrize("perspective", [True, False])
def test_freedom_is_residuals_less_rank(perspective: bool, rng: np.random.Generator) -> None:
    view = scene().select(np.arange(40))
    camera: Camera = view.camera if perspective else ScaledOrthographicCamera(scale=300.0)
    image = camera.project(view.joints_cam)
    image[rng.random((40, 14)) < 0.25] = np.nan
    sight = replace(sight_of(view, 1.0, camera, limit_deviation=np.inf), image=image, root=None)
    problem = sight.problem(np.arange(40), view.joints_cam[:, 0])
    state = state_of(problem.anatomy, view.joints_cam)
    state = state._replace(directions=limb_directions(view.joints_cam, np.tile(np.arange(40), (4, 1)), state))
    here = linearise(problem, state)
    assert here.limbs is not None
    columns = []
    for unknown in range(25):
        flat = np.zeros((25, 40))
        flat[unknown] = 1e-6
        sides = [
            problem.image_residuals(
                place(
                    moved(
                        state, PostureStep(s * flat[:9], s * flat[9:].reshape(4, 4, 40)), here.limbs.tangents
                    )
                ),
                slice(0, 14),
            )
            for s in (1, -1)
        ]
        columns.append((sides[0] - sides[1]).reshape(28, 40) / 2e-6)
    J = np.stack(columns, axis=1)
    seen = 2 * (problem.weight > 0).sum(axis=0)
    rank = np.array([np.linalg.matrix_rank(J[..., n], tol=1e-3 * np.abs(J[..., n]).max()) for n in range(40)])
    dof = degrees_of_freedom(problem)
    assert (
        dof <= seen - rank
    ).all()  # never more than there are: a posture is not let through for want of rejecting
    assert (dof == seen - rank).mean() > 0.9


def test_head_points_are_the_figures() -> None:
    view = scene()
    problem = sight_of(view, 1.0, head_image=view.head_image).problem(np.arange(N), view.joints_cam[:, 0])
    state = state_of(problem.anatomy, view.joints_cam, view.head_cam)
    placed = (state.root + head_points(state, problem.anatomy.head)).transpose(2, 0, 1)
    np.testing.assert_allclose(placed, view.head_cam, atol=1e-9)


def test_pinhole_of_the_test_is_the_scenes() -> None:
    assert isinstance(scene().camera, PinholeCamera)
