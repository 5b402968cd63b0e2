"""The method: minimise chi2 over the trunk's six joints, then over each limb on each trunk, then over whole bodies."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, Ints
from posekit.solver import reference
from posekit.solver.engine import descend
from posekit.solver.limits import ENDS, MIDDLES
from posekit.solver.modes import MERGE_DISTANCE_METRES, Modes, distinct
from posekit.solver.problem import ROBUST_DEVIATIONS, Problem
from posekit.solver.reference import Pull
from posekit.solver.starts import limb_starts, trunk_starts

#: Probability that noise alone makes chi2 too large to pass.
REJECTION_PROBABILITY: Final = 1e-3

#: Number of steps after which trunks, or whole bodies, that are close to each other are merged.
FIRST_STEPS: Final = 4

#: Two trunks are the same if no joint, relative to the neck, differs by more than this.
SAME_TRUNK_METRES: Final = 0.03

#: Two limbs on one trunk are the same if neither joint differs by more than this, for no, one and two hidden joints.
#:
#: Every position of a hidden joint within its limits fits, so only representatives are kept.
SAME_LIMB_METRES: Final = np.array([0.02, 0.25, 0.45])

#: Largest chi2 of a limb on a fixed trunk: the trunk may still move to fit the limb.
LOOSE_LIMB: Final = 300.0

#: Largest sum of the chi2 of trunk and limbs that is combined into a whole body.
LOOSE_BODY: Final = 600.0

#: A body is abandoned if its chi2 exceeds this multiple of the largest passing chi2, and the predicted decrease in its
#: next step is less than half of its chi2.
HOPELESS: Final = 2.0

#: The same multiple for a trunk without limbs.
HOPELESS_TRUNK: Final = 10.0

#: Largest number of steps with the caller's own residuals.
PULL_STEPS: Final = 15

#: All parts: the trunk and the four limbs.
WHOLE: Final = 31

#: Largest number of whole bodies tried in a frame, by lowest chi2; only frames with several hidden joints have more.
MOST_BODIES: Final = 1500

#: Smallest number of degrees of freedom of chi2: limits and lengths also contribute to it.
LEAST_FREEDOM: Final = 4


def solve(
    problem: Problem, *, max_chi2: float | None = None, most: int | None = None, pull: Pull | None = None
) -> Modes:
    """Find every mode of the posterior of each frame.

    Parameters
    ----------
    problem : Problem
        F frames, which are solved independently.
    max_chi2 : float, optional
        Largest chi2 of a mode. The default is the value that noise alone exceeds with probability
        `REJECTION_PROBABILITY`.
    most : int, optional
        Largest number of modes per frame; modes with the lowest chi2 are kept. All modes are kept if `most` is not
        given.
    pull : callable, optional
        Function that maps postures (N, 14, 3) to further residuals (N, K), in standard deviations. An example is the
        distance beyond a check's bounds. Modes are refined with these residuals.

    Returns
    -------
    Modes
    """
    if max_chi2 is None:
        from scipy.special import gammainccinv

        gross = ROBUST_DEVIATIONS**2 * (problem.records["robust"] > 0)  # one gross error of a detector
        freedom = np.maximum(problem.freedom, LEAST_FREEDOM)
        passing = gross + 2 * gammainccinv(freedom / 2, REJECTION_PROBABILITY)
    else:
        passing = np.full(len(problem), float(max_chi2))
    frame, trunk = trunk_starts(problem)
    x = np.zeros((len(frame), 43))
    x[:, :18] = trunk.reshape(-1, 18)
    trunks = _minima(problem, passing, frame, x, 1, HOPELESS_TRUNK)
    frame, x, chi2 = _minima(problem, passing, *_bodies(problem, *trunks, passing), WHOLE, HOPELESS)
    if pull is not None:
        hopeless, damping = HOPELESS * passing[frame], np.full(len(frame), reference.FIRST_DAMPING)
        x, chi2, _ = reference.descend(problem, frame, x, WHOLE, PULL_STEPS, hopeless, damping, pull)
        order = _best(problem, passing, frame, x, chi2, WHOLE)
        frame, x, chi2 = frame[order], x[order], chi2[order]
    modes = Modes(problem=problem, frame=frame, x=x, chi2=chi2)
    return modes if most is None else modes.take(_rank(frame) < most)


def _rank(group: Ints) -> Ints:
    """Return the rank of each entry within its group; `group` is sorted in ascending order."""
    return np.arange(len(group)) - np.searchsorted(group, group)


def _best(problem: Problem, most: Array, frame: Ints, x: Array, chi2: Array, parts: int) -> Ints:
    """Return the rows of distinct bodies with chi2 up to the limit `most` (F,) of their frame, best first."""
    order = np.lexsort((chi2, frame))
    order = order[np.isfinite(chi2[order]) & (chi2[order] <= most[frame[order]])]
    within, sure = (SAME_TRUNK_METRES, False) if parts == 1 else (MERGE_DISTANCE_METRES, True)
    return order[distinct(problem, frame[order], frame[order], x[order], parts, within, sure=sure)]


def _minima(
    problem: Problem, passing: Array, frame: Ints, x: Array, parts: int, hopeless: float
) -> tuple[Ints, Array, Array]:
    """Minimise chi2 from starts `x`; return frames (M,), unknowns (M, 43) and chi2 (M,) of the minima that pass.

    A minimum passes if its chi2 is at most `passing` (F,) of its frame. Starts that are close to each other after
    `FIRST_STEPS` steps are merged.
    """
    damping = np.full(len(frame), reference.FIRST_DAMPING)
    for steps, level in ((FIRST_STEPS, np.inf), (40, 1.0)):
        given_up = hopeless * passing[frame]
        x, chi2, damping = descend(problem, frame, x, parts, most=steps, hopeless=given_up, damping=damping)
        order = _best(problem, level * passing, frame, x, chi2, parts)
        frame, x, chi2, damping = frame[order], x[order], chi2[order], damping[order]
    return frame, x, chi2


def _bodies(problem: Problem, frame: Ints, x: Array, chi2: Array, passing: Array) -> tuple[Ints, Array]:
    """Combine trunks with limbs into whole bodies; return frames (B,) and unknowns (B, 43)."""
    open_ = problem.sized | ~problem.rooted
    if open_[frame].any():
        # At the depth of the trunk's own minimum a limb may be too short for its image; its near and far positions then
        # coincide. Therefore each trunk is first minimised together with its best limbs.
        row, body = _combined(problem, frame, x, chi2, most=1)
        row, body = row[open_[frame[row]]], body[open_[frame[row]]]
        body, value, _ = descend(problem, frame[row], body, WHOLE, hopeless=HOPELESS * passing[frame[row]])
        good = value <= 2 * HOPELESS * passing[frame[row]]
        x[row[good]] = body[good]
    row, body = _combined(problem, frame, x, chi2, most=MOST_BODIES)
    return frame[row], body


def _combined(problem: Problem, frame: Ints, x: Array, chi2: Array, most: int) -> tuple[Ints, Array]:
    """Combine each trunk with positions of its four limbs; return rows of trunks (B,) and unknowns (B, 43).

    The sum of the chi2 of trunk and limbs must be below `LOOSE_BODY`. Each limb on a trunk has at most `most`
    positions, those with the lowest chi2.
    """
    trunk = x[:, :18].reshape(-1, 6, 3)
    row, body, total = np.arange(len(frame)), x, chi2
    for limb in range(4):
        column = [3 * joint + k for joint in (MIDDLES[limb], ENDS[limb]) for k in range(3)]
        on, start = limb_starts(problem, frame, trunk, limb)
        alone = x[on].copy()
        alone[:, column] = start.reshape(-1, 6)
        alone, value, _ = descend(problem, frame[on], alone, 2 << limb)
        order = np.lexsort((value, on))
        order = order[value[order] < LOOSE_LIMB]
        on, alone, value = on[order], alone[order], value[order]
        hidden = (~problem.seen_joints[frame[on]][:, [MIDDLES[limb], ENDS[limb]]]).sum(axis=1)
        keep = distinct(problem, on, frame[on], alone, 2 << limb, SAME_LIMB_METRES[hidden], sure=True)
        keep &= _rank(on) < most
        on, ends, value = on[keep], alone[keep][:, column], value[keep]
        # Combine every body so far with every position of this limb on its trunk.
        first = np.searchsorted(on, np.arange(len(frame) + 1))
        count = np.diff(first)[row]
        which = np.repeat(np.arange(len(row)), count)
        choice = first[row][which] + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        total = total[which] + value[choice]
        good = np.lexsort((total, frame[row[which]]))
        good = good[total[good] < LOOSE_BODY]
        good = np.sort(good[_rank(frame[row[which[good]]]) < MOST_BODIES])
        which, choice, total = which[good], choice[good], total[good]
        row, body = row[which], body[which].copy()
        body[:, column] = ends[choice]
    return row, body
