"""The search for the cheapest path: against all paths of small sequences, and the laws that any sequence obeys."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.compiled.compiling import path as loops
from posekit.errors import InputError
from posekit.following import Beam, MotionModel, SurvivorFrame, best_paths, bridge
from posekit.following.channels import N_JOINTS, N_SEGMENTS, NextSurvivors, channels_of
from posekit.following.floors import Floors
from posekit.following.states import States
from posekit.following.transitions import Target, step_costs, turn_costs
from posekit.following.viterbi import advance
from posekit.skeleton import TREE_SEGMENTS

ALL = Beam(width=10**6, slack=1e9)
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
                deviation=rng.uniform(0, noise, (size, 14)) if noise else np.zeros((size, 14)),
                branches=[f"{k:013b}" for k in range(size)],
            )
        )
    return frames


def oracle(frames, path, model):
    """Add up the cost of one path, term by term, as the documentation has it."""
    taken = [(frame, one) for frame, one in zip(frames, path, strict=True) if one >= 0]
    total = model.skip * (len(path) - len(taken)) + sum(
        model.ranking * frame.cost[one] for frame, one in taken
    )
    for channel in range(N_JOINTS + N_SEGMENTS):
        values = [track(frame, one, channel) for frame, one in taken]
        for (t1, x1, v1), (t2, x2, v2) in itertools.pairwise(values):
            speed = np.linalg.norm(x2 - x1) / (t2 - t1)
            noise = (v1 + v2) / (t2 - t1) ** 2
            scales = (
                [(model.speed, model.nu), (model.resting, 1.0)]
                if channel < N_JOINTS
                else [(model.swing, model.nu)]
            )
            for scale, nu in scales:
                total += student(speed, scale[channel % N_JOINTS], noise, nu)
            slack = model.spread * (math.sqrt(v1) + math.sqrt(v2))
            reach = (
                model.max_speed[channel] * (t2 - t1)
                if channel < N_JOINTS
                else 2 * math.sin(min(math.pi, model.max_swing[channel - N_JOINTS] * (t2 - t1)) / 2)
            )
            if np.linalg.norm(x2 - x1) > reach + slack:
                return math.inf
        if channel < N_JOINTS:
            for (t1, x1, v1), (t2, x2, v2), (t3, x3, v3) in zip(values, values[1:], values[2:], strict=False):
                a, b = t2 - t1, t3 - t2
                acceleration = 2 / (a + b) * ((x3 - x2) / b - (x2 - x1) / a)
                noise = (2 / (a + b)) ** 2 * (v3 / b**2 + v2 * (1 / a + 1 / b) ** 2 + v1 / a**2)
                total += student(np.linalg.norm(acceleration), model.acceleration[channel], noise, model.nu)
    return total


def track(frame, one, channel):
    """Return a channel's time, value and variance."""
    if channel < N_JOINTS:
        return frame.time, frame.joints[one, channel], frame.deviation[one, channel] ** 2
    start, end = TREE_SEGMENTS[channel - N_JOINTS]
    along = frame.joints[one, end] - frame.joints[one, start]
    length = np.linalg.norm(along)
    return frame.time, along / length, (frame.deviation[one, [start, end]] ** 2).sum() / length**2


def student(size, scale, noise, nu):
    if math.isinf(scale):
        return 0.0
    wide = scale**2 + noise
    return (nu + 3) / 2 * math.log(1 + size**2 / wide / nu) + 0.5 * math.log(wide / scale**2)


def every(frames):
    return itertools.product(*(range(-1, len(frame)) for frame in frames))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("skip", [20.0, 150.0])
def test_the_best_of_all_paths_is_found(seed, skip):
    frames = sequence(seed, (3, 4, 0, 3, 2), move=0.05, noise=0.03 if seed % 2 else 0.0)
    model = MotionModel(skip=skip, max_swing=25.0 if seed < 2 else 130.0)
    costs = {path: oracle(frames, path, model) for path in every(frames)}
    best = min(costs, key=costs.__getitem__)
    assert sum(one >= 0 for one in best) >= 2
    found = best_paths(frames, model=model, beam=ALL)
    assert found.exact
    assert found.cost[0] == pytest.approx(costs[best], abs=1e-7)
    assert tuple(found.survivor[0]) == best


def test_passing_over_is_sometimes_best():
    frames = sequence(5, (2, 2, 2, 2), move=0.01)
    broken = SurvivorFrame(time=frames[2].time, joints=frames[2].joints + np.array([0, 0, 0.8]))
    path = best_paths([*frames[:2], broken, frames[3]], beam=ALL)
    assert path.bridged[0].tolist() == [False, False, True, False]


@pytest.mark.parametrize("seed", range(3))
def test_the_next_paths_are_the_cheapest_that_go_elsewhere(seed):
    frames = sequence(seed + 10, (3, 3, 3, 2), move=0.06)
    model = MotionModel()
    ranked = sorted(every(frames), key=lambda path: oracle(frames, path, model))
    for apart in (0.0, 0.12):
        found = best_paths(frames, k=4, model=model, beam=ALL, apart=apart)
        before: list[tuple[int, ...]] = []
        for path, cost in zip(found.survivor.tolist(), found.cost, strict=True):
            best = next(one for one in ranked if elsewhere(frames, one, before, apart))
            assert tuple(path) == best
            assert cost == pytest.approx(oracle(frames, best, model), abs=1e-7)
            before.append(best)
        assert len(found) == 4 or not any(elsewhere(frames, one, before, apart) for one in ranked)


def elsewhere(frames, path, before, apart):
    """Tell whether a path goes through a survivor that is nowhere near any earlier path."""
    time = np.array([frame.time for frame in frames])
    others = []
    for one in before:
        seen = np.full((len(frames), 14, 3), np.nan)
        for k, at in enumerate(one):
            if at >= 0:
                seen[k] = frames[k].joints[at]
        others.append(bridge(time, seen))
    return not before or any(
        at >= 0
        and all(np.linalg.norm(frames[k].joints[at] - joints[k], axis=1).max() > apart for joints in others)
        for k, at in enumerate(path)
    )


@settings(deadline=None, max_examples=15, derandomize=True)
@given(st.integers(0, 10**6), st.lists(st.integers(0, 6), min_size=1, max_size=7), st.booleans())
def test_backward_in_time_costs_the_same(seed, sizes, noisy):
    frames = sequence(seed, sizes, noise=0.02 if noisy else 0.0)
    backward = [
        SurvivorFrame(time=-frame.time, joints=frame.joints, cost=frame.cost, deviation=frame.deviation)
        for frame in reversed(frames)
    ]
    there, back = best_paths(frames, beam=ALL), best_paths(backward, beam=ALL)
    assert there.cost[0] == pytest.approx(back.cost[0], abs=1e-6)
    assert there.survivor[0].tolist() == back.survivor[0][::-1].tolist()


@settings(deadline=None, max_examples=15, derandomize=True)
@given(st.integers(0, 10**6), st.floats(0, 100))
def test_a_camera_elsewhere_changes_nothing(seed, far):
    frames = sequence(seed, (4, 5, 3, 4, 6, 4), noise=0.02)
    rng = np.random.default_rng(seed)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    R *= np.linalg.det(R)
    moved = [
        SurvivorFrame(
            time=frame.time, joints=frame.joints @ R.T + far, cost=frame.cost, deviation=frame.deviation
        )
        for frame in frames
    ]
    here, there = best_paths(frames, k=2), best_paths(moved, k=2)
    np.testing.assert_allclose(here.cost, there.cost, atol=1e-6)
    assert here.survivor.tolist() == there.survivor.tolist()


@settings(deadline=None, max_examples=15, derandomize=True)
@given(st.integers(0, 10**6), st.integers(0, 5), st.sampled_from(["cost", "far", "empty"]))
def test_an_impossible_survivor_changes_nothing(seed, at, kind):
    frames = sequence(seed, (4, 5, 3, 4, 6, 4))
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
    without, with_it = best_paths(frames), best_paths(changed)
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


def test_a_single_frame_has_its_cheapest_survivor():
    (frame,) = sequence(3, (9,))
    paths = best_paths([frame], k=3, apart=0.0)
    assert paths.survivor[:, 0].tolist() == np.argsort(frame.cost)[:3].tolist()
    np.testing.assert_allclose(paths.cost, np.sort(frame.cost)[:3])
    assert paths.exact
    assert paths.codes[0] == (frame.branches[int(np.argmin(frame.cost))],)


@settings(deadline=None, max_examples=8, derandomize=True)
@given(st.integers(0, 10**6))
def test_a_narrower_beam_never_finds_a_cheaper_path(seed):
    frames = sequence(seed, (8,) * 6, move=0.1)
    costs = [best_paths(frames, beam=Beam(width=width, slack=1e9)).cost[0] for width in (1, 4, 16, 10**5)]
    assert all(a >= b - 1e-9 for a, b in itertools.pairwise(costs))


def test_a_path_that_a_beam_claims_to_be_exact_is():
    for seed in range(20):
        frames = sequence(seed, (5, 5, 5), move=0.02)
        narrow = best_paths(frames, beam=Beam(width=20, slack=200.0))
        if narrow.exact:
            assert narrow.cost[0] == pytest.approx(best_paths(frames, beam=ALL).cost[0], abs=1e-9)


def test_blocks_of_memory_do_not_show(monkeypatch):
    frames = sequence(1, (12, 15, 9, 14), noise=0.01)
    whole = best_paths(frames, k=2)
    monkeypatch.setattr("posekit.following.reference_arrivals.MAX_BLOCK_NUMBERS", 27 * 20)
    parts = best_paths(frames, k=2)
    np.testing.assert_allclose(whole.cost, parts.cost, atol=1e-9)
    assert whole.survivor.tolist() == parts.survivor.tolist()


@pytest.mark.parametrize("detour", [0.06, 0.2])
def test_a_dear_detour_is_charged_its_turns_in_any_block(monkeypatch, detour):
    """The second path must take the detour, dearer than the slack allows: in a block of its own it pays the same."""
    rng = np.random.default_rng(3)
    frames = []
    for k in range(6):
        joints = STANDING + rng.normal(0, 0.004, (5, 14, 3))
        if k == 2:
            joints = np.concatenate([joints, joints[:1] + np.array([0, 0, detour])])
        frames.append(SurvivorFrame(time=k / 30, joints=joints))
    whole = best_paths(frames, k=2, apart=detour - 0.02)
    monkeypatch.setattr("posekit.following.reference_arrivals.MAX_BLOCK_NUMBERS", 27 * 5)
    parts = best_paths(frames, k=2, apart=detour - 0.02)
    model = MotionModel()
    assert whole.cost[1] > whole.cost[0] + 60
    for paths in (whole, parts):
        for path, cost in zip(paths.survivor.tolist(), paths.cost, strict=True):
            assert cost == pytest.approx(oracle(frames, path, model), abs=1e-6)
    assert whole.survivor.tolist() == parts.survivor.tolist()


def test_a_frame_of_too_many_survivors_is_searched_among_the_cheapest():
    frames = sequence(7, (9, 9, 9), move=0.01)
    few = best_paths(frames, beam=Beam(width=10**6, slack=1e9, survivors=3))
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
def test_a_limb_passes_through_the_image_plane_only_where_it_can(level):
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
    needed = 2 * angle / 0.1
    for wall, passes in ((needed * 1.001, True), (needed * 0.999, False)):
        swings = np.full(13, np.inf)
        swings[7] = wall
        path = best_paths(frames, model=MotionModel(max_swing=swings))
        assert path.bridged.any() != passes
    switch = [one for one in best_paths(frames).switches() if one.segment == "right_elbow-right_wrist"]
    assert len(switch) == 1
    assert not switch[0].far
    assert switch[0].angle == pytest.approx(2 * level, abs=3.0)  # its own ray is not the elbow's


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
    assert not path.exact


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
        ({"joints": np.zeros((2, 13, 3))}, "expected \\(N, 14, 3\\)"),
        ({"joints": np.full((2, 14, 3), math.inf)}, "farther than"),
        ({"joints": np.full((2, 14, 3), 1e7)}, "farther than"),
        ({"cost": [0.0, math.nan]}, "a cost is NaN"),
        ({"cost": [0.0, -math.inf]}, "a cost is -inf"),
        ({"cost": [0.0]}, "cost has shape"),
        ({"deviation": -np.ones((2, 14))}, "a deviation is negative"),
        ({"deviation": np.full((2, 14), np.nan)}, "a deviation is negative, NaN"),
        ({"deviation": np.ones(14)}, "deviation has shape"),
        ({"branches": ["0"]}, "1 branch codes for 2 survivors"),
    ],
)
def test_frames_that_are_none(given, says):
    with pytest.raises(InputError, match=says):
        SurvivorFrame(**{"time": 0.0, "joints": np.zeros((2, 14, 3)), **given})


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"speed": 0.0}, "speed: 0.0"),
        ({"acceleration": np.ones(13)}, "acceleration has shape"),
        ({"max_swing": math.nan}, "expected positive"),
        ({"nu": 0.0}, "nu is 0.0"),
        ({"skip": math.inf}, "skip is inf"),
        ({"ranking": -1.0}, "ranking is -1.0"),
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
    [{"width": 0}, {"width": 2.5}, {"width": True}, {"slack": -1.0}, {"slack": math.nan}, {"survivors": 0}],
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


def on_both_paths(frames, **given):
    """Search by matrices and by loops."""
    found = []
    for one in ("plain", "fast"):
        with loops(one):
            found.append(best_paths(frames, **given))
    return found


@pytest.mark.parametrize("seed", range(6))
def test_loops_find_what_matrices_find(seed):
    frames = sequence(seed, (14, 9, 0, 16, 12), noise=0.04 if seed % 2 else 0.0, move=0.03)
    if seed > 3:
        joints = frames[3].joints.copy()
        joints[:, [8, 12]] = np.nan
        joints[3:6, 0] = np.nan
        frames[3] = replace(frames[3], joints=joints, deviation=np.nan_to_num(frames[3].deviation))
    for beam in (ALL, Beam(width=8, slack=30.0), Beam(width=50, slack=5.0, survivors=7)):
        model = MotionModel(skip=40.0, max_swing=12.0 if seed == 2 else 130.0)
        plain, fast = on_both_paths(frames, k=3, beam=beam, model=model)
        np.testing.assert_allclose(fast.cost, plain.cost, rtol=1e-10)
        assert fast.survivor.tolist() == plain.survivor.tolist()


def test_loops_leave_out_the_terms_that_a_model_leaves_out():
    frames = sequence(2, (8, 8, 8, 8), noise=0.01)
    for without in ("speed", "swing", "acceleration", "resting", "max_speed", "max_swing"):
        plain, fast = on_both_paths(frames, model=MotionModel(**{without: math.inf}), beam=ALL)
        assert fast.cost[0] == pytest.approx(plain.cost[0], rel=1e-10)
        assert fast.survivor.tolist() == plain.survivor.tolist()


@settings(deadline=None, derandomize=True, max_examples=40)
@given(seed=st.integers(0, 10**6), noise=st.sampled_from([0.0, 0.01, 0.3]), even=st.booleans())
def test_nothing_costs_less_than_its_floor(seed, noise, even):
    frames = sequence(seed, (5, 6, 7), noise=noise, even=even)
    model, states = MotionModel(), States.start()
    for frame in frames[:2]:
        states, _ = advance(states, frame, model, ALL)
    states = states.take(np.flatnonzero(np.isfinite(states.interval).all(axis=0)))
    channels = channels_of(frames[2].joints, frames[2].deviation)
    survivors = NextSurvivors(
        channels=channels,
        time=frames[2].time,
        cost=frames[2].cost,
        fresh=np.zeros(len(frames[2]), dtype=np.bool_),
    )
    floors = Floors.of(states, survivors, model)
    target = Target.of(channels, frames[2].time)
    turns = turn_costs(states, target, model)
    least = floors.turns[:, None] + floors.to_turns
    assert (turns >= least - 1e-9).all()
    whole = states.cost[:, None] + frames[2].cost + step_costs(states, target, model) + turns
    assert (whole >= floors.ends[:, None] + floors.to - 1e-9).all()
    if noise:
        assert (least > 0.1).all()


def test_progress_ends_with_the_last_frame_of_the_last_search():
    told = []
    best_paths(sequence(0, (3, 4, 5)), k=2, progress=lambda done, total: told.append((done, total)))
    assert told == [(k, 6) for k in range(1, 7)]
