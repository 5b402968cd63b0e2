"""From the options about a detector's file to a `Source`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.pipeline.detected.source import Source


def source_of(
    *,
    format: str = "",
    skeleton: str = "",
    person: str = "",
    swap_sides: bool = False,
    camera: str = "",
    fov: float | None = None,
    focal35: float | None = None,
    size: str = "",
    fps: float | None = None,
    min_confidence: float = 0.0,
    deviation: float | None = None,
    stature: str = "",
    lengths: Path | None = None,
    calibrate: Path | None = None,
    proportions: str = "figure",
) -> Source:
    """Read the texts of the options."""
    from posekit.files import parse_length
    from posekit.pipeline.detected.source import Source

    return Source(
        format=format,
        skeleton=skeleton,
        person=person,
        swap_sides=swap_sides,
        camera=camera,
        fov=fov,
        focal35=focal35,
        size=pixels(size) if size else None,
        rate=fps,
        minimum_confidence=min_confidence,
        deviation=deviation,
        stature=parse_length(stature, name="--stature") if stature else None,
        lengths=lengths,
        calibrate=calibrate,
        proportions=proportions,
    )


def pixels(text: str) -> tuple[int, int]:
    """Read WIDTHxHEIGHT."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() and 0 < int(part) <= 10**6 for part in parts):
        raise InputError(f"--size: {text!r}; expected the picture's width and height in pixels, as 1920x1080")
    return int(parts[0]), int(parts[1])
