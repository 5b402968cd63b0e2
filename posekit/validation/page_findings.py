"""What a page says of the postures of a file: what checks find in each of them, in motion those over time, too."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from posekit.errors import PosekitError
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import Postures
from posekit.validation.files import AskedValidation
from posekit.validation.over_time import judged_over_time
from posekit.validation.people import Recording
from posekit.validation.reading import ReadPostures
from posekit.validators import Judgement, Validator
from posekit.viewer.page.findings_page import PageFinding, PageFindings

MOST_JUDGED: Final = 5000
"""Postures of a file that are judged while a page is made: about a second."""


def page_findings(given: Any) -> PageFindings | None:
    """Judge postures as `posekit validate` does; None where there are too many, or they cannot be judged.

    Parameters
    ----------
    given : Postures, HeldPostures or Result
        Each recording is one person's; of a result nothing is judged: all of its survivors passed.
    """
    if not isinstance(given, Postures | HeldPostures):
        return None
    held = given if isinstance(given, Postures) else given.postures
    joints, head = np.asarray(held.joints), held.head
    if len(joints) > MOST_JUDGED or not np.isfinite(joints).any():
        return None
    clip = given.clip if isinstance(given, HeldPostures) else np.zeros(len(joints), dtype=np.intp)
    recordings = [Recording(np.flatnonzero(clip == one), None) for one in np.unique(clip).tolist()]
    found: dict[int, list[PageFinding]] = defaultdict(list)
    moving: list[list[Judgement]] = [[] for _ in recordings]
    try:
        if isinstance(given, HeldPostures):
            validator = AskedValidation().validator(ReadPostures(given))
            if given.in_time:
                moving, _ = judged_over_time(given, recordings, validator)
        else:
            validator = Validator()
        for (rows, _), over_time in zip(recordings, moving, strict=True):
            report = validator.check(joints[rows], None if head is None else head[rows], configured=False)
            for row, finding in _findings([*report.judgements, *over_time]):
                found[int(rows[row])].append(finding)
    except PosekitError:
        return None
    return PageFindings(by_posture=dict(found))


def _findings(judgements: Sequence[Judgement]) -> Iterator[tuple[int, PageFinding]]:
    """List what was violated: the posture's row, and the finding."""
    for judgement in judgements:
        for row, k in np.argwhere(judgement.violated).tolist():
            value, lower, upper = (
                float(each[row, k]) for each in (judgement.value, judgement.lower, judgement.upper)
            )
            yield (
                row,
                PageFinding(
                    check=judgement.check,
                    where=judgement.where[k],
                    unit=judgement.unit[k],
                    value=value,
                    bound=lower if value < lower else upper,
                ),
            )
