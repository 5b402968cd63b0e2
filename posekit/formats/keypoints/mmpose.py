"""MMPose, the demos' layout: ``{meta_info, instance_info}``, the points by name in `meta_info`.

MMPose 1.x (open-mmlab/mmpose), ``demo/topdown_demo_with_mmdet.py --save-predictions``: of a video, `instance_info` is a
list of pictures ``{frame_id, instances}`` counted from 1; of a picture, the list of its people.
``meta_info.keypoint_id2name`` names the points.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.mmpose_instances import add_frames, add_instances, is_frame
from posekit.formats.keypoints.named_layout import by_names
from posekit.formats.keypoints.rows import DetectionRows, whole
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.safe_io import refusal, shown

MAX_POINTS = 1000


def looks_like(given: GivenFile) -> bool:
    """Tell whether it is an object with `meta_info` and `instance_info`."""
    document = given.document
    return isinstance(document, dict) and "instance_info" in document and "meta_info" in document


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
    """Read predictions that a demo of MMPose saved; of a folder, each file is a picture.

    Raises
    ------
    InputError
        Where it is not that layout, is of points in space, or its names fit no skeleton map.
    """
    rows = DetectionRows(str(given.path))
    names: list[str] = []
    for path, document in rows.documents(given):
        info = document.get("instance_info") if isinstance(document, dict) else None
        if not isinstance(info, list):
            raise refusal(path, "instance_info", shown(info), "a list", "save it with --save-predictions")
        found = names_of_points(path, document.get("meta_info"))
        if names and found != names:
            raise refusal(
                path, "meta_info", "other points than the files before", "the same", "split the folder"
            )
        names = found
        if info and is_frame(info[0]):
            add_frames(rows, info, "instance_info")
        else:
            add_instances(rows, rows.picture(path.stem), info, "instance_info")
    if rows.points and rows.count != len(names):
        got = f"{rows.count} points a person, {len(names)} names in meta_info"
        raise refusal(given.path, "meta_info", got, "a name a point", "save the file again")
    return rows.keypoints("mmpose", by_names(names, layout, given.path))


def names_of_points(path: Path, meta: object) -> list[str]:
    """Return the points' names in their order."""
    field = "meta_info.keypoint_id2name"
    table = meta.get("keypoint_id2name") if isinstance(meta, dict) else None
    if not isinstance(table, dict) or not 0 < len(table) <= MAX_POINTS:
        raise refusal(path, field, shown(table), "the points' names by number", "save it with MMPose 1.x")
    numbered = {whole(key): name for key, name in table.items()}
    names = [numbered.get(k) for k in range(len(table))]
    for index, name in enumerate(names):
        if not isinstance(name, str) or not name.strip():
            raise refusal(path, f"{field}.{index}", shown(name), "a name", "save the file again")
    return [str(name) for name in names]


MMPOSE_FORMAT: Final = KeyPointFormat(
    name="mmpose",
    title="MMPose's demos: meta_info with the points' names, instance_info with pictures or people",
    suffixes=(".json",),
    folder=True,
    looks_like=looks_like,
    read=read,
    skeletons=("coco_17", "halpe_26", "coco_wholebody_133", "h36m_17"),
)
