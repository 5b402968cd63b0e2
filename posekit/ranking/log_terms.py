"""The terms of survivors, before their weights."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.ranking.directions import directions
from posekit.ranking.evidence import RankingEvidence
from posekit.ranking.foreshortening import log_room
from posekit.ranking.ground import standing
from posekit.ranking.image_term import misfit
from posekit.ranking.posture_prior import Prior
from posekit.skeleton import JOINT

BLOCK_SURVIVORS: Final = 4096
"""Survivors whose terms are computed together: few enough to stay in the cache."""

CENTRE_OF_MASS_HEIGHT_METRES, STANCE_WIDTH_METRES = 0.9, 0.4
"""Metres from ankles to centre of mass, and between ankles: how far a wrong `up` moves one beside the other."""


def log_terms(evidence: RankingEvidence, wanted: Collection[str], prior: Prior) -> dict[str, Array]:
    """Return the log terms of all survivors (N,), by name: of those wanted for which there is something to go by."""
    count = len(evidence.joints)
    terms = {name: np.empty(count) for name in evidence.possible if name in wanted}
    for start in range(0, count, BLOCK_SURVIVORS):
        part = slice(start, min(start + BLOCK_SURVIVORS, count))
        for name, values in _log_terms_of(evidence, part, terms, prior):
            terms[name][part] = values
    return terms


def _log_terms_of(
    evidence: RankingEvidence, part: slice, wanted: Collection[str], prior: Prior
) -> Iterator[tuple[str, Array]]:
    joints = np.ascontiguousarray(evidence.joints[part].transpose(1, 2, 0))
    frame = evidence.frame[part]
    deviation = evidence.deviation[frame]
    upward, sine = None, 0.0
    if evidence.up is not None:
        direction, sine = evidence.up.direction, evidence.up.sine
        upward = direction[frame].T if direction.ndim == 2 else direction[:, None]
    if "image" in wanted and evidence.chi2 is not None:
        yield "image", -0.5 * evidence.chi2[part]
    elif "image" in wanted and evidence.lengths is not None:
        residual = None if evidence.length_residual is None else evidence.length_residual[part]
        yield "image", misfit(joints, evidence.lengths, residual, deviation)
    if "posture" in wanted or "gravity" in wanted:
        posture, gravity = prior.judge(directions(joints, upward if "gravity" in wanted else None), sine)
        # A survivor that is far off is no draw from a sharp distribution: its log-density counts the less.
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
    if "foreshortening" in wanted:
        yield "foreshortening", log_room(joints)
    if "depth" in wanted and evidence.depth is not None:
        yield "depth", evidence.depth.judge(joints[JOINT["neck"], 2], frame)
