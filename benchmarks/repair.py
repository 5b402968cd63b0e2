"""The remedy: how much comes back valid, and how far from the least change that a slow, general solver finds.

    python -m benchmarks.repair CAPTURE.npz [FILE ...] [--postures 1000] [--slow 40] [--starts 20] [--clips 0]

A file is anything that `benchmarks/people.py` reads. Postures of its clips are made illegal: an elbow, knee, hip or
shoulder 5 to 40 degrees beyond where it becomes so, a limb's segment 5 cm too long or too short, two bodies 3 cm in
each other. They are repaired, and judged by a validator that has not seen them, each by the lengths of its clip. The
slow solver is SciPy's SLSQP on some of them, the best of random starts, on the same problem (all lengths stay, but
those that are wrong), or, of wrong lengths and with ``--loose`` of all, on what the checks alone state (lengths within
their tolerance). With ``--clips`` so many clips a kind have a defect of `benchmarks/defects.py` at the size that must
be found.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from benchmarks.clean_clips import CleanClip, clean_clips
from benchmarks.defect_cases import draw
from benchmarks.defects import DEFECTS
from posekit.body import with_head
from posekit.body.measured import MeasuredPerson, measured_person
from posekit.formats.markdown import table_lines
from posekit.geometry import Array, rotation_from_vector
from posekit.remedy import repair
from posekit.remedy.constraints import margins_of
from posekit.remedy.pieces import N_UNKNOWNS, moved
from posekit.remedy.postures import joint_weights
from posekit.skeleton import JOINTS, LIMB_JOINTS
from posekit.tree import Check
from posekit.validators import Validator
from posekit.validators.motion import MotionClip, judge_motion

BEYOND_DEGREES = (5.0, 40.0)
LENGTH_METRES = 0.05
OVERLAP_METRES = 0.03
FEASIBLE_METRES = -1e-5
KINDS = ("elbow or knee", "hip or shoulder", "length", "overlap")


@dataclass(frozen=True, kw_only=True, eq=False)
class IllegalPosture:
    """A posture that was legal, and what it was made."""

    kind: str
    legal: Array
    joints: Array
    person: MeasuredPerson


def turned(points: Array, pivot: int, beyond: Sequence[int], turn: Array) -> Array:
    """Turn some joints (14, 3) about another by a rotation vector."""
    out = points.copy()
    out[list(beyond)] = points[pivot] + (points[list(beyond)] - points[pivot]) @ rotation_from_vector(turn).T
    return out


def made_illegal(
    kind: str, legal: Array, person: MeasuredPerson, judge: Validator, rng: np.random.Generator
) -> Array | None:
    """Make a posture (14, 3) illegal; None where that joint cannot be made so."""
    start, middle, end = LIMB_JOINTS[int(rng.integers(len(LIMB_JOINTS)))]
    if kind == "length":
        a, b, beyond = ((start, middle, (middle, end)), (middle, end, (end,)))[int(rng.integers(2))]
        way = legal[b] - legal[a]
        out = legal.copy()
        out[list(beyond)] += rng.choice((-1.0, 1.0)) * LENGTH_METRES * way / np.linalg.norm(way)
        return out
    if kind == "elbow or knee":
        axis = np.cross(legal[middle] - legal[start], legal[end] - legal[middle])
        pivot, beyond = middle, (end,)
        axis = axis if rng.random() < 0.2 else -axis
    else:
        axis, pivot, beyond = rng.normal(size=3), start, (middle, end)
    axis = axis / max(float(np.linalg.norm(axis)), 1e-9)
    angles = np.radians(np.arange(0.0, 181.0))
    many = np.stack([turned(legal, pivot, beyond, axis * angle) for angle in angles])
    found = {one.check: one for one in judge.check(many, person=person).judgements}
    if kind == "overlap":
        deep = found["collision"].worst < -OVERLAP_METRES
        return many[np.argmax(deep)] if deep.any() else None
    bad = found["joint_range"].violated.any(axis=1)
    if not bad.any():
        return None
    return turned(
        legal, pivot, beyond, axis * (angles[np.argmax(bad)] + np.radians(rng.uniform(*BEYOND_DEGREES)))
    )


def illegal_postures(
    clips: Sequence[CleanClip], count: int, rng: np.random.Generator
) -> list[IllegalPosture]:
    """Draw illegal postures, as many of each kind, from each clip about as many."""
    found: list[IllegalPosture] = []
    for which, one in enumerate(clips):
        judge, joints = Validator(), one.clip.joints
        person = measured_person(joints)
        legal = joints[judge.check(joints, person=person).valid]
        wanted = (which + 1) * count // len(clips)
        while len(found) < wanted and len(legal):
            kind, own = KINDS[len(found) % len(KINDS)], legal[int(rng.integers(len(legal)))]
            spoiled = made_illegal(kind, own, person, judge, rng)
            if spoiled is not None and judge.check(spoiled[None], person=person).invalid[0]:
                found.append(IllegalPosture(kind=kind, legal=own, joints=spoiled, person=person))
    return found


def slow_change(
    target: Array, suite: Sequence[Check], rng: np.random.Generator, starts: int, *, free: bool
) -> float:
    """Return the least change (m, root of the sum of squares) that SLSQP finds; infinite where none is legal."""
    points, weight = with_head(target[None]), joint_weights()[: len(JOINTS), None]
    size, scale = (3 * len(JOINTS), 0.03) if free else (N_UNKNOWNS, 0.3)

    def placed(unknowns: Array) -> Array:
        if free:
            return with_head(unknowns.reshape(-1, len(JOINTS), 3))
        return moved(np.repeat(points, len(unknowns), axis=0), unknowns)

    def numbers(unknowns: Array) -> tuple[float, Array, Array, Array]:
        here = placed(np.concatenate([unknowns[None], unknowns + 1e-7 * np.eye(size)]))
        margin = np.concatenate([margins_of(one, here[:, list(one.points)]) for one in suite], axis=1)
        margin = np.clip(margin, -1.0, 1.0)
        cost = (weight * (here[:, : len(JOINTS)] - target) ** 2).sum(axis=(1, 2))
        slope = np.clip((margin[1:] - margin[0]).T / 1e-7, -100.0, 100.0)
        return float(cost[0]), (cost[1:] - cost[0]) / 1e-7, margin[0], slope

    kept: dict[bytes, tuple[float, Array, Array, Array]] = {}

    def at(unknowns: Array) -> tuple[float, Array, Array, Array]:
        key = unknowns.tobytes()
        if key not in kept:
            kept.clear()
            kept[key] = numbers(unknowns)
        return kept[key]

    best = np.inf
    for k in range(starts):
        start = target.ravel() if free else np.zeros(size)
        found = minimize(
            lambda u: 50 * at(u)[0],
            start + (k > 0) * scale * rng.normal(size=size),
            jac=lambda u: 50 * at(u)[1],
            method="SLSQP",
            constraints=[{"type": "ineq", "fun": lambda u: at(u)[2], "jac": lambda u: at(u)[3]}],
            options={"maxiter": 100, "ftol": 1e-7},
        )
        cost, _, margin, _ = at(found.x)
        if margin.min() > FEASIBLE_METRES:
            best = min(best, cost)
    return float(np.sqrt(best))


def repaired_postures(cases: Sequence[IllegalPosture], judge: Validator) -> tuple[Array, float]:
    """Repair postures, those of a person at once: joints (N, 14, 3), and seconds of work."""
    repaired, seconds = np.empty((len(cases), len(JOINTS), 3)), 0.0
    for whose in {id(case.person): case.person for case in cases}.values():
        its = [k for k, case in enumerate(cases) if case.person is whose]
        began = time.process_time()
        repaired[its] = repair(np.stack([cases[k].joints for k in its]), judge, person=whose).joints
        seconds += time.process_time() - began
    return repaired, seconds


def freshly_valid(cases: Sequence[IllegalPosture], repaired: Array) -> NDArray[np.bool_]:
    """Ask a validator that has not seen them (N,)."""
    fresh = Validator()
    return np.array(
        [
            fresh.check(one[None], person=case.person).valid[0]
            for one, case in zip(repaired, cases, strict=True)
        ]
    )


def posture_rows(
    cases: Sequence[IllegalPosture], judge: Validator, asked: argparse.Namespace, rng: np.random.Generator
) -> list[list[str]]:
    """Repair postures, and compare with the slow solver on the first of each kind."""
    rows = []
    every, seconds = repaired_postures(cases, judge)
    by_kind: dict[str, list[int]] = defaultdict(list)
    for k, case in enumerate(cases):
        by_kind[case.kind].append(k)
    for kind, numbers in by_kind.items():
        mine, repaired = [cases[k] for k in numbers], every[numbers]
        valid = freshly_valid(mine, repaired)
        change = np.array(
            [np.linalg.norm(one - case.joints) for one, case in zip(repaired, mine, strict=True)]
        )
        known = np.array([np.linalg.norm(case.legal - case.joints) for case in mine])
        ratios: list[list[tuple[float, float]]] = [[], []]
        some = np.linspace(0, len(mine) - 1, asked.slow // len(by_kind)).astype(int).tolist()
        for k in some:
            case = mine[k]
            _, suite = judge.figure_and_suite(case.joints[None], person=case.person)
            for which, free in enumerate((False, True)):
                if free != (kind == "length") and not (free and asked.loose):
                    continue  # lengths that are wrong and stay have no solution
                least = slow_change(case.joints, suite, rng, asked.starts, free=free)
                if np.isfinite(least) and valid[k]:
                    ratios[which].append((change[k], least))
        told = []
        for pairs in ratios:
            both = np.array(pairs).reshape(-1, 2)
            told.append(f"{both[:, 0].sum() / both[:, 1].sum():.3f} of {len(both)}" if len(both) else "")
        rows.append(
            [
                kind,
                str(len(mine)),
                f"{np.mean(valid):.1%}",
                f"{change.mean() * 100:.2f}",
                f"{known.mean() * 100:.2f}",
                *told,
                f"{seconds / len(cases) * 1000:.0f}",
            ]
        )
    return rows


def clip_rows(
    clips: Sequence[CleanClip], judge: Validator, count: int, rng: np.random.Generator
) -> list[list[str]]:
    """Repair clips with defects: how many come back valid, with what change, beside that of the known clip."""
    rows = []
    for name, kind in DEFECTS.items():
        valid, found, change, known, left = 0, 0, 0.0, 0.0, 0.0
        for _ in range(count):
            case = draw(clips, kind, kind.asked, rng)
            if case is None:
                continue
            clean = next(one.clip for one in clips if one.name == case.source)
            clip = case.clip
            if not rejected(clip, judge).any():
                continue
            found += 1
            done = repair(clip, judge)
            fixed = replace(clip, joints=done.joints, time=clip.time if done.time is None else done.time)
            fixed = fixed if done.head is None else replace(fixed, head=done.head)
            fixed = fixed if done.feet is None else replace(fixed, feet=done.feet)
            valid += not rejected(fixed, Validator()).any()
            change += distance(fixed.joints, clip.joints)
            if len(clean) == len(clip):
                known += distance(clean.joints, clip.joints)
                left += distance(clean.joints, fixed.joints)
        if found:
            rows.append(
                [name, str(found), f"{valid / found:.0%}"]
                + [f"{metres / found * 100:.1f}" for metres in (change, known, left)]
            )
    return rows


def distance(some: Array, others: Array) -> float:
    """Return the root of the sum of squares over frames, joints and axes, metres."""
    return float(np.sqrt(np.nansum((some - others) ** 2)))


def rejected(clip: MotionClip, judge: Validator) -> NDArray[np.bool_]:
    """Return which frames are rejected (T,), by checks of postures and over time."""
    head = clip.head if np.isfinite(clip.head).any() else None
    bad = judge.check(clip.joints, head).invalid.copy()
    for one in judge_motion(judge.profile.checks, clip).judgements:
        bad |= one.violated.any(axis=1)
    return bad


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--postures", type=int, default=1000)
    parser.add_argument("--slow", type=int, default=40)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--loose", action="store_true")
    parser.add_argument("--clips", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    clips, judge = clean_clips(asked.files), Validator()
    rng = np.random.default_rng(asked.seed)
    if asked.postures:
        cases = illegal_postures(clips, asked.postures, rng)
        head = ["illegal by", "postures", "valid", "change, cm", "of the known, cm"]
        head += ["slow solver, same problem", "checks alone", "ms"]
        print("\n".join(table_lines(head, posture_rows(cases, judge, asked, rng))))
    if asked.clips:
        head = ["defect", "clips", "valid", "change, cm", "of the known, cm", "left to it, cm"]
        print("\n".join(table_lines(head, clip_rows(clips, judge, asked.clips, rng))))


if __name__ == "__main__":
    main()
