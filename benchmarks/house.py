"""Count how the installed code is built: lines, names, parameters, comments, of any checkout.

    python -m benchmarks.house [CHECKOUT] [--run] [--json FILE] [--against FILE]

Installed code is the package with the folders that it links to (validators, viewer, urdf), each once. What is counted:

- A line of code is not blank (but within a string), and not only a comment, a docstring (an attribute's too) or part
  of an import: moves alone change nothing. JavaScript, CSS and HTML count apart: lines that are not blank.
- A one-word constant is assigned at the top of a module, in capitals without an underscore; single letters, as
  mathematics has them, are listed apart. A name counts once a module.
- Parameters of a function are those in its signature, without `self`, `cls` and the starred ones; more than eight are
  allowed in `compiled/` and `cli/` alone.
- A parameter without description is an entry of the sections Parameters or Attributes of a public docstring whose next
  line is not indented.
- A file name in several folders is that of a Python file other than `__init__.py`.

With --run it also measures what runs, with this Python (`house_run.py`); with --against an earlier --json is beside it.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import re
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
MOST_PARAMETERS = 8
LONG_TEST_LINES = 600
MANY_PARAMETERS_ALLOWED = {"compiled", "cli"}

RULE_OF_SECTION = re.compile(r"-{3,}")
DESCRIBED_SECTIONS = ("Parameters", "Attributes")
NO_CODE = {
    *(tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.COMMENT, tokenize.ENCODING, tokenize.ENDMARKER),
}
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, kw_only=True)
class Source:
    """One file of Python.

    Parameters
    ----------
    place : Path
        Where it is in the checkout.
    module : str
        Its name when imported.
    text : str
        What it says.
    """

    place: Path
    module: str
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax tree."""
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """All nodes of the tree."""
        return tuple(ast.walk(self.tree))


def linked(checkout: Path) -> list[Path]:
    """Return the folders beside the package that it links to."""
    return sorted(link.resolve() for link in (checkout / "posekit").iterdir() if link.is_symlink())


def installed(checkout: Path) -> list[Source]:
    """Read the installed Python files, those behind a link once."""
    found = []
    for folder in (checkout / "posekit", *linked(checkout)):
        for path in sorted(folder.rglob("*.py")):
            place = path.relative_to(checkout)
            names = [name for name in place.with_suffix("").parts if name != "__init__"]
            module = ".".join(names if names[0] == "posekit" else ["posekit", *names])
            found.append(Source(place=place, module=module, text=path.read_text(encoding="utf-8")))
    return found


def lines_and_comments(source: Source) -> tuple[int, int]:
    """Count the lines of code and the comments of a file."""
    code: set[int] = set()
    comments = 0
    for token in tokenize.generate_tokens(io.StringIO(source.text).readline):
        comments += token.type == tokenize.COMMENT
        if token.type not in NO_CODE:
            code.update(range(token.start[0], token.end[0] + 1))
    for node in source.nodes:
        if isinstance(node, ast.Import | ast.ImportFrom | ast.Expr) and not _is_computed(node):
            code.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(code), comments


def _is_computed(statement: ast.stmt) -> bool:
    """Say whether a statement is an expression other than a string alone."""
    value = statement.value if isinstance(statement, ast.Expr) else None
    return value is not None and not (isinstance(value, ast.Constant) and isinstance(value.value, str))


def class_names(sources: Iterable[Source]) -> Counter[str]:
    """Count the classes of each name."""
    return Counter(node.name for s in sources for node in s.nodes if isinstance(node, ast.ClassDef))


def one_word_constants(sources: Iterable[Source]) -> Counter[str]:
    """Count the modules in which each one-word constant is assigned, single letters among them."""
    return Counter(
        name
        for source in sources
        for name in set(_assigned(source.tree.body))
        if re.fullmatch(r"[A-Z][A-Z0-9]*", name)
    )


def _assigned(body: Iterable[ast.AST]) -> Iterator[str]:
    """Name what statements assign, those under `if`, `try` and `with` too, not those of functions and classes."""
    for node in body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name))
        elif isinstance(node, ast.If | ast.Try | ast.With | ast.ExceptHandler):
            yield from _assigned(ast.iter_child_nodes(node))


def long_signatures(sources: Iterable[Source], *, everywhere: bool = False) -> list[str]:
    """List the functions of more than eight parameters, where they are not allowed or everywhere."""
    found = []
    for source in sources:
        if not everywhere and MANY_PARAMETERS_ALLOWED & set(source.place.parts):
            continue
        for node in source.nodes:
            if isinstance(node, Function):
                named = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
                count = sum(argument.arg not in {"self", "cls"} for argument in named)
                if count > MOST_PARAMETERS:
                    found.append(f"{source.place}:{node.lineno} {node.name} ({count})")
    return found


def undescribed(sources: Iterable[Source]) -> list[str]:
    """List the documented parameters that have a name and a type alone."""
    return [
        f"{source.place}:{node.lineno} {node.name}: {entry}"
        for source in sources
        for node in source.nodes
        if isinstance(node, ast.ClassDef | Function) and not node.name.startswith("_")
        for entry in _bare_entries((ast.get_docstring(node) or "").splitlines())
    ]


def _bare_entries(lines: list[str]) -> Iterator[str]:
    """Name the entries of a docstring's parameters that no indented line follows."""
    section = ""
    for line, after in pairwise([*lines, ""]):
        if RULE_OF_SECTION.fullmatch(after.strip()):
            section = line.strip()
        elif section in DESCRIBED_SECTIONS and line[:1].strip() and not RULE_OF_SECTION.fullmatch(line):
            if not after.startswith(" "):
                yield line


def long_tests(checkout: Path) -> list[str]:
    """List the test files of more than 600 lines, blank ones counted."""
    paths = sorted((checkout / "tests").rglob("*.py"))
    counts = {
        path.relative_to(checkout): len(path.read_text(encoding="utf-8").splitlines()) for path in paths
    }
    return [f"{place} ({count})" for place, count in counts.items() if count > LONG_TEST_LINES]


def shared_file_names(sources: Iterable[Source]) -> dict[str, int]:
    """Count the folders of each file name that several folders have."""
    return several(Counter(s.place.name for s in sources if s.place.name != "__init__.py"))


def names_of_linked(sources: Iterable[Source], folders: Iterable[str]) -> list[str]:
    """List what the rest of the package takes from the linked folders: imported names and those of their modules."""
    homes = tuple(f"posekit.{folder}" for folder in folders)
    taken: set[str] = set()
    for source in sources:
        if source.module.startswith(homes):
            continue
        aliases: dict[str, str] = {}
        for node in source.nodes:
            if isinstance(node, ast.ImportFrom) and node.module:
                full = {a.asname or a.name: f"{node.module}.{a.name}" for a in node.names}
                aliases |= {short: name for short, name in full.items() if name in homes}
                taken.update(n for n in full.values() if n.startswith(homes) and n not in homes)
        for node in source.nodes:
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                taken.update(f"{aliases[i]}.{node.attr}" for i in [node.value.id] if i in aliases)
    return sorted(taken)


def newcomers_names(checkout: Path) -> dict[str, list[str]]:
    """List what README's Python blocks use: names of the package, and attributes and keywords beside them."""
    text = (checkout / "README.md").read_text(encoding="utf-8")
    trees = [ast.parse(block) for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL)]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    names: set[str] = set()
    beside: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Attribute):
            of_package = isinstance(node.value, ast.Name) and node.value.id == "posekit"
            (names if of_package else beside).add(f"posekit.{node.attr}" if of_package else node.attr)
        elif isinstance(node, ast.keyword) and node.arg:
            beside.add(f"{node.arg}=")
    return {"names": sorted(names), "attributes and keywords": sorted(beside)}


def several(counter: Counter[str]) -> dict[str, int]:
    """Keep what was counted more than once, most first."""
    return {name: count for name, count in counter.most_common() if count > 1}


def count(checkout: Path) -> dict[str, Any]:
    """Count everything that needs no run: ``figures`` for the table, ``lists`` of what they count."""
    sources = installed(checkout)
    tallies = [lines_and_comments(source) for source in sources]
    lines = sum(tally[0] for tally in tallies)
    classes, constants = class_names(sources), one_word_constants(sources)
    words = {name: n for name, n in constants.most_common() if len(name) > 1}
    folders = [folder.name for folder in linked(checkout)]
    lists: dict[str, Any] = {
        "class names used twice": several(classes),
        "one-word constants": words,
        "single letters": {name: n for name, n in constants.most_common() if len(name) == 1},
        "functions over 8 parameters": long_signatures(sources, everywhere=True),
        "of these outside compiled/ and cli/": long_signatures(sources),
        "file names in several folders": shared_file_names(sources),
        "parameters without description": undescribed(sources),
        f"test files over {LONG_TEST_LINES} lines": long_tests(checkout),
        f"names taken from {', '.join(folders)}": names_of_linked(sources, folders),
        **{f"README's {name}": found for name, found in newcomers_names(checkout).items()},
    }
    figures: dict[str, float] = {
        "lines of code": lines,
        "of these in the linked folders": sum(
            tally[0] for s, tally in zip(sources, tallies, strict=True) if s.place.parts[0] != "posekit"
        ),
        "lines of JavaScript, CSS, HTML": _lines_of_pages(checkout),
        "source files": len(sources),
        "classes": sum(classes.values()),
        "one-word constants, with repetition": sum(words.values()),
        "comments per 1,000 lines of code": round(1e3 * sum(tally[1] for tally in tallies) / lines, 1),
        **{name: len(found) for name, found in lists.items()},
    }
    return {"figures": figures, "lists": lists}


def _lines_of_pages(checkout: Path) -> int:
    """Count the lines of pages and their programs that are not blank."""
    paths = [p for f in (checkout / "posekit", *linked(checkout)) for p in f.rglob("*")]
    return sum(
        bool(line.strip())
        for path in paths
        if path.suffix in {".js", ".css", ".html"}
        for line in path.read_text(encoding="utf-8").splitlines()
    )


def table(figures: dict[str, float], earlier: dict[str, float] | None) -> list[str]:
    """Write a Markdown table of figures, beside earlier ones where there are any."""
    if earlier is None:
        return ["| what | count |", "|---|---:|", *(f"| {k} | {v:,} |" for k, v in figures.items())]
    rows = (
        f"| {name} | {_cell(earlier.get(name))} | {_cell(figures.get(name))} |"
        for name in dict.fromkeys([*figures, *earlier])
    )
    return ["| what | before | now |", "|---|---:|---:|", *rows]


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:,}"


def listing(lists: dict[str, Any], shown: int) -> Iterator[str]:
    """Write the first of each list."""
    for name, found in lists.items():
        entries = [f"{k} {n}" for k, n in found.items()] if isinstance(found, dict) else found
        more = f"; … ({len(entries)} in all)" if len(entries) > shown else ""
        yield f"\n**{name}**: {'; '.join(entries[:shown]) or 'none'}{more}"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("checkout", type=Path, nargs="?", default=ROOT)
    parser.add_argument("--json", type=Path, help="also write the counts, whole lists with them")
    parser.add_argument("--against", type=Path, help="counts written earlier, for a column beside")
    parser.add_argument("--run", action="store_true", help="also measure what runs, with this Python")
    parser.add_argument("--shown", type=int, default=40, help="how many of each list are printed")
    given = parser.parse_args(arguments)
    checkout = given.checkout.resolve()
    counted = count(checkout)
    if given.run:
        command = [sys.executable, str(Path(__file__).with_name("house_run.py")), str(checkout)]
        ran = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
        counted = {kind: counted[kind] | ran[kind] for kind in counted}
    earlier = None if given.against is None else json.loads(given.against.read_text(encoding="utf-8"))
    print("\n".join(table(counted["figures"], earlier and earlier["figures"])))
    print("\n".join(listing(counted["lists"], given.shown)))
    if given.json is not None:
        given.json.write_text(json.dumps(counted, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
