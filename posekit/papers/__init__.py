"""Comparison of Lee & Chen 1985 and Taylor 2000 with posekit's calculations, one row for each printed statement."""

from __future__ import annotations

from pathlib import Path

from posekit.errors import nearest, refusal, shown
from posekit.papers.rows import Rows, write_rows
from posekit.progress import watched

PAPER_NAMES = ("all", "lee-chen", "taylor")
EFFORTS = ("quick", "fine")


def reproduce(
    paper: str = "all", folder: str | Path | None = None, *, effort: str = "quick", pictures: bool = False
) -> Rows:
    """Compare printed statements and tables of the papers with posekit's calculations, and draw the figures.

    Parameters
    ----------
    paper : {"all", "lee-chen", "taylor"}
        Lee & Chen 1985, Taylor 2000, or both.
    folder : path, optional
        Folder for ``papers.md``, ``papers.html`` and ``papers.json``; it is created if it does not exist.
    effort : {"quick", "fine"}
        Number of walkers (velocity, lean, gait phase) that Tables 3 and 4 are compared with: 500 or 8,100.
    pictures : bool
        Also draw the papers' figures again, into the folder; this needs matplotlib.

    Returns
    -------
    Rows
        For each statement: its section or table in the paper, the printed text, posekit's result, and the verdict.

    Raises
    ------
    InputError
        If `paper` or `effort` is unknown.
    ViewerError
        If pictures are requested without matplotlib.
    """
    for field, value, known in (("paper", paper, PAPER_NAMES), ("effort", effort, EFFORTS)):
        if value not in known:
            raise refusal("", field, shown(value), f"one of {', '.join(known)}", nearest(value, known))
    from posekit.papers.lee_chen_camera import camera_rows
    from posekit.papers.lee_chen_constraints import constraint_rows
    from posekit.papers.lee_chen_walks import walk_rows
    from posekit.papers.taylor import taylor_rows
    from posekit.papers.taylor_objects import object_rows

    lee_chen = [camera_rows, constraint_rows, lambda: walk_rows(effort)]
    taylor = [taylor_rows, object_rows]
    parts = [*(lee_chen if paper != "taylor" else []), *(taylor if paper != "lee-chen" else [])]
    rows = Rows(row for part in watched(parts, "reproducing") for row in part())
    if folder is not None:
        Path(folder).mkdir(parents=True, exist_ok=True)
        drawn: list[Path] = []
        if pictures:
            from posekit.papers.figures import draw_lee_chen, draw_taylor

            drawn += draw_lee_chen(Path(folder), effort) if paper != "taylor" else []
            drawn += draw_taylor(Path(folder)) if paper != "lee-chen" else []
        write_rows(Path(folder), rows, drawn)
    return rows
