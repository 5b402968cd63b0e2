"""Survivors over time: the paths through a sequence that a body can have moved along.

`best_paths` chooses a survivor in each frame, `Follower` does so live; both bridge frames without one. `choose_scale`
tells lengths by how the sequence moves, `smooth` smooths the distances of a path. See docs/sequences.md.
"""

from posekit.sequences.beam import Beam as Beam
from posekit.sequences.best_paths import APART as APART
from posekit.sequences.best_paths import best_paths as best_paths
from posekit.sequences.bridging import bridge as bridge
from posekit.sequences.follower import Estimate as Estimate
from posekit.sequences.follower import Follower as Follower
from posekit.sequences.frame import SurvivorFrame as SurvivorFrame
from posekit.sequences.motion_model import MotionModel as MotionModel
from posekit.sequences.paths import Paths as Paths
from posekit.sequences.scales import ScaleChoice as ScaleChoice
from posekit.sequences.scales import choose_scale as choose_scale
from posekit.sequences.smoothing import smooth as smooth
from posekit.sequences.switches import Switch as Switch
from posekit.sequences.switches import elevations as elevations
