"""From one format to another: key points, views, postures that move, cameras."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posekit.conversion.motion_output import (
    TABLES,
    Output,
    by_suffix,
    carries_points,
    write_moving,
    write_points,
)
from posekit.conversion.moving import moving, one_clip, read_clips
from posekit.errors import InputError
from posekit.formats import own as files
from posekit.formats.cameras import read_cameras, write_cameras
from posekit.formats.keypoints import KeyPoints, formats, is_format, write_keypoints
from posekit.formats.kinds import Kind, kind_of
from posekit.formats.motion import UPS, motion_formats
from posekit.formats.own import View
from posekit.safe_io import nearest, refusal, shown
from posekit.views.opening import Opened, choose_person, open_views, read_detections
from posekit.views.source import Source
from posekit.views.view_keypoints import view_keypoints

OWN: Final = ("view", "postures")
"""Files of posekit that can be converted to."""

MOTION: Final = ("--format", "--skeleton", "--up", "--input-up", "--clip", "--unit")
DETECTOR: Final = ("--format", "--skeleton", "--person", "--swap-sides", "--size")
CAMERA_AND_PERSON: Final = (
    "--camera",
    "--fov",
    "--focal35",
    "--fps",
    "--min-confidence",
    "--deviation",
    "--stature",
    "--lengths",
    "--calibrate",
    "--proportions",
)
TELLING: Final = {
    Kind.MOTION: MOTION,
    Kind.RESULT: ("--posture", "--view", "--up", "--input-up"),
    Kind.VIEW: ("--skeleton", "--up", "--input-up"),
    Kind.POSTURES: ("--up", "--input-up"),
}
"""The options that say something about a kind of file."""


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
        The axis that shall point up in the output; the format's custom if empty.
    input_up : str
        The axis that points up in what is read, where the file does not say it or is wrong.
    clip, unit : str
        Of motion capture: one of its clips, and the unit of lengths where the file's is to be overruled.

    Raises
    ------
    InputError
        Where the format to write or an axis is none.
    """

    given: Path
    output: Path
    to: str = ""
    source: Source
    posture: str = "first"
    view: View | None = None
    up: str = ""
    input_up: str = ""
    clip: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        if self.to and self.to not in (*OWN, *motion_formats()) and not is_format(self.to):
            near = nearest(self.to, [*OWN, *formats(), *motion_formats()])
            raise refusal("--to", "", shown(self.to), "a known format", near)
        for option, axis in (("--up", self.up), ("--input-up", self.input_up)):
            if axis not in ("", *UPS):
                raise refusal(option, "", shown(axis), ", ".join(UPS), "name an axis")

    def check_options(self, kind: Kind, telling: tuple[str, ...]) -> None:
        """Refuse options that say nothing about such a file: whoever gave them expects something of them."""
        given = {
            **self.source.given,
            "--posture": self.posture != "first",
            "--view": self.view is not None,
            "--up": bool(self.up),
            "--input-up": bool(self.input_up),
            "--clip": bool(self.clip),
            "--unit": bool(self.unit),
        }
        for name, is_given in given.items():
            if is_given and name not in telling:
                to = f" to {self.to}" if self.to else ""
                expected = ", ".join(telling) or "no option but --to"
                raise InputError(
                    f"{name}: says nothing of {kind.value} that {'are' if kind.value.endswith('s') else 'is'} "
                    f"converted{to}; expected {expected}; leave it out"
                )


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
    job.check_options(what.kind, TELLING.get(what.kind, ()))
    if what.kind is Kind.CAMERA:
        return _cameras(job)
    if is_format(job.to):
        return _view_as_key_points(job, what.kind)
    if job.to == "view":
        raise refusal(
            job.given, "--to", f"view, of {what.kind.value}", "key points", "convert to postures or motion"
        )
    output = Output(path=job.output, to=job.to or by_suffix(job.output), up=job.up)
    if what.kind is Kind.MOTION and carries_points(output.to):
        motion = read_clips(job.given, what, clip=job.clip, unit=job.unit, up=job.input_up)
        carried = motion if output.to in TABLES else one_clip(motion)
        return write_points(output, carried, job.source.skeleton)
    found = moving(
        job.given,
        what,
        posture=job.posture,
        view=job.view,
        skeleton=job.source.skeleton,
        clip=job.clip,
        unit=job.unit,
        up=job.input_up,
    )
    return [*found.says, *write_moving(output, found, every=job.posture == "all")]


def of_person(path: Path, one: Opened, *, alone: bool) -> Path:
    """Name the file of one of several people: ``out.json`` becomes ``out.person2.json``."""
    return path if alone else path.with_name(f"{path.stem}.person{one.person}{path.suffix}")


def _key_points(job: Conversion) -> list[str]:
    """Write key points as a view, or in another detector's format."""
    to = job.to or ("view" if job.output.suffix.lower() == ".json" else "")
    if job.given.is_dir() and job.output.resolve().parent == job.given.resolve():
        raise refusal(
            job.output, "", "a place among the files that are read", "another folder", "name one beside it"
        )
    if is_format(to):
        job.check_options(Kind.KEY_POINTS, DETECTOR)
        found = read_detections(job.given, job.source)
        one = job.source.person not in ("", "all")
        return _write_key_points(job, choose_person(found, job.source.person) if one else found)
    job.check_options(Kind.KEY_POINTS, (*DETECTOR, *CAMERA_AND_PERSON))
    if to != "view":
        raise refusal(
            job.output,
            "",
            to or f"a name that ends in {job.output.suffix or 'nothing'}",
            f"--to view (.json), {', '.join(formats())}: key points are of a picture, and not yet in space",
            "recover the view, and convert the result",
        )
    people = open_views(job.given, job.source)
    says = list(dict.fromkeys(line for each in people for line in each.says))
    for each in people:
        path = of_person(job.output, each, alone=len(people) == 1)
        files.write_view(path, each.view)
        says.append(f"{path}: {len(each.view)} frames")
    return says


def _view_as_key_points(job: Conversion, kind: Kind) -> list[str]:
    """Write the image points of a view."""
    if kind is not Kind.VIEW:
        raise refusal(
            job.given,
            "--to",
            f"{job.to}, of {kind.value}",
            "a view or a detector's file: only they have points in a picture",
            f"choose postures, {', '.join(motion_formats())}",
        )
    return _write_key_points(job, view_keypoints(files.read_view(job.given), job.to, job.source.skeleton))


def _write_key_points(job: Conversion, found: KeyPoints) -> list[str]:
    write_keypoints(job.output, found, job.to)
    return [f"{len(found)} detections in {len(found.pictures)} pictures"]


def _cameras(job: Conversion) -> list[str]:
    if job.to:
        raise refusal(
            job.given, "--to", f"{job.to}, of cameras", "a name that ends in .toml or .yml", "leave it out"
        )
    cameras = read_cameras(job.given)
    write_cameras(job.output, cameras)
    return [f"{len(cameras)} cameras: {', '.join(cameras)}"]
