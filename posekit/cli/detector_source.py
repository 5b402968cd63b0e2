"""From the options about a detector's file to a `Source`."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from posekit.cli.detector_options import Reading, Who
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.views.source import Source


def source_of(
    reading: Reading, who: Who, *, proportions: str = "figure", deviation: float | None = None
) -> Source:
    """Read the texts of the options."""
    from posekit.formats.own import parse_length
    from posekit.views.source import Source

    said = asdict(reading) | asdict(who)
    return Source(
        **said
        | {
            "size": pixels(reading.size) if reading.size else None,
            "stature": parse_length(who.stature, name="--stature") if who.stature else None,
        },
        deviation=deviation,
        proportions=proportions,
    )


def pixels(text: str) -> tuple[int, int]:
    """Read WIDTHxHEIGHT."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() and 0 < int(part) <= 10**6 for part in parts):
        raise InputError(f"--size: {text!r}; expected the picture's width and height in pixels, as 1920x1080")
    return int(parts[0]), int(parts[1])
