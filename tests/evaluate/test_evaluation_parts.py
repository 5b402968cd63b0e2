"""The parts of an evaluation, each against something that is not it: brute force, Pinocchio, plain sums."""

from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import ViewerError
from posekit.evaluate.joint_errors import best_of_frames, of_chosen, survivor_errors
from posekit.evaluate.scores import THRESHOLDS_METRES, correct_poses, correct_poses_score, reliability
from posekit.evaluate.survivor_certificate import certify
from posekit.evaluate.sweep import Sweep, facing, middles
from posekit.evaluate.true_branch import killers, limbs_right, true_branch
from posekit.measures import mpjpe, pa_mpjpe
from posekit.recovery import recover
from posekit.settings import EXACT_TOLERANCE, MEASURED_TOLERANCE
from posekit.skeleton import DOFS, JOINT, PARENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import Walker, random_postures, random_views
from posekit.synthesis.viewpoints import to_camera
from posekit.tree import enumerate_leaves
from posekit.validators import load_ranges
from posekit.viewer.plots import evaluation_plot as plots
from posekit.views.builtin import view_of

FIGURE = load_figure()
URDF = load_ranges("urdf")
UP = np.array([0.0, 0.0, 1.0])


def postures(n: int, seed: int = 0) -> np.ndarray:
    return np.asarray(
        FIGURE.forward_kinematics(random_postures(FIGURE, n, np.random.default_rng(seed)))[:, :14]
    )


def test_the_true_branch_is_the_leaf_that_is_the_truth() -> None:
    scene = random_views(FIGURE, 12, np.random.default_rng(1))
    frames = recover(view_of(scene)).frames
    lengths = np.array([0.0, *(FIGURE.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)])
    for k, frame in enumerate(frames):
        assert frame.batch is not None
        truth = np.full((frame.batch.leaves.n_frames, 14, 3), np.nan)
        truth[frame.index] = scene.joints_cam[k]
        true = true_branch(frame.batch.leaves, truth)
        assert true.known[frame.index]
        leaves, codes = enumerate_leaves(
            scene.camera,
            scene.joints_cam[k, 0],
            scene.image[k],
            parents=PARENTS,
            lengths=lengths,
            tolerance=1e-9,
        )
        nearest = np.linalg.norm(leaves - scene.joints_cam[k], axis=-1).max(axis=1)
        assert true.code[frame.index] in codes[nearest < 1e-6]
        assert f"{true.code[frame.index]:013b}" in frame.branches
        assert killers(frame.batch.leaves, true)[frame.index] == ""


def test_what_kills_the_truth_is_named() -> None:
    scene = random_views(FIGURE, 40, np.random.default_rng(3)).with_noise(2.0, np.random.default_rng(4))
    view = view_of(scene)
    frames = recover(view, tolerance=MEASURED_TOLERANCE).frames
    lost = 0
    for k, frame in enumerate(frames):
        if frame.batch is None:
            continue
        truth = np.full((frame.batch.leaves.n_frames, 14, 3), np.nan)
        truth[frame.index] = scene.joints_cam[k]
        true = true_branch(frame.batch.leaves, truth)
        code = int(true.code[frame.index])
        reason = killers(frame.batch.leaves, true)[frame.index]
        if code < 0:
            assert reason.startswith("lengths/")
            continue
        text = f"{code:013b}"
        expected = [branch.reason for branch in frame.pruned() if text.startswith(branch.branch)]
        assert [reason] == (expected or [""])
        assert (reason == "") == (text in frame.branches)
        lost += bool(reason)
    assert lost > 3


def test_an_unknown_joint_leaves_the_branch_unknown() -> None:
    scene = random_views(FIGURE, 2, np.random.default_rng(1))
    leaves = recover(view_of(scene)).frames[0].batch.leaves  # type: ignore[union-attr]
    truth = scene.joints_cam.copy()
    truth[0, 9] = np.nan
    assert true_branch(leaves, truth).known.tolist() == [False, True]


def test_limbs_are_right_by_their_own_two_choices() -> None:
    def code(**far: int) -> int:
        return sum(1 << (13 - JOINT[name]) for name, bit in far.items() if bit)

    true = np.array([code(right_elbow=1, left_knee=1)] * 5 + [-1])
    given = [
        code(right_elbow=1, left_knee=1),
        code(right_elbow=0, left_knee=1),
        code(right_elbow=1, right_wrist=1, left_knee=1, left_ankle=1),
        code(right_elbow=1, left_knee=1, right_hip=1, pelvis=1),
        code(right_wrist=1, left_wrist=1, right_ankle=1),
        0,
    ]
    shares = limbs_right(np.array(given), true)
    assert shares[:5].tolist() == [1.0, 0.75, 0.5, 1.0, 0.0]
    assert np.isnan(shares[5])


def test_errors_are_the_measures() -> None:
    rng = np.random.default_rng(0)
    truth = postures(20)
    joints = truth + 0.05 * rng.standard_normal(truth.shape)
    joints[3, 5] = truth[4, 6] = np.nan
    joints[7] = np.nan
    found = survivor_errors(joints, truth)
    assert np.allclose(found[:, 0], mpjpe(joints, truth).value, equal_nan=True, atol=1e-12)
    assert np.allclose(found[:, 2], pa_mpjpe(joints, truth).value, equal_nan=True, atol=1e-12)
    worst = np.array(
        [
            np.nanmax(row) if np.isfinite(row).any() else np.nan
            for row in np.linalg.norm(joints - truth, axis=-1)
        ]
    )
    assert np.allclose(found[:, 3], worst, equal_nan=True)
    moved = survivor_errors(joints + np.array([1.0, -2.0, 3.0]), truth)
    assert np.allclose(moved[:, [1, 2, 4]], found[:, [1, 2, 4]], equal_nan=True, atol=1e-9)
    assert np.isnan(found[7]).all()
    assert survivor_errors(np.empty((0, 14, 3)), np.empty((0, 14, 3))).shape == (0, 5)


def test_the_best_and_the_chosen_of_frames() -> None:
    errors = np.random.default_rng(0).random((7, 5))
    offsets = np.array([0, 3, 3, 7, 7])
    best = best_of_frames(errors, offsets)
    assert np.array_equal(best[0], errors[:3].min(axis=0))
    assert np.array_equal(best[2], errors[3:].min(axis=0))
    assert np.isnan(best[[1, 3]]).all()
    chosen = of_chosen(errors, offsets, np.array([2, -1, 0, -1]))
    assert np.array_equal(chosen[[0, 2]], errors[[2, 3]])
    assert np.isnan(chosen[[1, 3]]).all()
    assert np.isnan(best_of_frames(np.empty((0, 5)), np.zeros(3, dtype=int))).all()


def test_correct_poses_are_counted() -> None:
    rng = np.random.default_rng(0)
    worst = np.concatenate([rng.exponential(0.1, 200), [np.nan, np.inf, 0.0, 0.05]])
    curve = correct_poses(worst)
    with np.errstate(invalid="ignore"):
        assert np.array_equal(curve, [(worst < threshold).mean() for threshold in THRESHOLDS_METRES])
    assert (np.diff(curve) >= 0).all()
    # The curve every millimetre, by trapezoids, against the area itself.
    assert correct_poses_score(worst) == pytest.approx(np.trapezoid(curve, THRESHOLDS_METRES) * 1000, abs=0.6)
    assert correct_poses_score(np.zeros(3)) == 300.0
    assert correct_poses_score(np.full(3, np.nan)) == 0.0
    assert np.isnan(correct_poses_score(np.empty(0)))


def test_calibrated_probabilities_have_no_calibration_error() -> None:
    rng = np.random.default_rng(0)
    p = rng.random(200_000)
    fair = reliability(p, (rng.random(len(p)) < p).astype(float))
    sure = reliability(np.full(1000, 0.95), (np.arange(1000) < 500).astype(float))
    assert fair is not None and sure is not None
    assert fair.error < 0.01
    assert fair.frames.sum() == len(p)
    assert fair.brier == pytest.approx(1 / 6, abs=0.005)  # the mean of p (1 - p)
    assert sure.error == pytest.approx(0.45)
    assert sure.brier == pytest.approx(0.5 * 0.05**2 + 0.5 * 0.95**2)
    assert sure.frames.tolist() == [0] * 9 + [1000]
    assert np.isnan(sure.share[:9]).all()
    assert reliability(np.full(3, np.nan), np.ones(3)) is None
    assert reliability(np.array([1.0, 0.0, np.nan, 0.5]), np.array([1.0, 0.0, 1.0, np.nan])).error == 0  # type: ignore[union-attr]


def test_cameras_go_around_the_person() -> None:
    walker = Walker()
    joints = FIGURE.forward_kinematics(walker.configurations(np.linspace(0, 1, 7)))[:, :14]
    up = np.array([0.0, 1.0, 0.0])  # the walker's frame: x forward, y up, z right
    forward = facing(joints, up)
    assert np.allclose(np.linalg.norm(forward, axis=1), 1)
    assert (forward[:, 0] > 0.9).all()
    sweep = Sweep(yaws=(0.0, 90.0, 180.0), heights=(0.5, 2.0), distance=4.0)
    ground = float(joints[..., 1].min())
    middle = middles(joints)
    R, position = sweep.place(middle, forward, up, ground)
    assert R.shape == (6, 7, 3, 3)
    assert np.allclose(np.linalg.norm(position - middle, axis=-1), 4.0)
    assert np.allclose(position[..., 1] - ground, np.array([0.5, 2.0] * 3)[:, None])
    beside = position - middle
    assert (beside[:2, :, 0] > 3).all()  # ahead
    assert (beside[2:4, :, 2] < -3).all()  # on the left: z is right
    assert (beside[4:, :, 0] < -3).all()  # behind
    points = to_camera(np.broadcast_to(joints, (6, *joints.shape)), R, position)
    assert (points[..., 2] > 2).all()
    assert (points[:, :, 0, 1] < points[:, :, 12, 1]).all()  # heads up: y is down
    hips = points[:, :, JOINT["left_hip"], 0] - points[:, :, JOINT["right_hip"], 0]
    assert (hips[:2] > 0.1).all() and (hips[4:] < -0.1).all()  # seen from ahead, left is on the right


def test_facing_turns_with_the_body_and_is_known_of_any() -> None:
    joints = postures(50, seed=7)
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    assert np.allclose(facing(joints @ turn.T, UP), facing(joints, UP) @ turn.T, atol=1e-9)
    on_the_side = joints - joints[:, :1]
    left = on_the_side[:, 5] - on_the_side[:, 4]
    for k, axis in enumerate(left):
        found = facing(on_the_side[k : k + 1], axis / np.linalg.norm(axis))
        assert np.isfinite(found).all()
        assert np.linalg.norm(found) == pytest.approx(1)
        assert abs(found @ axis)[0] < 1e-9


def test_legal_bodies_are_certified() -> None:
    found = certify(postures(100), FIGURE, URDF, EXACT_TOLERANCE)
    lengths, ranges = found.violations
    assert not lengths.any() and not ranges.any()
    assert found.turned.max() < 1e-3


@pytest.mark.parametrize("segment", ["right_elbow-right_wrist", "left_hip-left_knee", "right_hip-left_hip"])
def test_a_wrong_length_is_found(segment: str) -> None:
    longer = FIGURE.scaled({segment: FIGURE.lengths[segment] + 0.05})
    joints = longer.forward_kinematics(random_postures(FIGURE, 20, np.random.default_rng(0)))[:, :14]
    found = certify(joints, FIGURE, None, MEASURED_TOLERANCE)
    assert found.violations[0].all()
    allowed = MEASURED_TOLERANCE.rigid if segment == "right_hip-left_hip" else MEASURED_TOLERANCE.tangent
    assert np.allclose(found.length, 0.05 - allowed, atol=1e-9)
    assert np.isnan(found.angle).all()


@pytest.mark.parametrize(
    "dof", ["left_elbow.flexion", "right_knee.flexion", "pelvis.flexion", "right_hip.abduction"]
)
def test_an_angle_outside_its_range_is_found(dof: str) -> None:
    q = random_postures(FIGURE, 1, np.random.default_rng(0))
    q[:, FIGURE.angle_index] = 0.3 * FIGURE.limits.upper + 0.7 * FIGURE.limits.lower
    place = FIGURE.angle_index[DOFS.index(dof)]
    beyond = np.radians(8)
    q[:, place] = FIGURE.limits.lower[DOFS.index(dof)] - beyond
    joints = FIGURE.forward_kinematics(q)[:, :14]
    found = certify(joints, FIGURE, URDF, MEASURED_TOLERANCE)
    assert found.violations[1].all()
    assert found.angle[0] > 0


def test_projected_ranges_are_judged_again() -> None:
    legal, table = postures(200), load_ranges("table1")
    ranges = certify(legal, FIGURE, table, MEASURED_TOLERANCE).violations[1]
    assert ranges.any() and not ranges.all()  # the figure's limits are wider than the book's


@pytest.mark.parametrize(
    "draw",
    [
        lambda: plots.plot_yaw(np.array([0.0]), {}),
        lambda: plots.plot_yaw(np.array([0.0]), {0.0: {"best": np.zeros(2)}}),
        lambda: plots.plot_survivors(np.empty(0), {}, np.empty(0)),
        lambda: plots.plot_correct_poses(np.zeros(3), {0.0: {"best": np.zeros(2)}}),
        lambda: plots.plot_reliability(np.zeros(3), np.zeros(2), np.zeros(3), error=0.1, event="it"),
    ],
)
def test_charts_of_nothing_are_refused(draw: object) -> None:
    pytest.importorskip("matplotlib")
    with pytest.raises(ViewerError, match="expected one"):
        draw()  # type: ignore[operator]


def test_charts_show_what_they_are_given() -> None:
    pytest.importorskip("matplotlib")
    yaw = np.array([0.0, 90.0, 180.0])
    figure = plots.plot_yaw(
        yaw, {0.0: {"best": yaw, "first": 2 * yaw}, 2.0: {"best": 3 * yaw, "first": 4 * yaw}}
    )
    lines = {line.get_gid(): line.get_ydata() for line in figure.axes[0].lines}
    assert set(lines) == {"0 best", "0 first", "2 best", "2 first"}
    assert np.array_equal(lines["2 first"], 4 * yaw)
    figure = plots.plot_reliability(
        np.array([0.2, 0.7]), np.array([0.1, 0.9]), np.array([3, 5]), error=0.125, event="it"
    )
    assert "ECE 0.125" in [line.get_label() for line in figure.axes[0].lines]
    bars: Any = figure.axes[1].patches
    assert [bar.get_height() for bar in bars] == [3, 5]
