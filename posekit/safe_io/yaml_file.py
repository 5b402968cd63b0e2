"""YAML: PyYAML's events of a safe loader, with bounded size and depth, each key once, without anchors or objects.

A tree is made of the events instead of by the loader, so that nothing nests deeper than is checked, an alias cannot
unfold, and a tag (``!!opencv-matrix``) makes no object. What a plain word means is what OpenCV, ROS and YAML 1.2 agree
on: YAML 1.1, which PyYAML reads, takes ``1e-05`` for a text and ``1:30`` for 90.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import yaml

from posekit.safe_io.refusal import cut, one_line, refusal, shown

MAX_DEPTH: Final = 16
"""How deep lists and maps may nest."""
YAML_LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The one in C, where PyYAML was built with it: ten times as fast, the same events."""

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?")
_WORDS: Final = {
    **{"true": True, "false": False, "null": None, "~": None, "": None},
    **{".nan": float("nan"), ".inf": float("inf"), "+.inf": float("inf"), "-.inf": float("-inf")},
}
_OPENCV = re.compile(r"\A%YAML:[^\n]*")
_UNPRINTED = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def parse_yaml(text: str, source: str | Path) -> Any:
    """Parse YAML of maps, lists, numbers and words.

    Parameters
    ----------
    text : str
        One document. OpenCV's header ``%YAML:1.0``, which is no YAML, is passed over.
    source : path
        What to call it in errors.

    Returns
    -------
    object
        Of dict, list, str, int, float, bool and None; keys are texts.

    Raises
    ------
    InputError
        Where it is no YAML (with line and column), has anchors or aliases, a key twice, several documents, or nests
        deeper than `MAX_DEPTH`.
    """
    text = _OPENCV.sub("", text)
    odd = _UNPRINTED.search(text)
    if odd is not None:
        place = f"line {text.count(chr(10), 0, odd.start()) + 1}"
        raise refusal(source, place, "a character that does not print", "YAML", "save the file again")
    try:
        return _tree(source, yaml.parse(text, Loader=YAML_LOADER))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = "" if mark is None else f"line {mark.line + 1} column {mark.column + 1}"
        reason = one_line(str(getattr(error, "problem", None) or error))
        got = f"no YAML: {cut(reason)}"
        raise refusal(source, place, got, "maps, lists, numbers and words", "correct it") from None


def _tree(source: str | Path, events: Any) -> Any:
    """Make the one document of its events, without recursion."""
    documents: list[Any] = []
    # Open lists and maps, the outermost first: what is in them, and the key that waits for its value.
    open_: list[tuple[Any, list[str]]] = []
    for event in events:
        place = f"line {event.start_mark.line + 1}"
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise refusal(source, place, "an anchor or an alias", "values as they are", "write them out")
        if isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
            open_.pop()
            continue
        if isinstance(event, yaml.ScalarEvent):
            value = _scalar(event.value) if event.implicit[0] else event.value
        elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
            value = [] if isinstance(event, yaml.SequenceStartEvent) else {}
        else:
            continue
        _put(source, place, open_, documents, value, event)
        if isinstance(value, list | dict):
            open_.append((value, []))
            if len(open_) > MAX_DEPTH:
                raise refusal(
                    source, place, f"more than {MAX_DEPTH} nested levels", "a flat file", "flatten it"
                )
    if len(documents) != 1:
        got = f"{len(documents)} documents" if documents else "nothing but comments"
        raise refusal(source, "", got, "YAML", "check how it was written")
    return documents[0]


def _put(
    source: str | Path,
    place: str,
    open_: list[tuple[Any, list[str]]],
    documents: list[Any],
    value: Any,
    event: Any,
) -> None:
    """Put a value where it belongs: into the list or map that is open, or at the top."""
    if not open_:
        documents.append(value)
        return
    inside, waiting = open_[-1]
    if isinstance(inside, list):
        inside.append(value)
    elif waiting:
        inside[waiting.pop()] = value
    elif not isinstance(event, yaml.ScalarEvent):
        raise refusal(source, place, f"{shown(value)} as a key", "a word", "correct it")
    elif event.value in inside:
        raise refusal(source, place, f"{shown(event.value)} twice", "each key once", "remove one of the two")
    else:
        waiting.append(event.value)


def _scalar(text: str) -> Any:
    """Read a plain word: a number, a truth value, nothing, or a text. OpenCV spells ``.Nan``, ``.Inf``, ``-.Inf``."""
    low = text.casefold()
    if low in _WORDS:
        return _WORDS[low]
    if _NUMBER.fullmatch(text):
        whole = text.lstrip("+-").isdecimal() and len(text) <= 18
        return int(text) if whole else float(text)
    return text
