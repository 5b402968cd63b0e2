"""Mistakes of the table: each is one line that says what is wrong, where, what is expected and what to do."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import posekit
from tests.cli.mistakes import MISTAKES, Mistake, lay_out

MOST_CHARACTERS = 520
"""Of a line: some name every format that there is."""
REMEDIES = ("expected", "--help", "did you mean", "Did you mean", "choose another", "see who", "requires")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, command: Callable[..., Any]) -> Iterator[Path]:
    """A folder with the samples, a result, a report, and files of other programs; the current one meanwhile."""
    made = tmp_path_factory.mktemp("made")
    recovery = posekit.recover(posekit.builtin_view("seq1"))
    recovery.save(made / "result.npz")
    posekit.write_postures(made / "postures.json", posekit.open(made / "result.npz", "postures"))
    assert command("validate", made / "postures.json", "-o", made / "report.json").code in (0, 1)
    work = tmp_path_factory.mktemp("work")
    lay_out(work, made / "result.npz", (made / "report.json").read_text(encoding="utf-8"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(work)
        yield work


def state(folder: Path) -> dict[str, int]:
    return {str(path): path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def test_there_are_sixty_and_each_is_another() -> None:
    assert len(MISTAKES) >= 60
    assert len({one.command for one in MISTAKES}) == len({one.what for one in MISTAKES}) == len(MISTAKES)
    assert all(one.says for one in MISTAKES)


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda one: one.what.replace(" ", "-"))
def test_a_mistake_is_one_line_with_a_remedy(
    folder: Path, command: Callable[..., Any], mistake: Mistake
) -> None:
    before = state(folder)
    outcome = command(*mistake.command.split())
    assert outcome.code == 2, outcome
    assert outcome.out == ""
    assert outcome.err.startswith("posekit: error: ") and outcome.err.count("\n") == 1
    assert outcome.err.endswith("\n") and outcome.err[:-1].isprintable()
    assert len(outcome.err) <= MOST_CHARACTERS
    assert [word for word in mistake.says if word not in outcome.err] == [], outcome.err
    assert any(word in outcome.err for word in REMEDIES), outcome.err
    assert state(folder) == before, "nothing is half written"


def test_the_page_has_them_all() -> None:
    page = (Path(__file__).parents[2] / "docs/reference/mistakes.md").read_text(encoding="utf-8")
    missing = [one.command for one in MISTAKES if f"\n{one.command}\n  " not in page]
    assert missing == [], "run: python docs/make_mistakes.py"
