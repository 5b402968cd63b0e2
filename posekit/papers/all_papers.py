"""`posekit reproduce all`: both papers row by row in one page, and their reports beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from posekit.papers.lee_chen import reproduce_lee_chen
from posekit.papers.lee_chen_checks import lee_chen_checks
from posekit.papers.lee_chen_rows import lee_chen_rows
from posekit.papers.lee_chen_tables34 import WALK_GRIDS, Effort
from posekit.papers.lee_chen_words import lee_chen_words
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.papers.rows import write_rows
from posekit.papers.taylor import reproduce_taylor
from posekit.papers.taylor_rows import find_taylor, taylor_rows

PICTURES_SHOWN: Final = {
    "lee-chen.seq1.tree.png": "Lee & Chen, Fig. 4: the tree of SEQ1's frame 1",
    "lee-chen.seq1.projections.png": "Lee & Chen, Fig. 6: SEQ1's frame 1 after grouping, one of each group",
    "lee-chen.seq1.superposed.png": "Lee & Chen, Fig. 7: these superposed",
    "lee-chen.seq2.projections.png": "Lee & Chen, Fig. 8: SEQ2's frame 1",
    "lee-chen.seq1.image.png": "Lee & Chen, Fig. A.1: SEQ1's images",
    "taylor.fig7.png": "Taylor, Fig. 7b: the closed chain's residual over s",
    "taylor.fig8.png": "Taylor, Fig. 8b: the flat chain's residual over s",
}
"""Figures that are drawn again; the setting is the walker's that is closest to all cells."""


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
    rows = [
        *lee_chen_words(lee_chen),
        *lee_chen_checks(lee_chen),
        *lee_chen_rows(lee_chen),
        *taylor_rows(taylor),
    ]
    return write_rows(folder, rows, ("lee-chen.md", "taylor.md"), PICTURES_SHOWN)
