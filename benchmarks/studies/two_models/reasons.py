"""Why two models' verdicts on one posture differ."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.two_models.angles import Angles
from benchmarks.studies.two_models.labelled import Labelled
from posekit.validators import Report

SPINE_ORDER: Final = "order of the spine's rotations"
OTHER_LIMIT: Final = "the human's own limit"
LONG_TRUNK: Final = "no proof: a spine with joints has no one length"
OTHER_JOINTS: Final = "joints that the stick figure has not"
CAPSULE_REASON: Final = "made-up capsules"
TOO_LITTLE: Final = ", too little to call"
SEARCH_REASON: Final = "another configuration, or none, was found"


def reasons(postures: Labelled, stick: Report, human: Report, expected: Angles, *, mapped: bool) -> list[str]:
    """Say why the human's verdict on each posture is not the stick figure's; nothing where it is.

    Parameters
    ----------
    postures : Labelled
    stick, human : Report
        Of the same checks.
    expected : mapping
        `excess` of the angles in the human's order over the limits that it was judged by, by part.
    mapped : bool
        Whether those limits are the stick figure's, or the human's own.
    """
    found = []
    ours, theirs = _judged(stick, "collision"), _judged(human, "collision")
    worst = np.max(list(expected.values()), axis=0)
    pelvis_alone = worst == expected["pelvis"]
    for k, (one, other) in enumerate(zip(stick.verdicts, human.verdicts, strict=True)):
        if one == other:
            found.append("")
        elif ours[k] != theirs[k]:
            found.append(CAPSULE_REASON)
        elif postures.kind[k] == "trunk stretched":
            found.append(LONG_TRUNK)
        elif one == "valid" and worst[k] <= 0:
            found.append(SEARCH_REASON)
        elif other == "valid" and worst[k] > 0:
            found.append(OTHER_JOINTS)
        else:
            why = SPINE_ORDER if mapped and pelvis_alone[k] else OTHER_LIMIT
            found.append(why + TOO_LITTLE if other == "undecided" else why)
    return found


def _judged(report: Report, check: str) -> NDArray[np.bool_]:
    violated = np.zeros(len(report.complete), dtype=np.bool_)
    for judgement in report.judgements:
        if judgement.check == check:
            violated |= judgement.violated.any(axis=1)
    return violated
