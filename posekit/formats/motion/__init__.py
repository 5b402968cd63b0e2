"""Motion: points in space over time, in the formats of motion capture, biomechanics and animation."""

from typing import TYPE_CHECKING

from posekit.formats.motion.reading import motion_format as motion_format
from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.formats.motion.motion import UP_DIRECTIONS as UP_DIRECTIONS
    from posekit.formats.motion.motion import Motion as Motion
    from posekit.formats.motion.motion_axes import with_up as with_up
    from posekit.formats.motion.motion_format import METRES_IN_UNIT as METRES_IN_UNIT
    from posekit.formats.motion.motion_format import MotionFormat as MotionFormat
    from posekit.formats.motion.postures import MotionPostures as MotionPostures
    from posekit.formats.motion.postures import postures_of as postures_of
    from posekit.formats.motion.postures_up import guess_up as guess_up
    from posekit.formats.motion.reading import format_of as format_of
    from posekit.formats.motion.reading import motion_formats as motion_formats
    from posekit.formats.motion.reading import read_motion as read_motion
    from posekit.formats.motion.reading import write_configurations as write_configurations
    from posekit.formats.motion.reading import write_motion as write_motion
    from posekit.formats.motion.survivors import SurvivorTable as SurvivorTable
    from posekit.formats.motion.survivors_files import read_survivors as read_survivors
    from posekit.formats.motion.survivors_files import write_survivors as write_survivors
else:
    __getattr__ = on_demand(
        __name__,
        {
            "motion": ("UP_DIRECTIONS", "Motion"),
            "motion_axes": ("with_up",),
            "motion_format": ("METRES_IN_UNIT", "MotionFormat"),
            "postures": ("MotionPostures", "postures_of"),
            "postures_up": ("guess_up",),
            "reading": ("format_of", "motion_formats", "read_motion", "write_configurations", "write_motion"),
            "survivors": ("SurvivorTable",),
            "survivors_files": ("read_survivors", "write_survivors"),
        },
    )
