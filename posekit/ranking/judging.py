"""The terms of survivors, before their weights."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.ranking.directions import directions
from posekit.ranking.given import RankingEvidence
from posekit.ranking.ground import standing
from posekit.ranking.image import misfit
from posekit.ranking.prior import Prior
from posekit.skeleton import JOINT

AT_ONCE: Final = 4096
"""Survivors whose terms are computed together: few enough to stay in the cache."""

CENTRE_OF_MASS_HEIGHT_METRES, STANCE_WIDTH_METRES = 0.9, 0.4
"""Metres from ankles to centre of mass, and between ankles: how far a wrong `up` moves one beside the other."""


def judge(given: RankingEvidence, wanted: Collection[str], prior: Prior) -> dict[str, Array]:
    """Return the log terms of all survivors (N,), by name: of those wanted for which there is something to go by."""
    count = len(given.joints)
    terms = {name: np.empty(count) for name in given.possible if name in wanted}
    for start in range(0, count, AT_ONCE):
        part = slice(start, min(start + AT_ONCE, count))
        for name, values in _judge(given, part, terms, prior):
            terms[name][part] = values
    return terms


def _judge(
    given: RankingEvidence, part: slice, wanted: Collection[str], prior: Prior
) -> Iterator[tuple[str, Array]]:
    joints = np.ascontiguousarray(given.joints[part].transpose(1, 2, 0))
    frame = given.frame[part]
    deviation = given.deviation[frame]
    upward, sine = None, 0.0
    if given.up is not None:
        direction, sine = given.up.direction, given.up.sine
        upward = direction[frame].T if direction.ndim == 2 else direction[:, None]
    if "image" in wanted and given.chi2 is not None:
        yield "image", -0.5 * given.chi2[part]
    elif "image" in wanted and given.lengths is not None:
        residual = None if given.length_residual is None else given.length_residual[part]
        yield "image", misfit(joints, given.lengths, residual, deviation)
    if "posture" in wanted or "gravity" in wanted:
        posture, gravity = prior.judge(directions(joints, upward if "gravity" in wanted else None), sine)
        coolness = 1.0 / (1.0 + deviation / prior.temperature)
        for name, values in (("posture", posture), ("gravity", gravity)):
            if name in wanted:
                yield name, coolness * values
    if upward is not None and ("balance" in wanted or "contact" in wanted):
        beside, apart = standing(joints, upward)
        if "balance" in wanted:
            yield "balance", prior.balance.judge(beside, CENTRE_OF_MASS_HEIGHT_METRES * sine)
        if "contact" in wanted:
            yield "contact", prior.contact.judge(apart, STANCE_WIDTH_METRES * sine)
    if "depth" in wanted and given.depth is not None:
        yield "depth", given.depth.judge(joints[JOINT["neck"], 2], frame)
