"""Options that say what is not seen, or not exactly: hidden joints, the depth of the neck, and noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from posekit.cli.detector_options import Deviation
from posekit.cli.options import as_recover, option


@dataclass(frozen=True, kw_only=True)
class Uncertain:
    """Hidden joints, the depth of the neck, and noise: `recover` explains it."""

    infer: Annotated[
        bool,
        typer.Option(
            "--infer/--no-infer",
            help="Complete joints that were not seen, each with the set of its positions.",
        ),
    ] = True
    root: Annotated[
        str,
        option(
            "--root",
            "HOW",
            "Calibrated views without a root: find the neck's depth by auto, head, torso or search.",
        ),
    ] = "auto"
    deviation: Deviation = None
    refine: Annotated[
        bool | None,
        typer.Option(
            "--refine/--no-refine",
            help="Turn survivors into the likeliest postures near them, and reject what the noise cannot explain. "
            "Default: wherever frames are not exact.",
        ),
    ] = None
    length_deviation: Annotated[
        float | None,
        option(
            "--length-deviation",
            "FRACTION",
            "How far lengths may be off, standard deviation of the body's size and of each; 0: exact. Default: as is "
            "known of the person: of lengths that are given 0.05 and 0.03.",
        ),
    ] = None
    coverage: Annotated[
        float,
        option(
            "--coverage",
            "SHARE",
            "Under noise, list the likeliest postures that hold this share of the probability; 1: all. What is not "
            "listed is counted and weighed.",
        ),
    ] = 0.99


@dataclass(frozen=True, kw_only=True)
class UncertainAsRecover(Uncertain):
    """The same, told more shortly."""

    infer: Annotated[bool, typer.Option("--infer/--no-infer", help="Complete joints that were not seen.")] = (
        True
    )
    root: Annotated[str, as_recover("--root", "HOW", ": auto, head, torso, search.")] = "auto"
    refine: Annotated[bool | None, as_recover("--refine/--no-refine")] = None
    length_deviation: Annotated[float | None, as_recover("--length-deviation", "FRACTION")] = None
    coverage: Annotated[float, as_recover("--coverage", "SHARE")] = 0.99
