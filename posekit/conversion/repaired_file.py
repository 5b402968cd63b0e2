"""What a file holds, repaired and written: as motion in its own format, as postures, as configurations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, load_figure
from posekit.body.measured import figure_of, measured_person
from posekit.conversion.judged_again import as_read_again, judged_again, records_judged
from posekit.conversion.motion_output import (
    EVENLY_TIMED,
    TABLE_FORMATS,
    MotionOutput,
    by_suffix,
    carries_points,
    write_moving,
    write_points,
)
from posekit.display.plural import plural
from posekit.errors import InputError, PosekitError
from posekit.formats import own as files
from posekit.formats.format import Content
from posekit.formats.held_postures import POSTURE_CONTENTS, HeldPostures
from posekit.formats.motion import Motion
from posekit.formats.own import Postures
from posekit.formats.own.postures_q import NamedConfigurations, write_configurations
from posekit.formats.recognising import recognise
from posekit.geometry import Array
from posekit.recovery.result_sequence import ASSUMED_RATE, PostureSequence
from posekit.remedy import Repaired, repair, repair_configurations
from posekit.safe_io import refusal
from posekit.safe_io.writing import check_target, make_folder, safe_stem
from posekit.skeleton import FEET_POINTS, POINTS
from posekit.validation.files import STICK_FIGURE_NAME, AskedValidation
from posekit.validation.keep import names_below
from posekit.validation.over_time import clip_of
from posekit.validation.reading import ReadPostures, read_postures_of
from posekit.validators import Validator

POSTURES_OF_A_ROBOT: Final = (
    "--repair: postures are repaired as the stick figure's; expected configurations of the robot; "
    "leave out --urdf"
)

MOST_TOLD: Final = 10
"""Clips of which it is said what was changed in them; of more how many there are."""

MORE_ROUNDS: Final = 2
"""How often what a fresh validation of the written file rejects is repaired once more."""

FOLDER_FORMAT: Final = ".npz"
"""What clips of a folder are written as where their own format cannot be written."""


@dataclass(frozen=True, kw_only=True)
class RepairedClip:
    """One clip of a file, repaired.

    Parameters
    ----------
    name : str
        Of the clip; that of the file where it has none.
    held : HeldPostures
        Its frames with the repaired joints.
    repaired : Repaired
        The record.
    """

    name: str
    held: HeldPostures
    repaired: Repaired


@dataclass(frozen=True, kw_only=True)
class RepairedFile:
    """What was made of one file.

    Parameters
    ----------
    lines : sequence of str
        What was changed, what is left and where it was written, for people.
    records : sequence of dict
        Of each clip, for the report.
    """

    lines: Sequence[str]
    records: Sequence[dict[str, Any]]


def check_repair_target(target: Path, clips: int) -> None:
    """Refuse a name before the work is done: of several clips a folder, or a format that carries several.

    Raises
    ------
    InputError
        Where it cannot be written.
    """
    if not target.suffix:
        return
    check_target(target)
    several = (*(f".{one}" for one in TABLE_FORMATS), ".json")
    if clips > 1 and target.suffix.lower() not in several:
        raise refusal(
            target,
            "--repair",
            f"a file, of {clips} clips",
            f"a folder, or {', '.join(several)}",
            "name it so",
        )


def repair_targets(paths: Sequence[Path], target: Path) -> list[Path]:
    """Say where each file's repair goes: of one to the target, of several to folders below it, named like the files.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    target : Path
        A file; or, without suffix, a folder: of several files, and of several clips.

    Raises
    ------
    InputError
        Where several files are to go to one, or a file to where one of them is.
    """
    if target.suffix:
        if len(paths) > 1:
            got = f"a file, of {len(paths)} files"
            raise refusal(target, "--repair", got, "a folder", "give a name without suffix")
        check_target(target)
    if len(paths) == 1:
        into = [target]
    else:
        below = names_below({str(path): path for path in paths})
        names = [below[str(path)].with_suffix("") for path in paths]
        # A name with a dot would be a file's.
        apart = _told_apart([name.with_name(name.name.replace(".", "_")).as_posix() for name in names])
        into = [target / name for name in apart]
    given = {path.resolve() for path in paths} | {path.resolve().parent for path in paths}
    for place in into:
        if place.resolve() in given:
            raise refusal(place, "--repair", "where a file is that is read", "another name", "choose one")
    return into


def check_repairable(paths: Sequence[Path], asked: AskedValidation) -> None:
    """Refuse postures that are to be judged as a robot's, before the work is done.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    asked : AskedValidation
        By what they are judged.

    Raises
    ------
    InputError
        Where a file holds postures, and the body is a robot.
    """
    if asked.urdf in ("", STICK_FIGURE_NAME):
        return
    for path in paths:
        try:
            holds = recognise(path).holds
        except PosekitError:  # it is said to be broken when it is read
            continue
        if holds in POSTURE_CONTENTS and holds is not Content.CONFIGURATIONS:
            raise InputError(f"{path}: {POSTURES_OF_A_ROBOT}")


def repair_files(paths: Sequence[Path], asked: AskedValidation, target: Path) -> Iterator[RepairedFile]:
    """Repair what files hold, each with the validator that judges it; those that are broken are passed over.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    asked : AskedValidation
        By what they are judged.
    target : Path
        As `repair_targets` has it.

    Raises
    ------
    InputError
        Where several files are to go to one, or it cannot be written.
    """
    for path, into in zip(paths, repair_targets(paths, target), strict=True):
        try:
            read = read_postures_of(path, asked.stated)
        except PosekitError:
            if len(paths) == 1:
                raise
            continue
        yield repair_file(read, asked, into, path)


def repair_file(read: ReadPostures, asked: AskedValidation, target: Path, source: Path) -> RepairedFile:
    """Repair what a file holds, write it, and judge what was written as a fresh validation does.

    What that still rejects is repaired once more, since lengths and noise are then measured anew; what is left after it
    is said.

    Parameters
    ----------
    read : ReadPostures
        What the file holds.
    asked : AskedValidation
        What must pass.
    target : Path
        A file, or without suffix a folder with a file a clip.
    source : Path
        The file that was read: its format is kept in a folder where it can be written.

    Raises
    ------
    InputError
        Where a robot is given postures, or the target cannot be written.
    """
    given, validator = read.postures, asked.validator(read)
    if isinstance(given, NamedConfigurations):
        path = target if target.suffix else target / f"{source.stem}{FOLDER_FORMAT}"
        done = _repaired_configurations(given, validator, path, asked)
        again = f"judged again, {int(done.valid.sum())} of {len(done.valid)} frames are valid"
        said = (f"repaired: {source.name}: {done.told()}", f"written: {path}; {again}")
        return RepairedFile(lines=said, records=[_record(source, path, "", done)])
    if validator.robot is not None:
        raise InputError(POSTURES_OF_A_ROBOT)
    clips = list(repaired_clips(given, validator, source))
    check_repair_target(target, len(clips))
    written = [(path, _settled(path, some, asked)) for path, some in _targets(target, source, clips)]
    clips = [clip for _, some in written for clip in some]
    changed = [clip for clip in clips if clip.repaired.spans or not clip.repaired.valid.all()]
    lines = [f"repaired: {clip.name}: {clip.repaired.told()}" for clip in changed[:MOST_TOLD]]
    more = len(changed) - MOST_TOLD
    also = f"; {more} more changed" if more > 0 else ""
    frames = sum(len(clip.repaired.valid) for clip in clips)
    valid = sum(int(clip.repaired.valid.sum()) for clip in clips)
    again = f"judged again, {valid} of {frames} frames are valid"
    count = sum(bool(clip.repaired.spans) for clip in clips)
    lines.append(f"written: {target}, {count} of {plural(len(clips), 'clip')} changed{also}; {again}")
    records = [_record(source, path, clip.name, clip.repaired) for path, some in written for clip in some]
    return RepairedFile(lines=lines, records=records)


def _record(source: Path, path: Path, clip: str, done: Repaired) -> dict[str, Any]:
    name = "" if clip == source.name else clip
    return {"file": str(source), "written": str(path), "clip": name, **done.as_dict()}


def _repaired_configurations(
    given: NamedConfigurations, validator: Validator, path: Path, asked: AskedValidation
) -> Repaired:
    done = repair_configurations(given.in_order_of(validator.configuration_names), validator)
    make_folder(path.parent)
    q = given.q if done.q is None else done.q
    write_configurations(path, q, validator.configuration_names, given.time)
    return next(records_judged([done], judged_again(path, asked)))


def _settled(path: Path, clips: list[RepairedClip], asked: AskedValidation) -> list[RepairedClip]:
    """Write clips, repair once more what a fresh validation of the file rejects, and let records say what is left."""
    _write(path, clips)
    report = judged_again(path, asked)
    for _ in range(MORE_ROUNDS):
        if not report.summary["invalid"]:
            break
        read = read_postures_of(path, as_read_again(asked).stated)
        if not isinstance(read.postures, HeldPostures):
            break
        validator = as_read_again(asked).validator(read)
        more = list(repaired_clips(read.postures, validator, path))
        if [len(clip.held) for clip in more] != [len(clip.held) for clip in clips]:
            break
        _write(path, more)
        there = judged_again(path, asked)
        if there.summary["invalid"] >= report.summary["invalid"]:
            _write(path, clips)
            break
        clips, report = [_after(*both) for both in zip(clips, more, strict=True)], there
    judged = records_judged([clip.repaired for clip in clips], report)
    return [replace(clip, repaired=record) for clip, record in zip(clips, judged, strict=True)]


def _after(first: RepairedClip, second: RepairedClip) -> RepairedClip:
    """Return the second repair of a clip, with the record of both."""
    spans = sorted((*first.repaired.spans, *second.repaired.spans), key=lambda span: -span.most)
    return replace(second, name=first.name, repaired=replace(second.repaired, spans=tuple(spans)))


def repaired_clips(given: HeldPostures, validator: Validator, source: Path) -> Iterator[RepairedClip]:
    """Repair each clip of a file; postures that are not in time, each by itself.

    Parameters
    ----------
    given : HeldPostures
        What the file holds.
    validator : Validator
        What must pass.
    source : Path
        The file: it names what has no name.
    """
    if not given.in_time:
        done = repair(given.postures.joints, validator, head=given.postures.head)
        yield RepairedClip(name=source.name, held=_with(given, np.arange(len(given)), done), repaired=done)
        return
    for index in np.unique(given.clip).tolist():
        rows = np.flatnonzero(given.clip == index)
        done = repair(clip_of(given, rows, validator), validator)
        name = (given.clips[index] if index < len(given.clips) else "") or source.name
        yield RepairedClip(name=name, held=_with(given, rows, done), repaired=done)


def _with(given: HeldPostures, rows: NDArray[np.intp], done: Repaired) -> HeldPostures:
    return HeldPostures(
        postures=Postures(joints=done.joints, head=done.head),
        frame=given.frame[rows],
        clip=np.zeros(len(rows), dtype=np.intp),
        time=given.time[rows] if done.time is None else done.time,
        up=given.up,
        unit=given.unit,
        feet=np.empty(0) if done.feet is None else done.feet,
    )


def _targets(
    target: Path, source: Path, clips: list[RepairedClip]
) -> Iterator[tuple[Path, list[RepairedClip]]]:
    """Name the files: one of all clips, or in a folder one of each."""
    if target.suffix:
        yield target, clips
        return
    try:
        by_suffix(source)
        suffix = source.suffix
    except InputError:
        suffix = FOLDER_FORMAT
    make_folder(target)
    stems = [safe_stem(source.stem if clip.name == source.name else clip.name) for clip in clips]
    for stem, clip in zip(_told_apart(stems), clips, strict=True):
        yield target / f"{stem}{suffix}", [clip]


def _told_apart(names: Sequence[str]) -> list[str]:
    """Append its number to each name that several have."""
    count = Counter(names)
    return [name if count[name] == 1 else f"{name}_{k}" for k, name in enumerate(names)]


def _write(path: Path, clips: list[RepairedClip]) -> None:
    joints = np.concatenate([clip.held.postures.joints for clip in clips])
    heads = [clip.held.postures.head for clip in clips]
    head = (
        None
        if any(one is None for one in heads)
        else np.concatenate([one for one in heads if one is not None])
    )
    in_time = all(clip.held.in_time for clip in clips)
    if path.suffix.lower() == ".json" or not in_time:
        files.write_postures(path, Postures(joints=joints, head=head))
        return
    to = by_suffix(path)
    unknown = np.full((len(joints), len(POINTS) - joints.shape[1], 3), np.nan)
    points = np.concatenate([joints, unknown if head is None else head], axis=1)
    time = np.concatenate([_times(clip.held) for clip in clips])
    feet = _feet(clips)
    if len(clips) > 1 or to in TABLE_FORMATS or (feet.size and carries_points(to) and to not in EVENLY_TIMED):
        names = (*POINTS, *FEET_POINTS) if feet.size else POINTS
        points = np.concatenate([points, feet], axis=1) if feet.size else points
        known = np.flatnonzero(np.isfinite(points[..., 0]).any(axis=0))
        steps = np.diff(_times(clips[0].held))
        motion = Motion(
            names=tuple(names[k] for k in known),
            points=points[:, known],
            time=time,
            rate=float(1 / np.median(steps)) if len(steps) else ASSUMED_RATE,
            up=clips[0].held.up,
            source=str(path),
            clip=np.repeat(np.arange(len(clips)), [len(clip.held) for clip in clips]),
            clips=tuple(clip.name for clip in clips),
        )
        write_points(MotionOutput(path=path, to=to), motion)
        return
    whole = np.isfinite(points[:, :14]).all(axis=(1, 2))
    write_moving(
        MotionOutput(path=path, to=to),
        PostureSequence(
            points=points,
            time=time,
            frame=np.arange(len(points)),
            survivor=np.zeros(len(points), dtype=np.intp),
            up=clips[0].held.up or "+z",
            figure=load_figure() if not whole.any() else _figure(points[:, :14]),
            values={},
        ),
    )


def _feet(clips: Sequence[RepairedClip]) -> Array:
    """Return toes and heels of all clips (T, 4, 3); empty where none has them."""
    if not any(clip.held.feet.size for clip in clips):
        return np.empty(0)
    none = (len(FEET_POINTS), 3)
    return np.concatenate(
        [
            clip.held.feet if clip.held.feet.size else np.full((len(clip.held), *none), np.nan)
            for clip in clips
        ]
    )


def _figure(joints: Array) -> Figure:
    person = measured_person(joints)
    return figure_of(load_figure(), person.lengths, person.behind)


def _times(held: HeldPostures) -> Array:
    """Return the times of frames; even ones where there are none."""
    if np.isfinite(held.time).all() and (np.diff(held.time) > 0).all():
        return held.time
    return np.arange(len(held)) / ASSUMED_RATE
