"""Angles of shoulders and hips do not jump between two ways to say the same, and say the same as before."""

from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.body import load_figure
from posekit.body.steady_angles import BALL_JOINTS, angles_near, steady_angles
from posekit.formats.held_postures import HeldPostures
from posekit.formats.motion import Motion, write_motion
from posekit.geometry import Array, other_branch
from posekit.skeleton import DOFS, JOINTS
from posekit.validation.reading import StatedMotion, read_postures_of
from posekit.viewer.plots.angle_tracks import angle_tracks
from posekit.viewer.scene.drawn_subject import subject_of

FIGURE = load_figure()
LOWER, UPPER = FIGURE.limits.lower, FIGURE.limits.upper
SHOULDER = [DOFS.index(f"right_shoulder.{name}") for name in ("flexion", "abduction", "rotation")]


def swinging(frames: int = 60) -> Array:
    """Return an arm that swings backward, beyond the figure's range of flexion, and forward again (T, 22)."""
    angles = np.zeros((frames, len(DOFS)))
    angles[:, SHOULDER[0]] = np.radians(-30 - 25 * np.sin(np.linspace(0, 6 * np.pi, frames)))
    angles[:, SHOULDER[1]] = np.radians(60)
    angles[:, SHOULDER[2]] = np.radians(-70)
    angles[:, DOFS.index("right_elbow.flexion")] = np.radians(60)
    return angles


def points_of(angles: Array) -> Array:
    q = np.zeros((len(angles), FIGURE.model.nq))
    q[:, 6] = 1.0
    q[:, FIGURE.angle_index] = angles
    return FIGURE.forward_kinematics(q)


def test_an_arm_that_swings_out_of_its_range_does_not_jump() -> None:
    wanted = swinging()
    found = FIGURE.inverse_kinematics(points_of(wanted))[:, FIGURE.angle_index]
    assert (
        np.abs(np.diff(found, axis=0)).max() > 2.0
    )  # frame by frame the other way is taken beyond the limit
    steady = steady_angles(found, LOWER, UPPER)
    np.testing.assert_allclose(steady[:, SHOULDER], wanted[:, SHOULDER], rtol=0, atol=1e-6)


def test_postures_stay_as_they_are(rng: np.random.Generator) -> None:
    angles = rng.uniform(LOWER, UPPER, (40, len(DOFS)))
    steady = steady_angles(angles, LOWER, UPPER)
    np.testing.assert_allclose(points_of(steady), points_of(angles), rtol=0, atol=1e-9)
    assert (steady != angles).any()
    others = [k for k in range(len(DOFS)) if k not in np.concatenate(BALL_JOINTS)]
    np.testing.assert_array_equal(steady[:, others], angles[:, others])


def test_no_other_sequence_has_less_of_both(rng: np.random.Generator) -> None:
    angles = rng.uniform(LOWER, UPPER, (8, len(DOFS)))
    low, high = LOWER[SHOULDER], UPPER[SHOULDER]
    turn = (low + high) / 2
    given = angles[:, SHOULDER]
    both = np.stack([given, other_branch(given)], axis=1)
    both -= 2 * np.pi * np.floor((both - turn + np.pi) / (2 * np.pi))

    def cost(one: Array) -> float:
        outside = np.maximum(np.maximum(low - one, one - high), 0.0).max(axis=1).sum()
        crossed = (np.abs(one[:, 1]) > np.pi / 2).sum()
        return float(np.abs(np.diff(one, axis=0)).max(axis=1).sum() + 0.1 * outside + 0.01 * crossed)

    choices = (np.arange(256)[:, None] >> np.arange(8)) & 1
    least = min(cost(both[np.arange(8), choice]) for choice in choices)
    assert cost(steady_angles(angles, LOWER, UPPER)[:, SHOULDER]) == pytest.approx(least, abs=1e-9)


def test_frames_that_are_not_known_stay_so() -> None:
    angles = swinging()
    angles[10:20, SHOULDER[2]] = np.nan
    found = steady_angles(angles, LOWER, UPPER)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(angles))
    np.testing.assert_allclose(found[20:, SHOULDER], swinging()[20:, SHOULDER], rtol=0, atol=1e-9)


def test_angles_are_said_as_near_ones_are() -> None:
    wanted = swinging()
    other = wanted.copy()
    other[:, SHOULDER] = other_branch(wanted[:, SHOULDER]) + 2 * np.pi
    np.testing.assert_allclose(angles_near(other, wanted[0]), wanted, rtol=0, atol=1e-9)
    unknown = np.full(len(DOFS), np.nan)
    np.testing.assert_array_equal(angles_near(other, unknown), other)


@pytest.mark.parametrize("name", ["angles.mot", "a plot"])
def test_curves_of_a_motion_do_not_jump(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    points = points_of(swinging())[:, :14]
    time = np.arange(len(points)) / 30
    write_motion("swing.npz", Motion(points=points, names=JOINTS, time=time, rate=30.0, up="+z"))
    if name == "angles.mot":
        posekit.convert("swing.npz", name)
        rows = [line.split("\t") for line in Path(name).read_text().splitlines()]
        head = next(k for k, row in enumerate(rows) if row[0] == "time")
        table = {column: [float(row[k]) for row in rows[head + 1 :]] for k, column in enumerate(rows[head])}
        found = np.array([table[f"right_shoulder_{part}"] for part in ("flexion", "abduction", "rotation")])
    else:
        held = read_postures_of(Path("swing.npz"), StatedMotion()).postures
        assert isinstance(held, HeldPostures)
        drawn = subject_of(held)
        names = [DOFS[k] for k in SHOULDER]
        tracks = angle_tracks(drawn.frames, drawn.frames, drawn.figure, names, limits={})
        found = np.array([track.value for track in tracks])
    assert np.abs(np.diff(found, axis=1)).max() < 20.0
