"""A prior on postures from motion capture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.directions import DIRECTION_NAMES, directions, mirrored, rows_of
from posekit.ranking.ground import standing
from posekit.ranking.posture_prior import WEIGHT_NAMES, DirectionBlock, Prior, SmallDistancePrior
from posekit.ranking.student import StudentMixture
from posekit.skeleton import JOINTS

LEG_DIRECTIONS: Final = DIRECTION_NAMES[4:6] + DIRECTION_NAMES[8:10]


class BlockShape(NamedTuple):
    """Directions that are judged together, and by what.

    Attributes
    ----------
    names : tuple of str
        Some of `DIRECTION_NAMES`.
    middles : int
        Of how many t distributions: an even number, as many mirrored, or one.
    blur : float
        Added to the deviation of each component, radians: other people, and other ways to place their joints.
    conditional : bool
        Whether only `up` is judged, given the others.
    """

    names: tuple[str, ...]
    middles: int = 128
    blur: float = 0.25
    conditional: bool = False


DIRECTION_BLOCKS: Final = (
    BlockShape(DIRECTION_NAMES[2:4] + DIRECTION_NAMES[6:8]),
    BlockShape(DIRECTION_NAMES[:2] + LEG_DIRECTIONS),
    BlockShape((*LEG_DIRECTIONS, "up"), middles=1, blur=0.2, conditional=True),
)
"""Both arms; hips and both legs; up, given the legs. Held-out actions chose them, and how many distributions."""

PRIOR_DEGREES_OF_FREEDOM: Final = 4.0
"""Degrees of freedom of the t distributions: postures far from those that were recorded are rare, not impossible."""

EM_ITERATIONS: Final = 30
"""Steps of expectation and maximisation, from middles drawn of the postures: later ones move nothing that is seen."""

LEAST_SHARE: Final = 1e-4
"""Of a distribution that no posture is near to."""

DEFAULT_TEMPERATURE: Final = 0.03
"""Metres: see `posekit.ranking.posture_prior.Prior`."""

BALANCE_SCALE_METRES, CONTACT_SCALE_METRES = 0.10, 0.06
"""Metres: see `posekit.ranking.posture_prior.SmallDistancePrior`."""


def fit_prior(
    joints: Array,
    up: Array,
    weight: Array | None = None,
    *,
    blocks: Sequence[BlockShape] = DIRECTION_BLOCKS,
    dof: float = PRIOR_DEGREES_OF_FREEDOM,
    temperature: float = DEFAULT_TEMPERATURE,
    source: str = "",
) -> Prior:
    """Fit a prior to postures; left and right are exchanged to make it symmetric. All terms have the weight one.

    The scale of a block of one distribution is the covariance of its components with the blur's square added, with the
    moments taken as they are: the tails of t are for postures that are not among these. Several are found by
    expectation and maximisation (Peel & McLachlan 2000, Statistics and Computing 10:339), from middles drawn with a
    fixed seed.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Any frame, metres; postures with an unknown joint are left out.
    up : array (3,) or (T, 3)
        The direction against gravity, unit length, in the same frame.
    weight : array (T,), optional
        How much each posture counts; equally if not given.
    blocks : sequence of BlockShape
        The directions that are judged together.
    dof : float
        Degrees of freedom of the t distributions.
    temperature : float
        Metres: see `Prior`.
    source : str
        What the postures are.

    Raises
    ------
    InputError
        Where a shape is wrong or no posture is complete.
    """
    positions = np.asarray(joints, dtype=np.float64)
    if positions.ndim != 3 or positions.shape[1:] != (len(JOINTS), 3):
        raise InputError(f"joints have shape {positions.shape}; expected (T, {len(JOINTS)}, 3)")
    upward = np.broadcast_to(np.asarray(up, dtype=np.float64), (len(positions), 3))
    share = np.ones(len(positions)) if weight is None else np.asarray(weight, dtype=np.float64)
    if share.shape != (len(positions),) or not (np.isfinite(share) & (share >= 0)).all():
        raise InputError(f"weight has shape {share.shape}; expected ({len(positions)},), not negative")
    columns = positions.transpose(1, 2, 0)
    found = directions(columns, upward.T)
    whole = np.isfinite(found).all(axis=(0, 1)) & (share > 0)
    if not whole.any():
        raise InputError("no posture has all joints; expected motion capture of whole bodies")
    # Each posture counts twice, as it is and in the mirror: the prior is then as likely for left as for right.
    flat = np.concatenate([found[..., whole], mirrored(found[..., whole])], axis=2).reshape(
        3 * len(DIRECTION_NAMES), -1
    )
    twice = np.tile(share[whole], 2) / (2 * share[whole].sum())
    fitted = []
    for shape in blocks:
        ordered = tuple(sorted(shape.names, key=DIRECTION_NAMES.index))
        student = _mixture(flat[rows_of(ordered)], twice, shape, dof)
        fitted.append(DirectionBlock(names=ordered, student=student, conditional=shape.conditional))
    off, apart = standing(columns[..., whole], upward[whole].T)
    spreads = [
        SmallDistancePrior(scale, float(np.log1p((distance / scale) ** 2) @ twice[: len(distance)] * 2))
        for scale, distance in ((BALANCE_SCALE_METRES, off), (CONTACT_SCALE_METRES, apart))
    ]
    return Prior(
        name="fitted",
        source=source,
        blocks=tuple(fitted),
        temperature=temperature,
        weights=dict.fromkeys(WEIGHT_NAMES, 1.0),
        balance=spreads[0],
        contact=spreads[1],
    )


def _mixture(x: Array, weight: Array, shape: BlockShape, dof: float) -> StudentMixture:
    """Fit t distributions to points (d, 2 T), the second half of which are the mirrored first."""
    size, count = x.shape[0], x.shape[1] // 2
    blur = shape.blur**2 * np.eye(size)
    mean = x @ weight
    away = x - mean[:, None]
    spread = (away * weight) @ away.T
    share = np.ones(1)
    middles = mean[:, None]
    if shape.middles > 1:
        rng = np.random.default_rng(0)
        pairs = min(shape.middles // 2, int((weight[:count] > 0).sum()))
        drawn = rng.choice(count, pairs, replace=False, p=weight[:count] / weight[:count].sum())
        middles = x[:, np.concatenate([drawn, drawn + count])]
        share, spread = np.full(2 * pairs, 0.5 / pairs), spread / 2
        for _ in range(EM_ITERATIONS):
            whitening = np.linalg.inv(np.linalg.cholesky(spread + blur))
            points, centres = whitening @ x, whitening @ middles
            squared = (points**2).sum(axis=0) + (centres**2).sum(axis=0)[:, None] - 2 * centres.T @ points
            squared = np.maximum(squared, 0.0)
            log_density = np.log(share)[:, None] - (dof + size) / 2 * np.log1p(squared / dof)
            belongs = np.exp(log_density - log_density.max(axis=0))
            belongs *= weight / belongs.sum(axis=0)
            pull = belongs * (dof + size) / (dof + squared)
            share = np.maximum(belongs.sum(axis=1), LEAST_SHARE)
            share /= share.sum()
            middles = (x @ pull.T) / pull.sum(axis=1)
            spread = (x * pull.sum(axis=0)) @ x.T - (middles * pull.sum(axis=1)) @ middles.T
            spread = (spread + spread.T) / 2
    scale = spread + blur
    return StudentMixture(means=middles.T, share=share, scale=(scale + scale.T) / 2, dof=dof)
