"""Make tables of the documentation from the code: formats, layouts, checks, settings, commands, the papers.

``python docs/tables.py`` writes those that stand in the pages, between comments ``<!-- table: NAME -->``; a test makes
sure that they are current. The longer ones are written to ``_generated/`` whenever Sphinx builds the pages.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path

DOCS = Path(__file__).resolve().parent
GENERATED = DOCS / "_generated"
PAPERS = DOCS.parent / "posekit" / "papers"


def write_tables() -> list[Path]:
    """Update the tables in the pages, and return the changed pages."""
    changed = []
    for page in sorted(DOCS.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        renewed = with_tables(text)
        if renewed != text:
            page.write_text(renewed, encoding="utf-8")
            changed.append(page)
    return changed


def with_tables(text: str) -> str:
    """Return the text of a page with current tables."""
    for mark in re.findall(r"<!-- table: \w+ -->", text):
        start = text.index(mark) + len(mark)
        end = text.index("<!-- end of table -->", start)
        made = globals()[mark.split()[2]]()
        text = "\n".join([text[:start], "", *made, "", text[end:]])
    return text


def write_generated() -> None:
    """Write the tables that are included when the pages are built; the papers' table only if its code has changed."""
    GENERATED.mkdir(exist_ok=True)
    for name, lines in (("settings", settings()), ("commands", commands())):
        (GENERATED / f"{name}.inc").write_text("\n".join(lines) + "\n", encoding="utf-8")
    rows = GENERATED / "papers.inc"
    newest = max(path.stat().st_mtime for path in PAPERS.iterdir() if path.is_file())
    if not rows.exists() or rows.stat().st_mtime < newest:
        rows.write_text("\n".join(papers()) + "\n", encoding="utf-8")


def grid(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Lay out a table in Markdown."""
    yield f"| {' | '.join(head)} |"
    yield f"|{'---|' * len(head)}"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"


def containers() -> Iterator[str]:
    """List the containers and the endings of their files."""
    from posekit.formats.open import CONTAINERS

    rows = ((name, ", ".join(f"`{one}`" for one in ends)) for name, (_, ends) in CONTAINERS.items())
    return grid(("container", "endings, also with `.gz`"), rows)


def files_read() -> Iterator[str]:
    """List the recognised kinds of content, and their containers."""
    from posekit.formats.open import READERS

    holders: dict[str, list[str]] = {}
    for container, readers in READERS.items():
        for reader in readers:
            holders.setdefault(reader, []).append(container)
    rows = ((_content(reader), ", ".join(held)) for reader, held in holders.items())
    return grid(("recognised content", "containers"), rows)


def _content(reader: str) -> str:
    """Return the description of a reader's module."""
    path = DOCS.parent / "posekit" / "formats" / f"{reader}.py"
    first = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0]
    return " ".join(first.split()).split(";")[0].rstrip(".").replace("``", "`")


def files_written() -> Iterator[str]:
    """List the endings that each kind of object is written to."""
    from posekit.formats.save import WRITERS

    kinds = {"dict": "cameras by name"}
    return grid(
        ("object", "endings"),
        (
            (kinds.get(kind, f"`{kind}`"), ", ".join(f"`{one}`" for one in known))
            for kind, known in WRITERS.items()
        ),
    )


def layouts() -> Iterator[str]:
    """List the built-in layouts and the first clause of their sources."""
    from posekit.formats.layout import layout_names, load_layout

    rows = []
    for name in layout_names():
        source = " ".join(str(load_layout(name).fields.get("source", "")).split())
        rows.append((f"`{name}`", re.split(r"[:;]| \(", source)[0]))
    return grid(("layout", "origin"), rows)


def checks() -> Iterator[str]:
    """List the checks with their units, what they judge, and the message of their findings."""
    from posekit.validators.check import message_of
    from posekit.validators.judge import POSTURE_CHECKS, ROBOT_CHECKS
    from posekit.validators.motion.profile import MOTION_CHECKS

    rows = []
    for what, known in (("postures", POSTURE_CHECKS), ("robots", ROBOT_CHECKS), ("motion", MOTION_CHECKS)):
        for name, check in known.items():
            reads = ", ".join(one for one in check.reads if one not in ("joints", "robot"))
            rows.append((f"`{name}`", what, check.unit, reads, message_of(check)))
    return grid(("check", "judges", "unit", "needs", "finding"), rows)


def settings() -> Iterator[str]:
    """List the fields of the settings with their defaults."""
    from posekit.cli.command import descriptions
    from posekit.settings import RecoverSettings, ValidateSettings

    for kind, command in ((RecoverSettings, "recover"), (ValidateSettings, "validate")):
        described = descriptions(kind)
        yield f"## Settings of `posekit {command}`: `{kind.__name__}`\n"
        shown = [
            (f"`{one.name}`", _default(one.default), described.get(one.name, "")) for one in fields(kind)
        ]
        yield from grid(("field", "default", "meaning"), shown)
        yield ""


def _default(value: object) -> str:
    """Show a default."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "none"
    return "" if value is None else f"`{value}`"


def commands() -> Iterator[str]:
    """Show the help of every command."""
    from importlib import import_module

    import click

    from posekit.cli.main import COMMANDS

    for name in COMMANDS:
        command: click.Command = getattr(import_module(f"posekit.cli.{name}"), name)
        with click.Context(command, info_name=f"posekit {name}", max_content_width=100) as context:
            yield f"## posekit {name}\n\n```text\n{command.get_help(context)}\n```\n"


def papers() -> Iterator[str]:
    """Compare the statements of both papers with computed values."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    from posekit.papers import reproduce

    yield from reproduce("all").lines()


if __name__ == "__main__":
    for page in write_tables():
        print(page)
