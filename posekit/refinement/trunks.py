r"""Torsos and hips that the noise allows, before any limb is lifted: where the tree is grown from under noise.

Lifting a trunk joint by joint, each from the last, throws the noise of every point onto the depth of the next: a
shoulder beside the neck, at right angles to its ray, is off by :math:`\sqrt{2 l \delta}`, 6 cm for 2 px at 4 m. The
trunk as a whole has six points for nine unknowns, and one or two places only where it fits them. These are found
first, by least squares, and their own image points put in place of the noisy ones: then the tree's rigid parts come
out right to rounding, and limbs start from where they are most likely to start.

Every near and far choice is followed to its minimum: where lengths vary, shoulders that are turned by themselves may
fit as well as the whole torso in a mirror. Far away, a flat body and its image in a mirror at right angles to the ray
look alike: with the mirror S of the ray and M of the body's own plane, S R M is the rotation of the second minimum if R
is that of the first. Torso and hips are flat, or nearly, so the best minimum gives three more starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.geometry import Array, unit
from posekit.geometry.batch_last import matrix_product
from posekit.refinement.descent import descend
from posekit.refinement.equations import chi2_of
from posekit.refinement.freedom import degrees_of_freedom
from posekit.refinement.merging import groups_of
from posekit.refinement.observed_frames import ObservedFrames
from posekit.refinement.problem import BLOCK_POSTURES, RefinementProblem
from posekit.refinement.refined import REJECTION_PROBABILITY
from posekit.refinement.start import state_of
from posekit.refinement.state import PostureState, trunk_joints, turned_by_spine
from posekit.refinement.survival import chi2_survival
from posekit.skeleton import JOINTS, N_TRUNK_JOINTS, PARENTS, TREE_SEGMENTS, segment_name

N_CHOICES = 32
"""Near and far choices of a trunk: two for each joint but the neck."""

ROOT_STEP_METRES = 0.15
"""Metres by which a root may be off for a search to find its trunk; where it may be more, several depths are tried."""

SEARCHED_DEVIATIONS = 2.0
"""Deviations of a root's depth within which trunks are lifted first."""

MAX_DEPTH_STEPS = 3
"""Depths tried on either side of where the root is most likely."""

EARLY_STEPS, MAX_STEPS = 4, 40
"""Steps of every choice, before those that came near each other go on as one; and of each search then."""

SAME_TRUNK_METRES = 0.03
"""Metres: trunks none of whose joints are farther apart are one: what is found is a start, refined with its limbs."""

LIFT_ROUNDING_METRES = 1e-5
"""Metres by which a trunk may be lifted otherwise than it was found: rounding, tangent to a ray."""

PROMISING_CHI2 = 150.0
"""A chi2 beyond which a mirrored start is followed only while its steps promise to halve it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trunks:
    """H trunks of F frames, by frame, the likeliest first.

    Parameters
    ----------
    frame : int array (H,)
        The frame of each trunk.
    joints : array (H, 6, 3)
        Neck, shoulders, pelvis and hips, camera frame, metres.
    image : array (H, 14, 2)
        The frame's key points, those of the trunk that were seen replaced by the projections of `joints`.
    chi2, dof, p : array (H,)
        See `posekit.refinement.refined.Refined`.
    """

    frame: NDArray[np.intp]
    joints: Array
    image: Array
    chi2: Array
    dof: NDArray[np.intp]
    p: Array

    def __len__(self) -> int:
        """Count the trunks."""
        return len(self.frame)

    @property
    def root(self) -> Array:
        """The necks (H, 3)."""
        return self.joints[:, 0]

    def tree_lengths(self, figure: Figure) -> Array:
        """Return what a tree of all H trunks lifts with (14, H, 1): the trunks' own lengths, the figure's limbs.

        They are the figure's all, unless the lengths of torso and hips are varied.
        """
        out = np.zeros((len(JOINTS), len(self), 1))
        for joint, (parent, _) in enumerate(TREE_SEGMENTS, start=1):
            if joint < N_TRUNK_JOINTS:
                out[joint, :, 0] = np.linalg.norm(self.joints[:, joint] - self.joints[:, parent], axis=1)
            else:
                out[joint] = figure.lengths[segment_name((parent, joint))]
        return out

    def carries(self, hypothesis: NDArray[np.integer], postures: Array) -> NDArray[np.bool_]:
        """Return which leaves (N, 14, 3) of a tree grown on these trunks have the trunk itself, no twin of it.

        Parameters
        ----------
        hypothesis : int array (N,)
            The trunk of each leaf.
        postures : array (N, 14, 3)
            Leaves of a tree that was grown from trunks, camera frame, metres.
        """
        apart = postures[:, :N_TRUNK_JOINTS] - self.joints[hypothesis]
        with np.errstate(invalid="ignore"):
            return np.asarray(~(np.abs(apart) > LIFT_ROUNDING_METRES).any(axis=(1, 2)))


def find_trunks(
    observed: ObservedFrames, *, level: float = REJECTION_PROBABILITY, within: float = SAME_TRUNK_METRES
) -> Trunks:
    """Find the trunks that the noise can explain.

    Parameters
    ----------
    observed : ObservedFrames
        Its root must say where the neck is, however roughly.
    level : float
        Probability with which noise alone gives a trunk that is left out.
    within : float
        Metres; see `SAME_TRUNK_METRES`.

    Returns
    -------
    Trunks
        None in frames whose root is not known, or behind a pinhole camera.

    Raises
    ------
    InputError
        Where there is no root.
    """
    if observed.root is None:
        raise InputError("find_trunks: no root was given; expected a RootPrior that says where necks are")
    in_front = isinstance(observed.camera, ScaledOrthographicCamera) | (observed.root.mean[:, 2] > 0)
    known = np.flatnonzero(np.isfinite(observed.root.mean).all(axis=1) & in_front)
    one = observed.problem(known, observed.root.mean[known]).trunk_alone()
    factors, many = _depth_factors(observed, known), len(known) * N_CHOICES
    starts, chi2 = [], []
    # Depths together, as long as they are few postures.
    each = max(BLOCK_POSTURES // max(many, 1), 1)
    for part in (factors[at : at + each] for at in range(0, len(factors), each)):
        begin, value = _started(observed, one, part)
        starts.append(begin)
        chi2.append(value.reshape(len(part), many))
    every = PostureState(*(np.concatenate(arrays, axis=-1) for arrays in zip(*starts, strict=True)))
    tried = np.concatenate(chi2)
    depth = np.argmin(tried, axis=0)  # of each choice the one that fits best
    which = np.repeat(np.arange(len(known)), N_CHOICES)
    early = descend(one.take(which), every.take(depth * many + np.arange(many)), steps=EARLY_STEPS)
    apart = _distinct(which, early.chi2, trunk_joints(early.state), within)
    which, begin = which[apart], early.state.take(apart)
    first = descend(one.take(which), begin, steps=MAX_STEPS)
    best = np.lexsort((first.chi2, which))[np.searchsorted(which, np.arange(len(known)))]
    turned = _reflections(first.state.take(best), one.optics.perspective)
    if one.anatomy.middle_pelvis:
        turned = turned._replace(hips=turned_by_spine(turned.torso, turned.hips))
    again = np.tile(np.arange(len(known)), 3)
    second = descend(one.take(again), turned, steps=MAX_STEPS, hopeless=PROMISING_CHI2)
    state = PostureState(
        *(np.concatenate(pair, axis=-1) for pair in zip(first.state, second.state, strict=True))
    )
    row = np.concatenate([which, again])
    value, active = (
        np.concatenate([a, b]) for a, b in ((first.chi2, second.chi2), (first.active, second.active))
    )
    dof = degrees_of_freedom(one)[row] + active
    finite = np.isfinite(value)
    p = np.where(finite, chi2_survival(np.where(finite, value, 0.0), dof), 0.0)
    joints = trunk_joints(state)
    keep = np.flatnonzero(p >= level)
    keep = keep[_distinct(row[keep], value[keep], joints[keep], within)]
    return _trunks(observed, one, known[row[keep]], joints[keep], value[keep], dof[keep], p[keep], row[keep])


def _distinct(frame: NDArray[np.intp], chi2: Array, joints: Array, within: float) -> NDArray[np.intp]:
    """Return the rows of trunks of which no likelier one of their frame is near, by frame, the likeliest first."""
    order = np.lexsort((chi2, frame))
    leader = groups_of(frame[order], joints[order], within)
    return np.asarray(order[leader == np.arange(len(order))])


def _started(observed: ObservedFrames, one: RefinementProblem, factors: Array) -> tuple[PostureState, Array]:
    """Lift trunks of frames (F,) by every choice at some depths (K,): postures and their chi2 (K F N_CHOICES)."""
    count = one.root.shape[1]
    each = np.tile(np.arange(count), len(factors))
    part = one.take(each)
    begin = state_of(
        one.anatomy, _lifts(observed, part, part.root * np.repeat(factors, count)).reshape(-1, 14, 3)
    )
    return begin, chi2_of(one.take(np.repeat(each, N_CHOICES)), begin)


def _trunks(
    observed: ObservedFrames,
    one: RefinementProblem,
    frame: NDArray[np.intp],
    joints: Array,
    chi2: Array,
    dof: NDArray[np.intp],
    p: Array,
    row: NDArray[np.intp],
) -> Trunks:
    image = observed.points()[frame].copy()
    projected = one.optics.take(row).image(joints.transpose(1, 2, 0)).transpose(2, 0, 1)
    image[:, :6] = np.where(np.isnan(image[:, :6]), np.nan, projected)
    return Trunks(frame=frame, joints=joints, image=image, chi2=chi2, dof=dof, p=p)


def _depth_factors(observed: ObservedFrames, frames: NDArray[np.intp]) -> Array:
    """Return by what roots are moved along their rays before trunks are lifted: no further apart than a search goes."""
    roots = observed.roots()
    if roots is None or not len(frames) or isinstance(observed.camera, ScaledOrthographicCamera):
        return np.ones(1)
    mean = roots.mean[frames]
    far = np.linalg.norm(mean, axis=1)
    off = np.sqrt(np.einsum("ni,nij,nj->n", mean, roots.covariance[frames], mean)) / far
    reach = SEARCHED_DEVIATIONS * off
    steps = math.ceil(float(reach.max()) / ROOT_STEP_METRES) if reach.max() > ROOT_STEP_METRES else 0
    spread = float(np.max(reach / far)) if steps else 0.0
    return np.asarray(np.exp(np.linspace(-spread, spread, 2 * min(steps, MAX_DEPTH_STEPS) + 1)))


def _lifts(observed: ObservedFrames, problem: RefinementProblem, root: Array) -> Array:
    """Lift trunks from roots (3, N) by every near and far choice, (N, 32, 14, 3): out of reach means nearest."""
    image, optics = problem.image[:6], problem.optics
    seen = problem.weight[:6] > 0
    placed: list[Array] = [root[None]]  # by joint (choices, 3, N), as the bits of its path
    for joint, (parent, _) in enumerate(TREE_SEGMENTS[:5], start=1):
        length = observed.figure.lengths[segment_name((parent, joint))]
        start = placed[parent]
        pixels = np.broadcast_to(image[joint], (len(start), *image.shape[1:]))
        ray, foot = optics.rays(pixels, start)
        apart = foot - start
        half = (
            np.sqrt(np.maximum(length * length - np.einsum("cin,cin->cn", apart, apart), 0.0))[:, None] * ray
        )
        ends = np.stack([foot - half, foot + half], axis=1).reshape(2 * len(start), 3, -1)
        placed.append(np.where(seen[joint], ends, np.nan))
    out = np.full((root.shape[1], N_CHOICES, 14, 3), np.nan)
    code = np.arange(N_CHOICES)
    out[:, :, 0] = root.T[:, None]
    for joint in range(1, 6):
        bit = code >> (5 - joint) & 1
        choice = bit if PARENTS[joint] == 0 else 2 * (code >> (5 - PARENTS[joint]) & 1) + bit
        out[:, :, joint] = placed[joint][choice].transpose(2, 0, 1)
    return out


def _reflections(state: PostureState, perspective: bool) -> PostureState:
    """Return torsos, hips, and both, as a mirror at right angles to the ray shows them: (3 N)."""
    ray = (
        unit(state.root, axis=-2)
        if perspective
        else np.broadcast_to(np.array([[0.0], [0.0], [1.0]]), state.root.shape)
    )
    mirror = np.eye(3)[:, :, None] - 2 * ray[:, None] * ray[None]
    flipped = np.array([-1.0, 1.0, 1.0])[None, :, None]
    torso, hips = (matrix_product(mirror, rotation) * flipped for rotation in (state.torso, state.hips))
    parts = (state._replace(torso=torso), state._replace(hips=hips), state._replace(torso=torso, hips=hips))
    return PostureState(*(np.concatenate(arrays, axis=-1) for arrays in zip(*parts, strict=True)))
