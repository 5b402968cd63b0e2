"""Quality of answers on people: errors, representatives, stated probability, and coverage of 95 % regions.

    python -m benchmarks.people [--data DIR] [--views 600] [--noise 2] [--trial POSE2SIM_FOLDER] [--only NAME,NAME]

Motion is read from files (`--data`), or it is a walker's. Every body has the same number of frames, drawn evenly over
its clips, because many clips of one data set have the same skeleton. Each frame has another random camera 2.5 to 6 m
away. Lengths are the medians of each clip; the stated deviation is the root mean square deviation of the clip's lengths
from them, because spines bend and shoulders move. Conditions:

- neck: the neck is given exactly;
- no neck: neither neck nor head points are given, and depth follows from the lengths;
- taped neck, taped no neck: the same with lengths that have a common error of 2 % and own errors of 2 %, and no
  stated deviation;
- photograph: camera and lengths are unknown as well;
- a trial: key points of a detector, with the calibration (TOML) and the motion (TRC) of the same seconds.
  The truth is the TRC's; the person is described by a stature only, or by the lengths in frames that no picture
  shows.

`60 mm` is the share of frames in which a representative is within 60 mm of the truth after alignment. `sure` is
compared with the frequency at which every joint of the answer is within 5 cm of the truth (expected calibration error).
The floor is the calibration error of exactly right probabilities for the same number of frames.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import posekit
from benchmarks.common import data_of, parser, recordings, table
from posekit.body import segment_lengths
from posekit.body.lengths import lengths_in_frames
from posekit.cameras import View
from posekit.evaluation import Evaluation, evaluate, posture_errors, with_truth
from posekit.evaluation.scores import MEASURES, reliability
from posekit.geometry import Array
from posekit.motion import Motion
from posekit.ranking.directions import LIMB_SEGMENTS
from posekit.recovery import Recovery
from posekit.skeleton import segment_name
from posekit.synthesis import forget_camera, mocap_views, with_noise

NEAR_METRES = 0.06
TAPE_DEVIATION = 0.02
SAME_BODY_METRES = 0.01
"""Largest difference of the limbs' lengths in clips of one body."""
PA = MEASURES.index("pa")
HEAD = (
    "condition",
    "frames",
    "empty",
    "best",
    "first",
    "answer",
    "representatives",
    "60 mm",
    "sure, mean",
    "true",
    "ECE",
    "floor",
    "regions",
    "ms",
)


@dataclass(frozen=True)
class Found:
    """Evaluation of one view, number of representatives, distance (F,) of the nearest, metres, and seconds."""

    evaluation: Evaluation
    representatives: Array
    near: Array
    seconds: float


def measured(view: View) -> Found:
    """Recover a view with truth and compare."""
    start = time.process_time()
    result = posekit.recover(view)
    seconds = time.process_time() - start
    return Found(evaluate(result, view.truth), *representatives(result, view.truth), seconds)


def representatives(result: Recovery, truth: Array) -> tuple[Array, Array]:
    """Return the number of representatives of each frame, and the distance of the one nearest to the truth (PA)."""
    count, near = np.zeros(len(result)), np.full(len(result), np.nan)
    for k, rows in enumerate(result.answer.representatives):
        joints = result.survivors.joints[np.asarray(rows, dtype=np.intp)]
        count[k] = len(rows)
        if len(rows):
            errors = posture_errors(joints, np.broadcast_to(truth[k], joints.shape))
            near[k] = np.nanmin(errors[:, PA])
    return count, near


def neck_given(view: View) -> View:
    neck = view.truth[:, 0]
    image = view.image.copy()
    image[:, 0] = view.camera.project(neck)
    return replace(view, root=neck, image=image)


def neck_unknown(view: View) -> View:
    nothing = np.full((len(view), 3), np.nan)
    head = np.full_like(view.head_image, np.nan)
    return replace(view, root=nothing, head_image=head)


def taped(view: View) -> View:
    """Return a view with taped lengths: common and own errors of `TAPE_DEVIATION`, without a stated deviation."""
    rng = np.random.default_rng(int(1e6 * abs(view.image[0, 0, 0])))  # another tape for each view
    off = TAPE_DEVIATION * (rng.normal() + rng.normal(size=len(view.lengths)))
    lengths = {name: length * np.exp(x) for (name, length), x in zip(view.lengths.items(), off, strict=True)}
    return replace(view, lengths=lengths, length_deviation=None)


def photograph(view: View) -> View:
    return replace(forget_camera(neck_unknown(view)), lengths={}, shoulders=None)


CONDITIONS: dict[str, Callable[[View], View]] = {
    "neck": neck_given,
    "no neck": neck_unknown,
    "taped neck": lambda view: taped(neck_given(view)),
    "taped no neck": lambda view: taped(neck_unknown(view)),
    "photograph": photograph,
}


def views_of(motions: Iterable[Motion], count: int, noise: float, rng: np.random.Generator) -> list[View]:
    """Draw views in equal shares of bodies, and of the clips of a body, with noise."""
    found: list[View] = []
    bodies = clips_by_body(motions)
    for clips, of_body in zip(bodies, shares(count, len(bodies)), strict=True):
        for clip, share in zip(clips, shares(of_body, len(clips)), strict=True):
            whole = clip.figure_joints[np.isfinite(clip.figure_joints).all(axis=(1, 2))]
            if min(share, len(whole)):
                stated = length_deviation(whole)
                for drawn in mocap_views(clip, min(share, len(whole)), rng):
                    view = with_noise(drawn, noise, rng) if noise else drawn
                    found.append(replace(view, length_deviation=stated))
    return found


def length_deviation(joints: Array) -> float:
    """Return the root mean square relative deviation of the lengths of postures (N, 14, 3) from their medians."""
    lengths = np.log(lengths_in_frames(joints))
    return float(np.sqrt(((lengths - np.median(lengths, axis=1, keepdims=True)) ** 2).mean()))


def shares(count: int, parts: int) -> list[int]:
    """Divide a number into parts that differ by at most one."""
    return [count // parts + (k < count % parts) for k in range(parts)]


def clips_by_body(motions: Iterable[Motion]) -> list[list[Motion]]:
    """Return the clips of each body; clips with equal limb lengths belong to one body."""
    bodies: list[tuple[Array, list[Motion]]] = []
    for clip in motions:
        lengths = segment_lengths(clip.figure_joints)
        limbs = np.array([lengths[segment_name(pair)] for pair in LIMB_SEGMENTS])
        for own, clips in bodies:
            if np.abs(own - limbs).max() <= SAME_BODY_METRES:
                clips.append(clip)
                break
        else:
            bodies.append((limbs, [clip]))
    return [clips for _, clips in bodies]


def trial_views(folder: Path, stature: float) -> Iterator[tuple[str, View]]:
    """Yield the view of each camera of a trial, by stature and by the lengths of the same recording."""
    calibration, truth = (next(folder.glob(f"*.{ending}")) for ending in ("toml", "trc"))
    motion = posekit.open(truth)
    for name, camera in posekit.open(calibration).items():
        pictures = folder / "pose" / f"{name.replace('_', '')}_json"
        if not pictures.is_dir():
            continue
        seen = posekit.open(pictures)
        rest = motion.figure_joints[len(set(np.asarray(seen.frame).tolist())) :]
        for how, lengths in ((f"stature {stature:g} m", {}), ("lengths", segment_lengths(rest))):
            view = replace(seen.view(camera, rate=motion.rate, stature=None if lengths else stature))
            view = replace(view, lengths=lengths) if lengths else view
            yield f"{folder.name} {name}, {how}", with_truth(view, motion)[0]


def least_error(sure: Array) -> float:
    """Return the mean calibration error, over 200 draws, of events whose stated probabilities are exact."""
    rng = np.random.default_rng(0)
    draws = [reliability(sure, (rng.random(len(sure)) < sure).astype(np.float64)) for _ in range(200)]
    return float(np.mean([one["ece"] for one in draws if one is not None]))


def row(name: str, parts: list[Found]) -> tuple[str, ...]:
    """Sum up one condition."""
    whole = Evaluation.joined([one.evaluation for one in parts], {})
    said, near = whole.summary(), np.concatenate([one.near for one in parts])
    count = np.concatenate([one.representatives for one in parts])
    sure, true = whole.columns["sure"], whole.columns["sure_true"]
    both = np.isfinite(sure) & np.isfinite(true)
    stated = said["calibration"]["sure"]
    error = said["error_mm"]
    return (
        name,
        str(len(whole)),
        f"{said['without_survivor'] / len(whole):.1%}",
        *(
            f"{error[role]['pa']['median']:.1f}" if role in error else "-"
            for role in ("best", "first", "answer")
        ),
        f"{np.median(count[count > 0]):g}" if count.any() else "-",
        f"{np.mean(near <= NEAR_METRES):.0%}",
        f"{sure[both].mean():.2f}",
        f"{true[both].mean():.2f}",
        "-" if stated is None else f"{stated['ece']:.3f}",
        "-" if stated is None else f"{least_error(sure[both]):.3f}",
        "-" if said["regions"] is None else f"{said['regions']:.1%}",
        f"{1000 * sum(one.seconds for one in parts) / len(whole):.0f}",
    )


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--views", type=int, default=600)
    made.add_argument("--noise", type=float, default=2.0)
    made.add_argument("--trial", type=Path)
    made.add_argument("--stature", type=float, default=1.75)
    made.add_argument("--only", default=",".join(CONDITIONS))
    given = made.parse_args()
    views = views_of(recordings(data_of(given)), given.views, given.noise, np.random.default_rng(given.seed))
    rows = [
        row(name, [measured(CONDITIONS[name](view)) for view in views])
        for name in given.only.split(",")
        if name
    ]
    for name, view in trial_views(given.trial, given.stature) if given.trial else ():
        rows.append(row(name, [measured(view)]))
        print(rows[-1], flush=True)
    print(f"{given.noise:g} px; errors are medians after alignment (PA), mm; ms of processor time a frame")
    print(table(HEAD, rows))


if __name__ == "__main__":
    main()
