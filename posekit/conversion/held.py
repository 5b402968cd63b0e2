"""What is converted: what a file holds, or an object that is given instead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from posekit.errors import InputError
from posekit.formats import own as files
from posekit.formats.format import Content
from posekit.formats.held_postures import HeldPostures, held_postures
from posekit.formats.motion import Motion, read_motion
from posekit.formats.own import ObjectResult, Postures, Result, View
from posekit.formats.recognising import Recognised, recognise
from posekit.safe_io import refusal

Held = Result | View | Motion | Postures | ObjectResult

CONTENT_OF_TYPE: Final = {
    Result: Content.RESULT,
    View: Content.VIEW,
    Motion: Content.MOTION,
    Postures: Content.POSTURES,
    ObjectResult: Content.OBJECTS,
}
"""What a file of such an object would hold."""


def content_of(given: object) -> Content:
    """Say what a file of an object would hold.

    Raises
    ------
    InputError
        Where it is none that is converted.
    """
    for kind, content in CONTENT_OF_TYPE.items():
        if isinstance(given, kind):
            return content
    raise InputError(
        f"convert: got {type(given).__name__}; expected a path, a recovery, a result, a view, postures, motion or "
        "recovered objects"
    )


def read_held(
    given: Path | Held,
    what: Recognised | None,
    *,
    clip: str = "",
    unit: str = "",
    up: str = "",
    rate: float | None = None,
) -> Held | HeldPostures:
    """Read what a file holds; an object is taken as it is.

    Parameters
    ----------
    given : Path, Result, View, Motion, Postures or ObjectResult
        The file, or what one would hold.
    what : Recognised, optional
        What the file is, where that is known already.
    clip, unit, up : str
        Of motion: one of its clips, the unit of its lengths and the axis that points up, where the file's are to be
        overruled.
    rate : float, optional
        Frames a second of motion whose file says none.

    Raises
    ------
    InputError
        Where it cannot be read, there is no such clip, or nothing in it moves.
    """
    if not isinstance(given, Path):
        return _motion_as_asked(given, clip, unit, up) if isinstance(given, Motion) else given
    what = what or recognise(given)
    if what.holds is Content.RESULT:
        return files.read_result(given)
    if what.holds is Content.VIEW:
        return files.read_view(given)
    if what.holds is Content.OBJECTS:
        return files.read_object(given)
    if what.holds is Content.MOTION:
        name = what.names[0] if what.names else None
        motion = read_motion(given, name, unit=unit or None, up=up or None, rate=rate)
        return motion.of_clip(clip) if clip else motion
    if what.holds in (Content.POSTURES, Content.CONFIGURATIONS):
        return held_postures(given, what)
    remedy = "; convert the result that it is of" if what.holds is Content.SURVIVORS else ""
    raise InputError(
        f"{given}: {what.holds.value}, in which nothing moves; expected a result, postures or motion{remedy}"
    )


def _motion_as_asked(motion: Motion, clip: str, unit: str, up: str) -> Motion:
    if unit:
        raise refusal(motion.source, "unit", unit, "metres, as objects have", "leave it out")
    motion = replace(motion, up=up) if up else motion
    return motion.of_clip(clip) if clip else motion
