"""Files that are to be judged: which are meant, and what each holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.held_postures import (
    POSTURE_CONTENTS,
    HeldPostures,
    configurations_of,
    held_postures,
    postures_of_result,
)
from posekit.formats.listing import Wanted, listed
from posekit.formats.motion import UP_DIRECTIONS
from posekit.formats.motion.ground_up import against_stated_up
from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.formats.own import NamedConfigurations, ObjectResult, Result, read_object, read_result
from posekit.formats.own.units import POSSIBLE_RATES
from posekit.formats.recognising import recognise
from posekit.formats.registry import formats
from posekit.geometry import Array
from posekit.safe_io import cut, refusal


@dataclass(frozen=True, kw_only=True)
class StatedMotion:
    """What is stated of files, in place of what they say themselves.

    Parameters
    ----------
    unit : str
        What lengths are in: ``m``, ``cm``, ``mm``, ``in``; empty where it is not stated.
    up : str
        The axis that points up, as ``+y``; empty where it is not stated.
    rate : float, optional
        Frames a second.
    body_model : Path, optional
        NPZ of the body model whose angles the files have.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """

    unit: str = ""
    up: str = ""
    rate: float | None = None
    body_model: Path | None = None

    def __post_init__(self) -> None:
        if self.unit and self.unit not in METRES_IN_UNIT:
            raise InputError(f"--unit: {cut(self.unit)!r}; expected one of {', '.join(METRES_IN_UNIT)}")
        up = f"+{self.up}" if f"+{self.up}" in UP_DIRECTIONS else self.up
        if up and up not in UP_DIRECTIONS:
            raise InputError(f"--up: {cut(self.up)!r}; expected one of {', '.join(UP_DIRECTIONS)}")
        object.__setattr__(self, "up", up)
        low, high = POSSIBLE_RATES
        if self.rate is not None and not low <= self.rate <= high:
            raise InputError(f"--rate: {self.rate:g}; expected frames a second, as 30")

    def applied(self, held: HeldPostures) -> HeldPostures:
        """Return postures with the direction up and the times that are stated."""
        if self.up:
            against = against_stated_up(held.postures.joints, held.clip, self.up)
            held = replace(held, up=self.up, said=(*held.said, *against))
        if self.rate is None:
            return held
        if held.in_time:
            first = np.full(int(held.clip.max(initial=0)) + 1, np.iinfo(np.intp).max)
            np.minimum.at(first, held.clip, held.frame)
            return replace(held, time=(held.frame - first[held.clip]) / self.rate)
        if held.frame.any():  # several postures a frame are none in time
            return held
        frame = np.arange(len(held))
        return replace(held, frame=frame, time=frame / self.rate)


PATH_AS_MOTION: Final = (
    "the survivors of a followed result are judged as postures; to judge its path as motion, convert it first: "
    "posekit convert RESULT path.npz"
)


class ReadPostures(NamedTuple):
    """What a file holds, the result that it is, if it is one, and the robot that it says it is of."""

    postures: HeldPostures | NamedConfigurations
    result: Result | None = None
    robot: str = ""

    @property
    def up(self) -> Array | None:
        """The direction up, where it is known."""
        said = self.postures.up if isinstance(self.postures, HeldPostures) else ""
        return UP_DIRECTIONS[said] if said else None


def read_postures_of(path: Path, stated: StatedMotion) -> ReadPostures:
    """Read what a file holds that can be judged.

    Parameters
    ----------
    path : Path
        A file, or a folder that is one recording.
    stated : StatedMotion
        What is stated of it.

    Raises
    ------
    InputError
        Where it cannot be read, or holds no posture.
    """
    found = recognise(path)
    result = None
    held: HeldPostures | NamedConfigurations
    if found.holds is Content.RESULT:
        result = read_result(path)
        held = stated.applied(postures_of_result(result))
        if result.paths is not None:
            held = replace(held, said=(*held.said, PATH_AS_MOTION))
    elif found.holds is Content.OBJECTS:
        return _of_objects(path, read_object(path))
    elif found.holds is Content.CONFIGURATIONS:
        held = configurations_of(path, found, stated.rate)
    else:
        read = held_postures(
            path,
            found,
            unit=stated.unit or None,
            up=stated.up or None,
            rate=stated.rate,
            body_model=stated.body_model,
        )
        held = read if found.holds is Content.MOTION else stated.applied(read)
    if not len(held):
        raise InputError(f"{path}: it holds no posture; nothing can be judged; expected at least one")
    return ReadPostures(held, result)


def _of_objects(path: Path, objects: ObjectResult) -> ReadPostures:
    """Return the configurations that reach objects; the nearest ones of other postures are none of theirs."""
    reached = [
        q
        for frame in objects.frames
        if frame.q is not None
        for q, certified in zip(frame.q, frame.certified, strict=True)
        if certified
    ]
    robot, count = objects.settings.get("robot"), sum(map(len, objects.frames))
    if not isinstance(robot, dict):
        expected = "configurations of a robot"
        raise refusal(
            path, "", "objects without a URDF", expected, "its lengths were checked; render or convert it"
        )
    if not reached:
        got = f"{plural(count, 'posture')}, for none of which a configuration within limits is known"
        raise refusal(path, "", got, "one at least", "recover it at another scale, as --scale closure")
    lacking = count - len(reached)
    held = NamedConfigurations(
        q=np.array(reached),
        names=objects.configuration_names,
        source=str(path),
        said=(f"{plural(lacking, 'posture')} without a configuration within limits left out",)
        if lacking
        else (),
    )
    return ReadPostures(held, robot=str(robot.get("name", "")))


def files_of(given: Sequence[Path], output: Path | None = None) -> list[Path]:
    """List the files that are meant: see `posekit.formats.listing.listed`.

    Parameters
    ----------
    given : sequence of Path
        Files, folders and patterns.
    output : Path, optional
        The report, which is no input.

    Raises
    ------
    InputError
        Where one is not there, or there is no file that can hold postures.
    """
    suffixes = {suffix for one in formats(*POSTURE_CONTENTS) for suffix in one.suffixes}
    contents = (*POSTURE_CONTENTS, Content.KEY_POINTS, Content.OBJECTS, Content.BATCH)
    found = listed(given, Wanted(suffixes=suffixes, contents=contents), output)
    if not found:
        names = cut(", ".join(map(str, given)))
        raise refusal(
            names, "", "no file", f"files of postures: {', '.join(sorted(suffixes))}", "name the files"
        )
    return found
