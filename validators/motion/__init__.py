"""What motion can do: checks over time, one kind a file, each with a value a frame.

`registry` has them by the names that profiles and ``--checks`` take. A check is a few thresholds and a function from a
`MotionClip` to findings; one that does not apply to a clip says why instead.
"""

from posekit.validators.motion.clip import MotionClip as MotionClip
from posekit.validators.motion.motion_check import MotionCheck as MotionCheck
from posekit.validators.motion.profile import load_profile as load_profile
from posekit.validators.motion.registry import MOTION_CHECKS as MOTION_CHECKS
from posekit.validators.motion.suite import MotionVerdict as MotionVerdict
from posekit.validators.motion.suite import judge_motion as judge_motion
