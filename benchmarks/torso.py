"""How much a torso must give: the truth retained against the survivors, for tolerances and for joints.

    python benchmarks/torso.py CAPTURE.npz [--views 1600] [--seed 0] [--ranges anatomical] [--picture FILE.png]

The capture is an NPZ as `posekit synth mocap` reads it; each frame is seen by a camera of its own, image points are
exact, lengths are each clip's medians. Trees are grown with hardly any check of the rigid parts; what each rule would
keep of their torsos then follows. Rules are fitted on all clips but the one that they judge. "Lost" counts the views
whose truth the other checks keep and the rule drops. Everything is said twice: for the recordings, whose skeleton has
no clavicles, and with clavicles that follow the arms. Prints Markdown tables.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from torso_rules import BENDING, CHOSEN, RULES  # type: ignore[import-not-found]
from torso_views import (  # type: ignore[import-not-found]  # the script beside this one
    CHECKS,
    Torsos,
    torsos_of,
    with_clavicles,
    with_spine,
)

from posekit.body import load_figure
from posekit.formats.markdown import table_lines
from posekit.recovery import recover
from posekit.recovery.body import FigureBody
from posekit.settings import MEASURED_TOLERANCE, RecoverSettings, Tolerance
from posekit.skeleton import JOINTS, RIGID_SEGMENTS, SEGMENTS, segment_name
from posekit.synthesis import Capture, SyntheticScene, mocap_scenes, random_views, read_capture
from posekit.validators import load_ranges
from posekit.viewer.plots.plot_file import (
    LEFT_COLOUR,
    MUTED_COLOUR,
    RIGHT_COLOUR,
    TRUNK_COLOUR,
    drawing,
    save,
)
from posekit.views.builtin import view_of

Floats = NDArray[np.float64]
Kept = NDArray[np.bool_]

UNIFORM_TOLERANCE = Tolerance(
    rigid=0.03, tangent=MEASURED_TOLERANCE.tangent, placement=False, angle=MEASURED_TOLERANCE.angle
)
"""What all four distances were allowed before each had its own tolerance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Score:
    """What a rule keeps: truth as shares of all views, what it loses itself, survivors by view."""

    label: str
    branch: float
    near: float
    lost_branch: float
    lost_near: float
    counts: NDArray[np.intp]

    @property
    def row(self) -> list[str]:
        median, high = np.percentile(self.counts, [50, 95])
        return [
            self.label,
            f"{self.branch:.2%}",
            f"{self.near:.2%}",
            f"{self.lost_branch:.2%}",
            f"{self.lost_near:.2%}",
            f"{median:.0f}",
            f"{self.counts.mean():.1f}",
            f"{high:.0f}",
        ]


TABLE_HEAD = ["rule", "true branch", "within 10 mm", "branch lost", "10 mm lost", "median", "mean", "95 %"]


def score(label: str, torsos: Torsos, kept: Kept, views: int) -> Score:
    def some(of: Kept) -> Kept:
        return np.bincount(torsos.view, of, views) > 0

    branch, near = some(torsos.true & kept), some(torsos.near & kept)
    return Score(
        label=label,
        branch=float(branch.mean()),
        near=float(near.mean()),
        lost_branch=1 - float(branch.sum() / some(torsos.true).sum()),
        lost_near=1 - float(near.sum() / some(torsos.near).sum()),
        counts=np.bincount(torsos.view, kept * torsos.count, views).astype(np.intp),
    )


def oracles(scenes: Sequence[SyntheticScene], ranges: str, views: int) -> list[Score]:
    """Joints at their best: torsos lifted with the frame's own lengths, and free in k of the four distances."""
    torsos = torsos_of(scenes, ranges, own_lengths=True)
    off = np.abs(torsos.off_truth)
    shrug, bend = np.abs(torsos.off_truth @ BENDING.T)[:, 1:3].T
    exact = np.asarray(off[:, [0, 3]].max(axis=1) < 1e-5)
    return [
        score("d: joints known, nothing free", torsos, off.max(axis=1) < 1e-5, views),
        score("d: a joint for side bend, 8 cm", torsos, exact & (shrug < 2e-3) & (bend < 0.08), views),
        score("d: and one for shrugging, 8 cm", torsos, exact & (off.max(axis=1) < 0.08), views),
        score("d: and clavicles, 8 cm", torsos, (off[:, 3] < 1e-5) & (off.max(axis=1) < 0.08), views),
    ]


def several_spines(scenes: Sequence[SyntheticScene], ranges: str, views: int) -> list[list[str]]:
    """Lift with several lengths from neck to pelvis: the truth in any, every survivor counted."""
    rows = []
    grown = {mm: torsos_of(scenes, ranges, spine=mm / 1000) for mm in (0, -2, -1, 1, -4)}
    kept = {mm: (np.abs(torsos.off) <= CHOSEN).all(axis=1) for mm, torsos in grown.items()}
    for lengths in ((0,), (0, -2), (0, -2, -1, 1), (0, -2, -1, 1, -4)):
        near, true = np.zeros((2, views), dtype=bool)
        counts = np.zeros(views)
        for mm in lengths:
            torsos = grown[mm]
            near |= np.bincount(torsos.view, torsos.near & kept[mm], views) > 0
            true |= np.bincount(torsos.view, torsos.true & kept[mm], views) > 0
            counts += np.bincount(torsos.view, kept[mm] * torsos.count, views)
        label = ", ".join(f"{mm:+d}" if mm else "0" for mm in sorted(lengths))
        rows.append([label, f"{true.mean():.2%}", f"{near.mean():.2%}", f"{counts.mean():.1f}"])
    return rows


def spreads(scenes: Sequence[SyntheticScene], torsos: Torsos) -> list[list[str]]:
    """Say how far distances are from the clip's medians, in truth and where the true branch lifts them."""
    rows = []
    for segment in SEGMENTS:
        if max(segment) > JOINTS.index("left_hip"):
            continue
        name = segment_name(segment)
        true = np.concatenate(
            [
                np.linalg.norm(scene.joints_cam[:, segment[0]] - scene.joints_cam[:, segment[1]], axis=-1)
                - scene.figure.lengths[name]
                for scene in scenes
            ]
        )
        cells = [f"{value * 1000:.1f}" for value in np.percentile(true, [0, 0.5, 99.5, 100])]
        if segment in RIGID_SEGMENTS:
            lifted = np.abs(torsos.off[torsos.branch, RIGID_SEGMENTS.index(segment)])
            cells += [f"{value * 1000:.1f}" for value in np.percentile(lifted, [99.5, 100])]
        rows.append([name, *cells, *[""] * (6 - len(cells))])
    return rows


def study(title: str, scenes: Sequence[SyntheticScene], ranges: str) -> dict[str, list[Score]]:
    """Print everything about one set of views; return the curves."""
    views = sum(map(len, scenes))
    torsos = torsos_of(scenes, ranges)
    print(f"## {title}: {views} views, ranges {ranges}\n")
    head = ["distance, mm", "least", "0.5 %", "99.5 %", "most", "lifted, 99.5 %", "lifted, most"]
    print("\n".join(table_lines(head, spreads(scenes, torsos))))
    nothing = score("no check of the rigid parts (12 cm)", torsos, np.ones(len(torsos.view), bool), views)
    now = score("chosen (MEASURED_TOLERANCE)", torsos, (np.abs(torsos.off) <= CHOSEN).all(axis=1), views)
    curves = {
        name: [score(f"{name}, {label}", torsos, kept, views) for label, kept in rule(torsos)]
        for name, rule in RULES.items()
    }
    best = oracles(scenes, ranges, views)
    every = [nothing, now, *(one for curve in curves.values() for one in curve), *best]
    print("\n".join(table_lines(TABLE_HEAD, [one.row for one in every])))
    return {**curves, "d: joints, oracle": best, "chosen": [now]}


def draw(panels: dict[str, dict[str, list[Score]]], path: Path) -> None:
    """Draw what is lost over the mean number of survivors."""
    looks = {
        "a: one tolerance for all": (MUTED_COLOUR, "o-"),
        "b: one for each distance": (RIGHT_COLOUR, "o-"),
        "b: 3 cm, but hips": (RIGHT_COLOUR, "D--"),
        "c: width, shrug, bend, hips": (LEFT_COLOUR, "s-"),
        "c: their covariance": (LEFT_COLOUR, "^:"),
        "d: a spine that gives": (TRUNK_COLOUR, "D--"),
    }
    with drawing() as kind:
        figure = kind(figsize=(7.6, 4.1), layout="constrained")
        for axes, (title, curves) in zip(
            figure.subplots(1, len(panels), sharey=True), panels.items(), strict=True
        ):
            for name, (colour, line) in looks.items():
                curve = curves[name]
                mean = [one.counts.mean() for one in curve]
                lost = [max(one.lost_branch, 3e-4) for one in curve]
                axes.plot(mean, lost, line, color=colour, ms=3.5, lw=1.0, label=name)
            best = curves["d: joints, oracle"]
            axes.plot(
                [one.counts.mean() for one in best],
                [3e-4] * len(best),
                "|",
                color=TRUNK_COLOUR,
                ms=10,
                label="d: joints, at their best",
            )
            (now,) = curves["chosen"]
            axes.plot(
                now.counts.mean(),
                max(now.lost_branch, 3e-4),
                "*",
                color=RIGHT_COLOUR,
                ms=13,
                zorder=5,
                label="chosen",
            )
            axes.set_yscale("log")
            axes.set_xlim(10, 85)
            axes.set_ylim(2.5e-4, 0.3)
            axes.set_xlabel("survivors a view, mean")
            axes.set_title(title)
            axes.grid(visible=True)
            axes.axhline(0.005, color=MUTED_COLOUR, lw=0.8, ls=":")
        figure.axes[0].set_ylabel("share of true branches lost")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncol=4, fontsize=7.5)
    save(figure, path)


def draws(capture: Capture, ranges: str, views: int, seeds: range) -> list[list[str]]:
    """Draw frames and cameras several times: what the chosen tolerances keep of all."""
    rows = []
    every = [torsos_of(mocap_scenes(capture, views, np.random.default_rng(seed)), ranges) for seed in seeds]
    for name, bounds in (("3 cm for all", np.full(4, UNIFORM_TOLERANCE.rigid)), ("hips 7.5 mm", CHOSEN)):
        scores = [score("", one, (np.abs(one.off) <= bounds).all(axis=1), views) for one in every]
        counts = np.concatenate([one.counts for one in scores])
        medians = ", ".join(f"{np.median(one.counts):.0f}" for one in scores)
        shares = [np.mean([one.branch for one in scores]), np.mean([one.near for one in scores])]
        rows.append(
            [
                name,
                *(f"{share:.2%}" for share in shares),
                f"{np.median(counts):.0f}",
                medians,
                f"{counts.mean():.1f}",
            ]
        )
    return rows


def whole(scenes: Sequence[SyntheticScene], tables: Sequence[str]) -> list[list[str]]:
    """Run `recover` itself, before and after, with each table of ranges."""
    rows = []
    views = [view_of(scene) for scene in scenes]
    for ranges in tables:
        table = load_ranges(ranges)
        both = {"3 cm for all": UNIFORM_TOLERANCE, "hips 7.5 mm": MEASURED_TOLERANCE}
        for name, tolerance in both.items():
            counts, near = [], []
            recovered = [recover(view, checks=CHECKS, ranges=table, tolerance=tolerance) for view in views]
            for scene, recovery in zip(scenes, recovered, strict=True):
                for frame, truth in zip(recovery.frames, scene.joints_cam, strict=True):
                    error = np.linalg.norm(frame.joints - truth, axis=-1).mean(axis=-1)
                    counts.append(len(frame))
                    near.append(error.min(initial=np.inf) < 0.01)
            rows.append(
                [
                    ranges,
                    name,
                    f"{np.mean(near):.2%}",
                    f"{np.median(counts):.0f}",
                    f"{np.mean(counts):.1f}",
                ]
            )
    return rows


def speed(scenes: Sequence[SyntheticScene], tables: Sequence[str]) -> str:
    """Time the trees alone, best of nine turns each: what the own tolerances take of what one for all does."""
    told = []
    for ranges in tables:
        seconds = {UNIFORM_TOLERANCE: np.inf, MEASURED_TOLERANCE: np.inf}
        grown = []
        for scene in scenes:
            body = FigureBody(figure=scene.figure, stature=1.7)
            asked = RecoverSettings(checks=CHECKS, ranges=ranges, rules=())
            grown.append((scene, body.tree, {one: body.checks(asked, one) for one in seconds}))
        for tolerance in [*seconds] * 9:
            start = time.process_time()
            for scene, tree, checks in grown:
                tree.grow(
                    scene.camera,
                    scene.joints_cam[:, 0],
                    scene.image,
                    checks[tolerance],
                    given=scene.head_cam,
                    tolerance=tolerance.tangent,
                )
            seconds[tolerance] = min(seconds[tolerance], time.process_time() - start)
        told.append(f"{ranges} {seconds[MEASURED_TOLERANCE] / seconds[UNIFORM_TOLERANCE]:.2f}")
    return "Time of the trees, 3 cm for all = 1: " + ", ".join(told)


def unstated_noise(count: int = 400) -> list[list[str]]:
    """Judge noisy points of exact bodies as if they were exact: nobody says how large the noise is."""
    scene = random_views(load_figure(), count, np.random.default_rng(0))
    rows = []
    for pixels in (0.25, 0.5, 1.0, 2.0):
        seen = view_of(scene.with_noise(pixels, np.random.default_rng(1)))
        view = replace(seen, root=scene.joints_cam[:, 0], head_image=np.full(seen.head_image.shape, np.nan))
        found = {}
        for name, tolerance in (("3 cm for all", UNIFORM_TOLERANCE), ("hips 7.5 mm", MEASURED_TOLERANCE)):
            frames = recover(view, checks=CHECKS, tolerance=tolerance).frames
            errors = [
                np.linalg.norm(frame.joints - truth, axis=-1).mean(axis=-1).min(initial=np.inf)
                for frame, truth in zip(frames, scene.joints_cam, strict=True)
            ]
            found[name] = np.array([len(frame) for frame in frames]), np.array(errors) < 0.035
        (wide, wide_near), (own, own_near) = found.values()
        found["hips 7.5 mm, 3 cm where nothing is left"] = (
            np.where(own == 0, wide, own),
            np.where(own == 0, wide_near, own_near),
        )
        rows += [
            [f"{pixels:g}", name, f"{(n == 0).mean():.1%}", f"{near.mean():.1%}", f"{n.mean():.1f}"]
            for name, (n, near) in found.items()
        ]
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--views", type=int, default=1600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ranges", default="anatomical")
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args()
    if given.capture is None:
        print("no capture given: python benchmarks/torso.py CAPTURE.npz")
        return
    capture = read_capture(given.capture)

    def scenes_of(which: Capture) -> tuple[SyntheticScene, ...]:
        return mocap_scenes(which, given.views, np.random.default_rng(given.seed))

    recorded = scenes_of(capture)
    panels = {
        title: study(title, scenes, given.ranges)
        for title, scenes in (
            ("As recorded", recorded),
            ("With clavicles that follow the arms", scenes_of(with_clavicles(capture))),
        )
    }
    study("With a spine that gives three times as much", scenes_of(with_spine(capture, 3.0)), given.ranges)
    print(f"## Five draws of {given.views} views, as recorded, ranges {given.ranges}\n")
    head = ["rigid tolerance", "true branch", "within 10 mm", "survivors, median", "by draw", "mean"]
    print("\n".join(table_lines(head, draws(capture, given.ranges, given.views, range(5)))))
    print("## Several lengths from neck to pelvis, mm beside the clip's, as recorded\n")
    head = ["lengths", "true branch", "within 10 mm", "survivors, mean"]
    print("\n".join(table_lines(head, several_spines(recorded, given.ranges, given.views))))
    print("## recover(), as recorded\n")
    head = ["ranges", "rigid tolerance", "within 10 mm", "survivors, median", "mean"]
    print("\n".join(table_lines(head, whole(recorded, ("table1", "urdf", "anatomical")))))
    print(speed(recorded, ("table1", "urdf", "anatomical")) + "\n")
    print("## Noise that nobody states, exact bodies, the neck given\n")
    head = ["noise, px", "rigid tolerance", "without a survivor", "within 35 mm", "survivors, mean"]
    print("\n".join(table_lines(head, unstated_noise())))
    if given.picture is not None:
        draw(panels, given.picture)


if __name__ == "__main__":
    main()
