"""What is wrong with a clip's frames as such, each thing named once; what is left is judged as motion.

A jump breaks bounds of speed, acceleration and jerk, too; so do labels that are exchanged, and frames in a wrong
order. So there is an order: times, then frames that are others again, then the order that the motion itself has, then
right and left, then jumps. Each sees what those before it left over, and the checks of motion see what they all left:
joints with right and left put right, in slots of even time, NaN where another check has named the frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.motion.clip import MotionClip, once_a_clip
from posekit.validators.motion.duplicates import duplicates
from posekit.validators.motion.jumps import LEAST_JUMP, Jumps, jumps_of
from posekit.validators.motion.order import ORDERED_RATE, displaced, stretches_of
from posekit.validators.motion.sides import exchanged_pairs, put_right
from posekit.validators.motion.timeline import Timeline, timeline_of
from posekit.validators.motion.trembling import trembling_of, usual_trembling


@dataclass(frozen=True, kw_only=True, eq=False)
class Explained:
    """What was found in T frames, and what motion is left in S slots.

    Parameters
    ----------
    timeline : Timeline
        Where frames are in time.
    repeats : int array (T,)
        How many frames in a row are the one before again, at each of them.
    displaced : int array (T,)
        Frames by which the motion says that each is out of its place.
    exchanged : bool array (T, 6)
        Pairs whose right and left are exchanged.
    jumps : Jumps
        Of slots.
    joints : array (S, 14, 3)
        What is left.
    noise : float
        Of the clip.
    """

    timeline: Timeline
    repeats: NDArray[np.intp]
    displaced: NDArray[np.intp]
    exchanged: NDArray[np.bool_]
    jumps: Jumps
    joints: Array
    noise: float

    @cached_property
    def trembling(self) -> Array:
        """How much joints tremble in slots (S, 14), metres."""
        return trembling_of(self.joints, self.noise)


@once_a_clip
def explained(clip: MotionClip) -> Explained:
    """Find what is wrong with the frames of a clip; of one clip once."""
    timeline = timeline_of(clip)
    # Frames without a place in time come last, and nothing is said of them.
    order = np.argsort(np.where(timeline.slots < 0, timeline.count, timeline.slots), kind="stable")
    back = np.argsort(order)
    joints = clip.joints[order]
    repeats = duplicates(joints)
    joints = np.where((repeats > 0)[:, None, None], np.nan, joints) if repeats.any() else joints
    known = repeats == 0
    places = np.zeros(len(joints), dtype=np.intp)
    if not clip.rate < ORDERED_RATE:
        places[known] = displaced(joints[known])
    rearranged = stretches_of(places)
    if places.any():
        joints = np.where(rearranged[:, None, None], np.nan, joints)
    kept = known & ~rearranged
    exchanged = np.zeros((len(joints), 6), dtype=np.bool_)
    noise = max(clip.noise, usual_trembling(joints[kept]))
    follows = np.diff(timeline.slots[order][kept]) == 1
    if len(joints) > 1:  # of one posture the usual ranges judge which way a knee bends
        exchanged[kept] = exchanged_pairs(
            joints[kept], clip.feet[order][kept], clip.head[order][kept], follows, noise
        )
    joints = timeline.spread(put_right(joints, exchanged)[back])
    jumps = jumps_of(joints, clip.step)
    jumped = (jumps.joint > LEAST_JUMP) | (jumps.body > LEAST_JUMP)[:, None]
    return Explained(
        timeline=timeline,
        repeats=repeats[back],
        displaced=places[back],
        exchanged=exchanged[back],
        jumps=jumps,
        joints=np.where(jumped[..., None], np.nan, joints) if jumped.any() else joints,
        noise=clip.noise,
    )
