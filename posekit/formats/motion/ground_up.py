"""Which way is up, by how bodies stand and by the ground under them, against what a file says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.formats.motion.motion import UP_DIRECTIONS
from posekit.formats.motion.postures_up import guess_up
from posekit.geometry import Array
from posekit.safe_io import refusal

FLAT_METRES: Final = 0.15
"""How much the lowest joint of a body that stays on a level ground goes up and down: an ankle's rise in a step."""
STEEP_METRES: Final = 0.6
"""How much it must go along another axis for that axis not to be up: more than from a crouch to the tips of the
toes."""
CLEAR_RATIO: Final = 2.0
"""How many times as much it must go along every other axis."""
SPREAD_PERCENTS: Final = (5, 95)


class FoundUp(NamedTuple):
    """The axis that points up, empty where it is not known, and a sentence that says from what."""

    up: str
    said: str = ""


def find_up(joints: Array, clip: NDArray[np.intp], up: str, source: str, *, told: bool) -> FoundUp:
    """Tell which way is up.

    Parameters
    ----------
    joints : array (T, 14, 3)
        In tree order, metres.
    clip : int array (T,)
        The recording of each frame.
    up : str
        What the file says, or what is customary; empty where it is neither.
    source : str
        What to call it in errors.
    told : bool
        Whether the file itself says it.

    Raises
    ------
    InputError
        Where the file's own word is another than how bodies stand, and the ground is against it too.
    """
    stands = _stands_along(joints)
    if stands and stands == up:
        return FoundUp(up)
    flat = {name: ground_spread(joints, clip, name) for name in UP_DIRECTIONS}
    by_ground = _level(flat)
    if not told:
        if stands and not (flat[stands] > STEEP_METRES and min(flat.values()) < FLAT_METRES):
            return FoundUp(stands, f"{stands} is up by how bodies stand")
        if by_ground:
            said = f"{by_ground} is up by the ground: the lowest joint stays level along it"
            return FoundUp(by_ground, said)
        return FoundUp(
            up, "" if up else "which way is up is not known: nobody stands, nothing is level (--up)"
        )
    other = stands or by_ground
    if other in ("", up) or (flat[up] < FLAT_METRES and flat[other] > STEEP_METRES):
        return FoundUp(up)
    how = "bodies stand along" if stands else "the ground is level along"
    if flat[up] > STEEP_METRES and flat[other] < FLAT_METRES:
        got = f"{up}, by the file's own word, along which the lowest joint goes {flat[up]:.1f} m"
        expected = f"an axis along which feet stay level, as {other}"
        raise refusal(source, "up", got, expected, f"{how} {other}; state it: --up {up} or --up {other}")
    return FoundUp(up, f"{up} is up by the file's own word, though {how} {other} (--up)")


def against_stated_up(joints: Array, clip: NDArray[np.intp], up: str) -> tuple[str, ...]:
    """Say that bodies stand along another axis than the one that was stated to be up; nothing where they do not.

    Parameters
    ----------
    joints : array (T, 14, 3)
        In tree order, metres.
    clip : int array (T,)
        The recording of each frame.
    up : str
        One of `UP_DIRECTIONS`.
    """
    stands = _stands_along(joints)
    if not stands:
        return ()
    level = (
        ground_spread(joints, clip, up) < FLAT_METRES and ground_spread(joints, clip, stands) > STEEP_METRES
    )
    return () if stands == up or level else (f"{up} is up as was stated, though bodies stand along {stands}",)


def _stands_along(joints: Array) -> str:
    """Return the axis along which bodies stand (T, 14, 3); empty where they tell none."""
    try:
        return guess_up(joints)
    except InputError:
        return ""


def _level(flat: Mapping[str, float]) -> str:
    """Return the axis along which the lowest joint stays level, and clearly more so than along the others."""
    best, second = sorted(flat, key=lambda name: flat[name])[:2]
    return best if flat[best] < FLAT_METRES and CLEAR_RATIO * flat[best] < flat[second] else ""


def ground_spread(joints: Array, clip: NDArray[np.intp], up: str) -> float:
    """Return how much the lowest joint goes along an axis, metres: from the 5th to the 95th percentile of a clip.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres.
    clip : int array (T,)
        The recording of each frame: of several the median counts.
    up : str
        One of `UP_DIRECTIONS`.
    """
    lowest = np.fmin.reduce(joints @ UP_DIRECTIONS[up], axis=1)
    spreads = []
    for index in np.unique(clip):
        known = lowest[(clip == index) & np.isfinite(lowest)]
        if len(known):
            low, high = np.percentile(known, SPREAD_PERCENTS)
            spreads.append(float(high - low))
    return float(np.median(spreads)) if spreads else float("inf")
