"""Write docs/reference/everything.md: every kind of result given to every command and format.

python docs/make_everything.py
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

ROOT = Path(__file__).parents[1]


def run(*arguments: object) -> SimpleNamespace:
    """Run the command: its exit code, and what it printed."""
    from posekit.cli import main

    out, err = io.StringIO(), io.StringIO()
    code: object = 0
    with (
        mock.patch.object(sys, "argv", ["posekit", *map(str, arguments)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as ended:
            code = ended.code
    return SimpleNamespace(code=code, out=out.getvalue(), err=err.getvalue())


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    from tests.cli import everything

    with tempfile.TemporaryDirectory() as made, tempfile.TemporaryDirectory() as written:
        results = everything.make_results(Path(made), run)
        cells = {
            kind: {
                column: everything.attempt(run, path, column, Path(written))
                for column in everything.columns()
            }
            for kind, path in results.items()
        }
        page = everything.page(cells, results)
    (ROOT / "docs/reference/everything.md").write_text(page, encoding="utf-8")
