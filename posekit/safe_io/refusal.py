"""The one line that refuses an input: file, field, value, what was expected, what to do."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable
from os import PathLike

from posekit.errors import InputError

MAX_SHOWN_CHARACTERS = 60
"""Characters of a value, a name or a list of names that are shown before it is cut."""

MAX_LINE_CHARACTERS = 500
"""Characters of a line that refuses something."""


def refusal(
    source: str | PathLike[str], field: str, got: str, expected: str, remedy: str = "correct it"
) -> InputError:
    """Word a refusal as ``file: field: got value; expected this; do that``.

    Parameters
    ----------
    source : path or str
        The file, or whatever else the value came from; empty where there is none.
    field : str
        Where in it, as ``frames[3].image.left_elbow``; empty for the whole.
    got, expected, remedy : str
        The value (see `shown`), what would be accepted, and what to do about it; to correct it, where
        nothing more can be said.
    """
    places = [str(place) for place in (source, field) if str(place)]
    return InputError(bounded(one_line(": ".join([*places, f"got {got}; expected {expected}; {remedy}"]))))


def one_line(text: str) -> str:
    """Escape what does not print: names in a damaged file may hold anything, line ends included."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


def bounded(text: str) -> str:
    """Cut a line that is too long to read in its middle: it begins with what is wrong, and ends with what to do."""
    half = MAX_LINE_CHARACTERS // 2
    return text if len(text) <= MAX_LINE_CHARACTERS else f"{text[:half]} … {text[3 - half :]}"


def shown(value: object) -> str:
    """Show a value as JSON spells it, cut to a readable length, always on one line."""
    if isinstance(value, dict):
        names = [cut(json.dumps(str(key))) for key in list(value)[:3]]
        return f"an object of {len(value)} entries ({', '.join(names)}{', …' if len(value) > 3 else ''})"
    if isinstance(value, list | tuple):
        if len(value) <= 6 and not any(isinstance(entry, list | tuple | dict) for entry in value):
            return "[" + ", ".join(shown(entry) for entry in value) + "]"
        return f"a list of {len(value)} entries"
    if isinstance(value, str):
        return cut(json.dumps(value[: MAX_SHOWN_CHARACTERS + 1]))
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, float) and not math.isfinite(value):
        return json.dumps(value)
    return cut(str(value))


def cut(text: str) -> str:
    """Shorten a text that is too long to show."""
    return text if len(text) <= MAX_SHOWN_CHARACTERS else text[: MAX_SHOWN_CHARACTERS - 1] + "…"


def nearest(name: str, names: Iterable[str]) -> str:
    """Suggest what a name was meant to be: the nearest valid names, or all of them where none is near."""
    valid = list(names)
    flipped = "-".join(reversed(name[:MAX_SHOWN_CHARACTERS].split("-")))
    near = (
        [flipped]
        if "-" in name and flipped in valid
        else difflib.get_close_matches(name[:MAX_SHOWN_CHARACTERS], valid)
    )
    if near:
        return f"did you mean {' or '.join(near)}?"
    return f"valid names are {', '.join(valid)}"


def perhaps(name: str, names: Iterable[str]) -> str:
    """Suggest what a name was meant to be, as the end of a sentence that lists the names; empty where none is near."""
    near = difflib.get_close_matches(name[:MAX_SHOWN_CHARACTERS], list(names), n=1)
    return f"; did you mean {near[0]}?" if near else ""
