"""`repair`: the nearest motion that passes, in the user's own file, and what was invented for it."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, refusal
from posekit.files import write_bytes
from posekit.formats import open as open_array
from posekit.formats.bvh import Bvh
from posekit.formats.options import Options
from posekit.geometry import Record
from posekit.motion.motion import PER_FRAME, Motion
from posekit.motion.repair.clip import Clip, RobotClip
from posekit.motion.repair.own_bvh import in_bvh
from posekit.motion.repair.own_file import in_own_file
from posekit.motion.repair.time import mended
from posekit.motion.validation import files_of, has_layout, in_order, names_below
from posekit.progress import watched
from posekit.settings import ValidateSettings
from posekit.validators.judge import Validator
from posekit.validators.report import Report, joined, plural

#: Times that a motion is repaired again: postures can tremble that time does not, and a file rounds.
ROUNDS: Final = 3
#: Change of a frame that counts, metres or radians.
SEEN: Final = 1e-7
#: Start of the note of what is left.
LEFT: Final = "left: "
#: From the name of a robot to its validator.
Judges = Callable[[str], Validator]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Repaired(Record):
    """A repaired motion, or the repaired files of a folder.

    Parameters
    ----------
    motion : Motion or None
        The repaired motion, with the frames that passed as they were; None for several files.
    before, report : Report
        What checks say of the given motion, and of the repaired one as it is read again.
    notes : tuple of str
        What was invented, and what is left, one sentence each.
    data : bytes
        The repaired table or arrays with the user's own columns; empty for other files.
    """

    motion: Motion | None
    before: Report
    report: Report
    notes: tuple[str, ...]
    data: bytes = b""

    def _facts(self) -> list[str]:
        return list(self.notes)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the repaired motion: in the format of its own file with the file's own names and columns.

        Raises
        ------
        InputError
            If the format cannot hold the motion, or there are several files.
        """
        import posekit

        path = Path(path)
        if self.motion is None:
            remedy = "repair them into a folder: repair(source, target)"
            raise refusal(path, "", "several files", "one motion", remedy)
        source = Path(self.motion.source or "")
        same = source.is_file() and source.suffix.lower() == path.suffix.lower()
        if same and bool(self.before.ok.all()):
            shutil.copyfile(source, path)
        elif same and self.data:
            write_bytes(path, self.data)
        else:
            posekit.save(self.motion, path)


def repair(
    source: Any,
    target: str | PathLike[str] | None = None,
    *,
    urdf: Any = "",
    settings: ValidateSettings | None = None,
    layout: str = "",
    unit: str | None = None,
    up: str | None = None,
    rate: float | None = None,
    person: int | None = None,
    **changes: Any,
) -> Repaired:
    """Find the nearest motion that passes all checks.

    Over time, frames are put in order, sides exchanged back, lengths of limbs restored, jumps and frozen frames
    interpolated, trembling smoothed by as little as helps, the body shifted to the ground, and standing feet held. Then
    each posture that is rejected is replaced by the nearest one inside all bounds, with changes that are alike in
    neighbouring frames. A first frame from which the body jumps, such as a T-pose, is replaced by one from which the
    motion goes on as it does after it.

    Frames that need no change stay as they are, byte for byte in BVH files and in tables. A file that is written is
    judged as it is read again.

    Parameters
    ----------
    source : path, sequence of path, Motion or array
        A file, a folder, a motion, or an array as `posekit.validate` takes it; an array is motion if `rate` is given.
    target : path, optional
        File to write; for a folder or several files a new folder of files of the same names, in which valid files are
        copied unchanged.
    urdf, settings, layout, unit, up, rate, person, **changes
        As in `posekit.validate`.

    Returns
    -------
    Repaired

    Raises
    ------
    InputError
        If a file cannot be read, or the target cannot hold the motion.

    Examples
    --------
    >>> import posekit
    >>> standing = posekit.load_figure().neutral_points[:14].copy()
    >>> posekit.repair(standing).notes
    ('0 of 1 frame changed',)
    >>> standing[[10, 12]] += [[0.35, 0, 0.1], [0.2, 0, 0.5]]  # a right knee bent forward
    >>> bool(posekit.repair(standing).report.ok.all())
    True
    """

    @cache
    def judge(robot: str) -> Validator:
        """Return the validator of the given body, else of the robot that a file names."""
        return Validator(urdf or robot or "figure", settings, **changes)

    name = str(getattr(urdf, "name", urdf) or "")
    name = "" if name in ("figure", "stick_figure") else name
    given = {"layout": layout, "unit": unit, "up": up, "rate": rate, "person": person}
    facts = {key: one for key, one in given.items() if one is not None} | {"urdf": name}
    paths = isinstance(source, str | PathLike) or (
        isinstance(source, Sequence) and all(isinstance(one, str | PathLike) for one in source)
    )
    if paths:
        files = list(files_of(source))
        if len(files) > 1 or not Path(files[0]).samefile(str(source)):
            return _folder(files, target, judge, facts)
        source = _opened(files[0], facts)
    else:
        if has_layout(source, layout):
            source = open_array(source, layout, unit=unit, up=up, rate=rate)
        source = _given(source, judge(""), up, rate)
    done = _repaired(source, judge, facts)
    return done if target is None else _written(done, Path(target), judge, facts)


def _given(source: Any, validator: Validator, up: str | None, rate: float | None) -> Motion:
    motion = source if isinstance(source, Motion) else validator.motion(source)
    fields: dict[str, Any] = {} if up is None else {"up": up if len(up) > 1 else f"+{up}"}
    if rate is not None:
        fields |= {"frame": np.arange(len(motion)), "time": np.arange(len(motion)) / rate}
    return replace(motion, **fields)


def _opened(path: Path, facts: dict[str, Any]) -> Motion:
    import posekit

    held = posekit.open(path, **facts)
    if not isinstance(held, Motion):
        raise refusal(path, "", f"a {type(held).__name__}", "postures or motion", "give a file of motion")
    return held


def _written(done: Repaired, path: Path, judge: Judges, facts: dict[str, Any]) -> Repaired:
    """Write a repaired motion, and judge the file as it is read again."""
    done.save(path)
    same = Path(getattr(done.motion, "source", "")).suffix.lower() == path.suffix.lower()
    if not same or done.report is done.before:
        return done
    report = _judged(_opened(path, facts), judge)
    return replace(done, report=report, notes=_with_left(done.notes, report))


def _with_left(notes: Sequence[str], report: Report) -> tuple[str, ...]:
    """Return notes with the spans of a report that are not valid."""
    left = [str(span) for span in report.spans if span.verdict == "invalid"]
    more = f"; {len(left) - 3} more" if len(left) > 3 else ""
    own = [note for note in notes if not note.startswith(LEFT)]
    return (*own, *([f"{LEFT}{'; '.join(left[:3])}{more}"] if left else []))


def _folder(
    files: Sequence[Path],
    target: str | PathLike[str] | None,
    judge: Judges,
    facts: dict[str, Any],
) -> Repaired:
    """Repair files into a new folder; a file that cannot be read or written is named."""
    folder = None if target is None else Path(target)
    if folder is not None and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise refusal(folder, "", "something that exists", "a new or empty folder", "name another")
    names = names_below(str(path) for path in files)
    done: list[Repaired] = []
    notes: list[str] = []
    refused: list[str] = []
    for path in watched(files, "repairing"):
        try:
            one = _repaired(_opened(path, facts), judge, facts)
            if folder is not None:
                place = folder / names[str(path)]
                place.parent.mkdir(parents=True, exist_ok=True)
                one = _written(one, place, judge, facts)
            done.append(one)
            if not one.before.ok.all():
                notes.append(f"{names[str(path)]}: {'; '.join(one.notes)}")
        except InputError as error:
            refused.append(str(error))
    if not done:
        raise InputError(f"none of {plural(len(files), 'file')} can be repaired; the first: {refused[0]}")
    valid = sum(bool(one.report.ok.all()) for one in done)
    kept = sum(bool(one.before.ok.all()) for one in done)
    first = f"{valid} of {plural(len(done), 'file')} valid: {kept} unchanged, {valid - kept} repaired"
    before = joined([one.before for one in done], refused=refused)
    report = joined([one.report for one in done], refused=refused)
    return Repaired(motion=None, before=before, report=report, notes=(first, *notes, *refused))


def _of_points(motion: Motion, validator: Validator) -> bool:
    return validator.robot is None and motion.joints is not None


def _judged(motion: Motion, judge: Judges) -> Report:
    """Judge a motion as it is repaired: points by themselves, configurations in the order of their robot."""
    validator = judge(motion.robot)
    if _of_points(motion, validator):
        return validator.check(replace(motion, q=None, q_names=(), robot=""))
    if motion.q is None:
        got, remedy = "positions of a person", "leave --urdf out, or convert the file first"
        raise refusal(motion.source or "repair", "urdf", got, "configurations of the robot", remedy)
    return validator.check(in_order(motion, validator))


def _repaired(motion: Motion, judge: Judges, facts: dict[str, Any]) -> Repaired:
    """Repair every recording of a motion."""
    validator, before = judge(motion.robot), _judged(motion, judge)
    if before.ok.all():
        return Repaired(motion=motion, before=before, report=before, notes=(_changed(0, len(motion)),))
    if _of_points(motion, validator):
        own = motion = replace(motion, q=None, q_names=(), robot="")
    else:
        own, motion = motion, in_order(motion, validator)
    parts, rows = [], []
    notes: list[str] = []
    for k, (name, recording) in enumerate(motion.recordings()):
        done, own_notes, own_rows = _recording(recording, validator, facts)
        parts.append(done)
        rows.append(np.flatnonzero(np.unique(np.asarray(motion.clip), return_inverse=True)[1] == k)[own_rows])
        notes += [f"{name}: {note}" if name else note for note in own_notes]
    repaired = parts[0] if len(parts) == 1 else _concatenated(parts, motion)
    report, data = validator.check(repaired), b""
    if repaired.document is None and len(before.files) == 1 and Path(own.source).is_file():
        after = repaired if own is motion else _as_in_file(repaired, own, np.concatenate(rows))
        written, lost = in_own_file(own.source, own, after, np.concatenate(rows))
        if written is not None:
            with tempfile.TemporaryDirectory() as folder:
                place = Path(folder) / Path(own.source).name
                write_bytes(place, written)
                again = _judged(_opened(place, facts), judge)
            if int(again.ok.sum()) >= int(report.ok.sum()):
                data, report = written, again
                notes += lost
            else:
                notes.append(
                    f"the columns of {Path(own.source).name} cannot hold the repair; joints are written"
                )
    return Repaired(motion=repaired, before=before, report=report, notes=_with_left(notes, report), data=data)


def _as_in_file(motion: Motion, own: Motion, rows: NDArray[np.intp]) -> Motion:
    """Return configurations in the order of a file's columns; those that the robot lacks stay."""
    if not own.q_names:
        return motion
    place = {_plain(name): k for k, name in enumerate(motion.q_names)}
    q = np.array(own.q)[rows]
    for column, name in enumerate(own.q_names):
        if _plain(name) in place:
            q[:, column] = np.asarray(motion.q)[:, place[_plain(name)]]
    return replace(motion, q=q, q_names=own.q_names)


def _plain(name: str) -> str:
    return name.removesuffix("_joint").lower()


def _recording(
    motion: Motion, validator: Validator, facts: dict[str, Any]
) -> tuple[Motion, list[str], NDArray[np.intp]]:
    """Repair one recording; return it, what was done, and the given frame of each frame.

    Where remedies do not suffice, the rejected frames are interpolated first.
    """
    given = (Clip if _of_points(motion, validator) else RobotClip).of(motion, validator)
    options = Options(**{key: facts.get(key, "") for key in ("layout", "unit", "up")})
    found = _searched(given, options)
    if found[0] and motion.in_time:
        bad = np.convolve(~validator.check(motion).ok, np.ones(3), mode="same") > 0
        found = min(found, _searched(given.interpolated(bad), options), key=lambda one: one[0])
    _, best, clip, done = found
    return best, _told(given, clip, done), np.maximum.accumulate(clip.rows)


def _searched(start: Clip, options: Options) -> tuple[int, Motion, Clip, list[str]]:
    """Repair a clip; return the number of frames that are not valid, the motion, the clip, and the remedies."""
    motion, validator = start.motion, start.validator
    clip = total = start
    document = motion.document
    done: list[str] = []
    tried: list[tuple[int, Motion, Clip, list[str]]] = []
    for _ in range(ROUNDS):
        for causes in (True, False) if motion.in_time else ():
            clip, remedies = mended(clip, causes=causes)
            done = [*done, *remedies]
            clip = clip.legal()
        clip = clip if motion.in_time else clip.legal()
        if isinstance(document, Bvh) and not isinstance(clip, RobotClip) and len(clip) == len(motion):
            now = in_bvh(clip, document, options)
            total = replace(
                clip,
                state=clip.state_of(now),
                motion=motion,
                rows=total.rows[clip.rows],
                filled=total.filled[clip.rows] | clip.filled,
                mirrored=total.mirrored != clip.mirrored,
            )
            document, clip = now.document, type(clip).of(now, validator)  # as the file is read again
        else:
            now, total = clip.as_motion(), clip
        tried.append((int((~validator.check(now).ok).sum()), now, total, done))
        if not tried[-1][0]:
            break
    return min(tried, key=lambda one: one[0])


def _told(given: Clip, clip: Clip, done: Sequence[str]) -> list[str]:
    """Say what was changed and what was invented."""
    rows = np.where(clip.rows < 0, 0, clip.rows)
    moved = np.nan_to_num(clip.state - given.state[rows]).reshape(len(clip), -1)
    inserted, filled = clip.rows < 0, clip.filled
    changed = (np.abs(moved) > SEEN).any(axis=1) | inserted | (rows != np.arange(len(rows)))
    notes = [_changed(int(changed.sum()), len(clip))]
    if inserted.any():
        notes.append(f"{plural(int(inserted.sum()), 'missing frame')} inserted")
    ends = filled & (np.logical_and.accumulate(filled) | np.logical_and.accumulate(filled[::-1])[::-1])
    for rows_made, how in (
        (filled & ~inserted & ~ends, "interpolated"),
        (ends, "continued to an end of the clip"),
    ):
        if rows_made.any():
            notes.append(f"{plural(int(rows_made.sum()), 'frame')} {how}")
    if clip.mirrored:
        notes.append("right and left exchanged in all frames")
    elif "exchanged" in done:
        notes.append("right and left exchanged back")
    notes += [SAID[name] for name in dict.fromkeys(done) if name in SAID]
    if not isinstance(clip, RobotClip) and not clip.mirrored:
        way = np.nanmax(np.linalg.norm((clip.state - given.state[rows])[:, :14], axis=-1), initial=0.0)
        notes.append(f"joints moved by up to {100 * way:.3g} cm")
    return notes


#: Sentences about remedies.
SAID: Final = {
    "reordered": "frames put in order",
    "lengthened": "lengths of limbs restored",
    "stepped back": "steps of the whole body taken out",
    "smoothed": "trembling smoothed",
    "shifted": "the body shifted to the ground",
    "held": "standing feet held",
}


def _changed(count: int, frames: int) -> str:
    return f"{count} of {plural(frames, 'frame')} changed"


def _concatenated(parts: Sequence[Motion], motion: Motion) -> Motion:
    """Return recordings one after the other."""
    held = [name for name in PER_FRAME if getattr(parts[0], name) is not None]
    fields: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in held}
    fields["clip"] = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    names = [part.clips[0] if part.clips else "" for part in parts]
    return replace(motion, **fields, clips=names if any(names) else (), document=None)
