"""What is known of a person before the pictures: proportions, their spread, stature, lengths that were measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from posekit.body.anthropometry.body import (
    BODY_DIMENSIONS,
    HIP_WIDTH,
    LIMB_PARTS,
    SHOULDER_WIDTH,
    TRUNK_LENGTH,
    limb,
)
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.safe_io import nearest, refusal, shown
from posekit.skeleton import SIDES, other_side

SIZE_SPREAD: Final = 0.08
"""Relative deviation of the whole body where neither stature nor a length is given (adults of both sexes)."""
GIVEN_LENGTH_DEVIATION: Final = 0.002
"""Relative deviation of a length that is given."""
STATURE_DEVIATION: Final = 0.02
"""Relative deviation of the way from ankles to shoulders at a known stature: head, neck and feet are the rest."""
ASYMMETRY_SHARE: Final = 0.4
"""How much left and right differ, as a share of the spread among people, where they are told apart: some 3 % of l."""


def prior_covariance(deviation: Array, both_sides: bool) -> Array:
    """Return the prior covariance (11, 11) of the dimensions' logarithms; sides that are equal move together."""
    correlation = np.eye(len(BODY_DIMENSIONS))
    alike = 1 - 1e-4 if both_sides else 1 - ASYMMETRY_SHARE**2
    for part in LIMB_PARTS:
        right, left = (BODY_DIMENSIONS.index(limb(side, part)) for side in SIDES)
        correlation[right, left] = correlation[left, right] = alike
    return np.asarray(correlation * np.outer(deviation, deviation))


def sides_averaged(dimensions: Array) -> Array:
    """Make left and right the same to the last bit."""
    other = [BODY_DIMENSIONS.index(_other_side(name)) for name in BODY_DIMENSIONS]
    return np.asarray((dimensions + dimensions[other]) / 2)


def _other_side(name: str) -> str:
    """Name the limb of the other side; widths and trunk are their own."""
    if name in (SHOULDER_WIDTH, HIP_WIDTH, TRUNK_LENGTH):
        return name
    return "-".join(other_side(end) for end in name.split("-"))


def _with_stack(middle: Array, covariance: Array) -> Array:
    """Condition the prior on what adds up to the stature: shank, thigh and trunk, from ankles to shoulders."""
    share = np.zeros(len(BODY_DIMENSIONS))
    for part in ("thigh", "shank"):
        for side in SIDES:
            share[BODY_DIMENSIONS.index(limb(side, part))] = 0.5
    share[BODY_DIMENSIONS.index(TRUNK_LENGTH)] = 1.0
    share *= np.exp(middle)
    share /= share.sum()
    gain = covariance @ share / (share @ covariance @ share + STATURE_DEVIATION**2)
    return np.asarray(covariance - np.outer(gain, covariance @ share))


def conditioned(
    middle: Array, covariance: Array, known: Mapping[str, float], stature: float | None, has_scale: bool
) -> tuple[Array, Array]:
    """Condition the prior on the stature and on lengths that are given; widen it where nothing says the size."""
    covariance = _with_stack(middle, covariance)
    if stature is None:
        if not known and not has_scale:
            raise InputError(
                "nothing fixes the size: pictures tell ratios alone; give the stature, a known length, or scales"
            )
        covariance = covariance + SIZE_SPREAD**2
    for name, length in known.items():
        if name not in BODY_DIMENSIONS or name == TRUNK_LENGTH:
            raise refusal("", "known", shown(name), "a limb or a width", nearest(name, BODY_DIMENSIONS[:-1]))
        k = BODY_DIMENSIONS.index(name)
        gain = covariance[:, k] / (covariance[k, k] + GIVEN_LENGTH_DEVIATION**2)
        middle = middle + gain * (np.log(positive(f"known {name}", length)) - middle[k])
        covariance = covariance - np.outer(gain, covariance[k])
    return middle, covariance


def positive(name: str, value: float) -> float:
    """Refuse a number that is not positive and finite."""
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"{name} is {value:g}; expected a positive, finite number")
    return float(value)
