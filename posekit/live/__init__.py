"""Live: a person followed as key points come, one picture a call.

`tracker` is `posekit.Tracker`, `sight` makes a view of one picture's points, `tracked_posture` is what a call returns,
`lines` is the same as JSON lines, for `posekit follow --stdin`.
"""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.live.tracked_posture import TrackedPosture as TrackedPosture
    from posekit.live.tracker import Tracker as Tracker
else:
    __getattr__ = on_demand(
        __name__,
        {
            "tracked_posture": ("TrackedPosture",),
            "tracker": ("Tracker",),
        },
    )
