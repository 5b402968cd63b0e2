"""`posekit convert`: from one format to another."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from posekit.cli.detector_options import Deviation, Proportions, Reading, Unit, Who
from posekit.cli.detector_source import source_of
from posekit.cli.groups import with_groups
from posekit.cli.options import examples, option
from posekit.cli.terminal import say
from posekit.errors import PosekitError

CONVERT_EXAMPLES = examples(
    "posekit convert keypoints/ view.json --camera calibration.toml:cam_01 --stature 175cm",
    "posekit convert predictions.json view.json --person largest --fov 60",
    "posekit convert postures.json walk.bvh",
    "posekit convert postures.json walk.trc --view view.json",
    "posekit convert postures.json survivors.csv --posture all",
    "posekit convert trial.c3d trial.trc",
)


@with_groups
def convert(
    *,
    given: Annotated[Path, typer.Argument(metavar="IN", help="A file or folder of any format that is read.")],
    output: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="The end of its name says the format, unless --to does; a name without an end is a folder with the "
            "person's URDF.",
        ),
    ],
    to: Annotated[
        str,
        option(
            "--to",
            "NAME",
            "The format to write: view, postures, or one of motion (trc, c3d, csv, npz, parquet, mot, bvh, glb, "
            "urdf).",
        ),
    ] = "",
    posture: Annotated[
        str,
        option(
            "--posture",
            "WHICH",
            "Of a result: likeliest, path (through all frames, if they were followed), a number from 0, or all, the "
            "likeliest first (csv, npz, parquet, glb). Default: the path if there is one, else the likeliest.",
        ),
    ] = "",
    view: Annotated[
        Path | None,
        option(
            "--view",
            "VIEW",
            "What a result was recovered from: puts it into its camera's world (newer results hold theirs).",
        ),
    ] = None,
    gaps: Annotated[
        str,
        option(
            "--gaps",
            "interpolate|hold|leave-out",
            "What to do in a result where a frame has no posture or a joint was not seen. Default: interpolate "
            "in bvh and c3d, which have no place for it; else leave-out.",
        ),
    ] = "",
    over: Annotated[
        Path | None,
        option(
            "--over",
            "IMAGE|FOLDER|VIDEO",
            "Of a result that becomes .rrd: the pictures that it came from, recorded behind its points.",
        ),
    ] = None,
    up: Annotated[
        str, option("--up", "AXIS", "The axis that shall point up, as +z. Default: by custom.")
    ] = "",
    input_up: Annotated[
        str,
        option(
            "--input-up",
            "AXIS",
            "The axis that points up in IN, where it does not say it or is wrong: of a result, in the camera's "
            "frame (-y where the camera is level), or with --view in its world.",
        ),
    ] = "",
    clip: Annotated[str, option("--clip", "NAME", "Of motion capture with several clips: which.")] = "",
    unit: Unit = "",
    reading: Reading,
    deviation: Deviation = None,
    who: Who,
    proportions: Proportions = "figure",
) -> None:
    """Convert a file: key points to views, results and motion capture to what other programs open."""
    from posekit.conversion.conversion import Conversion
    from posekit.conversion.conversion import convert as run
    from posekit.formats import own as files

    job = Conversion(
        given=given,
        output=output,
        to=to,
        posture=posture,
        gaps=gaps,
        over=over,
        view=None if view is None else files.read_view(view),
        up=up,
        input_up=input_up,
        clip=clip,
        unit=unit,
        source=source_of(reading, who, proportions=proportions, deviation=deviation),
    )
    with _naming(given, output):
        lines = run(job)
    for line in lines:
        say(line)
    say(f"written: {output}")


@contextmanager
def _naming(given: Path, output: Path) -> Iterator[None]:
    """Name the file in errors that name neither a file nor an option."""
    try:
        yield
    except PosekitError as error:
        if str(error).startswith(("--", str(given), str(output))):
            raise
        raise type(error)(f"{given}: {error}") from error
