"""Signals that end a command: each is an exception, on whose way out half-written files are taken away.

An exception is lost in a destructor, which none leaves, and in an import, where packages of others take every exception
for a package that is missing. A signal that comes there is sent once more, a little later.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import Final, Never

from posekit.cli.terminal import TERMINATED_CODE, Ended

SECONDS_UNTIL_SENT_AGAIN: Final = 0.02
IMPORTING_FILE: Final = "<frozen importlib._bootstrap>"
"""Where the frames of an import come from."""


def take_signals() -> None:
    """Let SIGTERM and SIGINT, also those held back until now, end this process by an exception.

    A SIGINT that is ignored stays ignored.
    """
    came: list[int] = []
    on_signal = partial(_on_signal, os.getpid(), came)
    signal.signal(signal.SIGTERM, on_signal)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, on_signal)
    sys.unraisablehook = partial(_on_lost, on_signal, came)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))


def _on_signal(owner: int, came: list[int], number: int, frame: FrameType | None) -> None:
    if os.getpid() != owner:
        _end_as_usual(number)
    while frame is not None:
        if frame.f_code.co_filename == IMPORTING_FILE:
            _send_again(number)
            return
        frame = frame.f_back
    came.append(number)
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    signal.signal(number, signal.SIG_DFL)
    raise Ended("ended from outside", TERMINATED_CODE)


def _end_as_usual(number: int) -> Never:
    """End a child process as it would have ended without this."""
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)
    raise SystemExit(128 + number)


def _on_lost(
    on_signal: Callable[[int, FrameType | None], None], came: list[int], lost: sys.UnraisableHookArgs
) -> None:
    """Look at an exception that came where none is passed on.

    Once a signal came, objects that it found half made may not be taken down well: nobody needs to know.
    """
    if isinstance(lost.exc_value, KeyboardInterrupt):
        _send_again(signal.SIGINT)
    elif isinstance(lost.exc_value, Ended):
        signal.signal(signal.SIGTERM, on_signal)
        _send_again(signal.SIGTERM)
    elif not came:
        sys.__unraisablehook__(lost)


def _send_again(number: int) -> None:
    later = threading.Timer(SECONDS_UNTIL_SENT_AGAIN, os.kill, (os.getpid(), number))
    later.daemon = True
    later.start()
