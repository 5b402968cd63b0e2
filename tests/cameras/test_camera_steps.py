"""Steps inside cameras and heads, each by a law of its own: how fast searches close in, and what they are told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.cameras import PinholeCamera, pinhole, undistortion
from posekit.cameras.calibrated import CalibratedCamera
from posekit.cameras.camera import meet_sphere
from posekit.cameras.head import TABLE_A2, HeadWarning, estimate, solve_pose
from posekit.cameras.head.estimate import BETTER_BEHIND
from posekit.cameras.head.misfit import misfits, spread
from posekit.cameras.head.perspective import Heads
from posekit.cameras.head.points import HeadPoints
from posekit.cameras.head.starts import reversed_start
from posekit.cameras.lens import distort, from_pixels, to_pixels
from posekit.cameras.neck import place
from posekit.cameras.neck.minima import _brackets
from posekit.cameras.neck.place import _feasible
from posekit.errors import HeadError
from posekit.geometry import Array, rotation_from_vector
from posekit.synthesis import random_views

CAMERA = PinholeCamera(K=np.array([[1000.0, 0.0, 640.0], [0.0, 1000.0, 360.0], [0.0, 0.0, 1.0]]))
LENS = np.array([0.3, -0.2, 0.05, -0.04, 0.1])


def heads(count: int, seed: int = 3) -> Array:
    """Return the points (F, 6, 3) of heads that look at a camera two metres away, more or less."""
    rng = np.random.default_rng(seed)
    turned = rotation_from_vector(rng.normal(0.0, 0.3, (count, 3))) @ np.diag([1.0, -1.0, -1.0])
    return np.asarray(np.einsum("fij,pj->fpi", turned, TABLE_A2.points) + np.array([0.0, 0.0, 2.0]))


@pytest.mark.parametrize("model", ["pinhole", "lens", "fisheye"])
def test_one_step_squares_what_is_off(
    model: str, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    """Newton's steps, whose slopes are the lens's own."""
    ideal = rng.uniform(-0.4, 0.4, (50, 2))
    camera = CalibratedCamera(
        name="lens",
        K=np.eye(3),
        distortion=LENS[:4] if model == "fisheye" else LENS,
        fisheye=model == "fisheye",
    )
    monkeypatch.setattr(pinhole, "UNDISTORTION_STEPS", 1)
    monkeypatch.setattr(undistortion, "MAX_STEPS", 1)
    for off in (1e-2, 1e-3):
        start = ideal + off * rng.choice([-1.0, 1.0], (50, 2))
        found = (
            pinhole._newton(start, pinhole.distort(ideal, LENS), LENS)
            if model == "pinhole"
            else undistortion._newton(start, distort(camera, ideal), camera)
        )
        assert np.abs(found - ideal).max() < 5 * off**2


@pytest.mark.parametrize(("off", "good"), [(0.9e-6, True), (1.1e-6, False)])
def test_a_ray_is_found_to_a_millionth_of_a_pixel(off: float, good: bool) -> None:
    camera = CalibratedCamera(name="lens", K=CAMERA.K, distortion=LENS)
    found = np.array([[0.1, -0.2]])
    target = to_pixels(camera.K, distort(camera, found)) + np.array([off, 0.0])
    ray = undistortion._checked(found, from_pixels(camera.K, target), camera)
    assert np.isfinite(ray).all() == good


def test_an_end_at_the_centre_of_projection_is_not_before_the_camera() -> None:
    """A segment of a metre whose other end is a metre before the camera, along its axis."""
    ahead = np.array([0.0, 0.0, 1.0])
    lift = meet_sphere(np.zeros(3), ahead, ahead, np.array(1.0), tolerance=0.0)
    assert lift.points[:, 2].tolist() == [0.0, 2.0] and lift.valid.tolist() == [False, True]


def test_the_spread_of_a_head_is_that_of_the_points_that_are_seen(rng: np.random.Generator) -> None:
    image, seen = rng.normal(size=(20, 6, 2)), rng.random((20, 6)) < 0.7
    seen[:, :2] = True
    image[~seen] = 0.0
    of = Heads(np.zeros((20, 6, 3)), image, seen.astype(float), None, None, np.ones(20))
    expected = [own[there].var(axis=0).sum() * there.sum() for own, there in zip(image, seen, strict=True)]
    np.testing.assert_allclose(spread(of), expected)


def test_a_third_start_is_tried_where_two_are_coarse_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def spy(points: Array, placement: Any) -> Any:
        asked.append(len(points))
        return reversed_start(points, placement)

    monkeypatch.setattr(estimate, "reversed_start", spy)
    image = CAMERA.project(heads(8))
    solve_pose(TABLE_A2, image, CAMERA)
    assert asked == []
    image[2:5] += 60.0 * np.random.default_rng(5).normal(size=(3, 6, 2))
    solve_pose(TABLE_A2, image, CAMERA)
    assert 0 < sum(asked) <= 3


def test_a_head_is_behind_the_camera_where_it_fits_so_much_better_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Seen from behind, points look as their mirror image through the camera's centre does from before it.

    Six points leave six residuals: of a ratio of squared errors the third power is told.
    """
    costs: list[Array] = []
    best_of = estimate._best

    def spy(heads: Heads, plane: Array) -> Any:
        best, reasons = best_of(heads, plane)
        costs.append(best.cost.copy())
        return best, reasons

    monkeypatch.setattr(estimate, "_best", spy)
    mirrored = HeadPoints(names=TABLE_A2.names, points=-TABLE_A2.points)
    image = CAMERA.project(-heads(300) + [0.0, 0.0, 3.2])
    image += np.geomspace(0.1, 40.0, 300)[:, None, None] * np.random.default_rng(6).normal(size=image.shape)
    own = solve_pose(TABLE_A2, image, CAMERA)
    solve_pose(mirrored, image, CAMERA)
    chance = (costs[1] / costs[0]) ** 3
    behind = np.array(["behind the camera" in reason for reason in own.reasons])
    clear = np.abs(np.log(chance / BETTER_BEHIND)) > 0.1
    assert ((chance < BETTER_BEHIND) & (3 * costs[1] / costs[0] > BETTER_BEHIND)).sum() > 20
    assert (behind == (chance < BETTER_BEHIND))[clear].mean() > 0.95


def test_a_chance_is_at_most_one(monkeypatch: pytest.MonkeyPatch) -> None:
    chances: list[Array] = []

    def spy(*given: Any) -> Any:
        found = misfits(*given)
        chances.append(found[2])
        return found

    monkeypatch.setattr(estimate, "misfits", spy)
    image = CAMERA.project(heads(60))
    solve_pose(TABLE_A2, image + np.random.default_rng(8).normal(size=image.shape), CAMERA)
    assert chances[0].max() == 1.0 and chances[0].min() > 0.0


def test_brackets_stand_at_samples_that_are_no_larger_than_their_neighbours(rng: np.random.Generator) -> None:
    psi = np.tile(np.arange(9.0), (4, 1))
    misfit = rng.integers(0, 3, (4, 9, 5)).astype(float)
    misfit[rng.random(misfit.shape) < 0.2] = np.inf
    found = _brackets(psi, misfit)
    expected = [
        (row, branch, max(cell - 1, 0), min(cell + 1, 8), cell, misfit[row, cell, branch])
        for row, cell, branch in np.ndindex(misfit.shape)
        if np.isfinite(misfit[row, cell, branch])
        and misfit[row, cell, branch] <= misfit[row, max(cell - 1, 0) : cell + 2, branch].min()
    ]
    assert list(zip(*(values.tolist() for values in found), strict=True)) == expected


def test_depths_at_which_rigid_parts_close_are_listed_or_there_are_none() -> None:
    for intervals, said in (([[1.0, 2.0], [3.0, 3.5]], "(2 to 4, 6 to 7 m)"), (np.empty((0, 2)), "(none m)")):
        depths: Any = SimpleNamespace(intervals=np.array(intervals))
        assert _feasible(depths, 2.0).endswith(said)


@pytest.mark.parametrize("count", [1, 2])
def test_of_several_frames_it_is_said_in_how_many_a_point_does_not_fit(count: int) -> None:
    image = CAMERA.project(heads(count))
    image[0, 2] += 80.0
    where = "" if count == 1 else r" in 1 of 2 frames, most in frames\[0\]"
    with pytest.warns(
        HeadWarning, match=rf"^head point {TABLE_A2.names[2]} does not fit the others{where}: "
    ):
        solve_pose(TABLE_A2, image, CAMERA)


@pytest.mark.parametrize("away", [0.0, 300.0])
def test_points_on_a_line_are_no_head_wherever_it_runs(away: float) -> None:
    image = away * np.array([-0.5, 1.0]) + np.linspace(0.0, 80.0, 6)[:, None] * [1.0, 0.5]
    along = np.std(np.linspace(0.0, 80.0, 6)) * np.hypot(1.0, 0.5)
    with pytest.raises(HeadError, match=rf"lie on one line or in one point \(spread {along:.3g} by"):
        solve_pose(TABLE_A2, image, CAMERA)


@pytest.mark.parametrize("behind", [False, True])
def test_a_torso_is_placed_whichever_way_its_shoulders_are_off(behind: bool) -> None:
    figure = load_figure()
    views = random_views(figure.scaled(figure.lengths, behind=behind), 12, np.random.default_rng(7))
    assert (views.figure.shoulder_offset < 0) == behind
    found = place(views.camera, views.figure, views.image, None, method="torso")
    for one, neck in zip(found, views.joints_cam[:, 0], strict=True):
        assert one.method == "torso" and np.linalg.norm(one.necks - neck, axis=1).min() < 1e-6


def test_a_focal_length_without_a_deviation_is_no_guess() -> None:
    assert [CalibratedCamera(name="c", K=CAMERA.K, deviation=d).guessed for d in (0.0, 1e-9)] == [False, True]
