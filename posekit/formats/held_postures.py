"""The postures that a file holds, whatever it holds them as: motion, a result, a table of survivors, a view's truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import load_figure
from posekit.formats.format import Content
from posekit.formats.held import HeldPostures
from posekit.formats.motion import SurvivorTable, read_survivors
from posekit.formats.motion.body_size import body_unit
from posekit.formats.motion.configuration_format import ConfigurationFormat
from posekit.formats.own import (
    NamedConfigurations,
    Postures,
    Result,
    View,
    read_postures,
    read_result,
    read_view,
)
from posekit.formats.own_files import OwnFormat
from posekit.formats.recognising import Recognised
from posekit.formats.registry import names as format_names
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.geometry import Array
from posekit.safe_io import refusal
from posekit.skeleton import JOINTS, POINTS

__all__ = [
    "POSTURE_CONTENTS",
    "HeldPostures",
    "configurations_of",
    "held_configurations",
    "held_postures",
    "postures_of_result",
]

SPATIAL_DETECTORS: Final = ("mediapipe", "mmpose", "mmpose-list")
"""Formats of key points whose files may have points in space, too."""
POSTURE_CONTENTS: Final = (
    Content.POSTURES,
    Content.RESULT,
    Content.MOTION,
    Content.SURVIVORS,
    Content.CONFIGURATIONS,
    Content.VIEW,
)
"""What files hold that have postures in them."""


def held_postures(
    path: Path,
    found: Recognised,
    *,
    layout: SkeletonMap | None = None,
    unit: str | float | None = None,
    up: str | None = None,
    rate: float | None = None,
    body_model: Path | None = None,
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
    rate : float, optional
        Of motion and configurations: frames a second, instead of what the file says.
    body_model : Path, optional
        Of the angles of a body model, as AMASS has them: the model's NPZ.

    Raises
    ------
    InputError
        Where it cannot be read, or holds no postures: the formats that do are named.
    """
    if found.holds is Content.POSTURES:
        return _at_once(read_postures(path), path, told=found.schema != "")
    if found.holds is Content.RESULT:
        return postures_of_result(read_result(path))
    if found.holds is Content.CONFIGURATIONS:
        figure = load_figure()  # angles alone do not say lengths: the built-in figure's, whose z points up
        variables = tuple(figure.configuration_names)
        return held_configurations(configurations_of(path, found, rate), variables, figure.forward_kinematics)
    if found.holds is Content.SURVIVORS:
        return _of_table(read_survivors(path))
    if found.holds is Content.MOTION or (
        found.holds is Content.KEY_POINTS
        and len(found.formats) == 1
        and found.formats[0].name in SPATIAL_DETECTORS
    ):
        from posekit.formats.held_motion import held_motion, read_recorded

        unit = None if unit is None else str(unit)
        recorded = read_recorded(path, found, unit=unit, up=up, body_model=body_model)
        return held_motion(recorded, layout=layout, unit=unit, up=up, rate=rate)
    if found.holds is Content.VIEW:
        return _of_truth(path, read_view(path))
    if found.holds is Content.OBJECTS:
        remedy = "its limits were checked when it was recovered; convert its points to trc, c3d, csv, npz or parquet"
        raise refusal(path, "", found.title, "postures of a person", remedy)
    known = ", ".join(format_names(*POSTURE_CONTENTS))
    remedies = {
        Content.KEY_POINTS: f"recover them first: posekit recover {path} -o RESULT",
        Content.BATCH: f"give its tables: {path}/shards",
    }
    remedy = remedies.get(found.holds, "give another file")
    raise refusal(path, "", found.title, f"postures, as they are in {known}", remedy)


def configurations_of(path: Path, found: Recognised, rate: float | None = None) -> NamedConfigurations:
    """Read configurations of a robot, in any format that holds them.

    Parameters
    ----------
    path : Path
        The file.
    found : Recognised
        What it is.
    rate : float, optional
        Frames a second, instead of what the file says.

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    one = found.only(path)
    if not isinstance(one, OwnFormat | ConfigurationFormat):
        raise refusal(path, "", found.title, "configurations of a robot", "give another file")
    read: NamedConfigurations = one.read(path)
    return read if rate is None else replace(read, time=np.arange(len(read)) / rate)


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


def held_configurations(
    configurations: NamedConfigurations, names: Sequence[str], positions: Callable[[Array], Array]
) -> HeldPostures:
    """Place the joints of a robot's configurations by forward kinematics, so that its ground and feet can be judged.

    Parameters
    ----------
    configurations : NamedConfigurations
        As a file has them.
    names : sequence of str (nq,)
        The robot's ``configuration_names``.
    positions : callable
        Forward kinematics: from q (N, nq) in the robot's order to points (N, 19, 3) in the order of
        `posekit.skeleton.POINTS`, metres, NaN where the robot has none; and after them those of feet, in the order of
        `posekit.skeleton.FEET_POINTS`, or none.

    Raises
    ------
    InputError
        Where the configurations are not that robot's.
    """
    q = configurations.in_order_of(names)
    points = positions(q)
    head, feet = points[:, len(JOINTS) : len(POINTS)], points[:, len(POINTS) :]
    count = len(points)
    return HeldPostures(
        postures=Postures(joints=points[:, : len(JOINTS)], head=head if np.isfinite(head).any() else None),
        frame=np.arange(count),
        clip=np.zeros(count, dtype=np.intp),
        time=configurations.time if len(configurations.time) else np.full(count, np.nan),
        up="+z",
        said=configurations.said,
        q=q,
        feet=feet if feet.size else np.empty(0),
    )


def _held(postures: Postures, frame: NDArray[np.intp], time: Array) -> HeldPostures:
    return HeldPostures(postures=postures, frame=frame, clip=np.zeros(len(frame), dtype=np.intp), time=time)


def _at_once(postures: Postures, path: Path, *, told: bool) -> HeldPostures:
    """Take postures whose unit is metres where the schema says so, and else told by their size."""
    count = len(postures.joints)
    held = _held(postures, np.zeros(count, dtype=np.intp), np.full(count, np.nan))
    size = body_unit(postures.joints, str(path), told=told)
    if size.metres == 1.0:
        return held
    head = None if postures.head is None else size.metres * postures.head
    scaled = Postures(joints=size.metres * postures.joints, head=head)
    said = f"lengths are taken as {size.name}: so the body is {size.stature:.2f} m tall"
    return replace(held, postures=scaled, unit=size.name, said=(said,))


def _of_table(table: SurvivorTable) -> HeldPostures:
    said = "a table of survivors says no tolerances; judge the result that it is of, which holds its own"
    return replace(
        _held(Postures(joints=table.joints), table.frame.astype(np.intp), table.time), said=(said,)
    )


def _of_truth(path: Path, view: View) -> HeldPostures:
    known = np.flatnonzero(np.isfinite(view.truth).any(axis=(1, 2)))
    if not len(known):
        got = "a view without truth: what it shows is of a picture, and not yet in space"
        raise refusal(path, "", got, "postures", "recover the view, and give the result")
    return _held(Postures(joints=view.truth[known]), known, view.time[known])
