"""What all checks over time say of a clip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from posekit.validators.motion.clip import MotionClip
from posekit.validators.motion.motion_check import MotionCheck
from posekit.validators.suite import Judgement


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionVerdict:
    """What checks over time found in one clip.

    Parameters
    ----------
    judgements : sequence of Judgement
        Of the checks that were asked; a row a frame.
    not_asked : mapping
        By the name of a check that does not apply, why.
    """

    judgements: Sequence[Judgement]
    not_asked: Mapping[str, str]


def judge_motion(checks: Sequence[MotionCheck], clip: MotionClip) -> MotionVerdict:
    """Ask checks over time about one clip.

    Parameters
    ----------
    checks : sequence of MotionCheck
        With their thresholds.
    clip : MotionClip
        One body over time.
    """
    judgements, not_asked = [], {}
    for check in checks:
        reason = check.not_asked(clip)
        if reason:
            not_asked[check.name] = reason
            continue
        findings, where = check.judge(clip), check.places(clip)
        shape = len(clip), len(where)
        judgements.append(
            Judgement(
                check=check.name.replace("-", "_"),
                where=where,
                unit=(check.unit,) * len(where),
                value=findings.value,
                lower=np.broadcast_to(findings.lower, shape),
                upper=np.broadcast_to(findings.upper, shape),
                margin=findings.margin,
                violated=np.asarray(findings.violated, dtype=np.bool_),
                over_time=True,
            )
        )
    return MotionVerdict(judgements=judgements, not_asked=not_asked)
