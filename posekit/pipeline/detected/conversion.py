"""From one format to another: key points, views, postures that move, cameras."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from posekit import files
from posekit.calibration import read_cameras, write_cameras
from posekit.errors import InputError
from posekit.files import Postures, View
from posekit.intake import refusal
from posekit.keypoints import KeyPoints, choose, formats, is_format, write_keypoints
from posekit.motion import (
    UPS,
    Motion,
    motion_format,
    motion_formats,
    with_up,
    write_configurations,
    write_motion,
    write_survivors,
)
from posekit.motion.glb import write_postures_glb
from posekit.pipeline.detected.kinds import Kind, kind_of
from posekit.pipeline.detected.moving import Moving, moving, one_clip
from posekit.pipeline.detected.opening import Opened, open_views, read_detections
from posekit.pipeline.detected.source import Source
from posekit.pipeline.detected.view_keypoints import view_keypoints

CUSTOM: Final = {"trc": "+y", "c3d": "+z", "csv": "", "npz": "", "parquet": ""}
"""The axis that points up in a format's files by custom; empty where it stays as it is."""

TABLES: Final = ("csv", "npz", "parquet")
"""Formats that carry all survivors of a frame."""


@dataclass(frozen=True, kw_only=True)
class Conversion:
    """What to convert, and how.

    Parameters
    ----------
    given, output : Path
    to : str
        The format to write: ``view``, ``postures``, one of key points or of motion; by the output's name if empty.
    source : Source
        How a detector's file is to be read.
    posture : str
        Of a result: ``first``, a number from 1, or ``all``.
    view : View, optional
        What a result was recovered from.
    up : str
        The axis that shall point up; the format's custom if empty.
    clip, unit : str
        Of motion capture: one of its clips, and the unit of lengths where the file's is to be overruled.
    """

    given: Path
    output: Path
    to: str = ""
    source: Source
    posture: str = "first"
    view: View | None = None
    up: str = ""
    clip: str = ""
    unit: str = ""


def convert(job: Conversion) -> list[str]:
    """Convert a file, and return what was done, a line each.

    Raises
    ------
    InputError
        Where one of the two formats is not known, or cannot carry what the other has.
    """
    what = kind_of(job.given, job.source.format)
    if what.kind is Kind.KEY_POINTS:
        return _key_points(job)
    if what.kind is Kind.CAMERA:
        cameras = read_cameras(job.given)
        write_cameras(job.output, cameras)
        return [f"{len(cameras)} cameras: {', '.join(cameras)}"]
    if what.kind is Kind.VIEW and is_format(job.to):
        return _write_key_points(job, view_keypoints(files.read_view(job.given), job.to, job.source.skeleton))
    if what.kind is Kind.MOTION and _carries_points(job):
        return _points(job, one_clip(job.given, what, clip=job.clip, unit=job.unit))
    found = moving(
        job.given,
        what,
        posture=job.posture,
        view=job.view,
        skeleton=job.source.skeleton,
        clip=job.clip,
        unit=job.unit,
    )
    return [*found.says, *_write_moving(job, found)]


def _key_points(job: Conversion) -> list[str]:
    """Write key points as a view, or in another detector's format."""
    to = job.to or ("view" if job.output.suffix.lower() == ".json" else "")
    if is_format(to):
        found = read_detections(job.given, job.source)
        one = job.source.person not in ("", "all")
        return _write_key_points(job, choose(found, job.source.person) if one else found)
    if to != "view":
        raise refusal(
            job.output,
            "--to",
            to or f"a name that ends in {job.output.suffix or 'nothing'}",
            f"view (.json), {', '.join(formats())}: key points are of a picture, and not yet in space",
            "recover the view, and convert the result",
        )
    says = []
    people = open_views(job.given, job.source)
    for each in people:
        path = of_person(job.output, each, alone=len(people) == 1)
        files.write_view(path, each.view)
        says += [*each.says, f"{path}: {len(each.view)} frames"]
    return says


def of_person(path: Path, one: Opened, *, alone: bool) -> Path:
    """Name the file of one of several people: ``out.json`` becomes ``out.person2.json``."""
    return path if alone else path.with_name(f"{path.stem}.person{one.person}{path.suffix}")


def _write_key_points(job: Conversion, found: KeyPoints) -> list[str]:
    write_keypoints(job.output, found, job.to)
    return [f"{len(found)} detections in {len(found.pictures)} pictures"]


def _write_moving(job: Conversion, found: Moving) -> list[str]:
    suffix = job.output.suffix.lower()
    if job.to == "postures" or (not job.to and suffix == ".json"):
        head = found.points[:, 14:]
        files.write_postures(
            job.output,
            Postures(joints=found.points[:, :14], head=head if np.isfinite(head).any() else None),
        )
        return [f"{len(found.points)} postures"]
    name = job.to or _by_suffix(job.output)
    chosen = motion_format(name)
    several = len(np.unique(found.frame)) < len(found.frame)
    if several:
        return _write_survivors(job, found, name)
    if chosen.write_points is not None:
        return _points(job, found.motion(str(job.given)))
    q, off = found.configurations()
    write_configurations(job.output, found.figure, q, found.time, name)
    return [
        f"{len(q)} frames of joint angles; the figure's joints are within {off * 100:.2g} cm of the postures'"
    ]


def _carries_points(job: Conversion) -> bool:
    """Tell whether the output has any points, and not only a body's joints or angles."""
    if job.to == "postures" or (not job.to and job.output.suffix.lower() == ".json"):
        return False
    return motion_format(job.to or _by_suffix(job.output)).write_points is not None


def _points(job: Conversion, motion: Motion) -> list[str]:
    """Write points, all that there are."""
    name = job.to or _by_suffix(job.output)
    up = job.up or CUSTOM.get(name, "") or motion.up
    if up not in ("", *UPS):
        raise refusal("--up", "", up, ", ".join(UPS), "name an axis")
    turned = with_up(motion, up) if up else motion
    write_motion(job.output, turned, name)
    return [
        f"{len(motion)} frames of {len(motion.names)} points, {turned.up or 'an axis that is not said'} up"
    ]


def _write_survivors(job: Conversion, found: Moving, name: str) -> list[str]:
    if name in TABLES:
        write_survivors(job.output, found.table())
        return [f"{len(found.points)} survivors of {len(np.unique(found.frame))} frames"]
    if name == "glb":
        first = found.frame == found.frame[0]
        q, _ = found.configurations()
        write_postures_glb(job.output, found.figure, q[first])
        return [f"the {int(first.sum())} survivors of the first frame that has any"]
    raise InputError(
        f"--posture: all, but {name} carries one posture a frame; expected {', '.join(TABLES)} or glb; choose one of "
        "them, or --posture first"
    )


def _by_suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    named = [one.name for one in motion_formats().values() if suffix in one.suffixes]
    if len(named) != 1:
        known = ", ".join(end for one in motion_formats().values() for end in one.suffixes)
        raise refusal(
            path,
            "",
            f"a name that ends in {suffix or 'nothing'}",
            f"one of {known}, .json",
            "name it so, or say --to",
        )
    return named[0]
