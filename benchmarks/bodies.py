"""Bodies that nobody measured: lengths that are off, and what becomes of the truth.

    python -m benchmarks.bodies CAPTURE [--frames 200] [--seed 0] [--only lengths,stated,...] [--rows ROWS.csv]

The capture is motion in any format that posekit reads (or a table of MediaPipe's points that caliscope triangulated).
Frames are drawn evenly over its clips, f = 1500 px, from 2.5 to 6 m: every second one by a level camera 1.0 to 1.7 m
over the ground, the others from anywhere on a sphere. A clip's median lengths are the truth's body, and *rigid* truths
have exactly these; the neck is given unless told otherwise. Nothing is fitted here, so nothing is held out; numbers are
of as many people as the capture has.

*Empty* frames have no survivor; *lost* ones have none within 35 mm (10 mm where points are exact) of the truth, after
alignment by a similarity where lengths are off (a common size shows in depth alone). The *true branch* are survivors
whose segments all point to or from the camera as the true ones do, those within 15 degrees of the image plane left out
(where noise turns a segment over, it may be gone without a loss). Its nearest survivor's stated 95 % ellipsoids, no
flatter than a millimetre and the neck's left out, should hold the truth for 95 % of joints; those of its *likeliest* do
where the branch has one posture. They are taken as they are; *scaled* about the camera until the neck is as far away as
the true one, what that common size had in the covariance, taken from the neck's, subtracted (where the neck is given
both are one); and *aligned* by the similarity, the covariance turned and scaled with the joints. The last is no fair
measure: the similarity spreads an arm's error over joints that are known to millimetres, which a joint's own covariance
cannot say.

CPU time is in units of the first condition's, in one run. Prints Markdown tables; `--rows` writes a line a frame.
"""

from __future__ import annotations

import argparse
import csv
import time
import warnings
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from posekit.body import load_figure
from posekit.compiled.compiling import path as loops
from posekit.errors import PosekitError
from posekit.formats.markdown import table_lines
from posekit.formats.motion import postures_of
from posekit.formats.motion.motion import Motion
from posekit.formats.own import OpenCVModel, View
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.measures import align
from posekit.recovery import recover
from posekit.recovery.recovery import FrameRecovery
from posekit.skeleton import JOINT, JOINTS, TREE_SEGMENTS
from posekit.synthesis import CameraSphere, Capture, clip_lengths, read_capture
from posekit.synthesis.viewpoints import look_at, to_camera, uniform_directions

SPHERE = CameraSphere(size=(2400, 2400))
"""Large pictures: a level camera at 2.5 m has the feet in them."""

EYE_HEIGHTS = (1.0, 1.7)
NOISE_PIXELS = 2.0
NEAR_EXACT, NEAR_NOISY = 0.010, 0.035
LEVEL_SINE = float(np.sin(np.radians(15.0)))
FLATTEST = 0.001
FRAMES_AT_ONCE = 12
"""Frames of a clip whose lengths are off alike."""

HELD = float(chi2.ppf(0.95, 3))
OFF = {"5 % long": 1.05, "5 % short": 0.95, "10 % long": 1.10, "10 % short": 0.90}


@dataclass(frozen=True, kw_only=True)
class Condition:
    """What is given of a body and its points."""

    group: str
    rigid: bool = False
    lengths: str = "right"
    pixels: float = 0.0
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """What a table calls it."""
        asked = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in self.settings.items())
        points = f"{self.pixels:g} px" if self.pixels else "exact points"
        body = f"{self.lengths}, rigid" if self.rigid else self.lengths
        return f"{body}, {points}{', ' if asked else ''}{asked}"

    def given(self, lengths: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
        """Return the lengths that are given for true ones."""
        if self.lengths == "3 % each":
            return {name: value * (1 + 0.03 * rng.standard_normal()) for name, value in lengths.items()}
        return {name: value * OFF.get(self.lengths, 1.0) for name, value in lengths.items()}


WRONG = (*OFF, "3 % each")
CONDITIONS = (
    Condition(group="stated", rigid=True, pixels=NOISE_PIXELS, settings={"length_deviation": 0.0}),
    Condition(group="stated", rigid=True, pixels=NOISE_PIXELS),
    Condition(group="stated", rigid=True, pixels=NOISE_PIXELS, settings={"length_deviation": 0.05}),
    Condition(group="lengths"),
    *(Condition(group="lengths", lengths=lengths) for lengths in WRONG),
    Condition(group="lengths", pixels=NOISE_PIXELS),
    Condition(group="stated", pixels=NOISE_PIXELS, settings={"length_deviation": 0.05}),
    *(Condition(group="lengths", lengths=lengths, pixels=NOISE_PIXELS) for lengths in WRONG),
    *(
        Condition(group="stated", lengths=lengths, pixels=NOISE_PIXELS, settings={"length_deviation": stated})
        for lengths, stated in zip(WRONG, (0.05, 0.05, 0.10, 0.10, 0.03), strict=True)
    ),
    *(Condition(group="ranges", settings={"ranges": ranges}) for ranges in ("urdf", "table1", "anatomical")),
)


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What holds for all conditions."""

    seed: int
    rooted: bool
    rigid: bool


@dataclass(frozen=True, kw_only=True)
class Shots:
    """Some frames of one clip, each seen by a camera of its own."""

    clip: str
    frame: NDArray[np.intp]
    level: NDArray[np.bool_]
    truth: np.ndarray
    lengths: dict[str, float]

    @cached_property
    def rigid(self) -> np.ndarray:
        """The same postures of a body that has exactly the clip's median lengths (F, 14, 3), metres."""
        figure = load_figure().scaled(self.lengths)
        placed = figure.forward_kinematics(figure.configurations(self.truth).q)[:, : len(JOINTS)]
        return placed + (self.truth - placed)[:, :1]


@dataclass(frozen=True, kw_only=True)
class Row:
    """What was found of one frame: metres, shares of joints."""

    condition: str
    clip: str
    frame: int
    level: bool
    survivors: int = 0
    best: float = np.inf
    pa: float = np.inf
    branch: float = np.inf
    inside: float = np.nan
    inside_likeliest: float = np.nan
    inside_scaled: float = np.nan
    inside_aligned: float = np.nan
    judged: str = ""
    lost_to: str = ""


def shots_of(capture: Capture, frames: int, seed: int) -> list[Shots]:
    """Draw frames evenly over the clips, and a camera for each."""
    rng = np.random.default_rng(seed)
    found = []
    clips = [capture.frames_of(k, complete=True) for k in range(len(capture.names))]
    for k, known in enumerate(clips):
        share = min(len(known), frames // len(clips) + (k < frames % len(clips)))
        if not share:
            continue
        rows = known[np.round(np.linspace(0, len(known) - 1, share)).astype(np.intp)]
        ground = float((capture.points[known, : len(JOINTS)] @ capture.up).min())
        level = np.arange(share) % 2 == 0
        truth = [
            seen(capture, capture.points[row, :14], ground, flat, rng)
            for row, flat in zip(rows, level, strict=True)
        ]
        lengths = clip_lengths(capture.points[known])
        for part in np.array_split(np.arange(share), -(-share // FRAMES_AT_ONCE)):
            found.append(
                Shots(
                    clip=capture.names[k],
                    frame=rows[part],
                    level=level[part],
                    truth=np.array(truth)[part],
                    lengths=lengths,
                )
            )
    return found


def seen(
    capture: Capture, joints: np.ndarray, ground: float, level: bool, rng: np.random.Generator
) -> np.ndarray:
    """Place a camera such that the body is in its picture, and return the joints (14, 3) in its frame."""
    middle = (joints.min(axis=0) + joints.max(axis=0)) / 2
    while True:
        away = rng.uniform(*SPHERE.distance) * uniform_directions(1, rng)[0]
        height = rng.uniform(*EYE_HEIGHTS)
        target = middle
        if level:
            distance = np.linalg.norm(away)
            away -= (away @ capture.up) * capture.up
            away *= distance / np.linalg.norm(away)
            target = middle + (ground + height - middle @ capture.up) * capture.up
        position = target + away
        there: np.ndarray = to_camera(joints, look_at(position, target, capture.up), position)
        if (there[:, 2] > 0).all() and SPHERE.fits(there[None])[0]:
            return there


def measure(condition: Condition, shots: Shots, number: int, asked: Asked) -> Iterable[Row]:
    """Recover a clip's frames and compare their survivors with the truth."""
    rng = np.random.default_rng((asked.seed, number))
    truth = shots.rigid if condition.rigid or asked.rigid else shots.truth
    image = SPHERE.camera.project(truth) + condition.pixels * rng.standard_normal(
        (len(truth), len(JOINTS), 2)
    )
    view = View(
        camera=OpenCVModel(K=SPHERE.camera.K, size=SPHERE.size),
        time=np.arange(float(len(image))),
        image=image,
        root=truth[:, 0] if asked.rooted else np.empty((0,)),
        lengths=condition.given(shots.lengths, rng),
        deviation=condition.pixels or None,
    )
    for k, frame in enumerate(frames_of(view, condition)):
        row = Row(
            condition=condition.name, clip=shots.clip, frame=int(shots.frame[k]), level=bool(shots.level[k])
        )
        yield compared(row, frame, truth[k])


def frames_of(view: View, condition: Condition) -> list[FrameRecovery]:
    """Recover, where all frames are refused together one by one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return recover(view, **condition.settings).frames
        except PosekitError as error:
            return [
                FrameRecovery(time=0.0, batch=None, index=0, reason=str(error), lost_to="view/refused")
            ] * len(view)


def compared(row: Row, frame: FrameRecovery, truth: np.ndarray) -> Row:
    """Say how far the survivors of a frame are from its truth."""
    rejected = frame.rejected
    worst = max(rejected, key=lambda name: rejected[name]) if rejected else ""
    told = replace(row, survivors=len(frame), judged=frame.judged or "", lost_to=frame.reason or worst)
    if not len(frame):
        return told
    joints = frame.joints
    fitted = align(joints, truth)
    aligned = fitted.apply(joints)
    best, pa = (np.linalg.norm(each - truth, axis=-1).mean(axis=1) for each in (joints, aligned))
    told = replace(told, best=float(best.min()), pa=float(pa.min()))
    of_branch = np.flatnonzero(same_branch(joints, truth))
    if not len(of_branch):
        return told
    refined = frame.refined
    if refined is None:
        return replace(told, branch=float(pa[of_branch].min()))
    likeliest, one = of_branch[np.argmin(refined.chi2[of_branch])], of_branch[np.argmin(best[of_branch])]
    C, x, y = refined.covariance[one, 1:], joints[one, 1:], truth[1:]
    turn = fitted.scale[one] * fitted.rotation[one]
    ratio = float(np.linalg.norm(truth[0]) / np.linalg.norm(joints[one, 0]))
    common = refined.covariance[one, 0, 2, 2] / joints[one, 0, 2] ** 2
    return replace(
        told,
        branch=float(pa[one]),
        inside=holds(x - y, C),
        inside_likeliest=holds(joints[likeliest, 1:] - y, refined.covariance[likeliest, 1:]),
        inside_scaled=holds(ratio * x - y, ratio**2 * less(C, common * x[:, :, None] * x[:, None, :])),
        inside_aligned=holds(aligned[one, 1:] - y, turn @ C @ turn.T),
    )


def less(C: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Take a part out of covariances (J, 3, 3), down to nothing."""
    values, vectors = np.linalg.eigh(C - part)
    return np.asarray((vectors * np.maximum(values, 0.0)[:, None]) @ vectors.transpose(0, 2, 1))


def same_branch(joints: np.ndarray, truth: np.ndarray) -> NDArray[np.bool_]:
    """Return which survivors (N, 14, 3) point to or from the camera as the truth, where that does so clearly."""
    start, end = np.array(TREE_SEGMENTS).T

    def away(points: np.ndarray) -> np.ndarray:
        along = points[..., end, :] - points[..., start, :]
        lengths = np.linalg.norm(along, axis=-1) * np.linalg.norm(points[..., end, :], axis=-1)
        return np.asarray((along * points[..., end, :]).sum(axis=-1) / lengths)

    true = away(truth)
    return np.asarray((~(np.abs(true) > LEVEL_SINE) | (away(joints) * true > 0)).all(axis=-1))


def holds(off: np.ndarray, C: np.ndarray) -> float:
    """Return the share of joints (J, 3) inside their 95 % ellipsoids, of covariances (J, 3, 3)."""
    square = np.einsum("ji,ji->j", off, np.linalg.solve(C + FLATTEST**2 * np.eye(3), off[..., None])[..., 0])
    return float((square < HELD).mean())


def caliscope(path: Path) -> Capture:
    """Read the points of MediaPipe's body that caliscope triangulated, smoothed over a third of a second.

    Their noise is centimetres: ask for `--rigid` truths.
    """
    layout = load_skeleton_map("mediapipe_33")
    table = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=(1, 2, 3, 4, 5))
    table = table[table[:, 1] < len(layout.points)]
    points = np.full((int(table[:, 0].max()) + 1, len(layout.points), 3), np.nan)
    points[table[:, 0].astype(int), table[:, 1].astype(int)] = table[:, 2:]
    windows = np.lib.stride_tricks.sliding_window_view(points, 9, axis=0)
    enough = np.isfinite(windows).sum(axis=-1) > windows.shape[-1] // 2
    points = np.where(enough, np.nanmedian(np.where(enough[..., None], windows, 0.0), axis=-1), np.nan)
    motion = Motion(
        names=layout.points, points=points, time=np.arange(float(len(points))), rate=1.0, source=str(path)
    )
    joints = postures_of(motion, layout).joints
    whole = joints[np.isfinite(joints).all(axis=(1, 2))]
    up = (whole[:, 0] - whole[:, [JOINT["right_ankle"], JOINT["left_ankle"]]].mean(axis=1)).mean(axis=0)
    count = len(whole)
    return Capture(
        points=np.concatenate([whole, np.full((count, 5, 3), np.nan)], axis=1),
        clip=np.zeros(count, dtype=np.intp),
        names=(path.stem,),
        actions=("",),
        fps=np.ones(1),
        up=up / np.linalg.norm(up),
        source=str(path),
    )


def line(rows: list[Row], condition: Condition, cost: float, base: float) -> list[str]:
    """Tell the numbers of one condition."""
    survivors = np.array([row.survivors for row in rows])
    best, pa, branch = (np.array([getattr(row, name) for row in rows]) for name in ("best", "pa", "branch"))
    near = NEAR_NOISY if condition.pixels or condition.lengths != "right" else NEAR_EXACT
    off = pa if condition.lengths != "right" else best
    by_clip: dict[str, list[bool]] = defaultdict(list)
    for row, lost in zip(rows, off > near, strict=True):
        by_clip[row.clip].append(bool(lost))
    shares = [float(np.mean(lost)) for lost in by_clip.values()]
    alive = survivors > 0

    def quantiles(values: np.ndarray) -> str:
        return (
            "/".join(f"{1000 * q:.0f}" for q in np.quantile(values[alive], (0.5, 0.95), method="lower"))
            if alive.any()
            else "-"
        )

    inside = [
        np.array([getattr(row, name) for row in rows])
        for name in ("inside", "inside_likeliest", "inside_scaled", "inside_aligned")
    ]
    return [
        condition.name,
        f"{(~alive).mean():.1%}",
        f"{(off > near).mean():.1%}",
        f"{min(shares):.0%} to {max(shares):.0%}",
        f"{(off <= NEAR_NOISY).mean():.1%}",
        quantiles(best),
        quantiles(pa),
        f"{np.median(survivors):.0f} ({survivors.mean():.0f})",
        f"{np.isinf(branch).mean():.1%}",
        *(f"{np.nanmean(one):.1%}" if np.isfinite(one).any() else "-" for one in inside),
        f"{cost / base:.2f}",
    ]


HEAD = (
    "lengths, points",
    "empty",
    "lost",
    "lost, by clip",
    "within 35 mm",
    "best, mm (95 %)",
    "best PA, mm (95 %)",
    "survivors, median (mean)",
    "true branch gone",
    "truth in 95 % ellipsoid",
    "likeliest",
    "scaled",
    "aligned",
    "CPU",
)


def mid_hip(points: np.ndarray) -> np.ndarray:
    """Put the pelvis (N, P, 3) into the middle of the hips, where most data sets have it."""
    middle = points.copy()
    middle[:, JOINT["pelvis"]] = points[:, [JOINT["right_hip"], JOINT["left_hip"]]].mean(axis=1)
    return middle


def bodies(capture: Capture, rng: np.random.Generator) -> list[str]:
    """Tell which bodies are refused: of whole clips, of few frames, and with the middle of the hips for a pelvis."""
    refused: dict[str, list[str]] = {"whole clips": [], "medians of 5 frames": [], "mid-hip pelvis": []}
    tried = dict.fromkeys(refused, 0)
    for k, name in enumerate(capture.names):
        points = capture.points[capture.frames_of(k, complete=True)]
        few = [("medians of 5 frames", rng.choice(points, 5)) for _ in range(5)]
        for what, some in (("whole clips", points), *few, ("mid-hip pelvis", mid_hip(points))):
            tried[what] += 1
            try:
                load_figure().scaled(clip_lengths(some))
            except PosekitError as error:
                refused[what].append(f"{name}: {error}")
    rows = [
        [what, str(tried[what]), str(len(found)), found[0] if found else "-"]
        for what, found in refused.items()
    ]
    return table_lines(("lengths of", "tried", "refused", "first"), rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--root", choices=("given", "auto"), default="given", help="whether the neck is told")
    parser.add_argument("--rigid", action="store_true", help="all truths have exactly their clip's lengths")
    parser.add_argument("--mid-hip", action="store_true", help="the pelvis is the middle of the hips")
    parser.add_argument("--only", default="bodies,lengths,stated,ranges", help="groups of conditions")
    parser.add_argument("--rows", type=Path, help="a table (CSV) with a line a frame")
    given = parser.parse_args()
    if given.capture is None:
        print("no capture given: python -m benchmarks.bodies CAPTURE")
        return
    table = given.capture.suffix == ".csv" and "sync_index" in given.capture.open().readline()
    capture = caliscope(given.capture) if table else read_capture(given.capture)
    if given.mid_hip:
        capture = replace(capture, points=mid_hip(capture.points))
    groups = given.only.split(",")
    if "bodies" in groups:
        print("Bodies that are refused\n")
        print("\n".join(bodies(capture, np.random.default_rng(given.seed))))
    shots = shots_of(capture, given.frames, given.seed)
    print(
        f"\n{sum(len(one.truth) for one in shots)} frames of {len(capture.names)} clips, seed {given.seed}\n"
    )
    asked = Asked(seed=given.seed, rooted=given.root == "given", rigid=given.rigid)
    chosen = [condition for condition in CONDITIONS if condition.group in groups]
    with loops("plain"):  # else the condition in which they begin to pay would pay for compiling them
        every, lines = measured(chosen, shots, asked)
    print("\n".join(table_lines(HEAD, lines)))
    if given.rows:
        with given.rows.open("w", newline="") as file:
            writer = csv.writer(file)
            names = [one.name for one in fields(Row)]
            writer.writerows([names, *([getattr(row, name) for name in names] for row in every)])


def measured(chosen: list[Condition], shots: list[Shots], asked: Asked) -> tuple[list[Row], list[list[str]]]:
    """Return a row a frame, and a line a condition."""
    every: list[Row] = []
    lines: list[list[str]] = []
    base = 0.0
    for one in shots[:1] if chosen else ():
        list(measure(chosen[0], one, 0, asked))  # what is loaded once is nobody's time
    for condition in chosen:
        start = time.process_time()
        rows = [row for k, one in enumerate(shots) for row in measure(condition, one, k, asked)]
        cost = time.process_time() - start
        base = base or cost
        lines.append(line(rows, condition, cost, base))
        every += rows
    return every, lines


if __name__ == "__main__":
    main()
