"""`Node`: checked access to a parsed document, with error messages that name the file, the field and the value."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, cut, nearest, one_line, refusal, shown
from posekit.geometry import FARTHEST_COORDINATE, Array

#: Default value that marks a required field.
MISSING: Final = object()


class Node:
    """One value of a parsed JSON, TOML or NPZ document, and its path in the document.

    Parameters
    ----------
    value : object
        The value.
    source : path
        Path of the file.
    place : str
        Path of the value in the document, such as ``frames[3].image``; empty for the whole document.
    """

    __slots__ = ("place", "source", "value")

    def __init__(self, value: Any, source: str | Path, place: str = "") -> None:
        self.source, self.place = source, place
        self.value = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value

    def refused(self, expected: str, remedy: str = "correct it", got: str = "") -> InputError:
        """Return an `InputError` about this value: what was found, what was expected, and the remedy."""
        return refusal(self.source, self.place, got or self._shown(), expected, remedy)

    def wrong(self, key: str, value: Any, expected: str, remedy: str, got: str = "") -> InputError:
        """Return an `InputError` about the value of the member `key`."""
        place = f"{self.place}.{cut(key)}".lstrip(".")
        return Node(value, self.source, place).refused(expected, remedy, got)

    def _shown(self) -> str:
        if self.value is MISSING:
            return "nothing"
        if isinstance(self.value, np.ndarray) and self.value.size > 1:
            return f"an array of shape {self.value.shape}"
        return shown(self.value.tolist() if isinstance(self.value, np.ndarray | np.generic) else self.value)

    def at(self, key: str | int, default: Any = MISSING) -> Node:
        """Return a member of an object or list. If it is missing or null, return the default, or raise without one."""
        place = f"{self.place}[{key}]" if isinstance(key, int) else f"{self.place}.{cut(key)}".lstrip(".")
        value = self.value[key] if isinstance(key, int) else self.object().get(key)
        if value is None and default is MISSING:
            raise Node(MISSING, self.source, place).refused("this field", "add it")
        return Node(default if value is None else value, self.source, place)

    def has(self, key: str) -> bool:
        """Return whether an object has a member that is not null."""
        return self.object().get(key) is not None

    def object(self, names: Iterable[str] = (), remedy: str = "") -> Mapping[str, Any]:
        """Return the value as a mapping; refuse other values and, if `names` are given, keys outside `names`."""
        if not isinstance(self.value, Mapping):
            raise self.refused("an object", remedy or "correct it")
        valid = list(names)
        unknown = [key for key in self.value if key not in valid] if valid else []
        if unknown:
            near = nearest(str(unknown[0]), valid)
            remedy = remedy or f"{near} Otherwise remove it"
            raise self.wrong(str(unknown[0]), None, "no field of this name", remedy, "a field")
        return self.value

    def list(self, least: int = 0) -> Iterator[Node]:
        """Iterate over the members of a list; refuse a list with fewer than `least` members."""
        if not isinstance(self.value, list | tuple) or len(self.value) < least:
            raise self.refused(f"a list of {least} or more" if least else "a list")
        return (Node(value, self.source, f"{self.place}[{k}]") for k, value in enumerate(self.value))

    def text(self, choices: Iterable[str] = ()) -> str:
        """Return the value as a string; refuse strings that are not among the choices, if choices are given."""
        value, valid = self.value, list(choices)
        if not isinstance(value, str) or (valid and value not in valid):
            near = nearest(value, valid) if isinstance(value, str) and valid else "correct it"
            raise self.refused(" or ".join(map(shown, valid)) if 0 < len(valid) < 8 else "a text", near)
        return value

    def texts(self) -> tuple[str, ...]:
        """Return the value, a list or an array of strings, as a tuple."""
        values = self.value.tolist() if isinstance(self.value, np.ndarray) else self.value
        if not isinstance(values, list | tuple) or not all(isinstance(value, str) for value in values):
            raise self.refused("a list of texts")
        return tuple(values)

    def number(self, least: float = -FARTHEST_COORDINATE, most: float = FARTHEST_COORDINATE) -> float:
        """Return the value as a finite number; refuse numbers outside the bounds."""
        value = self.value.item() if getattr(self.value, "size", 0) == 1 else self.value
        ok = isinstance(value, int | float) and not isinstance(value, bool)
        if not ok or not least <= value <= most:
            bounded = f" from {least:g} to {most:g}" if ok or least > -FARTHEST_COORDINATE else ""
            raise self.refused(f"a finite number{bounded}")
        return float(value)

    def positive(self) -> float:
        """Return the value as a finite number; refuse numbers that are not positive."""
        value = self.number()
        if value <= 0:
            raise self.refused("a number greater than 0")
        return value

    def array(self, *shape: int | None, unknown: bool = False, most: float = FARTHEST_COORDINATE) -> Array:
        """Return the value as an array of floats.

        Parameters
        ----------
        *shape : int or None
            Required shape; None accepts any length of an axis. Without arguments any shape is accepted.
        unknown : bool
            Whether null and NaN are accepted and become NaN.
        most : float
            Largest absolute value.
        """
        wanted = " x ".join("any" if extent is None else str(extent) for extent in shape)
        expected = f"finite numbers{f', {wanted}' if wanted else ''}{' or null' if unknown else ''}"
        array = as_numbers(self.value)
        if array is None:
            raise self.refused(expected)
        pairs = zip(shape, array.shape, strict=False)
        fits = not shape or (array.ndim == len(shape) and all(want in (None, have) for want, have in pairs))
        if not fits and not (array.size == 0 and shape[0] in (None, 0)):
            raise self.refused(expected, got=f"numbers of shape {' x '.join(map(str, array.shape))}")
        with np.errstate(invalid="ignore"):
            bad = ~(np.abs(array) <= most) & ~(np.isnan(array) & unknown)
        if bad.any():
            where = tuple(int(k) for k in np.argwhere(bad)[0])
            place = self.place + "".join(f"[{k}]" for k in where)
            raise Node(float(array[where]), self.source, place).refused(expected)
        return array.reshape([0 if extent is None else extent for extent in shape]) if not fits else array


def as_numbers(value: Any) -> Array | None:
    """Convert nested lists of numbers and nulls, or an array of numbers or booleans, to floats; None if impossible."""
    try:
        array: NDArray[Any] = np.asarray(value)
        if array.dtype.kind == "O" and {type(one) for one in array.flat} <= {int, float, type(None)}:
            array = array.astype(np.float64)
        elif array.size == 0 and array.dtype.kind == "f":
            return array.astype(np.float64)
    except (ValueError, TypeError, OverflowError):
        return None
    kinds = "iufb" if array is value else "iuf"  # JSON's true and false are not numbers
    return array.astype(np.float64) if array.dtype.kind in kinds else None


def points_by_name(nodes: Sequence[Node], names: Sequence[str], axes: int, kind: str) -> Array:
    """Gather objects ``{name: [x, y, …]}`` into an array (F, len(names), axes); absent names are NaN.

    Parameters
    ----------
    nodes : sequence of F Node
        One object for each frame; None or an empty object has no points.
    names : sequence of str
        Allowed names of points.
    axes : int
        Number of coordinates of a point; 0 for a single number without a list.
    kind : str
        Noun for a named point in error messages, such as ``joint``.
    """
    place, most = {name: column for column, name in enumerate(names)}, FARTHEST_COORDINATE
    found = np.full((len(nodes), len(names), *([axes] if axes else [])), np.nan)
    for k, node in enumerate(nodes):
        if node.value is None or node.value == {}:
            continue
        for name, value in node.object().items():
            if name not in place:
                raise node.wrong(name, name, f"the name of a {kind}", nearest(name, names))
            known = value if axes else [value]
            fits = isinstance(known, list) and len(known) == (axes or 1)
            if not fits or not all(type(one) in (int, float) and -most <= one <= most for one in known):
                expected = f"{axes} finite numbers" if axes else "a finite number"
                raise node.wrong(name, value, expected, f"leave out a {kind} that is not known")
            found[k, place[name]] = value
    return found


def known_points(points: Array, names: Sequence[str]) -> dict[str, Any]:
    """Return the known points of one frame by name, from points (P, axes) or numbers (P,)."""
    known = np.isfinite(points if points.ndim == 1 else points[:, 0])
    return {names[k]: points[k].tolist() for k in np.flatnonzero(known).tolist()}


@contextmanager
def undamaged(source: str | Path, schema: str) -> Iterator[None]:
    """Convert Python's errors during reading to an `InputError` about a damaged file."""
    try:
        yield
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError) as error:
        reason = cut(one_line(f"{type(error).__name__}: {error}"))
        raise refusal(source, "", f"a damaged file ({reason})", schema, "write it again") from None


def schema_of(document: Any) -> str:
    """Return the schema that a JSON or NPZ document, or a table's metadata, states; empty without a schema."""
    about = getattr(document, "about", {}).get("posekit", "")
    if about:
        return next(iter(re.findall(r'^\{"schema": "([^"]*)"', about[:200])), "")
    stated = document.get("schema") if isinstance(document, Mapping) else None
    if isinstance(stated, np.ndarray) and stated.ndim == 0:
        stated = stated.item()
    return stated if isinstance(stated, str) else ""
