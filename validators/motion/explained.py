"""Defects of the frames of a clip as such, each named once; what remains is judged as motion.

A jump also exceeds bounds of speed, acceleration and jerk; so do exchanged labels and shuffled frames. So there is an
order: times, then repeated frames, then the order of the motion itself, then right and left, then jumps. Each step sees
what those before it left. The checks of motion see the rest: joints with right and left corrected, in slots of even
time, NaN where another check has named the frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, runs
from posekit.validators.body import Body, once
from posekit.validators.motion.jumps import LEAST_JUMP, jumps_of
from posekit.validators.motion.order import ORDERED_RATE, displaced, stretches_of
from posekit.validators.motion.sides import exchanged_pairs, put_right
from posekit.validators.motion.timeline import Timeline, norm, timeline_of
from posekit.validators.motion.trembling import trembling_of, usual_trembling

#: Distance below which two positions are one, metres: one number written with 32 and with 64 bits.
SAME_METRES: Final = 1e-6

#: Step of the fastest joint in a frame from which a body moves, metres: coarse rounding alone makes no duplicate.
MOVED_METRES: Final = 1e-3

#: Frames before and after a run of duplicates in which the body must move.
NEAR_FRAMES: Final = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Explained:
    """What was found in T frames, and the motion that is left in S slots of even time.

    Parameters
    ----------
    timeline : Timeline
        Slot of each frame.
    repeats : int array (T,)
        Length of the run of duplicates that each frame is in; 0 for others.
    displaced : int array (T,)
        Frames by which each is out of its place, by the motion.
    exchanged : bool array (T, 6)
        Pairs whose right and left are exchanged.
    jumps : array (S, 15)
        Jumps of the joints and of the body, metres; see `posekit.validators.motion.jumps.jumps_of`.
    joints : array (S, 14, 3)
        The motion that is left.
    noise : float
        Noise of the body, metres.
    """

    timeline: Timeline
    repeats: NDArray[np.intp]
    displaced: NDArray[np.intp]
    exchanged: NDArray[np.bool_]
    jumps: Array
    joints: Array
    noise: float

    @cached_property
    def trembling(self) -> Array:
        """Standard deviation of trembling in slots (S, 14), metres."""
        return trembling_of(self.joints, self.noise)


@once
def explained(body: Body) -> Explained:
    """Find the defects of a body's frames."""
    timeline = timeline_of(body)
    # Frames without a place in time come last, and are not judged.
    order = np.argsort(np.where(timeline.slots < 0, timeline.count, timeline.slots), kind="stable")
    back = np.argsort(order)
    joints = body.joints[order]
    repeats = duplicates(joints)
    joints = np.where((repeats > 0)[:, None, None], np.nan, joints) if repeats.any() else joints
    known = repeats == 0
    places = np.zeros(len(joints), dtype=np.intp)
    if not body.rate < ORDERED_RATE:
        places[known] = displaced(joints[known])
    rearranged = stretches_of(places)
    if places.any():
        joints = np.where(rearranged[:, None, None], np.nan, joints)
    kept = known & ~rearranged
    exchanged = np.zeros((len(joints), 6), dtype=np.bool_)
    noise = max(body.noise, usual_trembling(joints[kept]))
    follows = np.diff(timeline.slots[order][kept]) == 1
    # Joint ranges judge which way a knee of one posture bends; the sides of a robot follow from its names.
    if len(joints) > 1 and body.q is None:
        exchanged[kept] = exchanged_pairs(
            joints[kept], body.feet[order][kept], body.head[order][kept], follows, noise
        )
    for edge, beside in ((0, 1), (-1, -2)):
        # One frame at an end that is another posture faces elsewhere: that is a jump, no exchange of labels.
        if len(joints) > 2 and exchanged[edge].all() and not exchanged[beside].any():
            exchanged[edge] = False
    joints = timeline.spread(put_right(joints, exchanged)[back])
    jumps = jumps_of(joints, body.dt)
    jumped = (jumps[:, :-1] > LEAST_JUMP) | (jumps[:, -1:] > LEAST_JUMP)
    return Explained(
        timeline=timeline,
        repeats=repeats[back],
        displaced=places[back],
        exchanged=exchanged[back],
        jumps=jumps,
        joints=np.where(jumped[..., None], np.nan, joints) if jumped.any() else joints,
        noise=body.noise,
    )


def duplicates(joints: Array) -> NDArray[np.intp]:
    """Return the length of the run of duplicates that each frame is in (T,): 0 where it is no copy of the one before.

    A run counts where the body moves by more than a millimetre a frame shortly before and shortly after it, at an end
    of the clip on one side. Otherwise rounding is enough to make two frames one.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres, frame after frame; a joint that is unknown in both frames is the same.
    """
    count = len(joints)
    lengths = np.zeros(count, dtype=np.intp)
    if count < 2:
        return lengths
    steps = norm(np.diff(joints, axis=0))
    unknown = np.isnan(joints[..., 0])
    alike = (unknown[1:] == unknown[:-1]).all(axis=1) & ~unknown[1:].all(axis=1)
    fastest = np.nan_to_num(np.fmax.reduce(steps, axis=1))
    same = alike & (fastest < SAME_METRES)
    for first, last in runs(same):
        before, after = fastest[max(first - NEAR_FRAMES, 0) : first], fastest[last : last + NEAR_FRAMES]
        moving = [part.max() > MOVED_METRES for part in (before, after) if len(part)]
        if moving and all(moving):
            lengths[first + 1 : last + 1] = last - first
    return lengths
