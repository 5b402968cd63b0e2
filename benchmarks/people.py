"""Motion of people beside one laboratory's: what files and packages hold, as captures.

    python benchmarks/people.py FILE [FILE ...]

A file is a wheel of `pybullet` (zlib licence; motions of DeepMimic, Peng et al. 2018, MIT licence: fifteen of several
people, from the CMU and SFU databases, and five of a walker), one of its motions, or anything `posekit synth mocap`
reads: NPZ, TRC, C3D, BVH. What is read stays where it is: nothing of it is part of posekit.

A frame of DeepMimic is its duration, the root's position (y up) and quaternion (w first), and quaternions of chest,
neck, hip, ankle and shoulder with angles of knee and elbow between, the right ones first; offsets are those of
`humanoid3d.txt`. It has hips where posekit has a pelvis above them: that is placed `PELVIS_ABOVE_HIPS` up the root.
"""

from __future__ import annotations

import json
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS, JOINT, JOINTS
from posekit.synthesis import Capture, clip_lengths, read_capture

PELVIS_ABOVE_HIPS = 0.10
"""Metres: as the built-in figure and CMU's skeletons have it."""

CHEST_OFFSET, NECK_OFFSET = (0.0, 0.236151, 0.0), (0.0, 0.223894, 0.0)
SHOULDER_OFFSET, HIP_OFFSET = (-0.02405, 0.24350, 0.18311), (0.0, 0.0, 0.084887)
UPPER_ARM_LENGTH, FOREARM_LENGTH, THIGH_LENGTH, SHANK_LENGTH = 0.274788, 0.258947, 0.421546, 0.409870
"""Metres: offsets in the parent's frame (x forward, y up, z right; the left ones mirrored), and lengths."""

N_NUMBERS = 44
"""Of a frame of a humanoid."""


def people(path: str | Path) -> Capture:
    """Read the motion of a file: a wheel or a motion of DeepMimic, or any capture that posekit reads.

    Raises
    ------
    ValueError
        Where a wheel or a text holds no motion of a humanoid.
    """
    path = Path(path)
    if path.suffix not in (".whl", ".txt"):
        return read_capture(path)
    clips = list(_deep_mimic(path))
    if not clips:
        raise ValueError(f"{path}: no motion of a humanoid, frames of {N_NUMBERS} numbers")
    joints = np.concatenate([found for _, found, _ in clips])
    names = tuple(name for name, _, _ in clips)
    return Capture(
        points=np.concatenate([joints, np.full((len(joints), len(HEAD_POINTS), 3), np.nan)], axis=1),
        clip=np.repeat(np.arange(len(clips)), [len(found) for _, found, _ in clips]),
        names=names,
        actions=tuple(name.removeprefix("humanoid3d_").rstrip("0123456789") for name in names),
        fps=np.array([fps for _, _, fps in clips]),
        up=np.array([0.0, 1.0, 0.0]),
        source=str(path),
        derived=("pelvis",),
    )


def clip_of(capture: Capture, *wanted: int) -> Capture:
    """Return some clips of a capture alone, by number."""
    rows = np.flatnonzero(np.isin(capture.clip, wanted))
    return replace(
        capture,
        points=capture.points[rows],
        clip=np.searchsorted(np.array(wanted), capture.clip[rows]),
        names=tuple(capture.names[k] for k in wanted),
        actions=tuple(capture.actions[k] for k in wanted),
        fps=capture.fps[list(wanted)],
    )


def _deep_mimic(path: Path) -> Iterator[tuple[str, Array, float]]:
    """Yield name, joints (T, 14, 3) and frames a second of every humanoid's motion."""
    for name, text in _texts(path):
        given = json.loads(text)
        frames = given.get("Frames", [])
        if frames and {len(frame) for frame in frames} == {N_NUMBERS}:
            numbers = np.array(frames, dtype=np.float64)
            yield name, deep_mimic_joints(numbers), float(1.0 / np.median(numbers[:, 0]))


def _texts(path: Path) -> Iterator[tuple[str, str]]:
    if path.suffix == ".txt":
        yield path.stem, path.read_text()
        return
    with zipfile.ZipFile(path) as wheel:
        for name in sorted(wheel.namelist()):
            if "/motions/" in name and name.endswith(".txt"):
                yield PurePosixPath(name).stem, wheel.read(name).decode()


def deep_mimic_joints(frames: Array) -> Array:
    """Return the 14 joints (T, 14, 3) of frames (T, 44) of a humanoid, metres, y up."""
    joints = np.full((len(frames), len(JOINTS), 3), np.nan)
    root, turned = frames[:, 1:4], _matrices(frames[:, 4:8])
    chest_at, chest = root + turned @ np.array(CHEST_OFFSET), turned @ _matrices(frames[:, 8:12])
    joints[:, JOINT["neck"]] = chest_at + chest @ np.array(NECK_OFFSET)
    joints[:, JOINT["pelvis"]] = root + turned @ np.array([0.0, PELVIS_ABOVE_HIPS, 0.0])
    for side, leg, arm, sign in (("right", 16, 25, 1.0), ("left", 30, 39, -1.0)):
        mirror = np.array([1.0, 1.0, sign])
        for names, start, at, frame, offset, lengths in (
            (("hip", "knee", "ankle"), leg, root, turned, HIP_OFFSET, (THIGH_LENGTH, SHANK_LENGTH)),
            (
                ("shoulder", "elbow", "wrist"),
                arm,
                chest_at,
                chest,
                SHOULDER_OFFSET,
                (UPPER_ARM_LENGTH, FOREARM_LENGTH),
            ),
        ):
            first = at + frame @ (np.array(offset) * mirror)
            upper = frame @ _matrices(frames[:, start : start + 4])
            angle = frames[:, start + 4]
            # The hinge turns about z: from straight down to forward.
            lower = np.stack([np.sin(angle), -np.cos(angle), np.zeros(len(frames))], axis=1)
            second = first - lengths[0] * upper[..., 1]
            third = second + lengths[1] * np.einsum("tij,tj->ti", upper, lower)
            for name, place in zip(names, (first, second, third), strict=True):
                joints[:, JOINT[f"{side}_{name}"]] = place
    return joints


def _matrices(quaternions: NDArray[np.float64]) -> Array:
    """Return rotations (T, 3, 3) of quaternions (T, 4), w first."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def main() -> None:
    if len(sys.argv) < 2:
        print("no file given: python benchmarks/people.py FILE [FILE ...]")
        return
    for path in sys.argv[1:]:
        capture = people(path)
        print(f"{path}: {len(capture.points)} frames, {len(capture.names)} clips")
        for index, name in enumerate(capture.names):
            points = capture.points[capture.clip == index]
            print(f"  {name}: {len(points)} frames at {capture.fps[index]:.0f} Hz")
        print({name: round(length, 3) for name, length in clip_lengths(capture.points).items()})


if __name__ == "__main__":
    main()
