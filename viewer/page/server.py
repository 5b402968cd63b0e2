"""Serve one page, and a page of each of its frames where that is asked for, to this machine alone."""

from __future__ import annotations

import re
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock
from typing import Any, Final

from posekit.errors import PosekitError, ViewerError

LOCAL_HOST: Final = "127.0.0.1"
FRAME_PATH: Final = re.compile(r"/frame/([0-9]{1,9})")
IDLE_TIMEOUT_SECONDS: Final = 10.0
"""Seconds that a connection may be idle."""


class PageServer(ThreadingHTTPServer):
    """Serve one page at ``http://127.0.0.1:PORT/``, and nothing else but its frames, to nobody else.

    Parameters
    ----------
    page : str
        HTML.
    port : int
        0 lets the system choose a free one.
    of_frame : callable, optional
        Makes the page of one frame, by its number, that is served at ``/frame/NUMBER``.

    Raises
    ------
    ViewerError
        Where the port is taken or not allowed.

    Examples
    --------
    >>> with PageServer("<p>Hello</p>") as server:
    ...     server.url.startswith("http://127.0.0.1:")
    True
    """

    daemon_threads = True
    # Rebinding while an old connection lingers is fine; a second server on the same port is not.
    allow_reuse_address = True
    allow_reuse_port = False

    def __init__(self, page: str, port: int = 0, of_frame: Callable[[int], str] | None = None) -> None:
        self.page = page.encode("utf-8")
        self._of_frame = of_frame
        self._making = Lock()
        try:
            super().__init__((LOCAL_HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise ViewerError(
                f"port {port} of {LOCAL_HOST}: {reason}; expected a free port; give another one, or none"
            ) from error

    @property
    def url(self) -> str:
        """The page's address."""
        return f"http://{LOCAL_HOST}:{self.server_port}/"

    @property
    def hosts(self) -> tuple[str, str]:
        """The names by which a browser on this machine asks."""
        return f"{LOCAL_HOST}:{self.server_port}", f"localhost:{self.server_port}"

    def content(self, path: str) -> bytes | None:
        """Return the page at a path; None where there is none."""
        if path == "/":
            return self.page
        asked = FRAME_PATH.fullmatch(path)
        if asked is None or self._of_frame is None:
            return None
        try:
            with self._making:  # one at a time: a page takes a second and some memory
                return self._of_frame(int(asked[1])).encode("utf-8")
        except PosekitError:
            return None

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing when a browser hangs up."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    server_version = "posekit"
    sys_version = ""
    timeout = IDLE_TIMEOUT_SECONDS

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def _answer(self, *, with_body: bool) -> None:
        # A page of somebody else's could point its own host name at 127.0.0.1 and read along.
        if self.headers.get("Host") not in self.server.hosts:
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        page = self.server.content(self.path)
        if page is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(page)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.end_headers()
        if with_body:
            self.wfile.write(page)

    def log_message(self, format: str, *args: Any) -> None:
        """Keep the terminal quiet."""
