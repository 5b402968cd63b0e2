"""Follow a person before a camera: key points of MediaPipe, a posture a picture.

python examples/live_camera.py --stature 1.75 --record seen.jsonl
python examples/live_camera.py --stature 1.75 --replay seen.jsonl     # without a camera, MediaPipe or OpenCV
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import posekit
from posekit.skeleton import JOINT

Picture = tuple[float, tuple[int, int], NDArray[np.float64]]
"""Seconds, width and height, and points (33, 3): pixels and how visible each is."""


def from_camera(number: int) -> Iterator[Picture]:
    """Yield what MediaPipe finds in the pictures of a camera."""
    try:
        import cv2
        import mediapipe
    except ImportError as missing:
        raise SystemExit(
            f"{missing.name} is not installed; expected OpenCV and MediaPipe, which find the key points: "
            "pip install opencv-python mediapipe, or give --replay FILE"
        ) from None
    capture = cv2.VideoCapture(number)
    if not capture.isOpened():
        raise SystemExit(f"camera {number} does not open; give another number, or --replay FILE")
    with mediapipe.solutions.pose.Pose() as detector:
        start = time.monotonic()
        while True:
            there, picture = capture.read()
            if not there:
                return
            now, (height, width) = time.monotonic() - start, picture.shape[:2]
            found = detector.process(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)).pose_landmarks
            points = np.full((33, 3), np.nan)
            if found is not None:
                points[:] = [[one.x * width, one.y * height, one.visibility] for one in found.landmark]
            yield now, (width, height), points


def from_file(path: Path) -> Iterator[Picture]:
    """Yield what was recorded."""
    with path.open(encoding="utf-8") as lines:
        for line in lines:
            one = json.loads(line)
            width, height = one["size"]
            points = [point or [np.nan] * 3 for point in one["points"]]
            yield one["time"], (width, height), np.array(points, dtype=np.float64)


def recorded(picture: Picture) -> str:
    """Write a picture's points as a line."""
    seconds, size, points = picture
    known = [None if np.isnan(point).any() else point.round(3).tolist() for point in points]
    return json.dumps({"time": seconds, "size": size, "points": known}) + "\n"


def say(told: posekit.TrackedPosture, rate: float) -> str:
    """Say in a line how far before the shoulders the hands are."""
    if told.reason:
        return f"{told.time:7.2f} s  {told.reason}"
    hands = []
    for side in ("right", "left"):
        shoulder, wrist = (told.joints[JOINT[f"{side}_{joint}"]] for joint in ("shoulder", "wrist"))
        off = told.deviation[JOINT[f"{side}_wrist"]]
        hands.append(f"{side} hand {100 * (shoulder[2] - wrist[2]):4.0f} ± {100 * off:.0f} cm")
    return (
        f"{told.time:7.2f} s  {told.survivors} postures, the likeliest {told.probability:.0%}; "
        f"towards the camera: {', '.join(hands)}  ({rate:.0f} pictures/s)"
    )


def main() -> None:
    """Follow until the camera ends, the file does, or Ctrl-C."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--camera", type=int, default=0, help="which camera, from 0")
    parser.add_argument("--stature", type=float, default=1.75, help="the person's height, metres")
    parser.add_argument("--record", type=Path, help="write what is seen, for --replay")
    parser.add_argument("--replay", type=Path, help="what was recorded, instead of a camera")
    asked = parser.parse_args()

    with asked.record.open("w", encoding="utf-8") if asked.record else nullcontext() as record:
        tracker = None
        for picture in from_file(asked.replay) if asked.replay else from_camera(asked.camera):
            seconds, size, points = picture
            if tracker is None:
                tracker = posekit.Tracker(size=size, stature=asked.stature, layout="mediapipe_33")
            if record is not None:
                record.write(recorded(picture))
            start = time.perf_counter()
            told = tracker.update(points, seconds)
            print(say(told, 1 / (time.perf_counter() - start)), flush=True)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
