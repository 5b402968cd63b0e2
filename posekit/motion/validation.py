"""`validate`: judge files, folders, arrays and results clip by clip; copy the clips that pass."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import LengthUncertainty, load_figure
from posekit.errors import InputError, names_checked, refusal
from posekit.formats.options import facts_of
from posekit.inputs import are_paths, files_of, kind_of, names_below, new_folder
from posekit.motion.motion import Motion
from posekit.progress import watched
from posekit.settings import EXACT, Tolerance, ValidateSettings, number, stated
from posekit.validators.judge import Validator, validate_motion
from posekit.validators.report import GROUND_NOTE, ClipDecision, Report, clip_rows, joined, plural

if TYPE_CHECKING:
    from posekit.recovery import Recovery

#: Name of the table of clips in a folder of kept clips.
CLIP_TABLE: Final = "clips.csv"

#: Maximum number of files without motion that a note names.
MOST_NAMED: Final = 3

#: Largest rounding error of a difference of two times, seconds.
ROUNDING_SECONDS: Final = 1e-6


@names_checked
def validate(
    given: Any,
    settings: ValidateSettings | None = None,
    *,
    urdf: Any = "",
    layout: str = "",
    unit: str | None = None,
    up: str | None = None,
    rate: float | None = None,
    person: int | None = None,
    keep: str | Path | None = None,
    keep_spans: str | float | None = None,
    checks: Any = None,
    ranges: str | None = None,
    profile: str | None = None,
    ground: str | float | None = None,
) -> Report:
    """Judge postures and motion from files, folders, arrays, `Motion` objects or results of `posekit.recover`.

    Parameters
    ----------
    given : path, sequence of path, array, Motion or Recovery
        Files, folders, and file patterns such as ``clips/*.bvh``; joints (T, 14, 3), or (T, 19, 3) with head points,
        metres, NaN if unknown; configurations (T, nq) of `urdf`; or a motion or result from `posekit.open`. Checks of
        motion are applied only to frames that are successive in time; for an array this requires `rate`.
    settings : ValidateSettings, optional
        Settings for the verdicts; for a result, by default the settings with which it was recovered.
    urdf : str, path, Figure or Robot
        Figure or robot of the postures, as in `posekit.Validator`. By default the robot that the file names, otherwise
        the figure.
    layout, unit, up, rate, person
        Facts that the files or the array do not state: see `posekit.open`. The points of an array (T, J, 3) with a
        `layout` are in the layout's order.
    keep : path, optional
        New folder for the clips that pass: see `keep_clips`.
    keep_spans : float or str, optional
        Also keep the longest run of valid frames of a clip that does not pass, if it lasts at least this long, seconds.
    checks, ranges, profile, ground : optional
        Fields of `ValidateSettings`; they replace those of `settings`.

    Returns
    -------
    Report

    Raises
    ------
    InputError
        If a single file cannot be read, if none of several files can be judged, or if a setting is wrong.

    Examples
    --------
    >>> import numpy as np, posekit
    >>> standing = np.repeat(posekit.load_figure().neutral_points[None, :14], 20, axis=0)
    >>> posekit.validate(standing, rate=30, up="+z").decision
    'keep 1 of 1 clip'
    """
    judge = Judge(settings, urdf, stated(checks=checks, ranges=ranges, profile=profile, ground=ground))
    facts = facts_of(layout=layout, unit=unit, up=up, rate=rate, person=person)
    if not are_paths(given):
        return judge.report(given if hasattr(given, "survivors") else judge.motion(given, facts))
    report = _files(list(dict.fromkeys(files_of(given))), judge, facts)
    if keep is not None:
        spans = None if keep_spans is None else number(keep_spans, "keep-spans", "seconds")
        report = replace(report, notes=(*report.notes, keep_clips(report, keep, spans=spans)))
    return report


class Judge:
    """Validator and settings, loaded once for all files.

    Parameters
    ----------
    settings : ValidateSettings or None
        Settings of the checks.
    urdf : str, path, Figure or Robot
        Figure or robot of the postures; empty for the robot that a file names, or the figure.
    changes : mapping
        Fields of the settings that replace those of `settings`.
    """

    def __init__(self, settings: ValidateSettings | None, urdf: Any, changes: Mapping[str, Any]) -> None:
        self.settings, self.urdf, self.changes = settings, urdf, dict(changes)
        self._made: dict[str, Validator] = {}
        ValidateSettings.of(settings, **self.changes)

    @property
    def name(self) -> str:
        """Name of the robot, which readers of tables need; empty for the figure."""
        name = str(getattr(self.urdf, "name", self.urdf) or "")
        return "" if name in ("figure", "stick_figure") else name

    def validator(self, robot: str) -> Validator:
        """Return the validator of the stated body (`urdf`), or else of the robot that a file names."""
        body = self.urdf or robot or "figure"
        if str(body) not in self._made:
            self._made[str(body)] = Validator(body, self.settings, **self.changes)
        return self._made[str(body)]

    def motion(self, given: Any, facts: Mapping[str, Any]) -> Any:
        """Return an array or a motion as a `Motion` with the stated facts: layout, unit, up, rate.

        Points of pictures become `Detections`.
        """
        from posekit.formats.arrays import has_layout

        layout, unit, up, rate = (facts.get(name) for name in ("layout", "unit", "up", "rate"))
        if has_layout(given, layout):
            import posekit

            return posekit.open(given, layout or "", unit=unit, up=up, rate=rate, urdf=self.name)
        if isinstance(given, Motion):
            motion, frame = given, np.asarray(given.frame)
        else:
            if unit is not None and np.ndim(given) == 3:
                given = np.asarray(given, dtype=np.float64) * number(f"1{unit}", "unit")
            motion = self.validator("").motion(given)
            if rate and motion.q is not None and motion.robot != "figure":
                up = up or "+z"  # of URDFs (REP-103)
            frame = np.arange(len(motion))
        times = {"frame": frame, "time": frame / rate} if rate else {}
        return replace(motion, up=up or motion.up, **times)

    def report(self, given: Any) -> Report:
        """Judge a motion, or the survivors of a result."""
        if hasattr(given, "survivors"):
            return self._of_recovery(given)
        if not isinstance(given, Motion):
            raise refusal("", "array", kind_of(given), "postures or motion", "recover postures first")
        validator = self.validator(given.robot)
        if given.joints is None or (validator.figure is None and given.q is not None):
            given = in_order(given, validator)
        return validator.check(given)

    def _of_recovery(self, recovery: Recovery) -> Report:
        """Judge all survivors of a result with the lengths, ranges and tolerances of its recovery."""
        fields = {name: value for name, value in recovery.settings.items() if name in SHARED}
        settings = self.settings or ValidateSettings(**fields)
        side = recovery.settings.get("shoulders", "")
        figure = load_figure()
        if recovery.lengths:
            figure = figure.scaled(recovery.lengths, behind={"behind": True, "front": False}.get(side))
        exact = recovery.tolerances.get("tolerated", recovery.tolerances.get("exact"))
        noisy, sided, margin = recovery.tolerances.get("noisy", {}), figure, settings.contact_margin
        if "by_segment" in noisy:
            sided = figure.with_side_within(LengthUncertainty(common=noisy["size"], own=noisy["by_segment"]))
        loose = noisy.get("certified", exact), noisy.get("contact_margin", margin), sided
        motion, solved = recovery.motion("all"), np.asarray(recovery.survivors.chi2) > 0
        reports = []
        for rows, (allowed, contact, body) in ((~solved, (exact, margin, figure)), (solved, loose)):
            if rows.any():
                asked = settings.changed(**{"contact_margin": contact, **self.changes})
                part = replace(motion.take(rows), q=None, q_names=(), robot="")
                tolerance = Tolerance(**allowed) if allowed else EXACT
                reports.append(validate_motion(part, asked, figure=body, tolerance=tolerance))
        return reports[0] if len(reports) == 1 else joined(reports)


SHARED: Final = ("checks", "ranges", "rules", "walkers", "contact_margin")


def in_order(motion: Motion, validator: Validator) -> Motion:
    """Return a motion with the entries of q in the order of the validator's robot."""
    names = validator.configuration_names
    if not motion.q_names or tuple(motion.q_names) == names:
        return motion
    if validator.figure is not None:
        got = f"configurations of {motion.robot or 'a robot'}"
        remedy = "name the robot with --urdf"
        remedy += ", or give the .trc of the markers" if motion.layout == "opensim" else ""
        raise refusal(motion.source, "q", got, "configurations of the figure", remedy)
    q, notes = validator.robot.q_from_columns(motion.q_names, motion.q)  # type: ignore[arg-type]
    return replace(motion, q=q, q_names=names, notes=(*motion.notes, *notes))


def _files(paths: Sequence[Path], judge: Judge, facts: Mapping[str, Any]) -> Report:
    """Judge files one after the other; the report of several files lists the files that cannot be read."""
    import posekit

    reports: list[Report] = []
    refused, skipped = list[str](), list[str]()
    for path in watched(paths, "judging"):
        try:
            held: Any = posekit.open(path, **facts, urdf=judge.name)
            if isinstance(held, Motion) or hasattr(held, "survivors"):
                refuse_without_joints(held, path)
                report = judge.report(held)
                reports.append(replace(report, files=(str(path),) * len(report.files)))
            elif len(paths) == 1:
                remedy = f"recover postures first: posekit recover {path} -o RESULT"
                raise refusal(path, "", kind_of(held), "postures or motion", remedy)
            else:
                skipped.append(path.name)
        except InputError as error:
            if len(paths) == 1:
                raise
            (skipped if _is_view(path) else refused).append(path.name if _is_view(path) else str(error))
    if not reports:
        first = [*refused, *skipped][0]
        raise InputError(f"none of {plural(len(paths), 'file')} can be judged; the first: {first}")
    if len(reports) > 1:
        reports = [replace(one, notes=_of_file(one)) for one in reports]
    report = joined(reports, refused=refused) if len(reports) > 1 or refused else reports[0]
    if skipped:
        named = ", ".join([*skipped[:MOST_NAMED], *["…"] * (len(skipped) > MOST_NAMED)])
        said = f"{plural(len(skipped), 'file')} without motion left out: {named}"
        report = replace(report, notes=(*report.notes, said))
    return report


def _of_file(report: Report) -> tuple[str, ...]:
    """Return the notes of a report, with the file's name before each note that is not about the ground."""
    name = Path(report.files[0]).name if report.files else ""
    return tuple(note if note.startswith(GROUND_NOTE) else f"{name}: {note}" for note in report.notes)


def _is_view(path: Path) -> bool:
    """Return whether a file is a view of an articulated object, which contains no motion."""
    return path.suffix.lower() == ".json" and b"posekit.view/1" in path.read_bytes()[:200]


def refuse_without_joints(held: Any, path: Path) -> None:
    """Refuse a motion whose points include no joint of a body."""
    if isinstance(held, Motion) and held.q is None and not np.isfinite(held.figure_joints).any():
        got = "no joint of a body among its points"
        remedy = "say which point is which joint with --layout FILE.toml"
        raise refusal(path, "", got, "named joints or markers", remedy)


def keep_clips(report: Report, folder: str | Path, *, spans: float | None = None) -> str:
    """Write the clips that pass, and a table of all clips, into a new folder; after an error nothing is written.

    A file in which every frame passes is copied unchanged. The kept frames of other files are written in the format
    of the file.

    Parameters
    ----------
    report : Report
        Report about files.
    folder : path
        Folder that does not exist or is empty.
    spans : float, optional
        Also keep the longest run of valid frames of a clip that does not pass, if it lasts at least this long, seconds.

    Returns
    -------
    str
        Sentence with the number of kept clips.

    Raises
    ------
    InputError
        If the folder is not empty, or a file cannot be read or written.
    """
    from posekit.formats.tables import columns_of_rows, csv_text

    folder = new_folder(folder)
    part = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        rows = list(_kept(report, part, spans))
        (part / CLIP_TABLE).write_text(csv_text(columns_of_rows(rows)), encoding="utf-8")
        if folder.exists():
            folder.rmdir()
        part.rename(folder)
    except OSError as error:
        raise refusal(folder, "", str(error), "a folder that can be written", "check its place") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
    kept = [row for row in rows if row["written"]]
    cut = sum(row["decision"] != "keep" for row in kept)
    tail = f", {cut} of them cut to their longest valid span" if cut else ""
    return f"{len(kept)} of {plural(len(rows), 'clip')} kept in {folder}{tail}"


def _kept(report: Report, folder: Path, spans: float | None) -> Iterator[dict[str, Any]]:
    """Write the kept frames of each file, and yield one row of the table for each clip."""
    rows, clips = clip_rows(report), report.clips
    by_file: dict[str, list[int]] = {}
    for k, clip in enumerate(clips):
        by_file.setdefault(clip.file, []).append(k)
    names = names_below(by_file)
    for file, numbers in by_file.items():
        chosen = {k: _frames(report, clips[k], k, spans) for k in numbers}
        wanted = np.concatenate(list(chosen.values()))
        name = names[file]
        if len(wanted):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            whole = len(wanted) == sum(clips[k].frames for k in numbers)
            if whole and Path(file).is_file():
                shutil.copyfile(file, folder / name)
            else:
                first = min(int(np.flatnonzero(report.clip == k)[0]) for k in numbers)
                _cut(file, folder / name, np.sort(wanted) - first)
        for k in numbers:
            part = chosen[k]
            yield {
                **rows[k],
                "written": name.as_posix() if len(part) else "",
                "first_kept": int(report.frame[part[0]]) if len(part) else -1,
                "last_kept": int(report.frame[part[-1]]) if len(part) else -1,
            }


def _frames(report: Report, clip: ClipDecision, number: int, spans: float | None) -> NDArray[np.intp]:
    """Return the rows of the report that belong to the kept frames of a clip."""
    rows = np.flatnonzero(report.clip == number)
    if clip.decision == "keep":
        return rows
    if spans is None or clip.good is None:
        return rows[:0]
    inside = (report.frame[rows] >= clip.good[0]) & (report.frame[rows] <= clip.good[1])
    part = rows[inside]
    seconds = float(report.time[part[-1]] - report.time[part[0]])
    return part[:0] if seconds < spans - ROUNDING_SECONDS else part


def _cut(source: str, target: Path, rows: NDArray[np.intp]) -> None:
    """Write some frames of a file, in its own format."""
    import posekit

    motion = posekit.open(source)
    kept = motion.take(rows)
    time = np.asarray(kept.time)
    posekit.save(replace(kept, time=time - time[0], frame=None), target)
