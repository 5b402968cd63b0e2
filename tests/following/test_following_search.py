"""The search for the cheapest path: against all paths of small sequences, and the laws that any sequence obeys."""

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.following import Beam, MotionModel, SurvivorFrame, best_paths
from posekit.following.kalman import MIN_DEVIATION_METRES, START_SPEED, MovingJoints
from posekit.following.transitions import step_costs
from posekit.following.trellis import Trellis
from posekit.skeleton import JOINTS, TREE_SEGMENTS

ALL = Beam(coverage=1.0, survivors=10**6, width=10**4, slack=1e9)
STANDING = np.array(
    [
        [0, -0.5, 0], [-0.2, -0.48, 0.05], [0.2, -0.48, -0.05], [0, 0, 0.03], [-0.1, 0.1, 0.06], [0.1, 0.1, 0.0],
        [-0.25, -0.2, 0.1], [0.25, -0.2, -0.1], [-0.25, 0.05, 0.0], [0.25, 0.05, 0.05], [-0.1, 0.5, 0.1],
        [0.1, 0.5, 0.0], [-0.1, 0.9, 0.0], [0.1, 0.9, 0.1],
    ]
) + np.array([0.1, 0.2, 4.0])  # fmt: skip


def sequence(seed, sizes, *, move=0.05, noise=0.0, even=False):
    """Draw frames whose survivors are one moving posture, each off by its own."""
    rng = np.random.default_rng(seed)
    time = 0.0
    velocity = rng.normal(0, 0.5, 3)
    frames = []
    for size in sizes:
        time += 1 / 30 if even else float(rng.uniform(0.02, 0.06))
        joints = STANDING + velocity * time + rng.normal(0, move, (size, 14, 3))
        frames.append(
            SurvivorFrame(
                time=time,
                joints=joints,
                cost=rng.exponential(2.0, size),
                covariance=covariances(rng, size, noise),
                branches=[f"{k:013b}" for k in range(size)],
            )
        )
    return frames


def covariances(rng, size, noise):
    """Draw covariances that differ by direction."""
    root = rng.normal(0, noise, (size, 14, 3, 3)) if noise else np.zeros((size, 14, 3, 3))
    return root @ root.swapaxes(-1, -2)


def oracle(frames, path, model):
    """Add up the cost of one path, term by term, as the documentation has it."""
    taken = [(frame, one) for frame, one in zip(frames, path, strict=True) if one >= 0]
    total = sum(passing(frame, model) for frame, one in zip(frames, path, strict=True) if one < 0)
    total += sum(model.ranking * frame.cost[one] for frame, one in taken)
    for joint in range(14):
        total += along(taken, [frame.time for frame in frames], joint, model)
    return total


def along(taken, times, joint, model):
    """Filter one joint as textbooks have it, with a state of six numbers, from one time to the next."""
    if not taken:
        return 0.0
    at = {frame.time: (frame, one) for frame, one in taken}
    total, x, before, seen = 0.0, None, None, None
    P: Any = None
    density = 0.05 * model.acceleration[joint] ** 2
    for now in times:
        if x is not None:
            dt = now - before
            F = np.kron([[1, dt], [0, 1]], np.eye(3))
            x = F @ x
            P = F @ P @ F.T + density * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3))
        before = now
        if now not in at:
            continue
        frame, one = at[now]
        z = frame.joints[one, joint]
        R = frame.covariance[one, joint] + MIN_DEVIATION_METRES**2 * np.eye(3)
        if x is None:
            x, P = np.append(z, np.zeros(3)), np.kron(np.diag([0, START_SPEED**2]), np.eye(3))
            P[:3, :3] = R
            last, last_P, seen = x[:3], P[:3, :3], now
            continue
        gap = now - seen
        slack = model.spread * (math.sqrt(np.trace(last_P)) + math.sqrt(np.trace(R)))
        if np.linalg.norm(z - last) > model.max_speed[joint] * gap + slack:
            return math.inf
        S = P[:3, :3] + R
        off = z - x[:3]
        far = (model.nu + 3) / 2 * math.log(1 + off @ np.linalg.solve(S, off) / model.nu)
        wide = 0.5 * math.log(max(np.linalg.det(S) / (density * gap**3 / 3) ** 3, 1.0))
        total += weight(frame, model) * (far + wide)
        gain = P[:, :3] @ np.linalg.inv(S)
        x, P = x + gain @ off, P - gain @ P[:3]
        last, last_P, seen = x[:3], P[:3, :3], now
    return total


def weight(frame, model):
    return model.weight if frame.deviation.any() else 1.0


def passing(frame, model):
    """Return what it costs to pass a frame over: with four degrees of freedom the mean of far is 2.381."""
    if not len(frame):
        return model.skip
    noise = frame.covariance[np.argmin(frame.cost)] + MIN_DEVIATION_METRES**2 * np.eye(3)
    total = 14 * 2.381303
    for joint in range(14):
        scale = 0.05 * model.acceleration[joint] ** 2 / 30**3 / 3
        total += 0.5 * math.log(np.linalg.det(2 * (np.eye(3) + noise[joint] / scale)))
    return model.skip + weight(frame, model) * total


def every(frames):
    return itertools.product(*(range(-1, len(frame)) for frame in frames))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("skip", [0.0, 150.0])
def test_the_best_of_all_paths_is_found(seed, skip):
    frames = sequence(seed, (3, 2, 0, 3, 2), move=0.05, noise=0.03 if seed % 2 else 0.0)
    model = MotionModel(skip=skip, max_speed=40.0 if seed > 1 else 4.0)
    costs = {path: oracle(frames, path, model) for path in every(frames)}
    best = min(costs, key=costs.__getitem__)
    found = best_paths(frames, model=model, beam=ALL)
    assert found.exact
    assert found.cost[0] == pytest.approx(costs[best], abs=1e-5)
    assert tuple(found.cheapest) == best


@pytest.mark.parametrize("seed", range(4))
def test_each_survivor_is_as_likely_as_all_paths_through_it(seed):
    frames = sequence(seed, (3, 2, 0, 3, 2), move=0.05, noise=0.03 if seed % 2 else 0.0)
    model = MotionModel(skip=5.0)
    likelihood = {path: math.exp(-oracle(frames, path, model)) for path in every(frames)}
    total = sum(likelihood.values())
    trellis = Trellis(model, ALL)
    for frame in frames:
        trellis.push(frame)
    for k, (stage, share) in enumerate(zip(trellis.stages, trellis.marginals(), strict=True)):
        assert share.sum() == pytest.approx(1.0)
        for one in range(-1, len(frames[k])):
            through = sum(value for path, value in likelihood.items() if path[k] == one) / total
            assert share[stage.survivor == one].sum() == pytest.approx(through, abs=1e-3)
    at, among = 3, trellis.stages[3].survivor == 1
    there = {path: value for path, value in likelihood.items() if path[at] == 1}
    for k, share in enumerate(trellis.marginals(at, among)):
        through = sum(value for path, value in there.items() if path[k] == 0) / sum(there.values())
        assert share[trellis.stages[k].survivor == 0].sum() == pytest.approx(through, abs=1e-3)


def test_a_path_is_what_is_off_least():
    frames = sequence(6, (6,) * 4, move=0.1, noise=0.02)
    trellis = Trellis(MotionModel(), ALL)
    for frame in frames:
        trellis.push(frame)
    path = best_paths(frames, beam=ALL)
    for k, share in enumerate(trellis.marginals()):
        weight = np.array([share[trellis.stages[k].survivor == one].sum() for one in range(6)])
        joints = frames[k].joints
        off = ((joints[:, None] - joints[None]) ** 2).sum(axis=(2, 3)) @ weight
        assert path.survivor[0, k] == np.argmin(off)
        near = np.linalg.norm(joints - joints[path.survivor[0, k]], axis=2).max(axis=1) <= 0.05
        assert path.confidence[0, k] == pytest.approx(weight[near].sum())


def test_passing_over_is_sometimes_best():
    frames = sequence(5, (2, 2, 2, 2), move=0.01)
    broken = SurvivorFrame(time=frames[2].time, joints=frames[2].joints + np.array([0, 0, 1.5]))
    path = best_paths([*frames[:2], broken, frames[3]], beam=ALL)
    assert path.bridged[0].tolist() == [False, False, True, False]
    vague = SurvivorFrame(
        time=broken.time, joints=broken.joints, deviation=np.full(broken.joints.shape[:2], 0.5)
    )
    assert not best_paths([*frames[:2], vague, frames[3]], beam=ALL).bridged.any()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("apart", [0.0, 0.12])
def test_the_next_paths_go_where_the_body_is_likeliest_elsewhere(seed, apart):
    frames = sequence(seed + 10, (3, 3, 3, 2), move=0.06)
    paths = best_paths(frames, k=4, beam=ALL, apart=apart)
    assert len(paths) > 1
    for later in range(1, len(paths)):
        away = [
            min(
                np.linalg.norm(frame.joints[paths.survivor[later, k]] - paths.joints[one, k], axis=1).max()
                for one in range(later)
            )
            for k, frame in enumerate(frames)
        ]
        assert max(away) > apart
    odds = paths.share / paths.share[0]
    np.testing.assert_allclose(np.log(odds), paths.cost[0] - paths.cost)
    assert (odds <= 1).all()


@settings(deadline=None, max_examples=15, derandomize=True)
@given(st.integers(0, 10**6), st.floats(0, 100))
def test_a_camera_elsewhere_changes_nothing(seed, far):
    frames = sequence(seed, (4, 5, 3, 4, 6, 4), noise=0.02)
    rng = np.random.default_rng(seed)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    R *= np.linalg.det(R)
    moved = [
        SurvivorFrame(
            time=frame.time,
            joints=frame.joints @ R.T + far,
            cost=frame.cost,
            covariance=R @ frame.covariance @ R.T,
        )
        for frame in frames
    ]
    here, there = best_paths(frames, k=2), best_paths(moved, k=2)
    np.testing.assert_allclose(here.cost, there.cost, atol=1e-4)
    assert here.survivor.tolist() == there.survivor.tolist()


@settings(deadline=None, max_examples=15, derandomize=True)
@given(st.integers(0, 10**6), st.integers(0, 5), st.sampled_from(["cost", "far", "empty"]))
def test_an_impossible_survivor_changes_nothing(seed, at, kind):
    frames = sequence(seed, (3, 2, 3, 2, 1, 2))
    old = frames[at]
    extra = {"cost": STANDING, "far": STANDING + np.array([0, 0, 300.0]), "empty": np.full((14, 3), np.nan)}[
        kind
    ]
    changed = list(frames)
    changed[at] = SurvivorFrame(
        time=old.time,
        joints=np.concatenate([old.joints, extra[None]]),
        cost=np.append(old.cost, math.inf if kind == "cost" else 0.0),
    )
    without, with_it = best_paths(frames, beam=ALL), best_paths(changed, beam=ALL)
    assert with_it.cost[0] == pytest.approx(without.cost[0], abs=1e-6)
    assert with_it.survivor.tolist() == without.survivor.tolist()


@settings(deadline=None, max_examples=10, derandomize=True)
@given(st.integers(0, 10**6), st.floats(0, 0.3))
def test_paths_are_sorted_and_different(seed, apart):
    paths = best_paths(sequence(seed, (6,) * 8), k=5, apart=apart)
    assert (np.diff(paths.cost) >= 0).all()
    for a, b in itertools.combinations(range(len(paths)), 2):
        away = np.linalg.norm(paths.joints[a] - paths.joints[b], axis=-1).max()
        assert away > apart
        assert paths.survivor[a].tolist() != paths.survivor[b].tolist()


def test_a_single_frame_has_all_its_survivors():
    (frame,) = sequence(3, (9,), move=0.3)
    paths = best_paths([frame], k=9, apart=0.0, beam=ALL)
    assert sorted(paths.survivor[:, 0].tolist()) == list(range(9))
    assert paths.cheapest.tolist() == [np.argmin(frame.cost)]
    assert paths.cost[0] == pytest.approx(frame.cost.min())
    assert paths.exact
    assert paths.codes[0] == (frame.branches[paths.survivor[0, 0]],)


@settings(deadline=None, max_examples=8, derandomize=True)
@given(st.integers(0, 10**6))
def test_a_narrower_beam_never_finds_a_cheaper_path(seed):
    frames = sequence(seed, (5,) * 3, move=0.1)
    wide: Any = {"width": 10**4, "slack": 1e9}
    costs = [best_paths(frames, beam=Beam(coverage=share, **wide)).cost[0] for share in (0.3, 0.7, 0.95, 1.0)]
    assert all(a >= b - 1e-9 for a, b in itertools.pairwise(costs))


def test_a_path_that_a_beam_claims_to_be_exact_is():
    claims = []
    for seed in range(6):
        frames = sequence(seed, (5, 5, 5), move=0.02)
        whole = best_paths(frames, beam=ALL)
        for slack in (20.0, 60.0, 200.0, 500.0):
            narrow = best_paths(frames, beam=Beam(coverage=1.0, width=200, slack=slack))
            claims.append(narrow.exact)
            if narrow.exact:
                assert narrow.cost[0] == pytest.approx(whole.cost[0], abs=1e-9)
    assert 0 < sum(claims) < len(claims)


def test_a_frame_of_too_many_survivors_is_searched_among_the_cheapest():
    frames = sequence(7, (9, 9, 9), move=0.01)
    few = best_paths(frames, beam=Beam(coverage=1.0, slack=1e9, survivors=3))
    for chosen, frame in zip(few.survivor[0].tolist(), frames, strict=True):
        assert chosen in np.argsort(frame.cost)[:3]
    only = [
        SurvivorFrame(
            time=frame.time,
            joints=frame.joints,
            cost=np.where(frame.cost <= np.sort(frame.cost)[2], frame.cost, math.inf),
        )
        for frame in frames
    ]
    np.testing.assert_allclose(few.cost, best_paths(only, beam=ALL).cost)
    assert not few.exact or few.cost[0] == pytest.approx(best_paths(frames, beam=ALL).cost[0])


def test_costs_of_survivors_decide_where_motion_does_not():
    frames = [
        SurvivorFrame(time=k / 30, joints=np.stack([STANDING, STANDING]), cost=np.array(cost))
        for k, cost in enumerate(([1.0, 0.0], [0.0, 2.0], [1.0, 0.0]))
    ]
    assert best_paths(frames).survivor[0].tolist() == [1, 0, 1]


@pytest.mark.parametrize("level", [5.0, 20.0, 40.0])
def test_a_limb_passes_through_the_image_plane_where_the_step_can(level):
    """A forearm at `level` degrees behind the plane across its ray; the next frame has it before the plane."""
    elbow = STANDING[6]
    across = np.cross(elbow, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    ray = elbow / np.linalg.norm(elbow)
    behind, before = STANDING.copy(), STANDING.copy()
    angle = math.radians(level)
    behind[8] = elbow + 0.25 * (math.cos(angle) * across + math.sin(angle) * ray)
    before[8] = elbow + 0.25 * (math.cos(angle) * across - math.sin(angle) * ray)
    frames = [SurvivorFrame(time=0.0, joints=behind[None]), SurvivorFrame(time=0.1, joints=before[None])]
    needed = 2 * 0.25 * math.sin(angle) / 0.1
    for wall, passes in ((needed * 1.05, True), (needed * 0.95, False)):
        walls = np.full(14, np.inf)
        walls[8] = wall
        path = best_paths(frames, model=MotionModel(max_speed=walls))
        assert path.bridged.any() != passes
    switch = [one for one in best_paths(frames).switches() if one.segment == "right_elbow-right_wrist"]
    assert len(switch) == 1
    assert not switch[0].far
    assert switch[0].angle == pytest.approx(2 * level, abs=3.0)  # its own ray is not the elbow's


def test_a_segment_changes_sides_from_one_frame_that_shows_it_to_the_next(rng):
    hidden = rng.random((60, 1, 14, 1)) < 0.3
    hidden[:, :, 0], hidden[:, :, 12] = False, True
    frames = [
        replace(frame, joints=np.where(one, np.nan, frame.joints))
        for frame, one in zip(sequence(3, [1] * 60, move=0.3), hidden, strict=True)
    ]
    path = best_paths(frames, model=MotionModel(max_speed=np.full(14, np.inf)))
    expected = []
    for start, end in TREE_SEGMENTS:
        taken = [(k, one.joints[0]) for k, one in enumerate(frames) if not path.bridged[0, k]]
        away = [(k, float((joints[end] - joints[start]) @ joints[end])) for k, joints in taken]
        shown = [(k, side > 0) for k, side in away if not math.isnan(side)]
        name = f"{JOINTS[start]}-{JOINTS[end]}"
        expected += [(k, name, far) for (_, before), (k, far) in itertools.pairwise(shown) if far != before]
    found = path.switches()
    assert len(expected) > 10
    assert sorted(one[:3] for one in found) == sorted(expected)
    assert [one.frame for one in found] == sorted(one.frame for one in found)


def test_what_noise_says_of_a_direction_counts_in_that_direction():
    """A step of 30 cm along the ray, where noise is 10 cm, costs less than one across it, where it is 1 cm."""
    covariance = np.broadcast_to(np.diag([1e-4, 1e-4, 1e-2]), (3, 14, 3, 3))
    moved = STANDING + np.array([[[0.0, 0, 0]], [[0, 0, 0.3]], [[0.3, 0, 0]]])
    ends, to = (
        MovingJoints.measured(joints, covariance[: len(joints)], np.ones((len(joints), 14), dtype=bool))
        for joints in (STANDING[None], moved)
    )
    still, along, across = step_costs(ends, to, 1 / 30, MotionModel(), weight=1.0)[0]
    assert still < along < across


def test_what_the_deviation_may_have_done_is_no_wall():
    frames = [SurvivorFrame(time=k / 30, joints=STANDING[None] + np.array([0, 0, 0.7 * k])) for k in range(2)]
    vague = [
        SurvivorFrame(time=frame.time, joints=frame.joints, deviation=np.full((1, 14), 0.1))
        for frame in frames
    ]
    assert best_paths(frames).bridged.any()
    assert not best_paths(vague).bridged.any()


def test_one_that_knows_less_is_not_cheaper_for_it():
    half = STANDING.copy()
    half[[8, 12]] = np.nan
    frames = [SurvivorFrame(time=k / 30, joints=np.stack([half, STANDING + 0.01 * k])) for k in range(4)]
    assert best_paths(frames).survivor[0].tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize("joint", [0, 3, 9, 12])
def test_joints_that_are_sometimes_unknown_keep_their_side(joint):
    """An ankle far or near, unknown in the middle: before and after it are linked by what it did before."""
    near, far = STANDING.copy(), STANDING.copy()
    far[joint, 2] += 0.3
    near[joint, 2] -= 0.3
    frames = []
    for k in range(7):
        postures = np.stack([near, far])
        if 2 <= k <= 4:
            postures[:, joint] = np.nan
        cost = [3.0, 0.0] if k == 0 else [0.0, 0.0]
        frames.append(SurvivorFrame(time=k / 30, joints=postures, cost=np.array(cost)))
    path = best_paths(frames)
    assert path.survivor[0, [0, 1, 5, 6]].tolist() == [1, 1, 1, 1]
    assert path.interpolated[0, :, joint].tolist() == [False, False, True, True, True, False, False]
    np.testing.assert_allclose(path.joints[0, :, joint], np.broadcast_to(far[joint], (7, 3)), atol=1e-6)


def test_postures_that_never_have_a_neck_are_followed():
    frames = []
    for frame in sequence(2, (5,) * 5):
        joints = frame.joints.copy()
        joints[:, [0, 3]] = np.nan
        frames.append(SurvivorFrame(time=frame.time, joints=joints))
    path = best_paths(frames, beam=ALL)
    assert path.exact
    assert np.isnan(path.joints[0][:, [0, 3]]).all()
    assert np.isfinite(path.joints[0][:, 1]).all()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"time": math.nan}, "time is not finite"),
        ({"time": -1e60}, "time is beyond what is a time"),
        ({"joints": np.zeros((2, 13, 3))}, "expected \\(N, 14, 3\\)"),
        ({"joints": np.full((2, 14, 3), math.inf)}, "farther than"),
        ({"joints": np.full((2, 14, 3), 1e7)}, "farther than"),
        ({"cost": [0.0, math.nan]}, "a cost is NaN"),
        ({"cost": [0.0, -math.inf]}, "a cost is -inf"),
        ({"cost": [0.0]}, "cost has shape"),
        ({"deviation": -np.ones((2, 14))}, "a deviation is negative"),
        ({"deviation": np.full((2, 14), np.nan)}, "a deviation is negative, NaN"),
        ({"deviation": np.ones(14)}, "deviation has shape"),
        ({"covariance": np.ones((2, 14))}, "covariance has shape"),
        ({"branches": ["0"]}, "1 branch codes for 2 survivors"),
    ],
)
def test_frames_that_are_none(given, says):
    with pytest.raises(InputError, match=says):
        SurvivorFrame(**{"time": 0.0, "joints": np.zeros((2, 14, 3)), **given})


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"acceleration": 0.0}, "acceleration: 0.0"),
        ({"acceleration": np.ones(13)}, "acceleration has shape"),
        ({"max_speed": math.nan}, "expected positive"),
        ({"nu": 0.0}, "nu is 0.0"),
        ({"skip": math.inf}, "skip is inf"),
        ({"ranking": -1.0}, "ranking is -1.0"),
        ({"weight": -1.0}, "weight is -1.0"),
        ({"spread": math.nan}, "spread is nan"),
    ],
)
def test_models_that_are_none(given, says):
    with pytest.raises(InputError, match=says):
        MotionModel(**given)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"k": 0}, "k is 0"),
        ({"k": True}, "k is True"),
        ({"apart": -1.0}, "apart is -1.0"),
        ({"apart": math.nan}, "apart is nan"),
    ],
)
def test_questions_that_are_none(given, says):
    with pytest.raises(InputError, match=says):
        best_paths(sequence(0, (2, 2)), **given)


@pytest.mark.parametrize(
    "given",
    [
        {"survivors": 2.5},
        {"survivors": True},
        {"slack": -1.0},
        {"slack": math.nan},
        {"survivors": 0},
        {"coverage": 0.0},
    ],
)
def test_beams_that_are_none(given):
    with pytest.raises(InputError, match=f"beam: {next(iter(given))} is"):
        Beam(**given)


def test_times_ascend():
    a, b = sequence(0, (2, 2))
    for frames, says in (([], "no frames"), ([b, a], "ascending"), ([a, a], "frame 1 is at")):
        with pytest.raises(InputError, match=says):
            best_paths(frames)


def test_results_are_read_only():
    paths = best_paths(sequence(0, (3, 3)))
    for array in (paths.cost, paths.survivor, paths.joints, paths.interpolated, paths.time):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_progress_ends_with_the_last_frame():
    told = []
    best_paths(sequence(0, (3, 4, 5)), k=2, progress=lambda done, total: told.append((done, total)))
    assert told == [(k, 3) for k in range(1, 4)]
