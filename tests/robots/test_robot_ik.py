"""Inverse kinematics with limits: what can be reached is reached, what cannot is said to be so, and why."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from posekit.errors import InputError
from posekit.robots import load_robot
from posekit.robots.ik import InverseKinematics, Reach, Solution, solve, solve_sequence
from posekit.robots.joint_map import load_joint_map
from posekit.robots.kinematics import BodyPoint, BodySite, Kinematics, body_points
from posekit.robots.limited_step import limited_step
from posekit.robots.start_tables import find_branches

MM = 1e-3


@cache
def mapped(name: str) -> Kinematics:
    return load_joint_map(name).kinematics(load_robot(name, geometry=False).model)


@cache
def solver(name: str) -> InverseKinematics:
    return InverseKinematics(kinematics=mapped(name))


@cache
def chain(name: str, frames: tuple[str, ...], *, free: bool) -> Kinematics:
    model = load_robot(name, geometry=False, free_flyer=free).model
    return Kinematics(model=model, points=body_points(frames))


def legal(kinematics: Kinematics, n: int, rng: np.random.Generator, share: float = 1.0) -> np.ndarray:
    """Draw configurations uniform inside the limits, clipped to half a turn; the base anywhere."""
    space, model = kinematics.space, kinematics.model
    dv = np.zeros((n, model.nv))
    for first in space.free_v:
        dv[:, first : first + 6] = rng.normal(size=(n, 6))
    if space.turn_v.size:
        dv[:, space.turn_v] = rng.uniform(-3, 3, (n, len(space.turn_v)))
    q = space.integrate(np.tile(pin.neutral(model), (n, 1)), dv)
    at = space.bounded_q
    lower, upper = (np.clip(limit[at], -np.pi, np.pi) for limit in (space.lower, space.upper))
    rest = np.clip(0.0, lower, upper)
    q[:, at] = rest + share * (rng.uniform(lower, upper, (n, len(at))) - rest)
    return q


def inside(kinematics: Kinematics, solution: Solution) -> bool:
    q, space = solution.q, kinematics.space
    kinematics.space.check(q)
    return bool((q >= space.lower).all() and (q <= space.upper).all())


def test_a_thousand_random_configurations_of_the_published_human_are_reached(
    rng: np.random.Generator,
) -> None:
    kinematics = mapped("human")
    targets = kinematics.positions(legal(kinematics, 1000, rng))
    solution = solver("human").solve(targets)
    worst = solution.residual.max(axis=1)
    assert (worst < MM).mean() >= 0.99
    assert np.median(worst) < 1e-6
    assert inside(kinematics, solution)
    np.testing.assert_array_equal(solution.reach == Reach.MET, worst <= MM)
    # The residual is what forward kinematics says of q.
    np.testing.assert_allclose(
        solution.residual, np.linalg.norm(kinematics.positions(solution.q) - targets, axis=2)
    )


@pytest.mark.parametrize(
    ("name", "share", "least"),
    [
        ("stick_figure", 1.0, 1.0),
        ("simple_humanoid", 1.0, 0.99),
        ("talos", 1.0, 0.99),
        # Its shoulders and hips are spread over centimetres, its legs swing by 150 degrees: a body back to front
        # misses its points by millimetres only.
        ("g1", 1.0, 0.85),
        ("g1", 0.5, 0.97),
    ],
)
def test_other_models_are_reached(name: str, share: float, least: float, rng: np.random.Generator) -> None:
    kinematics = mapped(name)
    solution = solver(name).solve(kinematics.positions(legal(kinematics, 60, rng, share)))
    assert (solution.residual.max(axis=1) < MM).mean() >= least
    assert inside(kinematics, solution)


@pytest.mark.parametrize("free", [True, False], ids=["free", "fixed"])
@pytest.mark.parametrize(
    ("name", "frames"),
    [
        ("ur5", ("shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_3_link", "tool0")),
        ("panda", ("panda_link1", "panda_link3", "panda_link4", "panda_link5", "panda_link7", "panda_hand")),
        (
            "allegro_left_hand",
            ("link_3.0_tip", "link_7.0_tip", "link_11.0_tip", "link_15.0_tip", "link_1.0", "link_9.0"),
        ),
        ("double_pendulum_continuous", ("link1", "link2")),
    ],
)
def test_arms_hands_and_continuous_joints_are_reached(
    name: str, frames: tuple[str, ...], free: bool, rng: np.random.Generator
) -> None:
    kinematics = chain(name, frames, free=free)
    solution = solve(kinematics, kinematics.positions(legal(kinematics, 60, rng)))
    assert (solution.residual.max(axis=1) < MM).mean() >= 0.95
    assert inside(kinematics, solution)


def test_what_the_points_do_not_determine_stays_neutral(rng: np.random.Generator) -> None:
    kinematics = mapped("stick_figure")
    q = legal(kinematics, 30, rng, share=0.5)
    model = kinematics.model
    straight = [model.idx_qs[model.getJointId(f"{side}_elbow_flexion")] for side in ("right", "left")]
    turns = [model.idx_qs[model.getJointId(f"{side}_shoulder_rotation")] for side in ("right", "left")]
    q[:, straight] = 0.0
    solution = solver("stick_figure").solve(kinematics.positions(q))
    assert solution.residual.max() < 1e-5
    np.testing.assert_allclose(solution.q[:, turns], 0.0, atol=0.02)
    started = solver("stick_figure").solve(kinematics.positions(q), start=q)
    np.testing.assert_allclose(started.q[:, turns], q[:, turns], atol=1e-6)


def test_joints_that_move_no_point_stay(rng: np.random.Generator) -> None:
    kinematics = mapped("human")
    still = [
        kinematics.model.idx_qs[j]
        for j in range(2, kinematics.model.njoints)
        if not kinematics.moved_by[:, kinematics.model.idx_vs[j]].any()
    ]
    assert len(still) == 13  # ankles 4, forearm twists 2, wrists 4, neck 3
    solution = solver("human").solve(kinematics.positions(legal(kinematics, 20, rng)))
    np.testing.assert_array_equal(solution.q[:, still], np.tile(kinematics.neutral[still], (20, 1)))


def test_unknown_points_are_left_out(rng: np.random.Generator) -> None:
    kinematics = mapped("human")
    targets = kinematics.positions(legal(kinematics, 40, rng))
    targets[rng.random(targets.shape[:2]) < 0.25] = np.nan
    solution = solver("human").solve(targets)
    np.testing.assert_array_equal(np.isnan(solution.residual), np.isnan(targets[:, :, 0]))
    assert (np.nanmax(solution.residual, axis=1) < MM).mean() >= 0.95


def test_nothing_known_is_the_neutral_configuration() -> None:
    kinematics = mapped("stick_figure")
    solution = solver("stick_figure").solve(np.full((2, len(kinematics.points), 3), np.nan))
    np.testing.assert_allclose(solution.q, np.tile(kinematics.neutral, (2, 1)), atol=1e-12)
    assert np.isnan(solution.residual).all()
    assert (solution.reach == Reach.MET).all()


def test_no_posture_is_no_solution() -> None:
    kinematics = mapped("stick_figure")
    empty = np.empty((0, len(kinematics.points), 3))
    for solution in (solver("stick_figure").solve(empty), solver("stick_figure").solve_sequence(empty)):
        assert solution.q.shape == (0, kinematics.model.nq)
        assert solution.residual.shape == (0, len(kinematics.points))


def test_limits_are_named_as_the_reason(rng: np.random.Generator) -> None:
    kinematics = mapped("human")
    model = kinematics.model
    knee = model.idx_qs[model.getJointId("right_knee_Z")]
    q = legal(kinematics, 20, rng, share=0.3)
    q[:, knee] = -0.6  # backward; the limit is 0
    solution = solver("human").solve(kinematics.positions(q))
    # A knee bent backward may be one bent forward on a thigh turned round: then it is met.
    reach = solution.reach
    assert set(reach.tolist()) <= {Reach.MET, Reach.LIMITS}
    twist = [model.idx_qs[model.getJointId(f"right_hip_{axis}")] for axis in "XY"]
    lower, upper = kinematics.space.lower.copy(), kinematics.space.upper.copy()
    lower[twist], upper[twist] = -0.4, 0.4
    narrow = solve(kinematics, kinematics.positions(q), lower=lower, upper=upper)
    assert (narrow.reach == Reach.LIMITS).all()
    assert (narrow.unlimited_residual.max(axis=1) < MM).all()
    outside = (narrow.unlimited_q < lower) | (narrow.unlimited_q > upper)
    assert outside[:, [knee, *twist]].any(axis=1).all()
    assert narrow.at_limit[:, [knee, *twist]].any(axis=1).all()


def test_lengths_are_named_as_the_reason(rng: np.random.Generator) -> None:
    kinematics = mapped("human")
    targets = kinematics.positions(legal(kinematics, 20, rng))
    elbow, wrist = kinematics.names.index("right_elbow"), kinematics.names.index("right_wrist")
    targets[:, wrist] += 0.5 * (targets[:, wrist] - targets[:, elbow])  # half as long again
    solution = solver("human").solve(targets)
    assert (solution.reach == Reach.LENGTHS).all()
    assert (solution.residual.max(axis=1) > 10 * MM).all()
    assert inside(kinematics, solution)


@settings(max_examples=3)
@given(st.integers(0, 2**32 - 1), st.floats(-3, 5))
def test_no_target_is_an_error(seed: int, exponent: float) -> None:
    kinematics, rng = mapped("stick_figure"), np.random.default_rng(seed)
    targets = rng.normal(size=(3, len(kinematics.points), 3)) * 10.0**exponent
    targets[rng.random((3, len(kinematics.points))) < 0.3] = np.nan
    solution = solver("stick_figure").solve(targets)
    assert inside(kinematics, solution)
    assert np.isfinite(solution.residual[np.isfinite(targets[:, :, 0])]).all()


def test_no_other_method_does_better_from_there(rng: np.random.Generator) -> None:
    kinematics = mapped("stick_figure")
    space, model = kinematics.space, kinematics.model
    targets = kinematics.positions(legal(kinematics, 6, rng)) + rng.normal(
        0, 0.02, (6, len(kinematics.points), 3)
    )
    solution = solver("stick_figure").solve(targets)
    for q, target in zip(solution.q, targets, strict=True):
        low, high = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
        low[space.bounded_v] = np.minimum(space.lower[space.bounded_q] - q[space.bounded_q], -1e-12)
        high[space.bounded_v] = np.maximum(space.upper[space.bounded_q] - q[space.bounded_q], 1e-12)

        def misfit(dv: np.ndarray, q: np.ndarray = q, target: np.ndarray = target) -> np.ndarray:
            return np.ravel(kinematics.positions(space.integrate(q[None], dv[None]))[0] - target)

        theirs = least_squares(misfit, np.zeros(model.nv), bounds=(low, high), xtol=1e-12, ftol=1e-12)
        ours = 0.5 * (misfit(np.zeros(model.nv)) ** 2).sum()
        assert ours <= theirs.cost * (1 + 1e-4)


def test_weights_say_whose_miss_counts(rng: np.random.Generator) -> None:
    kinematics = mapped("stick_figure")
    targets = kinematics.positions(legal(kinematics, 10, rng))
    wrist = kinematics.names.index("left_wrist")
    targets[:, wrist] += 0.2
    weights = np.ones(len(kinematics.points))
    plain = solver("stick_figure").solve(targets, weights=weights).residual
    weights[wrist] = 1e-6
    light = solver("stick_figure").solve(targets, weights=weights).residual
    weights[wrist] = 0.0
    none = solver("stick_figure").solve(targets, weights=1e-9 * weights)
    others = np.arange(len(kinematics.points)) != wrist
    assert (none.reach == Reach.MET).all() and none.residual[:, others].max() < MM
    assert light[:, others].max() < MM < plain[:, others].max()


def test_a_start_chooses_among_solutions(rng: np.random.Generator) -> None:
    kinematics = chain("panda", ("panda_link4", "panda_hand"), free=False)
    q = legal(kinematics, 30, rng, share=0.8)
    near = np.clip(
        kinematics.space.integrate(q, rng.normal(0, 0.02, q.shape)),
        kinematics.space.lower,
        kinematics.space.upper,
    )
    solution = solve(kinematics, kinematics.positions(q), start=near)
    # The same 9 joints place two points in many ways. A configuration near a singular one may slide far along them.
    assert np.percentile(np.abs(solution.q - near).max(axis=1), 95) < 0.1
    assert solution.residual.max() < MM


def test_the_same_input_gives_the_same_answer(rng: np.random.Generator) -> None:
    kinematics = mapped("human")
    targets = kinematics.positions(legal(kinematics, 20, rng))
    first = solve(kinematics, targets)
    second = solve(Kinematics(model=kinematics.model, points=kinematics.points), targets)
    np.testing.assert_array_equal(first.q, second.q)


def test_sequences_follow_their_frames(rng: np.random.Generator) -> None:
    kinematics = mapped("human")
    ends = legal(kinematics, 6, rng, share=0.6).reshape(3, 2, -1)
    time = np.linspace(0, 1, 15)
    steps = kinematics.space.difference(ends[:, 0], ends[:, 1])
    lengths = (15, 9, 12)
    q = np.concatenate(
        [
            kinematics.space.integrate(np.tile(a, (count, 1)), time[:count, None] * step)
            for a, step, count in zip(ends[:, 0], steps, lengths, strict=True)
        ]
    )
    which = np.repeat(["walk", "run", "jump"], lengths)
    shuffled = rng.permutation(len(q))
    order = shuffled[np.argsort(which[shuffled], kind="stable")]
    order = np.concatenate([np.sort(order[which[order] == name]) for name in ("run", "walk", "jump")])
    targets = kinematics.positions(q)[order]
    together = solver("human").solve_sequence(targets, sequence=which[order])
    assert (together.residual.max(axis=1) < MM).mean() >= 0.95
    for name in ("walk", "run", "jump"):
        rows = which[order] == name
        alone = solve_sequence(kinematics, targets[rows])
        np.testing.assert_allclose(alone.q, together.q[rows], atol=1e-6)
        # Frame by frame no joint leaps, which it may where each frame is solved by itself.
        legs = [
            kinematics.model.idx_qs[kinematics.model.getJointId(f"right_{joint}_Z")]
            for joint in ("hip", "knee")
        ]
        leaps = np.abs(np.diff(together.q[rows][:, legs], axis=0)).max()
        assert leaps < 3 * np.abs(np.diff(q[which == name][:, legs], axis=0)).max() + 0.05


def test_sequences_need_fewer_steps(rng: np.random.Generator) -> None:
    kinematics = mapped("stick_figure")
    ends = legal(kinematics, 2, rng, share=0.6)
    step = kinematics.space.difference(ends[:1], ends[1:])
    q = kinematics.space.integrate(np.tile(ends[0], (30, 1)), np.linspace(0, 1, 30)[:, None] * step)
    solution = solver("stick_figure").solve_sequence(kinematics.positions(q))
    assert np.median(solution.iterations) <= 6
    assert solution.converged.all()


def test_a_mean_of_frames_is_placed(rng: np.random.Generator) -> None:
    human = mapped("human")
    neck = BodyPoint(name="neck", sites=(BodySite(frame="right_upperarm"), BodySite(frame="left_upperarm")))
    points = tuple(neck if point.name == "neck" else point for point in human.points)
    kinematics = Kinematics(model=human.model, points=points)
    solution = solve(kinematics, kinematics.positions(legal(kinematics, 40, rng)))
    assert (solution.residual.max(axis=1) < MM).mean() >= 0.95


def test_limbs_are_found_by_what_they_move() -> None:
    kinematics = mapped("human")
    limbs = {frozenset(kinematics.names[p] for p in branch.points) for branch in find_branches(kinematics)}
    assert limbs == {
        frozenset({"right_shoulder", "right_elbow", "right_wrist"}),
        frozenset({"left_shoulder", "left_elbow", "left_wrist"}),
        frozenset({"right_knee", "right_ankle"}),
        frozenset({"left_knee", "left_ankle"}),
    }


@given(st.integers(0, 2**32 - 1))
def test_a_limited_step_stays_inside_and_descends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(4, 6, 6))
    normal = matrix @ np.swapaxes(matrix, 1, 2) + 0.1 * np.eye(6)
    gradient = rng.normal(size=(4, 6))
    lowest, highest = -rng.exponential(0.3, (4, 6)), rng.exponential(0.3, (4, 6))
    lowest[:, 0], highest[:, 1] = 0.0, 0.0
    step = limited_step(normal, gradient, lowest, highest)
    assert ((step >= lowest) & (step <= highest)).all()
    free = limited_step(normal, gradient, np.full((4, 6), -np.inf), np.full((4, 6), np.inf))
    np.testing.assert_allclose((normal @ free[..., None])[..., 0], -gradient, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"targets": np.zeros((2, 3, 3))}, "targets have shape"),
        ({"targets": np.full((1, 19, 3), np.inf)}, "a target is at inf m"),
        ({"targets": np.full((1, 19, 3), 1e7)}, "a target is at 1e\\+07 m"),
        ({"weights": np.ones(4)}, "weights have shape"),
        ({"weights": -np.ones(19)}, "weights must be finite and not negative"),
        ({"weights": np.full(19, np.nan)}, "weights must be finite and not negative"),
        ({"start": np.zeros(3)}, "start has shape"),
        ({"start": np.zeros(29)}, "has length 0; expected 1"),
        ({"start": np.full(29, np.nan)}, "configuration 0 is not finite"),
        ({"lower": np.zeros(3)}, "lower has shape"),
        ({"lower": np.full(29, np.nan)}, "expected lower <= upper"),
        ({"lower": np.ones(29), "upper": np.zeros(29)}, "lower limit 1 and upper limit 0"),
        ({"tolerance": np.nan}, "tolerance is nan"),
        ({"tolerance": 0.0}, "tolerance is 0"),
    ],
)
def test_bad_input_is_refused(change: dict[str, object], message: str) -> None:
    given = {"targets": np.zeros((1, 19, 3)), **change}
    with pytest.raises(InputError, match=message):
        solve(mapped("stick_figure"), **given)  # type: ignore[arg-type]


def test_a_sequence_of_another_length_is_refused() -> None:
    with pytest.raises(InputError, match="sequence has shape \\(2,\\); expected \\(3,\\)"):
        solve_sequence(mapped("stick_figure"), np.zeros((3, 19, 3)), sequence=[0, 0])


def test_a_solution_is_read_only(rng: np.random.Generator) -> None:
    kinematics = mapped("stick_figure")
    solution = solver("stick_figure").solve(kinematics.positions(legal(kinematics, 1, rng)))
    with pytest.raises(ValueError, match="read-only"):
        solution.q[0, 0] = 1.0
