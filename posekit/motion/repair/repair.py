"""`repair`: find a nearby motion that passes all checks, write it to a file, and list interpolated frames."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import InputError, names_checked, refusal
from posekit.files import write_bytes
from posekit.formats.bvh import Bvh
from posekit.formats.options import Options, facts_of
from posekit.geometry import Record
from posekit.inputs import are_paths, files_of, kind_of, names_below, new_folder
from posekit.motion.motion import PER_FRAME, Motion
from posekit.motion.repair.clip import Clip, RobotClip
from posekit.motion.repair.own_bvh import in_bvh
from posekit.motion.repair.own_file import in_own_file
from posekit.motion.repair.remedies import mended
from posekit.motion.validation import Judge, in_order, refuse_without_joints
from posekit.progress import watched
from posekit.settings import ValidateSettings, stated
from posekit.skeleton import JOINTS
from posekit.validators.report import Report, joined, plural

#: Maximum number of rounds of repair; more than one is needed if replaced postures jitter or the file rounds numbers.
ROUNDS: Final = 4
#: Change of a frame above which it counts as changed, metres or radians.
SEEN: Final = 5e-6
#: Start of the note about remaining findings.
LEFT: Final = "left: "
#: Notes about remedies.
SAID: Final = {
    "reordered": "frames put in order",
    "lengthened": "lengths of limbs restored",
    "stepped back": "steps of the whole body taken out",
    "smoothed": "trembling smoothed",
    "shifted": "the body shifted to the ground",
    "held": "standing feet held",
}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Repaired(Record):
    """Result of a repair of one motion, or of the files of a folder.

    Parameters
    ----------
    motion : Motion or None
        The repaired motion; None for several files. Frames that passed are unchanged.
    before, report : Report
        Reports about the given motion, and about the repaired motion as it is read from its file.
    notes : tuple of str
        Sentences about changes, interpolated frames and remaining defects.
    data : bytes
        Contents of the repaired file, with the user's names and columns; empty if `posekit.save` writes the motion.
    """

    motion: Motion | None
    before: Report
    report: Report
    notes: tuple[str, ...]
    data: bytes = b""

    def _facts(self) -> list[str]:
        return list(self.notes)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the repaired motion. A file in the format of the source file keeps the names and columns of the source.

        Raises
        ------
        InputError
            If the format cannot represent the motion, or there are several files.
        """
        import posekit

        path = Path(path)
        if self.motion is None:
            remedy = "repair them into a folder: repair(source, target)"
            raise refusal(path, "", "several files", "one motion", remedy)
        same = _same_format(self.motion, path)
        if same and bool(self.before.ok.all()):
            shutil.copyfile(self.motion.source, path)
        elif same and self.data:
            write_bytes(path, self.data)
        else:
            posekit.save(self.motion, path)


def _same_format(motion: Motion, path: Path) -> bool:
    source = Path(motion.source)
    return source.is_file() and source.suffix.lower() == path.suffix.lower()


@names_checked
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
    checks: Any = None,
    ranges: str | None = None,
    profile: str | None = None,
    ground: str | float | None = None,
) -> Repaired:
    """Find a motion near the given motion that passes all checks.

    Defects of the recording are removed first: frames are sorted, exchanged sides corrected, lengths of limbs restored,
    jumps and frozen frames interpolated, jitter smoothed, the body shifted to the ground, and standing feet fixed. Then
    each rejected posture is moved inside its bounds by the shortest steps. If the moved posture fails, it is
    interpolated toward the nearest valid frames until it passes. A first frame that does not belong to the motion, such
    as a T-pose, is extrapolated from the next frames.

    Frames without defects are unchanged, byte for byte in BVH files and in tables. The written file is read again and
    judged.

    Parameters
    ----------
    source : path, sequence of path, Motion or array
        A file, a folder, a motion, or an array as in `posekit.validate`; the frames of an array are successive in time
        if `rate` is given.
    target : path, optional
        File to write. For a folder or several files: a new folder for files with the same names; valid files are copied
        unchanged.
    urdf, settings, layout, unit, up, rate, person, checks, ranges, profile, ground
        As in `posekit.validate`.

    Returns
    -------
    Repaired

    Raises
    ------
    InputError
        If a file cannot be read, or the format of the target cannot represent the motion.

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
    judge = Judge(settings, urdf, stated(checks=checks, ranges=ranges, profile=profile, ground=ground))
    facts = facts_of(layout=layout, unit=unit, up=up, rate=rate, person=person, urdf=judge.name)
    if are_paths(source):
        files = list(files_of(source))
        if len(files) > 1 or not Path(files[0]).samefile(str(source)):
            return _folder(files, target, judge, facts)
        source = _opened(files[0], facts)
    else:
        source = judge.motion(source, facts)
    done = _repaired(source, judge, facts)
    return done if target is None else _written(done, Path(target), judge, facts)


def _opened(path: Path, facts: dict[str, Any]) -> Motion:
    import posekit

    held = posekit.open(path, **facts)
    if not isinstance(held, Motion):
        raise refusal(path, "", kind_of(held), "postures or motion", "give a file of motion")
    refuse_without_joints(held, path)
    return held


def _written(done: Repaired, path: Path, judge: Judge, facts: dict[str, Any]) -> Repaired:
    """Write a repaired motion, and return it with the report about the written file."""
    done.save(path)
    if done.motion is None or done.report is done.before or not _same_format(done.motion, path):
        return done
    report = judge.report(_opened(path, facts))
    return replace(done, report=report, notes=_with_left(done.notes, report))


def _with_left(notes: Sequence[str], report: Report) -> tuple[str, ...]:
    """Return notes, followed by a note about the invalid spans of a report."""
    left = [str(span) for span in report.spans if span.verdict == "invalid"]
    more = f"; {len(left) - 3} more" if len(left) > 3 else ""
    own = [note for note in notes if not note.startswith(LEFT)]
    return (*own, *([f"{LEFT}{'; '.join(left[:3])}{more}"] if left else []))


def _folder(
    files: Sequence[Path], target: str | PathLike[str] | None, judge: Judge, facts: dict[str, Any]
) -> Repaired:
    """Repair files into a new folder; files that cannot be read or written are named in the notes."""
    folder = None if target is None else new_folder(target)
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


def _repaired(motion: Motion, judge: Judge, facts: dict[str, Any]) -> Repaired:
    """Repair every recording of a motion in rounds, until the motion read from the written file passes."""
    before = judge.report(motion)
    if before.ok.all():
        return Repaired(motion=motion, before=before, report=before, notes=(_changed(0, len(motion)),))
    validator = judge.validator(motion.robot)
    of_points = validator.figure is not None and motion.joints is not None
    motion = replace(motion, q=None, q_names=(), robot="") if of_points else in_order(motion, validator)
    kind: type[Clip] = Clip if of_points else RobotClip
    given = clips = [kind.of(recording, validator) for _, recording in motion.recordings()]
    now, whole = motion, clips
    of_bvh = isinstance(motion.document, Bvh)
    tried: list[Repaired] = []
    with tempfile.TemporaryDirectory() as folder:
        for number in watched(range(ROUNDS), "repairing"):
            clips = [mended(clip, filled=number % 2 > 0) for clip in clips]
            whole = [clip.following(first) for clip, first in zip(clips, whole, strict=True)]
            after = _joined(clips, now)
            data, lost = _in_its_file(now, after, clips, facts)
            notes = [note for one, clip in zip(given, whole, strict=True) for note in _told(one, clip)]
            refused = f"the columns of {Path(motion.source).name} cannot hold the repair; joints are written"
            held = [(after, b"", [refused] if data else [])]
            if data:
                place = Path(folder) / f"{number}{Path(motion.source).name}"
                write_bytes(place, data)
                held = [*([] if of_bvh else held), (_opened(place, facts), data, lost)]
            for one, data, more in held:
                report = replace(judge.report(one), files=before.files)
                said, shown = _with_left([*notes, *more], report), replace(one, source=motion.source)
                tried.append(Repaired(motion=shown, before=before, report=report, notes=said, data=data))
            now = one if of_bvh or report.ok.sum() > before.ok.sum() else after
            if any(one.report.ok.all() for one in tried) and (report.ok.all() or now is after):
                break
            now = now if of_points else in_order(now, validator)
            parts = zip(now.recordings(), clips, strict=True)
            clips = [replace(kind.of(part, validator), done=clip.done) for (_, part), clip in parts]
    return max(tried, key=lambda one: (one.report.ok.sum(), bool(one.data)))


def _joined(clips: Sequence[Clip], motion: Motion) -> Motion:
    """Return repaired recordings as one motion."""
    parts = [clip.as_motion() for clip in clips]
    if len(parts) == 1:
        return parts[0]
    held = [name for name in PER_FRAME if getattr(parts[0], name) is not None]
    fields: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in held}
    fields["clip"] = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return replace(parts[0], **fields, clips=motion.clips, document=None)


def _in_its_file(
    before: Motion, after: Motion, clips: Sequence[Clip], facts: dict[str, Any]
) -> tuple[bytes, list[str]]:
    """Return the bytes of the repaired file, empty if its format cannot be kept, and notes about unchanged arrays."""
    if isinstance(before.document, Bvh):
        return in_bvh(clips[0], before.document, Options(**facts)) if len(after) == len(before) else b"", []
    if not Path(before.source).is_file():
        return b"", []
    of_clip = [np.flatnonzero(before.clip == index) for index in np.unique(np.asarray(before.clip))]
    rows = [own[clip.own_rows] for own, clip in zip(of_clip, clips, strict=True)]
    return in_own_file(before.source, before, after, np.concatenate(rows))


def _told(given: Clip, clip: Clip) -> list[str]:
    """Return notes about changes and interpolated frames, preceded by the name of the clip if it has one."""
    rows, inserted, filled = clip.own_rows, clip.rows < 0, clip.filled
    moved = np.nan_to_num(clip.state - given.state[rows])
    changed = (np.abs(moved) > SEEN).reshape(len(clip), -1).any(axis=1) | inserted
    changed |= filled | (rows != np.arange(len(rows)))
    ends = filled & (np.logical_and.accumulate(filled) | np.logical_and.accumulate(filled[::-1])[::-1])
    notes = [_changed(int(changed.sum()), len(clip))]
    for made, how in (
        (inserted, "missing frame{} inserted"),
        (filled & ~inserted & ~ends, "frame{} interpolated"),
        (ends, "frame{} continued to an end of the clip"),
    ):
        if made.any():
            notes.append(f"{made.sum()} {how.format('s' if made.sum() > 1 else '')}")
    if clip.mirrored:
        notes.append("right and left exchanged in all frames")
    elif "exchanged" in clip.done:
        notes.append("right and left exchanged back")
    notes += [SAID[name] for name in dict.fromkeys(clip.done) if name in SAID]
    if not isinstance(clip, RobotClip) and not clip.mirrored:
        way = np.linalg.norm(moved[:, : len(JOINTS)], axis=-1).max(initial=0.0)
        notes += [f"joints moved by up to {100 * way:.3g} cm"] if way > SEEN else []
    return [f"{clip.motion.clips[0]}: {note}" for note in notes] if any(clip.motion.clips) else notes


def _changed(count: int, frames: int) -> str:
    return f"{count} of {plural(frames, 'frame')} changed"
