"""Whose postures a file holds, recording by recording: lengths and measuring noise, as validators take them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body.measured import MeasuredPerson, measured_person
from posekit.validators import Validator

MAX_TOLD_PEOPLE: Final = 1000
"""Recordings of which a report says by what they were judged, one by one."""


class PersonRows(NamedTuple):
    """Postures in a row that are of one person, who is None where it is not asked."""

    rows: slice
    person: MeasuredPerson | None


def people_of(joints: NDArray[np.float64], clip: NDArray[np.intp] | None) -> list[PersonRows]:
    """Measure the person of each recording.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Metres.
    clip : int array (N,), optional
        Which recording each posture is of; one of all if not given.
    """
    if clip is None or not len(clip):
        return [PersonRows(slice(0, len(joints)), measured_person(joints))]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(clip)) + 1])
    ends = np.append(starts[1:], len(clip))
    in_one = len(starts) == len(np.unique(clip))
    people: dict[int, MeasuredPerson] = {}
    found = []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        which = int(clip[start])
        if which not in people:
            people[which] = measured_person(joints[start:end] if in_one else joints[clip == which])
        found.append(PersonRows(slice(start, end), people[which]))
    return found


def batches(stretches: Sequence[PersonRows], size: int) -> Iterator[PersonRows]:
    """Cut stretches into batches of at most so many postures."""
    for rows, person in stretches:
        for first in range(rows.start, rows.stop, size):
            yield PersonRows(slice(first, min(first + size, rows.stop)), person)


def told_of_people(validator: Validator, stretches: Sequence[PersonRows]) -> dict[str, Any]:
    """Say by what the people of a file were judged: of one their lengths; of more each, and the widest."""
    people = {id(person): person for _, person in stretches if person is not None}
    told = [validator.told_of(person) for person in people.values()]
    if len(told) == 1:
        (person,) = people.values()
        measured = validator.lengths == "median"
        lengths = {name: round(length, 6) for name, length in person.lengths.items()} if measured else None
        return told[0] if lengths is None else {"lengths": lengths, **told[0]}
    known = [one for one in told if one.get("noise") is not None]
    if not known:
        return {"people": told[:MAX_TOLD_PEOPLE]}
    most = max(known, key=lambda one: one["noise"])
    noise = [min(one["noise"] for one in known), most["noise"]]
    return {**most, "moved_lengths": {}, "noise": noise, "people": told[:MAX_TOLD_PEOPLE]}
