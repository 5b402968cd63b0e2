"""Wheel and sdist are whole: what is installed from them works where nothing of the source tree is."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FIRST_RESULT = (
    ("samples", "samples"),
    ("recover", "samples/walk.json", "-o", "postures.json"),
    ("render", "postures.json", "--view", "samples/walk.json", "-o", "postures.html"),
    ("validate", "samples/walk.npz"),
)
"""The first result of docs/index.md, and a check of motion, which reads tables of every kind."""


def run(*command: object, where: Path) -> str:
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [str(word) for word in command],
        cwd=where,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build both: the sdist of the tree, and the wheel of the sdist, as `python -m build` does."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, ROOT, where=folder)
    return folder


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into an environment of its own, which sees the packages that are needed and no posekit."""
    folder = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", "--without-pip", folder, where=folder)
    (wheel,) = built.glob("*.whl")
    python = folder / "bin/python"
    run(
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--no-deps",
        "--no-index",
        wheel,
        where=folder,
    )
    (packages,) = folder.glob("lib/python*/site-packages")
    needed = [path for path in sys.path if "site-packages" in path and Path(path).is_dir()]
    (packages / "needed.pth").write_text("\n".join(needed) + "\n", encoding="utf-8")
    return folder


def test_the_sdist_has_what_a_build_and_a_reader_need(built: Path) -> None:
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "LICENSE", "posekit/urdf/stick_figure.urdf"} <= names


def test_the_wheel_has_the_package_and_nothing_else(built: Path) -> None:
    (path,) = built.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        tops = {name.partition("/")[0] for name in archive.namelist()}
        names = set(archive.namelist())
    assert sorted(top for top in tops if not top.endswith(".dist-info")) == ["posekit"]
    source = {
        str(file.relative_to(ROOT))
        for top in ("urdf", "validators", "viewer")
        for file in (ROOT / "posekit" / top).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert source <= names


def test_what_is_installed_makes_the_first_result(installed: Path, tmp_path: Path) -> None:
    posekit = installed / "bin/posekit"
    where = run(installed / "bin/python", "-c", "import posekit; print(posekit.__file__)", where=tmp_path)
    assert Path(where.strip()).is_relative_to(installed)
    for arguments in FIRST_RESULT:
        run(posekit, *arguments, where=tmp_path)
    assert (tmp_path / "postures.html").stat().st_size > 100_000


def test_the_demo_ends_with_commands_that_can_be_typed(installed: Path, tmp_path: Path) -> None:
    said = run(installed / "bin/posekit", "demo", "-o", "demo", "--no-pictures", where=tmp_path)
    *_, first, _second, _third = said.splitlines()
    assert first.split() == [str(installed / "bin/posekit"), "samples", "samples"]


def test_the_command_is_named_as_the_package_and_only_tried_versions_are_claimed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert set(project["scripts"]) == {project["name"]}  # uvx runs it by that name
    claimed = [line.rpartition(" ")[2] for line in project["classifiers"] if "Python :: 3." in line]
    assert claimed == ["3.11", "3.13"]
