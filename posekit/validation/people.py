"""Whose postures a file holds, recording by recording: lengths and measuring noise, as validators take them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body.measured import MeasuredPerson, measured_person

MAX_TOLD_PEOPLE: Final = 1000
"""Recordings of which a report says by what they were judged, one by one."""


DECIMALS_OF_METRES: Final = 5


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
        return [Recording(np.arange(len(joints)), _measured(joints))]
    order = np.argsort(clip, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(clip[order])) + 1)
    return [Recording(rows, _measured(joints[rows])) for rows in parts]


def _measured(joints: NDArray[np.float64]) -> MeasuredPerson:
    """Measure a person to a hundredth of a millimetre and a degree, so that clips of one skeleton have the same."""
    found = measured_person(joints)
    return replace(
        found,
        lengths={name: round(length, DECIMALS_OF_METRES) for name, length in found.lengths.items()},
        noise=round(found.noise, DECIMALS_OF_METRES),
        hips_forward=float(np.round(found.hips_forward)),
        noise_by_limb={name: round(noise, DECIMALS_OF_METRES) for name, noise in found.noise_by_limb.items()},
    )


class PeopleTold:
    """By what the people of files were judged: of one their lengths; of more each, and the widest."""

    def __init__(self) -> None:
        self.count = 0
        self._each: list[dict[str, Any]] = []
        self._lengths: dict[str, float] | None = None
        self._least = np.inf
        self._most: dict[str, Any] | None = None

    def add(self, person: MeasuredPerson | None, told: dict[str, Any]) -> None:
        """Note one.

        Parameters
        ----------
        person : MeasuredPerson or None
            Whose lengths were taken; None where the model has its own.
        told : dict
            By what they were judged: see `Validator.told_of`.
        """
        if not self.count and person is not None:
            self._lengths = dict(person.lengths)
        self.count += 1
        if len(self._each) < MAX_TOLD_PEOPLE:
            self._each.append(told)
        noise = told.get("noise")
        if noise is None:
            return
        self._least = min(self._least, noise)
        if self._most is None or noise > self._most["noise"]:
            self._most = told

    def told(self) -> dict[str, Any]:
        """Say it as reports do."""
        if self.count <= 1:
            lengths = {} if self._lengths is None else {"lengths": self._lengths}
            return {**lengths, **(self._each[0] if self._each else {})}
        if self._most is None:
            return {**self._each[0], "moved_lengths": {}, "people": self._each}
        noise = [self._least, self._most["noise"]]
        return {**self._most, "moved_lengths": {}, "noise": noise, "people": self._each}
