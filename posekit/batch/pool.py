"""Work on many items in processes that may die: what a pool promises, and what comes back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Generic, Protocol, TypeVar

from posekit.batch.durable import OutputError
from posekit.errors import PosekitError
from posekit.safe_io import cut, one_line

T = TypeVar("T")
R = TypeVar("R")
MAX_ERROR_CHARACTERS = 500
"""Characters of an error that are kept."""


@dataclass(frozen=True, kw_only=True)
class PoolReport:
    """What a piece of work ended with.

    Parameters
    ----------
    value : object
        What it returned; None where it failed.
    error : str
        One line; empty where it did not fail.
    fatal : bool
        Whether nothing else can be written either.
    peak : int
        The most memory that the process has taken so far, bytes.
    """

    value: Any = None
    error: str = ""
    fatal: bool = False
    peak: int = 0


@dataclass(frozen=True, kw_only=True)
class Outcome(Generic[T, R]):
    """What became of an item.

    Parameters
    ----------
    item : T
        What was worked on.
    value : R or None
        None where it failed.
    error : str
        One line; empty where it did not fail.
    attempts : int
        How often it was begun.
    died : bool
        Whether a process died of it each time.
    fatal : bool
        Whether nothing else can be written either.
    peak : int
        The most memory of the process, bytes; 0 where that is not known.
    """

    item: T
    value: R | None
    error: str = ""
    attempts: int = 1
    died: bool = False
    fatal: bool = False
    peak: int = 0


class Pool(Protocol):
    """Processes."""

    def run(self, work: Callable[[T], R], items: Iterable[T]) -> Iterator[Outcome[T, R]]:
        """Do the work on every item, each at least once, and yield what became of it in any order.

        Items are taken only as they are needed: few are in flight. `work` is a module's function, and is safe to do
        twice.
        """
        ...

    def __enter__(self) -> Pool:
        """Start."""
        ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End every process, also in the middle of its work."""
        ...


def attempt(work: Callable[[T], R], item: T) -> PoolReport:
    """Do a piece of work and say what came of it: no error may end the process that others wait for."""
    try:
        return PoolReport(value=work(item), peak=peak_memory())
    except OutputError as error:
        return PoolReport(error=str(error), fatal=True, peak=peak_memory())
    except PosekitError as error:
        return PoolReport(error=one_line(str(error))[:MAX_ERROR_CHARACTERS], peak=peak_memory())
    except Exception as error:  # a defect, or too little memory: of this item, not of the run
        what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        return PoolReport(error=one_line(f"unexpected {what}")[:MAX_ERROR_CHARACTERS], peak=peak_memory())


def peak_memory() -> int:
    """Return the most memory that this process has taken, bytes; 0 where the system does not say."""
    try:
        import resource
    except ImportError:  # not POSIX
        return 0
    import sys

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def short(text: str) -> str:
    """Shorten an error of another library to a line."""
    return cut(one_line(text.strip().partition("\n")[0]))
