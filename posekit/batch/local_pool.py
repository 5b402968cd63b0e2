"""Processes of this machine, an item each at a time: whose death is known to be that item's."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from multiprocessing import connection, get_context, parent_process
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Final, TypeVar

from posekit.batch.pool import Outcome, PoolReport, attempt
from posekit.errors import InputError

T = TypeVar("T")
R = TypeVar("R")
THREAD_VARIABLES: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""What libraries read when they are loaded: a process is one thread, and processes are as many as cores."""
MALLOC_VARIABLES: Final = {"MALLOC_MMAP_THRESHOLD_": "33554432", "MALLOC_TRIM_THRESHOLD_": "67108864"}
"""What glibc's malloc reads (mallopt(3)), bytes: arrays that come and go with every piece of a shard stay the process's
own, instead of being given back and asked of the system, page by page, again; at most so much is kept."""
MAX_FAILED_STARTS: Final = 5
"""Processes in a row that end before they are ready, after which none is started any more."""
READY_SIGNAL: Final = b"ready"


@dataclass(eq=False)
class _Worker:
    """A process, and what it is doing."""

    process: Any
    pipe: Connection
    ready: bool = False
    busy: bool = False
    work: Any = None
    item: Any = None
    attempts: int = 0


@dataclass(eq=False)
class LocalPool:
    """A pool of spawned processes.

    An item whose process dies is tried again after all others, alone: where memory was short, it then has all of it,
    and what dies with it is its own doing.

    Parameters
    ----------
    jobs : int
        Processes.
    retries : int
        How often an item is tried again whose process died.
    """

    jobs: int
    retries: int
    workers: list[_Worker] = field(default_factory=list)
    failed_starts: int = 0

    def __enter__(self) -> LocalPool:
        """Start nothing yet: processes start with the work."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End every process."""
        for worker in self.workers:
            worker.process.kill()
        for worker in self.workers:
            worker.process.join()
            worker.pipe.close()
        self.workers.clear()

    def run(self, work: Callable[[T], R], items: Iterable[T]) -> Iterator[Outcome[T, R]]:
        """Do the work; see `posekit.batch.pool.Pool`."""
        waiting = iter(items)
        suspects: deque[tuple[T, int]] = deque()
        more = True
        while True:
            while more and len(self._busy()) < self.jobs:
                taken = next(waiting, _END)
                if taken is _END:
                    more = False
                else:
                    self._give(work, taken, 0)
            if not self._busy():
                if not suspects:
                    return
                self._give(work, *suspects.popleft())
            for worker, report in self._reports():
                item, tries = worker.item, worker.attempts
                worker.busy = False
                if report is not None:
                    yield Outcome(
                        item=item,
                        value=report.value,
                        error=report.error,
                        attempts=tries,
                        fatal=report.fatal,
                        peak=report.peak,
                    )
                elif tries <= self.retries:
                    suspects.append((item, tries))
                else:
                    yield Outcome(
                        item=item, value=None, error=_end_of(worker.process), attempts=tries, died=True
                    )

    def _busy(self) -> list[_Worker]:
        return [worker for worker in self.workers if worker.busy]

    def _give(self, work: Callable[[T], R], item: T, tries: int) -> None:
        """Hand an item to a process that is idle, or to a new one; it is sent once the process is ready."""
        for idle in [one for one in self.workers if not one.busy and not one.process.is_alive()]:
            self._bury(idle)  # it died of nothing that it was given
        worker = next((one for one in self.workers if not one.busy), None)
        if worker is None:
            worker = self._started()
        worker.busy, worker.work, worker.item, worker.attempts = True, work, item, tries + 1
        if worker.ready:
            self._send(worker)

    def _send(self, worker: _Worker) -> None:
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # it died: its end is noticed below
            worker.pipe.send((worker.work, worker.item))

    def _reports(self) -> Iterator[tuple[_Worker, PoolReport | None]]:
        """Wait, and yield who is done with what; None where the process has died."""
        by_pipe = {worker.pipe: worker for worker in self.workers if worker.busy}
        for pipe in connection.wait(list(by_pipe)):
            worker = by_pipe[pipe]  # type: ignore[index]
            try:
                message = worker.pipe.recv()
            except (EOFError, OSError, pickle.UnpicklingError):
                yield from self._died(worker)
                continue
            if message == READY_SIGNAL:
                worker.ready, self.failed_starts = True, 0
                self._send(worker)
            else:
                yield worker, message

    def _died(self, worker: _Worker) -> Iterator[tuple[_Worker, None]]:
        """Take a process out; that one never began is nobody's fault, as long as others do."""
        self._bury(worker)
        if worker.ready:
            yield worker, None
            return
        self.failed_starts += 1
        if self.failed_starts >= MAX_FAILED_STARTS:
            raise InputError(
                f"--jobs: {MAX_FAILED_STARTS} processes in a row ended before they began "
                f"({_end_of(worker.process)}); expected "
                "memory for them, and `if __name__ == '__main__'` in a script; take fewer jobs"
            )
        fresh = self._started()
        fresh.busy, fresh.work, fresh.item, fresh.attempts = True, worker.work, worker.item, worker.attempts

    def _started(self) -> _Worker:
        """Start a process that is ended with this pool."""
        with _held_back(signal.SIGINT, signal.SIGTERM):
            worker = _start()
            self.workers.append(worker)
        return worker

    def _bury(self, worker: _Worker) -> None:
        worker.process.join()
        worker.pipe.close()
        self.workers.remove(worker)


_END: Any = object()


@contextlib.contextmanager
def _held_back(*numbers: signal.Signals) -> Iterator[None]:
    """Let signals wait for the end of the block: a process that was not told what it is for prints a traceback."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    kept = {number: signal.signal(number, lambda number, _: came.append(number)) for number in numbers}
    try:
        yield
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)
        for one in came:
            signal.raise_signal(one)


def _start() -> _Worker:
    """Start a process with one thread that Ctrl-C does not reach: whoever started it ends it."""
    context = get_context("spawn")  # a fork after OpenMP was used hangs the child
    ours, theirs = context.Pipe()
    process = context.Process(target=serve, args=(theirs,), daemon=True)
    # Libraries read these when they are loaded, which in the child is before any line of ours runs.
    kept = {name: os.environ.get(name) for name in (*THREAD_VARIABLES, *MALLOC_VARIABLES)}
    os.environ.update(
        {**MALLOC_VARIABLES, **{name: value for name, value in kept.items() if value is not None}}
    )
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    # The child inherits the mask: Ctrl-C cannot end it before `serve` ignores it.
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        for name, value in kept.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
    theirs.close()  # held open here, it would hide that the child has died
    return _Worker(process=process, pipe=ours)


def serve(pipe: Connection) -> None:
    """Work on what comes through the pipe until it is closed: the life of a process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_follow_parent, daemon=True).start()
    try:
        pipe.send(READY_SIGNAL)
        while True:
            work, item = pipe.recv()
            pipe.send(attempt(work, item))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


def _follow_parent() -> None:
    """End this process when the one that started it is gone, in whatever way."""
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)  # from a thread, sys.exit would end no more than the thread


def _end_of(process: Any) -> str:
    """Say how a process ended."""
    code = process.exitcode
    if code is not None and code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = "?"
        return f"its process was ended by signal {-code} ({name})"
    return f"its process ended by itself with code {code}"
