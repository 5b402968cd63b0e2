"""What the tests of the command line share: a folder of its own for each, a view, and the shape of a refusal."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def run(command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Any]:
    """Return a way to run the command line in this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return command


@pytest.fixture(scope="session")
def walk(command: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the document of a view of the walker, two frames."""
    path = tmp_path_factory.mktemp("walk") / "walk.json"
    finished = command("synth", "walker", "-o", path, "--frames", 2, "--velocity", 0.7, "--phase", 0.11)
    assert finished.code == 0, finished.err
    return json.loads(path.read_text(encoding="utf-8"))  # type: ignore[no-any-return]


@pytest.fixture(scope="session")
def write() -> Callable[..., str]:
    """Return a way to write a document, or text as it is, to a file of the folder: its path."""

    def write(document: Any, path: str = "view.json") -> str:
        Path(path).write_text(
            document if isinstance(document, str) else json.dumps(document), encoding="utf-8"
        )
        return path

    return write


@pytest.fixture(scope="session")
def files_here() -> Callable[[], list[str]]:
    """Return a way to list what is in the folder."""

    def files_here() -> list[str]:
        return sorted(str(path) for path in Path().rglob("*"))

    return files_here


@pytest.fixture(scope="session")
def assert_refused() -> Callable[..., None]:
    """Return a check of the one line: its prefix, what it tells, and that there is nothing else."""

    def assert_refused(outcome: Any, *parts: str) -> None:
        assert outcome.code == 2, outcome
        assert outcome.out == ""
        assert outcome.err.startswith("posekit: error: ")
        assert outcome.err.endswith("\n")
        assert outcome.err.count("\n") == 1
        assert outcome.err[:-1].isprintable()
        for part in parts:
            assert part in outcome.err

    return assert_refused
