"""One person over time: paths through recovered frames, and live tracking."""

from posekit.following.paths import follow as follow
from posekit.following.tracker import PathPosture as PathPosture
from posekit.following.tracker import TrackedPosture as TrackedPosture
from posekit.following.tracker import Tracker as Tracker
