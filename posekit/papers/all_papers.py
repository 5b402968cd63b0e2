"""`posekit reproduce all`: both papers row by row in one page, and their reports beside it."""

from __future__ import annotations

from pathlib import Path

from posekit.papers.lee_chen import reproduce_lee_chen
from posekit.papers.lee_chen_checks import lee_chen_checks
from posekit.papers.lee_chen_rows import lee_chen_rows
from posekit.papers.lee_chen_tables34 import WALK_GRIDS, Effort
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.papers.rows import write_rows
from posekit.papers.taylor import reproduce_taylor
from posekit.papers.taylor_rows import find_taylor, taylor_rows


def reproduce_all(folder: Path, *, pictures: bool = True, effort: Effort = "quick") -> list[str]:
    """Write ``papers.html``, ``papers.md`` and ``papers.json``, and what both papers' reports write.

    Parameters
    ----------
    folder : Path
        Must exist.
    pictures : bool
        Whether to draw the figures too.
    effort : {"quick", "fine"}
        Over how many settings of the walker Tables 3 and 4 of Lee & Chen are counted.

    Returns
    -------
    list of str
        The lines of ``papers.md``.
    """
    lee_chen, taylor = LeeChenWork(grid=WALK_GRIDS[effort]), find_taylor()
    reproduce_lee_chen(folder, pictures=pictures, work=lee_chen)
    reproduce_taylor(folder, pictures=pictures, work=taylor)
    rows = [*lee_chen_checks(lee_chen), *lee_chen_rows(lee_chen), *taylor_rows(taylor)]
    return write_rows(folder, rows, ("lee-chen.md", "taylor.md"))
