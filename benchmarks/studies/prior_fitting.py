"""A prior on postures from motion capture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.directions import DIRECTION_NAMES, directions, mirrored, rows_of
from posekit.ranking.ground import standing
from posekit.ranking.posture_prior import WEIGHT_NAMES, DirectionBlock, Prior, SmallDistancePrior
from posekit.ranking.student import Student
from posekit.skeleton import JOINTS

BLOCK_DIRECTIONS: Final = (
    DIRECTION_NAMES[2:4] + DIRECTION_NAMES[6:8],
    DIRECTION_NAMES[:2] + DIRECTION_NAMES[4:6] + DIRECTION_NAMES[8:],
)
"""Both arms; hips, both legs and up."""

BLUR_RADIANS: Final = 0.1
"""Added to the deviation of each component, radians: other people, and other ways to place their joints."""

PRIOR_DEGREES_OF_FREEDOM: Final = 4.0
"""Degrees of freedom of the t distributions: postures far from those that were recorded are rare, not impossible."""

DEFAULT_TEMPERATURE: Final = 0.008
"""Metres: see `posekit.ranking.posture_prior.Prior`."""

BALANCE_SCALE_METRES, CONTACT_SCALE_METRES = 0.10, 0.06
"""Metres: see `posekit.ranking.posture_prior.SmallDistancePrior`."""


def fit_prior(
    joints: Array,
    up: Array,
    weight: Array | None = None,
    *,
    blocks: Sequence[Sequence[str]] = BLOCK_DIRECTIONS,
    blur: float = BLUR_RADIANS,
    dof: float = PRIOR_DEGREES_OF_FREEDOM,
    temperature: float = DEFAULT_TEMPERATURE,
    source: str = "",
) -> Prior:
    """Fit a prior to postures; left and right are exchanged to make it symmetric. All terms have the weight one.

    The scale of each block is the covariance of its components with the blur's square added, with the moments taken as
    they are: the tails of t are for postures that are not among these.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Any frame, metres; postures with an unknown joint are left out.
    up : array (3,) or (T, 3)
        The direction against gravity, unit length, in the same frame.
    weight : array (T,), optional
        How much each posture counts; equally if not given.
    blocks : sequence of sequence of str
        The directions that are judged together, by name.
    blur : float
        Added to the deviation of each component, radians.
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
    for names in blocks:
        ordered = tuple(sorted(names, key=DIRECTION_NAMES.index))
        x = flat[rows_of(ordered)]
        mean = x @ twice
        away = x - mean[:, None]
        scale = (away * twice) @ away.T + blur**2 * np.eye(len(x))
        fitted.append(
            DirectionBlock(names=ordered, student=Student(mean=mean, scale=(scale + scale.T) / 2, dof=dof))
        )
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
