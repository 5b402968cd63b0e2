"""Which bodies are listed: the likeliest, and no fewer than hold the probability asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.ranking.ranking import softmax
from posekit.recovery import Recovery, recover
from posekit.recovery.listing import likeliest
from posekit.recovery.summary import summary_lines
from posekit.samples import write_samples
from posekit.settings import RecoverSettings
from posekit.synthesis import random_views
from posekit.views.opening import open_views
from posekit.views.source import Source
from tests.recovery.test_refiner import noisy

COVERAGE = 0.95


def recovered(**changes: Any) -> tuple[Recovery, Recovery]:
    view = noisy(random_views(load_figure(), 12, np.random.default_rng(5)), 2.0)
    return recover(view, coverage=1.0, **changes), recover(view, coverage=COVERAGE, **changes)


@pytest.fixture(scope="module")
def both() -> tuple[Recovery, Recovery]:
    """The same views, every body listed, and those that hold a share of the probability."""
    return recovered()


@pytest.mark.parametrize("asked", [{}, {"length_deviation": 0.0}])
def test_every_body_is_listed_or_counted_with_its_probability(asked: dict[str, float]) -> None:
    assert_share_of_the_whole(*recovered(**asked), COVERAGE)


def test_what_the_sample_recording_leaves_out_is_exact(tmp_path: Path) -> None:
    write_samples(tmp_path)
    (opened,) = open_views(tmp_path / "keypoints", Source(camera=str(tmp_path / "calibration.toml")))
    assert_share_of_the_whole(recover(opened.view, coverage=1.0), recover(opened.view), 0.99)


def assert_share_of_the_whole(every: Recovery, some: Recovery, coverage: float) -> None:
    fewer = 0
    for k, (whole, part) in enumerate(zip(every.frames, some.frames, strict=True)):
        assert whole.unlisted == 0 == whole.unlisted_probability
        assert len(whole) == len(part) + part.unlisted
        assert part.rejected.get("noise/unlisted", 0) == part.unlisted
        if not len(whole):
            continue
        p, apart = every.probability[k], np.abs(whole.joints[:, None] - part.joints).max(axis=(2, 3))
        listed = apart.min(axis=1) == 0.0
        np.testing.assert_array_equal(whole.joints[listed], part.joints)
        assert p.sum() == pytest.approx(1.0) == some.probability[k].sum()
        np.testing.assert_allclose(some.probability[k], p[listed] / p[listed].sum(), rtol=1e-9)
        assert part.unlisted_probability == pytest.approx(p[~listed].sum(), rel=1e-9, abs=1e-12)
        assert part.unlisted_probability <= 1 - coverage + 1e-12
        assert p[~listed].max(initial=0.0) < p[listed].min()
        fewer += part.unlisted
    assert fewer > 0


def test_of_what_is_not_listed_nothing_is_said_to_be_impossible(both: tuple[Recovery, Recovery]) -> None:
    rounded = [replace(frame, unlisted_probability=0.0) for frame in both[1].frames]
    said = "\n".join(summary_lines(replace(both[1], frames=rounded)))
    assert "more hold under 1 % of a frame at most" in said
    assert "hold 0 %" not in said


def test_the_set_holds_what_is_listed_and_what_is_not(both: tuple[Recovery, Recovery]) -> None:
    for whole, part in zip(both[0].frames, both[1].frames, strict=True):
        found = part.posture_set
        assert found.bodies >= len(whole)
        if not len(whole):
            continue
        composed = found.joints(found.compose())
        # Limbs are on their trunks before whole bodies are refined: as far from where these end as depths are off.
        near = np.linalg.norm(whole.joints[:, None] - composed[None], axis=3).max(axis=2).min(axis=1)
        assert np.median(near) < 0.1


def brute(score: NDArray[np.float64], coverage: float) -> int:
    p = np.sort(np.exp(score - score.max()))[::-1]
    return int(np.searchsorted(np.cumsum(p) / p.sum(), coverage - 1e-12) + 1)


@pytest.mark.parametrize("coverage", [0.5, 0.9, 0.999])
def test_the_fewest_that_hold_the_share_are_chosen(coverage: float) -> None:
    rng = np.random.default_rng(2)
    frame = np.repeat([7, 3, 4], [20, 1, 35])
    score = 3.0 * rng.standard_normal(len(frame))
    score[5] = -np.inf
    mass, group = softmax(score, frame), np.unique(frame, return_inverse=True)[1].reshape(-1)
    chosen = likeliest(mass, group, np.asarray((1 - coverage) * np.bincount(group, mass)))
    for one in (7, 3, 4):
        own = (frame == one) & np.isfinite(score)
        assert chosen[own].sum() == brute(score[own], coverage)
        assert score[own & chosen].min() > score[own & ~chosen].max(initial=-np.inf)
    assert not chosen[5]


def test_exact_frames_list_all() -> None:
    import posekit

    view = posekit.builtin_view("seq1")
    one, other = posekit.recover(view, coverage=0.5), posekit.recover(view, coverage=1.0)
    for a, b in zip(one.frames, other.frames, strict=True):
        np.testing.assert_array_equal(a.joints, b.joints)
        assert a.posture_set.bodies >= len(a)


@pytest.mark.parametrize("coverage", [0.0, 1.5, float("nan"), -0.1])
def test_a_share_that_is_none_is_refused(coverage: float) -> None:
    with pytest.raises(InputError, match="--coverage"):
        RecoverSettings(coverage=coverage)


def test_the_last_bits_of_the_image_choose_nothing(tmp_path: Path) -> None:
    """Other machines add up in another order: they list the same postures, as likely."""
    write_samples(tmp_path)
    (opened,) = open_views(tmp_path / "keypoints", Source(camera=str(tmp_path / "calibration.toml")))
    here = recover(opened.view)
    there = recover(replace(opened.view, image=opened.view.image * (1.0 + 1e-12)))
    for k, (frame, other) in enumerate(zip(here.frames, there.frames, strict=True)):
        np.testing.assert_array_equal(frame.branches, other.branches)
        np.testing.assert_allclose(here.probability[k], there.probability[k], atol=1e-4)
