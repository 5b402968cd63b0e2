"""A person's lengths from stature, by the proportions of a named source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from posekit.body.anthropometry.body import (
    BODY_DIMENSIONS,
    HIP_WIDTH,
    LIMB_PARTS,
    SHOULDER_WIDTH,
    TRUNK_LENGTH,
    SegmentLengths,
    check_stature,
    completed,
    dimensions_of,
    limb,
    reference_lengths,
)
from posekit.body.stature import lengths_from_stature, stature_from_lengths
from posekit.geometry import Array
from posekit.safe_io import nearest, refusal, shown
from posekit.skeleton import SIDES

Sex = Literal["female", "male"]

PROPORTION_DEVIATION: Final = {
    "upper_arm": 0.08,
    "forearm": 0.058,
    "thigh": 0.08,
    "shank": 0.059,
    SHOULDER_WIDTH: 0.12,
    HIP_WIDTH: 0.25,
    TRUNK_LENGTH: 0.05,
}
"""Standard deviation of a person's dimension, as a fraction of what a proportion says.

For limbs it is the coefficient of variation among 4082 men, stature's own 3.9 % included, which makes it a cautious
figure at a known stature: acromion-radiale length 335 (17.5) mm, radiale-stylion 268 (15.4), thigh link 409 (28.4),
calf link 419 (24.6): Gordon et al. 2014, "2012 Anthropometric Survey of U.S. Army Personnel", NATICK/TR-15/007. That of
upper arm (5.2 %) and thigh (6.9 %) is widened to 8 %, because the sources differ about where shoulder and hip are: the
upper arm is 0.186 of stature in Drillis & Contini, 0.160 in de Leva. The trunk's is sitting height's, 918 (35.7) mm,
and some more for where the shoulders are. The widths' is wider than biacromial breadth's 4.6 %, because tables give
widths over the bones and key points are at the joints: the heads of the femurs are 190 mm apart, 0.11 of stature,
against 0.19 for the hips' width.
"""

JOINT_CENTRE_DEVIATION: Final = {SHOULDER_WIDTH: 0.08, HIP_WIDTH: 0.1}
"""The same where the widths are those of joint centres: biacromial breadth's 4.6 %, the femoral heads' 6.6 %, and room
for where a detector sees the joints."""

DE_LEVA_STATURE: Final[dict[Sex, float]] = {"female": 1735.0, "male": 1741.0}
DE_LEVA: Final[dict[Sex, dict[str, float]]] = {
    "female": {"upper_arm": 275.1, "forearm": 264.3, "thigh": 368.5, "shank": 438.6},
    "male": {"upper_arm": 281.7, "forearm": 268.9, "thigh": 422.2, "shank": 440.3},
}
"""Millimetres between joint centres (SJC-EJC, EJC-WJC, HJC-KJC, KJC-AJC), and the samples' mean statures: de Leva 1996,
"Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", J. Biomechanics 29, 1223-1230, Table 4."""


FEMORAL_HEADS: Final[dict[Sex, float]] = {"female": 2 * 91.54 / 1629.0, "male": 2 * 95.02 / 1756.2}
BIACROMIAL_OF_STATURE: Final = 415.7 / 1756.2
"""Widths that go with joint centres, of stature. The heads of the femurs are 91.5 and 95.0 mm from the pelvis's middle
("The distance of the centre of femoral head relative to the midline of the pelvis: a prospective X-ray study of 500
adults"), the statures and the breadth over the acromia (men's, for both) are Gordon et al. 2014's."""


@dataclass(frozen=True, kw_only=True)
class Proportions:
    """Where proportions come from."""

    name: str
    source: str
    sexes: bool = False


PROPORTION_SOURCES: Final[Mapping[str, Proportions]] = {
    one.name: one
    for one in (
        Proportions(
            name="drillis-contini",
            source="Drillis & Contini 1966, Body segment parameters, Technical Report 1166.03, New York University",
        ),
        Proportions(
            name="winter",
            source="Winter, Biomechanics and Motor Control of Human Movement, figure 4.1: the fractions of Drillis & "
            "Contini 1966",
        ),
        Proportions(
            name="de-leva",
            source="de Leva 1996, J. Biomechanics 29, 1223-1230, Table 4 (limbs, between joint centres); femoral heads "
            "by X-ray, acromia of Gordon et al. 2014; trunk of Drillis & Contini 1966",
            sexes=True,
        ),
        Proportions(name="table-a1", source="Lee & Chen 1985, Table A.1, scaled to the stature"),
    )
}
"""The sources by name."""


def proportion_names() -> tuple[str, ...]:
    """Return the names that `lengths_from_proportions` takes."""
    return tuple(PROPORTION_SOURCES)


def lengths_from_proportions(
    name: str,
    stature: float,
    *,
    sex: Sex | None = None,
    reference: Mapping[str, float] | None = None,
) -> SegmentLengths:
    """Estimate the 17 lengths of a person of a given stature.

    Parameters
    ----------
    name : str
        One of `proportion_names`.
    stature : float
        Standing height, metres.
    sex : str, optional
        ``female`` or ``male``, where the source tells them apart; the mean of both if not given.
    reference : mapping, optional
        The 17 lengths of the body whose torso gives the shape, metres; for ``table-a1`` all of it. The built-in
        figure's unless told otherwise.

    Returns
    -------
    SegmentLengths
        Its deviations are the spread among people.

    Raises
    ------
    InputError
        Where there is no such source or sex.
    FigureError
        Where the stature is no person's in metres.

    Examples
    --------
    >>> round(lengths_from_proportions("de-leva", 1.741, sex="male").lengths["right_hip-right_knee"], 4)
    0.4222
    """
    check_stature(stature)
    source = source_of(name)
    if sex is not None and sex not in DE_LEVA:
        raise refusal("", "sex", shown(sex), "female or male", "or leave it out for the mean of both")
    base = reference_lengths(reference)
    dimensions = _dimensions(name, stature, sex, base)
    says = source.source + (f", {sex}" if sex is not None and source.sexes else "")
    return completed(dimensions, np.diag(spread(name) ** 2), base, says, (), stature)


def source_of(name: str) -> Proportions:
    """Return a source by name, and refuse one that is not known."""
    if name not in PROPORTION_SOURCES:
        raise refusal("", "proportions", shown(name), "a known source", nearest(name, PROPORTION_SOURCES))
    return PROPORTION_SOURCES[name]


def spread(name: str) -> Array:
    """Return the relative standard deviation (11,) of each of `BODY_DIMENSIONS` about a source's proportions."""
    given = PROPORTION_DEVIATION | (JOINT_CENTRE_DEVIATION if name == "de-leva" else {})
    parts = {limb(side, part): given[part] for part in LIMB_PARTS for side in SIDES}
    return np.array([parts.get(one, given.get(one, np.nan)) for one in BODY_DIMENSIONS])


def _dimensions(name: str, stature: float, sex: Sex | None, base: dict[str, float]) -> dict[str, float]:
    if name == "table-a1":
        scale = stature / stature_from_lengths(base)
        return {one: scale * length for one, length in dimensions_of(base).items()}
    dimensions = dimensions_of(lengths_from_stature(stature, base))
    if name == "de-leva":
        chosen = tuple(DE_LEVA) if sex is None else (sex,)
        for part in LIMB_PARTS:
            fraction = sum(DE_LEVA[one][part] / DE_LEVA_STATURE[one] for one in chosen) / len(chosen)
            dimensions |= {limb(side, part): fraction * stature for side in SIDES}
        dimensions[HIP_WIDTH] = stature * sum(FEMORAL_HEADS[one] for one in chosen) / len(chosen)
        dimensions[SHOULDER_WIDTH] = stature * BIACROMIAL_OF_STATURE
    return dimensions
