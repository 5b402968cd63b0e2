"""The method: trunks first, limbs on each trunk, whole bodies of the combinations that can pass, modes."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array, Ints
from posekit.solver import reference
from posekit.solver.engine import descend
from posekit.solver.limits import ENDS, MIDDLES
from posekit.solver.modes import MERGE_DISTANCE_METRES, Modes, distinct, merged
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

#: Frames solved together: enough to spread the overhead of NumPy, few enough to keep memory small.
AT_ONCE: Final = 32

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

        passing = 2 * gammainccinv(np.maximum(problem.freedom, LEAST_FREEDOM) / 2, REJECTION_PROBABILITY)
        passing = passing + ROBUST_DEVIATIONS**2 * (
            problem.records["robust"] > 0
        )  # one gross error of a detector
    else:
        passing = np.full(len(problem), float(max_chi2))
    found = [
        _solved(problem, np.arange(at, min(at + AT_ONCE, len(problem))), passing, pull)
        for at in range(0, max(len(problem), 1), AT_ONCE)
    ]
    frame, x, chi2 = (np.concatenate([part[k] for part in found]) for k in range(3))
    modes = Modes(problem=problem, frame=frame, x=x, chi2=chi2)
    if most is not None:
        first = np.searchsorted(modes.frame, modes.frame)
        modes = modes.take(np.arange(len(modes)) - first < most)
    return modes


def _solved(whole: Problem, frames: Ints, passing: Array, pull: Pull | None) -> tuple[Ints, Array, Array]:
    """Return the modes of some frames: frames of the whole problem (M,), unknowns (M, 43), and chi2."""
    problem, passing = whole.take(frames), passing[frames]
    frame, x, chi2 = _bodies(problem, *_trunks(problem, passing), passing)
    if pull is not None:
        near = chi2 <= passing[frame]
        frame, hopeless = frame[near], HOPELESS * passing[frame[near]]
        damping = np.full(len(frame), reference.FIRST_DAMPING)
        x, chi2, _ = reference.descend(problem, frame, x[near], WHOLE, PULL_STEPS, hopeless, damping, pull)
    order = np.lexsort((chi2, frame))
    order = order[chi2[order] <= passing[frame[order]]]
    modes = merged(Modes(problem=problem, frame=frame[order], x=x[order], chi2=chi2[order]))
    return frames[modes.frame], modes.x, modes.chi2


def _trunks(problem: Problem, passing: Array) -> tuple[Ints, Array, Array]:
    """Return the trunks' modes: frames (T,), unknowns (T, 43), and chi2."""
    frame, trunk = trunk_starts(problem)
    x = np.zeros((len(frame), 43))
    x[:, :18] = trunk.reshape(-1, 18)
    damping = np.full(len(frame), reference.FIRST_DAMPING)
    for steps, level in ((FIRST_STEPS, np.inf), (40, 1.0)):
        hopeless = HOPELESS_TRUNK * passing[frame]
        x, chi2, damping = descend(problem, frame, x, 1, most=steps, hopeless=hopeless, damping=damping)
        order = np.lexsort((chi2, frame))
        order = order[np.isfinite(chi2[order]) & (chi2[order] <= level * passing[frame[order]])]
        frame, x, chi2, damping = frame[order], x[order], chi2[order], damping[order]
        keep = distinct(problem, frame, frame, x, 1, SAME_TRUNK_METRES)
        frame, x, chi2, damping = frame[keep], x[keep], chi2[keep], damping[keep]
    return frame, x, chi2


def _bodies(
    problem: Problem, frame: Ints, x: Array, chi2: Array, passing: Array
) -> tuple[Ints, Array, Array]:
    """Return whole bodies at their minima: frames (B,), unknowns (B, 43), and chi2."""
    open_ = problem.sized | ~problem.rooted
    if open_[frame].any():
        # At the depth of a trunk alone a limb may be too short for its image, so that near and far fall together:
        # each trunk is first moved to where its best limbs want it.
        row, body, _ = _combined(problem, frame, x, chi2, most=1)
        row, body = row[open_[frame[row]]], body[open_[frame[row]]]
        body, value, _ = descend(problem, frame[row], body, WHOLE, hopeless=HOPELESS * passing[frame[row]])
        good = value <= 2 * HOPELESS * passing[frame[row]]
        x[row[good]] = body[good]
    row, body, _ = _combined(problem, frame, x, chi2, most=None)
    frame = frame[row]
    hopeless = HOPELESS * passing[frame]
    x, chi2, damping = descend(problem, frame, body, WHOLE, most=FIRST_STEPS, hopeless=hopeless)
    # Bodies that approach each other go on as one.
    order = np.lexsort((chi2, frame))
    own = frame[order]
    keep = order[distinct(problem, own, own, x[order], WHOLE, MERGE_DISTANCE_METRES, sure=True)]
    frame, hopeless = frame[keep], hopeless[keep]
    x, chi2, _ = descend(problem, frame, x[keep], WHOLE, hopeless=hopeless, damping=damping[keep])
    return frame, x, chi2


def _combined(
    problem: Problem, frame: Ints, x: Array, chi2: Array, most: int | None
) -> tuple[Ints, Array, Array]:
    """Put limbs on trunks in all combinations that can pass: trunks (B,), unknowns (B, 43), and predicted chi2.

    With `most`, keep only the `most` best positions of each limb on a trunk.
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
        if most is not None:
            keep &= np.arange(len(on)) - np.searchsorted(on, on) < most
        on, ends, value = on[keep], alone[keep][:, column], value[keep]
        # Every body so far with every position of this limb on its trunk.
        first = np.searchsorted(on, np.arange(len(frame) + 1))
        count = np.diff(first)[row]
        which = np.repeat(np.arange(len(row)), count)
        choice = first[row][which] + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        total = total[which] + value[choice]
        good = np.lexsort((total, frame[row[which]]))
        good = good[total[good] < LOOSE_BODY]
        own = frame[row[which[good]]]
        good = np.sort(good[np.arange(len(own)) - np.searchsorted(own, own) < MOST_BODIES])
        which, choice, total = which[good], choice[good], total[good]
        row, body = row[which], body[which].copy()
        body[:, column] = ends[choice]
    return row, body, total
