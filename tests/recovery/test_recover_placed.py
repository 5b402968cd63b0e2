"""Calibrated views without a head or a root: the neck is placed, and every result says how."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.formats.own import Result, View, read_result, write_result
from posekit.recovery.result import result_of
from posekit.recovery.rooting import DEFAULT_DEVIATION_PIXELS, tolerance_of
from posekit.settings import Rooting
from posekit.synthesis import random_views
from posekit.views.builtin import forget_camera, view_of

FIGURE = posekit.load_figure()
FOUND = 1e-5


def blind(count: int = 12, noise: float = 0.0, seed: int = 11) -> View:
    """Return random views of which neither root nor head is known."""
    rng = np.random.default_rng(seed)
    scene = random_views(FIGURE, count, rng)
    view = view_of(scene if noise == 0 else scene.with_noise(noise, rng))
    return replace(
        view,
        root=np.full_like(view.root, np.nan),
        head_image=np.full_like(view.head_image, np.nan),
        length_deviation=0.0,
    )


def nearest(recovery: posekit.Recovery, truth: np.ndarray) -> list[float]:
    """Return the largest joint distance of the survivor nearest to the truth, by frame."""
    return [
        float(np.linalg.norm(frame.joints - true, axis=-1).max(axis=1).min(initial=np.inf))
        for frame, true in zip(recovery.frames, truth, strict=True)
    ]


def test_the_truth_is_among_the_survivors_of_exact_views() -> None:
    view = blind(40)
    recovery = posekit.recover(view)
    assert max(nearest(recovery, view.truth)) < FOUND
    for k, frame in enumerate(recovery.frames):
        assert frame.judged == "exact"
        assert frame.root is not None
        assert frame.root.lower <= view.truth[k, 0, 2] <= frame.root.upper
        assert np.abs(frame.root.chosen - view.truth[k, 0, 2]).min() < 1e-6


def test_survivors_and_rejected_leaves_are_all_leaves_of_all_depths() -> None:
    recovery = posekit.recover(blind(6, noise=2.0))
    for frame in recovery.frames:
        assert len(frame) + sum(frame.rejected.values()) == 8192 * frame.hypotheses
        assert frame.hypotheses == len(frame.root.chosen)  # type: ignore[union-attr]
        assert frame.judged == "noisy"


def test_every_survivor_is_at_one_of_the_chosen_depths() -> None:
    view = blind(6, noise=2.0)
    for frame in posekit.recover(view).frames:
        assert frame.root is not None
        away = np.abs(frame.joints[:, 0, 2][:, None] - frame.root.chosen).min(axis=1)
        assert away.max(initial=0.0) < 1e-9


def test_a_larger_deviation_keeps_what_a_smaller_one_allows() -> None:
    view = blind(8, noise=1.0)
    small, large = (posekit.recover(view, rooting=Rooting(deviation=px)) for px in (1.0, 4.0))
    for a, b in zip(small.frames, large.frames, strict=True):
        assert tolerance_of(a.placement).rigid <= tolerance_of(b.placement).rigid  # type: ignore[arg-type]
        assert b.root.lower <= a.root.lower + 1e-9  # type: ignore[union-attr]
        assert b.root.upper >= a.root.upper - 1e-9  # type: ignore[union-attr]


@pytest.mark.parametrize("method", ["torso", "search"])
def test_a_method_can_be_asked_for(method: str) -> None:
    view = blind(4, noise=1.0)
    recovery = posekit.recover(view, rooting=Rooting(method=method))  # type: ignore[arg-type]
    assert {frame.root.method for frame in recovery.frames if frame.root} == {method}


def test_the_views_own_deviation_counts_before_the_default() -> None:
    view = blind(3, noise=1.0)
    default = posekit.recover(view).frames[0].placement
    said = posekit.recover(replace(view, deviation=2 * DEFAULT_DEVIATION_PIXELS)).frames[0].placement
    asked = (
        posekit.recover(replace(view, deviation=9.0), rooting=Rooting(deviation=2 * DEFAULT_DEVIATION_PIXELS))
        .frames[0]
        .placement
    )
    assert default is not None
    assert said is not None
    assert asked is not None
    assert default.tolerance < said.tolerance == asked.tolerance


def test_results_say_how_the_neck_was_placed(tmp_path: Path) -> None:
    recovery = posekit.recover(blind(3, noise=2.0))
    result = result_of(recovery, unit="cm")
    for name in ("r.json", "r.npz"):
        write_result(tmp_path / name, result)
        again: Result = read_result(tmp_path / name)
        for mine, written in zip(result.frames, again.frames, strict=True):
            a, b = mine.root, written.root
            assert a is not None
            assert b is not None
            assert (a.method, a.segment, a.residual_unit, a.note) == (
                b.method,
                b.segment,
                b.residual_unit,
                b.note,
            )
            for field in ("chosen", "intervals", "minima_depth", "curve_residual"):
                np.testing.assert_allclose(getattr(a, field), getattr(b, field), rtol=1e-12, atol=1e-12)
            for field in ("residual", "estimate", "deviation", "lower", "upper"):
                np.testing.assert_allclose(getattr(a, field), getattr(b, field), rtol=1e-12, atol=1e-12)


def test_a_given_root_is_not_placed_again() -> None:
    view = blind(3)
    given = replace(view, root=view.truth[:, 0])
    recovery = posekit.recover(given)
    assert [frame.root for frame in recovery.frames] == [None] * 3
    assert max(nearest(recovery, view.truth)) < FOUND


def test_frames_with_and_without_a_root_go_together() -> None:
    view = blind(5)
    root = view.truth[:, 0].copy()
    root[[1, 3]] = np.nan
    recovery = posekit.recover(replace(view, root=root))
    assert [frame.root is None for frame in recovery.frames] == [True, False, True, False, True]
    assert max(nearest(recovery, view.truth)) < FOUND


def test_a_frame_of_which_nothing_is_seen_says_why_and_the_others_are_recovered() -> None:
    view = blind(3)
    image = view.image.copy()
    image[1, 1:] = np.nan
    recovery = posekit.recover(replace(view, image=image))
    assert "nothing bounds how far away the neck is" in recovery.frames[1].reason
    assert len(recovery.frames[1]) == 0
    assert recovery.frames[1].root is not None
    assert recovery.frames[1].root.method == "none"
    assert nearest(recovery, view.truth)[0] < FOUND


@pytest.mark.parametrize(
    ("method", "deviation", "text"),
    [("neck", None, "--root: 'neck'"), ("auto", -1.0, "--deviation"), ("auto", float("nan"), "--deviation")],
)
def test_bad_ways_to_find_the_neck_are_refused(method: str, deviation: float | None, text: str) -> None:
    with pytest.raises(InputError, match=text):
        Rooting(method=method, deviation=deviation)  # type: ignore[arg-type]


def test_an_uncalibrated_view_has_no_depth_to_find() -> None:
    with pytest.raises(InputError, match="--root: the view's camera is not known"):
        posekit.recover(forget_camera(blind(1)), rooting=Rooting(method="search"))


def test_names_of_joints_that_were_derived_are_checked() -> None:
    with pytest.raises(InputError, match="derived"):
        replace(blind(1), derived=("chin",))
    assert replace(blind(1), derived=("neck",)).derived == ("neck",)
