"""A motion nearby that passes, in the user's own file."""

from posekit.motion.repair.repair import Repaired as Repaired
from posekit.motion.repair.repair import repair as repair
