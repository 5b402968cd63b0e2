"""Frames without a posture, and joints that were not seen, in formats that have a place for everything."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from posekit.display.plural import plural
from posekit.following import bridge
from posekit.recovery.result_sequence import PostureSequence
from posekit.skeleton import JOINTS

GAP_FILLINGS: Final = ("interpolate", "hold", "leave-out")


def fill_gaps(found: PostureSequence, how: str) -> PostureSequence:
    """Put in the frames that have no posture, and the joints that have no place, where anything tells of them.

    Parameters
    ----------
    found : PostureSequence
        One posture a frame.
    how : {"interpolate", "hold", "leave-out"}
        Limbs turn evenly from the frame before to the frame after (`posekit.following.bridge`), or a frame is as the
        nearest that has a posture; or nothing is put in. Before the first and after the last posture both hold. Joints
        that were not seen are interpolated either way.

    Returns
    -------
    PostureSequence
        With what was done added to what it says; rows that were put in have survivor -1 and no values.
    """
    unseen = np.isnan(found.points[:, : len(JOINTS), 0])
    if how == "leave-out" or not (found.lost or unseen.any()):
        return found
    times = np.concatenate([found.time, list(found.lost.values())])
    order = np.argsort(times, kind="stable")
    time, count = times[order], len(found)
    given = np.flatnonzero(order < count)
    rows = np.full(len(time), -1, dtype=np.intp)
    rows[given] = order[given]
    if how == "hold":
        nearest = np.abs(time[:, None] - time[given]).argmin(axis=1)
        points = found.points[rows[given][nearest]]
    else:
        points = np.full((len(time), *found.points.shape[1:]), np.nan)
        points[given] = found.points[rows[given]]
    points[:, : len(JOINTS)] = bridge(time, points[:, : len(JOINTS)])
    frame = np.concatenate([found.frame, np.fromiter(found.lost, dtype=np.intp, count=len(found.lost))])[
        order
    ]
    put_in = rows < 0
    held = "as in the nearest frame" if how == "hold" else "interpolated"
    says = [f"{put_in.sum()} of {plural(len(time), 'frame')} had no posture: {held}"] if put_in.any() else []
    says += [f"{plural(int(unseen.sum()), 'unseen joint')} interpolated"] if unseen.any() else []
    return replace(
        found,
        points=points,
        time=time,
        frame=frame,
        survivor=np.where(put_in, -1, found.survivor[rows]),
        values={name: np.where(put_in, np.nan, values[rows]) for name, values in found.values.items()},
        branches=tuple("" if row < 0 else found.branches[row] for row in rows.tolist())
        if found.branches
        else (),
        says=(*(line for line in found.says if not line.endswith("are left out")), *says),
        lost={},
    )
