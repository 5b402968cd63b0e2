"""The answer of a frame of a result, as it was written, or made of what the frame lists."""

from __future__ import annotations

import numpy as np

from posekit.answers.answer import Answer, answers_of
from posekit.answers.depth_order import DepthOrder
from posekit.answers.listed_bodies import ListedBodies
from posekit.answers.regions import JointRegions
from posekit.errors import InputError
from posekit.formats.own.frame_answer import FrameAnswer
from posekit.formats.own.result import ResultFrame


def written_answer(frame: ResultFrame, deviation: float) -> Answer:
    """Return a frame's answer; results of version 1, which have none, list what it is made of.

    Parameters
    ----------
    frame : ResultFrame
        With probabilities.
    deviation : float
        Metres that its postures are off, in each direction, where they were not refined.

    Raises
    ------
    InputError
        Where the frame does not say how probable its postures are.
    """
    if frame.probability is None:
        raise InputError(
            "result: postures without probabilities; expected them of all frames; recover the view again"
        )
    bodies = ListedBodies.of(frame, frame.probability, deviation)
    if frame.answer is None:
        return answers_of([bodies])[0]
    return Answer(
        bodies=bodies,
        rows=frame.answer.representatives,
        probability=frame.answer.probability,
        depth=DepthOrder(near=frame.answer.near, far=frame.answer.far, unlisted=frame.unlisted_probability),
        written=_regions(frame.answer) if len(frame.answer.region_mean) else None,
    )


def _regions(answer: FrameAnswer) -> JointRegions:
    return JointRegions(
        mean=np.moveaxis(answer.region_mean, 1, 0),
        covariance=np.moveaxis(answer.region_covariance, 1, 0),
        probability=np.moveaxis(answer.region_probability, 1, 0),
        level=answer.region_level,
    )
