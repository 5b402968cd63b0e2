"""What is kept of several files: each under its own name, whole or not at all, and inputs stay as they are."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.listing import MANIFEST_NAME, Wanted, listed
from posekit.formats.own.report_clips import ClipVerdict
from posekit.formats.own.report_frames import ClipName, ReportFrames
from posekit.formats.own.report_schema import Verdict
from posekit.validation.keep import keep_clips, names_below

FRAMES = 10


def a_file(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, q=np.arange(3.0 * FRAMES).reshape(FRAMES, 3), fps=np.array(10.0))


def judged(*files: tuple[Path, Verdict, tuple[int, ...]]) -> tuple[list[ClipVerdict], ReportFrames]:
    """Return verdicts on files of one clip: the path, the verdict, the longest good span."""
    count = len(files)
    clips = [
        ClipVerdict(
            file=str(path),
            clip="",
            verdict=verdict,
            frames=FRAMES,
            invalid=FRAMES - 4,
            undecided=0,
            good=good,
        )
        for path, verdict, good in files
    ]
    frame = np.tile(np.arange(FRAMES), count)
    frames = ReportFrames(
        clips=[ClipName(str(path), "") for path, *_ in files],
        clip=np.repeat(np.arange(count), FRAMES),
        frame=frame,
        time=frame / 10,
    )
    return clips, frames


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


@pytest.fixture
def three(tmp_path):
    paths = [tmp_path / "in" / name for name in ("a/walk.npz", "b/walk.npz", "b/jump.npz")]
    for path in paths:
        a_file(path)
    return judged((paths[0], "valid", (0, 9)), (paths[1], "invalid", (2, 7)), (paths[2], "invalid", (4, 5)))


def test_files_keep_their_names_below_the_folder_that_holds_them_all(tmp_path, three):
    before = files_of(tmp_path / "in")
    kept = keep_clips(tmp_path / "out", *three, spans=0.5)
    found = files_of(tmp_path / "out")
    assert set(found) == {"a/walk.npz", "b/walk.npz", MANIFEST_NAME}
    assert found["a/walk.npz"] == before["a/walk.npz"]
    with np.load(tmp_path / "out/b/walk.npz") as part:
        np.testing.assert_array_equal(part["q"][:, 0], 3.0 * np.arange(2, 8))
    with (tmp_path / "out" / MANIFEST_NAME).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["written"], row["first"], row["last"]) for row in rows] == [
        ("a/walk.npz", "0", "9"),
        ("b/walk.npz", "2", "7"),
        ("", "", ""),
    ]
    assert "longest good span 0.1 s, below 0.5 s" in rows[2]["why"]
    assert kept.said == "2 of 3 clips kept, 1 of them cut to their longest good span"
    assert files_of(tmp_path / "in") == before


def test_what_was_kept_is_an_input_again(tmp_path, three):
    keep_clips(tmp_path / "out", *three, spans=0.5)
    found = listed([tmp_path / "out"], Wanted(suffixes=(".npz", ".csv"), contents=()))
    assert [path.relative_to(tmp_path / "out").as_posix() for path in found] == ["a/walk.npz", "b/walk.npz"]


def test_without_spans_only_what_passes_is_kept(tmp_path, three):
    (tmp_path / "out").mkdir()
    keep_clips(tmp_path / "out", *three)
    assert set(files_of(tmp_path / "out")) == {"a/walk.npz", MANIFEST_NAME}


def test_a_file_that_cannot_be_cut_is_told_and_the_others_are_kept(tmp_path, three):
    np.savez(tmp_path / "in/b/walk.npz", q=np.zeros((3, 3)))
    keep_clips(tmp_path / "out", *three, spans=0.5)
    assert set(files_of(tmp_path / "out")) == {"a/walk.npz", MANIFEST_NAME}
    assert "cannot be written" in (tmp_path / "out" / MANIFEST_NAME).read_text(encoding="utf-8")


def test_where_something_fails_there_is_no_folder(tmp_path, three, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    (tmp_path / "busy").mkdir()
    (tmp_path / "busy/mine").write_text("mine")
    with pytest.raises(InputError, match="new or empty"):
        keep_clips(tmp_path / "busy", *three)
    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match="No space left"):
        keep_clips(tmp_path / "out", *three)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["busy", "in"]


@pytest.mark.parametrize("name", [".", "../here"])
def test_the_folder_may_be_the_one_that_one_is_in(name, tmp_path, three, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    keep_clips(Path(name), *three)
    assert set(files_of(Path.cwd())) == {"a/walk.npz", MANIFEST_NAME}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["here", "in"]


def test_a_folder_that_cannot_be_made_is_named_as_it_was_given(tmp_path, three, monkeypatch):
    made = Path.mkdir

    def refuse(self, *given, **named):
        if self.suffix == ".part":
            raise OSError(30, "Read-only file system", str(self))
        made(self, *given, **named)

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError, match="out: got Read-only file system"):
        keep_clips(tmp_path / "out", *three)


@pytest.mark.parametrize("option", ["--output", "--page", "--repair"])
def test_nothing_else_is_written_into_the_folder_for_clips(
    option, tmp_path, command: Callable[..., Any], monkeypatch
):
    monkeypatch.chdir(tmp_path)
    np.savez("walk.npz", joints=np.zeros((2, 14, 3)))
    (tmp_path / "kept").mkdir()
    name = {"--output": "kept/a.json", "--page": "kept/a.html", "--repair": "kept/a.npz"}[option]
    outcome = command("validate", "walk.npz", "--keep", "kept", option, name)
    assert outcome.code == 2
    assert f"{name}: got a name in kept; expected clips alone in it" in outcome.err
    assert not list((tmp_path / "kept").iterdir())


def test_names_do_not_leave_the_folder():
    paths = {"../x/a.npz": Path("../x/a.npz"), "../y/z/../b.npz": Path("../y/z/../b.npz")}
    assert names_below(paths) == {"../x/a.npz": Path("x/a.npz"), "../y/z/../b.npz": Path("y/b.npz")}
