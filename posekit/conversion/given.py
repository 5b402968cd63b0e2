"""What `posekit render` and `posekit view` draw: a result, postures, or whatever else has postures in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.formats.held_postures import HeldPostures
    from posekit.formats.own import ObjectResult, Postures, Result, View


def read_given(
    path: Path, seen: Path | None, *, explain: bool = False
) -> tuple[Result | Postures | HeldPostures | ObjectResult, View | None]:
    """Read postures of a person or an object, and the view behind a result; a view is recovered first.

    Parameters
    ----------
    path : Path
        The file, of any format that holds postures.
    seen : Path, optional
        The view that a result was recovered from.
    explain : bool
        Of a view: whether to list every pruned branch.

    Raises
    ------
    InputError
        Where it cannot be read, or holds no postures; where there is a view beside what is no result.
    """
    from posekit.formats import own as files
    from posekit.formats.format import Content
    from posekit.formats.held_postures import held_postures
    from posekit.formats.recognising import recognise

    found = recognise(path)
    if seen is not None and (seen.is_dir() or recognise(seen).holds is Content.KEY_POINTS):
        raise InputError(
            f"--view: {seen} holds a detector's key points, which say no camera; expected a view; write it: "
            f"posekit convert {seen} view.json, with the camera and the person that the result was recovered with"
        )
    behind = files.read_view(seen) if seen is not None else None
    if found.holds is Content.VIEW:
        from posekit.recovery import recover, result_of

        if behind is not None:
            raise InputError(
                "--view: the file is a view itself; expected a result beside it; leave the option out"
            )
        behind = files.read_view(path)
        recovery = recover(behind, group=0.05)
        return result_of(recovery, unit=behind.unit, explain=explain), behind
    if found.holds is Content.RESULT:
        return files.read_result(path), behind
    if behind is not None:
        raise InputError("--view: the file holds no result; expected one, recovered from that view")
    if found.holds is Content.OBJECTS:
        return files.read_object(path), None
    held = held_postures(path, found)
    # Postures without frames are drawn together, and lie as they are.
    return (held.postures if found.holds is Content.POSTURES else held), None


def frame_count(content: Result | Postures | HeldPostures | ObjectResult) -> int:
    """Count the frames of what is drawn; postures without frames are one.

    Parameters
    ----------
    content : Result, Postures, HeldPostures or ObjectResult
        What a file holds.
    """
    from posekit.formats.own import ObjectResult, Postures, Result

    if isinstance(content, Result | ObjectResult):
        return len(content.frames)
    return 1 if isinstance(content, Postures) else int(content.frame.max(initial=0)) + 1
