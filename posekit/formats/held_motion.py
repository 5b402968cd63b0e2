"""Postures of a file of motion, as they were recorded: with the unit, the way up and the times that are found in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.format import Content
from posekit.formats.held import HeldPostures
from posekit.formats.motion import Motion, postures_of, read_motion
from posekit.formats.motion.amass import AMASS_FORMAT, read_amass
from posekit.formats.motion.body_size import BodyUnit, body_unit, stature_of
from posekit.formats.motion.detected import read_detected
from posekit.formats.motion.ground_up import FoundUp, against_stated_up, find_up
from posekit.formats.motion.motion_format import MotionFormat
from posekit.formats.motion.people_in_motion import people_apart
from posekit.formats.own import Postures
from posekit.formats.recognising import Recognised
from posekit.formats.registry import formats
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.geometry import Array
from posekit.safe_io import refusal
from posekit.skeleton import JOINT

ANOTHER_SIZE: Final = 2.5
"""Times as tall, or as small, as the others a body is whose clip is in another unit: an inch in centimetres."""
ORIGIN_METRES: Final = 0.03
"""How far from the origin the middle of the hips is where each frame has its own."""


def read_recorded(
    path: Path,
    found: Recognised,
    *,
    unit: str | None = None,
    up: str | None = None,
    body_model: Path | None = None,
) -> Motion:
    """Read motion as it was recorded.

    Parameters
    ----------
    path : Path
        The file.
    found : Recognised
        What it is.
    unit, up : str, optional
        Instead of what the file says.
    body_model : Path, optional
        Of the angles of a body model: the model's NPZ.

    Raises
    ------
    InputError
        Where it cannot be read, or its format carries no points.
    """
    one = found.only(path)
    if found.holds is Content.KEY_POINTS:
        detected = read_detected(path, one.name, unit)
        return detected if up is None else replace(detected, up=up, told=(*detected.told, "up"))
    if not one.reads:
        expected = ", ".join(
            known.name for known in formats(Content.MOTION) if isinstance(known, MotionFormat) and known.read
        )
        raise refusal(
            path, "format", f"{one.name}: {one.title}", f"points: {expected}", "choose a file of points"
        )
    if one is AMASS_FORMAT:
        motion = read_amass(path, body_model)
        return motion if up is None else replace(motion, up=up, told=(*motion.told, "up"))
    return read_motion(path, one.name, unit=unit, up=up, as_recorded=True)


def held_motion(
    motion: Motion,
    *,
    layout: SkeletonMap | None = None,
    unit: str | None = None,
    up: str | None = None,
    rate: float | None = None,
) -> HeldPostures:
    """Tell the postures of recorded motion, its unit and its way up.

    Parameters
    ----------
    motion : Motion
        As `read_recorded` gives it.
    layout : SkeletonMap, optional
        What the points are; told by their names if not given.
    unit, up : str, optional
        What was stated, and is not asked of the file.
    rate : float, optional
        Frames a second, instead of the file's.

    Raises
    ------
    InputError
        Where nobody's points are in it, or unit or up are not what the file says.
    """
    motion = people_apart(motion)
    found = postures_of(motion, layout)
    if unit is None:
        size = body_unit(found.joints, motion.source, told="unit" in motion.told)
    else:
        size = BodyUnit(unit, 1.0, np.nan)  # what was stated, it was read by
    joints, head = size.metres * found.joints, size.metres * found.head
    said = list(motion.said)
    if size.metres != 1.0:
        said.append(f"lengths are taken as {size.name}: so the body is {size.stature:.2f} m tall")
    said += _odd_clips(joints, motion)
    if up is None:
        way = find_up(joints, motion.clip, motion.up, motion.source, told="up" in motion.told)
    else:
        way = FoundUp(up, "; ".join(against_stated_up(joints, motion.clip, up)))
    said += [way.said] if way.said else []
    in_world = _in_world(joints)
    if not in_world:
        said.append("each frame has its own origin, the middle of the hips: nothing is known of the ground")
    time = motion.time if rate is None else _counted(motion.clip) / rate
    if len(motion) and np.isnan(time).all():
        said.append("the file says no times, and no frame rate that is above 0 (--rate)")
    return HeldPostures(
        postures=Postures(joints=joints, head=head if np.isfinite(head).any() else None),
        frame=np.arange(len(motion)),
        clip=motion.clip.copy(),
        time=time,
        up=way.up,
        clips=motion.clips,
        unit=size.name,
        in_world=in_world,
        said=tuple(said),
        feet=size.metres * found.feet,
    )


def _odd_clips(joints: Array, motion: Motion) -> list[str]:
    """Name the clips whose body is not the size of the others'."""
    if len(motion.clips) < 2:
        return []
    sizes = np.array([stature_of(joints[motion.clip == index]) for index in range(len(motion.clips))])
    usual = float(np.nanmedian(sizes)) if np.isfinite(sizes).any() else np.nan
    odd = (sizes > ANOTHER_SIZE * usual) | (sizes < usual / ANOTHER_SIZE)
    return [
        f"clip {motion.clips[index]}: the body is {sizes[index]:.3g} m tall, in the others {usual:.2f} m: another unit?"
        for index in np.flatnonzero(odd)
    ]


def _in_world(joints: Array) -> bool:
    """Tell whether the body goes anywhere: whether hips are not around the origin in every frame."""
    hips = joints[:, [JOINT["right_hip"], JOINT["left_hip"]]].mean(axis=1)
    away = np.linalg.norm(hips[np.isfinite(hips).all(axis=1)], axis=1)
    return len(away) < 2 or bool((away > ORIGIN_METRES).any())


def _counted(clip: NDArray[np.intp]) -> Array:
    """Count the frames of each clip, from 0."""
    count = np.zeros(len(clip))
    for index in np.unique(clip):
        rows = np.flatnonzero(clip == index)
        count[rows] = np.arange(len(rows))
    return count
