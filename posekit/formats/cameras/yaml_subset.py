"""The part of YAML that camera files use, without its traps: no anchors, no types, no objects.

OpenCV's own reader (`cv2.FileStorage`) is native code that ends the process on some damaged files, and a full YAML
parser is a dependency with more meaning than a camera needs.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from posekit.errors import InputError
from posekit.formats.cameras.yaml_flow import MAX_DEPTH, FlowError, parse_flow, parse_scalar
from posekit.safe_io import cut, refusal, shown

MAX_LINES: Final = 200_000

_KEY = re.compile(
    r"""(?P<key>"[^"]*"\s*|'[^']*'\s*|[^\s"'\[\]{}#,&*!|>%@`:-][^:#]*|-[^\s:#][^:#]*):(?:\s+|$)"""
)

_Line = tuple[int, int, str]
"""Number in the file, indentation, content."""


def parse_yaml(text: str, source: str | Path) -> Any:
    """Parse YAML of maps, lists, numbers and words.

    Tags (``!!opencv-matrix``) are passed over, and so are the directives and markers at a document's start and end.

    Parameters
    ----------
    text : str
        The document.
    source : path
        What to call it in errors.

    Returns
    -------
    object
        Of dict, list, str, int, float, bool and None.

    Raises
    ------
    InputError
        Where it is no such YAML, with the line; also for anchors, aliases and block texts.
    """
    lines = _lines(text, source)
    if not lines:
        raise refusal(source, "", "nothing but comments", "YAML", "check how it was written")
    value, following = _block(lines, 0, lines[0][1], source, 0)
    if following < len(lines):
        raise _malformed(source, lines[following], "a line that is indented otherwise")
    return value


def _lines(text: str, source: str | Path) -> list[_Line]:
    """Take a text apart, joining lists and maps in brackets that run over several lines."""
    raw = text.splitlines()
    if len(raw) > MAX_LINES:
        raise refusal(source, "", f"{len(raw):,} lines", f"at most {MAX_LINES:,}", "name a camera's file")
    lines: list[_Line] = []
    open_at = 0
    pieces: list[str] = []
    depth = 0
    for number, line in enumerate(raw, start=1):
        content = _without_comment(line).rstrip()
        if not content.strip() or (not depth and content.startswith(("%", "---", "..."))):
            continue
        if depth == 0:
            open_at, pieces = number, []
        pieces.append(content if depth == 0 else content.strip())
        depth += _opened(content)
        if depth < 0:
            raise _malformed(source, (number, 0, content), "a bracket that closes nothing")
        if depth == 0:
            whole = " ".join(pieces)
            body = whole.lstrip(" ")
            if body.startswith("\t"):
                raise _malformed(source, (open_at, 0, body), "a tab for indentation")
            lines.append((open_at, len(whole) - len(body), body))
    if depth:
        raise _malformed(source, (open_at, 0, pieces[0]), "a bracket that is not closed")
    return lines


def _without_comment(line: str) -> str:
    quote = ""
    for place, letter in enumerate(line):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'" and (place == 0 or line[place - 1] in " :[{,-"):
            quote = letter
        elif letter == "#" and (place == 0 or line[place - 1] in " \t"):
            return line[:place]
    return line


def _opened(content: str) -> int:
    bare = re.sub(r""""(?:[^"\\]|\\.)*"|'[^']*'""", "", content)
    return sum((letter in "[{") - (letter in "]}") for letter in bare)


def _block(lines: list[_Line], at: int, indent: int, source: str | Path, depth: int) -> tuple[Any, int]:
    """Parse the lines of one indentation from `at`; return their value and the line after them."""
    if depth > MAX_DEPTH:
        raise _malformed(source, lines[at], f"more than {MAX_DEPTH} nested levels")
    first = lines[at][2]
    if first.startswith("- ") or first == "-":
        return _sequence(lines, at, indent, source, depth)
    if _KEY.match(first):
        return _map(lines, at, indent, source, depth)
    if at + 1 < len(lines) and lines[at + 1][1] >= indent:
        raise _malformed(source, lines[at], "neither a key with a colon nor a list's dash")
    return _scalar(first, lines[at], source), at + 1


def _map(lines: list[_Line], at: int, indent: int, source: str | Path, depth: int) -> tuple[Any, int]:
    value: dict[str, Any] = {}
    while at < len(lines) and lines[at][1] == indent:
        line = lines[at]
        match = _KEY.match(line[2])
        if match is None:
            if line[2].startswith("-"):
                break
            raise _malformed(source, line, "neither a key with a colon nor a list's dash")
        key = match["key"].strip().strip("\"'")
        if key in value:
            raise refusal(
                source, f"line {line[0]}: {cut(key)}", "the same key twice", "each key once", "remove one"
            )
        rest = _untagged(line[2][match.end() :])
        at += 1
        if rest:
            value[key] = _scalar(rest, line, source)
        elif at < len(lines) and (
            lines[at][1] > indent or (lines[at][1] == indent and lines[at][2][0] == "-")
        ):
            value[key], at = _block(lines, at, lines[at][1], source, depth + 1)
        else:
            value[key] = None
    return value, at


def _sequence(lines: list[_Line], at: int, indent: int, source: str | Path, depth: int) -> tuple[Any, int]:
    value: list[Any] = []
    while (
        at < len(lines) and lines[at][1] == indent and (lines[at][2].startswith("- ") or lines[at][2] == "-")
    ):
        number, _, content = lines[at]
        rest = content[1:].lstrip(" ")
        inner = indent + len(content) - len(rest)
        rest = _untagged(rest)
        if not rest:
            at += 1
            if at < len(lines) and lines[at][1] > indent:
                item, at = _block(lines, at, lines[at][1], source, depth + 1)
            else:
                item = None
        else:
            # The rest of the line is the first line of what is nested in the dash.
            lines[at] = (number, inner, rest)
            item, at = _block(lines, at, inner, source, depth + 1)
        value.append(item)
    return value, at


def _untagged(text: str) -> str:
    return re.sub(r"^!\S*\s*", "", text.strip())


def _scalar(text: str, line: _Line, source: str | Path) -> Any:
    if text[0] in "[{":
        try:
            return parse_flow(text)
        except FlowError as error:
            raise _malformed(source, line, str(error)) from None
    if text[0] in "&*|>@`%":
        raise _malformed(source, line, f"{text[0]!r}, which camera files have no use for")
    if text[0] in "\"'":
        if len(text) < 2 or text[-1] != text[0]:
            raise _malformed(source, line, "a quote that is not closed")
        return text[1:-1]
    return parse_scalar(text)


def _malformed(source: str | Path, line: _Line, got: str) -> InputError:
    number, _, content = line
    return refusal(
        source, f"line {number}", f"{got}, in {shown(content.strip())}", "YAML", "correct the file there"
    )
