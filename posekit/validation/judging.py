"""Verdicts file after file: in columns, clip by clip and in batches, so that memory holds one clip's findings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import NamedConfigurations, Postures, ValidationReport
from posekit.formats.own.report import PostureReport
from posekit.formats.own.report_clips import ClipVerdict, Still
from posekit.formats.own.report_columns import ReportPlace, VerdictColumns, joined
from posekit.formats.own.report_frames import ClipName, ReportFrames, joined_frames
from posekit.validation.advice import why_most_fail
from posekit.validation.over_time import clip_of, frames_of
from posekit.validation.people import PeopleTold, Recording, recordings_of
from posekit.validation.robot_motion import placed
from posekit.validation.spans import clip_verdicts
from posekit.validation.stills import MOST_DRAWN_CLIPS, stills_of, worst_stills
from posekit.validation.validate_columns import columns_of, in_order
from posekit.validation.validate_listing import list_postures
from posekit.validators import Judgement, Validator
from posekit.validators import Report as Verdicts
from posekit.validators.motion import judge_motion
from posekit.validators.motion.registry import MOTION_CHECKS
from posekit.validators.robot import Contacts
from posekit.validators.robot.settings import OF_POSITIONS

POSTURES_AT_ONCE: Final = 4096
"""Postures that are judged at once."""

CONFIGURATIONS_FACTOR: Final = 4
"""Times as many configurations, which need no search: the fewer calls, the less time is lost between threads."""

MAX_LISTED: Final = 10_000
"""Postures that a report lists one by one: all where there are no more, else the first that are not valid."""

MAX_SAID: Final = 100
"""Sentences of what was recognised that a report has."""

Detail = Literal["findings", "margins", "verdicts"]


@dataclass(frozen=True, kw_only=True)
class WantedDetail:
    """What is wanted of each posture.

    Parameters
    ----------
    detail : {"findings", "margins", "verdicts"}
        Findings one by one, as JSON has them; the least margin of each, as CSV; or the verdicts alone, with what is
        behind those that are not valid, as summaries and Markdown have them.
    every : bool
        List every finding, not only violations and each check's worst.
    distances : bool, optional
        Whether to measure the nearest pair of bodies of every posture of a robot that is shown; by default where none
        is a mesh. Of those that collide it is measured in any case.
    files : int
        How many files there are, about: the more, the fewer spans of each clip are listed.
    """

    detail: Detail = "findings"
    every: bool = False
    distances: bool | None = None
    files: int = 1


class _Given(NamedTuple):
    """What is judged: postures, or configurations in the validator's order; and as motion, where they are frames."""

    joints: NDArray[np.float64] | None
    head: NDArray[np.float64] | None
    q: NDArray[np.float64] | None
    held: HeldPostures | None

    def __len__(self) -> int:
        return len(self.q) if self.q is not None else len(self.joints) if self.joints is not None else 0


class ReportBuilder:
    """The verdicts on one file after the other, and the report on all of them.

    Parameters
    ----------
    wanted : WantedDetail, optional
        What is wanted of each posture.
    """

    def __init__(self, wanted: WantedDetail | None = None) -> None:
        self._wanted = wanted or WantedDetail()
        self._places: dict[ReportPlace, int] = {}
        self._checks: list[str] = []
        self._parts: list[VerdictColumns] = []
        self._frames: list[tuple[str, ReportFrames | None]] = []
        self._clips: list[ClipVerdict] = []
        self._stills: list[Sequence[Still]] = []
        self._drawn = 0
        self._listed: list[tuple[int, PostureReport]] = []
        self._all_listed = True
        self._people = PeopleTold()
        self._not_asked: dict[str, Counter[str]] = {}
        self._said: Counter[str] = Counter()
        self._told: dict[str, Any] = {}
        self.count = 0
        self.own = False

    def add(
        self,
        validator: Validator,
        postures: Postures | HeldPostures | NamedConfigurations,
        *,
        file: str = "",
        sequence: NDArray[np.intp] | None = None,
        own: bool = False,
    ) -> None:
        """Judge a file.

        Parameters
        ----------
        validator : Validator
            What judges.
        postures : Postures, HeldPostures or NamedConfigurations
            What is judged; frames in time by the checks over time, too.
        file : str
            What reports call it.
        sequence : int array (N,), optional
            Which sequence in time each posture belongs to: see `Validator.check`.
        own : bool
            Whether it is judged by a body of its own, as results are.

        Raises
        ------
        InputError
            Where the validator cannot judge it; nothing is then kept of it.
        """
        given = _given(validator, postures)
        known = dict(self._places)
        checks = list(self._checks)
        try:
            self._add(validator, given, file, sequence)
        except BaseException:
            self._places, self._checks = known, checks
            raise
        self.own |= own

    def _add(self, validator: Validator, given: _Given, file: str, sequence: NDArray[np.intp] | None) -> None:
        applied = [name for name in validator.checks if given.q is None or name not in OF_POSITIONS]
        self._register(applied)
        if self._all_listed and self.count + len(given) > MAX_LISTED:
            self._all_listed = False
            self._listed = [one for one in self._listed if one[1].verdict != "valid"][:MAX_LISTED]
        frames = None if given.held is None else frames_of(given.held, file)
        over_time = given.held is not None and given.held.in_time and bool(validator.profile.checks)
        parts: list[VerdictColumns] = []
        order: list[NDArray[np.intp]] = []
        listed: list[tuple[int, PostureReport]] = []
        room = math.inf if self._all_listed else MAX_LISTED - len(self._listed)
        people, not_asked = PeopleTold(), Counter[tuple[str, str]]()
        if given.joints is None:
            recordings = [Recording(np.arange(len(given)), None)]
        else:  # scaling a robot takes a second: it has the lengths of the whole file
            clip = None if given.held is None or validator.robot is not None else given.held.clip
            recordings = recordings_of(given.joints, clip)
        for rows, person in recordings:
            judgements: Sequence[Judgement] = ()
            if over_time and given.held is not None:
                judgements = self._over_time(validator, given.held, rows, not_asked)
            for part, of_postures in _batches(validator, given, sequence, Recording(rows, person)):
                verdicts = of_postures.joined([one.of(part) for one in judgements])
                at = rows[part]
                columns, shown = self._judged(verdicts, room - len(listed))
                listed += [(int(at[k]), one) for k, one in shown]
                parts.append(columns)
                order.append(at)
            if person is not None:
                people.add(validator, person)
        columns = in_order(joined(parts, list(self._places), self._checks), order)
        self._keep(columns, frames, file, given.held)
        self._listed += sorted(
            ((self.count + row, self._placed(one, row, frames)) for row, one in listed),
            key=lambda one: one[0],
        )
        self.count += len(columns)
        self._people.join(people)
        for (name, reason), count in not_asked.items():
            self._not_asked.setdefault(name, Counter())[reason] += count
        self._said.update(() if given.held is None else given.held.said)
        self._told = self._told or {
            **validator.describe(),
            "checks": [],
            **validator.settings.told(),
            **_lengths_told(validator, given),
        }

    def _register(self, checks: Sequence[str]) -> None:
        """Know the names of checks, in the order in which they come."""
        self._checks += [name for one in checks if (name := one.replace("-", "_")) not in self._checks]

    def _over_time(
        self,
        validator: Validator,
        held: HeldPostures,
        rows: NDArray[np.intp],
        not_asked: Counter[tuple[str, str]],
    ) -> Sequence[Judgement]:
        """Ask the checks over time about the clips of a recording; a row each of its postures."""
        found: list[tuple[NDArray[np.intp], Judgement]] = []
        clip = held.clip[rows]
        for which in np.unique(clip).tolist():
            at = np.flatnonzero(clip == which)
            verdict = judge_motion(validator.profile.checks, clip_of(held, rows[at], validator))
            found += [(at, one) for one in verdict.judgements]
            not_asked.update(verdict.not_asked.items())
        self._register([one.check for _, one in found])
        return [_spread(one, at, len(rows)) for at, one in found]

    def _judged(
        self, verdicts: Verdicts, room: float
    ) -> tuple[VerdictColumns, list[tuple[int, PostureReport]]]:
        """Put a batch in columns, and list those of its postures that are to be listed."""
        wanted = self._wanted
        contacts = _contacts(verdicts, wanted.distances, every=wanted.detail != "verdicts")
        columns = columns_of(
            verdicts, contacts, self._places, self._checks, margins=wanted.detail != "verdicts"
        )
        if wanted.detail != "findings" or not room:
            return columns, []
        rows = np.arange(len(columns)) if self._all_listed else np.flatnonzero(columns.verdict)[: int(room)]
        made = list_postures(
            verdicts, contacts, columns, list(self._places), rows, every=wanted.every, first=None
        )
        return columns, list(zip(rows.tolist(), made, strict=True))

    def _keep(
        self, columns: VerdictColumns, frames: ReportFrames | None, file: str, held: HeldPostures | None
    ) -> None:
        """Keep a file's columns, and the verdicts on its clips."""
        if frames is None:
            clips: tuple[ClipVerdict, ...] = clip_verdicts(columns, _unordered(file, len(columns)), of=1)
        else:
            clips = clip_verdicts(columns, frames, of=max(self._wanted.files, len(frames.clips)))
        drawn = held is not None and frames is not None and frames.in_time
        stills = stills_of(clips, held) if held is not None and drawn else ((),) * len(clips)
        self._stills += stills
        self._clips += clips
        self._drawn += sum(map(bool, stills))
        if self._drawn > 2 * MOST_DRAWN_CLIPS:
            self._stills = worst_stills(self._clips, self._stills)
            self._drawn = MOST_DRAWN_CLIPS
        self._parts.append(columns)
        self._frames.append((file, frames))

    def _placed(self, posture: PostureReport, row: int, frames: ReportFrames | None) -> PostureReport:
        """Say of a listed posture which frame of which clip it is."""
        if frames is None:
            return posture
        time, first = float(frames.time[row]), len(self._clips) - len(frames.clips)
        return replace(
            posture,
            clip=first + int(frames.clip[row]) if frames.in_time else None,
            frame=int(frames.frame[row]),
            time=time if math.isfinite(time) else None,
        )

    def report(self, settings: Mapping[str, Any] | None = None) -> ValidationReport:
        """Return the report on all that was judged.

        Parameters
        ----------
        settings : mapping, optional
            What else is to be written of what decided the verdicts.
        """
        checks = self._checks
        last = {name.replace("-", "_"): k for k, name in enumerate(MOTION_CHECKS)}
        shown = sorted(checks, key=lambda name: last.get(name, -1))
        columns = replace(joined(self._parts, list(self._places), checks), checks=tuple(checks))
        wanted, all_listed = self._wanted, self._all_listed
        told = {
            **self._told,
            "checks": [name.replace("_", "-") for name in shown],
            **self._people.told(),
            **({"recognised": list(self._recognised())} if self._said else {}),
            **(
                {"not_asked": {name: dict(why) for name, why in self._not_asked.items()}}
                if self._not_asked
                else {}
            ),
            **({"files": len(self._frames)} if len(self._frames) > 1 else {}),
            **(settings or {}),
        }
        why = why_most_fail(columns, told)
        not_valid = len(columns) - columns.summary["valid"]
        frames, in_time = self._all_frames()
        counts = columns.by_check()
        return ValidationReport(
            settings={**told, **({"why": why} if why else {})},
            postures=tuple(one if all_listed else replace(one, index=row) for row, one in self._listed),
            checks={name: counts[name] for name in shown},
            listed=None
            if all_listed or wanted.detail != "findings"
            else f"the first {len(self._listed)} of {not_valid} that are not valid",
            verdicts=None if all_listed and wanted.detail == "findings" else columns.letters,
            columns=columns,
            frames=frames,
            clips=tuple(self._clips) if in_time else None,
            stills=tuple(self._stills) if in_time else (),
        )

    def _recognised(self) -> Iterator[str]:
        """Say what was recognised, each sentence once, with how many files it is of."""
        for sentence, count in self._said.most_common(MAX_SAID):
            yield sentence if len(self._frames) == 1 else f"{count} of {len(self._frames)} files: {sentence}"

    def _all_frames(self) -> tuple[ReportFrames | None, bool]:
        """Say which frame each posture is, and whether there are verdicts on clips: of one file where it has some."""
        if len(self._frames) == 1:
            frames = self._frames[0][1]
            return frames, frames is not None and frames.in_time
        parts = [
            _unordered(file, len(part)) if frames is None else frames
            for (file, frames), part in zip(self._frames, self._parts, strict=True)
        ]
        return (joined_frames(parts), True) if parts else (None, False)


def validate_postures(
    validator: Validator,
    postures: Postures | HeldPostures | NamedConfigurations,
    *,
    settings: Mapping[str, Any] | None = None,
    every: bool = False,
    sequence: NDArray[np.intp] | None = None,
    distances: bool | None = None,
    detail: Detail = "findings",
    file: str = "",
) -> ValidationReport:
    """Judge the postures of one file.

    Parameters
    ----------
    validator : Validator
        What judges, with its settings.
    postures : Postures, HeldPostures or NamedConfigurations
        What is judged; frames in time by the checks over time, too.
    settings : dict, optional
        What else is to be written of what decided the verdicts: the settings of the validator are.
    every, distances, detail
        As `WantedDetail` has them.
    sequence : int array (N,), optional
        Which sequence in time each posture belongs to: see `Validator.check`.
    file : str
        What reports call the file that they are of.

    Returns
    -------
    posekit.formats.own.ValidationReport
    """
    built = ReportBuilder(WantedDetail(detail=detail, every=every, distances=distances))
    built.add(validator, postures, file=file, sequence=sequence)
    return built.report(settings)


def _unordered(file: str, count: int) -> ReportFrames:
    """Take the postures of a file that knows no frames for one clip, whose order means nothing."""
    return ReportFrames(
        clips=[ClipName(file, "")],
        clip=np.zeros(count, dtype=np.intp),
        frame=np.arange(count),
        time=np.full(count, np.nan),
        in_time=False,
    )


def _given(validator: Validator, postures: Postures | HeldPostures | NamedConfigurations) -> _Given:
    """Lay out what is to be judged."""
    if isinstance(postures, NamedConfigurations):
        if not len(postures.time):
            return _Given(joints=None, head=None, q=_ordered(validator, postures), held=None)
        postures = placed(validator, postures)
    if isinstance(postures, HeldPostures):
        own = postures.postures
        if postures.q.shape[1] == len(validator.configuration_names):
            return _Given(joints=None, head=None, q=postures.q, held=postures)
        return _Given(joints=own.joints, head=own.head, q=None, held=postures)
    return _Given(joints=postures.joints, head=postures.head, q=None, held=None)


def _batches(
    validator: Validator, given: _Given, sequence: NDArray[np.intp] | None, recording: Recording
) -> Iterator[tuple[slice, Verdicts]]:
    """Judge a recording batch by batch: which of its rows, and the verdicts; lengths and noise are those of all."""
    rows, person = recording
    size = POSTURES_AT_ONCE * (CONFIGURATIONS_FACTOR if given.q is not None else 1)
    for first in range(0, len(rows), size):
        part = slice(first, min(first + size, len(rows)))
        at = rows[part]
        if given.q is not None:
            yield part, validator.check(q=given.q[at])
        elif given.joints is not None and person is not None:
            head = None if given.head is None else given.head[at]
            which = None if sequence is None else sequence[at]
            yield part, validator.check(given.joints[at], head, sequence=which, person=person)


def _ordered(validator: Validator, given: NamedConfigurations) -> NDArray[np.float64]:
    """Return q in the validator's order; as it is where that is the file's."""
    names = validator.configuration_names
    if given.q.shape[1] == len(names) and given.names in (None, tuple(names)):
        return given.q
    return given.in_order_of(names)


def _spread(judgement: Judgement, at: NDArray[np.intp], count: int) -> Judgement:
    """Lay what is said of some postures over all; of others nothing is said."""
    if len(at) == count:
        return judgement
    numbers: dict[str, Any] = {
        name: np.full((count, len(judgement.where)), np.nan) for name in ("value", "lower", "upper", "margin")
    }
    violated = np.zeros((count, len(judgement.where)), dtype=np.bool_)
    for name, array in numbers.items():
        array[at] = getattr(judgement, name)
    violated[at] = judgement.violated
    return replace(judgement, violated=violated, **numbers)


def _lengths_told(validator: Validator, given: _Given) -> dict[str, Any]:
    """Say what was given, and whose lengths the model had."""
    if given.joints is None:
        return {"given": "configurations"}
    return {"given": "joint positions", "lengths_from": validator.lengths}


def _contacts(verdicts: Verdicts, distances: bool | None, *, every: bool) -> Contacts | None:
    """Ask which bodies touch, of a robot; a figure's own check has said it pair by pair.

    The nearest pair is asked for of `every` posture, or of those alone that are undecided: what is rejected has a
    margin below zero anyway, and nothing is shown of what is valid.
    """
    if not verdicts.colliders:
        return None
    if distances is None:
        distances = not any(collider.has_meshes for collider in verdicts.colliders)
    return verdicts.contacts(nearest=distances if every else verdicts.undecided & distances)
