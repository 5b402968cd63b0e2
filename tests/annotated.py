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
from typing import Any, Literal, Union

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
            for name in ("__func__", "__wrapped__", "fget", "func"):
                each = getattr(each, name, None) or each
            if isinstance(each, FunctionType) and each.__code__.co_filename == module.__file__:
                found[each.__code__] = each
    return found


@cache
def hints_of(of: Any) -> dict[str, Any]:
    """Return annotations; none where some of them are names that only a type checker imports."""
    try:
        return typing.get_type_hints(of)
    except NameError:
        return {}


def unlike(value: Any, hint: Any) -> Iterator[str]:
    """Yield why a value, or what is inside of it, is not what an annotation says."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType):
        reasons = [list(unlike(value, one)) for one in parts]
        yield from [] if [] in reasons else reasons[0]
    elif origin is np.ndarray:
        (kind,) = typing.get_args(parts[1])
        if not isinstance(value, np.ndarray | np.generic):
            yield f"{type(value).__name__}, no array"
        elif kind is not Any and not issubclass(value.dtype.type, kind):
            yield f"{value.dtype}, not {kind.__name__}"
    elif origin is Literal:
        if value not in parts:
            yield f"{value!r}, not of {parts}"
    elif origin is tuple and isinstance(value, tuple):
        kinds = parts[:1] * len(value) if parts[1:] == (...,) else parts
        if len(kinds) != len(value):
            yield f"{len(value)} values, not {len(kinds)}"
        for one, kind in zip(value, kinds, strict=False):
            yield from unlike(one, kind)
    elif isinstance(value, list) and parts:
        for one in value:
            yield from unlike(one, parts[0])
    elif isinstance(value, Mapping) and len(parts) == len(("key", "value")):
        for pair in value.items():
            for one, kind in zip(pair, parts, strict=True):
                yield from unlike(one, kind)
    elif isinstance(hint, type) and hint is not Any and not getattr(hint, "_is_protocol", False):
        of_kind = {float: (float, int, np.floating, np.integer), int: (int, np.integer)}.get(hint, hint)
        if not isinstance(value, of_kind) or (hint in (float, int) and isinstance(value, bool)):
            yield f"{type(value).__name__}, not {hint.__name__}"
    if type(value).__module__.startswith("posekit."):
        for name, kind in hints_of(type(value)).items():
            if name in getattr(value, "_fields", getattr(value, "__dataclass_fields__", ())) and name not in BOUNDS:
                yield from (f"{type(value).__name__}.{name}: {why}" for why in unlike(getattr(value, name), kind))
