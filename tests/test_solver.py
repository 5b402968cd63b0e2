"""The solver: same steps in both engines, every posture behind a noisy view, sizes, hidden joints, covariances."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from importlib.resources import files
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.body import load_figure
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.geometry import pa_mpjpe
from posekit.settings import EXACT, ValidateSettings
from posekit.skeleton import JOINTS, SEGMENT_NAMES, SEGMENTS
from posekit.solver import Limits, Problem, backend, engine, reference, solve
from posekit.solver.limits import ENDS, MIDDLES, STARTS
from posekit.solver.modes import KNOWN
from posekit.solver.problem import EXACT_ROOT_METRES
from posekit.solver.starts import DEPTHS, limb_starts, trunk_starts
from posekit.tree import grow
from posekit.validators.judge import POSTURE_CHECKS, PostureJudge

FIGURE = load_figure()
LENGTHS = np.array([FIGURE.lengths[name] for name in SEGMENT_NAMES])
OWN = np.degrees(np.stack([FIGURE.limits.lower, FIGURE.limits.upper], axis=1))
TABLE = tomllib.loads((files("posekit.urdf") / "ranges" / "anatomical.toml").read_text())
PELVIS, HIPS = FIGURE.neutral_points[3], FIGURE.neutral_points[4:6]
LIMITS = Limits.of(TABLE, OWN, above_hips=np.linalg.norm(HIPS.mean(axis=0) - PELVIS))
CAMERA = PinholeCamera(K=[[1e3, 0, 640], [0, 1e3, 360], [0, 0, 1]])


def judged(joints, ranges="anatomical"):
    """Judge postures (N, 14, 3) by the check of joint ranges."""
    return PostureJudge(FIGURE, ValidateSettings(ranges=ranges), EXACT)(POSTURE_CHECKS["joint-range"], joints)


def legal_postures(count, rng):
    """Random postures (count, 14, 3) within the anatomical ranges, turned about the vertical, 4 m before the camera."""
    q = np.tile(FIGURE.neutral, (4000, 1))
    q[:, FIGURE.angle_index] = rng.uniform(0.7 * FIGURE.limits.lower, 0.7 * FIGURE.limits.upper, (4000, 22))
    joints = FIGURE.forward_kinematics(q)[:, :14]
    joints = joints[~judged(joints).violated.any(axis=1)][:count]
    down = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    turn = Rotation.from_euler("y", rng.uniform(0, 360, (count, 1)), degrees=True)
    about = joints @ down.T - (joints @ down.T).mean(axis=1, keepdims=True)
    return np.stack([R.apply(one) for R, one in zip(turn, about, strict=True)]) + np.array([0.2, 0.1, 4.0])


TRUTH = legal_postures(6, np.random.default_rng(5))
IMAGE = CAMERA.project(TRUTH)
NOISE = np.random.default_rng(6).normal(size=IMAGE.shape)
compiled = pytest.mark.skipif(backend() == "reference", reason="the compiled solver is not built")


def observed(pixels=2.0, image=None, camera=CAMERA, noise=True, **known):
    image = IMAGE + noise * pixels * NOISE if image is None else image
    known = {"root": TRUTH[:, 0], "limits": LIMITS, **known}
    return Problem.seen(camera, image, pixels, lengths=LENGTHS, **known)


def off(joints, other):
    """Largest distance of a joint, relative to the neck."""
    apart = (joints - joints[..., :1, :]) - (other - other[..., :1, :])
    return np.linalg.norm(apart, axis=-1).max(axis=-1)


def starts(problem, per_frame=4, spread=0.08):
    rng = np.random.default_rng(1)
    frame = np.repeat(np.arange(len(problem)), per_frame)
    joints = TRUTH[frame] + rng.normal(0, spread, (len(frame), 14, 3))
    return frame, np.hstack([joints.reshape(-1, 42), rng.normal(0, 0.02, (len(frame), 1))])


PROBLEMS = {
    "exact lengths": {},
    "open size": {"length_deviation": 0.03, "size_deviation": 0.05, "root": None},
    "robust": {"robust": True, "length_deviation": 0.05},
    "no limits": {"limits": None},
    "figure's own limits": {"limits": Limits.of(None, OWN)},
    "pelvis between hips": {"limits": Limits.of(TABLE, OWN, pelvis_between_hips=True)},
}


@compiled
@pytest.mark.parametrize("parts", [1, 2, 4, 8, 16, 31])
@pytest.mark.parametrize("kind", PROBLEMS)
def test_engines_take_the_same_steps(kind, parts):
    problem = observed(**PROBLEMS[kind])
    frame, x = starts(problem)
    limit = np.full(len(frame), np.inf)
    for steps in (1, 4):
        mine, chi2, _ = engine.descend(problem, frame, x, parts, most=steps)
        first = np.full(len(frame), reference.FIRST_DAMPING)
        other, value, _ = reference.descend(problem, frame, x, parts, steps, limit, first)
        np.testing.assert_allclose(mine, other, atol=1e-9 * 10 ** (2 * (steps > 1)))
        np.testing.assert_allclose(chi2, value, rtol=1e-7, atol=1e-9)


@compiled
@pytest.mark.parametrize("hidden", [(), ("left_wrist", "right_ankle")])
def test_engines_find_the_same_modes(monkeypatch, hidden):
    image = IMAGE + 2.0 * NOISE
    image[:2, [JOINTS.index(name) for name in hidden]] = np.nan
    problem = observed(image=image, length_deviation=0.02, size_deviation=0.02)
    fast = solve(problem)
    evidence, covariance = fast.log_evidence, fast.covariance()
    monkeypatch.setattr(engine, "compiled", None)
    engine._warn_once.cache_clear()
    with pytest.warns(UserWarning, match="compiler"):
        slow = solve(problem)
    assert backend() == "reference"
    np.testing.assert_array_equal(fast.frame, slow.frame)
    np.testing.assert_allclose(fast.chi2, slow.chi2, atol=1e-6)
    nearest = [
        off(slow.joints[slow.frame == f], j).min() for f, j in zip(fast.frame, fast.joints, strict=True)
    ]
    assert max(nearest) < 1e-6
    np.testing.assert_allclose(covariance, fast.covariance(), rtol=1e-5, atol=1e-9)
    H = reference.information(problem, fast.frame, fast.x, KNOWN)
    np.testing.assert_allclose(evidence, -fast.chi2 / 2 - np.linalg.slogdet(H)[1] / 2, atol=1e-3)


@pytest.mark.parametrize("kind", PROBLEMS)
def test_gradient_is_that_of_chi2(kind):
    problem = observed(**PROBLEMS[kind])
    frame, x = starts(problem, 1)
    here = reference.evaluate(problem, frame, x, 31)
    assert np.isfinite(here.chi2).all()
    for step in 1e-6 * np.random.default_rng(4).normal(size=(8, 43)):
        step[42] *= problem.sized[0]
        up, down = (reference.evaluate(problem, frame, x + s * step, 31).chi2 for s in (1, -1))
        slope = (up - down) / 4e-6  # half of the derivative, as the normal equations have it
        np.testing.assert_allclose(
            here.gradient @ step / 1e-6, slope, atol=2e-3 * np.abs(here.gradient).max()
        )


def test_every_mode_is_a_minimum_that_fits():
    problem = observed(length_deviation=0.02, size_deviation=0.02)
    modes = solve(problem)
    rng = np.random.default_rng(2)
    for _ in range(20):
        moved = modes.x + rng.normal(0, 1e-3, modes.x.shape)
        there = reference.evaluate(problem, modes.frame, moved, 31)
        assert (there.chi2 > modes.chi2 - 0.02).all()
    residuals = modes.residuals()
    assert all((value < 6).all() for value in residuals.values())
    again = sum(value**2 for name, value in residuals.items() if not name.startswith("limit"))
    limits = [value for name, value in residuals.items() if name.startswith("limit")]
    free = np.max(limits, axis=0) == 0
    np.testing.assert_allclose(again[free], modes.chi2[free], atol=1e-6)


def test_exact_points_give_the_truth():
    modes = solve(observed(0.05, noise=False))
    nearest = [off(modes.joints[modes.frame == frame], truth).min() for frame, truth in enumerate(TRUTH)]
    assert np.median(nearest) < 0.01
    assert max(nearest) < 0.05  # a segment at a right angle to its ray


class Rigid:
    """A distance inside torso or hips is not the figure's."""

    name, unit = "rigid", "m"

    def __init__(self, k):
        self.pair, self.length = SEGMENTS[k], LENGTHS[k]
        self.points = tuple(JOINTS[joint] for joint in self.pair)

    def judge(self, points):
        value = np.linalg.norm(points[:, self.pair[0]] - points[:, self.pair[1]], axis=1)[:, None]
        return SimpleNamespace(
            places=("length",), value=value, lower=self.length, upper=self.length, tolerance=1e-6
        )


@pytest.mark.parametrize("pixels", [0.2, 1.0])
def test_every_legal_leaf_of_the_exact_tree_is_a_mode(pixels):
    tree = grow(CAMERA, IMAGE, TRUTH[:, 0], LENGTHS, [Rigid(k) for k in range(13, 17)])
    legal = np.flatnonzero(~judged(tree.joints).violated.any(axis=1))
    assert len(legal) > 100
    modes = solve(observed(pixels, noise=False))
    for k in legal:
        assert off(modes.joints[modes.frame == tree.frame[k]], tree.joints[k]).min() < 0.05


def test_noisy_points_give_the_truth_within_its_covariance():
    modes = solve(observed(2.0))
    covariance = np.einsum("njajb->njab", modes.covariance().reshape(-1, 14, 3, 14, 3))
    distance = []
    for frame, truth in enumerate(TRUTH):
        rows = np.flatnonzero(modes.frame == frame)
        d = modes.joints[rows] - truth
        square = np.einsum("njk,njkl,njl->nj", d, np.linalg.inv(covariance[rows] + 1e-8 * np.eye(3)), d)
        distance.append(square.max(axis=1).min())
    assert max(distance) < 16.3  # 99.9 % of a Gaussian in three dimensions


def test_a_larger_deviation_loses_no_posture():
    few, many = (solve(observed(pixels, image=IMAGE + NOISE)) for pixels in (1.0, 3.0))
    for frame, joints in zip(few.frame, few.joints, strict=True):
        assert off(many.joints[many.frame == frame], joints).min() < 0.15


def test_a_frame_alone_is_as_among_others():
    problem = observed(length_deviation=0.03, size_deviation=0.03, root=None)
    together = solve(problem)
    for k in (0, 3, 5):
        alone = solve(problem.take(np.array([k])))
        np.testing.assert_array_equal(alone.x, together.x[together.frame == k])


def test_most_keeps_the_best():
    every, few = solve(observed()), solve(observed(), most=2)
    assert (np.bincount(few.frame) <= 2).all()
    for frame in range(len(TRUTH)):
        np.testing.assert_array_equal(few.chi2[few.frame == frame], every.chi2[every.frame == frame][:2])


def test_size_of_the_body_is_found_where_the_root_is_known():
    problem = Problem.seen(
        CAMERA,
        IMAGE + NOISE,
        1.0,
        lengths=LENGTHS * 1.06,
        size_deviation=0.1,
        length_deviation=0.005,
        root=TRUTH[:, 0],
        limits=LIMITS,
    )
    best = [modes.size[0] for modes in (solve(problem.take(np.array([k]))) for k in range(len(TRUTH)))]
    np.testing.assert_allclose(best, -np.log(1.06), atol=0.03)


def test_unknown_depth_leaves_limbs_apart():
    modes = solve(observed(2.0, root=None, length_deviation=0.03, size_deviation=0.05))
    for frame, truth in enumerate(TRUTH):
        joints = modes.joints[modes.frame == frame]
        assert pa_mpjpe(joints, np.broadcast_to(truth, joints.shape)).min() < 0.05
        apart = np.array([off(joints, one) for one in joints])
        assert (apart[~np.eye(len(joints), dtype=bool)] > 0.01).all()


def test_lens_and_ideal_camera_give_the_same_modes():
    lens = PinholeCamera(K=CAMERA.K, distortion=[-0.2, 0.05, 1e-3, -1e-3, 0.0])
    ideal = PinholeCamera(K=CAMERA.K)
    rays = ideal.normalize(IMAGE + NOISE)
    seen = lens.project(np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1))
    straight, bent = (
        solve(observed(2.0, image=image, camera=c)) for image, c in ((IMAGE + NOISE, ideal), (seen, lens))
    )
    for frame, joints, chi2 in zip(straight.frame, straight.joints, straight.chi2, strict=True):
        assert chi2 > 8 or off(bent.joints[bent.frame == frame], joints).min() < 0.1


def test_photograph_gives_the_truth_and_its_scale():
    camera = ScaledOrthographicCamera(scale=130.0)
    truth = TRUTH - TRUTH[:, :1]
    image = ScaledOrthographicCamera(scale=123.0).project(truth) + 0.3 * NOISE
    problem = Problem.seen(
        camera, image, 0.5, lengths=LENGTHS, size_deviation=0.2, length_deviation=0.01, limits=LIMITS
    )
    modes = solve(problem)
    for frame, one in enumerate(truth):
        rows = np.flatnonzero(modes.frame == frame)
        found = modes.joints[rows] * np.exp(-modes.size[rows])[:, None, None]
        nearest = off(found, one).argmin()
        assert off(found[nearest], one) < 0.12
        assert abs(np.exp(modes.size[rows[nearest]]) * 130.0 / 123.0 - 1) < 0.05


@pytest.mark.parametrize(
    ("hidden", "beyond"),
    [([6], 8), ([11], 13), ([9], None), ([10, 12], None), ([4], 10), ([3], 12), ([3, 4], None), ([1], 8)],
)
def test_hidden_joints_are_near_a_mode_and_what_is_beyond_is_used(hidden, beyond):
    image = IMAGE + NOISE
    image[:, hidden] = np.nan
    problem = observed(1.0, image=image)
    modes = solve(problem)
    seen = [j for j in range(14) if j not in hidden]
    for frame, truth in enumerate(TRUTH):
        joints = modes.joints[modes.frame == frame]
        assert np.linalg.norm(joints - truth, axis=2)[:, hidden].max(axis=1).min() < 0.3
        pixels = np.linalg.norm(CAMERA.project(joints[:, seen]) - image[frame, seen], axis=-1)
        assert pixels.max() < 6
        if beyond is not None:
            assert np.linalg.norm(joints[:, beyond] - truth[beyond], axis=1).min() < 0.2


def test_a_gross_error_of_a_detector_costs_one_point():
    image = IMAGE + NOISE
    image[:, 8] += [150.0, -80.0]
    strict, robust = (
        solve(observed(2.0, image=image, length_deviation=0.02, robust=robust)) for robust in (False, True)
    )
    assert len(np.unique(robust.frame)) == len(TRUTH) > len(np.unique(strict.frame))


def test_residuals_of_the_callers_own_pull():
    def hands_together(joints):
        apart = np.linalg.norm(joints[:, 8] - joints[:, 9], axis=1)
        return np.maximum(apart - 0.3, 0.0)[:, None] / 0.01

    problem = observed(3.0, length_deviation=0.03, size_deviation=0.03, root=None)
    free, pulled = solve(problem), solve(problem, pull=hands_together, max_chi2=60.0)
    assert (hands_together(free.joints) > 3).any()
    assert len(pulled)
    assert (hands_together(pulled.joints) < 6).all()


def test_nothing_seen_leaves_postures_of_the_known_lengths_at_the_root():
    modes = solve(observed(image=np.full_like(IMAGE[:1], np.nan), root=TRUTH[:1, 0]))
    assert len(modes) > 100 and off(modes.joints[:1], modes.joints).max() > 0.5
    for k, (a, b) in enumerate(SEGMENTS):
        np.testing.assert_allclose(
            np.linalg.norm(modes.joints[:, a] - modes.joints[:, b], axis=1), LENGTHS[k]
        )
    np.testing.assert_allclose(modes.joints[:, 0], np.broadcast_to(TRUTH[0, 0], (len(modes), 3)), atol=1e-9)


def standing(**angles):
    """Return a posture whose right limbs have these angles of the figure, degrees."""
    joints = FIGURE.neutral_points[:14].copy()
    for start, middle, end, signs, joint, hinge in (
        (1, 6, 8, (-1, -1, 1, -1), "shoulder", "elbow"),
        (4, 10, 12, (-1, -1, 1, 1), "hip", "knee"),
    ):
        flexion, abduction, rotation = (
            angles.get(f"{joint}_{k}", 0.0) for k in ("flexion", "abduction", "rotation")
        )
        ball = Rotation.from_euler("YXZ", np.array([flexion, abduction, rotation]) * signs[:3], degrees=True)
        bend = ball * Rotation.from_euler("Y", angles.get(hinge, 0.0) * signs[3], degrees=True)
        upper, lower = (np.linalg.norm(joints[b] - joints[a]) for a, b in ((start, middle), (middle, end)))
        joints[middle] = joints[start] + upper * ball.apply([0, 0, -1])
        joints[end] = joints[middle] + lower * bend.apply([0, 0, -1])
    return joints


@pytest.mark.parametrize(
    "angles",
    [
        {"hip_flexion": 60.0, "hip_abduction": 20.0, "hip_rotation": -30.0, "knee": 80.0},
        {"hip_flexion": -10.0, "hip_abduction": -15.0, "hip_rotation": 20.0, "knee": 40.0},
        {"shoulder_flexion": 70.0, "shoulder_abduction": 30.0, "shoulder_rotation": -20.0, "elbow": 90.0},
        {"shoulder_flexion": -20.0, "shoulder_abduction": 100.0, "shoulder_rotation": 50.0, "elbow": 30.0},
    ],
)
def test_the_angles_of_the_figure_are_read(angles):
    found = judged(standing(**angles)[None], "urdf")
    for name, size in angles.items():
        k = found.places.index(f"right_{name.replace('_', '.') if '_' in name else f'{name}.flexion'}")
        assert found.value[0, k] == pytest.approx(size, abs=1e-9)
        assert found.lower[0, k] <= size <= found.upper[0, k]


@pytest.mark.parametrize(
    ("angles", "name", "legal"),
    [
        ({"hip_flexion": 125.0, "knee": 90.0}, "hip.flexion", True),
        ({"hip_flexion": 125.0, "knee": 0.0}, "hip.flexion", False),
        ({"shoulder_flexion": 150.0, "elbow": 20.0}, "shoulder.elevation", True),
        ({"shoulder_flexion": -150.0, "elbow": 20.0}, "shoulder.elevation", False),
        ({"elbow": 170.0}, "elbow.flexion", False),
        ({"knee": 150.0, "hip_flexion": 100.0}, "knee.flexion", True),
        ({"knee": -20.0}, "knee.flexion", False),
    ],
)
def test_couplings_decide(angles, name, legal):
    found = judged(standing(**angles)[None])
    outside = {place for place, one in zip(found.places, found.violated[0], strict=True) if one}
    assert (
        not {place for place in outside if place.startswith("right_")}
        if legal
        else f"right_{name}" in outside
    )


def test_a_table_with_too_many_couplings_is_refused():
    with pytest.raises(InputError, match="coupling"):
        Limits.of({**TABLE, "coupling": TABLE["coupling"] * 2}, OWN)


def test_limits_pull_exactly_where_the_check_finds_something():
    rng = np.random.default_rng(3)
    joints = np.concatenate(
        [TRUTH + rng.normal(0, s, TRUTH.shape) for s in (0.0, 0.05, 0.15) for _ in range(20)]
    )
    problem = observed()
    inside = ~judged(joints).violated.any(axis=1)
    frame = np.arange(len(joints)) % len(TRUTH)
    x = np.hstack([joints.reshape(-1, 42), np.zeros((len(joints), 1))])
    with_limits, without = (
        reference.evaluate(replace(problem, limits=limits), frame, x, 31).chi2 for limits in (LIMITS, None)
    )
    np.testing.assert_array_equal(with_limits - without < 1e-6, inside)
    assert inside.any()
    assert not inside.all()


@pytest.mark.parametrize(
    "camera", [CAMERA, ScaledOrthographicCamera(scale=130.0)], ids=["pinhole", "orthographic"]
)
@pytest.mark.parametrize("rooted", [True, False])
def test_starts_lie_on_the_rays_at_the_lengths(camera, rooted):
    """Every start projects onto the image; segments have their lengths, or end at the foot of the start on the ray."""
    image = camera.project(TRUTH)
    problem = observed(image=image, camera=camera, root=TRUTH[:, 0] if rooted else None)
    frame, trunk = trunk_starts(problem)
    count = np.bincount(frame)
    assert (np.diff(frame) >= 0).all()
    assert (count == 32 * (1 if rooted or not camera.perspective else len(DEPTHS))).all()
    np.testing.assert_allclose(camera.project(trunk), image[frame, :6], atol=1e-6)
    for limb in (None, 0, 1, 2, 3):
        chains, own = ([(a, b) for a, b in SEGMENTS[:13] if b < 6], trunk), frame
        if limb is not None:
            row, ends = limb_starts(problem, frame, trunk, limb)
            assert (np.bincount(row) == 4).all()
            a, b, c = STARTS[limb], MIDDLES[limb], ENDS[limb]
            joints = np.full((len(row), 14, 3), np.nan)
            joints[:, :6], joints[:, [b, c]], own = trunk[row], ends, frame[row]
            np.testing.assert_allclose(camera.project(ends), image[own][:, [b, c]], atol=1e-6)
            chains = ([(a, b), (b, c)], joints)
        for start, end in chains[0]:
            length = LENGTHS[[tuple(sorted(one)) for one in SEGMENTS].index(tuple(sorted((start, end))))]
            line = chains[1][:, end] - chains[1][:, start]
            ray = chains[1][:, end] if camera.perspective else np.broadcast_to([0.0, 0, 1], line.shape)
            found = np.linalg.norm(line, axis=1)
            square = abs(np.einsum("ni,ni->n", line, ray) / found / np.linalg.norm(ray, axis=1)) < 1e-6
            assert (np.isclose(found, length, atol=1e-9) | (square & (found > length))).all()
            assert np.isclose(found, length, atol=1e-9).any()
    if rooted:
        nearest = [off(trunk[frame == k], TRUTH[k, :6]).min() for k in range(len(TRUTH))]
        assert max(nearest) < 1e-6
    elif camera.perspective:
        depth = trunk[::32, 0, 2].reshape(len(TRUTH), -1)
        np.testing.assert_allclose(depth / depth[:, :1], np.tile(DEPTHS / DEPTHS[0], (len(TRUTH), 1)))


@pytest.mark.parametrize(("hidden", "count"), [([8], 2 * 30), ([6], 30 * 2), ([6, 8], 30 * 3)])
def test_starts_of_hidden_joints_have_the_lengths_all_around(hidden, count):
    image = IMAGE.copy()
    image[:, hidden] = np.nan
    problem = observed(image=image)
    frame = np.arange(len(TRUTH))
    row, ends = limb_starts(problem, frame, TRUTH[:, :6], 0)
    assert (np.bincount(row) == count).all() and (np.diff(row) >= 0).all()
    upper, lower = (
        LENGTHS[list(SEGMENT_NAMES).index(f"right_{name}")]
        for name in ("shoulder-right_elbow", "elbow-right_wrist")
    )
    start = TRUTH[row, 1]
    first, second = (
        np.linalg.norm(ends[:, 0] - start, axis=1),
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1),
    )
    np.testing.assert_allclose(first, upper)
    # A wrist whose ray passes too far from its elbow is at the nearest point of the ray.
    aside = np.abs(np.einsum("ni,ni->n", ends[:, 1] - ends[:, 0], ends[:, 1])) < 1e-6
    fits = np.isclose(second, lower)
    assert (fits | (aside & (second > lower))).all() and (fits.all() or hidden == [6])
    assert fits.any()
    for k, joint in enumerate((6, 8)):
        if joint not in hidden:
            np.testing.assert_allclose(CAMERA.project(ends[:, k]), IMAGE[row, joint], atol=1e-6)
    for f in frame:
        middles = ends[row == f, 0] - start[row == f]
        if hidden != [8]:  # on all sides of the line to the end
            spread = np.linalg.eigvalsh(np.cov(middles.T))
            assert spread[1] > 1e-4
        nearest = np.linalg.norm(ends[row == f] - TRUTH[f, [6, 8]], axis=2).max(axis=1).min()
        assert nearest < 0.3


@pytest.mark.parametrize("hidden", [[3], [4], [1, 2], [0], [2, 3, 4], [0, 1, 2, 3, 5]])
def test_trunks_with_hidden_joints_start_with_the_figures_shape(hidden):
    image = IMAGE.copy()
    image[:, hidden] = np.nan
    problem = observed(image=image, root=None if 0 in hidden else TRUTH[:, 0])
    frame, trunk = trunk_starts(problem)
    assert np.isfinite(trunk).all() and set(frame) == set(range(len(TRUTH)))
    seen = [j for j in range(6) if j not in hidden]
    np.testing.assert_allclose(CAMERA.project(trunk[:, seen]), IMAGE[frame][:, seen], atol=1e-6)
    if 0 not in hidden:  # others hang on the neck
        nearest = [off(trunk[frame == k], TRUTH[k, :6]).min() for k in range(len(TRUTH))]
        assert np.median(nearest) < 0.12


@pytest.mark.parametrize(
    "camera", [CAMERA, ScaledOrthographicCamera(scale=250.0)], ids=["pinhole", "orthographic"]
)
def test_residuals_are_the_deviations_of_points_lengths_and_priors(camera):
    seen = camera.project(TRUTH) + 2.0 * NOISE
    known = {"length_deviation": 0.02, "size_deviation": 0.03}
    problem = observed(image=seen, camera=camera, **known)
    modes = solve(problem)
    found = modes.residuals()
    joints, frame = modes.joints, modes.frame
    image = np.linalg.norm(camera.project(joints) - seen[frame], axis=2) / 2.0
    near = image < 3  # the image is linearised at the observed point
    for j, name in enumerate(JOINTS):
        np.testing.assert_allclose(
            found[f"image {name}"][near[:, j]], image[near[:, j], j], rtol=0.05, atol=0.02
        )
    for k, name in enumerate(SEGMENT_NAMES):
        a, b = SEGMENTS[k]
        length = np.linalg.norm(joints[:, a] - joints[:, b], axis=1)
        deviation = abs(np.log(length / LENGTHS[k]) - modes.size) / 0.02
        np.testing.assert_allclose(found[f"length {name}"], deviation, atol=1e-9)
    np.testing.assert_allclose(found["size"], abs(modes.size) / 0.03, atol=1e-9)
    root = np.linalg.norm(joints[:, 0] - TRUTH[frame, 0], axis=1) / EXACT_ROOT_METRES
    np.testing.assert_allclose(found["root"], root, rtol=1e-6, atol=1e-9)
