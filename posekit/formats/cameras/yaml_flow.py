"""Values of YAML on one line: numbers, words, lists and maps in brackets."""

from __future__ import annotations

import re
from typing import Any, Final

MAX_DEPTH: Final = 16

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?")
_SPECIAL: Final = {".nan": "nan", ".inf": "inf", "+.inf": "inf", "-.inf": "-inf"}
_WORDS: Final = {"true": True, "false": False, "null": None, "~": None, "": None}
_TOKEN = re.compile(
    r"""\s*(?:(?P<sign>[\[\]{},:])|"(?P<double>[^"]*)"|'(?P<single>[^']*)'|(?P<bare>[^\[\]{},:"']+))"""
)

_Token = tuple[str, Any]
"""A sign and None, or nothing and a value."""


class FlowError(ValueError):
    """What is wrong with a line; the caller says where it is."""


def parse_scalar(text: str) -> Any:
    """Parse one word: a number, a truth value, nothing, or a text.

    OpenCV spells what is not finite ``.Nan``, ``.Inf``, ``-.Inf``.
    """
    low = text.casefold()
    if low in _WORDS:
        return _WORDS[low]
    if low in _SPECIAL:
        return float(_SPECIAL[low])
    if _NUMBER.fullmatch(text):
        whole = text.lstrip("+-").isdecimal() and len(text) <= 18
        return int(text) if whole else float(text)
    return text


def parse_flow(text: str) -> Any:
    """Parse ``[1, 2, [3]]`` or ``{a: 1, b: [2]}``.

    Raises
    ------
    FlowError
        Where brackets, commas or colons are not in their places, or it nests deeper than 16.
    """
    tokens = _tokens(text)
    value, following = _value(tokens, 0, 0)
    if following < len(tokens):
        raise FlowError("something after the closing bracket")
    return value


def _tokens(text: str) -> list[_Token]:
    tokens: list[_Token] = []
    place = 0
    end = len(text.rstrip())
    while place < end:
        match = _TOKEN.match(text, place)
        if match is None:
            raise FlowError("a quote that is not closed")
        place = match.end()
        if match["sign"]:
            tokens.append((match["sign"], None))
        elif match["bare"] is not None:
            tokens.append(("", parse_scalar(match["bare"].strip())))
        else:
            tokens.append(("", match["double"] if match["double"] is not None else match["single"]))
    return tokens


def _value(tokens: list[_Token], at: int, depth: int) -> tuple[Any, int]:
    if depth > MAX_DEPTH:
        raise FlowError(f"more than {MAX_DEPTH} nested levels")
    if at >= len(tokens):
        raise FlowError("a bracket that is not closed")
    sign, value = tokens[at]
    if not sign:
        return value, at + 1
    if sign == "[":
        return _list(tokens, at + 1, depth)
    if sign == "{":
        return _map(tokens, at + 1, depth)
    raise FlowError(f"{sign!r} where a value is due")


def _list(tokens: list[_Token], at: int, depth: int) -> tuple[list[Any], int]:
    values: list[Any] = []
    while not _closes(tokens, at, "]"):
        value, at = _value(tokens, at, depth + 1)
        values.append(value)
        at = _separated(tokens, at, "]")
    return values, at + 1


def _map(tokens: list[_Token], at: int, depth: int) -> tuple[dict[str, Any], int]:
    values: dict[str, Any] = {}
    while not _closes(tokens, at, "}"):
        sign, key = tokens[at]
        if sign or at + 1 >= len(tokens) or tokens[at + 1][0] != ":":
            raise FlowError("a map's entry without a colon")
        if str(key) in values:
            raise FlowError("the same key twice in a map")
        values[str(key)], at = _value(tokens, at + 2, depth + 1)
        at = _separated(tokens, at, "}")
    return values, at + 1


def _closes(tokens: list[_Token], at: int, sign: str) -> bool:
    if at >= len(tokens):
        raise FlowError("a bracket that is not closed")
    return tokens[at][0] == sign


def _separated(tokens: list[_Token], at: int, closing: str) -> int:
    """Pass over a comma; nothing else stands between entries."""
    if at < len(tokens) and tokens[at][0] == ",":
        return at + 1
    if at < len(tokens) and tokens[at][0] == closing:
        return at
    raise FlowError("two entries without a comma, or brackets that do not match")
