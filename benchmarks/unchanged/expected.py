"""What may differ: where and when something ran, and differences that were meant, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase


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
    """

    case: str
    place: str
    reason: str

    def covers(self, case: str, place: str) -> bool:
        """Whether a difference is one of these."""
        return fnmatchcase(case, self.case) and fnmatchcase(place, self.place.replace("[", "[[]"))


VOLATILE: tuple[Allowed, ...] = (
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

EXPECTED: tuple[Allowed, ...] = ()
"""What this change means to change. It is listed with its reason, and empty again for the next one."""


def allowed(case: str, place: str, among: tuple[Allowed, ...]) -> Allowed | None:
    """Return the first of `among` that covers a difference."""
    return next((one for one in among if one.covers(case, place)), None)
