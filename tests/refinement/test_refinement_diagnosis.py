"""Which lengths are wrong: stated half or twice of one segment or of all, and nothing said where nothing is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from posekit.body import Figure, load_figure
from posekit.errors import InputError
from posekit.refinement import LengthDoubt, ObservedFrames, RootPrior, diagnose, find_trunks, refine
from posekit.skeleton import SEGMENT_NAMES
from posekit.synthesis import SyntheticScene, random_views


@cache
def scene() -> SyntheticScene:
    return random_views(load_figure(), 12, np.random.default_rng(0)).with_noise(2.0, np.random.default_rng(1))


def stated(wrong: Sequence[str], factor: float) -> Figure:
    figure = scene().figure
    return figure.scaled({name: figure.lengths[name] * factor for name in wrong})


def sight_of(figure: Figure, rows: slice = slice(None)) -> ObservedFrames:
    view = scene()
    necks = view.joints_cam[rows, 0]
    root = RootPrior(mean=necks, covariance=np.zeros((len(necks), 3, 3)))
    return ObservedFrames(figure=figure, camera=view.camera, image=view.image[rows], deviation=2.0, root=root)


def found(wrong: Sequence[str], factor: float, rows: slice = slice(None)) -> dict[str, LengthDoubt]:
    return {doubt.segment: doubt for doubt in diagnose(sight_of(stated(wrong, factor), rows))}


def test_nothing_is_said_where_lengths_are_right() -> None:
    assert diagnose(sight_of(scene().figure)) == []


def test_a_limb_that_is_stated_half_is_named_with_what_it_needs() -> None:
    name = "left_elbow-left_wrist"
    doubts = found([name], 0.5)
    assert list(doubts) == [name]
    doubt, true = doubts[name], scene().figure.lengths[name]
    assert doubt.stated == pytest.approx(true / 2)
    assert 0.75 * true < doubt.needed < 1.15 * true
    assert doubt.least <= doubt.needed <= true * 1.05 and doubt.most > true
    assert doubt.unexplained > doubt.left == 0
    assert name in str(doubt) and "\n" not in str(doubt)


def test_a_limb_that_is_stated_twice_is_never_seen_as_long() -> None:
    name = "right_hip-right_knee"
    doubts = found([name], 2.0)
    assert list(doubts) == [name]
    assert doubts[name].needed == pytest.approx(scene().figure.lengths[name], rel=0.15)
    assert "none of 12 frames" in str(doubts[name])


def test_few_frames_do_not_tell_that_a_limb_is_too_long() -> None:
    doubts = found(["right_elbow-right_wrist"], 2.0, slice(0, 7))
    assert all(doubt.unexplained > 0 for doubt in doubts.values())


def test_a_distance_of_the_trunk_that_is_stated_half_is_named() -> None:
    name = "right_shoulder-left_shoulder"
    doubts = found([name], 0.5)
    assert list(doubts) == [name]
    assert doubts[name].needed == pytest.approx(scene().figure.lengths[name], rel=0.05)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_all_lengths_wrong_by_a_factor_are_all_named_from_one_view(factor: float) -> None:
    doubts = found(SEGMENT_NAMES, factor, slice(3, 4))
    assert list(doubts) == list(SEGMENT_NAMES)
    for name, doubt in doubts.items():
        assert doubt.needed == pytest.approx(scene().figure.lengths[name], rel=0.08)


def test_frames_without_a_joint_say_nothing() -> None:
    sight = sight_of(scene().figure)
    nothing = replace(sight, image=np.full((12, 14, 2), np.nan))
    assert diagnose(nothing) == []
    with np.errstate(all="raise"):
        refined = refine(nothing, scene().joints_cam)
    assert (refined.chi2 < 1e-6).all() and (refined.deviation[:, 13] > 0.1).all()


def test_frames_whose_root_is_not_known_say_nothing() -> None:
    sight = sight_of(scene().figure)
    root = RootPrior(mean=np.full((12, 3), np.nan), covariance=np.zeros((12, 3, 3)))
    assert diagnose(replace(sight, root=root)) == [] and not len(find_trunks(replace(sight, root=root)))


def test_without_a_root_it_is_refused() -> None:
    with pytest.raises(InputError, match="RootPrior"):
        diagnose(replace(sight_of(scene().figure), root=None))


def test_both_directions_are_worded() -> None:
    kind = {"segment": "pelvis-left_hip", "frames": 12, "unexplained": 9, "left": 0}
    short = LengthDoubt(stated=0.21, needed=0.272, least=0.272, most=0.4, **kind)  # type: ignore[arg-type]
    assert str(short) == "pelvis-left_hip is stated as 0.210 m, but 9 of 12 frames need 0.272 m of it or more"
    long = LengthDoubt(stated=0.4, needed=0.2, least=0.2, most=0.3, **kind)  # type: ignore[arg-type]
    assert str(long).endswith("stated as 0.400 m, but none of 12 frames shows more than 0.200 m of it")
    about = LengthDoubt(stated=0.4, needed=0.2, least=0.18, most=0.22, **kind)  # type: ignore[arg-type]
    assert str(about).endswith("9 of 12 frames need 0.200 m or the like (0.180 to 0.220 m)")
    one = LengthDoubt(stated=0.2, needed=0.3, least=0.3, most=0.3, **kind)  # type: ignore[arg-type]
    assert str(one).endswith("9 of 12 frames need 0.300 m or the like (0.300 to 0.300 m)")
