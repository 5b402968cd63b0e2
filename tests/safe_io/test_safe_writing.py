"""Files are written whole or not at all."""

import json
import stat
from pathlib import Path

import pytest

from posekit.errors import InputError
from posekit.safe_io import writing
from posekit.safe_io.writing import (
    check_folder,
    json_pieces,
    make_folder,
    replacing,
    replacing_folder,
    write_text,
)


def test_content_replaces_content(tmp_path):
    path = tmp_path / "out.json"
    write_text(path, ["old"])
    path.chmod(0o640)
    write_text(path, ["new ", "text"])
    assert path.read_text() == "new text"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_is_followed(tmp_path):
    (tmp_path / "to").mkdir()
    (tmp_path / "to" / "real").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "to" / "real")
    write_text(tmp_path / "link", ["new"])
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "to" / "real").read_text() == "new"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_failure_leaves_the_old_content_and_nothing_else(tmp_path, error):
    path = tmp_path / "out.json"
    path.write_text("old")

    def pieces():
        yield "half"
        raise error

    with pytest.raises(error):
        write_text(path, pieces())
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_one_line(tmp_path):
    with pytest.raises(InputError, match="got No space left on device; expected a file that can be written"):
        with replacing(tmp_path / "out", sync=True):
            raise OSError(28, "No space left on device")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_in_a_folder_that_grows_names_the_folder_that_was_asked_for(tmp_path):
    path = tmp_path / "out"
    with pytest.raises(InputError) as caught, replacing_folder(path) as folder:
        (folder / "first").write_text("whole")
        with replacing(folder / "second"):
            raise OSError(28, "No space left on device")
    assert str(caught.value).startswith(f"{path}/second: got No space left on device")
    assert not list(tmp_path.iterdir())


def test_a_rename_that_fails_leaves_nothing(tmp_path, monkeypatch):
    def refuse(self, target):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(InputError, match="Operation not permitted"):
        write_text(tmp_path / "out", ["x"])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["new", "new/below", "old", "file", "file/below", "link", "x" * 300])
def test_a_folder_is_refused_before_it_is_made_where_it_cannot_be_made(tmp_path, name):
    (tmp_path / "old").mkdir()
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    said = []
    for make in (check_folder, make_folder):
        try:
            make(tmp_path / name)
        except InputError as error:
            said.append("expected a folder for results" in str(error))
        if make is check_folder:
            assert len(list(tmp_path.rglob("*"))) == 3
    assert said == ([] if name in ("new", "new/below", "old") else [True, True])


def test_targets_that_cannot_be_are_refused(tmp_path):
    (tmp_path / "file").touch()
    for path, reason in [
        (tmp_path, "a directory"),
        (tmp_path / "no" / "out", "a directory that does not exist"),
        (tmp_path / "file" / "out", "does not exist"),
        (Path("/dev/null"), "a device"),
        (tmp_path / ("x" * 300), "File name too long"),
    ]:
        with pytest.raises(InputError, match=reason) as caught:
            write_text(path, ["x"])
        assert str(caught.value).isprintable()
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert Path("/dev/null").is_char_device()


def test_what_could_not_be_read_again_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "MAX_BYTES", 1000)
    with pytest.raises(InputError, match="more than 0 MB of JSON"):
        write_text(tmp_path / "out.json", ["x" * 600] * 2)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("items", [[], [1], [{"a": None}, {"b": [1.5]}]])
def test_pieces_are_json(items):
    head = {"schema": "s", "n": [1, 2]}
    assert json.loads("".join(json_pieces(head, "items", items))) == {**head, "items": items}
    assert json.loads("".join(json_pieces({}, "items", items))) == {"items": items}


def test_nan_is_never_written():
    with pytest.raises(ValueError, match="not JSON compliant"):
        "".join(json_pieces({}, "items", [float("nan")]))
