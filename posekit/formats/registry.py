"""The one registry of file formats: where each one is declared, and what is loaded of them when.

A format is an object of `posekit.formats.format.Format` in a module of its own, and a line of `BUILT_IN`. A format of
another package joins by an entry point of the group ``posekit.formats`` whose value names such an object.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Final

from posekit.formats.format import Content, Format
from posekit.formats.own_files import OWN_FORMATS

ENTRY_POINTS: Final = "posekit.formats"
"""The group of entry points by which formats of other packages join."""
FOLDER_SUFFIX: Final = "/"
"""Stands for a folder among the ends of names."""

BUILT_IN: Final[Mapping[Content, Mapping[str, tuple[str, ...]]]] = {
    Content.KEY_POINTS: {
        "keypoints.openpose:OPENPOSE_FORMAT": (".json", FOLDER_SUFFIX),
        "keypoints.coco:COCO_FORMAT": (".json",),
        "keypoints.coco_results:COCO_RESULTS_FORMAT": (".json",),
        "keypoints.wholebody:WHOLEBODY_FORMAT": (".json",),
        "keypoints.mediapipe:MEDIAPIPE_FORMAT": (".json", ".csv", FOLDER_SUFFIX),
        "keypoints.mmpose:MMPOSE_FORMAT": (".json", FOLDER_SUFFIX),
        "keypoints.mmpose_list:MMPOSE_LIST_FORMAT": (".json", FOLDER_SUFFIX),
        "keypoints.alphapose:ALPHAPOSE_FORMAT": (".json", FOLDER_SUFFIX),
        "keypoints.deeplabcut:DEEPLABCUT_FORMAT": (".csv", ".h5", ".hdf5", ".hdf"),
    },
    Content.MOTION: {
        "motion.trc:TRC_FORMAT": (".trc",),
        "motion.c3d:C3D_FORMAT": (".c3d",),
        "motion.csv_table:CSV_FORMAT": (".csv",),
        "motion.npz:NPZ_FORMAT": (".npz",),
        "motion.parquet:PARQUET_FORMAT": (".parquet", ".pq"),
        "motion.mot:MOT_FORMAT": (".mot", ".sto"),
        "motion.bvh:BVH_FORMAT": (".bvh",),
        "motion.glb:GLB_FORMAT": (".glb",),
        "motion.amass:AMASS_FORMAT": (".npz",),
        "motion.npy:NPY_FORMAT": (".npy",),
        "motion.caliscope:CALISCOPE_FORMAT": (".csv",),
        "motion.urdf_folder:URDF_FORMAT": (FOLDER_SUFFIX,),
        "motion.rerun_file:RERUN_FORMAT": (".rrd",),
    },
    Content.CONFIGURATIONS: {
        "motion.robot_table:ROBOT_NPZ_FORMAT": (".npz",),
        "motion.robot_csv:ROBOT_CSV_FORMAT": (".csv",),
    },
    Content.CAMERAS: {
        "cameras.opencv_file:OPENCV_FORMAT": (".yaml", ".yml", ".xml", ".json"),
        "cameras.npz:NPZ_CAMERA_FORMAT": (".npz",),
        "cameras.pose2sim:POSE2SIM_FORMAT": (".toml",),
        "cameras.pose2sim:ANIPOSE_FORMAT": (),
        "cameras.colmap:COLMAP_FORMAT": (".txt", FOLDER_SUFFIX),
        "cameras.exif:EXIF_FORMAT": (".jpg", ".jpeg", ".tif", ".tiff", ".webp"),
    },
}
"""Where the formats of other programs are declared, by what they hold, and the ends of their files' names: only the
modules of formats that a file can have are loaded."""


def formats(*holds: Content) -> tuple[Format, ...]:
    """List the formats, posekit's own last.

    Parameters
    ----------
    *holds : Content
        What their files hold; every format if none is given.
    """
    wanted = holds or tuple(Content)
    built_in = (_load(where) for content in wanted for where in BUILT_IN.get(content, ()))
    others = (one for one in _third_party() if one.holds in wanted)
    return (*built_in, *others, *(one for one in OWN_FORMATS if one.holds in wanted))


def names(*holds: Content) -> list[str]:
    """List the names of the formats whose files hold something, each once.

    Parameters
    ----------
    *holds : Content
        What their files hold; every format if none is given.
    """
    return list(dict.fromkeys(one.name for one in formats(*holds)))


def with_suffix(suffix: str) -> Iterator[Format]:
    """Yield the formats of other programs that have files whose names end so; posekit's own are `OWN_FORMATS`.

    Parameters
    ----------
    suffix : str
        In lower case with the dot; `FOLDER_SUFFIX` for folders.
    """
    for group in BUILT_IN.values():
        for where, suffixes in group.items():
            if suffix in suffixes:
                yield _load(where)
    for one in _third_party():
        if suffix in suffixes_of(one):
            yield one


def suffixes_of(one: Format) -> tuple[str, ...]:
    """Return the ends of a format's names, with `FOLDER_SUFFIX` where a folder can be of it."""
    return (*one.suffixes, FOLDER_SUFFIX) if one.folder else one.suffixes


@cache
def _load(where: str) -> Format:
    module, _, name = where.partition(":")
    found: Format = getattr(import_module(f"posekit.formats.{module}"), name)
    return found


@cache
def _third_party() -> tuple[Format, ...]:
    """Load the formats of other packages; one that cannot be loaded costs itself, and a warning."""
    found = []
    for point in entry_points(group=ENTRY_POINTS):
        try:
            one = point.load()
        except (ImportError, AttributeError) as error:
            one, reason = None, str(error)
        else:
            reason = f"got {type(one).__name__}; expected an object of posekit.formats.format.Format"
        if isinstance(one, Format):
            found.append(one)
        else:
            warnings.warn(f"the format {point.name} ({point.value}) is left out: {reason}", stacklevel=2)
    return tuple(found)
