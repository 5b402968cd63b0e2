"""MediaPipe Pose: 33 landmarks, fractions of the picture's width and height, in the files that people save of them.

MediaPipe has no file format. What is read is what its results look like when they are dumped: JSON of frames with
``pose_landmarks`` (of the Solutions API: 33 landmarks; of the Tasks API's ``PoseLandmarkerResult``: a list of people),
and CSV with a row a frame or a row a landmark. A landmark is ``{x, y, z, visibility, presence}``
(ai.google.dev/edge/api/mediapipe, NormalizedLandmark): x and y are fractions of the picture, which may lie outside
0..1; z is no depth that could be measured, and is left out. World landmarks are metres around the hips and lie in no
picture: they are skipped, and a file of nothing else is refused.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from posekit.formats.keypoints.format import Format
from posekit.formats.keypoints.given import Given
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.mediapipe_json import add_document, looks_like_landmarks
from posekit.formats.keypoints.mediapipe_table import add_table, looks_like_table
from posekit.formats.keypoints.mediapipe_write import write_json_of, write_table_of
from posekit.formats.keypoints.rows import Rows
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.safe_io import refusal

PIXELS = 3.0
"""Where half of all coordinates are larger, they are pixels: nobody stands three pictures away from the picture."""
WORLD = 0.02
"""World landmarks have the middle of the hips at the origin, which as a fraction is the picture's corner."""
HIPS = (23, 24)
POINTS = 33


def suits(given: Given) -> bool:
    """Tell whether it is JSON with MediaPipe's landmarks, or a table with their names or numbers."""
    if given.suffix == ".csv":
        return looks_like_table(given.text[:20_000])
    return given.document is not None and looks_like_landmarks(given.document)


def read(given: Given, layout: SkeletonMap | None) -> KeyPoints:
    """Read MediaPipe's landmarks; of a folder, each JSON file is a picture.

    Returns
    -------
    KeyPoints
        In pixels where the file says how large the picture is, or holds pixels; else `normalised`.

    Raises
    ------
    InputError
        Where nothing looks like 33 landmarks, or they are world landmarks.
    """
    rows = Rows(str(given.path))
    if given.suffix == ".csv":
        add_table(rows, given.text)
    else:
        for path, document in given.documents():
            rows.source = str(path)
            add_document(rows, document, path.stem)
    rows.source = str(given.path)
    if layout is not None and len(layout.points) != POINTS:
        raise refusal(
            given.path,
            "points",
            f"{POINTS} a person",
            f"{len(layout.points)}, as the skeleton map {layout.name} has",
            "give a map of MediaPipe's points, or none",
        )
    found = rows.keypoints("mediapipe", layout or load_skeleton_map("mediapipe_33"), normalised=True)
    return _in_pixels(found)


def _in_pixels(found: KeyPoints) -> KeyPoints:
    """Tell pixels, fractions and metres apart; make pixels of fractions where the picture's size is known."""
    known = ~np.isnan(found.points[..., 0])
    if not known.any():
        return found
    if float(np.median(np.abs(found.points[known]))) > PIXELS:
        return replace(found, normalised=False)
    hips = found.points[:, HIPS].mean(axis=1)
    hips = hips[~np.isnan(hips[:, 0])]
    if len(hips) and float(np.median(np.abs(hips))) < WORLD:
        raise refusal(
            found.source,
            "",
            "landmarks around the middle of the hips: world landmarks, metres",
            "landmarks in the picture",
            "save pose_landmarks, not pose_world_landmarks",
        )
    size = found.size[found.frame]
    if np.isnan(size).any():
        return found
    return replace(found, points=found.points * size[:, None], normalised=False)


def write(path: Path, keypoints: KeyPoints) -> None:
    """Write fractions: a table, a row a landmark, where the name ends in .csv; JSON of frames else.

    Lost: which points were placed though hidden, scores, and points that MediaPipe has not. In a table also who is who,
    pictures without people, and the size.

    Raises
    ------
    InputError
        Where the points are pixels and the picture's size is not known.
    """
    size = keypoints.size[keypoints.frame]
    if not keypoints.normalised and np.isnan(size).any():
        raise refusal(
            path,
            "",
            "pixels of pictures whose size is not known",
            "the size: MediaPipe's points are fractions of it",
            "give it with --size, or write another format",
        )
    fitted = keypoints.in_layout(load_skeleton_map("mediapipe_33"))
    if not keypoints.normalised:
        fitted = replace(fitted, points=fitted.points / size[:, None], normalised=True)
    if path.suffix.lower() == ".csv":
        write_table_of(path, fitted)
    else:
        write_json_of(path, fitted)


FORMAT = Format(
    name="mediapipe",
    says="MediaPipe Pose: 33 landmarks as JSON of frames, or as CSV",
    suits=suits,
    read=read,
    write=write,
    skeletons=("mediapipe_33",),
)
