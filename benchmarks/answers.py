"""How good answers are: the first, what else is said, how sure, and by where the camera stands.

    python benchmarks/answers.py FILE [FILE ...] [--views 160] [--noise 2] [--seed 0] [--ranges anatomical]

A file is motion as `benchmarks/people.py` reads it. Frames are drawn evenly over its clips, each seen by a camera of
its own with f = 1500 px, 2.5 to 6 m away, every second one at a person's height, the others anywhere; the neck is
given, lengths are the clip's medians. Probabilities are the product's: what its prior knows is not held out here, and
whoever reads the tables has to know it. Prints Markdown tables, one a file.

`ECE` is the expected calibration error of the first: *nearest*, that it is the survivor nearest to the truth; *branch*,
that all its segments point as those of the survivor nearest to the truth do, by more than 5 cm of depth; *5 cm*, that
the survivor nearest to the truth is within 5 cm of it. The quantile form is that of Pierzchlewicz et al. (2022,
"Multi-hypothesis 3D human pose estimation metrics favor miscalibrated distributions", section 3): for each joint the
share of samples that are nearer to their median than the truth is, which should be uniform; the mean distance of its
distribution from the uniform one. `floor` is the likeliest posture of the true branch: what the image allows.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.people import people
from posekit.answers import ANSWER_SEGMENTS, Answer
from posekit.evaluate.scores import Reliability, reliability
from posekit.formats.markdown import table_lines
from posekit.geometry import Array, cross, unit
from posekit.measures import pa_mpjpe
from posekit.recovery import Recovery, recover
from posekit.skeleton import JOINT, JOINTS
from posekit.synthesis import CameraPlacements, CameraSphere, Capture, SyntheticScene, mocap_scenes
from posekit.synthesis.viewpoints import look_at, to_camera
from posekit.views.builtin import view_of

DIRECTIONS = ("front", "back", "side")
NEAR_METRES = 0.06
"""Metres after alignment within which a representative counts as the truth."""

LEVEL_METRES = 0.05
CHI2_OF_95_PERCENT = 7.815
N_SAMPLES = 400


@dataclass(frozen=True, kw_only=True)
class HalfHeld(CameraSphere):
    """Cameras of which every second one is held by somebody: 1 to 1.7 m above the lowest joint."""

    def place(self, points: Array, up: Array, rng: np.random.Generator) -> CameraPlacements:
        n = len(points)
        middle = (np.nanmin(points, axis=1) + np.nanmax(points, axis=1)) / 2
        R, position = (np.array(values) for values in super().place(points, up, rng))
        rows: NDArray[np.intp] = np.arange(0, n, 2)
        while len(rows):
            across = rng.standard_normal((len(rows), 3))
            across = unit(across - (across @ up)[:, None] * up)
            at = middle[rows] + rng.uniform(*self.distance, len(rows))[:, None] * across
            height = np.nanmin(points[rows] @ up, axis=1) + rng.uniform(1.0, 1.7, len(rows))
            position[rows] = at + (height - at @ up)[:, None] * up
            R[rows] = look_at(position[rows], middle[rows], up)
            rows = rows[~self.fits(to_camera(points[rows], R[rows], position[rows]))]
        return CameraPlacements(R, position)


def recovered(
    capture: Capture, views: int, noise: float, ranges: str, rng: np.random.Generator
) -> Iterator[tuple[SyntheticScene, Recovery]]:
    """Recover views of a capture, a clip at a time; the neck is exact."""
    for scene in mocap_scenes(capture, views, rng, sphere=HalfHeld()):
        view = view_of(scene.with_noise(noise, rng) if noise else scene)
        image = view.image.copy()
        image[:, 0] = scene.image[:, 0]
        yield scene, recover(replace(view, image=image, deviation=noise or None), ranges=ranges)


def direction_of(joints: Array, up: Array) -> str:
    """Say from where a camera sees a person (14, 3), about the vertical: front and back are 45 degrees to each side."""
    down = joints[JOINT["pelvis"]] - joints[JOINT["neck"]]
    left = joints[JOINT["left_shoulder"]] - joints[JOINT["right_shoulder"]]
    ahead, towards = (unit(v - (v @ up) * up) for v in (cross(down, left), -joints.mean(axis=0)))
    cosine = float(ahead @ towards)
    return "front" if cosine > np.sqrt(0.5) else "back" if cosine < -np.sqrt(0.5) else "side"


def branch_of(joints: Array) -> Array:
    """Return which end of each segment is nearer (N, 11): -1, 0, 1, where 0 is by less than 5 cm."""
    start, end = np.array(ANSWER_SEGMENTS).T
    gap = joints[..., end, 2] - joints[..., start, 2]
    return np.sign(gap) * (np.abs(gap) > LEVEL_METRES)


def same_branch(joints: Array, one: Array) -> NDArray[np.bool_]:
    """Return which postures (N, 14, 3) have no segment that points opposite to that of one."""
    return np.asarray((branch_of(joints) * branch_of(one) >= 0).all(axis=-1))


def quantiles(answer: Answer, truth: Array, rng: np.random.Generator) -> Array:
    """Return for each joint (14,) the share of samples nearer to their median than the truth is."""
    bodies = answer.bodies
    row = rng.choice(len(bodies), p=bodies.probability / bodies.probability.sum(), size=N_SAMPLES)
    root = np.linalg.cholesky(bodies.covariance)
    drawn = bodies.joints[row] + np.einsum(
        "njab,njb->nja", root[row], rng.standard_normal((N_SAMPLES, 14, 3))
    )
    median = np.median(drawn, axis=0)
    apart = np.linalg.norm(drawn - median, axis=-1)
    return np.asarray((apart < np.linalg.norm(truth - median, axis=-1)).mean(axis=0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """What became of one frame: numbers by name."""

    direction: str
    numbers: dict[str, float]
    held: NDArray[np.bool_]
    held_by_first: NDArray[np.bool_]
    quantile: Array
    depth: tuple[Array, Array]


def measured(answer: Answer, truth: Array, up: Array, rng: np.random.Generator) -> Frame:
    bodies, p = answer.bodies, answer.bodies.probability
    pa = pa_mpjpe(bodies.joints, truth).value * 1000
    near = int(np.linalg.norm(bodies.joints - truth, axis=-1).mean(axis=1).argmin())
    first = int(p.argmax())
    alike = same_branch(bodies.joints, bodies.joints[near])
    off = truth - bodies.joints[first]
    chi2 = np.einsum("ja,jab,jb->j", off, np.linalg.inv(bodies.covariance[first]), off)
    around = np.linalg.norm(bodies.joints[near] - answer.posture, axis=-1).max() <= LEVEL_METRES
    return Frame(
        direction=direction_of(truth, up),
        numbers={
            "bodies": len(bodies),
            "first": pa[first],
            "answer": pa[answer.rows[0]],
            "best": pa.min(),
            "floor": pa[np.where(alike, p, -1.0).argmax()],
            "random": pa.mean(),
            "representatives": len(answer),
            "near": pa[answer.rows].min() <= NEAR_METRES * 1000,
            "nearest stated": p[first],
            "nearest true": first == near,
            "branch stated": p[same_branch(bodies.joints, bodies.joints[first])].sum(),
            "branch true": alike[first],
            "5 cm stated": answer.sure,
            "5 cm true": around,
        },
        held=answer.regions.holds(truth),
        held_by_first=chi2 <= CHI2_OF_95_PERCENT,
        quantile=quantiles(answer, truth, rng),
        depth=(
            np.stack([answer.depth.near, answer.depth.far]),
            branch_of(truth) == np.array([[-1.0], [1.0]]),
        ),
    )


def sureness(frames: list[Frame], name: str) -> Reliability:
    """Compare how sure the first is said to be with what came true."""
    stated, true = (
        np.array([f.numbers[f"{name} {part}"] for f in frames], dtype=np.float64)
        for part in ("stated", "true")
    )
    found = reliability(stated, true)
    assert found is not None
    return found


def quantile_error(frames: list[Frame]) -> float:
    """Return the mean distance of the quantiles' distributions, a joint each, from the uniform one."""
    q = np.linspace(0.0, 1.0, 101)
    quantile = np.array([frame.quantile for frame in frames])[:, 1:]
    return float(np.abs((quantile[:, :, None] <= q).mean(axis=0) - q).mean())


def row(name: str, frames: list[Frame]) -> list[str]:
    def middle(key: str) -> str:
        values = [frame.numbers[key] for frame in frames]
        return f"{np.median(values):.0f} ({np.mean(values):.0f})"

    stated, true = (np.concatenate([f.depth[k].ravel() for f in frames]) for k in (0, 1))
    depth = reliability(stated, true.astype(np.float64))
    few = [frame.numbers["representatives"] for frame in frames]
    return [
        f"{name} ({len(frames)})",
        f"{np.median([frame.numbers['bodies'] for frame in frames]):.0f}",
        *[middle(key) for key in ("first", "answer", "floor", "best", "random")],
        f"{np.median(few):g} ({np.mean(few):.1f})",
        f"{np.mean([frame.numbers['near'] for frame in frames]):.1%}",
        f"{np.mean([frame.held[1:] for frame in frames]):.1%}",
        f"{np.mean([frame.held_by_first[1:] for frame in frames]):.1%}",
        *[f"{sureness(frames, name).error:.3f}" for name in ("nearest", "branch", "5 cm")],
        f"{quantile_error(frames):.3f}",
        "" if depth is None else f"{depth.error:.3f}",
    ]


HEAD = [
    "views",
    "bodies",
    "first, mm PA, median (mean)",
    "answer",
    "floor",
    "best",
    "random",
    "representatives",
    "truth near one",
    "mixture's regions hold",
    "first's ellipsoids hold",
    "ECE nearest",
    "branch",
    "5 cm",
    "quantile form",
    "near and far",
]


def report(path: Path, given: argparse.Namespace) -> None:
    capture, rng = people(path), np.random.default_rng(given.seed)
    frames, missing, start = [], 0, time.process_time()
    for scene, found in recovered(capture, given.views, given.noise, given.ranges, rng):
        ups = scene.R_cam_world @ capture.up
        for answer, truth, up in zip(found.answers, scene.joints_cam, ups, strict=True):
            if len(answer):
                frames.append(measured(answer, truth, up, rng))
            else:
                missing += 1
    spent = (time.process_time() - start) / max(len(frames) + missing, 1)
    print(
        f"{path.name}: {len(capture.names)} clips, {given.noise:g} px, {given.ranges}; {missing} frames without a"
    )
    print(f"posture, {spent * 1000:.0f} ms of CPU a frame with all of this; joints: all but the neck\n")
    parts = [("all", frames), *((name, [f for f in frames if f.direction == name]) for name in DIRECTIONS)]
    print("\n".join(table_lines(HEAD, [row(name, part) for name, part in parts if part])))
    held = np.mean([frame.held for frame in frames], axis=0)
    print(
        "regions hold: " + ", ".join(f"{name} {share:.0%}" for name, share in zip(JOINTS, held, strict=True))
    )
    stated = sureness(frames, "nearest")
    rows = [
        [f"{mean:.2f}", f"{share:.2f}", str(count)]
        for mean, share, count in zip(stated.probability, stated.share, stated.frames, strict=True)
        if count
    ]
    print("\n" + "\n".join(table_lines(["nearest: stated", "came true", "frames"], rows)), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", type=Path, nargs="*")
    parser.add_argument("--views", type=int, default=160)
    parser.add_argument("--noise", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ranges", default="anatomical")
    given = parser.parse_args()
    if not given.files:
        print("no file given: python benchmarks/answers.py FILE [FILE ...]")
    warnings.simplefilter("ignore", UserWarning)
    for path in given.files:
        report(path, given)


if __name__ == "__main__":
    main()
