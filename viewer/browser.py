"""Control an installed Chromium or Chrome without a window, through two pipes.

Messages of Chromium's DevTools protocol pass through pipes (``--remote-debugging-pipe``), so no network port is opened.
If this process ends, the pipes close and the browser ends too.
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
from typing import Any, Final, Self

from posekit.errors import ViewerError

VARIABLE: Final = "POSEKIT_BROWSER"
NAMES: Final = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("chrome-headless-shell", "microsoft-edge"),
)
REMEDY: Final = (
    f"install one (Debian, Ubuntu: apt-get install chromium) or name its program in {VARIABLE}; "
    "pages (.html) and plots need none"
)
# The host resolver rule blocks all network access of the page. SwiftShader renders WebGL without a graphics card.
FLAGS: Final = """
--headless --remote-debugging-pipe --force-device-scale-factor=1 --hide-scrollbars --mute-audio
--no-first-run --no-default-browser-check --disable-background-networking --disable-breakpad
--disable-component-update --disable-default-apps --disable-dev-shm-usage --disable-extensions
--disable-sync --password-store=basic --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader
""".split()
#: File descriptors at which Chromium expects its two pipes.
READ_FD, WRITE_FD = 3, 4

CHUNK: Final = 1 << 20
#: Waiting time for the browser to end without a signal, seconds.
EXIT_SECONDS: Final = 3.0


def find_browser() -> str:
    """Return the path of the browser: ``POSEKIT_BROWSER`` if set, otherwise the first of `NAMES` on PATH.

    Raises
    ------
    ViewerError
        If no browser is found, or if the variable names a file that does not exist.
    """
    named = os.environ.get(VARIABLE)
    names = [named] if named else NAMES
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        raise ViewerError(
            f"browser: got none of {', '.join(names)} on PATH; expected one to draw with; {REMEDY}"
        )
    return found


class Browser:
    """A browser with one page. As a context manager, it stops all browser processes on exit.

    Parameters
    ----------
    size : (int, int)
        Width and height of the page, pixels.
    timeout : float
        Largest duration of one step, seconds; after this time the browser is stopped.

    Raises
    ------
    ViewerError
        If no browser is found, or if the browser does not start.
    """

    def __init__(self, *, size: tuple[int, int] = (1280, 720), timeout: float = 60.0) -> None:
        self.program, self.timeout = find_browser(), timeout
        self.requests: list[str] = []
        self._folder = Path(tempfile.mkdtemp(prefix="posekit-browser-"))
        self._count, self._pending = 0, b""
        try:
            self.pid, self._write, self._read = _start(self.program, self._folder)
        except OSError as error:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise ViewerError(
                f"{self.program}: got {error.strerror}; expected a browser that starts; {REMEDY}"
            ) from None
        self._end = weakref.finalize(self, _finish, self.pid, self._write, self._read, self._folder)
        self._session: str | None = None
        try:
            targets = self._ask("Target.getTargets")["targetInfos"]
            page = next(one["targetId"] for one in targets if one["type"] == "page")
            self._session = self._ask("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
            self._ask("Network.enable")
            self._ask("Page.enable")
            self.resize(size)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the browser and remove its files. A second call does nothing."""
        if self._end.alive:
            self._session = None
            with contextlib.suppress(ViewerError):
                self.timeout = min(self.timeout, EXIT_SECONDS)
                self._ask("Browser.close")
        self._end()

    def resize(self, size: tuple[int, int]) -> None:
        """Set the size of the page, pixels."""
        width, height = size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", **metrics)

    def open(self, page: Path) -> None:
        """Load an HTML file and wait until loading is complete."""
        self.requests.clear()
        refused = self._ask("Page.navigate", url=page.resolve().as_uri()).get("errorText")
        if refused:
            raise ViewerError(f"{page}: got {refused}; expected a page that opens; write it again")
        self.evaluate(
            "new Promise(f => document.readyState === 'complete' ? f() : addEventListener('load', () => f()))"
        )

    def evaluate(self, expression: str) -> Any:
        """Run JavaScript in the page and return its value, or the result of its promise.

        Raises
        ------
        ViewerError
            If the script throws an error; the message is the script's.
        """
        answer = self._ask("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            text = details.get("exception", {}).get("description") or details.get("text", "") or "no reason"
            raise ViewerError(f"the page failed: {text.splitlines()[0]}")
        return answer["result"].get("value")

    def screenshot(self) -> bytes:
        """Return a picture of the page as PNG."""
        import base64

        return base64.b64decode(self._ask("Page.captureScreenshot", format="png")["data"])

    def _ask(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command and wait for its result; record the network requests of the page that arrive before it."""
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": params}
        if self._session is not None:
            message["sessionId"] = self._session
        deadline = time.monotonic() + self.timeout
        self._send(json.dumps(message).encode() + b"\0", method, deadline)
        while True:
            answer = self._receive(method, deadline)
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise ViewerError(f"{self.program}: {method}: {answer['error'].get('message')}")
                result: dict[str, Any] = answer["result"]
                return result
            if answer.get("method") in ("Inspector.targetCrashed", "Target.targetCrashed"):
                raise self._gone(f"its page crashed during {method}")
            if answer.get("method") == "Network.requestWillBeSent":
                self.requests.append(answer["params"]["request"]["url"])

    def _send(self, data: bytes, method: str, deadline: float) -> None:
        if not self._end.alive:
            raise ViewerError(f"{self.program}: the browser was closed; open another")
        while data:
            if not _ready(self._write, select.POLLOUT, deadline):
                raise self._gone(f"it accepted nothing for {self.timeout:g} s during {method}")
            try:
                data = data[os.write(self._write, data[:CHUNK]) :]
            except BlockingIOError:
                continue
            except BrokenPipeError:
                raise self._gone(f"it ended during {method}") from None

    def _receive(self, method: str, deadline: float) -> dict[str, Any]:
        pieces = [self._pending]
        while b"\0" not in pieces[-1]:
            if not _ready(self._read, select.POLLIN, deadline):
                raise self._gone(f"it gave no answer to {method} within {self.timeout:g} s")
            piece = os.read(self._read, CHUNK)
            if not piece:
                raise self._gone(f"it ended during {method}")
            pieces.append(piece)
        text, self._pending = b"".join(pieces).split(b"\0", 1)
        message: dict[str, Any] = json.loads(text)
        return message

    def _gone(self, what: str) -> ViewerError:
        self._end()
        return ViewerError(
            f"{self.program}: {what}; it was ended; draw smaller pictures or use another browser"
        )


def _start(program: str, folder: Path) -> tuple[int, int, int]:
    """Start the browser in its own process group; return the process id and our file descriptors of the pipes."""
    flags = [*FLAGS, "--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={folder / 'profile'}"]
    if os.geteuid() == 0:
        flags.append("--no-sandbox")  # Chromium refuses to run as root with it
    their_read, our_write, our_read, their_write = (
        _high(fd) for pair in (os.pipe(), os.pipe()) for fd in pair
    )
    actions = [
        (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
        (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0),
        (os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0),
        (os.POSIX_SPAWN_DUP2, their_read, READ_FD),
        (os.POSIX_SPAWN_DUP2, their_write, WRITE_FD),
    ]
    try:
        command = [program, *flags, "about:blank"]
        pid = os.posix_spawn(program, command, os.environ, file_actions=actions, setpgroup=0)
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
    """Move a file descriptor to a number that the browser's pipes do not use."""
    moved = fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, 10)
    os.close(fd)
    return moved


def _ready(fd: int, event: int, deadline: float) -> bool:
    """Wait until a pipe is ready or closed by the browser; return False after the deadline."""
    waiting = select.poll()
    waiting.register(fd, event)
    return bool(waiting.poll(max(deadline - time.monotonic(), 0) * 1000))


def _finish(pid: int, write: int, read: int, folder: Path) -> None:
    """Wait until the browser ends, or stop its process group; then remove its folder."""
    for fd in (write, read):
        os.close(fd)
    deadline = time.monotonic() + EXIT_SECONDS
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
