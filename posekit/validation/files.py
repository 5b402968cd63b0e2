"""Any number of files judged into one report: one after the other; those that are broken are named."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from posekit.body import Figure
from posekit.errors import InputError, PosekitError
from posekit.formats.format import Content
from posekit.formats.held_postures import POSTURE_CONTENTS, HeldPostures
from posekit.formats.motion import UP_DIRECTIONS
from posekit.formats.own import ValidationReport
from posekit.formats.recognising import recognise
from posekit.geometry import Array
from posekit.recovery.recovered import recovered_with
from posekit.robots import Robot
from posekit.settings import DEFAULT_RANGES, ValidateSettings
from posekit.validation.judging import ReportBuilder, WantedDetail
from posekit.validation.reading import ReadPostures, StatedMotion, read_postures_of
from posekit.validators import Validator

STICK_FIGURE_NAME = "stick_figure"


@dataclass(frozen=True, kw_only=True)
class AskedValidation:
    """By what postures are to be judged, whichever file they are of.

    Parameters
    ----------
    urdf : str, path, Figure or Robot
        What `Validator` takes; empty for the stick figure, and of a result its own.
    settings : ValidateSettings, optional
        What decides the verdicts; the usual, or what a result was recovered with, if not given.
    changes : mapping
        Single settings that are other than those.
    stated : StatedMotion
        What is stated of the files.
    sequence : bool
        Whether a robot's fit starts from the frame before, clip by clip.
    """

    urdf: str | Path | Figure | Robot = ""
    settings: ValidateSettings | None = None
    changes: Mapping[str, Any] = field(default_factory=dict)
    stated: StatedMotion = field(default_factory=StatedMotion)
    sequence: bool = False

    @property
    def told(self) -> str:
        """The body, as reports name it."""
        return str(getattr(self.urdf, "name", self.urdf)) or STICK_FIGURE_NAME

    def validator(self, read: ReadPostures) -> Validator:
        """Make what judges a file.

        Parameters
        ----------
        read : ReadPostures
            What it holds.

        Raises
        ------
        InputError
            Where what is asked is impossible, or a result's settings are.
        """
        robot = self.urdf or read.robot
        figure: str | Path | Figure | Robot = robot or STICK_FIGURE_NAME
        base = self.settings or self._usual(read.up)
        if read.result is not None and self.settings is None:
            own, base = recovered_with(read.result)
            figure = self.urdf or own
        if robot not in ("", STICK_FIGURE_NAME) and self.settings is None:
            # What was allowed is the stick figure's: a robot's bodies are other ones, and meshes have no depth.
            own_limits = "urdf" if base.ranges == "urdf" else DEFAULT_RANGES
            base = base.changed(contact_margin=0.0, ranges=own_limits, lengths=None)
        stated = {"up": UP_DIRECTIONS[self.stated.up]} if self.stated.up else {}
        return Validator(figure, base.changed(**{**stated, **self.changes}))

    @staticmethod
    def _usual(up: Array | None) -> ValidateSettings:
        return ValidateSettings(up=(0.0, 0.0, 1.0) if up is None else up)


class _Validators:
    """What judges files, made once for all that are judged alike."""

    def __init__(self, asked: AskedValidation) -> None:
        self._asked = asked
        self._made: dict[tuple[str | float, ...], Validator] = {}

    def of(self, read: ReadPostures) -> Validator:
        if read.result is not None and self._asked.settings is None:
            return self._asked.validator(read)
        up = (read.robot, *(() if read.up is None else read.up.tolist()))
        if up not in self._made:
            self._made[up] = self._asked.validator(read)
        return self._made[up]


def validate_files(
    paths: Sequence[Path],
    asked: AskedValidation,
    *,
    wanted: WantedDetail | None = None,
    progress: Callable[[int], None] | None = None,
    strict: bool = True,
) -> ValidationReport:
    """Judge files, one after the other.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    asked : AskedValidation
        By what.
    wanted : WantedDetail, optional
        What is wanted of each posture.
    progress : callable, optional
        Told 1 after each file.
    strict : bool
        Whether it is an error where no file can be judged; else they are refused in a report of nothing.

    Returns
    -------
    ValidationReport
        Its `refused` has a line for each file that is broken.

    Raises
    ------
    InputError
        Where what is asked is impossible, or no file can be judged.
    """
    built = ReportBuilder(replace(wanted or WantedDetail(), files=len(paths)))
    validators = _Validators(asked)
    refused: list[str] = []
    left_out: list[str] = []
    for path in paths:
        try:
            if len(paths) > 1 and (other := _other_content(path)):
                left_out.append(f"{path} ({other})")
            else:
                _judge(built, validators, path, asked)
        except _Refused as error:
            if strict and len(paths) == 1:
                raise InputError(error.line) from error
            refused.append(error.line)
        if progress is not None:
            progress(1)
    if strict and built.empty:
        raise none_judged(len(paths), (*refused, *left_out)[0])
    name = asked.told if asked.urdf or not built.own else "as recovered"
    others = {"left_out": left_out} if left_out else {}
    return replace(built.report({"urdf": name, **others}), refused=tuple(refused))


def none_judged(count: int, first: str) -> InputError:
    """Word that none of some files can be judged, with why the first cannot."""
    return InputError(f"none of {count} files can be judged; the first: {first}" if count > 1 else first)


def _other_content(path: Path) -> str:
    """Say what a file holds that is nothing to be judged, as a camera or a report; empty where it is to be read."""
    try:
        holds = recognise(path).holds
    except PosekitError as error:
        raise _Refused(path, error) from error
    return "" if holds in (*POSTURE_CONTENTS, Content.KEY_POINTS, Content.OBJECTS) else holds.value


class _Refused(Exception):
    """A file that cannot be judged, and why, in a line that names it."""

    def __init__(self, path: Path, error: PosekitError) -> None:
        line = str(error)
        super().__init__(line)
        self.line = line if str(path) in line or line.startswith("--") else f"{path}: {line}"


def _judge(built: ReportBuilder, validators: _Validators, path: Path, asked: AskedValidation) -> None:
    """Judge one file."""
    try:
        read = read_postures_of(path, asked.stated)
    except PosekitError as error:
        raise _Refused(path, error) from error
    try:
        validator = validators.of(read)
    except PosekitError as error:
        if read.result is None or str(error).startswith("--"):
            raise  # what is asked is impossible, whatever the file holds
        raise _Refused(path, error) from error
    held = read.postures
    sequence = held.clip if asked.sequence and isinstance(held, HeldPostures) else None
    try:
        built.add(validator, held, file=str(path), sequence=sequence, own=read.result is not None)
    except PosekitError as error:
        raise _Refused(path, error) from error
