"""What the page says of a frame first: the likeliest posture, how sure it is, and what else it can be."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.answers import written_answer
from posekit.answers.depth_order import ANSWER_SEGMENTS
from posekit.answers.wording import answer_lines, difference
from posekit.formats.own.result import ResultFrame
from posekit.geometry import Array
from posekit.ranking import deviation_of_tolerance
from posekit.viewer.scene.image_sight import ImageSight

Json = dict[str, Any]

MOST_REPRESENTATIVES: Final = 6
"""Postures that are told one by one beside the likeliest."""


def answer_data(frame: ResultFrame, rows: NDArray[np.intp]) -> Json | None:
    """Gather the answer of a frame; None where nothing says how probable its postures are, or there is none.

    Parameters
    ----------
    frame : ResultFrame
        With all of its survivors.
    rows : int array (K,)
        Those that the page has, in its order.
    """
    if frame.probability is None or not len(frame.joints):
        return None
    answer = written_answer(frame, float(deviation_of_tolerance(0.0)))
    place = {row: k for k, row in enumerate(rows.tolist())}
    first = answer.posture
    representatives = [
        {
            "at": place[row],
            "p": float(f"{p:.4g}"),
            "how": "" if k == 0 else difference(first, answer.joints[k]),
        }
        for k, (row, p) in enumerate(
            zip(answer.rows[:MOST_REPRESENTATIVES].tolist(), answer.probability.tolist(), strict=False)
        )
        if row in place
    ]
    return {
        "lines": answer_lines([answer]),
        "sure": float(f"{answer.sure:.4g}"),
        "near": _rounded(answer.depth.near),
        "far": _rounded(answer.depth.far),
        "representatives": representatives,
        "more": max(len(answer) - len(representatives), 0),
    }


def answer_segments() -> list[list[int]]:
    """Return start and end of the segments of which an answer says which end is nearer."""
    return [list(pair) for pair in ANSWER_SEGMENTS]


def image_distances(joints: Array, sight: ImageSight | None) -> Array:
    """Measure how far the image of a posture (14, 3) is from the picture's points, in the image's unit (14,).

    Parameters
    ----------
    joints : array (14, 3)
        Camera frame, metres.
    sight : ImageSight, optional
        The camera and the points of the picture.
    """
    if sight is None:
        return np.full(len(joints), np.nan)
    away = sight.camera.project(joints[None])[0] - sight.image[: len(joints)]
    return np.asarray(np.linalg.norm(away, axis=-1))


def _rounded(values: Array) -> list[float | None]:
    return [None if np.isnan(value) else round(value, 3) for value in values.tolist()]
