"""What only saves time changes no result: torsos asked beforehand, heads placed in blocks, persons kept."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posekit import recover
from posekit.body import load_figure
from posekit.cameras import PinholeCamera
from posekit.cameras.head import TABLE_A2, blocks, head_points_cam, solve_pose
from posekit.formats.own import View
from posekit.recovery import grower
from posekit.recovery.grower import Grower
from posekit.recovery.person import person_of
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

FRAMES = 90


def mixed(noisy: slice) -> View:
    """Views of which some are exact and some are a pixel off, the root given."""
    view = view_of(random_views(load_figure(), FRAMES, np.random.default_rng(5)))
    image = view.image.copy()
    image[noisy] += np.random.default_rng(6).normal(0.0, 1.0, image[noisy].shape)
    assert view.truth is not None
    head = np.full_like(view.head_image, np.nan)
    return replace(view, image=image, root=view.truth[:, 0], head_image=head, length_deviation=0.0)


@pytest.fixture
def grown(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many hypotheses each tree was grown of."""
    counts: list[int] = []
    grow = Grower.grow

    def counted(self: Grower, chosen: Any, *how: Any) -> Any:
        counts.append(len(chosen))
        return grow(self, chosen, *how)

    monkeypatch.setattr(Grower, "grow", counted)
    return counts


def said(view: View, **options: Any) -> list[tuple[Any, ...]]:
    """All that distinguishes the frames of two recoveries."""
    return [
        (
            frame.judged,
            frame.branches,
            frame.joints.tobytes(),
            frame.rejected,
            frame.levels["physical"].tolist(),
        )
        for frame in recover(view, **options).frames
    ]


@pytest.mark.filterwarnings("ignore:frames.*root is:UserWarning")
@pytest.mark.parametrize("noisy", [slice(0, 0), slice(None), slice(0, None, 3)], ids=["none", "all", "third"])
@pytest.mark.parametrize(
    "checks", [("rigid-parts", "joint-range"), ("joint-range",)], ids=["rigid", "ranges"]
)
def test_torsos_that_are_asked_first_change_nothing(
    noisy: slice, checks: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    view = mixed(noisy)
    asked = said(view, checks=checks)
    monkeypatch.setattr(grower, "WORTH_ASKING", 10**6)
    assert said(view, checks=checks) == asked
    if "rigid-parts" in checks:
        assert [one[0] for one in asked].count("measured") == len(range(FRAMES)[noisy])


@pytest.mark.filterwarnings("ignore:frames.*root is:UserWarning")
def test_frames_whose_torso_does_not_close_are_grown_once(grown: list[int]) -> None:
    recover(mixed(slice(0, None, 3)), checks=("rigid-parts",))
    assert grown[:2] == [FRAMES - FRAMES // 3, FRAMES // 3]


@pytest.mark.filterwarnings("ignore:frames.*root is:UserWarning")
def test_a_frame_that_is_called_noisy_is_grown_as_exact_only_if_its_torso_closes(grown: list[int]) -> None:
    for noisy, judged in ((slice(0, 0), "exact"), (slice(None), "refined")):
        view = replace(mixed(noisy), deviation=1.0).take([4])
        assert [frame.judged for frame in recover(view).frames] == [judged]
        assert len(grown) == 1


@pytest.mark.parametrize("threads", [1, 2])
def test_heads_in_blocks_are_placed_as_all_at_once(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(3)
    R = np.broadcast_to(np.diag([1.0, -1.0, -1.0]), (23, 3, 3))
    t = generator.uniform([-0.5, -0.5, 2.0], [0.5, 0.5, 5.0], (23, 3))
    K = np.tile(np.array([[1000.0, 0.0, 640.0], [0.0, 1000.0, 360.0], [0.0, 0.0, 1.0]]), (23, 1, 1))
    K[:, 0, 0] = K[:, 1, 1] = np.linspace(900.0, 1100.0, 23)
    camera = PinholeCamera(K=K)
    image = camera.project(head_points_cam(R, t, TABLE_A2)) + generator.normal(0.0, 0.1, (23, 6, 2))
    image[4, 2], image[11] = np.nan, 0.0
    whole = solve_pose(TABLE_A2, image, camera)
    monkeypatch.setattr(blocks, "BLOCK_HEADS", 5)
    parts = solve_pose(TABLE_A2, image, camera, threads=threads)
    assert parts.reasons == whole.reasons
    assert parts.misfit == whole.misfit
    assert 0 < whole.found.sum() < 23
    for name in ("R_cam_head", "t_cam_head", "f", "residuals", "rms"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), rtol=1e-12, atol=1e-12)


def test_a_person_is_built_once() -> None:
    view, figure = mixed(slice(0, 0)), load_figure()
    tall = replace(view, stature=1.9)
    assert person_of(tall, figure) is person_of(replace(tall), figure)
    assert person_of(tall, figure) is not person_of(replace(view, stature=1.8), figure)
    longer = replace(view, lengths={"right_knee-right_ankle": 0.41})
    assert person_of(longer, figure).lengths["right_knee-right_ankle"] == pytest.approx(0.41)
    assert person_of(view, figure) is figure
