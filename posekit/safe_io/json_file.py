"""Read JSON that may be malformed, huge, or meant to harm.

The standard parser accepts NaN, Infinity, 1e400 and repeated keys and recurses as deep as the text nests;
here each of these is refused before anything is made of it.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import InputError
from posekit.safe_io.refusal import cut, refusal, shown
from posekit.safe_io.regular_file import read_bytes
from posekit.safe_io.text_file import decode

MAX_BYTES: Final = 100_000_000
"""The largest file that is read as JSON; also the largest that is written as JSON."""
MAX_DEPTH: Final = 64
"""How deep lists and objects may nest; posekit's own schemas need 7."""
MAX_CONTAINERS: Final = 10_000_000
"""How many lists and objects a file may hold: ``[],`` repeated costs 20 times its size in memory."""
MAX_DIGITS: Final = 308
"""Digits of an integer that surely fits a float64."""

_TOO_LARGE: Final = "split it, or use .npz where the command takes it"
_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+(?:"|\\?\Z)', re.DOTALL)
_NOT_BRACKETS = bytes(byte for byte in range(256) if byte not in b"[]{}")
_CHUNK = 1 << 20
_ANY_DIGIT = bytes.maketrans(b"123456789", b"000000000")
_LONG_NUMBERS = (b"0" * 200, b"0e000", b"0e+000", b"0E000", b"0E+000")


class _SuspiciousError(ValueError):
    """Raised in the parser's hooks; `_suspicion` then finds where."""


class _Literal(str):
    """A number that no float64 holds, as it was spelled."""


class _Pairs(list[tuple[str, Any]]):
    """An object with its keys as they were written, repeated ones included."""


def read_json(path: str | Path) -> Any:
    """Read a JSON file.

    Parameters
    ----------
    path : path
        A regular file of at most 1e8 bytes, UTF-8.

    Returns
    -------
    object
        What `json.loads` makes of it; every number is finite, no key is repeated in its object, and lists and
        objects nest at most 64 deep.

    Raises
    ------
    InputError
        Where the file is missing, not readable, empty, too large, not UTF-8, malformed (with line and column)
        or holds what is said above not to be there.
    """
    return parse_json(path, read_bytes(path, limit=MAX_BYTES, too_large=_TOO_LARGE))


def parse_json(path: str | Path, data: bytes) -> Any:
    """Parse JSON that came from `path`, with the checks of `read_json`."""
    text = decode(path, data)
    _check_size(path, data)
    # Looking at each number costs as much as parsing it: that is left out where none can be too large.
    looked_at: dict[str, Any] = {"parse_float": _finite, "parse_int": _integer} if _may_overflow(data) else {}
    try:
        return json.loads(text, object_pairs_hook=_unique, parse_constant=_constant, **looked_at)
    except _SuspiciousError:
        raise _suspicion(path, text) from None
    except json.JSONDecodeError as error:
        raise _malformed(path, text, error) from None
    except RecursionError:
        raise _too_deep(path, "deeper nesting than the parser takes") from None


def _malformed(path: str | Path, text: str, error: json.JSONDecodeError) -> InputError:
    return refusal(
        path,
        f"line {error.lineno} column {error.colno}",
        shown(text[error.pos : error.pos + 20]) if error.pos < len(text) else "the end of the file",
        f"JSON ({error.msg[0].lower()}{error.msg[1:]})",
        "correct the file there",
    )


def _too_deep(path: str | Path, got: str) -> InputError:
    return refusal(path, "", got, f"at most {MAX_DEPTH} levels", "flatten it: no posekit file nests so deep")


def _check_size(path: str | Path, data: bytes) -> None:
    """Refuse what nests too deep or holds too many lists and objects, before it is parsed."""
    depth, containers = nesting(data)
    if depth > MAX_DEPTH:
        raise _too_deep(path, f"{depth:,} nested levels")
    if containers > MAX_CONTAINERS:
        raise refusal(
            path,
            "",
            f"{containers:,} lists and objects",
            f"at most {MAX_CONTAINERS:,}",
            "split the file, or use .npz where the command takes it",
        )


def nesting(data: bytes) -> tuple[int, int]:
    """Return how deep lists and objects of JSON nest, and how many there are, without recursion.

    A bracket inside a string opens nothing, so the strings go first; the pattern takes an unterminated one
    to the end and never backtracks, which keeps it linear.
    """
    brackets = _STRING.sub(b"", data).translate(None, delete=_NOT_BRACKETS)
    level = deepest = containers = 0
    for start in range(0, len(brackets), _CHUNK):
        codes = np.frombuffer(brackets, np.uint8, min(_CHUNK, len(brackets) - start), start)
        opening = (codes == ord("[")) | (codes == ord("{"))
        levels = level + np.cumsum(np.where(opening, 1, -1))
        deepest = max(deepest, int(levels.max()))
        level = int(levels[-1])
        containers += int(opening.sum())
    return deepest, containers


def _may_overflow(data: bytes) -> bool:
    """Tell whether a number may be one that no float64 holds: it has 200 digits in a row, or 3 in its exponent.

    One with fewer is below 10^299, as 199 digits times 10^99 are.
    """
    digits = data.translate(_ANY_DIGIT)
    return any(long in digits for long in _LONG_NUMBERS)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    unique = dict(pairs)
    if len(unique) != len(pairs):
        raise _SuspiciousError
    return unique


def _finite(text: str) -> float:
    value = float(text)
    if math.isinf(value):
        raise _SuspiciousError
    return value


def _integer(text: str) -> int:
    if len(text) > MAX_DIGITS:
        raise _SuspiciousError
    return int(text)


def _constant(_text: str) -> float:
    raise _SuspiciousError


def _suspicion(path: str | Path, text: str) -> InputError:
    """Parse once more, keeping what was refused in its place, and say where the first of it is."""
    try:
        tree = json.loads(
            text,
            object_pairs_hook=_Pairs,
            parse_float=lambda number: _Literal(number) if math.isinf(float(number)) else float(number),
            parse_int=lambda number: _Literal(number) if len(number) > MAX_DIGITS else int(number),
            parse_constant=_Literal,
        )
    except json.JSONDecodeError as error:
        return _malformed(path, text, error)
    field, got, expected, remedy = next(_suspicions(tree, ""))
    return refusal(path, field, got, expected, remedy)


def _suspicions(node: Any, field: str) -> Iterator[tuple[str, str, str, str]]:
    """Walk a parsed tree, at most `MAX_DEPTH` deep, to what the hooks refused."""
    if isinstance(node, _Literal):
        yield (
            field,
            cut(node),
            "a finite number",
            "leave out or write null for what is not known, where the schema allows it",
        )
    elif isinstance(node, _Pairs):
        seen = set()
        for key, value in node:
            place = f"{field}.{cut(key)}" if field else cut(key)
            if key in seen:
                yield place, "the same key twice", "each key once", "remove one of the two"
            seen.add(key)
            yield from _suspicions(value, place)
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from _suspicions(value, f"{field}[{index}]")
