"""Truth from another file: axes are reconciled by the image, frames by their times; survivors are compared with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.evaluate.comparison import compare
from posekit.formats.own import OpenCVModel, View
from posekit.geometry import Array
from posekit.recovery.judged import rigid_of
from posekit.recovery.ranked import ranked
from posekit.recovery.result import result_of
from posekit.synthesis import random_views
from posekit.views.builtin import view_of
from posekit.views.truth import AXIS_TURNS, with_truth

FIGURE = posekit.load_figure()


def placed(count: int = 8) -> tuple[View, Array]:
    """Return a view of a camera in a world, and the truth in that world."""
    rng = np.random.default_rng(5)
    view = view_of(random_views(FIGURE, count, rng))
    assert isinstance(view.camera, OpenCVModel)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    R = q * np.sign(np.linalg.det(q))
    t = np.array([0.3, -0.2, 1.0])
    camera = OpenCVModel(K=view.camera.K, distortion=view.camera.distortion, R=R, t=t, size=view.camera.size)
    world = (view.truth - t) @ R
    view = replace(view, camera=camera, time=np.arange(count) / 30, truth=np.full_like(view.truth, np.nan))
    return view, world


def test_the_turns_are_the_24_rotations_of_the_axes() -> None:
    assert len(AXIS_TURNS) == 24
    assert len({turn.tobytes() for turn in AXIS_TURNS}) == 24
    np.testing.assert_allclose(np.linalg.det(AXIS_TURNS), 1.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("turn", range(0, 24, 5))
def test_any_turn_of_the_axes_is_found(turn: int) -> None:
    view, world = placed()
    given, told = with_truth(view, world @ AXIS_TURNS[turn], view.time + 7.0)
    true = world @ view.camera.R.T + view.camera.t  # type: ignore[union-attr,operator]
    np.testing.assert_allclose(given.truth, true, rtol=0, atol=1e-9)
    assert told.frames == len(view)
    assert told.error < 1e-6


def test_frames_are_matched_by_time() -> None:
    view, world = placed()
    fewer = replace(view, time=view.time, image=view.image)
    given, told = with_truth(fewer, world[::2], view.time[::2])
    assert told.frames == len(view) // 2 + (len(view) % 2)
    assert np.isnan(given.truth[1]).all()
    assert np.isfinite(given.truth[2]).all()


def test_pictures_of_nobody_have_their_truth_too() -> None:
    """The first picture is at the truth's second 0, whoever is in it."""
    view, world = placed()
    image = view.image.copy()
    image[[0, 3]] = np.nan
    given, told = with_truth(replace(view, image=image), world, view.time)
    whole, _ = with_truth(view, world, view.time)
    np.testing.assert_array_equal(given.truth, whole.truth)
    assert told.frames == len(view)


def test_what_is_no_truth_of_the_view_is_refused() -> None:
    view, world = placed()
    with pytest.raises(InputError, match=r"misses the key points.*--person"):
        with_truth(view, world + np.array([0.0, 0.0, 3.0]), view.time)
    with pytest.raises(InputError, match="none of its 8 frames is at the time"):
        with_truth(replace(view, time=view.time + 100.0), world, view.time)
    camera = OpenCVModel(K=view.camera.K)  # type: ignore[union-attr]
    with pytest.raises(InputError, match="expected R and t"):
        with_truth(replace(view, camera=camera), world, view.time)


def test_the_truth_among_exact_survivors_is_the_best_and_ranks_with_the_first() -> None:
    view = view_of(random_views(FIGURE, 6, np.random.default_rng(2)))
    recovery = posekit.recover(view)
    told = compare(recovery, view.truth)
    assert (told.best < 1e-6).all()
    assert (told.best <= told.first + 1e-12).all()
    assert (told.best <= told.middle + 1e-12).all()
    assert told.survivors.tolist() == [len(frame) for frame in recovery.frames]
    assert "6 of 6 frames" in told.lines[0]


def test_a_frame_without_truth_or_survivor_is_not_counted() -> None:
    view = view_of(random_views(FIGURE, 3, np.random.default_rng(2)))
    truth = view.truth.copy()
    truth[1] = np.nan
    told = compare(posekit.recover(view), truth)
    assert np.isnan(told.best[1]).all()
    assert "2 of 3 frames" in told.lines[0]
    assert compare(posekit.recover(view), np.full_like(truth, np.nan)).lines == [
        "no frame has both survivors and a truth"
    ]


def test_the_likeliest_comes_first_and_probabilities_are_of_each_frame() -> None:
    view = view_of(random_views(FIGURE, 5, np.random.default_rng(4)))
    recovery = posekit.recover(view)
    ranking = ranked(recovery.frames, FIGURE.lengths, 1e-8)
    for k, frame in enumerate(recovery.frames):
        part = ranking.of(k)
        assert part.probability.sum() == pytest.approx(1.0)
        assert sorted(part.order.tolist()) == list(range(len(frame)))
        assert (np.diff(part.probability[part.order]) <= 1e-15).all()
    told = rigid_of(result_of(recovery).settings, 5)
    np.testing.assert_allclose(told, 1e-8, rtol=0, atol=0)


def test_a_results_settings_say_what_its_frames_were_judged_with() -> None:
    settings = {
        "judged": ["exact", "noisy", "given", None],
        "noisy": {"rigid": 0.12},
        "tolerance": {"rigid": 0.5},
    }
    assert rigid_of(settings, 4).tolist() == [1e-8, 0.12, 0.5, 1e-8]
    assert rigid_of({}, 2).tolist() == [1e-8, 1e-8]
