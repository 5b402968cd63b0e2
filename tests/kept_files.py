"""Documents that are kept beside tests, and what posekit says now."""

import contextlib
import importlib
import io
import json
import math
import sys
from pathlib import Path
from typing import Any
from unittest import mock


def run(*arguments: object) -> str:
    """Run a command, and return what it says on stderr."""
    main = importlib.import_module("posekit.cli").main
    error = io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["posekit", *map(str, arguments)]),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(error),
        contextlib.suppress(SystemExit),
    ):
        main()
    return error.getvalue()


def rounded(document: Any) -> Any:
    """Return a document with six digits a number."""
    if isinstance(document, dict):
        return {key: rounded(value) for key, value in document.items()}
    if isinstance(document, list):
        return [rounded(value) for value in document]
    return float(f"{document:.6g}") if isinstance(document, float) else document


def keep(path: Path, document: Any) -> None:
    """Write a document, on one line."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(rounded(document), separators=(",", ":")) + "\n", encoding="utf-8")


def differences(path: Path, found: Any) -> list[str]:
    """Name the places where a document is not as it is kept, numbers by more than another machine's rounding."""
    return _differences(json.loads(path.read_text(encoding="utf-8")), found, "")


def _differences(kept: Any, found: Any, where: str) -> list[str]:
    if isinstance(kept, dict) and isinstance(found, dict):
        names = [f"{where}: {sorted(set(kept) ^ set(found))}"] if set(kept) != set(found) else []
        both = [key for key in kept if key in found]
        return names + [
            each for key in both for each in _differences(kept[key], found[key], f"{where}.{key}")
        ]
    if isinstance(kept, list) and isinstance(found, list) and len(kept) == len(found):
        pairs = enumerate(zip(kept, found, strict=True))
        return [each for k, pair in pairs for each in _differences(*pair, f"{where}[{k}]")]
    if isinstance(kept, int | float) and isinstance(found, int | float):
        same = math.isclose(kept, found, rel_tol=1e-4, abs_tol=2e-6)
    else:
        same = bool(kept == found)
    return [] if same else [f"{where}: {kept!r} -> {found!r}"]
