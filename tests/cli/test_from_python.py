"""`posekit.convert` and `posekit.render` do what the commands do, of files and of objects."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import posekit
from posekit.answers.wording import percent
from posekit.errors import InputError
from posekit.viewer.pictures import Shot
from posekit.viewer.scene.drawn_subject import Shown


@pytest.fixture(scope="module")
def recovery() -> posekit.Recovery:
    return posekit.recover(posekit.builtin_view("seq1"))


@pytest.fixture
def file(recovery: posekit.Recovery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    recovery.save("found.npz")
    return "found.npz"


@pytest.mark.parametrize("options", [{}, {"posture": "3", "up": "+y"}])
@pytest.mark.parametrize("suffix", ["bvh", "csv"])
def test_a_file_is_converted_as_by_the_command(
    file: str, command, suffix: str, options: dict[str, Any]
) -> None:
    says = posekit.convert(file, f"mine.{suffix}", **options)
    words = [word for name, value in options.items() for word in (f"--{name}", value)]
    outcome = command("convert", file, f"theirs.{suffix}", *words)
    assert outcome.code == 0 and outcome.out.splitlines()[:-1] == says
    assert Path(f"mine.{suffix}").read_bytes() == Path(f"theirs.{suffix}").read_bytes()


def test_objects_are_converted_as_their_files(
    file: str, recovery: posekit.Recovery, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is written beside the output: no temporary file, either."""
    monkeypatch.setattr(tempfile, "mkdtemp", lambda *_, **__: pytest.fail("a temporary folder is made"))
    expected = posekit.convert(file, "file.bvh")
    for name, given in {
        "recovery": recovery,
        "result": posekit.open(file),
        "postures": posekit.open(file, "postures"),
    }.items():
        says = posekit.convert(given, f"{name}.trc")
        assert says, name
    assert posekit.convert(recovery, "again.bvh") == expected
    assert Path("again.bvh").read_bytes() == Path("file.bvh").read_bytes()
    motion = posekit.open("recovery.trc", "motion")
    posekit.convert(motion, "motion.csv")
    np.testing.assert_allclose(posekit.open("motion.csv").points, motion.points, rtol=0, atol=1e-9)
    with pytest.raises(InputError, match="metres, as objects have"):
        posekit.convert(motion, "motion.csv", unit="mm")


def test_what_is_converted_is_the_answer(file: str, recovery: posekit.Recovery) -> None:
    said = posekit.convert(file, "motion.npz")
    answers = recovery.answers
    with np.load("motion.npz") as written:
        np.testing.assert_allclose(written["joints"], [one.posture for one in answers], rtol=0, atol=1e-6)
    sure = float(np.median([one.sure for one in answers]))
    assert said[0].startswith(f"the likeliest posture of each frame, {percent(sure)} sure")
    assert said[0].endswith("; without jumps: recover --follow 1")


def test_a_page_is_the_commands(file: str, command) -> None:
    assert posekit.render(file, "mine.html") == 1
    assert command("render", file, "-o", "theirs.html").code == 0
    assert Path("mine.html").read_bytes() == Path("theirs.html").read_bytes()


def test_objects_are_drawn(file: str, recovery: posekit.Recovery) -> None:
    for given in (recovery, posekit.open(file), posekit.open(file, "postures")):
        posekit.render(given, "page.html", frame=0)
        assert Path("page.html").stat().st_size > 100_000
    posekit.render(recovery, "scene.html", frame=1, posture="likeliest")
    assert Path("scene.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html")


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (
            lambda: posekit.convert(cast("Any", [1]), "out.bvh"),
            "convert: got list; expected a path, a recovery",
        ),
        (lambda: posekit.convert("found.npz", "out.bvh", colour="red"), "convert: colour: is no option"),
        (lambda: posekit.render(cast("Any", 3), "out.html"), "render: got int; expected a path"),
        (lambda: posekit.render("found.npz", "out.html", frame=99), "expected a number from 0 to 4"),
        (lambda: posekit.render("none.npz", "out.html"), "none.npz"),
    ],
)
def test_a_mistake_is_one_line(file: str, call, text: str) -> None:
    with pytest.raises(InputError, match=text) as refused:
        call()
    assert "\n" not in str(refused.value)
    assert not Path("out.html").exists() and not Path("out.bvh").exists()


def test_a_file_is_not_converted_to_itself(file: str) -> None:
    posekit.convert(file, "motion.npz", to="npz")
    before = Path("motion.npz").read_bytes()
    Path("link.npz").symlink_to("motion.npz")
    for output in ("motion.npz", "./motion.npz", "link.npz"):
        with pytest.raises(InputError, match="the file that is read"):
            posekit.convert("motion.npz", output, up="+z")
    assert Path("motion.npz").read_bytes() == before


def test_films_are_as_fast_as_the_frames(
    recovery: posekit.Recovery, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    shots: list[Shot] = []

    def keep(*_: object, shot: Shot, **__: object) -> int:
        shots.append(shot)
        return 1

    monkeypatch.setattr("posekit.viewer.pictures.write_picture", keep)
    posekit.render(recovery, tmp_path / "walk.gif")  # 0.2 s from frame to frame
    posekit.render(recovery, tmp_path / "slow.gif", shot=Shot(fps=2.0))
    assert [shot.fps for shot in shots] == [pytest.approx(5.0), 2.0]


def test_a_film_is_the_commands(command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Frames that a path bridges are drawn, and captions have the frames' numbers."""
    view = posekit.builtin_view("seq1")
    image = view.image.copy()
    image[2] = np.nan
    recovery = posekit.recover(replace(view, image=image))
    found = posekit.result_of(recovery, following=posekit.follow(recovery, k=1))
    posekit.write_result(tmp_path / "found.npz", found)
    films: list[list[str]] = []

    def keep(path: Path, subject: object, frames: Sequence[Shown], **_: object) -> int:
        films.append([shown.caption for shown in frames])
        return len(frames)

    monkeypatch.setattr("posekit.viewer.pictures.write_picture", keep)
    posekit.render(found, tmp_path / "mine.gif")
    assert command("render", tmp_path / "found.npz", "-o", tmp_path / "theirs.gif").code == 0
    mine, theirs = films
    assert mine == theirs and len(mine) == len(view)
    assert mine[2].startswith("frame 2") and "bridged" in mine[2]
