"""Watch calls: what functions of a package are given and return must be what their annotations say, to the dtype."""

from __future__ import annotations

import inspect
import sys
import types
import typing
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from types import CodeType, FrameType, FunctionType
from typing import Any, ClassVar, Literal, Union

import numpy as np

BOUNDS = ("lower", "upper")
"""Fields that may be whole numbers: thresholds are written so."""


@contextmanager
def watched(package: str) -> Iterator[set[str]]:
    """Yield a set to which it is added, while calls are made, where something is not what its annotation says."""
    wrong: set[str] = set()
    functions = functions_of(package)

    def look(frame: FrameType, event: str, value: Any) -> None:
        function = functions.get(frame.f_code) if event in ("call", "return") else None
        if function is None:
            return
        code, hints = frame.f_code, hints_of(function)
        if event == "call":
            for name in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]:
                if name in hints:
                    said = unlike(frame.f_locals[name], hints[name])
                    wrong.update(f"{code.co_qualname}({name}): {why}" for why in said)
        # None is what an exception leaves, too.
        elif value is not None and not code.co_flags & inspect.CO_GENERATOR and "return" in hints:
            wrong.update(f"{code.co_qualname} returns {why}" for why in unlike(value, hints["return"]))

    sys.setprofile(look)
    try:
        yield wrong
    finally:
        sys.setprofile(None)


def functions_of(package: str) -> dict[CodeType, FunctionType]:
    """Return the functions and methods of a package's modules, as far as they are imported, by their code."""
    found: dict[CodeType, FunctionType] = {}
    for module in [one for name, one in sys.modules.items() if name.startswith(package)]:
        held = list(vars(module).values())
        for each in [*held, *(own for one in held if isinstance(one, type) for own in vars(one).values())]:
            inner = each
            for name in ("__func__", "__wrapped__", "fget", "func"):
                inner = getattr(inner, name, None) or inner
            if isinstance(inner, FunctionType) and inner.__code__.co_filename == module.__file__:
                found[inner.__code__] = inner
    return found


@cache
def hints_of(of: type | FunctionType) -> dict[str, Any]:
    """Return annotations; none where some of them are names that only a type checker imports."""
    try:
        return typing.get_type_hints(of)
    except NameError:
        return {}


def unlike(value: Any, hint: Any) -> Iterator[str]:
    """Yield why a value, or what is inside of it, is not what an annotation says."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType, ClassVar):
        reasons = [list(unlike(value, one)) for one in parts]
        yield from [] if [] in reasons else reasons[0]
        return
    if origin is np.ndarray:
        (kind,) = typing.get_args(parts[1])
        if not isinstance(value, np.ndarray | np.generic):
            yield f"{type(value).__name__}, no array"
        elif kind is not Any and not issubclass(value.dtype.type, kind):
            yield f"{value.dtype}, not {kind.__name__}"
    elif origin is Literal:
        if value not in parts:
            yield f"{value!r}, not of {parts}"
    elif origin is None and not _is_instance(value, hint):
        yield f"{type(value).__name__}, not {hint.__name__}"
    elif origin is tuple and not (
        isinstance(value, tuple) and (parts[1:] == (...,) or len(value) == len(parts))
    ):
        yield f"{value!r}, not {hint}"
    for one, kind, where in (*inside(value, parts), *fields_of(value)):
        yield from (f"{where}{why}" for why in unlike(one, kind))


def _is_instance(value: Any, hint: Any) -> bool:
    """Tell whether a value is of a class, where the annotation is one: a float may be whole, and no number a bool."""
    if not isinstance(hint, type) or hint is Any or getattr(hint, "_is_protocol", False):
        return True
    numbers: dict[type, Any] = {float: (float, int, np.floating, np.integer), int: (int, np.integer)}
    return isinstance(value, numbers.get(hint, hint)) and not (hint in numbers and isinstance(value, bool))


def inside(value: Any, parts: tuple[Any, ...]) -> Iterator[tuple[Any, Any, str]]:
    """Yield what a tuple, a list or a mapping holds, and the annotation of each."""
    if type(value) is tuple:
        kinds = parts[:1] * len(value) if parts[1:] == (...,) else parts
        yield from ((one, kind, "") for one, kind in zip(value, kinds, strict=False))
    elif isinstance(value, list) and parts:
        yield from ((one, parts[0], "") for one in value)
    elif isinstance(value, Mapping) and len(parts) == len(("key", "value")):
        yield from ((one, kind, "") for pair in value.items() for one, kind in zip(pair, parts, strict=True))


def fields_of(value: Any) -> Iterator[tuple[Any, Any, str]]:
    """Yield the fields of a dataclass or a named tuple of posekit, and their annotations."""
    if type(value).__module__.startswith("posekit."):
        names = getattr(value, "_fields", getattr(value, "__dataclass_fields__", ()))
        of: Any = type(value)
        for name, kind in hints_of(of).items():
            if name in names and name not in BOUNDS:
                yield getattr(value, name), kind, f"{type(value).__name__}.{name}: "
