"""MMPose, the Inferencer's layout: a bare list of people, or of pictures ``{frame_id, instances}``, without names.

``MMPoseInferencer(..., pred_out_dir=…)`` of MMPose 1.x (open-mmlab/mmpose,
mmpose/apis/inferencers/base_mmpose_inferencer.py) writes one file a picture, named as the picture is, or one a video,
counted from 0. What the points are is known by their number alone, and 17 are COCO's or Human3.6M's: what is at the
places of the head tells which.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.head_share import HEAD_COCO, HEAD_H36M, head_share
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.mmpose_instances import add_frames, add_instances, is_frame, is_instance
from posekit.formats.keypoints.named_layout import by_count
from posekit.formats.keypoints.rows import DetectionRows
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.safe_io import refusal, shown

BY_COUNT = {17: "coco_17", 26: "halpe_26", 133: "coco_wholebody_133", 136: "halpe_136"}


def looks_like(given: GivenFile) -> bool:
    """Tell whether it is a list of MMPose's people or pictures."""
    document = given.document
    return (
        isinstance(document, list) and bool(document) and (is_instance(document[0]) or is_frame(document[0]))
    )


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
    """Read what the Inferencer saved; of a folder, each file is a picture.

    Raises
    ------
    InputError
        Where it is not that layout, is of points in space, or nothing tells what the points are.
    """
    rows = DetectionRows(str(given.path))
    for path, document in rows.documents(given):
        if not isinstance(document, list):
            raise refusal(
                path, "", shown(document), "a list of people or of pictures", "name the file that is"
            )
        if document and is_frame(document[0]):
            add_frames(rows, document, "")
        else:
            add_instances(rows, rows.picture(path.stem), document, "")
    return rows.keypoints("mmpose-list", _layout(rows, layout))


def _layout(rows: DetectionRows, layout: SkeletonMap | None) -> SkeletonMap:
    if layout is None and rows.count == 17:
        share = head_share(np.array(rows.points))
        if share > HEAD_H36M:
            return load_skeleton_map("h36m_17")
        if not share < HEAD_COCO:
            expected = "points that are clearly coco_17 or h36m_17"
            remedy = "say which with --skeleton coco_17 or --skeleton h36m_17"
            raise refusal(rows.source, "points", "17 a person, unnamed", expected, remedy)
    usual = {number: load_skeleton_map(name) for number, name in BY_COUNT.items()}
    return by_count(rows.count, layout, rows.source, usual)


MMPOSE_LIST_FORMAT: Final = KeyPointFormat(
    name="mmpose-list",
    title="MMPose's Inferencer: a list of people or of pictures, points without names",
    suffixes=(".json",),
    folder=True,
    looks_like=looks_like,
    read=read,
    skeletons=("coco_17", "h36m_17", "halpe_26", "coco_wholebody_133", "halpe_136"),
)
