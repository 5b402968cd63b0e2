"""BVH: a skeleton and its joint angles over time, as animators have them.

Biovision's hierarchical format, a text: HIERARCHY with ROOT, JOINT and End Site, each with its OFFSET and CHANNELS;
MOTION with Frames, Frame Time and a line of channel values a frame, degrees. Meredith & Maddock 2001, *Motion Capture
File Formats Explained* (University of Sheffield, CS-01-11); the course notes CS 838 of the University of Wisconsin
(*Biovision BVH*, 1999). It names no unit and no axis: y is up by custom, centimetres are frequent.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from posekit.formats.motion.bvh_reading import BvhReading, examine_bvh, read_bvh
from posekit.formats.motion.bvh_writing import write_bvh
from posekit.formats.motion.motion_format import MotionFormat

__all__ = ["BVH_FORMAT", "BvhReading", "examine_bvh", "read_bvh", "write_bvh"]

BVH_FORMAT: Final = MotionFormat(
    name="bvh",
    title="BVH: a skeleton's joint angles over time, for Blender and other animation programs",
    suffixes=(".bvh",),
    looks_like=lambda given: given.start.lstrip().startswith(b"HIERARCHY"),
    read=read_bvh,
    read_recorded=partial(read_bvh, as_recorded=True),
    write_configurations=write_bvh,
)
