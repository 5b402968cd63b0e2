"""Survivors over time: the motions through a sequence that a body can have made.

`best_paths` weighs all paths at once and returns what is expected, `Follower` does so live; both bridge frames without
a survivor. `choose_scale` tells lengths by how the sequence moves, `smooth` smooths a path. See docs, "Sequences".
"""

from posekit.following.beam import Beam as Beam
from posekit.following.best_paths import PATH_SEPARATION_METRES as PATH_SEPARATION_METRES
from posekit.following.best_paths import best_paths as best_paths
from posekit.following.bridging import bridge as bridge
from posekit.following.follower import Follower as Follower
from posekit.following.follower import LiveEstimate as LiveEstimate
from posekit.following.following import Following as Following
from posekit.following.length_scales import ScaleChoice as ScaleChoice
from posekit.following.length_scales import choose_scale as choose_scale
from posekit.following.motion_model import MotionModel as MotionModel
from posekit.following.smoothing import smooth as smooth
from posekit.following.survivor_frame import SurvivorFrame as SurvivorFrame
from posekit.following.survivor_paths import Paths as Paths
from posekit.following.switches import Switch as Switch
from posekit.following.switches import elevations as elevations
