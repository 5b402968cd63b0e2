"""The postures that a file holds, whatever it holds them as: motion, a result, a table of survivors, a view's truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.format import Content
from posekit.formats.motion import SurvivorTable, guess_up, postures_of, read_motion, read_survivors
from posekit.formats.motion.motion_format import MotionFormat
from posekit.formats.own import (
    NamedConfigurations,
    Postures,
    Result,
    View,
    read_configurations,
    read_postures,
    read_result,
    read_view,
)
from posekit.formats.recognising import Recognised
from posekit.formats.registry import formats, names
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.geometry import Array
from posekit.safe_io import refusal
from posekit.skeleton import JOINTS

POSTURE_CONTENTS: Final = (
    Content.POSTURES,
    Content.RESULT,
    Content.MOTION,
    Content.SURVIVORS,
    Content.CONFIGURATIONS,
    Content.VIEW,
)
"""What files hold that have postures in them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldPostures:
    """Postures of a file, N of them.

    Parameters
    ----------
    postures : Postures
        Metres, in the file's own world or its camera's frame.
    frame : int array (N,)
        The frame that each posture is of; all 0 where the file knows no frames.
    clip : int array (N,)
        The recording that each posture is of, from 0.
    time : array (N,)
        Seconds; NaN where the file does not say them.
    up : str
        The axis that points up, as ``+y``; empty where it is not known.
    clips : tuple of str
        The names of the recordings; empty where they have none.
    """

    postures: Postures
    frame: NDArray[np.intp]
    clip: NDArray[np.intp]
    time: Array
    up: str = ""
    clips: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of postures."""
        return len(self.postures.joints)

    @property
    def in_time(self) -> bool:
        """Whether they are frames of motion: of each frame of a clip one posture."""
        frames = np.stack([self.clip, self.frame], axis=1)
        return len(self) > 0 and len(np.unique(frames, axis=0)) == len(frames)


def held_postures(
    path: Path,
    found: Recognised,
    *,
    layout: SkeletonMap | None = None,
    unit: str | float | None = None,
    up: str | None = None,
) -> HeldPostures:
    """Read the postures of a file.

    Parameters
    ----------
    path : Path
        The file.
    found : Recognised
        What it is.
    layout : SkeletonMap, optional
        Of motion: what the points are; told by their names if not given.
    unit : str or float, optional
        Of motion: what lengths are in, instead of what the file says.
    up : str, optional
        Of motion: the axis that points up, instead of what the file says.

    Raises
    ------
    InputError
        Where it cannot be read, or holds no postures: the formats that do are named.
    """
    if found.holds is Content.POSTURES:
        return _at_once(read_postures(path))
    if found.holds is Content.RESULT:
        return postures_of_result(read_result(path))
    if found.holds is Content.CONFIGURATIONS:
        return _of_configurations(read_configurations(path))
    if found.holds is Content.SURVIVORS:
        return _of_table(read_survivors(path))
    if found.holds is Content.MOTION:
        return _of_motion(path, found, layout, None if unit is None else str(unit), up)
    if found.holds is Content.VIEW:
        return _of_truth(path, read_view(path))
    known = ", ".join(names(*POSTURE_CONTENTS))
    raise refusal(path, "", found.title, f"postures, as they are in {known}", "give another file")


def postures_of_result(result: Result) -> HeldPostures:
    """Return the survivors of all frames of a result, in the camera's frame.

    Parameters
    ----------
    result : Result
        The survivors of a view.
    """
    counts = [len(frame.joints) for frame in result.frames]
    joints = np.concatenate([np.empty((0, len(JOINTS), 3)), *(frame.joints for frame in result.frames)])
    time = np.repeat([frame.time for frame in result.frames], counts)
    return _held(Postures(joints=joints), np.repeat(np.arange(len(counts)), counts), time)


def _of_configurations(configurations: NamedConfigurations) -> HeldPostures:
    """Place the joints of the built-in figure, whose z points up: angles alone do not say lengths."""
    figure = load_figure()
    points = figure.forward_kinematics(configurations.in_order_of(tuple(figure.configuration_names)))
    count = len(points)
    return HeldPostures(
        postures=Postures(joints=points[:, : len(JOINTS)], head=points[:, len(JOINTS) :]),
        frame=np.arange(count),
        clip=np.zeros(count, dtype=np.intp),
        time=np.full(count, np.nan),
        up="+z",
    )


def _held(postures: Postures, frame: NDArray[np.intp], time: Array) -> HeldPostures:
    return HeldPostures(postures=postures, frame=frame, clip=np.zeros(len(frame), dtype=np.intp), time=time)


def _at_once(postures: Postures) -> HeldPostures:
    count = len(postures.joints)
    return _held(postures, np.zeros(count, dtype=np.intp), np.full(count, np.nan))


def _of_motion(
    path: Path, found: Recognised, layout: SkeletonMap | None, unit: str | None, up: str | None
) -> HeldPostures:
    one = found.only(path)
    if not one.reads:
        expected = ", ".join(
            known.name for known in formats(Content.MOTION) if isinstance(known, MotionFormat) and known.read
        )
        raise refusal(
            path, "format", f"{one.name}: {one.title}", f"points: {expected}", "choose a file of points"
        )
    motion = read_motion(path, one.name, unit=unit, up=up)
    postures = postures_of(motion, layout)
    if not motion.up:
        try:
            found_up = guess_up(postures.joints, motion.source)
        except InputError:  # nobody stands: whoever needs to know which way is up has to say it
            found_up = ""
    head = postures.head if np.isfinite(postures.head).any() else None
    return HeldPostures(
        postures=Postures(joints=postures.joints, head=head),
        frame=np.arange(len(motion)),
        clip=motion.clip.copy(),
        time=motion.time,
        up=motion.up or found_up,
        clips=motion.clips,
    )


def _of_table(table: SurvivorTable) -> HeldPostures:
    return _held(Postures(joints=table.joints), table.frame.astype(np.intp), table.time)


def _of_truth(path: Path, view: View) -> HeldPostures:
    known = np.flatnonzero(np.isfinite(view.truth).any(axis=(1, 2)))
    if not len(known):
        got = "a view without truth: what it shows is of a picture, and not yet in space"
        raise refusal(path, "", got, "postures", "recover the view, and give the result")
    return _held(Postures(joints=view.truth[known]), known, view.time[known])
