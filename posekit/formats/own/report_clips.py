"""The verdict on a clip, and the spans of frames that are behind it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.report_schema import ClipFields, Verdict


@dataclass(frozen=True, kw_only=True)
class Span:
    """Neighbouring frames of a clip that one check rejects, or says nothing about.

    Parameters
    ----------
    check, where, unit : str
        The check, its worst place, and the unit of the numbers; no place where it says nothing.
    verdict : str
        ``invalid`` or ``undecided``.
    first, last : int
        Its frames, counted from 0 in the clip; both are of the span.
    frames : int
        How many of them are rejected or undecided: frames between two that are near each other may not be.
    worst_frame : int
        The frame that is farthest beyond the bound; the first one where nothing is said.
    start, end : float or None
        Seconds of the first and the last frame.
    value, bound, margin : float or None
        What was found in the worst frame, the bound that it is beyond, and by how much, negative.
    places : sequence of str
        All places that the check rejects in the span, the worst first; ten at most.
    """

    check: str
    where: str
    unit: str
    verdict: Verdict
    first: int
    last: int
    frames: int
    worst_frame: int
    start: float | None = None
    end: float | None = None
    value: float | None = None
    bound: float | None = None
    margin: float | None = None
    places: Sequence[str] = ()

    @property
    def name(self) -> str:
        """What is behind it, as it is printed: ``joint_range/right_knee``."""
        return f"{self.check}/{self.where}" if self.where else self.check


@dataclass(frozen=True, kw_only=True)
class ClipVerdict:
    """The verdict on one clip.

    Parameters
    ----------
    file, clip : str
        Its file, and its name in it, empty where it has none.
    verdict : str
        ``invalid`` where some frame is, else ``undecided`` where some frame is, else ``valid``.
    frames, invalid, undecided : int
        Its frames, and how many are rejected and undecided.
    spans : sequence of Span
        What is behind it, the worst first.
    more_spans : int
        Spans that are not listed.
    first_frame : int or None
        The first frame that is not valid.
    first_by : sequence of str
        The checks and places that do not let it pass.
    good : sequence of int
        First and last frame of the longest span of valid frames; empty where none is.
    seconds : float or None
        How long it takes.
    """

    file: str
    clip: str
    verdict: Verdict
    frames: int
    invalid: int
    undecided: int
    spans: Sequence[Span] = ()
    more_spans: int = 0
    first_frame: int | None = None
    first_by: Sequence[str] = field(default_factory=tuple)
    good: Sequence[int] = ()
    seconds: float | None = None

    @property
    def valid(self) -> int:
        """How many frames are valid."""
        return self.frames - self.invalid - self.undecided

    @property
    def rejected_share(self) -> float:
        """The share of frames that are not valid."""
        return (self.invalid + self.undecided) / max(self.frames, 1)

    def rank(self) -> tuple[bool, float]:
        """Return by what clips are sorted, the worst first: what is rejected, by its share of frames not valid."""
        return self.verdict != "invalid", -self.rejected_share


class Still(NamedTuple):
    """A frame of a clip as it can be drawn: metres, z up, around its own middle.

    `points` (14 or 19, 3) are the joints, and the head's points where they are known; `before` those of the frame
    before, in the same place, or None.
    """

    frame: int
    points: NDArray[np.float32]
    before: NDArray[np.float32] | None


def clip_document(clip: ClipVerdict) -> dict[str, Any]:
    """Lay a clip's verdict out as the schema has it."""
    own = {name: value for name, value in vars(clip).items() if value is not None}
    return own | {"spans": [{k: v for k, v in vars(span).items() if v is not None} for span in clip.spans]}


def clip_of_document(given: ClipFields) -> ClipVerdict:
    """Read a clip's verdict from a report."""
    own = {one.name: getattr(given, one.name) for one in fields(ClipVerdict)}
    spans = tuple(
        Span(**{one.name: getattr(span, one.name) for one in fields(Span)} | {"places": tuple(span.places)})
        for span in given.spans
    )
    return ClipVerdict(**own | {"spans": spans, "first_by": tuple(given.first_by), "good": tuple(given.good)})
