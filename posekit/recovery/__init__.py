"""Recovery of every posture behind a view: locate the neck, find all postures, check them, and rank them."""

from posekit.recovery.recovery import Answer as Answer
from posekit.recovery.recovery import Frames as Frames
from posekit.recovery.recovery import Paths as Paths
from posekit.recovery.recovery import Recovery as Recovery
from posekit.recovery.recovery import Survivors as Survivors
