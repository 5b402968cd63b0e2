"""Sequences: how far the cheapest path is from the truth, from all sides, how sure it is, and how fast it is found.

    python benchmarks/sequences.py [CAPTURE.npz] [--beside FILE] [--yaws 8] [--only accuracy,sure,speed,scale,depth]

A synthetic walker from six sides, and real motion capture (an NPZ as `posekit synth mocap` reads it): the first two
seconds of every clip of walking and running seen from `--yaws` sides, and of six clips of other actions from two; a
standing camera 1.4 m high, f = 1500 px, so far away that the whole way is in the picture; 30 frames a second; the neck
is given. Exact points, recovered as `posekit recover` does; and 2 px of noise, recovered on trunks that the noise
allows, refined and merged. Survivors cost nothing, or minus the log of their probability by a prior that was fitted to
the other actions, or to the other clips, and to other sources' other actions (``--beside``, as `benchmarks/people.py`
reads them), with a camera that is taken to be level.

A limb-frame is right where both segments of an arm or a leg are on their true side, near or far; `told apart` leaves
out segments within 15 degrees of the plane across their ray, whose sides 2 px do not tell apart. Prints Markdown.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from sequence_views import (  # type: ignore[import-not-found]  # the script beside this one
    Priors,
    Recovered,
    clip_scene,
    exact,
    noisy,
    odds_of_two,
    odds_table,
    scenes,
    survivors_of,
    view_of,
    walker_scene,
)

from benchmarks.people import people
from posekit.cameras.neck import place
from posekit.following import (
    Beam,
    Follower,
    LiveEstimate,
    Paths,
    SurvivorFrame,
    best_paths,
    elevations,
)
from posekit.formats.markdown import table_lines
from posekit.ranking import load_prior
from posekit.recovery.scaled_sequences import follow_scaled
from posekit.skeleton import JOINTS, PARENTS
from posekit.synthesis import Capture, SyntheticScene, read_capture

TOLD_APART = math.radians(15.0)
LIMB_SEGMENTS = ((5, 7), (6, 8), (9, 11), (10, 12))
"""Segments of the two arms and the two legs, in tree order."""

FRAMES_PER_SECOND = 30.0
LAG_FRAMES = 10
PRIOR_KINDS = ("not ranked", "by action", "by clip")
"""What the prior was not fitted to, where survivors are ranked."""


def costed(found: Recovered, priors: Priors, clip: str, costs: str) -> list[SurvivorFrame]:
    frames: list[SurvivorFrame] = (
        found.frames
        if costs == "not ranked"
        else found.ranked(priors.without(costs.removeprefix("by "), clip))
    )
    return frames


def error(joints: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return the mean joint error (...,), mm."""
    return np.asarray(np.linalg.norm(joints - truth, axis=-1).mean(axis=-1) * 1000)


def limbs_right(joints: np.ndarray, truth: np.ndarray, least: float) -> np.ndarray:
    """Tell which limb-frames (T, 4) have the true sides; segments that stand out by less than `least` pass."""
    true = elevations(truth)
    right = ((elevations(joints) > 0) == (true > 0)) | (np.abs(true) < least)
    return np.stack([right[:, a] & right[:, b] for a, b in LIMB_SEGMENTS], axis=1)


def outcome(frames: list[SurvivorFrame], truth: np.ndarray, near: float) -> dict[str, float]:
    """Measure a sequence."""
    start = time.process_time()
    path: Paths = best_paths(frames)
    seconds = time.process_time() - start
    joints = path.joints[0]
    start = time.process_time()
    live = np.stack([found.joints for found in follow(frames, LAG_FRAMES)])
    live_seconds = time.process_time() - start
    full = [k for k, frame in enumerate(frames) if len(frame)]
    errors = {k: error(frames[k].joints, truth[k]) for k in full}
    best = [limbs_right(frames[k].joints[[errors[k].argmin()]], truth[[k]], TOLD_APART).mean() for k in full]
    return {
        "survivors": float(np.median([len(frame) for frame in frames])),
        "truth kept": float(np.mean([k in errors and errors[k].min() < near for k in range(len(frames))])),
        "best": float(np.mean([errors[k].min() for k in full])),
        "random": float(np.mean([errors[k].mean() for k in full])),
        "first": float(np.mean([errors[k][int(np.argmin(frames[k].cost))] for k in full])),
        "path": float(error(joints, truth).mean()),
        "survivors of path": float(np.nanmean(error(survivors_of(frames, path.survivor[0]), truth))),
        "live": float(error(live, truth).mean()),
        "limbs": float(limbs_right(joints, truth, 0.0).mean()),
        "limbs of best": float(np.mean(best)),
        "told apart": float(limbs_right(joints, truth, TOLD_APART).mean()),
        "bridged": float(path.bridged[0].mean()),
        "rate": len(frames) / seconds,
        "live rate": len(frames) / live_seconds,
    }


def follow(frames: list[SurvivorFrame], lag: int, beam: Beam | None = None) -> Iterator[LiveEstimate]:
    """Follow live; the frames are made anew, as they come."""
    follower = Follower(lag=lag, beam=beam)
    for frame in frames:
        fresh = SurvivorFrame(
            time=frame.time, joints=frame.joints, cost=frame.cost, covariance=frame.covariance
        )
        estimate = follower.push(fresh)
        if estimate is not None:
            yield estimate
    yield from follower.finish()


TABLE_HEAD = (
    ("survivors", "survivors, median", "{:.0f}"),
    ("truth kept", "frames with the truth", "{:.1%}"),
    ("random", "random, mm", "{:.0f}"),
    ("first", "first of each frame, mm", "{:.0f}"),
    ("path", "path, mm", "{:.1f}"),
    ("survivors of path", "its survivors, mm", "{:.1f}"),
    ("live", f"live, lag {LAG_FRAMES}, mm", "{:.1f}"),
    ("best", "best of each frame, mm", "{:.1f}"),
    ("limbs", "limb-frames right", "{:.1%}"),
    ("told apart", "told apart: path", "{:.1%}"),
    ("limbs of best", "told apart: best of each frame", "{:.1%}"),
    ("bridged", "bridged", "{:.1%}"),
    ("rate", "frames/s", "{:.0f}"),
    ("live rate", "live, frames/s", "{:.0f}"),
)


def accuracy(capture: Capture | None, priors: Priors, yaws: int, seed: int) -> None:
    table, sides, far = [], [], []
    for pixels, near in ((0.0, 10.0), (2.0, 35.0)):
        found: dict[tuple[str, str], list[dict[str, float]]] = defaultdict(list)
        by_side: dict[tuple[str, int], list[tuple[float, float]]] = defaultdict(list)
        for number, (action, clip, yaw, scene) in enumerate(scenes(capture, yaws)):
            if pixels:
                seen = scene.with_noise(pixels, np.random.default_rng(seed + number))
                recovered = noisy(seen, pixels, real=bool(clip))
            else:
                recovered = exact(scene)
            for costs in PRIOR_KINDS if clip else (PRIOR_KINDS[0], PRIOR_KINDS[2]):
                result = outcome(costed(recovered, priors, clip, costs), scene.joints_cam, near)
                found[action, costs].append(result)
                if costs == PRIOR_KINDS[2]:
                    by_side[action, yaw].append((result["path"], result["told apart"]))
        for (action, costs), results in found.items():
            cells = [form.format(np.mean([one[key] for one in results])) for key, _, form in TABLE_HEAD]
            table.append([f"{pixels:g}", action, costs, str(len(results)), *cells])
            paths, firsts = (np.array([one[key] for one in results]) for key in ("path", "first"))
            if costs == PRIOR_KINDS[2]:
                worst = int(np.argmax(paths - firsts))
                far.append(
                    [
                        f"{pixels:g}",
                        action,
                        f"{np.mean(paths > 40):.0%}",
                        f"{paths.max():.0f}",
                        f"{np.mean(paths > firsts):.0%}",
                        f"{np.mean(paths > firsts + 5):.0%}",
                        f"{firsts[worst]:.0f} to {paths[worst]:.0f}",
                    ]
                )
        for (action, yaw), values in by_side.items():
            if action in ("walking", "running"):
                path, told = np.mean(values, axis=0)
                sides.append([f"{pixels:g}", action, str(yaw), f"{path:.1f}", f"{told:.1%}"])
    head = ["noise, px", "motion", "ranked", "sequences", *(label for _, label, _ in TABLE_HEAD)]
    show("Accuracy", head, table)
    if sides:
        show(
            "From every side, ranked by clip",
            ["noise, px", "motion", "yaw, deg", "path, mm", "told apart: path"],
            sides,
        )
    show(
        "Sequences whose path is off by more than 40 mm, or worse than the first of each frame, ranked by clip",
        [
            "noise, px",
            "motion",
            "share",
            "worst, mm",
            "worse",
            "by more than 5 mm",
            "the worst: first to path, mm",
        ],
        far,
    )


def sure(capture: Capture | None, priors: Priors, seed: int) -> None:
    """Compare the odds between the two cheapest paths with which of them was nearer, where they differ."""
    odds: list[tuple[float, bool]] = []
    for number, (_, clip, _, scene) in enumerate(scenes(capture, 4)):
        found = noisy(scene.with_noise(2.0, np.random.default_rng(seed + number)), 2.0, real=bool(clip))
        frames = costed(found, priors, clip, PRIOR_KINDS[2])
        for apart in (0.25, 0.5):
            odds += odds_of_two(frames, scene.joints_cam, apart)
    show("How sure: the first of two paths, 2 px, ranked by clip", *odds_table(odds))


def crowd(count: int, frames: int, seed: int) -> list[SurvivorFrame]:
    """Make frames of a walker with wrong postures added: limbs mirrored in depth, all else the same."""
    rng = np.random.default_rng(seed)
    truth = walker_scene(30.0, frames).joints_cam
    found = []
    for k, joints in enumerate(truth):
        postures = np.repeat(joints[None], count, axis=0)
        for one in range(1, count):
            for child in range(1, len(JOINTS)):
                if rng.random() < 0.3:
                    postures[one, child, 2] += 2 * (joints[PARENTS[child], 2] - joints[child, 2])
        found.append(SurvivorFrame(time=k / FRAMES_PER_SECOND, joints=postures))
    return found


def timed(run: Callable[[], object], repeats: int = 3) -> float:
    run()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times)


def speed(capture: Capture | None) -> None:
    rows = []
    for count in (10, 20, 50, 100, 200, 500, 1000, 2000):
        frames = crowd(count, 60 if count < 500 else 20, 0)
        repeats = 3 if count < 500 else 1
        live = timed(lambda frames=frames: list(follow(frames, LAG_FRAMES)), repeats)  # type: ignore[misc]
        offline = timed(lambda frames=frames: best_paths(frames), repeats)  # type: ignore[misc]
        rows.append([str(count), f"{len(frames) / live:.0f}", f"{len(frames) / offline:.0f}"])
    show(
        "Speed: frames/s of CPU time on one core, crowds of mirrored limbs",
        ["survivors a frame", f"live, lag {LAG_FRAMES}", "offline"],
        rows,
    )
    chosen = [("synthetic walking", "", walker_scene(30.0))]
    if capture is not None:
        chosen += [
            ("walking", clip, clip_scene(capture, clip, 30)) for clip in capture.names if "walking" in clip
        ]
    rows = []
    for action, clip, scene in chosen:
        for pixels in (0.0, 2.0):
            seen = scene.with_noise(pixels, np.random.default_rng(0)) if pixels else scene
            start = time.process_time()
            found = noisy(seen, pixels, real=bool(clip)) if pixels else exact(seen)
            recovering = time.process_time() - start
            prior = load_prior()
            ranking = timed(lambda found=found, prior=prior: found.ranked(prior), 1)  # type: ignore[misc]
            frames = found.ranked(prior)
            following = timed(lambda frames=frames: list(follow(frames, LAG_FRAMES)), 1)  # type: ignore[misc]
            spent = (following, following + ranking, following + ranking + recovering)
            median = np.median([len(frame) for frame in frames])
            rows.append(
                [
                    f"{pixels:g}",
                    f"{action} {clip}",
                    f"{median:.0f}",
                    *(f"{len(frames) / each:.0f}" for each in spent),
                ]
            )
    show(
        f"Live, lag {LAG_FRAMES}: frames a second of CPU time on one core (recovery and ranking of all frames at once)",
        ["noise, px", "motion", "survivors, median", "followed", "and ranked", "and recovered"],
        rows,
    )


def scale(capture: Capture | None, priors: Priors, seed: int) -> None:
    rows = []
    for pixels in (1.0, 2.0, 5.0):
        for name, chosen in (
            ("synthetic walking", [walker_scene(yaw, 30) for yaw in (15, 135)]),
            ("walking, running", of_clips(capture, ("walking", "running"), (20, 110))),
        ):
            off, stated, ends = [], [], 0
            for number, scene in enumerate(chosen):
                seen = scene.with_noise(pixels, np.random.default_rng(seed + number))
                for wrong in (0.95, 1.05):
                    lengths = {part: length * wrong for part, length in scene.figure.lengths.items()}
                    view = replace(view_of(seen, scene.figure.scaled(lengths)), deviation=pixels)
                    found = follow_scaled(view)
                    off.append(found.scale * wrong - 1)
                    stated.append(found.deviation)
                    ends += found.at_the_end
            if off:
                away = np.abs(off)
                rows.append(
                    [
                        f"{pixels:g}",
                        name,
                        str(len(off)),
                        f"{np.median(away):.1%}",
                        f"{np.sqrt(np.mean(np.square(off))):.1%}",
                        f"{away.max():.1%}",
                        f"{np.median(stated):.1%}",
                        f"{np.mean(away < np.multiply(2, stated)):.0%}",
                        str(ends),
                    ]
                )
    show(
        "Scale of the lengths, which are 5 % too small or too large",
        [
            "noise, px",
            "motion",
            "sequences",
            "off, median",
            "rms",
            "at most",
            "stated, median",
            "within twice that",
            "at the end",
        ],
        rows,
    )


def of_clips(
    capture: Capture | None, actions: tuple[str, ...], yaws: tuple[int, ...]
) -> list[SyntheticScene]:
    if capture is None:
        return []
    return [
        clip_scene(capture, clip, yaw)
        for clip, action in zip(capture.names, capture.actions, strict=True)
        if action in actions
        for yaw in yaws
    ]


def depth(capture: Capture | None, priors: Priors) -> None:
    chosen = [("synthetic walking", walker_scene(yaw, 40)) for yaw in range(15, 360, 60)]
    chosen += [("walking", scene) for scene in of_clips(capture, ("walking",), (40, 130, 220, 310))]
    found: dict[tuple[str, str], list[list[float]]] = defaultdict(list)
    names = () if capture is None else tuple(clip for clip in capture.names if "walking" in clip)
    clips = ["" for _ in range(6)] + [clip for clip in names for _ in range(4)]
    for (action, scene), clip in zip(chosen, clips, strict=True):
        true = scene.joints_cam
        placements = place(scene.camera, scene.figure, scene.image, np.full((len(scene), 5, 2), np.nan))
        told = np.array([one.estimate for one in placements])
        recovered = exact(scene, rooted=False)
        for costs in (PRIOR_KINDS[0], PRIOR_KINDS[2]):
            frames = costed(recovered, priors, clip, costs)
            path: Paths = best_paths(frames)
            joints = path.joints[0]
            found[action, costs].append(
                [
                    float(np.median([len(frame) for frame in frames])),
                    *(float(np.nanmean(np.abs(at - true[:, 0, 2]))) * 1000 for at in (told, joints[:, 0, 2])),
                    float(error(joints - joints[:, :1], true - true[:, :1]).mean()),
                ]
            )
    rows = [
        [action, name, str(len(values)), *(f"{value:.0f}" for value in np.mean(values, axis=0))]
        for (action, name), values in found.items()
    ]
    head = [
        "motion",
        "ranked",
        "sequences",
        "survivors, median",
        "neck's depth, the frame's estimate, mm",
        "path, mm",
        "joints relative to the neck, path, mm",
    ]
    show(
        "Depth of the neck, which is not given: placed in every frame, and along the path",
        head,
        rows,
    )


def show(title: str, head: list[str], rows: list[list[str]]) -> None:
    print(f"\n{title}\n")
    print("\n".join(table_lines(head, rows)), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--beside", type=Path, nargs="*", default=[], help="motion that priors know too")
    parser.add_argument("--yaws", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="accuracy,sure,speed,scale,depth")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    capture = None if given.capture is None else read_capture(given.capture)
    priors = Priors(capture, [people(path) for path in given.beside])
    parts = given.only.split(",")
    if "accuracy" in parts:
        accuracy(capture, priors, given.yaws, given.seed)
    if "sure" in parts:
        sure(capture, priors, given.seed)
    if "speed" in parts:
        speed(capture)
    if "scale" in parts:
        scale(capture, priors, given.seed)
    if "depth" in parts:
        depth(capture, priors)


if __name__ == "__main__":
    main()
