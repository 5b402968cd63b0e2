"""Options that say what a live camera sees, and what its points are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from posekit.cli.detector_options import Reading, Size
from posekit.cli.options import as_recover, option


@dataclass(frozen=True, kw_only=True)
class Watching:
    """The camera, the layout of the points, and how far the path looks ahead."""

    layout: Annotated[
        str,
        typer.Option(
            "--layout",
            "--skeleton",
            metavar="NAME|FILE",
            help="What the points are: a built-in skeleton map, as coco_17 or mediapipe_33, or a "
            "posekit.skeleton_map/1 TOML. Default: the 14 joints in tree order.",
        ),
    ] = ""
    camera: Annotated[
        str,
        option(
            "--camera",
            "FILE[:NAME]",
            "The calibration, as `posekit recover` has it. Without any camera a usual webcam's for --size.",
        ),
    ] = ""
    fov: Annotated[float | None, as_recover("--fov", "DEGREES")] = None
    focal35: Annotated[float | None, as_recover("--focal35", "MM")] = None
    size: Size = ""
    minimum_confidence: Annotated[float, as_recover("--min-confidence", "VALUE")] = 0.0
    lag: Annotated[
        int,
        typer.Option(
            "--lag",
            min=0,
            max=1000,
            help="Pictures that the path looks ahead: the more, the surer and later.",
        ),
    ] = 5

    def reading(self) -> Reading:
        """Return what these say of a detector's points."""
        return Reading(
            skeleton=self.layout,
            camera=self.camera,
            fov=self.fov,
            focal35=self.focal35,
            size=self.size,
            minimum_confidence=self.minimum_confidence,
        )
