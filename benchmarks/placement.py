"""Placing the neck without a rigid head of six points: how well each method tells its depth, and how fast.

    python benchmarks/placement.py [--views 1000] [--capture FILE] [--trial FOLDER]

Random legal postures 2.5 to 6 m from a camera with f = 1500 px, all points with the same normal error, which the
methods are told. `inside`: the true depth is among those that the search leaves; `kept`: some neck is within a step of
it; `median` and `95 %`: the error of the one depth that the method would tell, m; `necks`: how many a frame; `step`:
how far a possible depth is from a neck at most, m. Then what a step means: the joints relative to the neck, where the
tree grows from a neck that is off by so much.

FILE is a motion capture archive as `posekit synth mocap` reads it. FOLDER is a trial with OpenPose BODY_25B detections
(`pose/cam01_json/*.json`), a calibration (`Calib_*.toml`) and its triangulation (`*.trc`), as Pose2Sim's demos have
them. Frames a second are of one run on one machine.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
import tomllib
from pathlib import Path

import numpy as np

from posekit.body import Figure, load_figure
from posekit.body.lengths import hips_points, torso_points
from posekit.body.stature import stature_from_lengths
from posekit.cameras import PinholeCamera
from posekit.cameras.neck import NeckPlacement, place
from posekit.geometry import rotation_from_vector
from posekit.settings.rooting import RootMethod
from posekit.skeleton import JOINT, JOINTS, PARENTS, SIDES, TREE_SEGMENTS, segment_name
from posekit.synthesis import SyntheticScene, mocap_scenes, random_views, read_capture

NOISE_PIXELS = (0.0, 1.0, 2.0, 5.0, 10.0, 15.0)
METHOD_ORDER: tuple[RootMethod, ...] = ("search", "torso", "head", "auto")
TABLE_HEADER = (
    f"{'':>8} {'px':>4} {'cm':>4} {'inside':>7} {'kept':>6} {'median':>7} {'95 %':>7} {'necks':>6} {'step':>6} "
    f"{'frames/s':>9}"
)
TOLD_PIXELS = (1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 15.0)
TOLD_NOISE = (*((px, 0.0) for px in TOLD_PIXELS), (2.0, 0.01), (5.0, 0.01), (5.0, 0.02))
"""Deviations (px) and offsets (m) that the methods are told of real postures and detections."""


def inside(found: NeckPlacement, depth: float) -> bool:
    low, high = found.intervals.T
    return bool(((low <= depth + 1e-6) & (high >= depth - 1e-6)).any())


def row(
    name: str, error: tuple[float, float], found: list[NeckPlacement], depths: np.ndarray, seconds: float
) -> None:
    """Print a line; `error` is the deviation and the offset."""
    pairs = list(zip(found, depths, strict=True))
    kept = [np.abs(one.depths - depth).min(initial=np.inf) <= one.step + 1e-6 for one, depth in pairs]
    away = np.array([abs(one.estimate - depth) for one, depth in pairs])
    median, most = np.nanpercentile(away, [50, 95]) if np.isfinite(away).any() else (np.nan, np.nan)
    methods = [one.method for one in found]
    counts = ", ".join(f"{methods.count(name)} {name}" for name in sorted(set(methods)))
    print(
        f"{name:>8} {error[0]:4g} {error[1] * 100:4g} {np.mean([inside(*pair) for pair in pairs]):7.3f} "
        f"{np.mean(kept):6.3f} {median:7.3f} {most:7.3f} {np.mean([len(one.necks) for one in found]):6.1f} "
        f"{np.mean([one.step for one in found]):6.3f} {len(found) / seconds:9.0f}  {counts if name == 'auto' else ''}"
    )


def table(scene: SyntheticScene, rng: np.random.Generator) -> None:
    for method in METHOD_ORDER:
        for noise in NOISE_PIXELS:
            noisy = scene.with_noise(noise, rng)
            start = time.perf_counter()
            found = place(
                noisy.camera, noisy.figure, noisy.image, noisy.head_image, method=method, deviation=noise
            )
            row(method, (noise, 0.0), found, scene.joints_cam[:, 0, 2], time.perf_counter() - start)


def steps(scene: SyntheticScene) -> None:
    """Grow from a neck that is off along its ray, each joint on the branch that is nearer to the truth."""
    lengths = [0.0] + [scene.figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS]
    true = scene.joints_cam
    ray = true[:, 0] / np.linalg.norm(true[:, 0], axis=1, keepdims=True)
    print(f"\n{'off by':>8} {'median':>7} {'95 %':>7}   joints relative to the neck, m")
    for off in (-0.10, -0.05, -0.025, 0.025, 0.05, 0.10):
        placed = np.full_like(true, np.nan)
        placed[:, 0] = true[:, 0] + off * ray
        for joint in range(1, len(JOINTS)):
            start = placed[:, PARENTS[joint]]
            ends = scene.camera.lift(
                start, scene.image[:, joint], np.array(lengths[joint]), tolerance=0.1
            ).points
            away = np.linalg.norm(ends - true[:, joint, None], axis=-1)
            placed[:, joint] = ends[np.arange(len(ends)), away.argmin(axis=1)]
        moved = np.linalg.norm(placed - placed[:, :1] - (true - true[:, :1]), axis=-1)[:, 1:]
        print(f"{off:8.3f} {np.nanmedian(moved):7.3f} {np.nanpercentile(moved, 95):7.3f}")


def captured(path: Path, rng: np.random.Generator) -> None:
    """Real postures, whose torso is not rigid, seen exactly."""
    print(f"\nreal postures, seen exactly; what the methods are told, px and cm\n{TABLE_HEADER}")
    scenes = mocap_scenes(read_capture(path), 480, rng)
    depths = np.concatenate([scene.joints_cam[:, 0, 2] for scene in scenes])
    for deviation, offset in TOLD_NOISE:
        found: list[NeckPlacement] = []
        start = time.perf_counter()
        for scene in scenes:
            found += place(
                scene.camera, scene.figure, scene.image, scene.head_image, deviation=deviation, offset=offset
            )
        row("auto", (deviation, offset), found, depths, time.perf_counter() - start)


BODY_25B = {
    "shoulder": (6, 5),
    "elbow": (8, 7),
    "wrist": (10, 9),
    "hip": (12, 11),
    "knee": (14, 13),
    "ankle": (16, 15),
}
"""Right and left (OpenPose, BODY_25B); nose 0, left and right eye 1 and 2, left and right ear 3 and 4."""


def trial(folder: Path, figure: Figure) -> None:
    """Real detections: the truth is the triangulation of four cameras, its neck the middle of the shoulders."""
    camera, R, t = calibration(next(iter(sorted(folder.glob("Calib*.toml")))))
    points = []
    for path in sorted((folder / "pose" / "cam01_json").glob("*.json")):
        people = [
            np.array(one["pose_keypoints_2d"]).reshape(-1, 3)
            for one in json.loads(path.read_text())["people"]
        ]
        points.append(max(people, key=lambda one: (one[5:7, 2].min() > 0, one[:, 2].sum())))
    detected = np.array(points)
    pixels = np.where(detected[..., 2:] > 0, detected[..., :2], np.nan)
    image, true = np.full((len(pixels), 14, 2), np.nan), triangulated(folder)[: len(pixels)]
    for name, numbers in BODY_25B.items():
        for side, number in zip(SIDES, numbers, strict=True):
            image[:, JOINT[f"{side}_{name}"]] = pixels[:, number]
    cam = min(
        (true @ turn.T @ R.T + t for turn in turns()),
        key=lambda cam: float(np.nanmedian(np.linalg.norm(camera.project(cam) - image, axis=-1))),
    )
    person = measured(figure, cam)
    for values in (image, cam):
        middles(values, person)
    error = np.linalg.norm(camera.project(cam) - image, axis=-1)
    print(
        f"\nreal detections, {len(image)} frames, {np.nanmedian(error):.1f} px from the truth (median), "
        f"{np.median(cam[:, 0, 2]):.2f} m away; what the methods are told, px and cm\n"
        f"{TABLE_HEADER}  tolerance, tangent (m)"
    )
    head = pixels[:, [0, 2, 1, 4, 3]]
    for method in METHOD_ORDER:
        for deviation, offset in TOLD_NOISE:
            start = time.perf_counter()
            found = place(camera, person, image, head, method=method, deviation=deviation, offset=offset)
            row(method, (deviation, offset), found, cam[:, 0, 2], time.perf_counter() - start)
            if method == "search":
                allowed = np.median([[one.tolerance, one.tangent] for one in found], axis=0)
                print(f"{'':>68} {allowed[0]:.3f} {allowed[1]:.3f}")


def calibration(path: Path) -> tuple[PinholeCamera, np.ndarray, np.ndarray]:
    """Read the first camera of a Pose2Sim calibration: Rodrigues' vector, metres."""
    first = next(iter(tomllib.loads(path.read_text()).values()))
    camera = PinholeCamera(K=np.array(first["matrix"]), distortion=np.array([*first["distortions"], 0.0]))
    return camera, rotation_from_vector(np.array(first["rotation"])), np.array(first["translation"])


def triangulated(folder: Path) -> np.ndarray:
    """Read the joints (T, 14, 3) of a TRC file by the names of their markers; neck and pelvis are not known."""
    lines = next(iter(sorted(folder.glob("*.trc")))).read_text().splitlines()
    names = [name for name in lines[3].split("\t")[2:] if name.strip()]
    rows = [[float(v) for v in line.split("\t")[2:] if v.strip()] for line in lines[5:] if line.strip()]
    markers = np.array(rows).reshape(len(rows), -1, 3)
    joints = np.full((len(rows), 14, 3), np.nan)
    for name in BODY_25B:
        for side in SIDES:
            joints[:, JOINT[f"{side}_{name}"]] = markers[:, names.index(side[0].upper() + name.capitalize())]
    return joints


def turns() -> list[np.ndarray]:
    """Return the 24 rotations that lay axes onto axes."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) > 0:
                found.append(turn)
    return found


def measured(figure: Figure, cam: np.ndarray) -> Figure:
    """Scale the figure to the median lengths of the limbs; its torso and head follow the stature that they give."""
    limbs = [("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")]
    lengths = {
        f"{side}_{a}-{side}_{b}": float(
            np.nanmedian(np.linalg.norm(cam[:, JOINT[f"{side}_{a}"]] - cam[:, JOINT[f"{side}_{b}"]], axis=-1))
        )
        for side in SIDES
        for a, b in limbs
    }
    return figure.from_stature(stature_from_lengths(lengths)).scaled(lengths)


def middles(values: np.ndarray, person: Figure) -> None:
    """Put the neck between the shoulders, and the pelvis where the person's is on the way to the hips' middle."""
    torso, hips = torso_points(person.lengths), hips_points(person.lengths)
    above = np.linalg.norm((torso[1] + torso[2]) / 2 - torso[3])
    below = np.linalg.norm((hips[1] + hips[2]) / 2)
    shoulders, hip_line = values[:, 1:3].mean(axis=1), values[:, 4:6].mean(axis=1)
    values[:, 0] = shoulders
    values[:, 3] = shoulders + above / (above + below) * (hip_line - shoulders)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=1000)
    parser.add_argument("--capture", type=Path)
    parser.add_argument("--trial", type=Path)
    options = parser.parse_args()
    figure, rng = load_figure(), np.random.default_rng(0)
    scene = random_views(figure, options.views, rng)
    print(TABLE_HEADER)
    table(scene, rng)
    steps(scene)
    if options.capture:
        captured(options.capture, rng)
    if options.trial:
        trial(options.trial, figure)


if __name__ == "__main__":
    main()
