"""Loops that Numba compiles where it is installed (the extra ``fast``), once it pays.

A module of kernels is plain Python on plain arrays. The functions to compile are listed in `COMPILED_TYPES`, each with
the types it takes (none: it is compiled into its callers), and those of other modules in `KERNEL_PARTS`. They are
compiled as copies that know each other; the module itself needs no Numba. Machine code is kept on disk in Numba's own
cache, under names that carry a hash of the source and its constants: old code is never run for new sources.

Trees that are grown compiled are those that are grown uncompiled, so it may be switched at any moment. Importing Numba
and loading the code take about as long as growing some thousand trees without them: they are loaded when so many have
been grown. What is refined differs in rounding: there compiled loops run wherever Numba is installed (`is_installed`).
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, Literal

Path_ = Literal["auto", "plain", "fast"]

PAYS_FROM = 5000
"""Frames that were grown in this process from which Numba is loaded: until then it costs more than it brings."""

_LOCK = threading.Lock()
_LOADED: dict[tuple[str, str], Any] = {}


class _State:
    """What was chosen, and what was grown so far."""

    chosen: Path_ = "auto"
    grown: int = 0
    threads: int | None = None
    tell: Callable[[], None] | None = None


def when_compiling(tell: Callable[[], None] | None) -> None:
    """Call a function once, when loops are compiled that are not kept on disk: it takes up to half a minute."""
    _State.tell = tell


def _told(dispatcher: Any) -> Any:
    """Tell, if nobody was told, that a function was compiled anew."""
    tell = _State.tell
    if tell is not None and dispatcher.stats.cache_misses:
        _State.tell = None
        tell()
    return dispatcher


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


def is_installed() -> bool:
    """Say whether what is refined uses compiled loops: wherever Numba is installed, from the first frame on.

    It is the same to rounding only, so it depends on nothing that a process did or chose before.
    """
    return find_spec("numba") is not None and _numba() is not None


def expect(frames: int) -> None:
    """Say that as many frames are to come, or that what comes takes as long: loops are then compiled from now on."""
    _State.grown += frames


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


def compiled(module: ModuleType, parts: ModuleType | None = None) -> Any:
    """Return a module's kernels, compiled if Numba is there: an object with a function for each of `COMPILED_TYPES`.

    Functions of `parts` take the place of those of the same name: a module may leave some to be filled in.
    """
    key = (module.__name__, "" if parts is None else parts.__name__)
    loaded = _LOADED.get(key)
    if loaded is None:
        with _LOCK:
            loaded = _LOADED.get(key)
            if loaded is None:
                loaded = _LOADED[key] = _load(module, parts)
    return loaded


def _load(module: ModuleType, parts: ModuleType | None) -> Any:
    numba = _numba()
    if numba is None:
        return module if parts is None else _linked(module, parts, lambda copy, types: copy)
    try:
        return _compiled(module, parts, numba, on_disk=True)
    except (RuntimeError, OSError, EOFError, pickle.UnpicklingError):
        # No folder that can be written, or a damaged cache: compile for this process alone.
        return _compiled(module, parts, numba, on_disk=False)


def _compiled(
    module: ModuleType, parts: ModuleType | None, numba: ModuleType, *, on_disk: bool
) -> SimpleNamespace:
    """Compile copies of a module's functions, which call each other's compiled copies."""

    def compiling(copy: FunctionType, types: str) -> Any:
        if types:
            return _told(numba.njit(types, nogil=True, cache=on_disk, error_model="numpy")(copy))
        return numba.njit(nogil=True, error_model="numpy", forceinline=parts is not None)(copy)

    return _linked(module, parts, compiling)


def _linked(
    module: ModuleType, parts: ModuleType | None, make: Callable[[FunctionType, str], Any]
) -> SimpleNamespace:
    """Make copies of functions that know those before them, each with the other names of the file it is from."""
    filled = {} if parts is None else _of(parts)
    wanted = filled | {name: pair for name, pair in _of(module).items() if name not in filled}
    wanted = _called(wanted, module.COMPILED_TYPES)
    homes = dict.fromkeys(function.__module__ for function, _ in wanted.values())
    spaces = {home: dict(vars(sys.modules[home])) for home in homes}
    digest = hashlib.sha256()
    for names in spaces.values():
        constants = sorted(
            (name, value) for name, value in names.items() if isinstance(value, int | float | tuple)
        )
        digest.update(Path(str(names["__file__"])).read_bytes() + repr(constants).encode())
    made: dict[str, Any] = {}
    for name, (function, types) in wanted.items():
        copy = FunctionType(function.__code__, spaces[function.__module__], name, function.__defaults__)
        copy.__qualname__ = f"{name}_{digest.hexdigest()[:12]}"
        copy.__module__ = function.__module__
        made[name] = make(copy, types)
        for names in spaces.values():
            names[name] = made[name]
    return SimpleNamespace(**{name: made[name] for name, types in module.COMPILED_TYPES.items() if types})


def _of(module: ModuleType) -> dict[str, tuple[FunctionType, str]]:
    """Return the functions to compile, with the types they take: those of the modules in `KERNEL_PARTS` first."""
    wanted = {name: each for part in getattr(module, "KERNEL_PARTS", ()) for name, each in _of(part).items()}
    own = vars(module)
    return wanted | {name: (own[name], types) for name, types in module.COMPILED_TYPES.items() if name in own}


def _called(
    wanted: dict[str, tuple[FunctionType, str]], asked: Iterable[str]
) -> dict[str, tuple[FunctionType, str]]:
    """Leave out functions of other modules that none of those asked for calls."""
    called, waiting = set(asked), list(asked)
    while waiting:
        new = set(wanted[waiting.pop()][0].__code__.co_names) & wanted.keys() - called
        called |= new
        waiting += new
    return {name: each for name, each in wanted.items() if name in called}


@cache
def _numba() -> ModuleType | None:
    """Import Numba; None where it is missing, or not made for this NumPy."""
    try:
        return import_module("numba")
    except ImportError as error:
        reason = (
            "Numba is not installed, with which many frames take a third to a half of the time; "
            "install it: pip install 'posekit[fast]'"
            if isinstance(error, ModuleNotFoundError)
            else f"Numba cannot be used, the slower path is taken: {error}"
        )
        warnings.warn(reason, UserWarning, stacklevel=4)
        return None
