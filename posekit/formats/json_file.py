"""JSON: parse files that may be damaged, and write documents whose arrays contain NaN."""

from __future__ import annotations

import gc
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, cut, refusal, shown
from posekit.files import text, write_bytes

#: Largest size in bytes of a file that is parsed or written; a parsed document takes about ten times as much memory.
MAX_JSON_BYTES: Final = 500_000_000

#: Largest size in bytes of a file that is checked for repeated keys; only small files are edited by hand.
MAX_BY_HAND: Final = 1_000_000


@contextmanager
def without_collection() -> Iterator[None]:
    """Pause cyclic garbage collection, which takes half of the time of parsing or writing millions of lists."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def parse(data: bytes, source: str | Path) -> Any:
    """Parse a JSON file.

    Parameters
    ----------
    data : bytes
        Content of the file in UTF-8.
    source : path
        Path of the file, for error messages.

    Returns
    -------
    object
        Lists, dicts, strings, numbers, booleans and None. NaN and infinite numbers are accepted here; readers refuse
        them in fields that need finite numbers.

    Raises
    ------
    InputError
        If the file is empty, too large, malformed or nested too deeply, or an object repeats a key.
    """
    if len(data) > MAX_JSON_BYTES:
        raise _too_large(source)
    if not data.strip():
        raise refusal(source, "", "an empty file", "JSON", "check how it was written")
    spelled = text(data, str(source))

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) != len(pairs):
            twice = next(key for k, (key, _) in enumerate(pairs) if key in dict(pairs[:k]))
            raise refusal(source, cut(twice), "the same key twice in one object", "one", "remove one")
        return found

    try:
        with without_collection():
            return json.loads(spelled, object_pairs_hook=unique if len(data) < MAX_BY_HAND else None)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno} column {error.colno}"
        rest = spelled[error.pos : error.pos + 20]
        got = shown(rest) if rest else "the end of the file"
        raise refusal(
            source, where, got, f"JSON ({error.msg[0].lower()}{error.msg[1:]})", "correct the file there"
        ) from None
    except RecursionError:
        raise refusal(source, "", "values nested too deeply", "at most 900 levels", "flatten it") from None
    except ValueError as error:  # an integer of more digits than Python converts
        raise refusal(source, "", cut(str(error)), "numbers of ordinary length") from None


def write(path: str | Path, head: dict[str, Any], name: str = "", items: Iterable[Any] = ()) -> None:
    """Write ``{**head, name: [items]}`` as JSON with one entry and one item per line.

    If writing fails, no incomplete file remains.

    Parameters
    ----------
    path : path
        Path that ends in ``.json``, or in ``.json.gz`` for a compressed file.
    head : dict
        Entries of the document, without NaN; see `nullable`.
    name : str
        Key of the list of items; empty for a document without this list.
    items : iterable
        Items of the list.

    Raises
    ------
    InputError
        If the file cannot be written, or would be too large to be read again.
    """
    data = bytearray()
    with without_collection():
        for piece in _pieces(head, name, items):
            data += piece.encode()
            if len(data) > MAX_JSON_BYTES:
                raise _too_large(path)
    write_bytes(path, bytes(data))


def _pieces(head: dict[str, Any], name: str, items: Iterable[Any]) -> Iterator[str]:
    spell = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode
    yield "{\n" + ",\n".join(f" {spell(key)}: {spell(value)}" for key, value in head.items())
    if name:
        yield f",\n {spell(name)}: ["
        separator = "\n  "
        for item in items:
            yield separator + spell(item)
            separator = ",\n  "
        yield "\n ]"
    yield "\n}\n"


def nullable(values: NDArray[Any] | float) -> Any:
    """Convert an array to nested lists, or a number to a float, with None for NaN."""
    array = np.asarray(values)
    if array.dtype.kind != "f" or not np.isnan(array).any():
        return array.tolist()
    return np.where(np.isnan(array), None, array).tolist()  # type: ignore[call-overload]


def _too_large(path: str | Path) -> InputError:
    return refusal(path, "", f"over {MAX_JSON_BYTES / 1e6:.0f} MB of JSON", "less", "use .npz, or split it")
