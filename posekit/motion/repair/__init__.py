"""Repair: find a nearby motion that passes all checks, and write it in the format of the user's file."""

from posekit.motion.repair.repair import Repaired as Repaired
from posekit.motion.repair.repair import repair as repair
