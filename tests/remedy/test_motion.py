"""Laws of the remedy for motion: what is put into a clean clip is undone, and nothing else is touched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import posekit
from posekit.body import load_figure
from posekit.geometry import Array
from posekit.remedy.between import interpolated, smoothed, turn_between
from posekit.remedy.pieces import moved
from posekit.remedy.tied import tied_postures
from posekit.skeleton import JOINT, JOINTS, LIMB_JOINTS, other_side
from posekit.validators import Validator
from posekit.validators.motion import MotionClip, judge_motion

FRAMES, RATE = 90, 30.0
UP = np.array([0.0, 0.0, 1.0])
MILLIMETRE = 1e-3
LEGS = ("hip", "knee", "ankle")


def steps() -> MotionClip:
    """Return a clip of a figure that marches on the spot, always on a foot."""
    figure = load_figure()
    q = np.zeros((FRAMES, figure.model.nq))
    q[:, 6] = 1.0
    phase = np.linspace(0, 3 * np.pi, FRAMES)
    lift = {"right": np.maximum(np.sin(phase), 0) ** 2, "left": np.maximum(-np.sin(phase), 0) ** 2}
    angles = np.zeros((FRAMES, 22))
    angles[:, [9, 13]] = 0.4
    angles[:, 6], angles[:, 10] = 0.3 * np.sin(phase + 0.7), -0.3 * np.sin(phase + 0.7)
    for k, side in ((14, "right"), (18, "left")):
        angles[:, k], angles[:, k + 3] = 0.8 * lift[side], 1.2 * lift[side]
    q[:, figure.angle_index] = angles
    joints = figure.forward_kinematics(q)[:, : len(JOINTS)]
    joints[..., 2] -= joints[..., 2].min()
    return MotionClip(joints=joints, time=np.arange(FRAMES) / RATE, rate=RATE, up=UP)


def rejected(clip: MotionClip) -> NDArray[np.bool_]:
    """Return which frames a fresh validator rejects, by all its checks (T,)."""
    judge = Validator()
    bad = judge.check(clip.joints).invalid.copy()
    for one in judge_motion(judge.profile.checks, clip).judgements:
        bad |= one.violated.any(axis=1)
    return bad


def with_joints(clip: MotionClip, joints: Array) -> MotionClip:
    """Return the clip with other joints."""
    return replace(clip, joints=joints)


def exchange_legs(joints: Array) -> Array:
    """Take the right leg for the left in frames 30 to 59."""
    order = [
        JOINTS.index(other_side(name)) if any(part in name for part in LEGS) else k
        for k, name in enumerate(JOINTS)
    ]
    joints[30:60] = joints[30:60][:, order]
    return joints


def jump(joints: Array) -> Array:
    """Displace a wrist by 15 cm in one frame."""
    joints[40, JOINT["left_wrist"]] += [0.1, 0.1, 0.05]
    return joints


def jump_of_the_body(joints: Array) -> Array:
    """Displace all joints by 20 cm in one frame."""
    joints[40] += [0.2, 0.0, 0.0]
    return joints


def sink(joints: Array) -> Array:
    """Lower the body by 4 cm for a second."""
    joints[30:60] -= 0.04 * UP
    return joints


def drift(joints: Array) -> Array:
    """Lengthen a forearm by a tenth for half a second."""
    _, elbow, wrist = LIMB_JOINTS[0]
    joints[40:55, wrist] += 0.1 * (joints[40:55, wrist] - joints[40:55, elbow])
    return joints


def freeze(joints: Array) -> Array:
    """Hold ten frames of a swing."""
    joints[6:16] = joints[5]
    return joints


@pytest.mark.parametrize(
    ("put", "remedy", "near"),
    [
        (exchange_legs, "exchanged", 0.0),
        (jump, "interpolated", 5 * MILLIMETRE),
        (jump_of_the_body, "interpolated", 5 * MILLIMETRE),
        (sink, "shifted", MILLIMETRE),
        (drift, "lengthened", MILLIMETRE),
        (freeze, "interpolated", 60 * MILLIMETRE),
    ],
    ids=lambda one: getattr(one, "__name__", str(one)),
)
def test_defects_are_undone(put: Callable[[Array], Array], remedy: str, near: float) -> None:
    """The clip passes again, is near what it was, and the record names the remedy."""
    clean = steps()
    spoiled = with_joints(clean, put(clean.joints.copy()))
    assert rejected(spoiled).any()
    repaired = posekit.repair(spoiled)
    assert not rejected(with_joints(spoiled, repaired.joints)).any()
    assert np.abs(repaired.joints - clean.joints).max() <= near + 1e-12
    assert remedy in {span.remedy for span in repaired.spans}
    assert repaired.valid.all() and repaired.left == ()


def test_clean_clips_come_back_as_they_were() -> None:
    """A legal motion is not touched."""
    clean = steps()
    assert not rejected(clean).any()
    repaired = posekit.repair(clean)
    np.testing.assert_array_equal(repaired.joints, clean.joints)
    assert repaired.spans == ()


def test_frames_out_of_order_are_put_in_order() -> None:
    """Frames that keep their times are sorted by them."""
    clean = steps()
    order = np.arange(FRAMES)
    order[40:44] = [43, 41, 42, 40]
    spoiled = replace(clean, joints=clean.joints[order], time=clean.time[order])
    repaired = posekit.repair(spoiled)
    np.testing.assert_array_equal(repaired.joints, clean.joints)
    np.testing.assert_array_equal(repaired.time, clean.time)


def bent_back(joints: Array) -> Array:
    """Bend a knee forward, by degrees that rise and fall over frames 20 to 70."""
    hip, knee, ankle = LIMB_JOINTS[2]
    for frame in range(20, 70):
        angle = np.radians(25 * np.sin(np.pi * (frame - 20) / 50) ** 2)
        upper = joints[frame, knee] - joints[frame, hip]
        turn = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
        length = np.linalg.norm(joints[frame, ankle] - joints[frame, knee])
        joints[frame, ankle] = joints[frame, knee] + length * turn @ (upper / np.linalg.norm(upper))
    return joints


def test_legal_frames_stay_and_changes_are_smooth() -> None:
    """Only rejected frames change, and the repaired motion jerks no more than the one given."""
    clean = steps()
    spoiled = with_joints(clean, bent_back(clean.joints.copy()))
    bad = rejected(spoiled)
    repaired = posekit.repair(spoiled)
    assert 5 < bad.sum() < 50
    np.testing.assert_array_equal(repaired.joints[~bad], spoiled.joints[~bad])
    assert not rejected(with_joints(spoiled, repaired.joints)).any()
    jerks = [np.abs(np.diff(joints, n=2, axis=0)).max() for joints in (repaired.joints, spoiled.joints)]
    assert jerks[0] < 1.5 * jerks[1] + MILLIMETRE


def test_ties_draw_changes_together() -> None:
    """Changes of neighbouring frames differ less than those of frames by themselves."""
    spoiled = bent_back(steps().joints.copy())
    rng = np.random.default_rng(0)
    spoiled = spoiled + rng.normal(0, 2 * MILLIMETRE, spoiled.shape)
    points = np.concatenate([spoiled, np.full((FRAMES, 5, 3), np.nan)], axis=1)
    judge = Validator()
    bad = np.flatnonzero(judge.check(spoiled).invalid)
    _, suite = judge.figure_and_suite(spoiled)
    weight = np.ones((FRAMES, 19))
    tied = tied_postures(points, bad, suite, weight)[:, : len(JOINTS)]
    alone = np.concatenate([posekit.repair(spoiled, judge).joints[None]])[0]
    rough = [np.sum(np.diff(one - spoiled, axis=0) ** 2) for one in (tied, alone)]
    assert rough[0] <= rough[1]
    assert judge.check(tied).valid.all()


def test_interpolated_frames_keep_lengths_and_ends() -> None:
    """Frames between two turned postures are of rigid pieces; the good ones stay."""
    points = np.repeat(load_figure().neutral_points[None], 5, axis=0)
    step = np.zeros((1, 36))
    step[0, [0, 4, 13, 17]] = 0.3, 0.4, 0.5, -0.3
    points[4] = moved(points[:1], step)[0]
    out = interpolated(points, np.array([False, True, True, True, False]))
    np.testing.assert_array_equal(out[[0, 4]], points[[0, 4]])
    arm = [JOINT["right_shoulder"], JOINT["right_elbow"]]
    lengths = np.linalg.norm(np.diff(out[:, arm], axis=1), axis=-1)
    np.testing.assert_allclose(lengths, lengths[0, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        moved(points[:1], turn_between(points[0], points[4])[None])[0], points[4], atol=1e-12
    )


def test_smoothing_leaves_even_motion_and_other_frames() -> None:
    """Parabolas are left as they are; frames that may not move do not; noise gets less."""
    t = np.linspace(0, 1, 40)[:, None]
    even, loose = np.concatenate([t, t**2], axis=1), np.zeros(40, dtype=bool)
    loose[10:30] = True
    np.testing.assert_allclose(smoothed(even, loose, 100.0), even, rtol=0, atol=1e-12)
    noisy = even + loose[:, None] * np.random.default_rng(0).normal(0, 0.01, even.shape)
    out = smoothed(noisy, loose, 100.0)
    np.testing.assert_array_equal(out[~loose], noisy[~loose])
    assert np.abs(out - even)[loose].mean() < 0.7 * np.abs(noisy - even)[loose].mean()
