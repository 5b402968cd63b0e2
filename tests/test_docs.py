"""The pages of the API are those of the modules, and what Sphinx warned of it warns of again."""

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PACKAGE = DOCS.parent / "posekit"

CONF = """import sys
sys.path.insert(0, {docs!r})
extensions = ["sphinx.ext.autodoc", "quick_build", "warned_again"]
autodoc_default_options = {{"members": True}}
"""
PAGES = {
    "index.rst": "Title\n=====\n\n.. toctree::\n\n   code\n\n:ref:`there`\n",
    "code.rst": "Code\n====\n\n.. automodule:: code_of_a_test\n",
}
MODULE = '''"""A module."""

from __future__ import annotations


def one(value: Given) -> Given:
    """%s"""


class Given:
    """What is given."""
'''


@pytest.fixture(scope="module")
def page() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_api", DOCS / "make_api.py")
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def test_the_pages_are_written_anew_with_every_module(page: ModuleType) -> None:
    made = page.pages()
    written = {f"api/{path.name}" for path in (DOCS / "api").iterdir()} | {"api.md"}
    assert written == set(made), "run: python docs/make_api.py"
    for name, text in made.items():
        assert (DOCS / name).read_text(encoding="utf-8") == text, "run: python docs/make_api.py"
        assert name == "api.md" or f"\n{name.removesuffix('.rst')}\n" in made["api.md"]


def test_every_module_is_on_one_page(page: ModuleType) -> None:
    lines = [line for text in page.pages().values() for line in text.splitlines()]
    listed = [line.removeprefix(".. automodule:: ") for line in lines if line.startswith(".. automodule")]
    expected = set()
    for top in PACKAGE.iterdir():
        for file in sorted(top.rglob("*.py")) if top.is_dir() else [top]:
            parts = ("posekit", *([top.name] if top.is_dir() else []))
            inside = file.relative_to(top).with_suffix("").parts if top.is_dir() else (top.stem,)
            expected.add(".".join(part for part in (*parts, *inside) if part != "__init__"))
    data = {name for name in expected if name.startswith("posekit.urdf")}
    assert sorted(listed) == sorted(expected - data - {"posekit.py.typed"} - {"posekit.py"})


def test_a_package_on_no_page_is_named(page: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "SECTIONS", page.SECTIONS[:-1])
    with pytest.raises(ValueError, match=r"^posekit\.__main__: on no page"):
        page.pages()


def test_what_was_warned_of_is_warned_of_again_until_it_is_mended(tmp_path: Path) -> None:
    pytest.importorskip("sphinx")
    source = tmp_path / "docs"
    source.mkdir()
    (source / "conf.py").write_text(CONF.format(docs=str(DOCS)))
    for name, text in PAGES.items():
        (source / name).write_text(text)
    module = tmp_path / "code_of_a_test.py"
    module.write_text(MODULE % "Say *one.")

    def build() -> tuple[int, str]:
        done = subprocess.run(
            [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-b", "html", "docs", "html"],
            cwd=tmp_path,
            env={"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1", "PATH": ""},
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout + done.stderr

    for _ in range(2):
        status, said = build()
        assert status == 1, said
        assert "code_of_a_test.one" in said, said
        assert "undefined label: 'there'" in said
    module.write_text(MODULE % "Say one.")
    (source / "index.rst").write_text(PAGES["index.rst"].replace(":ref:`there`", ""))
    status, said = build()
    assert status == 0, said
    html = (tmp_path / "html" / "code.html").read_text()
    assert html.count('href="#code_of_a_test.Given" title="code_of_a_test.Given"') == 2
    status, said = build()
    assert status == 0
    assert "0 added, 0 changed" in said
