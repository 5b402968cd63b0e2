"""Loops that Numba compiles where it is installed (the extra ``fast``), once it pays.

A module of kernels is plain Python on plain arrays, with the functions to compile listed in `COMPILED`, each with the
types it takes (none: it is compiled into those that call it). They are compiled as copies that know each other; the
module itself needs no Numba. Machine code is kept on disk in Numba's own
cache, under names that carry a hash of the source and its constants: old code is never run for new sources.

What runs compiled gives what runs uncompiled, so it may be switched at any moment. Importing Numba and loading the code
take about as long as growing some thousand trees without them: they are loaded when so many have been grown.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, Literal

Path_ = Literal["auto", "plain", "fast"]

PAYS_FROM = 5000
"""Frames that were grown in this process from which Numba is loaded: until then it costs more than it brings."""

_LOCK = threading.Lock()
_LOADED: dict[str, Any] = {}


class _State:
    """What was chosen, and what was grown so far."""

    chosen: Path_ = "auto"
    grown: int = 0
    threads: int | None = None


def n_threads() -> int:
    """Return how many threads compiled loops may use.

    The cores that this process has, unless told otherwise: by `use_threads`, or by ``OMP_NUM_THREADS`` as it is set.
    """
    if _State.threads is not None:
        return _State.threads
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    said = os.environ.get("OMP_NUM_THREADS", "")
    return min(cores, max(int(said), 1)) if said.isdecimal() else cores


def use_threads(threads: int | None) -> None:
    """Limit the threads of compiled loops in this process: one, where every core has a process. None: no limit."""
    _State.threads = threads


def is_fast(frames: int) -> bool:
    """Count frames that are about to be grown, and say whether compiled loops shall grow them."""
    if _State.chosen != "auto":
        return _State.chosen == "fast"
    _State.grown += frames
    return _State.grown > PAYS_FROM and _numba() is not None


@contextmanager
def path(chosen: Path_) -> Iterator[None]:
    """Choose the ``plain`` or the ``fast`` path for a while: for tests and benchmarks, results are the same.

    Where Numba is missing the fast path runs uncompiled, which is slow.
    """
    before, _State.chosen = _State.chosen, chosen
    try:
        yield
    finally:
        _State.chosen = before


def compiled(module: ModuleType) -> Any:
    """Return a module's kernels, compiled if Numba is there: an object with a function for each of `COMPILED`."""
    loaded = _LOADED.get(module.__name__)
    if loaded is None:
        with _LOCK:
            loaded = _LOADED.setdefault(module.__name__, _load(module))
    return loaded


def _load(module: ModuleType) -> Any:
    numba = _numba()
    if numba is None:
        return module
    try:
        return _compiled(module, numba, on_disk=True)
    except (RuntimeError, OSError, EOFError, pickle.UnpicklingError):
        # No folder that can be written, or a damaged cache: compile for this process alone.
        return _compiled(module, numba, on_disk=False)


def _compiled(module: ModuleType, numba: ModuleType, *, on_disk: bool) -> SimpleNamespace:
    """Compile copies of a module's functions, which call each other's compiled copies."""
    names = dict(vars(module))
    constants = sorted((name, value) for name, value in names.items() if isinstance(value, int | float))
    source = Path(str(module.__file__)).read_bytes()
    digest = hashlib.sha256(source + repr(constants).encode()).hexdigest()[:12]
    for name, types in module.COMPILED.items():
        function = names[name]
        copy = FunctionType(function.__code__, names, name, function.__defaults__)
        copy.__qualname__ = f"{name}_{digest}"
        copy.__module__ = module.__name__
        if types:
            names[name] = numba.njit(types, nogil=True, cache=on_disk, error_model="numpy")(copy)
        else:
            names[name] = numba.njit(nogil=True, error_model="numpy")(copy)
    return SimpleNamespace(**{name: names[name] for name, types in module.COMPILED.items() if types})


@cache
def _numba() -> ModuleType | None:
    """Import Numba; None where it is missing, or not made for this NumPy."""
    try:
        return import_module("numba")
    except ImportError as error:
        if not isinstance(error, ModuleNotFoundError):
            warnings.warn(
                f"numba cannot be used, the slower path is taken: {error}", RuntimeWarning, stacklevel=4
            )
        return None
