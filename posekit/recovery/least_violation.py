"""How near any posture comes to passing the checks, in a frame where none does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.display.check_words import check_words
from posekit.geometry import Array
from posekit.recovery.grower import Grower
from posekit.settings import MEASURED_TOLERANCE, Tolerance
from posekit.tree import Leaves
from posekit.tree.bits import path_of, select
from posekit.validators import Judgement, judge

UNIT_VIOLATIONS: Final = {"m": 0.01, "deg": 5.0}
"""Violations that weigh the same, by unit: a centimetre is five degrees of a shin."""

REACH_METRES: Final = 10.0
"""Metres by which a segment may be too short for its image while the least violation is looked for."""

MAX_BRANCHES_JUDGED: Final = 256
"""Branches whose collisions are asked about: those with the least other violations."""


@dataclass(frozen=True, kw_only=True)
class Excess:
    """How far one thing is beyond what is allowed.

    Parameters
    ----------
    reason : str
        ``check/where``, as branches are rejected by.
    beyond : float
        By how much, in `unit`.
    unit : str
        m or deg.
    """

    reason: str
    beyond: float
    unit: str

    def __str__(self) -> str:
        """Say it in words: ``rigid-parts/right_hip-left_hip 1.2 cm``."""
        if self.unit == "m":
            return f"{check_words(self.reason)} {self.beyond * 100:.3g} cm"
        return f"{check_words(self.reason)} {self.beyond:.2g} {self.unit}"


@dataclass(frozen=True, kw_only=True)
class LeastViolation:
    """The branch that comes nearest to a posture, and what is wrong with it.

    Parameters
    ----------
    branch : str
        Its near-far code.
    excesses : tuple of Excess
        All that would have to be allowed, the worst first.
    """

    branch: str
    excesses: tuple[Excess, ...]

    def __str__(self) -> str:
        """Say it in a line."""
        return f"{', '.join(map(str, self.excesses))} (branch {self.branch})"


def least_violation(grower: Grower, frame: int, tolerance: Tolerance | None = None) -> LeastViolation | None:
    """Look for the branch of a frame that breaks the checks least.

    All 8192 branches are lifted, with segments as long as their images need, and judged as a whole: the least sum of
    violations wins, each counted in `UNIT_VIOLATIONS` ones.

    Parameters
    ----------
    grower : Grower
        Of the view.
    frame : int
        Its number in the view, counted from 0.
    tolerance : Tolerance, optional
        Beyond which something is a violation; that of measured points if not given.

    Returns
    -------
    LeastViolation or None
        None where the neck is not known, or no branch has all joints that were seen.
    """
    rows = np.flatnonzero(grower.fit.frame == frame)
    rows = rows[np.isfinite(grower.fit.root[rows]).all(axis=1)]
    if not len(rows):
        return None
    allowed = tolerance or MEASURED_TOLERANCE
    _, checks = grower.suites_of(allowed)
    leaves = grower.body.tree.grow(
        grower.fit.cameras(rows),
        grower.fit.root[rows],
        grower.body.image(grower.view.image[grower.fit.frame[rows]]),
        [],
        given=grower.fit.head[rows],
        tolerance=REACH_METRES,
    )
    if not len(leaves.code):
        return None
    points = grower.body.points(leaves)
    short = np.maximum(leaves.length_residual() - allowed.tangent, 0.0)
    plain = judge([check for check in checks if not check.slow], points)
    weight = short / UNIT_VIOLATIONS["m"] + sum(_weight(each) for each in plain)
    best = np.argsort(weight, kind="stable")[:MAX_BRANCHES_JUDGED]
    bodies = judge([check for check in checks if check.slow], points[best])
    chosen = int(np.argmin(weight[best] + sum(_weight(each) for each in bodies)))
    row = int(best[chosen])
    excesses = [
        *_short(leaves, row, allowed),
        *(one for each in plain for one in _excesses(each, row)),
        *(one for each in bodies for one in _excesses(each, chosen)),
    ]
    excesses.sort(key=lambda one: -one.beyond / UNIT_VIOLATIONS.get(one.unit, 1.0))
    return LeastViolation(branch=leaves.branches()[row], excesses=tuple(excesses))


def _beyond(judgement: Judgement) -> Array:
    """Return by how much each place is outside where it is violated (N, K), else 0."""
    return np.where(judgement.violated, np.maximum(-judgement.margin, 0.0), 0.0)


def _weight(judgement: Judgement) -> Array:
    small = np.array([UNIT_VIOLATIONS.get(unit, 1.0) for unit in judgement.unit])
    return np.asarray((_beyond(judgement) / small).sum(axis=1))


def _excesses(judgement: Judgement, row: int) -> list[Excess]:
    beyond = _beyond(judgement)[row]
    violated: NDArray[np.intp] = np.flatnonzero(judgement.violated[row])
    return [
        Excess(
            reason=f"{judgement.check}/{judgement.where[k]}", beyond=float(beyond[k]), unit=judgement.unit[k]
        )
        for k in violated.tolist()
    ]


def _short(leaves: Leaves, row: int, allowed: Tolerance) -> list[Excess]:
    """Name the segment of a branch that is most too short for its image, where that is too much."""
    joints = range(1, leaves.level + 1)
    code, frame = leaves.code[row], leaves.frame[row]
    excess = np.array(
        [
            leaves.candidates.excess[joint][frame, select(leaves.level, path_of(joint, leaves.parents))[code]]
            for joint in joints
        ]
    )
    if not np.nanmax(excess) > allowed.tangent:
        return []
    joint = joints[int(np.nanargmax(excess))]
    segment = f"{leaves.joints[leaves.parents[joint]]}-{leaves.joints[joint]}"
    return [
        Excess(reason=f"no_solution/{segment}", beyond=float(np.nanmax(excess) - allowed.tangent), unit="m")
    ]
