"""Start and save a matplotlib figure, without a screen and without matplotlib's global state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from posekit.errors import ViewerError
from posekit.formats.own.npz import suffix
from posekit.safe_io.writing import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLOT_FORMATS: Final = (".png", ".svg", ".pdf")
PLOT_DPI: Final = 160

RIGHT_COLOUR: Final = "#D55E00"
"""Right limbs: vermilion of Okabe & Ito's palette, told from `LEFT_COLOUR` by colour-blind eyes too."""
LEFT_COLOUR: Final = "#0072B2"
"""Left limbs: blue of the same palette."""
TRUNK_COLOUR: Final = "#333333"
MUTED_COLOUR: Final = "#767676"
"""What is only there to compare with: printed numbers, what was pruned, hints."""
FAINT_COLOUR: Final = "#DDDDDD"

PLOT_STYLE: Final[Any] = {  # matplotlib's annotations list every key there is
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same on every machine
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlepad": 6.0,
    "axes.labelsize": 9.0,
    "axes.edgecolor": MUTED_COLOUR,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.color": TRUNK_COLOUR,
    "ytick.color": TRUNK_COLOUR,
    "grid.color": "#E8E8E8",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.hashsalt": "posekit",  # the same drawing gives the same file
    "pdf.fonttype": 42,
}


@contextmanager
def drawing() -> Iterator[type[Figure]]:
    """Yield matplotlib's `Figure` class, with the style set as long as the block lasts.

    Raises
    ------
    ViewerError
        Where matplotlib is not installed.
    """
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ViewerError(
            "plots need matplotlib, which is not installed; run: pip install 'posekit[pictures]'"
        ) from error
    with mpl.rc_context(PLOT_STYLE):
        yield Figure


def save(figure: Figure, path: str | Path) -> None:
    """Write a figure as ``.png``, ``.svg`` or ``.pdf``, whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        What one of the `plot_` functions returned, or any other.
    path : path
        Its suffix decides the format. The same figure gives the same bytes: no date is written.

    Raises
    ------
    InputError
        Where the suffix is another, or the file cannot be written.
    """
    kind = suffix(path, *PLOT_FORMATS)
    date: dict[str, Any] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[kind]
    with drawing(), replacing(path) as file:
        figure.savefig(file, format=kind[1:], dpi=PLOT_DPI, metadata=date, facecolor="white")
