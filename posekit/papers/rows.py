"""Rows of the papers, each with its check beside it: one page that a reviewer can follow."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, Literal

from posekit.formats.markdown import table_lines
from posekit.safe_io.writing import write_json, write_lines

Verdict = Literal["agrees", "differs", "open"]
VERDICT_MEANINGS: Final[dict[Verdict, str]] = {
    "agrees": "what is printed comes out, as near as its digits or its bound",
    "differs": "something else comes out: the last column says why",
    "open": "the print leaves open what decides it (motion, body, camera or noise): sizes can be compared",
}
PAGE_STYLE: Final = (
    "body{font:15px/1.4 sans-serif;margin:2em;max-width:80em}table{border-collapse:collapse}"
    "td,th{border:1px solid #ccc;padding:.3em .5em;text-align:left;vertical-align:top}"
    ".differs{background:#fde5d4}.open{background:#eef1f6}img{max-width:100%}"
)


@dataclass(frozen=True, kw_only=True)
class PaperRow:
    """One thing that a paper prints.

    Parameters
    ----------
    paper, place : str
        Where it is printed.
    printed, here : str
        What is printed, and what comes out.
    verdict : {"agrees", "differs", "open"}
        What that is, `VERDICT_MEANINGS`.
    check : str
        How what comes out was calculated or held against another calculation.
    why : str
        Why it differs, or what is left open.
    """

    paper: str
    place: str
    printed: str
    here: str
    verdict: Verdict
    check: str
    why: str = ""

    def __post_init__(self) -> None:
        if self.verdict != "agrees" and not self.why:
            raise ValueError(f"{self.place}: what {self.verdict} has its reason")


def agreement(fits: bool) -> Verdict:
    """Return the verdict of a row that can be compared digit for digit."""
    return "agrees" if fits else "differs"


def compared(
    paper: str, place: str, printed: str, here: str, fits: bool, check: str, why: str = "not explained"
) -> PaperRow:
    """Make a row that can be compared: it agrees, or differs for a reason that may not be known."""
    return PaperRow(
        paper=paper,
        place=place,
        printed=printed,
        here=here,
        verdict=agreement(fits),
        check=check,
        why="" if fits else why,
    )


def write_rows(
    folder: Path, rows: Sequence[PaperRow], beside: Iterable[str], pictures: Mapping[str, str] | None = None
) -> list[str]:
    """Write ``papers.md``, ``papers.html`` and ``papers.json``.

    Parameters
    ----------
    folder : Path
        Must exist.
    rows : sequence of PaperRow
        In the papers' order.
    beside : iterable of str
        Names of files of the folder that tell more.
    pictures : mapping, optional
        Names of pictures, and which figures they are like; those that are in the folder are shown.

    Returns
    -------
    list of str
        The lines of ``papers.md``.
    """
    counts = ", ".join(
        f"{sum(row.verdict == verdict for row in rows)} {verdict}" for verdict in VERDICT_MEANINGS
    )
    head = ("place", "printed", "here", "verdict", "check", "why")
    title, said = "The two papers, row by row", f"{len(rows)} rows: {counts}."
    lines = [
        f"# {title}",
        "",
        said,
        "",
        *(f"- *{name}*: {meaning}." for name, meaning in VERDICT_MEANINGS.items()),
        "",
    ]
    page = [
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title><style>{PAGE_STYLE}</style>',
        f"<h1>{title}</h1><p>{said}</p><dl>",
        *(f"<dt>{name}</dt><dd>{meaning}</dd>" for name, meaning in VERDICT_MEANINGS.items()),
        "</dl>",
    ]
    for paper in dict.fromkeys(row.paper for row in rows):
        cells = [
            (row.place, row.printed, row.here, row.verdict, row.check, row.why)
            for row in rows
            if row.paper == paper
        ]
        lines += [f"## {paper}", "", *table_lines(head, cells)]
        page += [f"<h2>{html.escape(paper)}</h2><table><tr>{_cells('th', head)}</tr>"]
        page += [f'<tr class="{each[3]}">{_cells("td", each)}</tr>' for each in cells]
        page += ["</table>"]
    for name, caption in (pictures or {}).items():
        if (folder / name).is_file():
            lines += [f"![{caption}]({name})", ""]
            said = html.escape(caption)
            page += [
                f'<figure><img src="{html.escape(name)}" alt="{said}"><figcaption>{said}</figcaption></figure>'
            ]
    beside = list(beside)
    lines += [f"More: {', '.join(f'[{name}]({name})' for name in beside)}.", ""]
    links = (f'<a href="{html.escape(name)}">{html.escape(name)}</a>' for name in beside)
    page += [f"<p>More: {', '.join(links)}.</p>"]
    write_lines(folder / "papers.md", lines)
    write_lines(folder / "papers.html", page)
    write_json(folder / "papers.json", {"rows": [asdict(row) for row in rows]})
    return lines


def _cells(tag: str, texts: Iterable[str]) -> str:
    return "".join(f"<{tag}>{html.escape(text)}</{tag}>" for text in texts)
