"""From one format to another: key points, views, postures that move, cameras."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posekit.conversion.gaps import GAP_FILLINGS
from posekit.conversion.held import Held, content_of, read_held
from posekit.conversion.motion_output import (
    TABLE_FORMATS,
    MotionOutput,
    by_suffix,
    carries_points,
    write_moving,
    write_points,
)
from posekit.conversion.moving import one_clip, sequence_of
from posekit.conversion.object_points import write_object_points
from posekit.conversion.rerun_recording import write_rerun_result
from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats import own as files
from posekit.formats.cameras import read_cameras, write_cameras
from posekit.formats.format import Content
from posekit.formats.keypoints import is_format
from posekit.formats.motion import UP_DIRECTIONS, Motion, motion_formats
from posekit.formats.own import ObjectResult, Result, View
from posekit.formats.recognising import recognise
from posekit.safe_io import nearest, refusal, shown
from posekit.views.opened import of_person
from posekit.views.opening import open_views
from posekit.views.source import Source

OWN_TARGETS: Final = ("view", "postures")
"""Files of posekit that can be converted to."""

MOTION_OPTIONS: Final = ("--format", "--skeleton", "--up", "--input-up", "--clip", "--unit", "--fps")
DETECTOR_OPTIONS: Final = ("--format", "--skeleton", "--person", "--swap-sides", "--size")
CAMERA_AND_PERSON_OPTIONS: Final = (
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
OPTIONS_OF: Final = {
    Content.MOTION: MOTION_OPTIONS,
    Content.RESULT: ("--posture", "--view", "--up", "--input-up", "--gaps", "--over"),
    Content.OBJECTS: ("--posture", "--up", "--input-up"),
    Content.VIEW: ("--skeleton", "--up", "--input-up", "--gaps"),
    Content.POSTURES: ("--up", "--input-up"),
    Content.CONFIGURATIONS: ("--up", "--input-up"),
}
"""The options that say something about a kind of file."""


@dataclass(frozen=True, kw_only=True)
class Conversion:
    """What to convert, and how.

    Parameters
    ----------
    given : Path, Result, View, Motion, Postures or ObjectResult
        The file that is read, or what one would hold.
    output : Path
        The file that is written.
    to : str
        The format to write: ``view``, ``postures``, or one of motion; by the output's name if empty.
    source : Source
        How a detector's file is to be read.
    posture : str
        Of a result: ``likeliest``, ``path``, a number from 0, or ``all``; if empty the path where the frames were
        followed, else the likeliest.
    view : View, optional
        What a result was recovered from.
    up : str
        The axis that shall point up in the output; the format's custom if empty.
    input_up : str
        The axis that points up in what is read, where the file does not say it or is wrong.
    clip, unit : str
        Of motion capture: one of its clips, and the unit of lengths where the file's is to be overruled.
    gaps : str
        How frames without a posture and unseen joints are filled: ``interpolate``, ``hold``, or ``leave-out``; by what
        the format can hold if empty.
    over : Path, optional
        Of a result that becomes a recording for Rerun: the photograph, folder or video that it came from.

    Raises
    ------
    InputError
        Where the format to write or an axis is none, or the output is the file that is read.
    """

    given: Path | Held
    output: Path
    to: str = ""
    source: Source
    posture: str = ""
    view: View | None = None
    up: str = ""
    input_up: str = ""
    clip: str = ""
    unit: str = ""
    gaps: str = ""
    over: Path | None = None

    def __post_init__(self) -> None:
        given = self.given
        if (
            isinstance(given, Path)
            and self.output.exists()
            and given.exists()
            and self.output.samefile(given)
        ):
            raise refusal(self.output, "", "the file that is read", "another name", "choose one")
        written = (*OWN_TARGETS, *(one.name for one in motion_formats().values() if one.writes))
        if self.to and is_format(self.to):
            got = f"{self.to}, which detectors write and posekit reads"
            raise refusal("--to", "", got, ", ".join(written), "choose one of them")
        if self.to and self.to not in written:
            raise refusal("--to", "", shown(self.to), "a known format", nearest(self.to, written))
        if self.gaps and self.gaps not in GAP_FILLINGS:
            raise refusal(
                "--gaps", "", shown(self.gaps), ", ".join(GAP_FILLINGS), nearest(self.gaps, GAP_FILLINGS)
            )
        for option, axis in (("--up", self.up), ("--input-up", self.input_up)):
            if axis not in ("", *UP_DIRECTIONS):
                raise refusal(option, "", shown(axis), ", ".join(UP_DIRECTIONS), "name an axis")

    @property
    def named(self) -> str:
        """How errors call what is converted: by its file, or by what it is."""
        return str(self.given) if isinstance(self.given, Path) else content_of(self.given).value

    def check_options(self, kind: Content, telling: tuple[str, ...]) -> None:
        """Refuse options that say nothing about such a file: whoever gave them expects something of them."""
        given = {
            **self.source.given,
            "--posture": bool(self.posture),
            "--view": self.view is not None,
            "--up": bool(self.up),
            "--input-up": bool(self.input_up),
            "--clip": bool(self.clip),
            "--unit": bool(self.unit),
            "--gaps": bool(self.gaps),
            "--over": self.over is not None,
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
    """Convert a file or an object, and return what was done, a line each.

    Raises
    ------
    InputError
        Where one of the two formats is not known, or cannot carry what the other has.
    """
    what = recognise(job.given, job.source.format) if isinstance(job.given, Path) else None
    holds = content_of(job.given) if what is None else what.holds
    if holds is Content.KEY_POINTS:
        return _key_points(job)
    job.check_options(holds, OPTIONS_OF.get(holds, ()))
    if holds is Content.CAMERAS:
        return _cameras(job)
    if job.to == "view":
        raise refusal(
            job.named, "--to", f"view, of {holds.value}", "key points", "convert to postures or motion"
        )
    output = MotionOutput(path=job.output, to=job.to or by_suffix(job.output), up=job.up, gaps=job.gaps)
    if job.over is not None and output.to != "rerun":
        raise InputError(
            f"--over: {output.to} holds no pictures; expected .rrd; or draw them: posekit render --over"
        )
    held = read_held(job.given, what, clip=job.clip, unit=job.unit, up=job.input_up, rate=job.source.rate)
    if isinstance(held, Motion) and carries_points(output.to):
        carried = held if output.to in TABLE_FORMATS else one_clip(held)
        return write_points(output, carried, job.source.skeleton)
    if isinstance(held, ObjectResult):
        return write_object_points(output, held, job.named, posture=job.posture, up=job.input_up)
    if isinstance(held, Result) and output.to == "rerun":
        return write_rerun_result(job.output, held, job.view, job.over)
    found = sequence_of(
        held, job.named, posture=job.posture, view=job.view, skeleton=job.source.skeleton, up=job.input_up
    )
    return write_moving(output, found, every=job.posture == "all")


def _key_points(job: Conversion) -> list[str]:
    """Write the views of the people in key points: a file of one, or one a person."""
    given = Path(job.named)
    to = job.to or ("view" if job.output.suffix.lower() == ".json" else "")
    if given.is_dir() and job.output.resolve().parent == given.resolve():
        raise refusal(
            job.output, "", "a place among the files that are read", "another folder", "name one beside it"
        )
    job.check_options(Content.KEY_POINTS, (*DETECTOR_OPTIONS, *CAMERA_AND_PERSON_OPTIONS))
    if to != "view":
        raise refusal(
            job.output,
            "",
            to or f"a name that ends in {job.output.suffix or 'nothing'}",
            "--to view (.json): key points are of a picture, and not yet in space",
            "recover the view, and convert the result",
        )
    people = open_views(given, job.source)
    says = list(dict.fromkeys(line for each in people for line in each.says))
    for each in people:
        path = of_person(job.output, each, alone=len(people) == 1)
        files.write_view(path, each.view)
        says.append(f"{path}: {plural(len(each.view), 'frame')}")
    return says


def _cameras(job: Conversion) -> list[str]:
    if job.to:
        raise refusal(
            job.named, "--to", f"{job.to}, of cameras", "a name that ends in .toml or .yml", "leave it out"
        )
    cameras = read_cameras(job.named)
    write_cameras(job.output, cameras)
    return [f"{plural(len(cameras), 'camera')}: {', '.join(cameras)}"]
