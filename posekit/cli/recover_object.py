"""`posekit recover --linkage`: another articulated object than a person."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from posekit.cli.judging_options import Tolerances
from posekit.cli.look_further import tell_further
from posekit.cli.options import about, progress
from posekit.cli.terminal import say
from posekit.errors import InputError

OPTIONS_OF_OBJECTS: Final = (
    "--output",
    "--linkage",
    "--scale",
    "--nearer",
    "--rigid-tolerance",
    "--tangent-tolerance",
)
"""Options that say something of an object too."""


def refuse_options_of_persons(given: Sequence[str]) -> None:
    """Refuse options that were given and say nothing of an object.

    Raises
    ------
    InputError
        For the first of them.
    """
    for name in given:
        if name not in OPTIONS_OF_OBJECTS:
            raise InputError(f"{name} is for persons; leave it out with --linkage")


def recover_object(
    view: Path, output: Path, linkage: str, scale: str, nearer: Path | None, tolerances: Tolerances
) -> None:
    """Recover an object from an uncalibrated view of it, and print what was found."""
    from posekit import objects
    from posekit.formats import own as files

    files.check_object_path(output)
    thing = objects.load_object(linkage)
    seen = files.read_object_view(view, thing.linkage)
    tolerance = objects.tolerance_of(thing, rigid=tolerances.rigid, tangent=tolerances.tangent)
    per_unit = 1.0 if seen.unit is None else files.PER_METRE[seen.unit]
    with progress("recovering", len(seen)) as done, about(view):
        result = objects.recover_object(
            seen,
            thing,
            scale=objects.parse_scale(scale, per_unit=per_unit) if scale else None,
            nearer=None if nearer is None else files.read_nearer(nearer),
            tolerance=tolerance,
            progress=done,
        )
    files.write_object(output, result)
    for line in objects.object_lines(result):
        say(line)
    say(f"written: {output}")
    if any(len(frame) for frame in result.frames):
        tell_further(output, moving=".trc")
