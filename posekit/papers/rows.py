"""Rows that compare statements of the papers with posekit's calculations, and the page of all rows."""

from __future__ import annotations

import html
import json
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

from posekit.files import write_bytes

Verdict = Literal["agrees", "differs", "open"]

PAPERS: Final = {"lee-chen": "Lee & Chen 1985", "taylor": "Taylor 2000"}

VERDICTS: Final[dict[Verdict, str]] = {
    "agrees": "the printed statement is reproduced to its digits or its bound",
    "differs": "the calculation gives another result; the last column gives the reason",
    "open": "the paper does not print what decides it (motion, body, camera or noise): orders of magnitude compare",
}

COLUMNS: Final = ("place", "printed", "here", "verdict", "check", "why")

#: Reason of a row that differs and has no explanation in ``rows.toml``.
UNEXPLAINED: Final = "not explained"

STYLE: Final = (
    "body{font:15px/1.4 sans-serif;margin:2em;max-width:80em}table{border-collapse:collapse}"
    "td,th{border:1px solid #ccc;padding:.3em .5em;text-align:left;vertical-align:top}"
    ".differs{background:#fde5d4}.open{background:#eef1f6}"
)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One statement of a paper, compared with posekit's calculation.

    Parameters
    ----------
    paper : str
        Key of `PAPERS`.
    place, printed : str
        Section or table of the paper, and its printed statement.
    here : str
        posekit's result.
    verdict : {"agrees", "differs", "open"}
        See `VERDICTS`.
    check : str
        Description of posekit's calculation.
    why : str
        Reason why the result differs or the comparison is open; empty if the result agrees.
    """

    paper: str
    place: str
    printed: str
    here: str
    verdict: Verdict
    check: str
    why: str = ""


class Rows(list[Row]):
    """The rows of one or both papers."""

    @property
    def passed(self) -> bool:
        """Whether every row whose value differs from the printed one has an explanation."""
        return all(one.why != UNEXPLAINED for one in self)

    def counts(self) -> str:
        """Return a sentence with the number of rows of each verdict."""
        agree, differ, open_ = (sum(one.verdict == verdict for one in self) for verdict in VERDICTS)
        return f"{len(self)} rows: {agree} agree, {differ} differ, {open_} are open."

    def lines(self) -> list[str]:
        """Return the lines of ``papers.md``."""
        lines = ["# The two papers, row by row", "", self.counts(), ""]
        lines += [f"- *{verdict}*: {meaning}." for verdict, meaning in VERDICTS.items()]
        for paper in dict.fromkeys(one.paper for one in self):
            lines += ["", f"## {PAPERS[paper]}", "", _line(COLUMNS), _line(["---"] * len(COLUMNS))]
            lines += [_line([getattr(one, name) for name in COLUMNS]) for one in self if one.paper == paper]
        return [*lines, ""]


@cache
def printed() -> dict[str, Any]:
    """Return the tables printed in both papers, from ``printed.toml``."""
    return tomllib.loads(Path(__file__).with_name("printed.toml").read_text(encoding="utf-8"))


@cache
def _texts() -> dict[str, dict[str, str]]:
    return tomllib.loads(Path(__file__).with_name("rows.toml").read_text(encoding="utf-8"))


def row(key: str, here: str, fits: bool | None, **names: Any) -> Row:
    """Build a row from its texts in ``rows.toml`` and posekit's result.

    Parameters
    ----------
    key : str
        Name of the row's table in ``rows.toml``.
    here : str
        posekit's result.
    fits : bool or None
        Whether the result agrees with the statement; None if the paper prints too little to decide.
    **names
        Values of the placeholders ``{…}`` in the texts.
    """
    texts = {name: text.format(**names) for name, text in _texts()[key].items()}
    if fits:
        texts["why"] = ""
    elif not texts.get("why"):
        texts["why"] = UNEXPLAINED
    verdict: Verdict = "open" if fits is None else "agrees" if fits else "differs"
    return Row(here=here, verdict=verdict, **texts)


def write_rows(folder: Path, rows: Rows, pictures: Sequence[Path] = ()) -> list[Path]:
    """Write ``papers.md``, ``papers.html`` (with `pictures`) and ``papers.json``; return their paths."""
    page = [
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>The two papers</title><style>{STYLE}</style>',
        f"<h1>The two papers, row by row</h1><p>{rows.counts()}</p><dl>",
        *(f"<dt>{verdict}</dt><dd>{meaning}</dd>" for verdict, meaning in VERDICTS.items()),
        "</dl>",
    ]
    for paper in dict.fromkeys(one.paper for one in rows):
        page.append(f"<h2>{html.escape(PAPERS[paper])}</h2><table><tr>{_cells('th', COLUMNS)}</tr>")
        page += [
            f'<tr class="{one.verdict}">{_cells("td", [getattr(one, name) for name in COLUMNS])}</tr>'
            for one in rows
            if one.paper == paper
        ]
        page.append("</table>")
    page += [f'<p><img src="{path.name}" alt="{path.stem}"></p>' for path in pictures]
    texts = {
        "papers.md": "\n".join(rows.lines()),
        "papers.html": "\n".join(page) + "\n",
        "papers.json": json.dumps({"rows": [asdict(one) for one in rows]}, indent=1, ensure_ascii=False)
        + "\n",
    }
    for name, text in texts.items():
        write_bytes(folder / name, text.encode())
    return [folder / name for name in texts]


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _cells(tag: str, texts: Sequence[str]) -> str:
    return "".join(f"<{tag}>{html.escape(text)}</{tag}>" for text in texts)
