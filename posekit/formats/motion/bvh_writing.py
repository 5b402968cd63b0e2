"""Write the figure's joint angles as BVH."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.formats.motion.bvh_angles import AXIS_ORDER, continuous
from posekit.formats.motion.bvh_names import ANIMATION_NAMES
from posekit.formats.motion.bvh_tree import BODY_NODES, LEAF_NODES, checked, filled, offsets, place
from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.geometry import Array
from posekit.safe_io import refusal, replacing, shown

STILL_FRAME_SECONDS: Final = 1 / 30
"""Seconds that a file of one frame says."""
UNEVEN_STEP_SHARE: Final = 0.1
"""Fraction of a frame by which a frame's time may lie beside its place in an even sequence."""
_DIGITS: Final = 6
_ROWS: Final = 2000


def write_bvh(
    path: str | Path,
    figure: Figure,
    q: Array,
    time: Array,
    *,
    up: str = "+z",
    unit: str = "cm",
    unknown: str = "refuse",
) -> None:
    """Write configurations as BVH, whole or not at all.

    The joints are those of `posekit.formats.motion.bvh_tree`, named as in `ANIMATION_NAMES`; every joint has the
    channels Xrotation Zrotation Yrotation, which are the figure's flexion, abduction (or bending) and rotation. Angles
    and places have 6 decimals, the points are those of forward kinematics within 1e-7 m.

    Parameters
    ----------
    path : path
        The file to write, whole or not at all.
    figure : Figure
        The figure whose configurations they are.
    q : array (T, nq)
        In Pinocchio's order, free-flyer first: metres, unit quaternion, radians.
    time : array (T,)
        Seconds, evenly spaced: the file says the first as 0.
    up : str
        The axis of q's world that points up; in the file y does.
    unit : str
        One of `posekit.formats.motion.motion_format.METRES_IN_UNIT`.
    unknown : str
        ``refuse`` or ``hold`` angles that are not known: see `posekit.formats.motion.bvh_tree.filled`.

    Raises
    ------
    InputError
        Where q or time are not what is said above, or the file cannot be written.
    """
    if unit not in METRES_IN_UNIT:
        raise refusal(path, "unit", shown(unit), " or ".join(METRES_IN_UNIT), "state one of them")
    q = checked(path, figure, q, time, up)
    frame_time = even_step(path, np.asarray(time, dtype=np.float64))
    placed = place(figure, filled(path, figure, q, unknown), up)
    scale = 1.0 / METRES_IN_UNIT[unit]
    angles = np.degrees(continuous(placed.angles)).reshape(len(q), -1)
    values = np.hstack([placed.root * scale, angles])
    with replacing(path) as file:
        for piece in _pieces(offsets(figure) * scale, values, frame_time):
            file.write(piece.encode("ascii"))


def even_step(path: str | Path, time: Array) -> float:
    """Return the time from frame to frame, seconds; refuse frames that are not evenly spaced."""
    if len(time) == 1:
        return STILL_FRAME_SECONDS
    step = float(time[-1] - time[0]) / (len(time) - 1)
    beside = np.abs(time - time[0] - step * np.arange(len(time))) / step
    if beside.max() > UNEVEN_STEP_SHARE:
        frame = int(np.argmax(beside))
        got = f"{time[frame] - time[0]:g} s after the first"
        expected = f"{step * frame:g} s, for a BVH file has one time from frame to frame"
        raise refusal(path, f"time[{frame}]", got, expected, "write frames that are evenly spaced")
    return step


def _pieces(steps: Array, values: Array, frame_time: float) -> Iterator[str]:
    yield "HIERARCHY\n" + "".join(_block(0, steps, 0))
    yield f"MOTION\nFrames: {len(values)}\nFrame Time: {frame_time:.10f}\n"
    values = np.round(values, _DIGITS) + 0.0  # no -0.000000
    row = " ".join(f"%.{_DIGITS}f" if column.any() else "%d" for column in values.T) + "\n"
    for start in range(0, len(values), _ROWS):
        piece = values[start : start + _ROWS]
        yield (row * len(piece)) % tuple(piece.ravel().tolist())


def _block(k: int, steps: Array, depth: int) -> Iterator[str]:
    """Spell a node and what hangs on it; the tree is 6 deep."""
    tab, node = "\t" * depth, BODY_NODES[k]
    x, y, z = np.round(steps[k], _DIGITS + 2) + 0.0
    turns = " ".join(f"{'XYZ'[axis]}rotation" for axis in AXIS_ORDER)
    moves = "Xposition Yposition Zposition "
    yield f"{tab}{'JOINT' if depth else 'ROOT'} {ANIMATION_NAMES[node.name]}\n{tab}{{\n"
    yield f"{tab}\tOFFSET {x:.8f} {y:.8f} {z:.8f}\n"
    yield f"{tab}\tCHANNELS {3 if depth else 6} {'' if depth else moves}{turns}\n"
    if k in LEAF_NODES:
        # A reader expects an end; the figure has no hands and no feet, so it has no length.
        yield f"{tab}\tEnd Site\n{tab}\t{{\n{tab}\t\tOFFSET 0.0 0.0 0.0\n{tab}\t}}\n"
    for child, other in enumerate(BODY_NODES):
        if other.parent == k:
            yield from _block(child, steps, depth + 1)
    yield f"{tab}}}\n"
