"""Parts of placing heads: blocks and threads, where searches start, and what a step moves."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.cameras import PinholeCamera
from posekit.cameras.head import HeadPoints, blocks, solve_pose
from posekit.cameras.head.misfit import beyond_chance
from posekit.cameras.head.perspective import HeadPlacement, Heads, look
from posekit.cameras.head.starts import affine_start, direct_start, reversed_start
from posekit.geometry import rotation_from_vector
from posekit.skeleton import HEAD_POINTS

FIGURE = load_figure()


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("own", [False, True])
def test_blocks_and_threads_change_nothing(threads: int, own: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    head = HeadPoints(names=("neck", *HEAD_POINTS), points=FIGURE.head_points)
    R = rotation_from_vector(rng.uniform(-0.5, 0.5, (8, 3)))
    t = np.array([0.0, 0.0, 1.5]) + rng.uniform(-0.2, 0.2, (8, 3))
    K = np.tile(np.array([[900.0, 0.0, 320.0], [0.0, 900.0, 240.0], [0.0, 0.0, 1.0]]), (8, 1, 1))
    if own:
        K[:, 0, 0] += 10.0 * np.arange(8)
    camera = PinholeCamera(K=K if own else K[0], distortion=np.array([0.1, -0.05, 0.002, 0.001, 0.01]))
    image = camera.project(t[:, None] + np.einsum("fij,pj->fpi", R, head.points))
    whole = solve_pose(head, image, camera)
    monkeypatch.setattr(blocks, "BLOCK_HEADS", 3)
    parts = solve_pose(head, image, camera, threads=threads)
    np.testing.assert_allclose(parts.t_cam_head, t, atol=1e-6)
    np.testing.assert_allclose(parts.R_cam_head, R, atol=1e-6)
    for name in ("t_cam_head", "R_cam_head", "residuals", "found"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), atol=1e-9)


def heads_of(count: int, f: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return centred points of size 1 (F, P, 3), rotations, centres (F, 3), and their perspective image."""
    rng = np.random.default_rng(9)
    points = rng.normal(size=(7, 3)) * [1.0, 0.8, 0.6]
    points = points - points.mean(axis=0)
    points = points / np.sqrt((points**2).sum(axis=1).mean())
    R = rotation_from_vector(rng.uniform(-2.0, 2.0, (count, 3)))
    centre = np.array([0.3, -0.2, 12.0]) + rng.uniform(-0.1, 0.1, (count, 3))
    placed = centre[:, None] + np.einsum("fij,pj->fpi", R, points)
    return np.tile(points, (count, 1, 1)), R, centre, f * placed[..., :2] / placed[..., 2:]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_linear_equations_of_exact_points_are_the_placement_itself(side: float) -> None:
    """A head behind the camera looks as one turned by half a turn about the optical axis, its depths reversed."""
    points, R, centre, _ = heads_of(5, 0.05)
    centre = centre * [1.0, 1.0, side]
    placed = centre[:, None] + np.einsum("fij,fpj->fpi", R, points)
    image = 0.05 * placed[..., :2] / placed[..., 2:]
    seen = np.ones((5, 7), dtype=bool)
    found, behind = direct_start(points, image, seen)
    assert behind.tolist() == [side < 0] * 5
    np.testing.assert_allclose(found.R, R * np.array([[side], [side], [1.0]]), atol=1e-6)
    np.testing.assert_allclose(found.slope, 1.0 / centre[:, 2], rtol=1e-6)
    np.testing.assert_allclose(found.scale, 0.05 / np.abs(centre[:, 2]), rtol=1e-6)
    np.testing.assert_allclose(found.shift, 0.05 * centre[:, :2] / centre[:, 2:], rtol=1e-6)
    heads = Heads(points, image, seen.astype(float), None, None, np.ones(5))
    residual, _, possible = look(heads, found)
    assert possible.all() and np.abs(residual).max() < 1e-9
    assert heads.unknowns == 7 and heads._replace(K=np.tile(np.eye(3), (5, 1, 1))).unknowns == 6


@pytest.mark.parametrize("known", [False, True])
def test_a_head_far_away_is_a_scaled_orthographic_view(known: bool) -> None:
    """Of its own image the start is exact, unseen points aside; and reversed it looks almost the same."""
    points, R, _, _ = heads_of(4, 1.0)
    shift, scale = np.array([0.4, -0.3]), 0.05
    image = shift + scale * np.einsum("fij,fpj->fpi", R, points)[..., :2]
    seen = np.ones((4, 7), dtype=bool)
    seen[1, 6] = False
    image[1, 6] = 99.0
    found = affine_start(points, image, seen, known)
    np.testing.assert_allclose(found.R, R, atol=1e-6)
    np.testing.assert_allclose(found.scale, scale)
    np.testing.assert_allclose(found.shift, np.tile(shift, (4, 1)), atol=1e-9)
    np.testing.assert_allclose(found.slope, scale if known else 0.0)
    other = reversed_start(points, found)
    np.testing.assert_allclose(np.linalg.det(other.R), 1.0)
    axes = np.linalg.svd(points[0])[2]
    q, turned = (np.einsum("fij,pj->fpi", one.R, axes[:2]) for one in (found, other))
    np.testing.assert_allclose(turned, q * [1.0, 1.0, -1.0], atol=1e-9)


def test_a_step_moves_all_unknowns() -> None:
    points, R, _, image = heads_of(2, 1.0)
    start = HeadPlacement(R.copy(), np.zeros((2, 2)), np.full(2, 0.1), np.full(2, 0.01))
    step = np.array([[0.1, -0.2, 0.3, 0.01, 0.02, 0.003, 0.0004]] * 2)
    free = Heads(points, image, np.ones((2, 7)), None, None, np.array([1.0, -1.0]))
    found = start.moved(step, free)
    np.testing.assert_allclose(found.R, rotation_from_vector(step[:, :3]) @ R)
    np.testing.assert_allclose(found.shift, step[:, 3:5])
    np.testing.assert_allclose(found.scale, 0.103)
    np.testing.assert_allclose(found.slope, 0.0104)
    fixed = start.moved(step[:, :6], free._replace(K=np.tile(np.eye(3), (2, 1, 1))))
    np.testing.assert_allclose(fixed.slope, [0.103, -0.103])


def test_of_many_chances_those_are_more_than_accidents_that_are_small_together() -> None:
    """The k smallest of F, where the k-th is at most k / F of five in a thousand (Benjamini & Hochberg 1995)."""
    assert beyond_chance(np.array([0.005])).tolist() == [True]
    assert beyond_chance(np.array([0.0051])).tolist() == [False]
    assert beyond_chance(np.array([0.9, 0.0037, 0.001, 0.003])).tolist() == [False, True, True, True]
    assert beyond_chance(np.array([0.9, 0.0038, 0.0013, 0.0026])).tolist() == [False] * 4
    assert beyond_chance(np.array([])).tolist() == []
