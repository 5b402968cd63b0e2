"""The stick figure and example-robot-data's human as judges of the same postures, and of real motion capture.

    python benchmarks/two_models.py [CAPTURE.npz] [--postures 1000] [--every 4] [--seed 0]

Without a capture: n legal and n illegal postures with known labels, judged by the stick figure with its URDF's limits
and by the human with the same limits (its other joints free, or held so that its trunk is rigid too) and with its own;
with a capture: real frames. The capture is an NPZ as `posekit synth mocap` reads it; lengths are each clip's medians;
the human judges every n-th frame. Prints Markdown tables; takes some minutes.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.studies.two_models import reasons
from benchmarks.studies.two_models.angles import excess, figure_limits, in_human_order
from benchmarks.studies.two_models.human import (
    HELD_JOINTS,
    HUMAN_NAME,
    Counterpart,
    joint_columns,
    limits_of_human,
    limits_on_human,
    mapped_ranges,
    measure_counterparts,
    ranges_text,
    without_collision,
)
from benchmarks.studies.two_models.labelled import ILLEGAL_KINDS, Labelled, labelled_postures
from posekit import Validator, load_figure
from posekit.body import Figure
from posekit.formats.markdown import table_lines
from posekit.robots.scaling import shoulders_are_behind
from posekit.settings import MEASURED_TOLERANCE
from posekit.skeleton import JOINTS
from posekit.synthesis import Capture, read_capture
from posekit.synthesis.mocap import clip_lengths
from posekit.validators import Report

VERDICT_NAMES = ("valid", "invalid", "undecided")
STRICT_DISTANCE = 1e-3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--postures", type=int, default=1000)
    parser.add_argument(
        "--every", type=int, default=4, help="the human judges every n-th frame of the capture"
    )
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    figure = load_figure()
    if given.capture is not None:
        with tempfile.TemporaryDirectory() as folder:
            held = write_held(figure, measure_counterparts(figure), Path(folder))
            real(figure, read_capture(given.capture), given.every, held)
        return
    counterparts = measure_counterparts(figure)
    print("Joints of the human that do what the stick figure's do\n")
    rows = [
        [dof, found.joint, f"{found.sign:+d}", f"{found.offset:+.3f}"] for dof, found in counterparts.items()
    ]
    print("\n".join(table_lines(["stick figure", "human", "sign", "offset, deg"], rows)))
    spine_order(figure, given.seed)
    synthetic(figure, counterparts, given.postures, given.seed)


def spine_order(figure: Figure, seed: int) -> None:
    """Print how far pelvis angles inside the limits are outside them in the human's order."""
    rng = np.random.default_rng(seed)
    q = np.tile(np.zeros(figure.model.nq), (10_000, 1))
    q[:, 6] = 1.0
    lower, upper = figure.limits.lower, figure.limits.upper
    q[:, figure.angle_index] = rng.uniform(lower, upper, (len(q), len(lower)))
    postures = figure.forward_kinematics(q)[:, : len(JOINTS)]
    outside = excess(in_human_order(figure, postures), figure_limits(figure))["pelvis"]
    out = outside[outside > 0]
    print(
        f"Pelvis angles uniform inside the limits: {len(out) / len(outside):.1%} are outside in the human's order, "
        f"by {np.median(out):.1f} deg (median), at most {out.max():.1f}\n"
    )


def write_held(figure: Figure, counterparts: dict[str, Counterpart], folder: Path) -> str:
    """Write the mapped ranges with a trunk that is rigid, as the stick figure's; return the file's name."""
    path = folder / "held.toml"
    limits = limits_on_human(figure_limits(figure), counterparts)
    path.write_text(ranges_text(limits | dict.fromkeys(HELD_JOINTS, (0.0, 0.0))), encoding="utf-8")
    return str(path)


def synthetic(figure: Figure, counterparts: dict[str, Counterpart], n: int, seed: int) -> None:
    postures = labelled_postures(figure, n, np.random.default_rng(seed))
    ours = Validator(figure, strict=True).check(postures.joints)
    angles = in_human_order(figure, postures.joints)
    with tempfile.TemporaryDirectory() as folder:
        held = write_held(figure, counterparts, Path(folder))
        for name, ranges in (
            ("mapped ranges, trunk held rigid", held),
            ("mapped ranges", str(mapped_ranges())),
            ("its own limits", "urdf"),
        ):
            validator = Validator(HUMAN_NAME, ranges=ranges)
            theirs = validator.check(postures.joints, lengths=figure.lengths)
            expected = excess(angles, limits_of_human(theirs, counterparts))
            for checks, one, other in (
                ("joint range, rigid parts", without_collision(ours), without_collision(theirs)),
                ("the same and collision", ours, theirs),
            ):
                why = reasons(postures, one, other, expected, mapped=ranges != "urdf")
                print(f"The human with {name}: {checks}\n")
                print("\n".join(agreement(postures, one, other)))
                print("\n".join(explanation(postures, other, why)))
            examples(postures, validator, theirs, why, angles)
            collisions(postures, ours, theirs)


def agreement(postures: Labelled, ours: Report, theirs: Report) -> list[str]:
    kinds = np.array(postures.kind)
    one, other = np.array(ours.verdicts), np.array(theirs.verdicts)
    rows = []
    for kind in ("legal", *ILLEGAL_KINDS, "all"):
        rows_of = (kinds == kind) | (kind == "all")
        counts = [
            " / ".join(str(int((verdicts[rows_of] == each).sum())) for each in VERDICT_NAMES)
            for verdicts in (one, other)
        ]
        rows.append([kind, str(rows_of.sum()), *counts, f"{(one == other)[rows_of].mean():.1%}"])
    return table_lines(
        ["kind", "postures", "stick figure: valid / invalid / undecided", "human: the same", "agree"], rows
    )


def explanation(postures: Labelled, theirs: Report, why: list[str]) -> list[str]:
    counts = Counter(
        (kind, verdict, reason)
        for kind, verdict, reason in zip(postures.kind, theirs.verdicts, why, strict=True)
        if reason
    )
    rows = [[*key, str(count)] for key, count in counts.most_common()]
    return table_lines(["kind", "the human says", "why not what the stick figure says", "postures"], rows)


def examples(
    postures: Labelled, validator: Validator, theirs: Report, why: list[str], angles: dict[str, np.ndarray]
) -> None:
    """Print the first posture of each kind, verdict and reason: what is outside, and by how much."""
    columns = joint_columns(validator)
    judged = next(each for each in theirs.judgements if each.check == "joint_range")
    seen = set()
    for k, reason in enumerate(why):
        key = (postures.kind[k], theirs.verdicts[k], reason)
        if not reason or key in seen:
            continue
        seen.add(key)
        out = [
            f"{joint} {judged.value[k, i]:.2f} outside [{judged.lower[k, i]:g}, {judged.upper[k, i]:g}]"
            for i, joint in enumerate(judged.where)
            if np.nan_to_num(judged.value[k, i] - judged.upper[k, i]) > STRICT_DISTANCE
            or np.nan_to_num(judged.lower[k, i] - judged.value[k, i]) > STRICT_DISTANCE
        ]
        spine = [
            f"{np.degrees(theirs.q[k, columns[j]]):.2f}" for j in ("middle_thoracic_Z", "middle_thoracic_X")
        ]
        order = [f"{angles[f'pelvis.{name}'][k]:.2f}" for name in ("flexion", "bending", "rotation")]
        print(
            f"- {key}, {postures.what[k] or 'posture'} {k}: {'; '.join(out) or 'nothing outside'}; fit off by "
            f"{theirs.fk_distance[k] * 1000:.2f} mm; pelvis in the human's order {', '.join(order)}; thorax Z, X "
            f"{', '.join(spine)}"
        )
    print()


def collisions(postures: Labelled, ours: Report, theirs: Report) -> None:
    hits = []
    for report in (ours, theirs):
        judgement = next(each for each in report.judgements if each.check == "collision")
        hits.append(judgement.violated.any(axis=1))
    decided = np.isfinite(next(each for each in theirs.judgements if each.check == "collision").worst)
    rows = []
    for name, a in (("collides on the stick figure", True), ("does not", False)):
        same = hits[0] == a
        columns = (decided & hits[1], decided & ~hits[1], ~decided)
        rows.append([name, *(str(int((same & column).sum())) for column in columns)])
    print(
        "\n".join(
            table_lines(["collision alone", "collides on the human", "does not", "not asked: no fit"], rows)
        )
    )


@dataclass
class Tally:
    """Verdicts of one judge on real frames, by action, and what rejects them."""

    verdicts: dict[str, Counter[str]] = field(default_factory=dict)
    checks: Counter[str] = field(default_factory=Counter)
    places: Counter[str] = field(default_factory=Counter)
    frames: list[str] = field(default_factory=list)
    why: list[str] = field(default_factory=list)
    off: list[float] = field(default_factory=list)

    def add(self, action: str, report: Report) -> None:
        self.verdicts.setdefault(action, Counter()).update(report.verdicts)
        self.frames += report.verdicts
        self.off += report.fk_distance.tolist()
        named = [(judgement, k) for judgement in report.judgements for k in range(len(judgement.where))]
        self.why += [
            ", ".join(judgement.where[k] for judgement, k in named if judgement.violated[row, k])
            for row in range(len(report.verdicts))
        ]
        for judgement in report.judgements:
            self.checks[judgement.check] += int(judgement.violated.any(axis=1).sum())
            for k, where in enumerate(judgement.where):
                self.places[f"{judgement.check}/{where}"] += int(judgement.violated[:, k].sum())

    def share(self, verdict: str, action: str | None = None) -> float:
        chosen = [counts for name, counts in self.verdicts.items() if action in (None, name)]
        return sum(counts[verdict] for counts in chosen) / sum(counts.total() for counts in chosen)


def real(figure: Figure, capture: Capture, every: int, held: str) -> None:
    judges = {
        "stick, table1": (None, "table1", STRICT_DISTANCE),
        "stick, table1, 2 deg": (None, "table1", MEASURED_TOLERANCE.angle),
        "stick, urdf": (None, "urdf", STRICT_DISTANCE),
        "stick, urdf, 2 deg": (None, "urdf", MEASURED_TOLERANCE.angle),
        "human, mapped": (HUMAN_NAME, str(mapped_ranges()), STRICT_DISTANCE),
        "human, mapped, 2 deg": (HUMAN_NAME, str(mapped_ranges()), MEASURED_TOLERANCE.angle),
        "human, held rigid": (HUMAN_NAME, held, STRICT_DISTANCE),
        "human, held rigid, 2 deg": (HUMAN_NAME, held, MEASURED_TOLERANCE.angle),
        "human, own": (HUMAN_NAME, "urdf", STRICT_DISTANCE),
        "human, own, 2 deg": (HUMAN_NAME, "urdf", MEASURED_TOLERANCE.angle),
    }
    print("All frames, the stick figure\n")
    tallies = {}
    for name, (urdf, ranges, tolerance) in judges.items():
        if urdf is None:
            for checks in (("joint-range",), None):
                what = "all checks" if checks is None else "joint range"
                tallies[f"{name}, {what}"] = judge_capture(
                    figure, capture, 1, urdf, ranges, tolerance, checks
                )
    report(tallies)
    print(f"One frame in {every}, all checks\n")
    tallies = {name: judge_capture(figure, capture, every, *judge) for name, judge in judges.items()}
    report(tallies)
    middle, high, worst = 1000 * np.percentile(tallies["human, own"].off, [50, 95, 100])
    print(f"The human's fit is off by {middle:.1f} mm (median), {high:.1f} (95 %), {worst:.1f} (worst)\n")
    crossed(tallies["stick, urdf"], tallies["human, mapped"])


def judge_capture(
    figure: Figure,
    capture: Capture,
    step: int,
    urdf: str | None,
    ranges: str,
    tolerance: float,
    checks: tuple[str, ...] | None = None,
) -> Tally:
    tally = Tally()
    human = None if urdf is None else Validator(urdf, ranges=ranges, angle_tolerance=tolerance)
    for clip, action in enumerate(capture.actions):
        rows = capture.frames_of(clip, complete=True)
        lengths = clip_lengths(capture.points[rows])
        postures = capture.points[rows][::step, : len(JOINTS)]
        if human is None:
            scaled = figure.scaled(lengths)
            validator = Validator(scaled, checks=checks, ranges=ranges, angle_tolerance=tolerance)
            tally.add(action, validator.check(postures))
        else:
            behind = shoulders_are_behind(capture.points[rows])
            tally.add(action, human.check(postures, lengths=lengths, behind=behind))
    return tally


def report(tallies: dict[str, Tally]) -> None:
    first = next(iter(tallies.values()))
    actions = sorted(first.verdicts)
    rows = []
    for name, tally in tallies.items():
        cells = [f"{tally.share('valid', action):.1%}" for action in (None, *actions)]
        rows.append([name, *cells, f"{tally.share('undecided'):.1%}"])
    print("\n".join(table_lines(["accepted by", "all", *actions, "undecided"], rows)))
    rows = []
    for name, tally in tallies.items():
        checks = [f"{each} {count}" for each, count in tally.checks.items() if count]
        places = [f"{each.split('/')[1]} {count}" for each, count in tally.places.most_common() if count]
        rows.append([name, ", ".join(checks) or "-", ", ".join(places) or "-"])
    print("\n".join(table_lines(["judge", "frames that a check rejects", "where"], rows)))


def crossed(ours: Tally, theirs: Tally) -> None:
    pairs = Counter(zip(ours.frames, theirs.frames, strict=True))
    rows = [[a, *(str(pairs[a, b]) for b in VERDICT_NAMES)] for a in VERDICT_NAMES[:2]]
    print(
        "\n".join(table_lines(["stick figure, urdf", *(f"human, mapped: {b}" for b in VERDICT_NAMES)], rows))
    )
    why = Counter(
        (a, ours.why[k], b, theirs.why[k])
        for k, (a, b) in enumerate(zip(ours.frames, theirs.frames, strict=True))
        if a != b
    )
    rows = [[*key, str(count)] for key, count in why.most_common()]
    print(
        "\n".join(
            table_lines(["stick figure, urdf", "because of", "human, mapped", "because of", "frames"], rows)
        )
    )


if __name__ == "__main__":
    main()
