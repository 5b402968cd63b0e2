"""What noise may do to angles, as plain loops: the formulas are those of `posekit.refinement.allowance`.

A screen of `posekit.compiled.screen_kinds.OF_NOISY` is another one with wider tolerances. Its numbers are laid out by
`posekit.refinement.allowance.NoisyRange`: the kind of the other, then as `AT_BOUND` and so on say; the other's own
numbers follow. While it is asked, what it allows is written down from `ALLOWED_AT` on, where there are zeros else.
"""

from __future__ import annotations

import math
from typing import Any

from posekit.compiled.frame_kernels import ROOM_AT
from posekit.compiled.rigid_kernels import SHORTEST_METRES, between
from posekit.geometry import Array

AT_BOUND, AT_STRETCH, AT_PERSPECTIVE, AT_BESIDE, AT_COUNT, AT_PAIRS = range(1, 7)
"""Where numbers are.

Bound and stretch; 1 for a camera with a perspective; 1 where the second place is an abduction; how many segments there
are, then start, end, and 1 for a limb's, 0 for the trunk's.
"""

PAIR_NUMBERS = 3
"""Numbers of a segment."""

MIN_COSINE = 0.02
"""Cosine of the abduction down to which the other angles' allowance is reckoned."""

LEAST_DEGREES = 1e-3
"""Degrees that are allowed at least."""

ALLOWED_AT, BESIDE_AT, LEVEL_AT, ACROSS_AT, BLUR_AT = range(ROOM_AT + 50, ROOM_AT + 55)
"""Where is written down: how many times a tolerance is allowed; 1 where the second place is an abduction; its cosine
and sine; radians within which nothing is clear, as arcus cosines near one have few digits."""

BLUR_RADIANS = 2e-6
"""What is written down there."""


def off(w: Array, start: int, end: int, share: Any, at: int) -> Any:
    """Return by what angle noise may turn a segment, radians; NaN where it is not known, -1 where that is not clear."""
    x, y, z = between(w, start, end)
    length = math.sqrt(x * x + y * y + z * z)
    if math.isnan(length):
        return math.nan
    if not SHORTEST_METRES < length < math.inf:
        return -1.0
    bound, stretch = share * w[at + AT_BOUND], w[at + AT_STRETCH]
    away = z
    if w[at + AT_PERSPECTIVE] > 0:
        ex, ey, ez = w[3 * end], w[3 * end + 1], w[3 * end + 2]
        depth = math.sqrt(ex * ex + ey * ey + ez * ez)
        if not SHORTEST_METRES < depth < math.inf:
            return -1.0
        away = (x * ex + y * ey + z * ez) / depth
        bound *= depth
    seen = math.sqrt(max(length * length - away * away, 0.0))
    delta = math.sqrt(bound * bound + stretch * seen * stretch * seen)
    angle = math.atan2(abs(away), seen)
    least = math.acos(min((seen + delta) / length, 1.0))
    most = math.acos(max((seen - delta) / length, -1.0))
    return max(angle - least, most - angle)


def allow(w: Array, at: int) -> Any:
    """Write down what noise allows to the posture in w; return whether it is clear."""
    trunk, limb = 0.0, 0.0
    for i in range(int(w[at + AT_COUNT])):
        row = at + AT_PAIRS + PAIR_NUMBERS * i
        of_limb = w[row + 2] > 0
        turn = off(w, int(w[row]), int(w[row + 1]), math.sqrt(2.0) if of_limb else 1.0, at)
        if turn < 0:
            return False
        if of_limb and turn > limb:
            limb = turn
        if not of_limb and turn > trunk:
            trunk = turn
    degrees = math.sqrt(trunk * trunk + limb * limb) * 180.0 / math.pi
    w[ALLOWED_AT], w[BESIDE_AT], w[BLUR_AT] = max(degrees, LEAST_DEGREES), w[at + AT_BESIDE], BLUR_RADIANS
    return True


def forget(w: Array) -> None:
    """Write down that no noise is allowed for."""
    w[ALLOWED_AT], w[BESIDE_AT], w[LEVEL_AT], w[BLUR_AT] = 0.0, 0.0, 0.0, 0.0


def beside(w: Array, level: Any, across: Any) -> None:
    """Write down cosine and sine of an abduction, where it is one."""
    if w[BESIDE_AT] > 0:
        w[LEVEL_AT], w[ACROSS_AT] = max(level, MIN_COSINE), abs(across)


def loosened(w: Array, place: int, tolerance: Any, degree: Any) -> Any:
    """Return the tolerance of a place under noise, in units of which one degree is so many."""
    if not w[ALLOWED_AT] > 0:
        return tolerance
    if w[LEVEL_AT] > 0 and place == 0:
        tolerance /= w[LEVEL_AT]
    if w[LEVEL_AT] > 0 and place == 2:
        tolerance += degree * w[ACROSS_AT] / w[LEVEL_AT]
    return tolerance * w[ALLOWED_AT]


COMPILED_TYPES = {
    "off": "",
    "allow": "(f8[::1], i8)",
    "forget": "",
    "beside": "",
    "loosened": "",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
