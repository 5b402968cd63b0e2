"""A browser's process, and the pipe over which it is told what to do.

Chromium's DevTools protocol goes over two pipes (``--remote-debugging-pipe``): no port is opened, and when
this process is gone, however it ends, the browser sees its pipe closed and ends too. The browser has a
process group of its own, which is ended as a whole.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import select
import shutil
import signal
import tempfile
import time
import weakref
from pathlib import Path
from typing import Any

from posekit.errors import ViewerError
from posekit.viewer.browser.find_browser import BROWSER_REMEDY

Message = dict[str, Any]

BROWSER_FLAGS = (
    "--headless",
    "--remote-debugging-pipe",
    "--force-device-scale-factor=1",
    "--hide-scrollbars",
    "--mute-audio",
    "--no-first-run",
    "--no-default-browser-check",
    "--disable-background-networking",
    "--disable-breakpad",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-dev-shm-usage",
    "--disable-extensions",
    "--disable-sync",
    "--password-store=basic",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # whatever it would look up outside, it does not find
)
WEBGL_FLAGS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""WebGL by the processor: the rest of the page is then drawn through it too, at a third of the speed."""

NO_WEBGL_FLAGS = ("--disable-gpu",)
READ_FD, WRITE_FD = 3, 4
"""The descriptors at which Chromium expects its two pipes."""

LOG_CHATTER = (":ERROR:", ":WARNING:", ":INFO:", "DevTools")
CHUNK_BYTES = 1 << 20
EXIT_TIMEOUT_SECONDS = 3.0
"""Seconds that a browser is given to end by itself."""


class DevTools:
    """A running browser and the conversation with it.

    Parameters
    ----------
    program : str
        The browser.
    timeout : float
        Seconds that any answer may take; after them the browser is ended.
    webgl : bool
        Whether pages may draw with WebGL.
    """

    def __init__(self, program: str, *, timeout: float, webgl: bool = True) -> None:
        self.program, self.timeout = program, timeout
        self.folder = Path(tempfile.mkdtemp(prefix="posekit-browser-"))
        self._count = 0
        self._pending = b""
        self.events: list[Message] = []
        try:
            self.pid, self._write, self._read = _start(
                program, self.folder, WEBGL_FLAGS if webgl else NO_WEBGL_FLAGS
            )
        except OSError as error:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise ViewerError(f"{program}: cannot be started: {error.strerror}; {BROWSER_REMEDY}") from None
        self._end = weakref.finalize(self, _finish, self.pid, self._write, self._read, self.folder)

    def ask(self, method: str, session: str | None = None, **params: Any) -> Message:
        """Send a command and wait for its result.

        Raises
        ------
        ViewerError
            Where the browser refuses, crashes, or does not answer in time; in the last two cases it is ended.
        """
        self._count += 1
        message: Message = {"id": self._count, "method": method, "params": params}
        if session is not None:
            message["sessionId"] = session
        deadline = time.monotonic() + self.timeout
        self._send(json.dumps(message).encode() + b"\0", method, deadline)
        while True:
            answer = self._receive(method, deadline)
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise ViewerError(f"{self.program}: {method}: {answer['error'].get('message')}")
                result: Message = answer["result"]
                return result
            if answer.get("method") in ("Inspector.targetCrashed", "Target.targetCrashed"):
                raise self._gone(f"its page crashed during {method}")
            if "method" in answer:
                self.events.append(answer)

    def close(self) -> None:
        """End the browser and remove what it wrote."""
        if self._end.alive:
            with contextlib.suppress(ViewerError):
                self.timeout = min(self.timeout, EXIT_TIMEOUT_SECONDS)
                self.ask("Browser.close")
        self._end()

    def _send(self, data: bytes, method: str, deadline: float) -> None:
        if not self._end.alive:
            raise ViewerError(f"{self.program}: the browser was closed; open another")
        while data:
            if not _ready(self._write, select.POLLOUT, deadline):
                raise self._gone(f"it took nothing for {self.timeout:g} s during {method}")
            try:
                data = data[os.write(self._write, data[:CHUNK_BYTES]) :]
            except BlockingIOError:
                continue
            except BrokenPipeError:
                raise self._gone(f"it ended during {method}") from None

    def _receive(self, method: str, deadline: float) -> Message:
        pieces = [self._pending]
        while b"\0" not in pieces[-1]:
            if not _ready(self._read, select.POLLIN, deadline):
                raise self._gone(f"it gave no answer to {method} within {self.timeout:g} s")
            piece = os.read(self._read, CHUNK_BYTES)
            if not piece:
                raise self._gone(f"it ended during {method}")
            pieces.append(piece)
        text, self._pending = b"".join(pieces).split(b"\0", 1)
        message: Message = json.loads(text)
        return message

    def _gone(self, what: str) -> ViewerError:
        log = _last_line(self.folder / "log")
        self._end()
        said = f" (its last words: {log})" if log else ""
        return ViewerError(
            f"{self.program}: {what}{said}; it was ended; try again, draw smaller pictures or allow it more time, "
            "or use another browser"
        )


def _start(program: str, folder: Path, drawing: tuple[str, ...]) -> tuple[int, int, int]:
    """Start the browser in its own process group; return its id and our ends of the pipes."""
    flags = [*BROWSER_FLAGS, *drawing, f"--user-data-dir={folder / 'profile'}"]
    if os.geteuid() == 0:
        flags.append("--no-sandbox")  # Chromium refuses to run as root with it
    pipes = [_high(fd) for pair in (os.pipe(), os.pipe()) for fd in pair]
    their_read, our_write, our_read, their_write = pipes
    log = str(folder / "log")
    actions = [
        (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
        (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0),
        (os.POSIX_SPAWN_OPEN, 2, log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600),
        (os.POSIX_SPAWN_DUP2, their_read, READ_FD),
        (os.POSIX_SPAWN_DUP2, their_write, WRITE_FD),
    ]
    try:
        pid = os.posix_spawn(
            program, [program, *flags, "about:blank"], os.environ, file_actions=actions, setpgroup=0
        )
    except OSError:
        os.close(our_write)
        os.close(our_read)
        raise
    finally:
        os.close(their_read)
        os.close(their_write)
    os.set_blocking(our_write, False)
    return pid, our_write, our_read


def _high(fd: int) -> int:
    """Move a descriptor away from those that the browser's pipes shall have."""
    moved = fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, 10)
    os.close(fd)
    return moved


def _ready(fd: int, event: int, deadline: float) -> bool:
    """Wait until a pipe can be used, or closed at the other end; False where that takes too long."""
    waiting = select.poll()
    waiting.register(fd, event)
    return bool(waiting.poll(max(deadline - time.monotonic(), 0) * 1000))


def _finish(pid: int, write: int, read: int, folder: Path) -> None:
    """Let the browser end, or end it, with all processes of its group; wait for it; remove its folder."""
    for fd in (write, read):
        os.close(fd)
    deadline = time.monotonic() + EXIT_TIMEOUT_SECONDS
    ended = False
    while not ended and time.monotonic() < deadline:
        ended = os.waitpid(pid, os.WNOHANG)[0] == pid
        if not ended:
            time.sleep(0.01)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)
    if not ended:
        os.waitpid(pid, 0)
    shutil.rmtree(folder, ignore_errors=True)


def _last_line(path: Path) -> str:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError:
        return ""
    # Chromium always complains of a missing desktop; that says nothing of why it ended.
    said = [line.strip() for line in lines if line.strip() and not any(word in line for word in LOG_CHATTER)]
    return said[-1][-160:] if said else ""
