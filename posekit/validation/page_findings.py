"""What a page says of the postures of a file: findings of the checks that judge each posture by itself."""

from __future__ import annotations

from collections import defaultdict
from typing import Any, Final

import numpy as np

from posekit.errors import PosekitError
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import Postures
from posekit.validators import Validator
from posekit.viewer.page.findings_page import PageFinding, PageFindings

MOST_JUDGED: Final = 5000
"""Postures of a file that are judged while a page is made: about a second."""


def page_findings(given: Any) -> PageFindings | None:
    """Judge postures as `posekit validate` does; None where there are too many, or they cannot be judged.

    Parameters
    ----------
    given : Postures, HeldPostures or Result
        Frames of one person; of a result nothing is judged: all of its survivors passed.
    """
    if not isinstance(given, Postures | HeldPostures):
        return None
    held = given if isinstance(given, Postures) else given.postures
    joints = np.asarray(held.joints)
    if len(joints) > MOST_JUDGED or not np.isfinite(joints).any():
        return None
    try:
        report = Validator().check(joints, held.head, configured=False)
    except PosekitError:
        return None
    found: dict[int, list[PageFinding]] = defaultdict(list)
    for judgement in report.judgements:
        for row, k in np.argwhere(judgement.violated).tolist():
            value, lower, upper = (
                float(each[row, k]) for each in (judgement.value, judgement.lower, judgement.upper)
            )
            found[row].append(
                PageFinding(
                    check=judgement.check,
                    where=judgement.where[k],
                    unit=judgement.unit[k],
                    value=value,
                    bound=lower if value < lower else upper,
                )
            )
    return PageFindings(by_posture=dict(found))
