"""Joint ranges against real motion: what each table accepts, what it leaves, and how wide the anatomical one must be.

    python benchmarks/ranges.py CAPTURE.npz [--views 320] [--seed 0]

The capture is an NPZ as `posekit synth mocap` reads it; lengths are each clip's medians. Acceptance is of the true
joint positions, all frames, angles within a thousandth of a degree. The number of spreads is chosen on half of the
clips (every other one), as the least that accepts 99.5 % of their frames, and reported on the other half. Survivors
are those of `benchmarks/real_motion.py`: each frame seen by a virtual camera of its own. Prints Markdown tables.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from real_motion import CHECK_NAMES, Tally, true_code  # type: ignore[import-not-found]  # the script beside this one

from posekit.body import Figure, load_figure
from posekit.body.frames import hips_frame
from posekit.compiled.compiling import path
from posekit.formats.markdown import table_lines
from posekit.recovery import recover
from posekit.settings import MEASURED_TOLERANCE, Tolerance
from posekit.skeleton import DOFS, JOINT, SIDES
from posekit.synthesis import Capture, SyntheticScene, mocap_scenes, read_capture
from posekit.synthesis.mocap import clip_lengths
from posekit.validators import Ranges, joint_range, load_ranges
from posekit.validators.anatomical import Anatomy, Sinus
from posekit.validators.anatomical_limb import limb_walls
from posekit.validators.anatomical_plausibility import plausibility
from posekit.views.builtin import view_of

RANGE_TABLES = ("table1", "urdf", "anatomical")
SPREAD_FACTORS = tuple(np.round(np.arange(0.0, 3.01, 0.1), 1).tolist())
WANTED_SHARE = 0.995


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip:
    """One clip's complete frames and its person."""

    name: str
    action: str
    points: NDArray[np.float64]
    figure: Figure

    def rejected(self, ranges: Ranges) -> tuple[NDArray[np.bool_], dict[str, NDArray[np.bool_]]]:
        """Judge the true joints: which frames are rejected, and at which places."""
        places: dict[str, NDArray[np.bool_]] = {}
        for check in joint_range(self.figure, ranges):
            violated = check.judge(self.points[:, list(check.points)]).violated
            for k, where in enumerate(check.where):
                places[where] = places.get(where, np.zeros(len(self.points), dtype=bool)) | violated[:, k]
        return np.logical_or.reduce(list(places.values())), places


def clips_of(capture: Capture) -> list[Clip]:
    clips = []
    for index, name in enumerate(capture.names):
        points = capture.points[capture.frames_of(index, complete=True)]
        figure = load_figure().scaled(clip_lengths(points))
        clips.append(Clip(name=name, action=capture.actions[index], points=points, figure=figure))
    return clips


def anatomy_of(ranges: Ranges) -> Anatomy:
    if ranges.anatomy is None:
        raise SystemExit(f"{ranges.name} is no anatomical table")
    return ranges.anatomy


def widened(spreads: float) -> Ranges:
    """Return the anatomical ranges with another number of spreads."""
    table = load_ranges("anatomical")
    anatomy = replace(anatomy_of(table), spreads=spreads)
    return replace(table, limits=anatomy.limits(), anatomy=anatomy)


def accepted(clips: Sequence[Clip], ranges: Ranges) -> float:
    return 1.0 - float(np.concatenate([clip.rejected(ranges)[0] for clip in clips]).mean())


def evaluate(
    scenes: Sequence[SyntheticScene], ranges: Ranges, tolerance: Tolerance = MEASURED_TOLERANCE
) -> Tally:
    tally = Tally()
    for scene in scenes:
        recovery = recover(view_of(scene), checks=CHECK_NAMES, ranges=ranges, tolerance=tolerance)
        for label, frame, truth in zip(scene.labels, recovery.frames, scene.joints_cam, strict=True):
            tally.add(label, frame, truth)
    return tally


def row(tally: Tally) -> list[str]:
    found = [f for every in tally.retained.values() for f in every]
    counts = np.array(tally.survivors)
    median, high = np.percentile(counts, [50, 95])
    return [f"{np.mean(found):.1%}", f"{counts.mean():.1f}", f"{median:.0f}", f"{high:.0f}"]


def acceptance(clips: Sequence[Clip]) -> None:
    tables = {name: load_ranges(name) for name in RANGE_TABLES}
    actions = sorted({clip.action for clip in clips})
    groups = {"all": list(clips)} | {a: [clip for clip in clips if clip.action == a] for a in actions}
    rows = [
        [action, str(sum(len(clip.points) for clip in group))]
        + [f"{accepted(group, tables[name]):.2%}" for name in RANGE_TABLES]
        for action, group in groups.items()
    ]
    print("Accepted, true joints, all frames\n")
    print("\n".join(table_lines(["action", "frames", *RANGE_TABLES], rows)))
    print("What rejects (a frame counts at every place)\n")
    for name in RANGE_TABLES:
        places: Counter[str] = Counter()
        for clip in clips:
            places.update({where: int(bad.sum()) for where, bad in clip.rejected(tables[name])[1].items()})
        print(f"- {name}: " + ", ".join(f"{where} {count}" for where, count in places.most_common() if count))
    print()


def cross_validation(clips: Sequence[Clip]) -> None:
    halves = {"odd clips": clips[0::2], "even clips": clips[1::2]}
    curve = {
        name: np.array([accepted(half, widened(k)) for k in SPREAD_FACTORS]) for name, half in halves.items()
    }
    rows = []
    for fitted, other in (("odd clips", "even clips"), ("even clips", "odd clips")):
        enough = np.flatnonzero(curve[fitted] >= WANTED_SHARE)
        k = int(enough[0]) if len(enough) else len(SPREAD_FACTORS) - 1
        rows.append(
            [fitted, f"{SPREAD_FACTORS[k]:g}", f"{curve[fitted][k]:.2%}", other, f"{curve[other][k]:.2%}"]
        )
    print("Spreads chosen on half of the clips\n")
    print("\n".join(table_lines(["fitted on", "spreads", "accepted there", "reported on", "accepted"], rows)))


def rounded(anatomy: Anatomy, power: float) -> tuple[Sinus, ...]:
    return tuple(replace(sinus, power=power) for sinus in anatomy.sinuses)


def other_hips(clips: Sequence[Clip]) -> None:
    """Ask which power of the hip's sinus leaves room for bodies whose hips stand otherwise."""
    anatomy = anatomy_of(load_ranges("anatomical"))
    shifts = {
        "as measured": (0, 0, 0), "5 more extended": (-5, 0, 0), "8 more extended": (-8, 0, 0),
        "5 more adducted": (0, -5, 0), "5 more extended, 5 more adducted": (-5, -5, 0),
        "8 more turned inward": (0, 0, 8), "8 more turned outward": (0, 0, -8),
    }  # fmt: skip
    rows = []
    for name, shift in shifts.items():
        cells = []
        for power in (2.0, 2.5, 3.0, 4.0, None):
            variant = replace(anatomy, sinuses=() if power is None else rounded(anatomy, power))
            lost = [hips_lost(clip, variant, shift) for clip in clips]
            cells.append(f"{np.concatenate(lost).mean():.2%}")
        rows.append([name, *cells])
    print("Frames lost to the hips, by the sinus's power, if every hip stood otherwise (degrees)\n")
    print("\n".join(table_lines(["hips", "2", "2.5", "3", "4", "no sinus"], rows)))


def hips_lost(clip: Clip, anatomy: Anatomy, shift: tuple[float, float, float]) -> NDArray[np.bool_]:
    lost = np.zeros(len(clip.points), dtype=bool)
    for side in SIDES:
        joints = [JOINT[f"{side}_{name}"] for name in ("hip", "knee", "ankle")]
        R_hips = hips_frame(*np.moveaxis(clip.points[:, 3:6], 1, 0))
        ik = clip.figure.ik
        angles = np.degrees(ik.limb(f"{side}_hip", R_hips, *np.moveaxis(clip.points[:, joints], 1, 0)))
        angles += [*shift, 0.0]
        walls = limb_walls(anatomy, "hip", angles)
        lower, upper = walls.limits(anatomy.spreads)
        beyond = np.maximum(lower - walls.values, walls.values - upper)
        beyond[..., 2] *= (
            np.abs(np.sin(np.radians(angles[:, 3])))[:, None] > 0.05
        )  # a straight leg shows no rotation
        lost |= beyond.max(axis=2).min(axis=1) > 1e-3
    return lost


def tolerances(scenes: Sequence[SyntheticScene]) -> None:
    rows = []
    for name in ("table1", "anatomical"):
        for degrees in (0.0, 0.5, 1.0, 2.0, 3.0):
            tally = evaluate(scenes, load_ranges(name), replace(MEASURED_TOLERANCE, angle=degrees))
            rows.append([name, f"{degrees:g}", *row(tally)])
    print("Tolerance of angles\n")
    head = ["ranges", "angle tolerance, deg", "truth among survivors", "survivors, mean", "median", "95 %"]
    print("\n".join(table_lines(head, rows)))


def curve(clips: Sequence[Clip], scenes: Sequence[SyntheticScene]) -> None:
    rows = []
    for k in (0.0, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0):
        ranges = widened(k)
        rows.append([f"{k:g}", f"{accepted(clips, ranges):.2%}", *row(evaluate(scenes, ranges))])
    table = load_ranges("anatomical")
    anatomy = anatomy_of(table)
    variants = {
        f"sinus of power {p:g}": replace(anatomy, sinuses=rounded(anatomy, p)) for p in (2.0, 2.5, 4.0)
    }
    variants["no sinus"] = replace(anatomy, sinuses=())
    variants["no couplings, no sinus"] = replace(anatomy, couplings=(), sinuses=())
    for label, variant in variants.items():
        ranges = replace(table, anatomy=variant)
        rows.append(
            [
                f"{anatomy.spreads:g}, {label}",
                f"{accepted(clips, ranges):.2%}",
                *row(evaluate(scenes, ranges)),
            ]
        )
    head = ["spreads", "frames accepted", "truth among survivors", "survivors, mean", "median", "95 %"]
    print("Spreads against acceptance and survivors\n")
    print("\n".join(table_lines(head, rows)))


def views(scenes: Sequence[SyntheticScene]) -> None:
    tallies = {name: evaluate(scenes, load_ranges(name)) for name in RANGE_TABLES}
    print(f"Survivors of {sum(map(len, scenes))} views, measured tolerance, all physical checks\n")
    head = ["ranges", "truth among survivors", "survivors, mean", "median", "95 %"]
    print("\n".join(table_lines(head, [[name, *row(tally)] for name, tally in tallies.items()])))
    pairs = {name: np.array(tally.survivors) for name, tally in tallies.items()}
    fewer, more = (np.mean(op(pairs["anatomical"], pairs["table1"])) for op in (np.less, np.greater))
    kept = np.array([found for every in tallies["table1"].retained.values() for found in every])
    print(f"anatomical leaves fewer than table1 in {fewer:.0%} of the views, more in {more:.0%}; ", end="")
    print(f"table1 kills the truth in {np.mean(~kept):.1%} of them\n")
    print("Truth among survivors by action\n")
    rows = [
        [action, str(len(found))]
        + [f"{np.mean(tallies[name].retained[action]):.1%}" for name in RANGE_TABLES]
        for action, found in sorted(tallies["table1"].retained.items())
    ]
    print("\n".join(table_lines(["action", "views", *RANGE_TABLES], rows)))
    print("What kills the truth\n")
    for name in RANGE_TABLES:
        killers = tallies[name].killers.most_common()
        print(f"- {name}: " + ", ".join(f"{reason} {count}" for reason, count in killers))
    print()


def ranking(scenes: Sequence[SyntheticScene]) -> None:
    """Say how far up plausibility alone puts the truth among the survivors."""
    ranges = load_ranges("anatomical")
    above: list[float] = []
    first: dict[str, list[float]] = defaultdict(list)
    for scene in scenes:
        recovery = recover(view_of(scene), checks=CHECK_NAMES, ranges=ranges, tolerance=MEASURED_TOLERANCE)
        for frame, truth in zip(recovery.frames, scene.joints_cam, strict=True):
            code = true_code(frame, truth)
            if code not in frame.branches:
                continue
            score = plausibility(frame.q[:, recovery.figure.angle_index], anatomy_of(ranges)).sum(axis=1)
            mine = score[frame.branches.index(code)]
            above.append(
                float((score > mine + 1e-9).sum() + 0.5 * (np.abs(score - mine) <= 1e-9).sum() - 0.5)
            )
            first["share"].append(above[-1] / max(len(frame) - 1, 1))
    share = np.array(first["share"])
    print(
        f"Plausibility alone: {np.median(above):.1f} survivors in the middle (mean {np.mean(above):.1f}) are more "
        f"plausible than the truth, ties counted half; mean place {share.mean():.2f} of the way down (chance: 0.50)\n"
    )


def speed(clips: Sequence[Clip]) -> None:
    points = np.concatenate([np.concatenate([clip.points for clip in clips])] * 5)
    figure = load_figure()
    best: dict[str, float] = {}
    for _ in range(5):
        for name in RANGE_TABLES:
            checks = joint_range(figure, load_ranges(name), tolerance=MEASURED_TOLERANCE.angle)
            start = time.process_time()
            for check in checks:
                check.judge(points[:, list(check.points)])
            best[name] = min(best.get(name, np.inf), time.process_time() - start)
    angles = np.random.default_rng(0).uniform(-1, 1, (len(points), len(DOFS)))
    anatomy = anatomy_of(load_ranges("anatomical"))
    start = time.process_time()
    plausibility(angles, anatomy)
    seconds = time.process_time() - start
    print(f"Time of the checks on {len(points)} postures, urdf = 1: ", end="")
    print(", ".join(f"{name} {best[name] / best['urdf']:.2f}" for name in RANGE_TABLES), end="; ")
    print(f"plausibility {seconds / best['urdf']:.2f}")


def tree_speed(scenes: Sequence[SyntheticScene]) -> None:
    """Compare the time of whole recoveries, on the plain and on the compiled path where Numba is installed."""
    views = [view_of(scene) for scene in scenes]
    for way in ("plain", "fast") if find_spec("numba") else ("plain",):
        best: dict[str, float] = {}
        with path(way):
            for _ in range(4):
                for name in RANGE_TABLES:
                    start = time.process_time()
                    for view in views:
                        recover(view, checks=CHECK_NAMES, ranges=name, tolerance=MEASURED_TOLERANCE)
                    best[name] = min(best.get(name, np.inf), time.process_time() - start)
        print(f"Time of recovery, {way} path, urdf = 1: ", end="")
        print(", ".join(f"{name} {best[name] / best['urdf']:.2f}" for name in RANGE_TABLES))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--views", type=int, default=320)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if given.capture is None:
        print("no capture given: python benchmarks/ranges.py CAPTURE.npz")
        return
    capture = read_capture(given.capture)
    clips = clips_of(capture)
    scenes = mocap_scenes(capture, given.views, np.random.default_rng(given.seed))
    acceptance(clips)
    cross_validation(clips)
    other_hips(clips)
    curve(clips, scenes)
    tolerances(scenes)
    views(scenes)
    ranking(scenes)
    speed(clips)
    tree_speed(scenes)


if __name__ == "__main__":
    main()
