"""What commands write: never over what they read, whole or not at all, and refused in one line where it cannot be."""

from __future__ import annotations

import errno
import json
import os
import resource
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from posekit.errors import InputError
from posekit.safe_io import write_text
from posekit.skeleton import DOFS

ROOT = Path(__file__).parents[2]
LONG = "x" * 300
COMMANDS_WITH_LONG_NAMES = [
    ("inspect", LONG),
    ("recover", "view.json", "-o", f"{LONG}.json"),
    ("recover", "view.json", "-o", "a.json", "--truth", LONG),
    ("convert", "view.json", f"{LONG}.npz"),
    ("render", "view.json", "-o", f"{LONG}.png"),
    ("validate", "view.json", "--urdf", LONG),
    ("batch", "view.json", "-o", LONG),
    ("synth", "walker", "-o", f"{LONG}.json"),
    ("samples", LONG),
]
OVER_THEIR_INPUT = [
    ("recover", "view.json", "-o", "view.json"),
    ("recover", "view.json", "-o", "a.json", "--write-urdf", "a.json"),
    ("recover", "points.json", "--camera", "camera.toml", "-o", "camera.toml"),
    ("recover", "points.json", "--camera", "camera.toml:first", "-o", "camera.toml"),
    ("recover", "points.json", "--lengths", "lengths.toml", "-o", "lengths.toml"),
    ("recover", "view.json", "--truth", "walk.npz", "-o", "./walk.npz"),
    ("convert", "view.json", "link.json"),
    ("validate", "view.json", "--page", "view.json"),
    ("validate", "view.json", "--urdf", "robot.urdf", "-o", "robot.urdf"),
    ("render", "view.json", "-o", "view.json"),
    ("evaluate", "walk.npz", "-o", "walk.npz"),
    ("batch", "view.json", "-o", "view.json"),
]


@pytest.mark.parametrize("arguments", COMMANDS_WITH_LONG_NAMES, ids=lambda arguments: arguments[0])
def test_a_name_that_no_system_takes_is_one_line(
    arguments: tuple[str, ...],
    run: Callable[..., Any],
    assert_refused: Callable[..., None],
    files_here: Callable[[], list[str]],
) -> None:
    Path("view.json").write_text("{}")
    assert_refused(run(*arguments), os.strerror(errno.ENAMETOOLONG))
    assert files_here() == ["view.json"]


@pytest.mark.parametrize("arguments", OVER_THEIR_INPUT, ids=lambda arguments: " ".join(arguments[-2:]))
def test_nothing_is_written_over_what_is_read(
    arguments: tuple[str, ...], run: Callable[..., Any], assert_refused: Callable[..., None]
) -> None:
    for name in ("view.json", "points.json", "camera.toml", "lengths.toml", "walk.npz", "robot.urdf"):
        Path(name).write_text(name)
    Path("link.json").symlink_to("view.json")
    assert_refused(run(*arguments), "would be written over another file")
    assert all(path.read_text() == path.resolve().name for path in Path().iterdir())


@pytest.mark.parametrize("asked", ["recover", "validate", "convert"])
def test_a_disk_that_takes_nothing_is_one_line(
    asked: str,
    run: Callable[..., Any],
    walk: dict[str, Any],
    assert_refused: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Path("view.json").write_text(json.dumps(walk))
    names = {"recover": ("-o", "out.json"), "validate": ("-o", "out.json"), "convert": ("out.npz",)}
    original = Path.open

    def refuse(self: Path, *arguments: Any, **more: Any) -> Any:
        if self.suffix == ".part":
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(self))
        return original(self, *arguments, **more)

    def refuse_removal(self: Path, missing_ok: bool = False) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(self))

    monkeypatch.setattr(Path, "open", refuse)
    monkeypatch.setattr(Path, "unlink", refuse_removal)
    outcome = run(asked, "view.json", *names[asked])
    assert outcome.code == 2
    assert "Read-only file system" in outcome.err
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("there", [True, False])
def test_a_figure_that_cannot_be_written_leaves_no_new_srdf(
    there: bool,
    run: Callable[..., Any],
    walk: dict[str, Any],
    assert_refused: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Path("view.json").write_text(json.dumps(walk))
    if there:
        Path("f.srdf").write_text("mine")
    written = write_text

    def full(path: Path, pieces: Any) -> None:
        if path.suffix == ".urdf":
            raise InputError(f"{path}: got No space left on device")
        written(path, pieces)

    monkeypatch.setattr("posekit.body.urdf.write_text", full)
    assert_refused(run("recover", "view.json", "-o", "a.json", "--write-urdf", "f.urdf"), "No space left")
    assert {path.name for path in Path().iterdir()} == {"view.json", *(["f.srdf"] if there else [])}


SIGNALS_COME = {
    "in the command": "end()",
    "in a destructor": "(type('Ending', (), {'__del__': lambda _: end()})().__class__, time.sleep(30))",
    "in an import that takes every exception": "(__import__('taker'), time.sleep(30))",
}


@pytest.mark.parametrize("where", SIGNALS_COME)
@pytest.mark.parametrize(
    ("signal", "code", "says"), [("SIGTERM", 143, "ended from outside"), ("SIGINT", 130, "interrupted")]
)
def test_a_command_that_is_ended_leaves_nothing_half_written(
    where: str, signal: str, code: int, says: str, tmp_path: Path
) -> None:
    # The signal comes when the file is written and has not its name yet.
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "taker.py").write_text(
        f"import os, signal\ntry:\n os.kill(os.getpid(), signal.{signal})\nexcept BaseException: pass\n"
    )
    program = f"""
import os, pathlib, signal, sys, time
from posekit.cli.main import main
sys.path.append("modules")
sys.dont_write_bytecode = True
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
end = lambda: os.kill(os.getpid(), signal.{signal})
pathlib.Path.replace = lambda self, target: {SIGNALS_COME[where]}
sys.argv = ["posekit", "synth", "walker", "-o", "view.json", "--frames", "1"]
main()
"""
    ended = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (code, f"posekit: error: {says}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["modules"]


@pytest.mark.parametrize(("most", "stays"), [(100, False), (20_000, True)])
def test_a_disk_that_fills_leaves_no_empty_folder_and_says_what_stays(
    run: Callable[..., Any], tmp_path: Path, most: int, stays: bool
) -> None:
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, usual[1]))
    try:
        outcome = run("samples", "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert outcome.code == 2 and "File too large" in outcome.err
    assert ("what was finished before stays in out" in outcome.err) == stays
    assert (tmp_path / "out" / "walk.json").is_file() == (tmp_path / "out").exists() == stays


def test_a_signal_that_comes_while_the_command_loads_is_one_line() -> None:
    module, _, name = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "scripts"
    ]["posekit"].partition(":")
    program = f"""
import os, signal, sys
class Finder:
    def find_spec(name, path, target=None):
        if name == "typer":
            os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Finder)
sys.argv = ["posekit", "--version"]
from {module} import {name} as main
main()
"""
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=100, check=False
    )
    assert (ended.returncode, ended.stderr) == (130, "posekit: error: interrupted\n")


@pytest.mark.parametrize(
    ("signal", "code", "says"), [("SIGTERM", 143, "ended from outside"), ("SIGINT", 130, "interrupted")]
)
def test_a_signal_that_comes_while_an_error_is_said_is_one_line(signal: str, code: int, says: str) -> None:
    program = f"""
import os, signal, sys, typer
from posekit.cli.main import main
echo = typer.echo
def ended(*given, **named):
    typer.echo = echo
    os.kill(os.getpid(), signal.{signal})
typer.echo = ended
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv = ["posekit", "inspect", "nothing.json"]
main()
"""
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=100, check=False
    )
    assert (ended.returncode, ended.stderr) == (code, f"posekit: error: {says}\n")


def test_what_a_signal_leaves_half_made_is_not_complained_of() -> None:
    program = """
import os, signal
from posekit.cli.signals import take_signals
signal.signal(signal.SIGINT, signal.default_int_handler)
class Half:
    def __del__(self):
        raise AttributeError("before it came" if before else "after it came")
take_signals()
before = True
Half()
before = False
try:
    os.kill(os.getpid(), signal.SIGINT)
except KeyboardInterrupt:
    Half()
"""
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=100, check=True
    )
    assert "before it came" in ended.stderr and "after it came" not in ended.stderr


def test_a_long_list_is_no_name_of_a_file(run: Callable[..., Any]) -> None:
    pytest.importorskip("matplotlib")
    assert run("synth", "walker", "-o", "view.json", "--frames", 1).code == 0
    assert run("recover", "view.json", "-o", "result.npz").code == 0
    every = ",".join(DOFS)
    assert len(every) > 255
    outcome = run("render", "result.npz", "--angles", every, "-o", "angles.png")
    assert (outcome.code, outcome.err) == (0, "")
