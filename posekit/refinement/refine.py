"""From survivors of the tree to the most likely postures that the image, the lengths and the limits allow."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras import Array, Camera
from posekit.errors import InputError
from posekit.figure import Figure
from posekit.figure.angles import Limits
from posekit.refinement.anatomy import LIMBS, TRUNK_SEGMENTS, Anatomy
from posekit.refinement.descent import PRECISION, STEPS, Descent, descend
from posekit.refinement.distinct import distinct
from posekit.refinement.equations import chi2_of
from posekit.refinement.freedom import degrees_of_freedom
from posekit.refinement.optics import optics_of
from posekit.refinement.prior import RootPrior
from posekit.refinement.problem import Problem
from posekit.refinement.refined import Refined
from posekit.refinement.start import relift, sides, state_of
from posekit.refinement.state import State, head_points, place
from posekit.skeleton import HEAD_POINTS, JOINTS, SEGMENT_NAMES, segment_name

LIMIT_DEVIATION = 2.0
"""Degrees: standard deviation with which limits of joints are known, unless told otherwise."""


def refine(
    figure: Figure,
    camera: Camera,
    postures: ArrayLike,
    image: ArrayLike,
    deviation: ArrayLike,
    *,
    frame: ArrayLike | None = None,
    root: RootPrior | None = None,
    head: ArrayLike | None = None,
    head_image: ArrayLike | None = None,
    head_deviation: ArrayLike | None = None,
    length_deviation: Mapping[str, float] | float = 0.0,
    limits: Limits | None = None,
    limit_deviation: float = LIMIT_DEVIATION,
    steps: int = STEPS,
    precision: float = PRECISION,
    hopeless: float = np.inf,
) -> Refined:
    r"""Refine survivors to the most likely postures near them.

    Minimises

    .. math::

       \chi^2 = \sum_j \frac{|\pi(p_j) - y_j|^2}{\sigma_j^2} + |W (p_{root} - \mu)|^2
              + \sum_s \frac{\ln^2(l_s / \bar l_s)}{\rho_s^2} + \sum_i \frac{v_i^2}{\sigma_{limit}^2}

    over the configuration, and the lengths where their uncertainty is given; v is how far a joint is outside its
    limits. First torso and hips alone, then each limb is laid on its rays again to the sides that it had, then all
    together (Levenberg-Marquardt, at most `steps` steps).

    Parameters
    ----------
    figure : Figure
    camera : Camera
        A pinhole or scaled orthographic one; its first axis, where it has one, counts frames.
    postures : array (N, 14, 3) or (N, nq)
        Survivors, camera frame, metres; or configurations. NaN for joints that are not known; the neck must be.
    image : array (F, 14, 2)
        Key points, pixels; NaN where a joint was not seen.
    deviation : float or array broadcastable to (F, 14)
        Their standard deviations in each coordinate, pixels; a joint whose deviation is infinite counts as not seen.
    frame : int array (N,), optional
        The frame of each survivor; without it survivors and frames are the same.
    root : RootPrior, optional
        What is known of the neck besides its key point. A scaled orthographic camera leaves its depth open; it is then
        held where it is, and uncertainties are those relative to it.
    head : array (F, 5, 3) or (N, 5, 3), optional
        Where the head's points are, metres: the start of the search for the head.
    head_image, head_deviation : array (F, 5, 2), float or array (F, 5), optional
        The head's key points.
    length_deviation : float or mapping
        Relative standard deviation of all lengths, or by segment name ``a-b``; lengths are held where it is zero.
    limits : Limits, optional
        The figure's unless told otherwise.
    limit_deviation : float
        Degrees; infinite for no limits.
    steps : int
    precision : float
        Decrease of chi2 that is not worth another step.
    hopeless : float
        A chi2 from which the search is given up where the next step does not promise to halve it.

    Returns
    -------
    Refined
        In the order of the survivors.

    Raises
    ------
    InputError
        Where a shape is wrong, a deviation is not positive, or a name is unknown.
    """
    positions, spread = _postures(figure, postures)
    points = _array("image", image, (None, len(JOINTS), 2))
    frames = _frames(frame, len(positions), len(points))
    anatomy = Anatomy.of(figure, limits)
    if not limit_deviation > 0:
        raise InputError(f"the limits' deviation is {limit_deviation!r} degrees; expected a positive number")
    weight = _weights("deviation", deviation, points)
    shape_weight, limb_weight = _length_weights(length_deviation)
    if head_image is not None:
        head_points_seen = _array("head_image", head_image, (len(points), len(HEAD_POINTS), 2))
        head_weight = _weights("head_deviation", 1.0 if head_deviation is None else head_deviation, head_points_seen)
        if not head_weight.any():
            head_image = None
    optics = optics_of(camera, frames)
    mean, whitening = _root(root, len(points))
    held = np.zeros((3, 3))
    if not optics.perspective:
        held[2, 2] = HELD
    known = np.isfinite(mean).all(axis=1)
    own = np.where(known[frames, None], mean[frames], positions[:, 0])
    W = np.where(known[frames, None, None], whitening[frames], held)
    placeable = np.isfinite(positions[:, 0]).all(axis=1)
    positions = np.where(placeable[:, None, None], positions, FAR)
    problem = Problem(
        anatomy=anatomy,
        optics=optics,
        image=_last(np.nan_to_num(points[frames])),
        weight=_last(weight[frames]),
        root=_last(np.nan_to_num(own)),
        root_weight=_last(W),
        limit_deviation=np.radians(limit_deviation),
        head_image=None if head_image is None else _last(np.nan_to_num(head_points_seen[frames])),
        head_weight=None if head_image is None else _last(head_weight[frames]),
        shape_weight=shape_weight,
        limb_weight=limb_weight,
    )
    skull = None if head is None else _heads(head, len(points), frames)
    factors = factor_postures(frames, positions)
    found = _search(problem, anatomy, positions, skull, factors, steps, precision, hopeless)
    return _refined(figure, problem, frames, found, placeable)


HELD = 1e6
"""One over metres: what holds the depth of a root that the camera does not see."""

FAR = 1e3
"""Metres: stands for the joints of survivors that cannot be placed."""


class _Found(NamedTuple):
    """Where the search began and ended."""

    descent: Descent
    first: Array


def _search(
    problem: Problem,
    anatomy: Anatomy,
    postures: Array,
    skull: Array | None,
    factors: Factors,
    steps: int,
    precision: float,
    hopeless: float,
) -> _Found:
    """Refine trunks, then limbs on them, then survivors."""
    one = factors.trunk
    start = state_of(anatomy, postures[one], None if skull is None else skull[one])
    trunk_problem = problem.take(one).trunk_alone()
    rows = problem.take(one[factors.row_trunk])
    limbs = _limbs_of(anatomy, postures, factors, start)
    first = _first_chi2(trunk_problem, rows, start, limbs, factors)
    trunks = descend(trunk_problem, start, steps=steps, precision=precision)
    far = sides(problem.optics.take(one[factors.row_trunk]), limbs.start, limbs.directions, limbs.lengths)
    held = chains_of(trunks.state.take(factors.row_trunk)._replace(directions=limbs.directions, limbs=limbs.lengths))
    fit = fit_limbs(rows, relift(rows, held, far), steps, precision, hopeless)
    joined = join(problem, rows, trunks, fit, factors, precision=precision, hopeless=hopeless)
    found = Descent(
        joined.state,
        joined.chi2,
        trunks.steps[factors.trunk_of] + 1,
        joined.settled,
        joined.folds,
        joined.active,
    )
    worse = np.flatnonzero(~(joined.chi2 <= first))
    if worse.size:
        again = _assembled_start(start, limbs, factors, worse)
        joined.state.put(worse, again)
        found.chi2[worse] = first[worse]
    open_ = ~joined.settled & (joined.chi2 <= hopeless)
    open_[worse] = True
    rest = np.flatnonzero(open_)
    if rest.size:
        more = descend(problem.take(rest), joined.state.take(rest), steps=steps, precision=precision, hopeless=hopeless)
        joined.state.put(rest, more.state)
        for mine, theirs in zip(found[1:], more[1:], strict=True):
            mine[rest] = theirs
    return _Found(found, first)


def _refined(
    figure: Figure,
    problem: Problem,
    frames: NDArray[np.intp],
    found: Descent,
    first: Array,
    placeable: NDArray[np.bool_],
) -> Refined:
    joints = place(found.state).joints.transpose(2, 0, 1).copy()
    joints[~placeable] = np.nan
    head = np.full((len(frames), len(HEAD_POINTS), 3), np.nan)
    if problem.head_image is not None:
        placed = found.state.root + head_points(found.state, problem.anatomy.head)
        head = placed.transpose(2, 0, 1).copy()
    return Refined(
        figure=figure,
        frame=frames,
        joints=joints,
        head=head,
        chi2=np.where(placeable, found.chi2, np.nan),
        dof=degrees_of_freedom(problem) + found.active + found.folds,
        start_chi2=np.where(placeable, first, np.nan),
        steps=found.steps,
        converged=found.settled & placeable,
        problem=problem,
    )


def _postures(figure: Figure, postures: ArrayLike) -> tuple[Array, None]:
    given = np.asarray(postures, dtype=np.float64)
    if given.ndim == 2 and given.shape[1] == figure.model.nq:
        return figure.forward_kinematics(given)[:, : len(JOINTS)], None
    return _array("postures", given, (None, len(JOINTS), 3)), None


def _array(name: str, given: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    array = np.asarray(given, dtype=np.float64)
    fits = array.ndim == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=False)
    )
    if not fits:
        wanted = ", ".join("N" if size is None else str(size) for size in shape)
        raise InputError(f"{name} has shape {array.shape}; expected ({wanted})")
    if np.isinf(array).any():
        raise InputError(f"{name} has infinite entries; expected numbers, NaN for what is not known")
    return array


def _frames(frame: ArrayLike | None, survivors: int, count: int) -> NDArray[np.intp]:
    if frame is None:
        if survivors != count:
            raise InputError(f"{survivors} survivors and {count} frames of image points; say by `frame` which is whose")
        return np.arange(count)
    frames = np.asarray(frame)
    if frames.shape != (survivors,) or frames.dtype.kind not in "iu":
        raise InputError(f"frame has shape {frames.shape}; expected ({survivors},) whole numbers")
    if survivors and not (0 <= int(frames.min()) and int(frames.max()) < count):
        raise InputError(f"frame runs from {frames.min()} to {frames.max()}; expected 0 to {count - 1}")
    return frames.astype(np.intp)


def _weights(name: str, deviation: ArrayLike, points: Array) -> Array:
    """Return one over the standard deviations (F, P); zero where a point was not seen."""
    given = np.asarray(deviation, dtype=np.float64)
    try:
        given = np.broadcast_to(given, points.shape[:2])
    except ValueError:
        raise InputError(f"{name} has shape {given.shape}; expected a number or {points.shape[:2]}") from None
    seen = np.isfinite(points).all(axis=2)
    if not (given[seen] > 0).all():
        raise InputError(f"{name} must be positive where a point was seen, pixels; give infinity for a point not to be used")
    return np.where(seen, 1.0 / np.where(seen, given, 1.0), 0.0)


def _length_weights(deviation: Mapping[str, float] | float) -> tuple[Array | None, Array | None]:
    """Return one over the relative deviations of the trunk's nine distances and of the limbs' lengths."""
    if isinstance(deviation, Mapping):
        unknown = [name for name in deviation if name not in SEGMENT_NAMES]
        if unknown:
            raise InputError(f"length_deviation: {unknown[0]!r} is not a segment; expected some of {', '.join(SEGMENT_NAMES)}")
        by_name = {name: float(deviation.get(name, 0.0)) for name in SEGMENT_NAMES}
    else:
        by_name = dict.fromkeys(SEGMENT_NAMES, float(deviation))
    for name, value in by_name.items():
        if not 0 <= value < 1:
            raise InputError(f"length_deviation: {name} is {value!r}; expected a fraction of the length, zero or more")
    trunk = np.array([by_name[segment_name(pair)] for pair in TRUNK_SEGMENTS])
    limbs = np.array([[by_name[segment_name(pair)] for pair in (limb[:2], limb[1:])] for limb in LIMBS])
    return (
        1.0 / np.maximum(trunk, SHORTEST) if trunk.any() else None,
        1.0 / np.maximum(limbs, SHORTEST) if limbs.any() else None,
    )


SHORTEST = 1e-5
"""Relative deviation of a length that is known exactly, where others are not."""


def _root(root: RootPrior | None, count: int) -> tuple[Array, Array]:
    if root is None:
        return np.full((count, 3), np.nan), np.zeros((count, 3, 3))
    if len(root.mean) != count:
        raise InputError(f"the root's prior has {len(root.mean)} frames; expected {count}")
    return root.mean, root.whitening()


def _heads(head: ArrayLike, count: int, frames: NDArray[np.intp]) -> Array:
    given = np.asarray(head, dtype=np.float64)
    if given.shape == (count, len(HEAD_POINTS), 3):
        return np.asarray(given[frames])
    return _array("head", given, (len(frames), len(HEAD_POINTS), 3))


def _last(array: Array) -> Array:
    """Move the batch to the last axis."""
    return np.ascontiguousarray(np.moveaxis(array, 0, -1))
