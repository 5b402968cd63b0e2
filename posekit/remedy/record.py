"""What a repair returns: postures, what was changed by how much and where, and what is left."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.display.plural import plural
from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array, runs
from posekit.skeleton import JOINTS
from posekit.validators.suite import Judgement

SHIFTED_BACK: Final = "shifted back"
"""What was done where the whole body was moved, as after a step that lasts."""

SEEN_METRES: Final = 1e-9
"""Metres from which a joint counts as moved."""


@dataclass(frozen=True, kw_only=True)
class RepairedSpan:
    """One joint that was moved in consecutive frames.

    Parameters
    ----------
    remedy : str
        What was done: ``turned``, ``shifted``, ``shifted back``, ``interpolated``, ``exchanged``, ``smoothed``,
        ``held``, ``lengthened``, ``reordered``.
    place : str
        The joint, of a robot the joint of its URDF; ``body`` where all of it was shifted back.
    first, last : int
        The frames, both counted in.
    most : float
        The most by which it was moved, in `unit`.
    unit : str
        Metres (``m``) of the stick figure's joints; of a robot's ``rad``, or ``m``.
    """

    remedy: str
    place: str
    first: int
    last: int
    most: float
    unit: str = "m"

    def __str__(self) -> str:
        frames = f"frame {self.first}" if self.first == self.last else f"frames {self.first} to {self.last}"
        most = f"{100 * self.most:.3g} cm" if self.unit == "m" else f"{np.degrees(self.most):.3g} deg"
        return f"{self.place} {self.remedy} by up to {most} in {frames}"


@dataclass(frozen=True, kw_only=True)
class UnrepairedFrame:
    """What a check still rejects.

    Parameters
    ----------
    frame : int
        Which posture.
    check, place : str
        What rejects it, and where.
    left : float
        How far it is outside the bound, in `unit`; positive.
    unit : str
        The check's.
    """

    frame: int
    check: str
    place: str
    left: float
    unit: str

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"frame {self.frame}: {self.check} {self.place} is {abs(self.left):.3g}{unit} beyond its bound"


@dataclass(frozen=True, kw_only=True, eq=False)
class Repaired(ShortRepr):
    """The nearest postures, or configurations, that pass, and the record of it.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Metres; those that passed are as they were. None of a robot: N is then of `q`.
    head : array (N, 5, 3), optional
        The head's points, where they were given.
    feet : array (N, 4, 3), optional
        Toes and heels of a motion that has them (`posekit.skeleton.FEET_POINTS`): they go with their ankles.
    q : array (N, nq), optional
        Of a robot, its configurations.
    time : array (N,), optional
        Of a motion, the times of its frames, seconds: in order, where frames were put in order.
    spans : tuple of RepairedSpan
        What was changed, most first.
    left : tuple of UnrepairedFrame
        What could not be repaired.
    valid : bool array (N,)
        What a fresh validation says of each.
    """

    joints: Array
    head: Array | None = None
    feet: Array | None = None
    q: Array | None = None
    time: Array | None = None
    spans: tuple[RepairedSpan, ...]
    left: tuple[UnrepairedFrame, ...]
    valid: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for array in (self.joints, self.head, self.feet, self.q, self.valid):
            if array is not None:
                array.flags.writeable = False

    @property
    def changed(self) -> NDArray[np.bool_]:
        """Which postures were changed (N,)."""
        changed = np.zeros(len(self.valid), dtype=np.bool_)
        for span in self.spans:
            changed[span.first : span.last + 1] = True
        return changed

    def told(self, most: int = 3) -> str:
        """Say in a sentence what was changed and what was not."""
        changed, bad = int(self.changed.sum()), len({one.frame for one in self.left})
        parts = [f"{changed} of {plural(len(self.valid), 'frame')} changed"]
        parts += map(str, self.spans[:most])
        if len(self.spans) > most:
            parts.append(f"{len(self.spans) - most} more")
        if bad:
            checks = Counter({one.check: 0 for one in self.left})
            checks.update(check for _, check in {(one.frame, one.check) for one in self.left})
            counts = ", ".join(f"{check} {count}" for check, count in checks.most_common())
            parts.append(f"left: {plural(bad, 'frame')}: {counts}; the first, {self.left[0]}")
        undecided = int((~self.valid).sum()) - bad
        if undecided > 0:
            parts.append(f"{undecided} undecided")
        return "; ".join(parts)

    def as_dict(self) -> dict[str, Any]:
        """Return the record for a report in JSON."""
        return {
            "frames": len(self.valid),
            "changed": int(self.changed.sum()),
            "valid": int(self.valid.sum()),
            "spans": [vars(span) for span in self.spans],
            "left": [vars(one) for one in self.left],
        }


def spans_of(
    remedy: str, moved: Array, places: Sequence[str] = JOINTS, unit: str = "m", least: float = SEEN_METRES
) -> list[RepairedSpan]:
    """List the spans in which places moved (N, K), by how much; of a body that is shifted back the body's."""
    if remedy == SHIFTED_BACK:
        moved, places = moved.max(axis=1, keepdims=True), ["body"]
    return [
        RepairedSpan(
            remedy=remedy,
            place=place,
            first=first,
            last=stop - 1,
            most=float(moved[first:stop, column].max()),
            unit=unit,
        )
        for column, place in enumerate(places)
        for first, stop in runs(moved[:, column] > least)
    ]


def left_of(judgements: Sequence[Judgement]) -> tuple[UnrepairedFrame, ...]:
    """List what checks reject, by frame."""
    left = [
        UnrepairedFrame(
            frame=int(frame),
            check=one.check,
            place=one.where[place],
            left=float(-one.margin[frame, place]),
            unit=one.unit[place],
        )
        for one in judgements
        for frame, place in zip(*np.nonzero(one.violated), strict=True)
    ]
    return tuple(sorted(left, key=lambda one: (one.frame, one.check, one.place)))
