"""Options that say how a detector's file is to be read, and whose body it shows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from posekit.cli.options import option

Format = Annotated[
    str,
    option(
        "--format",
        "NAME",
        "The format of what is read, where its structure does not tell: openpose, coco, mediapipe, trc, …",
    ),
]
Skeleton = Annotated[
    str,
    option(
        "--skeleton",
        "NAME|FILE",
        "What the points are: a built-in skeleton map, as body_25b, or a posekit.skeleton_map/1 TOML.",
    ),
]
SwapSides = Annotated[
    bool, typer.Option("--swap-sides", help="Exchange left and right: the file has them the wrong way round.")
]
Size = Annotated[str, option("--size", "WxH", "The picture's width and height, where the file does not say.")]
Deviation = Annotated[
    float | None,
    option(
        "--deviation",
        "PX",
        "Standard deviation of the image points, pixels: how far off they may be. Default: the view's, else 3 "
        "of a detector's before a calibrated camera, and 1; necks are searched with 5 and 2.",
    ),
]
Proportions = Annotated[
    str,
    option(
        "--proportions",
        "NAME",
        "By which proportions a stature gives lengths: drillis-contini, winter, de-leva, table-a1. In "
        "uncalibrated views also taylor (his 12 points, no neck and pelvis).",
    ),
]
Unit = Annotated[
    str,
    option("--unit", "NAME", "Of motion capture: m, cm, mm or in, where the file's is wrong or not said."),
]


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How a detector's file is to be read: who, with which camera."""

    format: Format = ""
    skeleton: Skeleton = ""
    person: Annotated[
        str,
        option(
            "--person",
            "WHO",
            "largest, surest, first, a track's number from `posekit inspect`, or all. Default: the only one, else "
            "largest.",
        ),
    ] = ""
    swap_sides: SwapSides = False
    camera: Annotated[
        str,
        option(
            "--camera",
            "FILE[:NAME]",
            "The calibration: OpenCV, Pose2Sim or Anipose TOML, COLMAP, NPZ; or the photograph, whose EXIF "
            "gives a guess. NAME where it has several cameras. Without any camera the view is scaled orthographic.",
        ),
    ] = ""
    fov: Annotated[
        float | None,
        option("--fov", "DEGREES", "A guess instead of a calibration: the horizontal field of view."),
    ] = None
    focal35: Annotated[
        float | None, option("--focal35", "MM", "A guess: the focal length in 35 mm equivalents.")
    ] = None
    size: Size = ""
    rate: Annotated[
        float | None, option("--fps", "RATE", "Frames a second, where the file does not say. Default: 30.")
    ] = None
    minimum_confidence: Annotated[
        float,
        option(
            "--min-confidence", "VALUE", "Points that are less sure than this count as not seen.", min=0.0
        ),
    ] = 0.0


@dataclass(frozen=True, kw_only=True)
class Who:
    """Whose body it shows: what gives the lengths."""

    stature: Annotated[
        str, option("--stature", "LENGTH", "The person's height, as 175cm: gives the lengths.")
    ] = ""
    lengths: Annotated[
        Path | None, option("--lengths", "FILE", "The person's segment lengths: posekit.lengths/1.")
    ] = None
    calibrate: Annotated[
        Path | None,
        option(
            "--calibrate",
            "FILE",
            "A recording of the same person, from which lengths are estimated: motion capture, or key points of "
            "the same camera (with --stature).",
        ),
    ] = None
