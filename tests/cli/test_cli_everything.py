"""Every kind of result goes to every command and format, or is refused in one line with its reason."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.cli import everything

PAGE = Path(__file__).parents[2] / "docs/reference/everything.md"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory, command: Callable[..., Any]) -> dict[str, Path]:
    """Recover one result of each kind."""
    return everything.make_results(tmp_path_factory.mktemp("results"), command)


@pytest.fixture(scope="module")
def cells(
    results: dict[str, Path], tmp_path_factory: pytest.TempPathFactory, command: Callable[..., Any]
) -> dict[str, dict[str, Any]]:
    """Give each to each command, and convert it to each format."""
    folder = tmp_path_factory.mktemp("written")
    return {
        kind: {column: everything.attempt(command, path, column, folder) for column in everything.columns()}
        for kind, path in results.items()
    }


def test_a_person_is_refused_by_nothing_but_evaluation(cells: dict[str, dict[str, Any]]) -> None:
    refused = {
        (kind, column)
        for kind, of_kind in cells.items()
        for column, done in of_kind.items()
        if done.code not in (0, 1)
    }
    people = {(kind, column) for kind, column in refused if not kind.startswith("an object")}
    assert {column for _, column in people} == {"evaluate"}


def test_a_refusal_is_one_line_that_says_what_is_expected(cells: dict[str, dict[str, Any]]) -> None:
    for kind, of_kind in cells.items():
        for column, done in of_kind.items():
            if done.code not in (0, 1):
                assert done.code == 2, (kind, column, done)
                assert done.err.count("\n") == 1 and "; expected " in done.err, (kind, column, done.err)


def test_the_page_says_what_happens(cells: dict[str, dict[str, Any]], results: dict[str, Path]) -> None:
    assert PAGE.read_text(encoding="utf-8") == everything.page(cells, results)
