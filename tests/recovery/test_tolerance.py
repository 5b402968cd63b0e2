"""Tolerances: each distance of the torso its own, and what the tree keeps with them."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.body.frames import torso_frame
from posekit.errors import InputError
from posekit.recovery import recover
from posekit.settings import (
    EXACT_TOLERANCE,
    MEASURED_TOLERANCE,
    PHOTOGRAPH_TOLERANCE,
    RigidTolerance,
    Tolerance,
)
from posekit.skeleton import RIGID_SEGMENTS, segment_name
from posekit.synthesis import SyntheticScene, random_views
from posekit.views.builtin import view_of

FIGURE = load_figure()
LOOSE = Tolerance(rigid=0.05, tangent=0.01, placement=False, angle=2.0)
GIVING = {
    "right_shoulder-left_shoulder": 0.006,
    "right_shoulder-pelvis": -0.022,
    "left_shoulder-pelvis": 0.018,
    "right_hip-left_hip": 0.004,
}
"""Metres by which the torso that is seen differs from the figure's: a side bend."""


@pytest.fixture(scope="module")
def bent() -> SyntheticScene:
    """Look at postures of a torso that bends, for a figure whose torso does not."""
    bends = FIGURE.scaled({name: FIGURE.lengths[name] + more for name, more in GIVING.items()})
    return replace(random_views(bends, 24, np.random.default_rng(3)), figure=FIGURE)


def offs(joints: np.ndarray) -> np.ndarray:
    ends = np.array(RIGID_SEGMENTS)
    away = np.linalg.norm(joints[:, ends[:, 0]] - joints[:, ends[:, 1]], axis=-1)
    return np.asarray(away - [FIGURE.lengths[segment_name(segment)] for segment in RIGID_SEGMENTS])


def ahead(joints: np.ndarray) -> np.ndarray:
    """Measure how far the shoulders lie in front of the line from neck to pelvis (N,)."""
    forward = torso_frame(*np.moveaxis(joints[:, :4], 1, 0))[:, :, 0]
    return np.asarray(np.einsum("ni,ni->n", forward, joints[:, 1] - joints[:, 0]))


def test_all_distances_have_the_same_bound_unless_told_otherwise() -> None:
    for tolerance in (EXACT_TOLERANCE, PHOTOGRAPH_TOLERANCE, LOOSE):
        assert tolerance.distances == RigidTolerance.uniform(tolerance.rigid)


def test_the_hips_of_measured_bodies_give_a_quarter() -> None:
    assert MEASURED_TOLERANCE.distances == RigidTolerance(shoulders=0.03, sides=0.03, hips=0.0075)
    assert replace(MEASURED_TOLERANCE, rigid=0.04).distances == RigidTolerance(
        shoulders=0.04, sides=0.04, hips=0.01
    )
    assert MEASURED_TOLERANCE.distances.widest == MEASURED_TOLERANCE.rigid


@pytest.mark.parametrize("part", [np.nan, np.inf, -0.01, 1.001])
def test_a_part_that_is_none_is_refused(part: float) -> None:
    with pytest.raises(
        InputError, match=f"the hips' part of the rigid tolerance is {part!r}; expected a number"
    ):
        replace(MEASURED_TOLERANCE, hips=part)


def test_tolerances_are_keys_and_come_back_from_json() -> None:
    every = (EXACT_TOLERANCE, MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE, LOOSE)
    assert len(set(every)) == 4
    for tolerance in every:
        assert Tolerance(**json.loads(json.dumps(asdict(tolerance)))) == tolerance


def test_the_tree_keeps_what_has_every_distance_within_its_own_bound(bent: SyntheticScene) -> None:
    loose = recover(view_of(bent), tolerance=LOOSE)
    measured = recover(
        view_of(bent), tolerance=replace(MEASURED_TOLERANCE, tangent=LOOSE.tangent, angle=LOOSE.angle)
    )
    bounds = np.array([MEASURED_TOLERANCE.distances.of(segment) for segment in RIGID_SEGMENTS])
    assert measured.settings["tolerance"]["hips"] == 0.25
    assert measured.settings["measured"] == asdict(MEASURED_TOLERANCE)
    fewer, kept = 0, 0
    for before, after in zip(loose.frames, measured.frames, strict=True):
        inside = (np.abs(offs(before.joints)) <= bounds).all(axis=1)
        inside &= ahead(before.joints) >= min(FIGURE.shoulder_offset - MEASURED_TOLERANCE.rigid, 0.0)
        assert [code for code, ok in zip(before.branches, inside, strict=True) if ok] == after.branches
        fewer, kept = fewer + len(before) - len(after), kept + len(after)
    assert fewer > 0
    assert kept > 0


def test_margins_are_the_room_left_to_each_distances_own_bound(bent: SyntheticScene) -> None:
    recovery = recover(view_of(bent), tolerance=MEASURED_TOLERANCE)
    bounds = np.array([MEASURED_TOLERANCE.distances.of(segment) for segment in RIGID_SEGMENTS])
    survivors = 0
    for frame in recovery.frames:
        room = (bounds - np.abs(offs(frame.joints))).min(axis=1)
        np.testing.assert_allclose(frame.margins["rigid_parts"], room, rtol=0, atol=1e-12)
        assert (room >= 0).all()
        survivors += len(frame)
    assert survivors > 100


def test_a_torso_that_bends_keeps_its_true_posture(bent: SyntheticScene) -> None:
    recovery = recover(view_of(bent), tolerance=MEASURED_TOLERANCE)
    for frame, truth in zip(recovery.frames, bent.joints_cam, strict=True):
        error = np.linalg.norm(frame.joints - truth, axis=-1).mean(axis=1)
        assert error.min(initial=np.inf) < 0.002
