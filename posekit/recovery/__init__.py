"""The conductor: a view to certified postures, in the order in which a view passes."""

from posekit.recovery.conductor import recover as recover
from posekit.recovery.recovery import FrameRecovery as FrameRecovery
from posekit.recovery.recovery import Recovery as Recovery
from posekit.recovery.result import result_of as result_of
from posekit.recovery.scaled_sequences import ScaledFollowing as ScaledFollowing
from posekit.recovery.scaled_sequences import follow_scaled as follow_scaled
from posekit.recovery.sequences import follow as follow
from posekit.recovery.sequences import follow_frames as follow_frames
from posekit.recovery.sequences import survivor_frames as survivor_frames
from posekit.recovery.summary import following_line as following_line
from posekit.recovery.summary import summary_lines as summary_lines
from posekit.settings import Rooting as Rooting
