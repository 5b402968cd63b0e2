"""TOML: bounded size, depth and length of keys, finite numbers.

The standard parser takes quadratic time on a key of many parts, recurses as deep as the text nests, and reads
NaN, infinities and integers that no float holds.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from posekit.errors import InputError
from posekit.safe_io.refusal import cut, one_line, refusal
from posekit.safe_io.text_file import read_text

MAX_BYTES: Final = 1_000_000
MAX_DEPTH: Final = 16
"""How deep tables and lists may nest."""
MAX_DIGITS: Final = 308
"""Digits of an integer that surely fits a float64."""

_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"{_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{MAX_DEPTH},}}")


def read_toml(path: str | Path, *, limit: int = MAX_BYTES, finite: bool = True) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : path
        A regular file of at most `limit` bytes, UTF-8.
    limit : int
        Bytes.
    finite : bool
        Whether to refuse NaN, infinities and integers that no float64 holds.

    Raises
    ------
    InputError
        Where it cannot be read, is no TOML (with line and column), or is beyond a bound.
    """
    return parse_toml(read_text(path, limit=limit), path, finite=finite)


def parse_toml(text: str, source: str | Path, *, finite: bool = True) -> dict[str, Any]:
    """Parse TOML that came from `source`, with the checks of `read_toml`."""
    if long := _LONG_KEY.search(text):
        line = text.count("\n", 0, long.start()) + 1
        raise _too_deep(source, f"line {line}", f"a key of {long.group().count('.') + 1} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise _too_deep(source, "", "deeper nesting than the parser takes") from None
    except ValueError as error:  # a number of thousands of digits is a plain ValueError
        reason = one_line(str(error).partition(";")[0])
        raise refusal(source, "", f"not TOML: {reason}", "TOML", "correct the file there") from None
    for field, depth, value in _walk(table):
        if depth > MAX_DEPTH:
            raise _too_deep(source, field, f"{depth} nested levels")
        if finite and not _is_finite(value):
            got = cut(str(value)) if isinstance(value, float) else "an integer that no float64 holds"
            raise refusal(source, field, got, "a finite number", "correct it, or leave it out")
    return table


def _is_finite(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return not isinstance(value, int) or value.bit_length() <= MAX_DIGITS * math.log2(10)


def _walk(table: dict[str, Any]) -> Iterator[tuple[str, int, object]]:
    """Go through all values, with their place and depth, without recursion."""
    waiting: list[tuple[str, int, object]] = [("", 0, table)]
    while waiting:
        field, depth, value = waiting.pop()
        yield field, depth, value
        if depth > MAX_DEPTH:
            continue
        if isinstance(value, dict):
            place = f"{field}." if field else ""
            waiting += [(f"{place}{cut(key)}", depth + 1, entry) for key, entry in value.items()]
        elif isinstance(value, list):
            waiting += [(f"{field}[{index}]", depth + 1, entry) for index, entry in enumerate(value)]


def _too_deep(source: str | Path, field: str, got: str) -> InputError:
    return refusal(source, field, got, f"at most {MAX_DEPTH} levels", "flatten it")
