"""Verdicts file after file: in columns, clip by clip and in batches, so that memory holds one clip's findings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.display.plural import plural
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import NamedConfigurations, Postures, ValidationReport
from posekit.formats.own.report import PostureReport
from posekit.formats.own.report_clips import ClipVerdict, Still
from posekit.formats.own.report_columns import ReportPlace, VerdictColumns, joined
from posekit.formats.own.report_frames import ClipName, ReportFrames, joined_frames
from posekit.validation.advice import why_most_fail
from posekit.validation.batches import (
    POSTURES_AT_ONCE,
    FileJob,
    judged_parts,
    postures_given,
    recordings_given,
)
from posekit.validation.over_time import frames_of, judged_over_time, left_to_strides
from posekit.validation.people import PeopleTold
from posekit.validation.spans import clip_verdicts
from posekit.validation.stills import MOST_DRAWN_CLIPS, stills_of, worst_stills
from posekit.validation.validate_columns import columns_of, in_order
from posekit.validation.validate_listing import list_postures
from posekit.validators import Report as Verdicts
from posekit.validators import Validator
from posekit.validators.given_points import refuse_far
from posekit.validators.motion.registry import MOTION_CHECKS
from posekit.validators.robot import Contacts
from posekit.validators.robot.settings import OF_POSITIONS

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


class _FileVerdicts(NamedTuple):
    """What is found in a file: columns part by part, which postures they are of, and those that are listed."""

    parts: list[VerdictColumns]
    order: list[NDArray[np.intp]]
    listed: list[tuple[int, PostureReport]]


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
        self._waiting: list[FileJob] = []
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
        given = postures_given(validator, postures)
        job = FileJob(validator=validator, given=given, file=file, sequence=sequence)
        job.recordings = recordings_given(validator, given)
        if given.held is not None and given.held.in_time:
            job.over_time, job.not_asked = judged_over_time(given.held, job.recordings, validator)
        self.own |= own
        if given.held is None and isinstance(postures, NamedConfigurations):
            self._said.update(postures.said)
        if not job.groups:  # its configurations may be none of the robot's
            self._judge_waiting()
            self._judge([job])
            return
        refuse_far(given.joints)
        self._waiting.append(job)
        if sum(len(one.given) for one in self._waiting) >= POSTURES_AT_ONCE:
            self._judge_waiting()

    @property
    def empty(self) -> bool:
        """Whether nothing was given yet."""
        return not self.count and not self._waiting

    def _judge_waiting(self) -> None:
        """Judge the files that wait for others of their people."""
        waiting, self._waiting = self._waiting, []
        if waiting:
            self._judge(waiting)

    def _judge(self, jobs: Sequence[FileJob]) -> None:
        """Judge files together, and keep their verdicts one after the other."""
        for job in jobs:
            q = job.given.q is not None
            self._register([name for name in job.validator.checks if not q or name not in OF_POSITIONS])
        for job in jobs:
            self._register([one.check for judgements in job.over_time for one in judgements])
        if self._all_listed and self.count + sum(len(job.given) for job in jobs) > MAX_LISTED:
            self._all_listed = False
            self._listed = [one for one in self._listed if one[1].verdict != "valid"]
        found = {id(job): _FileVerdicts([], [], []) for job in jobs}
        for judged in judged_parts(jobs, configured=self._wanted.detail != "verdicts"):
            mine = found[id(judged.job)]
            over_time = judged.job.over_time
            judgements = over_time[judged.recording] if over_time else ()
            later = [one.of(judged.part) for one in judgements]
            verdicts = left_to_strides(judged.verdicts, later).joined(later)
            columns, shown = self._judged(verdicts, MAX_LISTED - len(self._listed) - len(mine.listed))
            mine.listed.extend((int(judged.rows[k]), one) for k, one in shown)
            mine.parts.append(columns)
            mine.order.append(judged.rows)
        for job in jobs:
            self._keep(job, found[id(job)])

    def _keep(self, job: FileJob, found: _FileVerdicts) -> None:
        """Keep a file's verdicts."""
        columns = in_order(joined(found.parts, list(self._places), self._checks), found.order)
        held = job.given.held
        frames = None if held is None else frames_of(held, job.file)
        self._keep_clips(columns, frames, job.file, held)
        listed = sorted(found.listed, key=lambda one: one[0])[: max(MAX_LISTED - len(self._listed), 0)]
        self._listed += [(self.count + row, self._placed(one, row, frames)) for row, one in listed]
        self.count += len(columns)
        for (_, person), told in zip(job.recordings, job.told, strict=True):
            if person is not None and told is not None:
                self._people.add(person if job.validator.lengths == "median" else None, told)
        for name, reason in job.not_asked:
            self._not_asked.setdefault(name, Counter())[reason] += 1
        self._said.update(() if held is None else held.said)
        self._told = self._told or {
            **job.validator.describe(),
            "checks": [],
            **job.validator.settings.told(),
            **_lengths_told(job),
        }

    def _register(self, checks: Sequence[str]) -> None:
        """Know the names of checks, in the order in which they come."""
        self._checks += [
            name for one in dict.fromkeys(checks) if (name := one.replace("-", "_")) not in self._checks
        ]

    def _judged(
        self, verdicts: Verdicts, room: int
    ) -> tuple[VerdictColumns, list[tuple[int, PostureReport]]]:
        """Put a batch in columns, and list those of its postures that are to be listed."""
        wanted = self._wanted
        contacts = _contacts(verdicts, wanted.distances, every=wanted.detail != "verdicts")
        columns = columns_of(
            verdicts, contacts, self._places, self._checks, margins=wanted.detail != "verdicts"
        )
        if wanted.detail != "findings" or room <= 0:
            return columns, []
        rows = np.arange(len(columns)) if self._all_listed else np.flatnonzero(columns.verdict)[:room]
        made = list_postures(
            verdicts, contacts, columns, list(self._places), rows, every=wanted.every, first=None
        )
        return columns, list(zip(rows.tolist(), made, strict=True))

    def _keep_clips(
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
        self._judge_waiting()
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
            yield (
                sentence
                if len(self._frames) == 1
                else f"{count} of {plural(len(self._frames), 'file')}: {sentence}"
            )

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


def _lengths_told(job: FileJob) -> dict[str, Any]:
    """Say what was given, and whose lengths the model had."""
    if job.given.joints is None:
        return {"given": "configurations"}
    return {"given": "joint positions", "lengths_from": job.validator.lengths}


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
