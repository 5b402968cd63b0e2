"""Tables in reports."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table_lines(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Lay out a Markdown table, columns aligned."""
    cells = [[str(cell) for cell in row] for row in rows]
    widths = [max(len(row[k]) for row in [list(head), *cells]) for k in range(len(head))]
    layout = [
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))} |"
        for row in cells
    ]
    top = f"| {' | '.join(cell.ljust(width) for cell, width in zip(head, widths, strict=True))} |"
    return [top, f"|{'|'.join('-' * (width + 2) for width in widths)}|", *layout, ""]
