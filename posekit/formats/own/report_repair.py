"""What a repair changed, as rows of the tables of reports."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from posekit.display.check_words import check_words
from posekit.display.plural import plural

REPAIR_HEAD: Final = ("written", "clip", "what was done", "by up to", "frames")
"""The columns of `repair_rows`."""

MOST_REPAIR_ROWS: Final = 500
"""Changes, and frames that are left, of a table; a JSON file has all of them."""


def repair_rows(repair: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Return the rows of a table: of each clip its changes, most first, and what is left.

    Parameters
    ----------
    repair : sequence of mapping
        As `posekit.formats.own.ValidationReport` has them.
    """
    rows = list(_rows(repair))
    more = len(rows) - MOST_REPAIR_ROWS
    return rows if more <= 0 else [*rows[:MOST_REPAIR_ROWS], ("", "", f"{more} more", "", "")]


def _rows(repair: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, ...]]:
    for record in repair:
        clip = (str(record["written"]), str(record["clip"]))
        told = (
            f"{record['changed']} of {plural(record['frames'], 'frame')} changed, {record['valid']} valid in the "
            "written file"
        )
        yield (*clip, told, "", "")
        for span in record["spans"]:
            first, last = span["first"], span["last"]
            frames = str(first) if first == last else f"{first} to {last}"
            yield (*clip, f"{span['place']} {span['remedy']}", _most(span["most"], span["unit"]), frames)
        for one in record["left"]:
            beyond = f"{one['left']:.3g} {'' if one['unit'] == '1' else one['unit']}".rstrip()
            yield (
                *clip,
                f"left: {check_words(one['check'])} {one['place']}",
                f"{beyond} beyond",
                str(one["frame"]),
            )


def _most(most: float, unit: str) -> str:
    return f"{100 * most:.3g} cm" if unit == "m" else f"{math.degrees(most):.3g} deg"
