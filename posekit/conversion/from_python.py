"""`posekit.convert` and `posekit.render`: what the commands of these names do, of files and of objects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from posekit.conversion.composed import DrawnChoice, write_whole_page
from posekit.conversion.given import read_given
from posekit.conversion.held import Held, content_of
from posekit.errors import InputError
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import ObjectResult, Postures, Result, View, read_view
from posekit.recovery.recovery import Recovery
from posekit.recovery.result import result_of

if TYPE_CHECKING:
    from posekit.views.source import Source


def convert(
    given: str | Path | Recovery | Held,
    output: str | Path,
    *,
    view: str | Path | View | None = None,
    source: Source | None = None,
    **options: Any,
) -> list[str]:
    """Convert a file, or what was read or recovered, to another format: what `posekit convert` does.

    Parameters
    ----------
    given : path, Recovery, Result, View, Postures, Motion or ObjectResult
        What is converted; nothing is written but the output.
    output : path
        The end of its name says the format, unless `to` does; a name without an end is a folder with the URDF.
    view : path or View, optional
        What a result was recovered from: puts it into its camera's world.
    source : Source, optional
        How a detector's file is to be read.
    **options
        Others of `posekit.conversion.Conversion`, as the command has them: ``to``, ``posture``, ``up``, ``input_up``,
        ``clip``, ``unit``, ``gaps``, ``over``.

    Returns
    -------
    list of str
        What was done, a line each.

    Raises
    ------
    InputError
        Where one of the two formats is not known, or cannot carry what the other has.

    Examples
    --------
    >>> import posekit
    >>> recovery = posekit.recover(posekit.builtin_view("seq1"))
    >>> posekit.convert(recovery, "walk.bvh")  # doctest: +SKIP
    """
    from posekit.conversion.conversion import Conversion
    from posekit.conversion.conversion import convert as run
    from posekit.views.source import Source as AsItIs

    allowed = Conversion.__dataclass_fields__.keys() - {"given", "output", "view", "source"}
    for name in options:
        if name not in allowed:
            raise InputError(f"convert: {name}: is no option; expected some of {', '.join(sorted(allowed))}")
    behind = read_view(view) if isinstance(view, str | Path) else view
    if isinstance(given, str | Path):
        given = Path(given)
    elif isinstance(given, Recovery):
        given = result_of(given)
    else:
        content_of(given)
    return run(
        Conversion(given=given, output=Path(output), view=behind, source=source or AsItIs(), **options)
    )


def render(
    given: str | Path | Recovery | Result | View | Postures | HeldPostures | ObjectResult,
    output: str | Path,
    *,
    view: str | Path | View | None = None,
    frame: str | int = "",
    posture: str | int = "",
    style: Any = None,
    shot: Any = None,
) -> int:
    """Draw postures as a picture, an animation, or a page to be turned by hand: what `posekit render` does.

    Parameters
    ----------
    given : path, Recovery, Result, View, Postures, HeldPostures or ObjectResult
        What is drawn; a view is recovered first.
    output : path
        ``.png``, ``.gif``, ``.mp4``; or ``.html``: the page of all survivors.
    view : path or View, optional
        What a result was recovered from: its camera and image are drawn, too.
    frame : int or str
        From 0; or ``A-B``. The first with a posture, or all where it moves, if empty.
    posture : int or str
        From 0, as ``0,4``; ``all``, ``likeliest``, ``path`` or ``groups``. The likeliest and what else it can be, or
        where it moves the likeliest path, if empty.
    style : Style, optional
        How postures are composed (`posekit.viewer.Style`).
    shot : Shot, optional
        The size of the picture, and from where it is taken (`posekit.viewer.Shot`). Without one, films are as fast as
        the frames' times say.

    Returns
    -------
    int
        The number of pictures drawn.

    Raises
    ------
    PosekitError
        Where there is nothing to draw, or nothing to draw it with.

    Examples
    --------
    >>> import posekit
    >>> recovery = posekit.recover(posekit.builtin_view("seq1"))
    >>> posekit.render(recovery, "page.html")  # doctest: +SKIP
    1
    """
    from posekit.viewer.moving import real_time
    from posekit.viewer.pictures import Shot, check_picture, write_picture
    from posekit.viewer.scene.compose import Style

    output = Path(output)
    timed = shot is None
    shot = shot or Shot()
    moving = check_picture(output, shot) and not shot.turntable
    content, behind, title = _drawable(given, view)
    if output.suffix.lower() == ".html" and posture in ("", "all") and style is None:
        write_whole_page(output, content, behind, frame=str(frame), title=title)
        return 1
    asked = DrawnChoice(frame=str(frame), posture=str(posture))
    subject, drawn = asked.of(content, behind, moving=moving)
    if moving and timed and drawn:
        shot = replace(shot, fps=real_time([one.time for one in drawn]))
    style = style or Style(layout=asked.layout(moving=moving, through_view=shot.through_view))
    return write_picture(output, subject, drawn, style=style, shot=shot, title=title)


def _drawable(
    given: Any, view: str | Path | View | None
) -> tuple[Result | Postures | HeldPostures | ObjectResult, View | None, str]:
    """Return what can be drawn, the view behind it, and its title."""
    if isinstance(given, str | Path):
        path = view if isinstance(view, str | Path) else None
        content, behind = read_given(Path(given), None if path is None else Path(path))
        return content, view if isinstance(view, View) else behind, Path(given).name
    behind = read_view(view) if isinstance(view, str | Path) else view
    if isinstance(given, View):
        from posekit.recovery.conductor import recover

        return result_of(recover(given, group=0.05), unit=given.unit), given, "view"
    if isinstance(given, Recovery):
        return result_of(given), behind, "recovery"
    if isinstance(given, Result | Postures | HeldPostures | ObjectResult):
        return given, behind, type(given).__name__.lower()
    raise InputError(
        f"render: got {type(given).__name__}; expected a path, a recovery, a result, a view, postures or recovered "
        "objects"
    )
