r"""What frames say of the shape of one body's trunk, its place and turn in each of them left open.

Wherever a trunk is turned, a wider one turned more explains the image as well: the likeliest place and turn say nothing
of a length but that it is long enough, and of many frames those that noise makes too long. So places and turns are
drawn: from the normal distribution at each minimum of chi2, weighted by how much likelier they are than that has them.

Torsos are not rigid. A frame's distances differ from the body's by deviations :math:`\sigma`; with their logarithms y
the slope of the body's log-likelihood is the mean of :math:`(y - \bar y) / \sigma^2` over the draws (Fisher's
identity: Dempster, Laird & Rubin 1977), and its curvature what is left when all that is the frame's own is eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.refinement.descent import descend
from posekit.refinement.equations import chi2_of
from posekit.refinement.figure_numbers import N_SHAPE_NUMBERS, TRUNK_SEGMENTS
from posekit.refinement.observed_frames import ObservedFrames
from posekit.refinement.start import state_of
from posekit.refinement.state import PostureStep, moved, trunk_offsets
from posekit.refinement.trunk_terms import shape_distances, to_unknowns, trunk_terms
from posekit.refinement.trunks import Trunks, find_trunks
from posekit.skeleton import segment_name

TRUNK_NAMES: Final = tuple(segment_name(pair) for pair in TRUNK_SEGMENTS)
"""The nine distances of the trunk."""

RIVAL_CHI2: Final = 10.0
"""Chi2 above a frame's least beyond which another trunk is not considered."""

MAX_STEPS: Final = 8
"""Steps to the minimum from where trunks were found."""

N_DRAWS: Final = 2
"""Pairs of draws, one the other's mirror image, from each minimum."""

LEAST_INFORMATION: Final = 1e-2
"""Added to what is inverted, one over rad^2 or m^2."""

HOPELESS_LOG: Final = 8.0
"""Logarithm by which a trunk that is left out is less likely than the best of its frame."""

LEAST_SLOPE: Final = 0.02
"""Share of the steepest slope of distances along the shape below which they do not tell it: a flat torso, flat hips."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrunkEvidence:
    """N trunks drawn in F frames, and what each says of the nine distances.

    Parameters
    ----------
    found : Trunks
        From which they were drawn.
    frame : int array (N,)
        The frame of each.
    joints : array (6, 3, N)
        Neck, shoulders, pelvis and hips, camera frame, metres.
    torso, hips : array (3, 3, N)
        Rotations from the parts' frames into the camera's.
    log_weight : array (N,)
        How likely each is, and how many others it stands for.
    stretch : array (N, 9)
        By how much the logarithms of its distances are above the body's.
    information : array (N, 9, 9)
        On the logarithms of the body's distances.
    """

    found: Trunks
    frame: NDArray[np.intp]
    joints: Array
    torso: Array
    hips: Array
    log_weight: Array
    stretch: Array
    information: Array

    @staticmethod
    def of(
        observed: ObservedFrames, deviation: Array, rng: np.random.Generator, found: Trunks | None = None
    ) -> TrunkEvidence:
        """Draw from trunks, found for nearly the same body or not yet.

        The `deviation` (9,) are those that `observed` gives to the distances.
        """
        found = find_trunks(observed, level=0.0) if found is None else found
        least = np.full(len(observed.points()), np.inf)
        np.minimum.at(least, found.frame, found.chi2)
        keep = np.flatnonzero(found.chi2 < least[found.frame] + RIVAL_CHI2)
        problem = observed.problem(found.frame[keep], found.root[keep]).trunk_alone()
        postures = np.full((len(keep), 14, 3), np.nan)
        postures[:, :6] = found.joints[keep]
        at = descend(problem, state_of(problem.anatomy, postures), steps=MAX_STEPS).state
        terms = trunk_terms(problem, at)
        A = np.moveaxis(to_unknowns(terms, terms.points, terms.pull)[0], -1, 0)
        A += LEAST_INFORMATION * np.eye(A.shape[1])
        own, ones = problem.anatomy.shape, np.ones(len(TRUNK_NAMES))
        pose, shape = slice(0, -N_SHAPE_NUMBERS), slice(-N_SHAPE_NUMBERS, None)
        slope = np.moveaxis(shape_distances(ones, own, at.shape)[1], -1, 0)
        back = np.asarray(np.linalg.pinv(slope, rcond=LEAST_SLOPE), dtype=np.float64)
        # The shape goes along: its mean given place and turn. With H = L L', L'^-1 z has the covariance H^-1.
        follows = np.linalg.solve(A[:, shape, shape], A[:, shape, pose])
        H = A[:, pose, pose] - A[:, pose, shape] @ follows
        root = np.linalg.cholesky(H)
        half = rng.standard_normal((N_DRAWS, H.shape[1]))
        z = np.concatenate([half, -half])
        steps = np.linalg.solve(root.transpose(0, 2, 1), np.broadcast_to(z.T, (len(A), *z.T.shape)))
        steps = np.concatenate([steps, -follows @ steps], axis=1)
        each = np.repeat(np.arange(len(A)), len(z))
        state = moved(at.take(each), PostureStep(steps.transpose(1, 0, 2).reshape(A.shape[1], -1)), None)
        chi2 = chi2_of(problem.take(each), state)
        room = -np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        return TrunkEvidence(
            found=found,
            frame=found.frame[keep][each],
            joints=state.root + trunk_offsets(state),
            torso=state.torso,
            hips=state.hips,
            log_weight=room[each] + 0.5 * np.tile((z * z).sum(axis=1), len(A)) - 0.5 * chi2,
            stretch=shape_distances(ones, own, state.shape)[0].T,
            information=_information(A, back, deviation)[each],
        )

    def weighted(self, logarithm: Array) -> TrunkEvidence:
        """Return those that are not hopeless when something else says how likely each is (N,)."""
        total = self.log_weight + logarithm
        best = np.full(int(self.frame.max(initial=-1)) + 1, -np.inf)
        np.maximum.at(best, self.frame, np.where(np.isfinite(total), total, -np.inf))
        keep = np.flatnonzero(total > best[self.frame] - HOPELESS_LOG)
        return TrunkEvidence(
            found=self.found,
            frame=self.frame[keep],
            joints=self.joints[..., keep],
            torso=self.torso[..., keep],
            hips=self.hips[..., keep],
            log_weight=total[keep],
            stretch=self.stretch[keep],
            information=self.information[keep],
        )


def _information(A: Array, back: Array, deviation: Array) -> Array:
    """Return what frames whose matrices are A (H, C, C) tell of the body's distances (H, 9, 9)."""
    pose, shape = slice(0, -N_SHAPE_NUMBERS), slice(-N_SHAPE_NUMBERS, None)
    coupling = A[:, pose, shape]
    left = A[:, shape, shape] - coupling.transpose(0, 2, 1) @ np.linalg.solve(A[:, pose, pose], coupling)
    own = np.diag(deviation**-2.0)
    # The frame's distances have M + `own` of information, the body's what is left of it behind the frame's own.
    M = back.transpose(0, 2, 1) @ left @ back - own
    values, vectors = np.linalg.eigh((M + M.transpose(0, 2, 1)) / 2)
    M = (vectors * np.maximum(values, 0.0)[:, None]) @ vectors.transpose(0, 2, 1)
    return np.asarray(np.linalg.solve(np.eye(len(own)) + M * deviation**2, M))
