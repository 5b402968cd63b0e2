"""The method: trunks first, limbs on each trunk, whole bodies of the combinations that can pass, modes."""

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

#: Probability with which noise alone exceeds the largest chi2 that passes.
REJECTION_PROBABILITY: Final = 1e-3

#: Steps after which trunks, and whole bodies, that approach each other are merged.
FIRST_STEPS: Final = 4

#: Trunks none of whose joints, relative to the neck, are farther apart are one.
SAME_TRUNK_METRES: Final = 0.03

#: Limbs on one trunk neither of whose joints is farther apart are one, by the number of hidden joints among the two.
#:
#: Every position of a hidden joint within its limits fits: what is kept are representatives.
SAME_LIMB_METRES: Final = np.array([0.02, 0.25, 0.45])

#: Largest chi2 of a limb on a fixed trunk that the whole body may still meet.
LOOSE_LIMB: Final = 300.0

#: The same for the sum of trunk and limbs.
LOOSE_BODY: Final = 600.0

#: Multiple of the largest chi2 that passes, above which a body is given up once its steps promise less than half.
HOPELESS: Final = 2.0

#: The same for a trunk.
HOPELESS_TRUNK: Final = 10.0

#: Steps with residuals of the caller's own, from modes without.
PULL_STEPS: Final = 15

#: All parts: the trunk and the four limbs.
WHOLE: Final = 31

#: Whole bodies of a frame that are tried, the likeliest ones: more arise only where much is hidden.
MOST_BODIES: Final = 1500

#: Degrees of freedom that chi2 is granted at least: limits and lengths add to it even where nothing is left over.
LEAST_FREEDOM: Final = 4


def solve(
    problem: Problem, *, max_chi2: float | None = None, most: int | None = None, pull: Pull | None = None
) -> Modes:
    """Find every mode of the posterior of each frame.

    Parameters
    ----------
    problem : Problem
        F frames; each is solved alone.
    max_chi2 : float, optional
        Largest chi2 of a mode; if not given, the one that noise exceeds with `REJECTION_PROBABILITY`.
    most : int, optional
        Largest number of modes a frame, the best ones; all if not given.
    pull : callable, optional
        Further residuals (N, K) of postures (N, 14, 3), standard deviations, as of a check's bounds: zero where nothing
        pulls. Modes are moved until they fit these, too.

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
    """Return the place of each entry within its group; groups are ascending."""
    return np.arange(len(group)) - np.searchsorted(group, group)


def _best(problem: Problem, most: Array, frame: Ints, x: Array, chi2: Array, parts: int) -> Ints:
    """Return the rows of distinct bodies with a chi2 of at most `most` (F,) of their frame, the best first."""
    order = np.lexsort((chi2, frame))
    order = order[np.isfinite(chi2[order]) & (chi2[order] <= most[frame[order]])]
    within, sure = (SAME_TRUNK_METRES, False) if parts == 1 else (MERGE_DISTANCE_METRES, True)
    return order[distinct(problem, frame[order], frame[order], x[order], parts, within, sure=sure)]


def _minima(
    problem: Problem, passing: Array, frame: Ints, x: Array, parts: int, hopeless: float
) -> tuple[Ints, Array, Array]:
    """Return the minima that starts reach and that pass: frames (M,), unknowns (M, 43), and chi2, the best first.

    Starts that approach each other after a few steps go on as one.
    """
    damping = np.full(len(frame), reference.FIRST_DAMPING)
    for steps, level in ((FIRST_STEPS, np.inf), (40, 1.0)):
        given_up = hopeless * passing[frame]
        x, chi2, damping = descend(problem, frame, x, parts, most=steps, hopeless=given_up, damping=damping)
        order = _best(problem, level * passing, frame, x, chi2, parts)
        frame, x, chi2, damping = frame[order], x[order], chi2[order], damping[order]
    return frame, x, chi2


def _bodies(problem: Problem, frame: Ints, x: Array, chi2: Array, passing: Array) -> tuple[Ints, Array]:
    """Return whole bodies that limbs make on trunks: frames (B,) and unknowns (B, 43)."""
    open_ = problem.sized | ~problem.rooted
    if open_[frame].any():
        # At the depth of a trunk alone a limb may be too short for its image, so that near and far fall together:
        # each trunk is first moved to where its best limbs want it.
        row, body = _combined(problem, frame, x, chi2, most=1)
        row, body = row[open_[frame[row]]], body[open_[frame[row]]]
        body, value, _ = descend(problem, frame[row], body, WHOLE, hopeless=HOPELESS * passing[frame[row]])
        good = value <= 2 * HOPELESS * passing[frame[row]]
        x[row[good]] = body[good]
    row, body = _combined(problem, frame, x, chi2, most=MOST_BODIES)
    return frame[row], body


def _combined(problem: Problem, frame: Ints, x: Array, chi2: Array, most: int) -> tuple[Ints, Array]:
    """Put limbs on trunks in all combinations that can pass: trunks (B,) and unknowns (B, 43).

    Of each limb on a trunk, keep the `most` best positions.
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
        # Every body so far with every position of this limb on its trunk.
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
