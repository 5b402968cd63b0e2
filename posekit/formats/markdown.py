"""Markdown in reports: tables, and text from files that must not be taken for markup."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final

from posekit.safe_io import one_line

MARKUP_LETTERS: Final = frozenset("&<>|\\`[]*#~")
"""Letters that Markdown or HTML may take for more than themselves, also in the middle of a word."""


def table_lines(
    head: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    spelled: Callable[[str], str] = lambda text: one_line(text).replace("|", "\\|"),
) -> list[str]:
    """Lay out a Markdown table, columns aligned.

    Parameters
    ----------
    head : sequence of str
        The names of the columns.
    rows : iterable of sequence
        The cells.
    spelled : callable
        How the text of a cell is written: kept inside its cell, or as `no_markup` has it where it comes from a file and
        the table goes into one that is rendered.
    """
    cells = [[spelled(str(cell)) for cell in row] for row in rows]
    widths = [max(len(row[k]) for row in [list(head), *cells]) for k in range(len(head))]

    def line(row: Sequence[str]) -> str:
        return f"| {' | '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))} |"

    return [line(head), f"|{'|'.join('-' * (width + 2) for width in widths)}|", *map(line, cells), ""]


def no_markup(text: str) -> str:
    """Keep a text from a file from being taken for Markdown or HTML, or from ending its line."""
    return "".join(f"&#{ord(letter)};" if letter in MARKUP_LETTERS else letter for letter in one_line(text))
