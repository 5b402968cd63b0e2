"""What one stage of Viterbi's algorithm keeps: the cheapest ways from the ends of paths to the survivors of a frame."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.compiled.compiling import is_fast
from posekit.following import fast, plain
from posekit.following.beam import Beam
from posekit.following.channels import Channels
from posekit.following.floors import Arrivals, Floors
from posekit.following.motion_model import MotionModel
from posekit.following.states import States
from posekit.geometry import Array

PAIRS_PER_TREE_GROWN: Final = 2500
"""Pairs of an end and a survivor that take as long, without compiled loops, as growing a frame's tree does."""


def arrivals(
    states: States,
    channels: Channels,
    time: float,
    own: Array,
    new: NDArray[np.bool_],
    *,
    model: MotionModel,
    beam: Beam,
) -> Arrivals:
    """Find the cheapest way from each last survivor to each new one.

    Those that cost less than all ways that are left out, and as many as the beam is wide, are always among them.

    Parameters
    ----------
    states : States
    channels : Channels
        N survivors.
    time : float
        Seconds.
    own : array (N,)
        What each costs itself; finite.
    new : bool array (N,)
        Those that make a path fresh.
    model : MotionModel
    beam : Beam
        What of it is kept.
    """
    floors = Floors.of(states, channels, time, own, model)
    least = 0 if floors.moving else len(own)
    find = fast.find if is_fast(len(states) * len(own) // PAIRS_PER_TREE_GROWN) else plain.find
    width = max(beam.width, least)
    found = find(states, channels, time, own, new, floors, model=model, beam=beam, width=width)
    came, went, cost, dropped = found
    order = np.lexsort((went, came))
    came, went, cost = came[order], went[order], cost[order]
    kept, lost = beam.keep(cost, states.fresh[came] | new[went], least=least)
    return Arrivals(came[kept], went[kept], cost[kept], min(dropped, lost))
