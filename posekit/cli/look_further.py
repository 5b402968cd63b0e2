"""What to type next: the commands that look further at a file that was just written."""

from __future__ import annotations

import shlex
from pathlib import Path

from posekit.cli.terminal import say


def further_lines(
    result: Path, view: Path | None, program: str = "posekit", *, moving: str = ".bvh"
) -> list[str]:
    """List the commands that show, draw and convert a result.

    Parameters
    ----------
    result : Path
        The file that was written.
    view : Path, optional
        The view that it was recovered from.
    program : str
        How this command is called.
    moving : str
        The end of the name of a format that carries what moves.

    Examples
    --------
    >>> from pathlib import Path
    >>> for line in further_lines(Path("out.npz"), Path("my walk.json")):
    ...     print(line)
    look further:
      posekit view out.npz --view 'my walk.json'
      posekit render out.npz -o out.png
      posekit convert out.npz out.bvh
    >>> further_lines(Path("out.json.gz"), None)[-1]
    '  posekit convert out.json.gz out.bvh'
    """
    name = shlex.quote(str(result))
    plain = result.with_suffix("") if result.suffix == ".gz" else result
    beside = "" if view is None else f" --view {shlex.quote(str(view))}"
    return [
        "look further:",
        f"  {program} view {name}{beside}",
        f"  {program} render {name} -o {shlex.quote(str(plain.with_suffix('.png')))}",
        f"  {program} convert {name} {shlex.quote(str(plain.with_suffix(moving)))}",
    ]


def tell_further(result: Path, view: Path | None = None, *, moving: str = ".bvh") -> None:
    """Print what to type next.

    Parameters
    ----------
    result : Path
        The file that was written.
    view : Path, optional
        The view that it was recovered from.
    moving : str
        The end of the name of a format that carries what moves.
    """
    from posekit.cli.demo import program

    for line in further_lines(result, view, program(), moving=moving):
        say(line)
