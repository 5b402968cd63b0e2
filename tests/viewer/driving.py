"""How the viewer's tests drive what they test: the command, and pages in a real browser."""

from __future__ import annotations

import sys
import time
from typing import Any

import pytest

from posekit.cli.main import main


def render(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    """Run `posekit render`, and return its exit code."""
    monkeypatch.setattr(sys, "argv", ["posekit", "render", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def wait_until(tab: Any, condition: str) -> None:
    """Poll from outside: the page's policy forbids it to evaluate text itself."""
    deadline = time.monotonic() + 10
    while not tab.evaluate(condition):
        assert time.monotonic() < deadline, condition
        tab.wait_for_timeout(20)
