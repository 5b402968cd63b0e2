"""Whose postures a file holds, recording by recording: lengths and measuring noise, as validators take them."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body.measured import MeasuredPerson, measured_person
from posekit.validators import Validator

MAX_TOLD_PEOPLE: Final = 1000
"""Recordings of which a report says by what they were judged, one by one."""


class Recording(NamedTuple):
    """Which postures of a file are of one recording, and their person, who is None where it is not asked."""

    rows: NDArray[np.intp]
    person: MeasuredPerson | None


def recordings_of(joints: NDArray[np.float64], clip: NDArray[np.intp] | None) -> list[Recording]:
    """Measure the person of each recording.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Metres.
    clip : int array (N,), optional
        Which recording each posture is of; one of all if not given.
    """
    if clip is None or not len(clip):
        return [Recording(np.arange(len(joints)), measured_person(joints))]
    order = np.argsort(clip, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(clip[order])) + 1)
    return [Recording(rows, measured_person(joints[rows])) for rows in parts]


class PeopleTold:
    """By what the people of files were judged: of one their lengths; of more each, and the widest."""

    def __init__(self) -> None:
        self.count = 0
        self._each: list[dict[str, Any]] = []
        self._lengths: dict[str, float] | None = None
        self._least = np.inf
        self._most: dict[str, Any] | None = None

    def add(self, validator: Validator, person: MeasuredPerson) -> None:
        """Note one, right after the judging: a validator keeps the last person's figure."""
        told = validator.told_of(person)
        if not self.count and validator.lengths == "median":
            self._lengths = {name: round(length, 6) for name, length in person.lengths.items()}
        self._note([told], 1)

    def join(self, others: PeopleTold) -> None:
        """Note those of another file."""
        if not self.count:
            self._lengths = others._lengths
        extremes = [] if others._most is None else [{"noise": others._least}, others._most]
        self._note(others._each, others.count, extremes)

    def _note(
        self, told: list[dict[str, Any]], count: int, extremes: list[dict[str, Any]] | None = None
    ) -> None:
        self.count += count
        self._each += told[: MAX_TOLD_PEOPLE - len(self._each)]
        for one in told if extremes is None else extremes:
            noise = one.get("noise")
            if noise is None:
                continue
            self._least = min(self._least, noise)
            if len(one) > 1 and (self._most is None or noise > self._most["noise"]):
                self._most = one

    def told(self) -> dict[str, Any]:
        """Say it as reports do."""
        if self.count <= 1:
            lengths = {} if self._lengths is None else {"lengths": self._lengths}
            return {**lengths, **(self._each[0] if self._each else {})}
        if self._most is None:
            return {"people": self._each} if any(self._each) else {}
        noise = [self._least, self._most["noise"]]
        return {**self._most, "moved_lengths": {}, "noise": noise, "people": self._each}
