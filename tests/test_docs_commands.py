"""Every command and every Python block of README and docs does what it says, in a folder that has the samples."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from posekit.samples import write_samples

ROOT = Path(__file__).parents[1]
DOC_FOLDERS = ("tutorials", "how-to", "explanation", "reference", "formats", "research")
DOC_PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *(page for folder in DOC_FOLDERS for page in sorted((ROOT / "docs" / folder).glob("*.md"))),
]
PAGE_NAMES = [str(page.relative_to(ROOT)) for page in DOC_PAGES]

NOT_RUN = {
    r"make ": "sets up the environment that this runs in: .ci/run runs demo, test and docs",
    r"(pip|uvx|\.venv/bin/|\. \.venv|git clone|cd )": "installs: benchmarks/newcomer.py does",
    r"python (-m )?benchmarks": "measures, by recordings that are not posekit's to ship",
    r"detector \|": "a camera and a detector write into it",
    r"posekit view ": "serves until somebody stops it",
    r"posekit demo ": "tests/cli runs it",
    r"posekit batch .*--cluster": "a cluster",
    r"posekit render (?!.*(over\.png|--angles)).*(\.(png|gif|mp4)\b|--over)": "a browser draws it: one does here",
}
"""Commands that are shown and not run here, with the reason."""

NOT_SHIPPED = {
    "archive": "an archive of millions of frames",
    "lamp.toml": "a linkage of one's own",
    "my_robot.urdf": "a robot of one's own",
}
"""Files of one's own, beside those of other programs on the pages of formats: a command that reads one must fail by
naming it, so that its options are known to be right."""

FRAGMENT_PAGES = {
    "docs/how-to/live.md": "pictures come from a camera",
    "docs/how-to/own-check.md": "its check is the one of examples/own_check.py, which runs",
    "docs/explanation/occlusion.md": "leaves, camera and checks of a tree of one's own",
    "docs/explanation/placement.md": "a camera and image of one's own",
    "docs/formats/csv.md": "pandas is another package",
    "docs/formats/glb.md": "configurations of one's own",
}
"""Pages whose Python is a fragment, with what it lacks: it is compiled alone."""


class Block(NamedTuple):
    """A fenced block: its language and text."""

    language: str
    text: str


class Ran(NamedTuple):
    """What commands have printed in a folder, by command."""

    folder: Path
    said: dict[str, str]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    folder = tmp_path_factory.mktemp("docs")
    write_samples(folder / "samples")
    return Ran(folder, {})


def blocks(page: Path) -> Iterator[Block]:
    for language, text in re.findall(r"^```(\w+)\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S):
        yield Block(language, text)


def commands(text: str) -> Iterator[str]:
    for line in text.replace("\\\n", " ").splitlines():
        found = re.sub(r"\s+#\s.*$", "", line).strip()
        if found and not found.startswith("#"):
            yield found


def shown_and_not_run(line: str) -> bool:
    return any(re.match(pattern, line) for pattern in NOT_RUN)


@pytest.mark.parametrize("page", DOC_PAGES, ids=PAGE_NAMES)
def test_what_is_shown_runs(
    page: Path, ran: Ran, tmp_path: Path, command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    if page.parent.name == "formats":  # what other pages have written is none of their files
        (tmp_path / "samples").symlink_to(ran.folder / "samples")
        ran = Ran(tmp_path, {})
    monkeypatch.chdir(ran.folder)
    name = str(page.relative_to(ROOT))
    names: dict[str, Any] = {"__name__": "docs"}
    printed = ""
    for block in blocks(page):
        if block.language == "sh":
            for line in commands(block.text):
                if not shown_and_not_run(line):
                    if line not in ran.said:
                        ran.said[line] = run(line, name, command)
                    printed += ran.said[line]
        elif block.language == "python":
            code = compile(block.text, name, "exec")
            if name not in FRAGMENT_PAGES:
                out = io.StringIO()
                with contextlib.redirect_stdout(out):
                    exec(code, names)
                printed += out.getvalue()
        elif block.language == "text" and name.startswith("docs/tutorials/"):
            for line in block.text.splitlines():
                assert is_said(line, printed), f"{name} shows what is not said: {line}"


def is_said(line: str, printed: str) -> bool:
    """Tell whether a line was printed: numbers to 2 %, as sets under noise end a body earlier on another processor."""
    words = r"\d[\d.]*".join(re.escape(part) for part in re.split(r"\d[\d.]*", line))
    wanted = [float(number.rstrip(".")) for number in re.findall(r"\d[\d.]*", line)]
    return line in printed or any(
        [float(number.rstrip(".")) for number in re.findall(r"\d[\d.]*", said)]
        == pytest.approx(wanted, rel=0.02)
        for said in re.findall(words, printed)
    )


def test_lines_are_said_by_their_words_and_numbers() -> None:
    said = "person 0:\n197 postures in 12 frames, 44 % sure\n"
    assert is_said("196 postures in 12 frames", said)
    assert not is_said("190 postures in 12 frames", said)
    assert not is_said("197 bodies in 12 frames", said)


def run(line: str, name: str, command: Callable[..., Any]) -> str:
    program, *arguments = shlex.split(line)
    if program == "python":
        path = ROOT / arguments[0]
        assert path.is_file(), f"{name}: {line}"
        return ""
    assert program == "posekit", f"{name}: {line}: run it, or say in NOT_RUN why not"
    done = command(*arguments)
    absent = re.search(r"got (no such file|no file of such a name)", done.err, re.IGNORECASE)
    if name.startswith("docs/formats/") or any(word.strip("/") in NOT_SHIPPED for word in arguments):
        if absent:
            assert done.code == 2
            return ""
    allowed = (0, 1) if arguments[0] == "validate" else (0,)
    assert done.code in allowed, f"{name}: {line}: {done.err}"
    return str(done.out)


def test_every_reason_is_needed() -> None:
    lines = [
        line
        for page in DOC_PAGES
        for block in blocks(page)
        if block.language == "sh"
        for line in commands(block.text)
    ]
    assert [pattern for pattern in NOT_RUN if not any(re.match(pattern, line) for line in lines)] == []
    words = {word.strip("/") for line in lines for word in line.split()}
    assert set(NOT_SHIPPED) <= words
    assert set(FRAGMENT_PAGES) <= set(PAGE_NAMES)
