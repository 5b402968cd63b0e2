"""Laws of the defects that are put into clean clips, and of when one counts as found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.clean_clips import CleanClip
from benchmarks.defect_cases import DefectCase, draw
from benchmarks.defects import DEFECTS
from benchmarks.defects_found import is_found
from posekit.body import load_figure
from posekit.validators.motion import MotionClip

UP = np.array([0.0, 1.0, 0.0])
BY_SIZE = (
    "floating",
    "sinking",
    "sliding",
    "jump of a joint",
    "jump of the body",
    "drift of a length",
    "jitter",
)
WHOLE = [kind for kind, defect in DEFECTS.items() if not defect.frames[1]]


def clean(count: int = 120) -> CleanClip:
    time = np.arange(count) / 30.0
    joints = np.repeat(load_figure().neutral_points[None, :14], count, axis=0)
    joints = joints + 0.05 * np.sin(3.0 * time[:, None, None] + np.arange(42).reshape(14, 3))
    feet = np.full((count, 4, 3), np.nan)
    feet[:, :2] = np.array([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]])
    clip = MotionClip(joints=joints, feet=feet, time=time, rate=30.0, up=UP)
    return CleanClip(name="swaying", clip=clip, thresholds=False)


def drawn(kind: str, size: float, seed: int = 0) -> DefectCase:
    case = draw([clean()], DEFECTS[kind], size, np.random.default_rng(seed), tries=2000)
    assert case is not None
    return case


@pytest.mark.parametrize("kind", BY_SIZE)
def test_a_defect_of_no_size_is_none(kind: str) -> None:
    assert np.allclose(drawn(kind, 0.0).clip.joints, clean().clip.joints, atol=1e-12)


@pytest.mark.parametrize("kind", sorted(set(BY_SIZE) - {"sliding", "drift of a length"}))
def test_outside_its_span_nothing_is_changed(kind: str) -> None:
    case = drawn(kind, 0.1)
    changed = np.abs(case.clip.joints - clean().clip.joints).max(axis=(1, 2)) > 0
    assert np.array_equal(np.flatnonzero(changed), np.arange(case.span[0], case.span[1] + 1))


@pytest.mark.parametrize("kind", [kind for kind in DEFECTS if kind not in WHOLE])
def test_a_span_is_inside_its_clip(kind: str) -> None:
    size = 0.0 if kind == "shuffled" else DEFECTS[kind].sizes[0]
    case = drawn(kind, size)
    assert 0 < case.span[0] <= case.span[1] < len(case.clip) - 1
    assert len(case.clip.time) == len(case.clip.joints)


def test_sliding_goes_on_from_where_it_came_to() -> None:
    case = drawn("sliding", 0.3)
    way = np.linalg.norm(case.clip.joints[:, 0] - clean().clip.joints[:, 0], axis=-1)
    seconds = (case.span[1] - case.span[0] + 1) / 30.0
    assert way[-1] == pytest.approx(0.3 * seconds)
    assert way[case.span[0] - 1] == 0.0


def test_a_swap_of_a_swap_is_the_clip() -> None:
    kind = DEFECTS["swap of both sides"]
    rng, span = np.random.default_rng(0), (10, 30)
    once = kind.put(clean().clip, span, 1.0, rng)
    assert once is not None
    twice = kind.put(once.clip, span, 1.0, rng)
    assert twice is not None
    assert np.array_equal(twice.clip.joints, clean().clip.joints)


def test_a_defect_counts_as_found_by_the_right_name_near_its_span_alone() -> None:
    case = replace(drawn("floating", 0.1), span=(40, 60))
    frames = np.zeros(120, dtype=np.bool_)
    frames[42:60] = True
    assert is_found(case, {"floating": frames})
    assert not is_found(case, {"teleport": frames})
    frames[90] = True
    assert not is_found(case, {"floating": frames})
    assert not is_found(case, {"floating": np.zeros(120, dtype=np.bool_)})
