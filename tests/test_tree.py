"""The exact tree: brute force over all 8192 leaves, a reason for every branch, checks asked early with few points."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.settings import EXACT, PHOTOGRAPH, RecoverSettings
from posekit.skeleton import JOINTS, PARENTS, POINT, SEGMENT_NAMES, SEGMENTS
from posekit.solver import engine
from posekit.synthesis import builtin_view, random_views
from posekit.tree import grow, steps
from posekit.validators import Judgement, PostureJudge
from posekit.validators.judge import early_checks

FIGURE = load_figure()
VIEW = builtin_view("seq2")
LENGTHS = np.array([{**FIGURE.lengths, **VIEW.lengths}[name] for name in SEGMENT_NAMES])
CAMERA = PinholeCamera(K=[[1200.0, 0, 640], [0, 1200.0, 480], [0, 0, 1]])
IMAGE = CAMERA.project(VIEW.truth)


class Apart:
    """Two joints are nearer, or farther, than allowed."""

    unit = "m"

    def __init__(self, a: str, b: str, lower: float = -np.inf, upper: float = np.inf) -> None:
        self.name, self.points = f"apart-{a}-{b}", (a, b)
        self.lower, self.upper = lower, upper
        self.asked: list[np.ndarray] = []

    def judge(self, points):
        self.asked.append(points)
        a, b = (points[:, POINT[name]] for name in self.points)
        value = np.linalg.norm(a - b, axis=1)[:, None]
        return SimpleNamespace(
            places=("distance",), value=value, lower=self.lower, upper=self.upper, tolerance=1e-6
        )


def checks():
    """Rigid parts, and four distances that cut limbs: alone, against the trunk, and against each other."""
    rigid = [
        Apart(JOINTS[pair[0]], JOINTS[pair[1]], LENGTHS[i], LENGTHS[i])
        for i, pair in enumerate(SEGMENTS)
        if i >= 13
    ]
    return [
        *rigid,
        Apart("right_shoulder", "right_wrist", lower=0.3),
        Apart("pelvis", "left_knee", upper=0.55),
        Apart("right_wrist", "left_knee", lower=0.25),
        Apart("right_ankle", "left_ankle", lower=0.2),
    ]


def brute_force(frame, asked):
    """Place and judge all 8192 leaves; codes of the survivors with their joints."""
    rays = np.concatenate([(IMAGE[frame] - [640, 480]) / 1200.0, np.ones((14, 1))], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    kept = {}
    bits = np.array(list(itertools.product((0, 1), repeat=13)))
    joints = np.full((len(bits), 19, 3), np.nan)
    joints[:, 0] = VIEW.truth[frame, 0]
    for j in range(1, 14):
        start = joints[:, PARENTS[j]]
        along = start @ rays[j]
        half = LENGTHS[j - 1] ** 2 - ((start - along[:, None] * rays[j]) ** 2).sum(axis=1)
        root = np.sqrt(np.where(half >= 0, half, np.nan))
        joints[:, j] = (along + np.where(bits[:, j - 1], root, -root))[:, None] * rays[j]
    good = np.isfinite(joints[:, :14]).all(axis=(1, 2))
    for check in asked:
        found = check.judge(joints)
        good &= ((found.value >= found.lower - 1e-6) & (found.value <= found.upper + 1e-6)).all(axis=1)
    for row in np.flatnonzero(good):
        kept["".join(map(str, bits[row]))] = joints[row, :14]
    return kept


@pytest.fixture(scope="module")
def trees():
    return grow(CAMERA, IMAGE, VIEW.truth[:, 0], LENGTHS, checks())


@pytest.mark.parametrize("frame", range(len(VIEW)))
def test_survivors_are_those_of_brute_force(trees, frame):
    expected = brute_force(frame, checks())
    own = np.flatnonzero(trees.frame == frame)
    assert [trees.branches[k] for k in own] == sorted(expected)
    assert len(expected) > 1
    for k in own:
        np.testing.assert_allclose(trees.joints[k], expected[trees.branches[k]], atol=1e-7)


def test_truth_survives(trees):
    for frame, truth in enumerate(VIEW.truth):
        apart = np.linalg.norm(trees.joints[trees.frame == frame] - truth, axis=2).max(axis=1)
        assert apart.min() < 1e-6


@pytest.mark.parametrize("frame", range(len(VIEW)))
def test_every_leaf_is_lost_once_or_survives(trees, frame):
    count = np.zeros(8192, dtype=int)
    count[trees.code[trees.frame == frame]] += 1
    by_reason: dict[str, int] = {}
    for branch, joint, reason, value, lower, upper, unit in trees.pruned(frame):
        rest = 13 - len(branch)
        count[int(branch, 2) << rest : (int(branch, 2) + 1) << rest] += 1
        by_reason[reason] = by_reason.get(reason, 0) + (1 << rest)
        assert joint == JOINTS[len(branch)]
        assert unit == "m"
        assert not lower - 1e-9 <= value <= upper + 1e-9 or reason.startswith(("coincident", "behind"))
    np.testing.assert_array_equal(count, 1)
    assert by_reason == trees.rejected[frame]


def test_levels_count_beginnings(trees):
    for frame in range(len(VIEW)):
        codes = [code for code, k in zip(trees.branches, trees.frame, strict=True) if k == frame]
        assert trees.levels[frame].tolist() == [len({code[:level] for code in codes}) for level in range(14)]


def test_checks_are_asked_early_about_few_postures():
    asked = checks()
    grow(CAMERA, IMAGE[:1], VIEW.truth[:1, 0], LENGTHS, asked)
    for check in asked:
        for points in check.asked:
            placed = np.isfinite(points).all(axis=2)
            assert [k for k in range(19) if placed[:, k].any()] == sorted(
                POINT[name] for name in check.points
            )
    # The right arm of one torso has four positions of its wrist, whatever the other limbs do.
    arm = next(check for check in asked if check.points == ("right_shoulder", "right_wrist"))
    assert sum(map(len, arm.asked)) <= 16


def test_a_frame_alone_is_as_among_others(trees):
    alone = grow(CAMERA, IMAGE[2:3], VIEW.truth[2:3, 0], LENGTHS, checks())
    np.testing.assert_array_equal(alone.joints, trees.joints[trees.frame == 2])
    assert alone.rejected[0] == trees.rejected[2]


def test_hidden_joints_end_their_limbs():
    image = IMAGE.copy()
    image[:, JOINTS.index("left_elbow")] = np.nan
    found = grow(CAMERA, image, VIEW.truth[:, 0], LENGTHS, checks())
    hidden = [JOINTS.index(name) for name in ("left_elbow", "left_wrist")]
    assert np.isnan(found.joints[:, hidden]).all()
    assert np.isfinite(np.delete(found.joints, hidden, axis=1)).all()
    for frame in range(len(VIEW)):
        assert sum(found.rejected[frame].values()) + (found.frame == frame).sum() == 8192
        # One branch of a hidden joint stands for both.
        assert {found.branches[k][6] for k in np.flatnonzero(found.frame == frame)} == {"0"}
        assert found.rejected[frame]["missing/left_elbow"] > 0


def test_a_segment_too_short_is_tolerated():
    lengths = LENGTHS.copy()
    elbow = JOINTS.index("right_elbow")
    lengths[elbow - 1] = 0.05
    found = grow(CAMERA, IMAGE, VIEW.truth[:, 0], lengths, [])
    frame = next(k for k in range(len(VIEW)) if not (found.frame == k).any())
    loose = grow(CAMERA, IMAGE, VIEW.truth[:, 0], lengths, [], tolerance=0.5)
    assert 0 < loose.length_residual[loose.frame == frame].max() <= 0.5


def test_checks_of_the_head_are_not_asked_without_one():
    class Nose:
        name, unit, points = "nose", "m", ("neck", "nose")

        def judge(self, points):
            height = points[:, POINT["nose"]] @ [0.0, -1.0, 0.0] - points[:, 0] @ [0.0, -1.0, 0.0]
            assert np.isfinite(height).all()
            return SimpleNamespace(
                places=("nose",), value=height[:, None], lower=0.1, upper=9.0, tolerance=0.0
            )

    head = np.full((len(VIEW), 5, 3), np.nan)
    head[0] = VIEW.truth[0, 0] + [0.0, 0.2, 0.0]  # below the neck
    head[1] = VIEW.truth[1, 0] + [0.0, -0.2, 0.0]
    rigid = checks()[:4]
    found = grow(CAMERA, IMAGE, VIEW.truth[:, 0], LENGTHS, [Nose(), *rigid], head=head)
    assert found.rejected[0] == {"nose/nose": 8192}
    assert (np.bincount(found.frame, minlength=5)[1:] > 0).all()


def test_scaled_orthographic_leaves_come_in_mirror_pairs():
    camera = ScaledOrthographicCamera(scale=100.0)
    truth = VIEW.truth[:2] - VIEW.truth[:2, :1]
    found = grow(camera, camera.project(truth), np.zeros((2, 3)), LENGTHS, checks())
    for frame in range(2):
        joints = found.joints[found.frame == frame]
        mirrored = joints * [1.0, 1.0, -1.0]
        apart = np.linalg.norm(joints[:, None] - mirrored[None], axis=3).max(axis=2)
        assert apart.min(axis=1).max() < 1e-6
        assert np.linalg.norm(joints - truth[frame], axis=2).max(axis=1).min() < 1e-6


class FeetApart:
    """The ankles are nearer than 20 cm."""

    name, unit, reads, points = "feet-apart", "m", ("joints",), ("right_ankle", "left_ankle")

    def judge(self, body):
        apart = np.linalg.norm(body.joints[:, 12] - body.joints[:, 13], axis=1)
        return Judgement(["ankles"], apart, lower=0.2)


@pytest.mark.skipif(steps.compiled is None, reason="no compiled tree")
@pytest.mark.parametrize(
    ("changes", "tolerance"),
    [
        ({}, EXACT),
        ({"ranges": "urdf"}, EXACT),
        ({"ranges": "table1"}, EXACT),
        ({"contact_margin": 0.02, "checks": ("rigid-parts", "collision", FeetApart)}, EXACT),
        ({}, PHOTOGRAPH),
    ],
)
def test_compiled_tree_and_reference_agree(monkeypatch, changes, tolerance):
    """Survivors, reasons, values and bounds of the built-in checks, of noisy points too."""
    rng = np.random.default_rng(5)
    view = random_views(30, rng)
    settings = RecoverSettings(**changes)
    judge = PostureJudge(FIGURE, settings, tolerance, np.array([0.0, -1.0, 0.0]))
    image = view.image + (rng.normal(0, 2, view.image.shape) if tolerance is PHOTOGRAPH else 0.0)
    head = np.full((30, 5, 3), np.nan)
    head[::3] = view.truth[::3, :1] + FIGURE.neutral_points[14:]
    lengths = [FIGURE.lengths[name] for name in SEGMENT_NAMES]

    def grown():
        return grow(
            view.camera,
            image,
            view.truth[:, 0],
            lengths,
            early_checks(settings),
            judge=judge,
            head=head,
            tolerance=tolerance.tangent,
        )

    fast = grown()
    monkeypatch.setattr(steps, "compiled", None)
    monkeypatch.setattr(engine, "compiled", None)
    slow = grown()
    assert len(fast) > 30
    np.testing.assert_array_equal(fast.frame, slow.frame)
    np.testing.assert_array_equal(fast.code, slow.code)
    assert fast.rejected == slow.rejected
    for frame in range(30):
        one, other = (sorted(each.pruned(frame)) for each in (fast, slow))
        assert [row[:3] for row in one] == [row[:3] for row in other]
        np.testing.assert_allclose([row[3:6] for row in one], [row[3:6] for row in other], atol=1e-9)
