"""From postures, of any number, to a report of verdicts: in batches, with bounded memory."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, load_figure
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import Postures, Result, ValidationReport
from posekit.formats.own.postures_q import NamedConfigurations
from posekit.formats.own.report import PostureReport
from posekit.formats.own.report_columns import ReportPlace, VerdictColumns, joined
from posekit.formats.own.report_frames import ReportFrames
from posekit.recovery.judged import tolerances_of
from posekit.safe_io.refusal import refusal
from posekit.settings import EXACT_TOLERANCE, RIGID_TOLERANCE, ValidateSettings
from posekit.validation.advice import why_most_fail
from posekit.validation.over_time import OverTime, frames_of, judged_over_time
from posekit.validation.people import PersonRows, batches, people_of, told_of_people
from posekit.validation.robot_motion import placed
from posekit.validation.spans import clip_verdicts
from posekit.validation.stills import stills_of
from posekit.validation.validate_columns import columns_of
from posekit.validation.validate_listing import list_postures
from posekit.validators import Report as Verdicts
from posekit.validators import Validator
from posekit.validators.ranges import NAMED_TABLES
from posekit.validators.robot import Contacts
from posekit.validators.robot.settings import OF_POSITIONS
from posekit.validators.walking import THRESHOLDS_BY_WALKERS

POSTURES_AT_ONCE: Final = 4096
"""Postures that are judged at once."""

CONFIGURATIONS_FACTOR: Final = 4
"""Times as many configurations, which need no search: the fewer calls, the less time is lost between threads."""

SHORTEST_LIMB_METRES: Final = 0.2
"""Metres: by it what positions are off becomes what angles are off."""

MAX_LISTED: Final = 10_000
"""Postures that a report lists one by one: all of a file that has no more, else the first that are not valid."""

Detail = Literal["findings", "margins", "verdicts"]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Given:
    """What is to be judged: postures, or configurations in the validator's order."""

    joints: NDArray[np.float64] | None
    head: NDArray[np.float64] | None
    q: NDArray[np.float64] | None
    sequence: NDArray[np.intp] | None

    def __len__(self) -> int:
        return len(self.q) if self.q is not None else len(self.joints) if self.joints is not None else 0


def validate(
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
    """Judge a file of postures.

    Parameters
    ----------
    validator : Validator
        What judges, with its settings.
    postures : Postures, HeldPostures or NamedConfigurations
        What is judged; frames in time by the checks over time, too.
    settings : dict, optional
        What else is to be written of what decided the verdicts: the settings of the validator are.
    every : bool
        List every finding, not only violations and each check's worst.
    sequence : int array (N,), optional
        Which sequence in time each posture belongs to: see `Validator.check`.
    distances : bool, optional
        Whether to measure the nearest pair of bodies of every posture of a robot that `detail` shows; by default
        where none is a mesh. Of those that collide it is measured in any case.
    detail : {"findings", "margins", "verdicts"}
        What is wanted of the postures: findings one by one, as JSON has them; the least margin of each, as CSV; or
        the verdicts alone, with what is behind those that are not valid, as summaries and Markdown have them.
    file : str
        What reports call the file that they are of.

    Returns
    -------
    posekit.formats.own.ValidationReport
    """
    over_time, frames, clip, held = OverTime(), None, None, None
    if isinstance(postures, HeldPostures):
        held, clip = postures, postures.clip
        frames = frames_of(postures, file)
        if postures.in_time and validator.profile.checks:
            over_time = judged_over_time(postures, validator.profile.checks, validator.settings)
        postures = postures.postures
    if isinstance(postures, NamedConfigurations):
        if len(postures.time):
            held = placed(validator, postures)
            frames, clip = frames_of(held, file), held.clip
            over_time = judged_over_time(
                held,
                validator.profile.checks,
                validator.settings,
                model=validator.robot and validator.robot.model,
            )
        given = _Given(joints=None, head=None, q=_ordered(validator, postures), sequence=None)
    else:
        given = _Given(joints=postures.joints, head=postures.head, q=None, sequence=sequence)
    applied = [name for name in validator.checks if given.q is None or name not in OF_POSITIONS]
    applied += [one.check.replace("_", "-") for one in over_time.judgements]
    checks = [name.replace("-", "_") for name in applied]
    places: dict[ReportPlace, int] = {}
    parts: list[VerdictColumns] = []
    listed: list[PostureReport] = []
    all_listed = len(given) <= MAX_LISTED
    if given.joints is None:
        people = [PersonRows(slice(0, len(given)), None)]
    else:  # scaling a robot takes a second: it has the lengths of the whole file
        people = people_of(given.joints, clip if validator.robot is None else None)
    for first, of_postures in _batches(validator, given, people):
        rows = slice(first, first + len(of_postures.complete))
        verdicts = of_postures.joined([one.of(rows) for one in over_time.judgements])
        contacts = _contacts(verdicts, distances, every=detail != "verdicts")
        columns = columns_of(verdicts, contacts, places, checks, margins=detail != "verdicts")
        parts.append(columns)
        if detail != "findings" or (not all_listed and len(listed) == MAX_LISTED):
            continue
        shown = (
            np.arange(len(columns))
            if all_listed
            else np.flatnonzero(columns.verdict)[: MAX_LISTED - len(listed)]
        )
        listed += list_postures(
            verdicts, contacts, columns, list(places), shown, every=every, first=None if all_listed else first
        )
    columns = joined(parts, list(places), checks)
    if frames is not None:
        listed = [_placed(posture, k, frames) for k, posture in enumerate(listed)]
    clips = clip_verdicts(columns, frames) if frames is not None and frames.in_time else None
    not_valid = len(columns) - columns.summary["valid"]
    told = {
        **validator.describe(),
        "checks": applied,
        **validator.settings.told(),
        **_people_told(validator, given, people),
        **({"not_asked": over_time.not_asked} if over_time.not_asked else {}),
        **(settings or {}),
    }
    why = why_most_fail(columns, told)
    return ValidationReport(
        settings={**told, **({"why": why} if why else {})},
        postures=tuple(listed),
        checks=columns.by_check(),
        listed=None
        if all_listed or detail != "findings"
        else f"the first {len(listed)} of {not_valid} that are not valid",
        verdicts=None if all_listed and detail == "findings" else columns.letters,
        columns=columns,
        frames=frames,
        clips=clips,
        stills=stills_of(clips, held) if clips and held is not None else (),
    )


def _placed(posture: PostureReport, row: int, frames: ReportFrames) -> PostureReport:
    """Say of a listed posture which frame it is."""
    row = row if posture.index is None else posture.index
    time = float(frames.time[row])
    return replace(
        posture,
        clip=int(frames.clip[row]) if frames.in_time else None,
        frame=int(frames.frame[row]),
        time=time if math.isfinite(time) else None,
    )


class RecoveredWith(NamedTuple):
    """Whose postures a result holds, and settings that judge them by what they were recovered with.

    Of several kinds of frames, by what allowed most; and no more strictly than is usual.
    """

    figure: Figure
    settings: ValidateSettings


def recovered_with(result: Result) -> RecoveredWith:
    """Return what a result was recovered with, by its settings.

    Where they are mute, it is taken as the built-in figure's, exact, and by the paper.

    Raises
    ------
    InputError
        Where the settings say what is no tolerance, margin or name.
    """
    figure, settings = load_figure(), result.settings
    lengths = settings.get("lengths")
    if isinstance(lengths, dict) and settings.get("figure") != figure.hash:
        behind = _number(settings, "shoulder_offset", 0.0) < 0
        figure = figure.scaled({str(name): float(length) for name, length in lengths.items()}, behind=behind)
    # Results of earlier versions, which are mute of it, did not ask for the side.
    if settings.get("shoulders", "undecided" if isinstance(lengths, dict) else "") == "undecided":
        figure = replace(figure, side_known=False)
    return RecoveredWith(figure, _judged(settings, result.decimals))


def _judged(settings: Mapping[str, Any], decimals: int | None) -> ValidateSettings:
    """Return what frames were judged with, and by how much what a file says of them is off."""
    judged = settings.get("judged")
    kinds = {kind for kind in judged if isinstance(kind, str)} if isinstance(judged, list) else set()
    asked = _number(settings, "contact_margin", 0.0)
    rigid, angles, margins = [RIGID_TOLERANCE], [EXACT_TOLERANCE.angle], [asked]
    for kind, said in tolerances_of(settings).items():
        if kind in kinds:
            within = "tolerance." if kind == "given" else f"{kind}."
            rigid.append(_number(said, "rigid", RIGID_TOLERANCE, within=within))
            angles.append(_number(said, "angle", EXACT_TOLERANCE.angle, within=within))
            margins.append(_number(said, "contact", asked, within=within))
    if decimals is not None:  # what was rounded may be off by that
        step = math.sqrt(3) * 10.0**-decimals
        rigid, margins = [max(rigid) + step], [min(margins) - step]
        angles = [max(angles) + math.degrees(2 * step / SHORTEST_LIMB_METRES)]
    walkers, ranges = settings.get("walkers", "paper"), settings.get("ranges")
    if not (isinstance(walkers, str) and walkers in THRESHOLDS_BY_WALKERS):
        raise refusal(
            "result",
            "settings.walkers",
            repr(walkers)[:40],
            " or ".join(THRESHOLDS_BY_WALKERS),
            "correct what made the result",
        )
    return ValidateSettings(
        rigid_tolerance=max(rigid),
        angle_tolerance=max(angles),
        contact_margin=min(margins),
        noise=0.0,
        lengths="model",
        walkers=walkers,
        **({"ranges": ranges} if ranges in ("urdf", *NAMED_TABLES) else {}),
    )


def _number(settings: Mapping[str, Any], name: str, default: float, *, within: str = "") -> float:
    """Return a number of a result's settings, or refuse what is none."""
    value = settings.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise refusal(
            "result",
            f"settings.{within}{name}",
            repr(value)[:40],
            "a finite number",
            "correct what made the result",
        )
    return float(value)


def _batches(
    validator: Validator, given: _Given, people: Sequence[PersonRows]
) -> Iterator[tuple[int, Verdicts]]:
    """Judge batch by batch; lengths and noise are those of the whole recording."""
    size = POSTURES_AT_ONCE * (CONFIGURATIONS_FACTOR if given.q is not None else 1)
    for rows, person in batches(people, size):
        if given.q is not None:
            yield rows.start, validator.check(q=given.q[rows])
        elif given.joints is not None and person is not None:
            head = None if given.head is None else given.head[rows]
            which = None if given.sequence is None else given.sequence[rows]
            yield rows.start, validator.check(given.joints[rows], head, sequence=which, person=person)


def _ordered(validator: Validator, given: NamedConfigurations) -> NDArray[np.float64]:
    """Return q in the validator's order; as it is where that is the file's."""
    names = validator.configuration_names
    if given.q.shape[1] == len(names) and given.names in (None, tuple(names)):
        return given.q
    return given.in_order_of(names)


def _people_told(validator: Validator, given: _Given, people: Sequence[PersonRows]) -> dict[str, Any]:
    """Say whose lengths the model had, and what was allowed."""
    if given.joints is None:
        return {"given": "configurations"}
    return {
        "given": "joint positions",
        "lengths_from": validator.lengths,
        **told_of_people(validator, people),
    }


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
