"""The conductor: a view to certified postures, in the order in which a view passes."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand
from posekit.settings import Rooting as Rooting

if TYPE_CHECKING:
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
else:
    __getattr__ = on_demand(
        __name__,
        {
            "conductor": ("recover",),
            "recovery": (
                "FrameRecovery",
                "Recovery",
            ),
            "result": ("result_of",),
            "scaled_sequences": (
                "ScaledFollowing",
                "follow_scaled",
            ),
            "sequences": (
                "follow",
                "follow_frames",
                "survivor_frames",
            ),
            "summary": (
                "following_line",
                "summary_lines",
            ),
        },
    )
