"""Many heads are placed block by block, and on threads, as all at once."""

from __future__ import annotations

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.cameras import PinholeCamera
from posekit.cameras.head import HeadPoints, blocks, solve_pose
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
