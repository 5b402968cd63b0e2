"""Postures judged in batches: those of one person together, whichever clips and files they are of.

A call of a validator costs some ten milliseconds, as much as judging hundreds of postures, and a person's figure as
much again. Where many clips are short, those of people with the same measures are judged in one call.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body.measured import MeasuredPerson
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import NamedConfigurations, Postures
from posekit.validation.people import Recording, recordings_of
from posekit.validation.robot_motion import placed
from posekit.validators import Judgement, Validator
from posekit.validators import Report as Verdicts

POSTURES_AT_ONCE: Final = 4096
"""Postures that are judged at once."""

CONFIGURATIONS_FACTOR: Final = 4
"""Times as many configurations, which need no search: the fewer calls, the less time is lost between threads."""


class PosturesGiven(NamedTuple):
    """What is judged: postures, or configurations in the validator's order; and as motion, where they are frames."""

    joints: NDArray[np.float64] | None
    head: NDArray[np.float64] | None
    q: NDArray[np.float64] | None
    held: HeldPostures | None

    def __len__(self) -> int:
        return len(self.q) if self.q is not None else len(self.joints) if self.joints is not None else 0


@dataclass(eq=False, kw_only=True)
class FileJob:
    """A file that waits to be judged.

    Parameters
    ----------
    validator : Validator
        What judges it.
    given : PosturesGiven
        What it holds.
    file : str
        What reports call it.
    sequence : int array (N,), optional
        Which sequence in time each posture belongs to: see `Validator.check`.
    recordings : sequence of Recording
        Which of its postures are whose.
    over_time : sequence of sequences of Judgement
        What checks over time say of each recording, a row a posture.
    not_asked : sequence of (str, str)
        Of each clip, checks that do not apply and why.
    told : list of dict
        Of each recording, by what its person is judged: filled while it is.
    """

    validator: Validator
    given: PosturesGiven
    file: str
    sequence: NDArray[np.intp] | None
    recordings: Sequence[Recording] = ()
    over_time: Sequence[Sequence[Judgement]] = ()
    not_asked: Sequence[tuple[str, str]] = ()
    told: list[dict[str, Any] | None] = field(default_factory=list)

    @property
    def groups(self) -> bool:
        """Whether it may be judged together with others: a person by the stick figure."""
        return self.given.joints is not None and self.validator.robot is None


class JudgedPart(NamedTuple):
    """Verdicts on the postures `rows` of a file, which are the part `part` of one of its recordings."""

    job: FileJob
    recording: int
    part: slice
    verdicts: Verdicts

    @property
    def rows(self) -> NDArray[np.intp]:
        """Which postures of the file they are."""
        return self.job.recordings[self.recording].rows[self.part]


def postures_given(
    validator: Validator, postures: Postures | HeldPostures | NamedConfigurations
) -> PosturesGiven:
    """Lay out what is to be judged.

    Parameters
    ----------
    validator : Validator
        What judges.
    postures : Postures, HeldPostures or NamedConfigurations
        What was read.
    """
    if isinstance(postures, NamedConfigurations):
        if not len(postures.time):
            return PosturesGiven(None, None, _ordered(validator, postures), None)
        postures = placed(validator, postures)
    if isinstance(postures, HeldPostures):
        own = postures.postures
        if postures.q.shape[1] == len(validator.configuration_names):
            return PosturesGiven(None, None, postures.q, postures)
        return PosturesGiven(own.joints, own.head, None, postures)
    return PosturesGiven(postures.joints, postures.head, None, None)


def recordings_given(validator: Validator, given: PosturesGiven) -> list[Recording]:
    """Return the recordings of what is given: whose postures it holds.

    Parameters
    ----------
    validator : Validator
        What judges.
    given : PosturesGiven
        What is judged.
    """
    if given.joints is None:
        return [Recording(np.arange(len(given)), None)]
    # Scaling a robot takes a second: it has the lengths of the whole file.
    clip = None if given.held is None or validator.robot is not None else given.held.clip
    return recordings_of(given.joints, clip)


def judged_parts(jobs: Sequence[FileJob], *, configured: bool = True) -> Iterator[JudgedPart]:
    """Judge files; the parts of each recording come in their order.

    Parameters
    ----------
    jobs : sequence of FileJob
        The files.
    configured : bool
        Whether the configurations of postures are wanted: see `Validator.check`.
    """
    groups: dict[tuple[Any, ...], list[tuple[FileJob, int]]] = {}
    for job in jobs:
        job.told = [None] * len(job.recordings)
        for k, (_, person) in enumerate(job.recordings):
            alone = () if job.groups and person is not None else (id(job), k)
            who = () if person is None else _key(person)
            key = (id(job.validator), job.given.head is None, *who, *alone)
            groups.setdefault(key, []).append((job, k))
    for members in groups.values():
        yield from _judged_together(members, configured)


def _judged_together(members: Sequence[tuple[FileJob, int]], configured: bool) -> Iterator[JudgedPart]:
    """Judge recordings of one person in as few calls as may be."""
    validator, given = members[0][0].validator, members[0][0].given
    size = POSTURES_AT_ONCE * (CONFIGURATIONS_FACTOR if given.q is not None else 1)
    person = members[0][0].recordings[members[0][1]].person
    pieces: list[tuple[FileJob, int, slice]] = []
    room = size
    for job, k in members:
        first, count = 0, len(job.recordings[k].rows)
        while first < count:
            part = slice(first, min(first + room, count))
            pieces.append((job, k, part))
            room -= part.stop - part.start
            first = part.stop
            if not room:
                yield from _checked(validator, person, pieces, configured)
                pieces, room = [], size
    if pieces:
        yield from _checked(validator, person, pieces, configured)
    if person is not None:
        told = validator.told_of(person)
        for job, k in members:
            job.told[k] = told


def _checked(
    validator: Validator,
    person: MeasuredPerson | None,
    pieces: Sequence[tuple[FileJob, int, slice]],
    configured: bool,
) -> Iterator[JudgedPart]:
    """Judge parts of recordings in one call."""
    rows = [job.recordings[k].rows[part] for job, k, part in pieces]
    jobs = [job for job, _, _ in pieces]
    if jobs[0].given.q is not None:
        found = validator.check(q=_taken([job.given.q for job in jobs], rows))
    else:
        head = None if jobs[0].given.head is None else _taken([job.given.head for job in jobs], rows)
        which = None if jobs[0].sequence is None or jobs[0].groups else _taken([jobs[0].sequence], rows)
        joints = _taken([job.given.joints for job in jobs], rows)
        found = validator.check(joints, head, sequence=which, person=person, configured=configured)
    if len(pieces) == 1:
        yield JudgedPart(*pieces[0], found)
        return
    first = 0
    for piece, own in zip(pieces, rows, strict=True):
        yield JudgedPart(*piece, found.of(slice(first, first + len(own))))
        first += len(own)


def _taken(arrays: Sequence[NDArray[Any] | None], rows: Sequence[NDArray[np.intp]]) -> NDArray[Any]:
    """Lay rows of arrays one after the other."""
    return np.concatenate([array[own] for array, own in zip(arrays, rows, strict=True) if array is not None])


def _key(person: MeasuredPerson) -> tuple[Any, ...]:
    """Return what is the same of two people who are judged alike."""
    limbs = tuple(person.noise_by_limb.items())
    return tuple(person.lengths.items()), person.behind, str(person.hips_forward), str(person.noise), limbs


def _ordered(validator: Validator, given: NamedConfigurations) -> NDArray[np.float64]:
    """Return q in the validator's order; as it is where that is the file's."""
    names = validator.configuration_names
    if given.q.shape[1] == len(names) and given.names in (None, tuple(names)):
        return given.q
    return given.in_order_of(names)
