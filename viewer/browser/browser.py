"""A headless browser, started once and used for many pages."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any

from posekit.errors import ViewerError
from posekit.viewer.browser.devtools import DevTools
from posekit.viewer.browser.find_browser import find_browser

STEP_TIMEOUT_SECONDS = 60.0
"""Seconds that one step of the browser may take."""


class Browser:
    """A locally installed Chromium or Chrome without a window, and without an open port.

    Parameters
    ----------
    program : str, optional
        Its path; default see `posekit.viewer.browser.find_browser`.
    timeout : float
        Seconds that any step may take; after them the browser is ended.
    size : (int, int)
        Width and height of its pages, pixels.
    webgl : bool
        Whether pages may draw with WebGL, as those of pictures do; without, the rest is drawn faster.

    Raises
    ------
    ViewerError
        Where there is none, or it does not start.

    Notes
    -----
    A context manager: at the block's end the browser and all its processes are gone.
    """

    def __init__(
        self,
        program: str | None = None,
        *,
        timeout: float = STEP_TIMEOUT_SECONDS,
        size: tuple[int, int] = (1280, 720),
        webgl: bool = True,
    ) -> None:
        self.size = size
        self._tools = DevTools(program or find_browser(), timeout=timeout, webgl=webgl)
        try:
            self._session = self._attach()
        except BaseException:
            self._tools.close()
            raise

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def pid(self) -> int:
        """The id of the browser's process, which leads its process group."""
        return self._tools.pid

    def close(self) -> None:
        """End the browser; closing it again does nothing."""
        self._tools.close()

    def open(self, page: Path) -> None:
        """Load an HTML file and wait until it is loaded."""
        self._ask("Page.enable")
        self._tools.events.clear()
        address = page.resolve().as_uri()
        refused = self._ask("Page.navigate", url=address).get("errorText")
        if refused:
            raise ViewerError(f"{page}: the browser cannot open it: {refused}")
        self.evaluate(
            "new Promise(done => document.readyState === 'complete' ? done() : addEventListener('load', done))"
        )

    def evaluate(self, expression: str) -> Any:
        """Run JavaScript in the page and return its value; a promise is waited for.

        Raises
        ------
        ViewerError
            With the page's own error, where it throws one.
        """
        answer = self._ask("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            text = details.get("exception", {}).get("description") or details.get("text", "")
            raise ViewerError(f"the page failed: {text.splitlines()[0] if text else 'no reason given'}")
        return answer["result"].get("value")

    def requests(self) -> list[str]:
        """Return the addresses that the page asked for since `open`."""
        return [
            event["params"]["request"]["url"]
            for event in self._tools.events
            if event["method"] == "Network.requestWillBeSent"
        ]

    def _attach(self) -> str:
        targets = self._tools.ask("Target.getTargets")["targetInfos"]
        page = next((target["targetId"] for target in targets if target["type"] == "page"), None)
        if page is None:
            page = self._tools.ask("Target.createTarget", url="about:blank")["targetId"]
        session: str = self._tools.ask("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        width, height = self.size
        self._tools.ask("Network.enable", session)
        self._tools.ask(
            "Emulation.setDeviceMetricsOverride",
            session,
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        return session

    def _ask(self, method: str, **params: Any) -> dict[str, Any]:
        return self._tools.ask(method, self._session, **params)
