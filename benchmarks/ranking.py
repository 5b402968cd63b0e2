"""Ranking on real motion capture: where the truth comes, what the first-ranked is off, how sure one may be.

    python benchmarks/ranking.py CAPTURE.npz [--views 320] [--seed 0] [--fit PRIOR.toml] [--trial FOLDER]

The capture is an NPZ as `posekit synth mocap` reads it; frames are drawn evenly over its clips, each seen by a virtual
camera of its own. Cross-validated by action (and by clip): what is reported of an action was ranked by a prior that was
fitted to the others, with weights fitted to the others too, each ranked by a prior that knew neither it nor what is
held out. ``--fit`` writes the prior and the weights of all clips. ``--trial`` is a folder of Pose2Sim's balancing trial
(``pose``, a calibration and a TRC), ranked by the built-in prior. Prints Markdown tables.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from ranking_views import Clip, Priors, Views, views_of  # type: ignore[import-not-found]  # the script beside this one

from benchmarks.studies.weight_fitting import fit_weights
from posekit.formats.markdown import table_lines
from posekit.formats.own import OpenCVModel
from posekit.ranking import (
    Prior,
    Ranking,
    RankingEvidence,
    Up,
    deviation_of_tolerance,
    load_prior,
    rank,
    write_prior,
)
from posekit.ranking.posture_prior import TERM_NAMES, WEIGHT_NAMES
from posekit.ranking.ranking import softmax
from posekit.recovery import recover
from posekit.skeleton import RIGID_SEGMENTS, segment_name
from posekit.synthesis import Capture, read_capture
from posekit.views.given_views import given_views
from posekit.views.source import Source

TEMPERATURES_METRES = (0.002, 0.004, 0.008, 0.016, 0.032)


@dataclass(frozen=True, kw_only=True)
class How:
    """How survivors are ranked."""

    up: str = "known"
    extra: bool = False

    def rank(self, clip: Clip, prior: Prior) -> Ranking:
        up = {"known": Up(direction=clip.up), "level": Up.level(), "none": None}[self.up]
        ranking = rank(
            RankingEvidence.of(
                clip.joints,
                clip.lengths,
                frame=clip.frame,
                length_residual=clip.length_residual,
                chi2=clip.chi2,
                deviation=clip.deviation,
                up=up,
                depth=clip.depth,
            ),
            extra={"plausibility": clip.plausibility} if self.extra else None,
            prior=prior,
        )
        if clip.chi2 is None:
            return ranking
        return replace(ranking, terms={"chi2" if n == "image" else n: v for n, v in ranking.terms.items()})


def rank_by_fit(joints: np.ndarray, length_residual: np.ndarray, lengths: Mapping[str, float]) -> np.ndarray:
    """Order survivors by how far torso, hips and the worst segment are from the person's lengths: the plain way."""
    ends = np.array(RIGID_SEGMENTS)
    apart = np.linalg.norm(joints[:, ends[:, 0]] - joints[:, ends[:, 1]], axis=-1)
    off = apart - [lengths[segment_name(segment)] for segment in RIGID_SEGMENTS]
    return np.argsort(np.nansum(off**2, axis=1) + np.nan_to_num(length_residual) ** 2, kind="stable")


def cross_validate(
    fitted: Sequence[Views],
    reported: Sequence[Views],
    priors: Priors,
    how: How,
    without: Iterable[str] = (),
) -> tuple[list[list[NDArray[np.float64]]], dict[str, float]]:
    """Return the probabilities of survivors by views and clip, and the mean weights over the groups."""
    left_out = set(without) | ({"chi2"} if "image" in without else set())
    names = [name for name in (*WEIGHT_NAMES, "plausibility") if name not in left_out]
    probability: list[list[NDArray[np.float64]]] = [[np.empty(0)] * len(one.clips) for one in reported]
    weights: dict[str, list[float]] = {}
    for held in dict.fromkeys(priors.groups.tolist()):
        rankings, nearest = [], []
        for views in fitted:
            for k, clip in enumerate(views.clips):
                group = priors.groups[clip.index]
                if group != held:
                    rankings.append(how.rank(clip, priors.without(held, group)))
                    nearest.append(views.nearest[k])
        found = fit_weights(
            rankings, nearest, names=[n for n in names if any(n in r.terms for r in rankings)]
        )
        for name, value in found.items():
            weights.setdefault(name, []).append(value)
        for v, views in enumerate(reported):
            for k, clip in enumerate(views.clips):
                if priors.groups[clip.index] == held:
                    terms = how.rank(clip, priors.without(held)).terms
                    score = sum(
                        (found[n] * terms[n] for n in found if n in terms), np.zeros(len(clip.joints))
                    )
                    probability[v][k] = softmax(score, clip.frame)
    return probability, {name: float(np.mean(values)) for name, values in weights.items()}


TABLE_HEAD = [
    "N, mean",
    "log-loss",
    "first is nearest",
    "nearest in 5",
    "its rank, mean",
    "first, mm",
    "best",
    "random",
    "centred: first",
    "best",
    "random",
    "ECE",
]


class Scores:
    """What became of each frame."""

    def __init__(self, views: Views, probability: Sequence[NDArray[np.float64]]) -> None:
        rows: list[tuple[float, ...]] = []
        self.action: list[int] = []
        for k, clip in enumerate(views.clips):
            for frame in np.unique(clip.frame):
                mine = np.flatnonzero(clip.frame == frame)
                p, error, centred = probability[k][mine], views.error[k][mine], views.centred[k][mine]
                near = int(np.argmin(error))
                first = int(np.argmax(p))
                above = (p > p[near]).sum() + 0.5 * ((p == p[near]).sum() - 1)
                sure = (len(mine), p[near], p[first], first == near, above)
                absolute = (error[first], error.min(), error.mean())
                rows.append((*sure, *absolute, centred[first], centred.min(), centred.mean()))
                self.action.append(clip.index)
        self.table = np.array(rows, dtype=np.float64)

    def row(self) -> list[str]:
        t = self.table
        errors = [f"{value * 1000:.1f}" for value in t[:, 5:11].mean(axis=0)]
        return [
            f"{t[:, 0].mean():.0f}",
            f"{-np.log(np.maximum(t[:, 1], 1e-300)).mean():.3f}",
            f"{t[:, 3].mean():.1%}",
            f"{(t[:, 4] < 5).mean():.1%}",
            f"{t[:, 4].mean() + 1:.1f}",
            *errors,
            f"{self.calibration()[0]:.3f}",
        ]

    def calibration(self) -> tuple[float, list[list[str]]]:
        """Return the expected calibration error of the first-ranked, ten bins, and the reliability table."""
        stated, right = self.table[:, 2], self.table[:, 3]
        which = np.minimum((stated * 10).astype(int), 9)
        error, rows = 0.0, []
        for k in range(10):
            inside = which == k
            if inside.any():
                error += abs(stated[inside].mean() - right[inside].mean()) * inside.mean()
                rows.append(
                    [
                        f"{k / 10:.1f} to {(k + 1) / 10:.1f}",
                        str(int(inside.sum())),
                        f"{stated[inside].mean():.2f}",
                        f"{right[inside].mean():.2f}",
                    ]
                )
        return float(error), rows


def show(head: Sequence[str], rows: Sequence[Sequence[str]], title: str) -> None:
    print(f"{title}\n")
    print("\n".join(table_lines(list(head), [list(row) for row in rows])), flush=True)


def report(every: Sequence[Views], capture: Capture) -> None:
    fitted = [views for views in every if views.name.startswith("anatomical")]
    for label, groups in (
        ("action", list(capture.actions)),
        ("clip", list(capture.names)),
    ):
        probability, weights = cross_validate(fitted, every, Priors(capture, groups), How())
        scores = [Scores(views, p) for views, p in zip(every, probability, strict=True)]
        rows = [[views.name, *one.row()] for views, one in zip(every, scores, strict=True)]
        show(["views", *TABLE_HEAD], rows, f"Held out by {label}, up known")
        print("weights: " + ", ".join(f"{name} {value:.2f}" for name, value in weights.items()) + "\n")
        if label == "action":
            for views, one in zip(fitted, scores, strict=False):
                title = f"Reliability of the first-ranked, {views.name}, held out by action"
                show(["stated", "frames", "mean", "came true"], one.calibration()[1], title)
                by_action(views, one, capture)


def by_action(views: Views, scores: Scores, capture: Capture) -> None:
    actions = np.array(capture.actions)[scores.action]
    rows = []
    for action in sorted(set(actions)):
        t = scores.table[actions == action]
        rows.append([action, str(len(t)), f"{t[:, 2].mean():.2f}", f"{t[:, 3].mean():.2f}"])
        rows[-1] += [f"{t[:, 5].mean() * 1000:.1f}", f"{t[:, 6].mean() * 1000:.1f}"]
    head = ["action", "frames", "stated, mean", "came true", "first, mm", "best"]
    show(head, rows, f"By held-out action, {views.name}")


def ablation(every: Sequence[Views], capture: Capture) -> None:
    priors = Priors(capture, list(capture.actions))
    fitted = [views for views in every if views.name.startswith("anatomical")]
    cases: list[tuple[str, How, tuple[str, ...]]] = [("all terms", How(), ())]
    cases += [(f"without {name}", How(), (name,)) for name in TERM_NAMES]
    cases += [(f"{name} alone", How(), tuple(n for n in TERM_NAMES if n != name)) for name in TERM_NAMES[:-1]]
    cases += [
        ("no up: no gravity, balance, contact", How(up="none"), ()),
        ("camera taken to be level", How(up="level"), ()),
        ("and plausibility of angles", How(extra=True), ()),
        ("plausibility and image alone", How(up="none", extra=True), ("posture", "depth")),
    ]
    tables: list[list[list[str]]] = [[] for _ in fitted]
    for label, how, without in cases:
        probability, _ = cross_validate(fitted, fitted, priors, how, without)
        for k, (views, p) in enumerate(zip(fitted, probability, strict=True)):
            tables[k].append([label, *Scores(views, p).row()])
    for views, rows in zip(fitted, tables, strict=True):
        show(
            ["terms", *TABLE_HEAD],
            rows,
            f"Terms, weights fitted anew each time, {views.name}, held out by action",
        )


def temperatures(every: Sequence[Views], capture: Capture) -> None:
    fitted = [views for views in every if views.name.startswith("anatomical")]
    rows = []
    for temperature in TEMPERATURES_METRES:
        priors = Priors(capture, list(capture.actions), temperature)
        probability, weights = cross_validate(fitted, fitted, priors, How())
        for views, p in zip(fitted, probability, strict=True):
            score = Scores(views, p)
            loss = -np.log(np.maximum(score.table[:, 1], 1e-300)).mean()
            rows.append(
                [f"{temperature * 1000:g}", views.name, f"{loss:.3f}", f"{score.calibration()[0]:.3f}"]
            )
            rows[-1].append(f"{weights['posture']:.2f}")
    show(["temperature, mm", "views", "log-loss", "ECE", "weight of posture"], rows, "Temperatures")


def fit(every: Sequence[Views], capture: Capture, path: Path) -> None:
    """Write the prior of all clips; the weights are fitted to clips whose action the prior did not know."""
    priors = Priors(capture, list(capture.actions))
    fitted = [views for views in every if views.name.startswith("anatomical")]
    rankings, nearest = [], []
    for views in fitted:
        for k, clip in enumerate(views.clips):
            rankings.append(replace_depth(How().rank(clip, priors.without(priors.groups[clip.index]))))
            nearest.append(views.nearest[k])
    weights = fit_weights(rankings, nearest, names=[name for name in WEIGHT_NAMES if name != "depth"])
    prior = priors.without()
    write_prior(path, replace(prior, weights={**prior.weights, **weights}))
    print(f"written: {path}, weights " + ", ".join(f"{name} {value:.3f}" for name, value in weights.items()))


def replace_depth(ranking: Ranking) -> Ranking:
    """Leave the depth out: what the torso tells of it is in the image's term already."""
    return replace(ranking, terms={name: values for name, values in ranking.terms.items() if name != "depth"})


def speed(views: Views, prior: Prior) -> None:
    best = min(_timed(lambda: [How().rank(clip, prior) for clip in views.clips]) for _ in range(5))
    print(
        f"{views.name}: ranking {len(views)} survivors takes {best / len(views) * 1e6:.2f} us a survivor, "
        f"{best / views.seconds:.1%} of recovering them\n"
    )


def _timed(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def trial(folder: Path) -> None:
    """Rank the survivors of a detector's key points and compare the first with the truth."""
    calibration, truth = next(folder.glob("Calib*.toml")), next(folder.glob("*.trc"))
    rows = []
    for number, pose in enumerate(sorted((folder / "pose").iterdir()), 1):
        source = Source(camera=f"{calibration}:cam_{number:02d}", calibrate=truth)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            view = given_views(pose, source, truth)[0].view
            recovery = recover(view)
        R = view.camera.R if isinstance(view.camera, OpenCVModel) else None
        assert R is not None
        ways = {
            "by fit": None,
            "up known": Up.of_camera(R, [0.0, 0.0, 1.0]),
            "camera taken to be level": Up.level(),
            "no up": "",
        }
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in (*ways, "best", "median")}
        counts = []
        for frame, true in zip(recovery.frames, view.truth, strict=True):
            if not len(frame) or not np.isfinite(true).any():
                continue
            counts.append(len(frame))
            error = np.stack(_errors(frame.joints, true), axis=1)
            found["best"].append(tuple(error.min(axis=0)))
            found["median"].append(tuple(np.median(error, axis=0)))
            tolerance = frame.tolerance.rigid if frame.tolerance is not None else 0.0
            for name, up in ways.items():
                if name == "by fit":
                    first = int(rank_by_fit(frame.joints, frame.length_residual, recovery.figure.lengths)[0])
                else:
                    ranking = rank(
                        RankingEvidence.of(
                            frame.joints,
                            recovery.figure.lengths,
                            length_residual=frame.length_residual,
                            deviation=deviation_of_tolerance(tolerance),
                            up=up or None,  # type: ignore[arg-type]
                        )
                    )
                    first = int(ranking.order[0])
                found[name].append(tuple(error[first]))
        cells = []
        for values in found.values():
            absolute, centred = np.median(np.array(values), axis=0) * 1000
            cells.append(f"{absolute:.0f} / {centred:.0f}")
        rows.append([f"cam_{number:02d}", f"{np.median(counts):.0f}", *cells])
    names = ["by fit", "up known", "level camera", "no up", "best of N", "median of N"]
    title = (
        "Balancing trial, OpenPose key points: first-ranked, mm where it is / moved to the middle (medians)"
    )
    show(["camera", "N, median", *names], rows, title)


def _errors(joints: NDArray[np.float64], true: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    away = true - joints
    middle = np.nanmean(away, axis=1, keepdims=True)
    return tuple(np.nanmean(np.linalg.norm(each, axis=-1), axis=1) for each in (away, away - middle))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--views", type=int, default=320)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fit", type=Path)
    parser.add_argument("--trial", type=Path)
    given = parser.parse_args()
    if given.capture is None:
        print("no capture given: python benchmarks/ranking.py CAPTURE.npz")
        return
    warnings.simplefilter("ignore", UserWarning)  # a noisy neck lies beside the ray of its root
    capture = read_capture(given.capture)
    few = max(16, given.views // 2)
    every = [
        views_of(capture, "anatomical", 0.0, given.views, given.seed),
        views_of(capture, "anatomical", 2.0, given.views, given.seed + 1),
        views_of(capture, "anatomical", 2.0, few, given.seed + 2, placed=True),
        views_of(capture, "anatomical", 2.0, given.views, given.seed + 3, refined=True),
    ]
    if given.fit is not None:
        fit(every, capture, given.fit)
        return
    every += [
        views_of(capture, "urdf", 0.0, given.views, given.seed),
        views_of(capture, "urdf", 2.0, given.views, given.seed + 1),
    ]
    for views in every:
        speed(views, load_prior())
    report(every, capture)
    ablation(every, capture)
    temperatures(every, capture)
    if given.trial is not None:
        trial(given.trial)


if __name__ == "__main__":
    main()
