"""The motion of a figure's points, from the angles of its joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posekit.body import Figure
from posekit.formats.motion.bvh_tree import POINT_NODES, known_nodes
from posekit.formats.motion.motion import Motion
from posekit.geometry import Array
from posekit.safe_io import refusal, shown
from posekit.skeleton import POINTS


def figure_motion(
    path: str | Path, figure: Figure, q: Array, time: Array, *, unit: str | None, up: str
) -> Motion:
    """Place a figure's joints and head points by its angles.

    Parameters
    ----------
    path : path
        Where the angles are from, for messages.
    figure : Figure
        Whose angles they are.
    q : array (T, nq)
        In Pinocchio's order, free-flyer first: metres, unit quaternions, radians; NaN where an angle is not known.
    time : array (T,)
        Seconds, ascending.
    unit : str or None
        What the user says lengths are in: a figure's are metres, and any other unit is refused.
    up : str
        The axis of q's world that points up; empty where it is not known.

    Returns
    -------
    Motion
        All 19 points; NaN for those that hang on an angle that is not known.

    Raises
    ------
    InputError
        Where another unit is said.
    """
    if unit not in (None, "m"):
        raise refusal(path, "unit", shown(unit), "m, for a figure is in metres", "leave it out")
    points = figure.forward_kinematics(np.where(np.isnan(q), 0.0, q))
    points[known_nodes(figure, q)[:, POINT_NODES] == 0] = np.nan
    rate = (len(time) - 1) / (time[-1] - time[0]) if len(time) > 1 else 1.0
    return Motion(
        names=POINTS,
        points=points,
        time=time,
        rate=float(rate),
        up=up,
        source=str(path),
        told=("unit", "up") if up else ("unit",),
    )
