"""Rules of walking against real walking: how often each of them kills the truth, and what it takes away.

    python benchmarks/walking_rules.py CAPTURE.npz [--views 360] [--seed 1]

The capture is what `benchmarks/people.py` reads. Clips are judged over strides; then the true joint positions of every
frame are judged, rule by rule, with the default thresholds and with those for people: a frame is lost to a rule that
any of its findings violates; undecided is a frame where none of them says anything.
Then thresholds are chosen on all walkers but one, as
the least that keep all their frames, and reported on that one. Last, walkers are seen by virtual cameras, each frame by
one of its own, as in `benchmarks/real_motion.py`: whether the truth is among the survivors, and how many those are.
Prints Markdown tables.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from people import people  # type: ignore[import-not-found]
from ranges import Clip, clips_of  # type: ignore[import-not-found]  # the scripts beside this one
from real_motion import CHECK_NAMES, true_code  # type: ignore[import-not-found]

from posekit.formats.markdown import table_lines
from posekit.recovery import recover
from posekit.settings import MEASURED_TOLERANCE
from posekit.skeleton import JOINTS
from posekit.synthesis import Capture, SyntheticScene, mocap_scenes
from posekit.tree import Findings
from posekit.validators import load_ranges, walking
from posekit.validators.motion import MotionClip
from posekit.validators.motion.walking_phases import RULES_OVER_STRIDES, WalkingPhases
from posekit.validators.walking import DEFAULT_RULES, PEOPLE_THRESHOLDS, RULE_NUMBERS, WalkingThresholds
from posekit.views.builtin import view_of

WALKING_ACTION = "walking"
THRESHOLD_SETS = {"default": WalkingThresholds(), "people": PEOPLE_THRESHOLDS}
RULE_SETS = ((), *((rule,) for rule in RULE_NUMBERS), DEFAULT_RULES, (1, 2, 3), RULE_NUMBERS)


def judged(clip: Clip, rule: int, thresholds: WalkingThresholds) -> dict[str, Findings]:
    """Judge a clip's true joints by one rule: findings by place, or by places where a check has two."""
    points = np.concatenate([clip.points, np.full((len(clip.points), 5, 3), np.nan)], axis=1)
    checks = walking(clip.figure, (rule,), thresholds)
    return {", ".join(check.where): check.judge(points[:, list(check.points)]) for check in checks}


def lost(clip: Clip, rule: int, thresholds: WalkingThresholds) -> NDArray[np.bool_]:
    found = [findings.violated.any(axis=1) for findings in judged(clip, rule, thresholds).values()]
    return np.asarray(np.logical_or.reduce(found))


def on_true_joints(clips: Sequence[Clip]) -> None:
    actions = sorted({clip.action for clip in clips}, key=lambda action: (action != WALKING_ACTION, action))
    for name, thresholds in THRESHOLD_SETS.items():
        rows = [
            [str(rule)]
            + [
                f"{np.concatenate([lost(c, rule, thresholds) for c in clips if c.action == action]).mean():.1%}"
                for action in actions
            ]
            for rule in RULE_NUMBERS
        ]
        print(f"Frames whose true posture a rule kills, {name} thresholds\n")
        print("\n".join(table_lines(["rule", *actions], rows)))
    walkers = [clip for clip in clips if clip.action == WALKING_ACTION]
    for name, thresholds in THRESHOLD_SETS.items():
        rows = []
        for rule in RULE_NUMBERS:
            each = ", ".join(f"{lost(clip, rule, thresholds).mean():.1%}" for clip in walkers)
            findings = [judged(clip, rule, thresholds) for clip in walkers]
            silent = [
                np.logical_and.reduce([np.isnan(f.value).all(axis=1) for f in found.values()])
                for found in findings
            ]
            places = ", ".join(
                f"{where.replace(f'rule{rule}.', '')} "
                f"{np.concatenate([found[where].violated.any(axis=1) for found in findings]).mean():.1%}"
                for where in findings[0]
            )
            rows.append([str(rule), each, f"{np.concatenate(silent).mean():.0%}", places])
        print(f"Walkers, {name} thresholds: {len(walkers)} clips\n")
        print("\n".join(table_lines(["rule", "killed, clip by clip", "undecided", "by place"], rows)))


def cross_validation(walkers: Sequence[Clip]) -> None:
    """Choose the least thresholds that keep all frames but one in a hundred of the other walkers, and report."""
    bare = WalkingThresholds(elbow_swing=0.0, knee_swing=0.0, girdle_swing=0.0)

    def reach(clip: Clip, rule: int, part: str) -> NDArray[np.float64]:
        """How far each frame goes beyond a rule: what the threshold would have to be."""
        found = [f.value[:, k] * (-1 if rule == 3 else 1) for where, f in judged(clip, rule, bare).items()
                 for k, place in enumerate(where.split(", ")) if part in place]  # fmt: skip
        return np.asarray(np.fmax.reduce(found))

    needs = {
        "elbow_swing": (1, "arms"), "knee_swing": (1, "legs"), "girdle_swing": (3, ""),
        "out_of_plane": (4, ""), "flexed_knee": (5, "knees"), "vertical": (5, "standing"),
    }  # fmt: skip
    rows = []
    for k, clip in enumerate(walkers):
        others = [other for other in walkers if other is not clip]
        chosen: dict[str, Any] = {
            name: float(max(0.0, *(np.nanquantile(reach(other, *need), 0.99) for other in others)))
            for name, need in needs.items()
        }
        thresholds = WalkingThresholds(**chosen)
        killed = [f"{lost(clip, rule, thresholds).mean():.1%}" for rule in RULE_NUMBERS]
        rows.append([str(k + 1), ", ".join(f"{value:.2g}" for value in chosen.values()), *killed])
    print("Thresholds chosen on the other walkers\n")
    print(
        "\n".join(table_lines(["walker", ", ".join(needs), *(f"rule {rule}" for rule in RULE_NUMBERS)], rows))
    )


def on_views(scenes: Sequence[SyntheticScene]) -> None:
    """Recover walkers by the anatomical ranges, and then apply each set of rules to the survivors."""
    ranges = load_ranges("anatomical")
    tallies: dict[tuple[str, tuple[int, ...]], list[tuple[bool, int]]] = {}
    for scene in scenes:
        recovery = recover(view_of(scene), checks=CHECK_NAMES, ranges=ranges, tolerance=MEASURED_TOLERANCE)
        for frame, truth in zip(recovery.frames, scene.joints_cam, strict=True):
            joints = frame.joints
            mine = np.array([code == true_code(frame, truth) for code in frame.branches], dtype=bool)
            points = np.concatenate([joints, np.full((len(joints), 5, 3), np.nan)], axis=1)
            for name, thresholds in THRESHOLD_SETS.items():
                killed = {
                    rule: np.logical_or.reduce(
                        [
                            check.judge(points[:, list(check.points)]).violated.any(axis=1)
                            for check in walking(recovery.figure, (rule,), thresholds)
                        ]
                    )
                    for rule in RULE_NUMBERS
                }
                for rules in RULE_SETS:
                    kept = ~np.logical_or.reduce(
                        [np.zeros(len(joints), dtype=bool), *(killed[r] for r in rules)]
                    )
                    tallies.setdefault((name, rules), []).append((bool(mine[kept].any()), int(kept.sum())))
    rows = []
    for (name, rules), found in tallies.items():
        counts = np.array([count for _, count in found])
        median, high = np.percentile(counts, [50, 95])
        shares = (np.mean([true for true, _ in found]), np.mean(counts == 0))
        numbers = (f"{counts.mean():.1f}", f"{median:.0f}", f"{high:.0f}")
        label = ", ".join(map(str, rules)) or "none"
        rows.append([name if rules else "", label, *(f"{share:.1%}" for share in shares), *numbers])
    print(f"Views of walkers: {sum(map(len, scenes))}\n")
    head = [
        "thresholds",
        "rules",
        "truth among survivors",
        "no survivor",
        "survivors, mean",
        "median",
        "95 %",
    ]
    unique = [row for k, row in enumerate(rows) if row not in rows[:k]]
    print("\n".join(table_lines(head, unique)))


def over_strides(capture: Capture) -> None:
    """Judge each clip's true joints over strides: which part of its frames each rule rejects."""
    check, rows = WalkingPhases(), []
    for index, name in enumerate(capture.names):
        joints = capture.points[capture.frames_of(index, complete=True), : len(JOINTS)]
        rate = float(capture.fps[index])
        clip = MotionClip(joints=joints, time=np.arange(len(joints)) / rate, rate=rate)
        violated = check.judge(clip).violated
        rules = np.array([int(place[len("rule")]) for place in check.places(clip)])
        shares = (violated[:, rules == rule].any(axis=1).mean() for rule in RULES_OVER_STRIDES)
        rows.append([name, capture.actions[index], str(len(joints)), *(f"{share:.1%}" for share in shares)])
    print("\nOver strides\n")
    head = ["clip", "action", "frames", *(f"rule {rule}" for rule in RULES_OVER_STRIDES)]
    print("\n".join(table_lines(head, rows)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--views", type=int, default=360)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if given.capture is None:
        print("no capture given: python benchmarks/walking_rules.py CAPTURE.npz")
        return
    capture = people(given.capture)
    clips = clips_of(capture)
    over_strides(capture)
    on_true_joints(clips)
    cross_validation([clip for clip in clips if clip.action == WALKING_ACTION])
    walkers = sum(action == WALKING_ACTION for action in capture.actions)
    if not walkers:
        print(f"no clip of {WALKING_ACTION}: no views")
        return
    # Frames are drawn evenly over all clips: so many that the walkers' share is what was asked for.
    drawn = -(-given.views * len(capture.actions) // walkers)
    scenes = mocap_scenes(capture, drawn, np.random.default_rng(given.seed))
    on_views([scene for scene in scenes if scene.labels[0] == WALKING_ACTION])


if __name__ == "__main__":
    main()
