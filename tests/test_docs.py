"""The documentation runs: commands, Python blocks, examples; its tables are current and its links lead somewhere."""

from __future__ import annotations

import contextlib
import doctest
import importlib
import inspect
import io
import json
import os
import pkgutil
import re
import runpy
import shlex
import shutil
import signal
import sys
import tomllib
import warnings
from pathlib import Path

import click
import pytest

import posekit
from posekit.cli.main import COMMANDS, main
from posekit.samples import samples

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(path for path in DOCS.rglob("*.md") if "_" not in path.parent.name[:1])]
NAMED = {path.relative_to(ROOT).as_posix(): path for path in PAGES}
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

ELSEWHERE = (
    *("pip ", "apt-get ", "make ", "git ", ". .venv", "detector "),  # other programs
    *(
        "dataset/",
        "archive/",
        "my_robot.urdf",
        "results.json",
        "--cluster",
    ),  # the reader's own files and machines
)
"""Commands with one of these are not run."""

HEAVY = (".png", ".gif", ".mp4", "posekit demo", "posekit reproduce", "posekit evaluate samples")
"""Commands with one of these take more than five seconds, or need a browser; `POSEKIT_ALL_DOCS=1` runs them, too."""

ARGUMENTS = {"live_camera.py": ["--keypoints", "samples/keypoints"]}
"""Arguments of examples."""

NEEDS_MORE = ("viser_viewer.py",)
"""Examples that need a package of their own: they are compiled only."""

READ = {"json": json.loads, "toml": tomllib.loads}
"""Languages whose blocks must be well formed."""


def blocks(page: Path) -> list[tuple[str, str]]:
    """Return the language and the text of each fenced block."""
    return re.findall(r"^```(\w*)\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.S | re.M)


def call(line: str) -> tuple[int, str]:
    """Run a command in this process; return its exit code and what it prints."""
    out, handler, show = io.StringIO(), signal.getsignal(signal.SIGTERM), warnings.showwarning
    arguments = sys.argv
    sys.argv = shlex.split(line, comments=True)
    try:
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(out),
            pytest.raises(SystemExit) as ended,
        ):
            main()
    finally:
        sys.argv, warnings.showwarning = arguments, show
        signal.signal(signal.SIGTERM, handler)
    return int(ended.value.code or 0), out.getvalue()


def words(text: str) -> str:
    """Return a text with a 0 for every number and one blank between words: numbers may move, words may not."""
    return " ".join(re.sub(r"[-\u2212]?\b\d[\d.,e]*", "0", text).split())


@pytest.fixture(scope="module")
def sample_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("docs") / "samples"
    samples(folder)
    return folder


@pytest.fixture
def desk(tmp_path: Path, sample_files: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with the samples, and the examples' checks."""
    shutil.copytree(sample_files, tmp_path / "samples")
    shutil.copy(ROOT / "examples" / "own_check.py", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def runs(line: str) -> bool:
    skipped = ELSEWHERE if os.environ.get("POSEKIT_ALL_DOCS") else (*ELSEWHERE, *HEAVY)
    return line.startswith("posekit ") and not any(part in line for part in skipped)


@pytest.mark.parametrize("name", [name for name, page in NAMED.items() if blocks(page)])
def test_blocks_run_and_print_what_the_page_shows(name: str, desk: Path) -> None:
    printed, space = "", {"__name__": "page"}
    for language, text in blocks(NAMED[name]):
        if language == "sh":
            printed = ""
            for line in filter(runs, text.splitlines()):
                if line.startswith("posekit samples"):
                    shutil.rmtree(desk / "samples", ignore_errors=True)
                code, out = call(line)
                assert code in ((0, 1) if "validate" in line else (0,)), f"{line}\n{out}"
                printed += out
        elif language == "python":
            shown = io.StringIO()
            with contextlib.redirect_stdout(shown):
                exec(compile(text, name, "exec"), space)
            printed = shown.getvalue()
        elif language in READ:
            READ[language](text)
        elif language == "text" and printed:
            for line in text.splitlines():
                assert words(line) in words(printed), f"{name}: {line}\nis not among\n{printed}"


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
def test_examples_run(example: Path, desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if example.name in NEEDS_MORE:
        compile(example.read_text(encoding="utf-8"), example.name, "exec")
        return
    monkeypatch.setattr(sys, "argv", [example.name, *ARGUMENTS.get(example.name, ())])
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        runpy.run_path(str(example), run_name="__main__")
    assert printed.getvalue().strip()


def test_tables_are_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    tables = importlib.import_module("tables")
    made = {name: tables.with_tables(page.read_text(encoding="utf-8")) for name, page in NAMED.items()}
    stale = [name for name, page in NAMED.items() if made[name] != page.read_text(encoding="utf-8")]
    assert not stale, "run: python docs/tables.py"
    assert sum(text.count("<!-- table:") for text in made.values()) >= 4


def anchors(page: Path) -> set[str]:
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("name", NAMED)
def test_links_lead_somewhere(name: str) -> None:
    page = NAMED[name]
    text = re.sub(r"^```(?!\{).*?^```$", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith("http"):
            continue
        path, _, anchor = target.partition("#")
        aim = (page.parent / path).resolve() if path else page
        assert aim.exists(), target
        assert not anchor or anchor in anchors(aim), target
    for listed in re.findall(
        r"^```\{toctree\}\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.S | re.M
    ):
        for entry in filter(None, listed.splitlines()):
            assert entry.startswith(":") or (page.parent / f"{entry}.md").exists(), entry


def test_the_layout_page_names_files_and_functions_that_exist() -> None:
    text = (DOCS / "reference" / "layout.md").read_text(encoding="utf-8")
    places = set(re.findall(r"`([\w/]+\.(?:py|toml))`", text))
    assert all(any((top / place).exists() for top in (ROOT / "posekit", ROOT)) for place in places), places
    steps = re.findall(r"^\| \d\. [^|]+ \| ([^|]+) \| ([^|]+) \|$", text, flags=re.M)
    assert len(steps) == 8
    for functions, files in steps:
        code = "".join((ROOT / "posekit" / name).read_text() for name in re.findall(r"`([\w/.]+)`", files))
        for function in re.findall(r"`(?:\w+\.)?(\w+)`", functions):
            assert re.search(rf"def {function}\b", code), function


def options() -> set[str]:
    """Return every option of every command."""
    found, waiting = {"--help", "--version"}, []
    for name in COMMANDS:
        waiting.append(getattr(importlib.import_module(f"posekit.cli.{name}"), name))
    while waiting:
        command: click.Command = waiting.pop()
        waiting += getattr(command, "commands", {}).values()
        for parameter in command.params:
            found |= {*parameter.opts, *parameter.secondary_opts}
    return found


@pytest.mark.parametrize("name", NAMED)
def test_options_that_a_page_names_exist(name: str) -> None:
    text = NAMED[name].read_text(encoding="utf-8")
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", text)) <= options()


def test_every_page_is_listed() -> None:
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = {f"docs/{entry}.md" for entry in re.findall(r"^([\w/-]+)$", index, flags=re.M)}
    assert {name for name in NAMED if name.startswith("docs/")} - {"docs/index.md"} <= listed


@pytest.mark.parametrize("name", posekit.__all__)
def test_public_names_have_an_example(name: str) -> None:
    thing = getattr(posekit, name)
    assert doctest.DocTestParser().get_examples(inspect.getdoc(thing) or ""), "no example in the docstring"


MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(posekit.__path__, "posekit.")
    if not module.name.endswith("__main__") and not module.name.rpartition(".")[2].startswith("_")
)


@pytest.mark.parametrize("name", [name for name in MODULES if ".cli" not in name])
def test_docstring_examples_run(name: str, desk: Path) -> None:
    module = importlib.import_module(name)
    found = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert not found.failed
