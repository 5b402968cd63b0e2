"""The loop over ends of paths and survivors, which leaves early what can no longer be kept.

Ends and survivors are taken in the order of their floors (`posekit.following.floors`). A pair whose floors, or whose
first channels with them, are above what is the dearest that can still be kept is left, and with it all that follow.
Nothing that could have been kept is lost.

Every function here also runs as it is, slowly.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array

TIGHT_COST = 1e-9
"""Cost by which a bound may be off by rounding."""


AT_X, AT_Y, AT_Z, AT_WEIGHT, AT_VARIANCE, AT_REACH, AT_GIVE = range(7)
"""Columns of an end's channel: where it is, one over the square of the time since, its variance, walls, their give."""

TO_VARIANCE, TO_GIVE, TO_KNOWN = 3, 4, 5
"""Columns of a survivor's channel, after its place."""

TURN_WEIGHT, TURN_NOISE = 3, 4
"""Columns of where an end is heading: one over the square of the scale there, and its own noise in units of it."""

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def lay(rows: Ints, channels: Ints, place: Array, centre: Array, numbers: Array, laid: Array) -> None:
    """Lay out vectors (C, S, 3), from their centres (C, 3), and numbers (M, C, S): those of a row side by side."""
    for k in range(len(rows)):
        for i in range(len(channels)):
            c, s = channels[i], rows[k]
            for axis in range(3):
                laid[k, i, axis] = place[c, s, axis] - centre[c, axis]
            for m in range(len(numbers)):
                laid[k, i, 3 + m] = numbers[m, c, s]


def step(ends: Array, to: Array, i: int, j: int, scale: Array, nu: float, walls: float, most: float) -> float:
    """Return what the velocities of a step cost; infinite where the products' G / H passes `most`, -1 beyond the walls.

    `scale` is one over the square of each channel's, `walls` 1 where they are asked and 0 where not.
    """
    G, H, per = 1.0, 1.0, 1.0 / nu
    for c in range(ends.shape[1]):
        if to[j, c, TO_KNOWN] == 0.0 or (walls == 0.0 and scale[c] == 0.0):
            continue
        x = to[j, c, AT_X] - ends[i, c, AT_X]
        y = to[j, c, AT_Y] - ends[i, c, AT_Y]
        z = to[j, c, AT_Z] - ends[i, c, AT_Z]
        squared = x * x + y * y + z * z
        if walls > 0.0:
            reach = ends[i, c, AT_REACH] + ends[i, c, AT_GIVE] + to[j, c, TO_GIVE]
            if squared > reach * reach * (1 + 1e-12) + 1e-12:
                return -1.0
        weight = ends[i, c, AT_WEIGHT] * scale[c]
        wide = 1.0 + weight * (ends[i, c, AT_VARIANCE] + to[j, c, TO_VARIANCE])
        H *= wide
        G *= wide + weight * per * squared
        if G > most * H:
            return math.inf
    return (nu + 3) / 2 * math.log(G) - (nu + 2) / 2 * math.log(H)


def turn(heading: Array, to: Array, i: int, j: int, joints: Ints, nu: float, most: float) -> float:
    """Return what a change of velocity costs; infinite where the products' G / H passes `most`."""
    G, H, per = 1.0, 1.0, 1.0 / nu
    for k in range(heading.shape[1]):
        c = joints[k]
        if to[j, c, TO_KNOWN] == 0.0:
            continue
        x = to[j, c, AT_X] - heading[i, k, AT_X]
        y = to[j, c, AT_Y] - heading[i, k, AT_Y]
        z = to[j, c, AT_Z] - heading[i, k, AT_Z]
        weight = heading[i, k, TURN_WEIGHT]
        wide = 1.0 + heading[i, k, TURN_NOISE] + weight * to[j, c, TO_VARIANCE]
        H *= wide
        G *= wide + weight * per * (x * x + y * y + z * z)
        if G > most * H:
            return math.inf
    return (nu + 3) / 2 * math.log(G) - (nu + 2) / 2 * math.log(H)


def put(cost: Array, came: Ints, went: Ints, count: int, new: float, end: int, to: int) -> None:
    """Put a path into a heap, the dearest on top; where it is full, in place of that."""
    full = count == len(cost)
    k = 0 if full else count
    while not full and k > 0 and cost[(k - 1) >> 1] < new:
        up = (k - 1) >> 1
        cost[k], came[k], went[k] = cost[up], came[up], went[up]
        k = up
    while full and 2 * k + 1 < count:
        down = 2 * k + 1
        if down + 1 < count and cost[down + 1] > cost[down]:
            down += 1
        if cost[down] <= new:
            break
        cost[k], came[k], went[k] = cost[down], came[down], went[down]
        k = down
    cost[k], came[k], went[k] = new, end, to


def arrive(  # noqa: PLR0912 -- calls with many arrays cost more than what they would do
    first: Ints,
    order: Ints,
    floor: Array,
    fresh: Bools,
    sofar: Array,
    turns: Array,
    alike: bool,
    ends: Array,
    heading: Array,
    survivors: Array,
    own: Array,
    to_floor: Array,
    to_turns: Array,
    new: Bools,
    joints: Ints,
    usual: Array,
    resting: Array,
    nu: float,
    resting_nu: float,
    slack: float,
    cost: Array,
    came: Ints,
    went: Ints,
) -> tuple[Ints, Array]:
    """Find the cheapest ways from groups of ends to survivors.

    Parameters
    ----------
    first : int array (G + 1,)
        Where each group of ends begins; within it they ascend by `sofar` and `turns` together.
    order : int array (G,)
        The groups, by their floors.
    floor : array (G,)
        What a path that goes on from a group costs at least, without what is the survivor's.
    fresh : bool array (G,)
        Which groups are of fresh paths: through a survivor that no better path uses.
    sofar, turns : array (S,)
        What each end costs so far, and the floor of what its turn will.
    alike : bool
        Whether all ends of a group make the same steps to come.
    ends : array (S, C, 7)
        The channels of each end; see `AT_X` and the others for the columns.
    heading : array (S, K, 5)
        Where the channels that turn are heading at each end, as `turn` takes it.
    survivors : array (N, C, 6)
        The channels of each survivor, as `step` takes them.
    own, to_floor, to_turns : array (N,)
        What each costs itself; with the floors of its steps and turns, ascending; and those of its turns alone.
    new : bool array (N,)
        Which survivors no better path uses.
    joints : int array (K,)
        The channels that turn.
    usual, resting : array (C,)
        One over the square of the scales of speeds; zero where there is none.
    nu, resting_nu, slack : float
        Degrees of freedom of speeds, and of those of what rests; what a path may cost more than the cheapest.
    cost, came, went : array (2, M)
        Filled: the M cheapest of the paths that are not fresh, and of those that are.

    Returns
    -------
    count : int array (2,)
        How many there are of either.
    most : array (2,)
        What a path that is not among them costs at least; infinite where none was left out.
    """
    half = (nu + 3) / 2
    count, best = np.zeros(2, np.int64), np.full(2, np.inf)
    most = np.full(2, np.inf)
    left = False
    for g in order:
        for j in range(len(own)):
            kind = 1 if fresh[g] or new[j] else 0
            limit = most[kind] + TIGHT_COST
            low = floor[g] + to_floor[j]
            if low > limit:
                left = True
                if low > max(most[0], most[1]) + TIGHT_COST:
                    break
                continue
            found, which, stepped, wall = math.inf, -1, 0.0, True
            for i in range(first[g], first[g + 1]):
                bound = min(limit, found)
                if i == first[g] or not alike:
                    # Ends that are alike share the first's step, and have floors no lower than the group's.
                    farthest = math.exp(min((bound - low) / half, 700.0))
                    stepped = step(ends, survivors, i, j, usual, nu, 1.0, farthest)
                    if 0.0 <= stepped < math.inf:
                        stepped += step(ends, survivors, i, j, resting, resting_nu, 0.0, math.inf)
                wall = wall and stepped < 0.0
                total = sofar[i] + own[j] + stepped
                lowest = total + turns[i] + to_turns[j]
                if not 0.0 <= stepped < math.inf or lowest > bound:
                    if alike:
                        break
                    continue
                if heading.shape[1] > 0:
                    farthest = math.exp(min((bound - lowest) / half, 700.0))
                    total += turn(heading, survivors, i, j, joints, nu, farthest)
                if total < found:
                    found, which = total, i
            if not found <= limit or which < 0:
                left = left or not wall
                continue
            if count[kind] < cost.shape[1] or found < cost[kind, 0]:
                left = left or count[kind] == cost.shape[1]
                put(cost[kind], came[kind], went[kind], count[kind], found, which, j)
                count[kind] = min(count[kind] + 1, cost.shape[1])
                best[kind] = min(best[kind], found)
                most[kind] = best[kind] + slack
                if count[kind] == cost.shape[1]:
                    most[kind] = min(most[kind], cost[kind, 0])
            else:
                left = True
    if not left:
        most[:] = np.inf
    return count, most


F8_1, F8_2, F8_3, I8_1, B1_1 = "f8[::1]", "f8[:, ::1]", "f8[:, :, ::1]", "i8[::1]", "b1[::1]"
COMPILED_TYPES = {
    "lay": f"({I8_1}, {I8_1}, {F8_3}, {F8_2}, {F8_3}, {F8_3})",
    "step": "",
    "turn": "",
    "put": "",
    "arrive": f"({I8_1}, {I8_1}, {F8_1}, {B1_1}, {F8_1}, {F8_1}, b1, {F8_3}, {F8_3}, {F8_3}, {F8_1}, {F8_1}, "
    f"{F8_1}, {B1_1}, {I8_1}, {F8_1}, {F8_1}, f8, f8, f8, {F8_2}, i8[:, ::1], i8[:, ::1])",
}
"""The kernels, in the order in which they need each other, with the types they take."""
