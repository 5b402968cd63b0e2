"""From a view to every posture that can be behind it: root, tree or solver, certify, rank, answer."""

from posekit.recovery.recovery import Answer as Answer
from posekit.recovery.recovery import Frames as Frames
from posekit.recovery.recovery import Paths as Paths
from posekit.recovery.recovery import Recovery as Recovery
from posekit.recovery.recovery import Survivors as Survivors
