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
from typing import Final

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.mediapipe_json import add_document, looks_like_landmarks
from posekit.formats.keypoints.mediapipe_names import LANDMARK_NAMES
from posekit.formats.keypoints.mediapipe_table import add_table, looks_like_table
from posekit.formats.keypoints.named_layout import by_count
from posekit.formats.keypoints.rows import DetectionRows
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.safe_io import refusal

PIXELS_FROM = 3.0
"""Where half of all coordinates are larger, they are pixels: nobody stands three pictures away from the picture."""
WORLD_MIDDLE_WITHIN = 0.02
"""World landmarks have the middle of the hips at the origin, which as a fraction is the picture's corner."""
HIP_LANDMARKS = (23, 24)


def looks_like(given: GivenFile) -> bool:
    """Tell whether it is JSON with MediaPipe's landmarks, or a table with their names or numbers."""
    if given.suffix == ".csv":
        return looks_like_table(given.text[:20_000]) and not _is_in_space(given.columns)
    return given.document is not None and looks_like_landmarks(given.document)


def _is_in_space(columns: frozenset[str]) -> bool:
    """Tell whether a table of points is of points in space: z is there, and nothing that only detectors write.

    Landmarks of MediaPipe in a table have the same names as other points, and a z too.
    """
    words = {name.casefold() for name in columns}
    deep = any(name == "z" or name.endswith("_z") for name in words)
    detected = ("visibility", "presence", "confidence", "score", "likelihood", "eye_inner", "foot_index")
    return deep and not any(part in name for name in words for part in detected)


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
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
    rows, by_camera = DetectionRows(str(given.path)), False
    if given.suffix == ".csv":
        by_camera = add_table(rows, given.text)
    else:
        for path, document in rows.documents(given):
            add_document(rows, document, path.stem)
    usual = {len(LANDMARK_NAMES): load_skeleton_map("mediapipe_33")}
    fitting = by_count(len(LANDMARK_NAMES), layout, given.path, usual)
    found = rows.keypoints("mediapipe", fitting, normalised=True)
    return replace(_in_pixels(found), by_camera=by_camera)


def _in_pixels(found: KeyPoints) -> KeyPoints:
    """Tell pixels, fractions and metres apart; make pixels of fractions where the picture's size is known."""
    known = ~np.isnan(found.points[..., 0])
    if not known.any():
        return found
    if float(np.median(np.abs(found.points[known]))) > PIXELS_FROM:
        return replace(found, normalised=False)
    hips = found.points[:, HIP_LANDMARKS].mean(axis=1)
    hips = hips[~np.isnan(hips[:, 0])]
    if len(hips) and float(np.median(np.abs(hips))) < WORLD_MIDDLE_WITHIN:
        got = "landmarks around the middle of the hips: world landmarks, metres"
        remedy = "save pose_landmarks, not pose_world_landmarks"
        raise refusal(found.source, "", got, "landmarks in the picture", remedy)
    size = found.size[found.frame]
    if np.isnan(size).any():
        return found
    return replace(found, points=found.points * size[:, None], normalised=False)


MEDIAPIPE_FORMAT: Final = KeyPointFormat(
    name="mediapipe",
    title="MediaPipe Pose: 33 landmarks as JSON of frames, or as CSV, caliscope's xy too",
    suffixes=(".json", ".csv"),
    folder=True,
    looks_like=looks_like,
    read=read,
    skeletons=("mediapipe_33",),
)
