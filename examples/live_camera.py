"""Follow a person in front of a camera: MediaPipe's key points, one posture per picture.

python examples/live_camera.py --stature 1.75
python examples/live_camera.py --keypoints samples/keypoints    # recorded key points in place of a camera
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import posekit
from posekit.skeleton import JOINT, POINTS

Picture = tuple[float, tuple[int, int], Any]
"""Seconds, width and height in pixels, and points (P, 3): pixels and confidence, NaN where unseen."""


def from_camera(number: int) -> Iterator[Picture]:
    """Yield the 33 points that MediaPipe finds in the pictures of a camera."""
    import cv2
    import mediapipe  # type: ignore[import-not-found]

    capture = cv2.VideoCapture(number)
    if not capture.isOpened():
        raise SystemExit(f"camera {number} does not open; give another number, or --keypoints FOLDER")
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


def from_files(path: str, rate: float = 10.0) -> Iterator[Picture]:
    """Yield the 19 points of joints and head that a detector wrote."""
    detections = posekit.open(path)
    columns = [detections.names.index(name) for name in POINTS]
    for frame, points, confidence in zip(
        detections.frame, detections.points, detections.confidence, strict=True
    ):
        seen = np.column_stack([points[columns], confidence[columns]])
        yield frame / rate, detections.size or (1280, 720), seen


def line_of(found: Any) -> str:
    """Return a line of text with the distance of the hands in front of the shoulders."""
    if found.reason:
        return f"{found.time:6.2f} s  {found.reason}"
    hands = []
    for side in ("right", "left"):
        shoulder, wrist = (found.joints[JOINT[f"{side}_{joint}"]] for joint in ("shoulder", "wrist"))
        hands.append(f"{side} hand {100 * (shoulder[2] - wrist[2]):4.0f} cm")
    return f"{found.time:6.2f} s  toward the camera: {', '.join(hands)}; {found.survivors} postures"


def main() -> None:
    """Follow the person until the camera or the files end, or until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--camera", type=int, default=0, help="number of the camera, from 0")
    parser.add_argument("--stature", type=float, default=1.75, help="height of the person, metres")
    parser.add_argument("--keypoints", default="", help="key points in place of a camera")
    asked = parser.parse_args()
    tracker = None
    for seconds, size, points in (
        from_files(asked.keypoints) if asked.keypoints else from_camera(asked.camera)
    ):
        if tracker is None:
            layout = "" if asked.keypoints else "mediapipe_33"
            tracker = posekit.Tracker(size=size, stature=asked.stature, layout=layout)
        print(line_of(tracker.update(points, seconds)), flush=True)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
