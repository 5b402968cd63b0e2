"""Recovery: from a view to certified postures. The files in the order in which a view passes.

`conductor` is `posekit.recover`, and calls the others one after the other:

1. Root: `person` (whose body it is, and how well its lengths are known), `body` (what is lifted, and the checks that
   settings ask for), `observed` (which frames show enough), `fit_camera` and `fit_scale` (where the camera sees the
   root), `rooting` (where the neck is put that nobody gives).
2. Tree: `grower` grows and prunes the trees of some hypotheses, `trees` is what comes of them.
3. Refine, where points or lengths are uncertain: `length_evidence` (whether lengths may be taken at their word),
   `clip_body` (one body for all frames), `noise`, `hypotheses` (what was observed, and how far it may be off),
   `refiner` (trees on trunks), `limb_walls` (limits of limbs), `survival` (what became of each leaf), `refined` (the
   likeliest postures), `refined_completion` (joints that were not seen); `photograph` without a camera.
4. Certify: `certified`, the checks that every refined posture passes; `judged`, what a result says of that.
5. Rank: `ranked`, the probability of every survivor; `grouping`, those that are alike.
6. Answer: `recovery` (what is returned), `answered` (what is said of each frame), `camera_record`, `result` (what is
   written) and `result_output` (where), `summary` and `advice` (what is printed), `least_violation` and
   `length_diagnosis` (what is wrong where no posture was found).

`sequences` and `scaled_sequences` follow a person through what was recovered. Of a result `recovered` says what it was
recovered with, and `result_sequence` how it moves. `taylor_figure` is another body: the twelve points of Taylor (2000).
"""

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
    from posekit.recovery.swapped_labels import swapped_line as swapped_line
    from posekit.recovery.swapped_labels import undo_swaps as undo_swaps
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
            "swapped_labels": (
                "swapped_line",
                "undo_swaps",
            ),
        },
    )
