"""What one stage of Viterbi's algorithm keeps: the cheapest ways from the ends of paths to the survivors of a frame."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.compiled.compiling import is_fast
from posekit.following import compiled_arrivals, reference_arrivals
from posekit.following.beam import Beam
from posekit.following.channels import NextSurvivors
from posekit.following.floors import Arrivals, Floors
from posekit.following.motion_model import MotionModel
from posekit.following.states import States

PAIRS_PER_TREE_GROWN: Final = 2500
"""Pairs of an end and a survivor that take as long, without compiled loops, as growing a frame's tree does."""


def arrivals(
    states: States,
    to: NextSurvivors,
    *,
    model: MotionModel,
    beam: Beam,
) -> Arrivals:
    """Find the cheapest way from each last survivor to each new one.

    Those that cost less than all ways that are left out, and as many as the beam is wide, are always among them.

    Parameters
    ----------
    states : States
        The ends of the paths so far.
    to : NextSurvivors
        The survivors of the frame.
    model : MotionModel
        What steps and turns cost.
    beam : Beam
        What of the arrivals is kept.
    """
    floors = Floors.of(states, to, model)
    # As long as no end has a velocity, all survivors are followed: the first steps say too little to choose.
    least = 0 if floors.moving else len(to)
    find = (
        compiled_arrivals.find
        if is_fast(len(states) * len(to) // PAIRS_PER_TREE_GROWN)
        else reference_arrivals.find
    )
    width = max(beam.width, least)
    came, went, cost, dropped = find(states, to, floors, model=model, beam=beam, width=width)
    order = np.lexsort((went, came))
    came, went, cost = came[order], went[order], cost[order]
    kept, lost = beam.keep(cost, states.fresh[came] | to.fresh[went], least=least)
    return Arrivals(came[kept], went[kept], cost[kept], min(dropped, lost))
