"""What may differ: where and when something ran, and differences that were meant, each with its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fnmatch import fnmatchcase

from benchmarks.unchanged.differences import Difference


@dataclass(frozen=True)
class Allowed:
    """Differences that are allowed.

    Parameters
    ----------
    case : str
        A glob of cases.
    place : str
        A glob of places, as ``result.json:settings.versions.*``; brackets stand for themselves.
    reason : str
        Why.
    within : float
        Numbers may be so far apart, and no farther.
    """

    case: str
    place: str
    reason: str
    within: float = math.inf

    def covers(self, case: str, difference: Difference) -> bool:
        """Whether a difference is one of these."""
        place = self.place.replace("[", "[[]")
        near = difference.distance <= self.within
        return near and fnmatchcase(case, self.case) and fnmatchcase(difference.place, place)


VOLATILE_PLACES: tuple[Allowed, ...] = (
    Allowed("*", "*settings.versions*", "versions of packages"),
    Allowed("*", "*:versions*", "versions of packages"),
    Allowed("batch-*", "*settings.made_with*", "versions of packages"),
    Allowed(
        "batch-*", "*batch.json:hash", "a digest of settings and versions, which are compared themselves"
    ),
    Allowed(
        "batch-*", "*batch.json:inputs.*", "digests of contents, which are compared where they are written"
    ),
)
"""What differs between two runs of one program, or follows from where it ran; nothing is said of it."""

EXPECTED_DIFFERENCES: tuple[Allowed, ...] = (
    Allowed("python-names", "answer.json:*Settings", "settings are one object, a name of posekit's own"),
    Allowed("python-names", "answer.json:open", "one door for files, a name of posekit's own"),
    Allowed("python-names", "answer.json:follow", "paths through frames have a name of posekit's own"),
    Allowed("*", "*:settings.asked*", "settings are written whole into every result"),
    Allowed("*", "*:settings.values[0].asked*", "settings are written whole into every result"),
    Allowed("*", "*.npz:settings.dtype", "settings are written whole: the text is longer"),
    Allowed("*", "*.npz:roots.dtype", "the text of roots is as long as its longest value needs"),
    Allowed("demo", "*.report.json:settings.*", "a report says what it was judged with, from Python too"),
    Allowed(
        "recover-default-tolerance-given",
        "*:settings.judged*",
        "how a frame was judged is stored: tolerances that are given are given, whatever their numbers",
    ),
)
"""What this change means to change. It is listed with its reason, and empty again for the next one."""


def allowed(case: str, difference: Difference, among: tuple[Allowed, ...]) -> Allowed | None:
    """Return the first of `among` that covers a difference."""
    return next((one for one in among if one.covers(case, difference)), None)
