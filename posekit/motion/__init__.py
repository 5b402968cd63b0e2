"""Motion: points in space over time, in the formats of motion capture, biomechanics and animation."""

from posekit.motion.format import UNITS as UNITS
from posekit.motion.format import MotionFormat as MotionFormat
from posekit.motion.motion import UPS as UPS
from posekit.motion.motion import Motion as Motion
from posekit.motion.motion_axes import with_up as with_up
from posekit.motion.postures import MotionPostures as MotionPostures
from posekit.motion.postures import postures_of as postures_of
from posekit.motion.postures_up import guess_up as guess_up
from posekit.motion.reading import format_of as format_of
from posekit.motion.reading import motion_format as motion_format
from posekit.motion.reading import motion_formats as motion_formats
from posekit.motion.reading import read_motion as read_motion
from posekit.motion.reading import write_configurations as write_configurations
from posekit.motion.reading import write_motion as write_motion
from posekit.motion.survivors import SurvivorTable as SurvivorTable
from posekit.motion.survivors_files import read_survivors as read_survivors
from posekit.motion.survivors_files import write_survivors as write_survivors
