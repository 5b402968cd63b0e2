"""The order of a quaternion's four numbers in a table: by its name, or by which of the two lets a robot stand."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posekit.geometry import Array
from posekit.safe_io import refusal

UNIT_LENGTH_ERROR: Final = 0.01
"""How far from unit length a quaternion may be that was written with few digits; it is made one."""
UPRIGHT_COSINE, FALLEN_COSINE = 0.8, 0.5
"""Cosines between the root's z axis and the world's, medians over the frames, by which one order stands and the other
does not."""
QUATERNION_ORDERS: Final = ("xyzw", "wxyz")
CUSTOMARY_ORDER: Final = "xyzw"
"""As GMR, TWIST2 and PHUMA write ``root_rot`` and ``root_ori``; taken where the robot stands by both: then it looks
along x all the time, or by the other order just the other way."""


class RootTurn(NamedTuple):
    """Quaternions x, y, z, w (N, 4), of unit length, and a sentence that says how their order is known."""

    quaternion: Array
    said: str


def root_turn(values: Array, order: str, source: str, field: str) -> RootTurn:
    """Bring quaternions into the order x, y, z, w.

    Parameters
    ----------
    values : array (N, 4)
        As the file has them.
    order : str
        ``xyzw`` or ``wxyz``; empty where the file does not say it.
    source, field : str
        What to call them in errors.

    Raises
    ------
    InputError
        Where they are not of unit length, or the robot stands by neither order.
    """
    length = np.linalg.norm(values, axis=1)
    known = np.isfinite(length)
    off = known & (np.abs(length - 1) > UNIT_LENGTH_ERROR)
    if off.any():
        frame = int(np.argmax(off))
        got = f"a quaternion of length {length[frame]:.4g}"
        raise refusal(source, f"{field}[{frame}]", got, "1", "give quaternions, x, y, z, w or w, x, y, z")
    values = values / np.where(known, length, 1.0)[:, None]
    if order:
        return RootTurn(_in_order(values, order), "")
    stands = {name: upright(_in_order(values[known], name)) for name in QUATERNION_ORDERS}
    if stands[CUSTOMARY_ORDER] >= UPRIGHT_COSINE:
        how = (
            "so the robot stands" if stands["wxyz"] < UPRIGHT_COSINE else "as is customary; it stands by both"
        )
        return RootTurn(_in_order(values, CUSTOMARY_ORDER), f"{field} is taken as x, y, z, w: {how}")
    if stands["wxyz"] >= UPRIGHT_COSINE and stands[CUSTOMARY_ORDER] <= FALLEN_COSINE:
        return RootTurn(_in_order(values, "wxyz"), f"{field} is taken as w, x, y, z: so the robot stands")
    got = "a quaternion whose order is not said, and by which the robot does not stand"
    remedy = f"name the array {field}_xyzw or {field}_wxyz"
    raise refusal(source, field, got, "x, y, z, w or w, x, y, z", remedy)


def upright(quaternion: Array) -> float:
    """Return the median cosine between the z axes of bodies (N, 4; x, y, z, w) and the world's; -1 without any."""
    x, y = quaternion[:, 0], quaternion[:, 1]
    return float(np.median(1 - 2 * (x * x + y * y))) if len(quaternion) else -1.0


def _in_order(values: Array, order: str) -> Array:
    return np.asarray(values[:, [1, 2, 3, 0]] if order == "wxyz" else values)
