"""Pages shown from Python: in a notebook, in a browser, and where there is neither."""

import sys
import tempfile
import types
import webbrowser

import pytest

import posekit
from posekit.errors import InputError
from posekit.viewer.showing import show_page, shown_folder


@pytest.fixture(scope="module")
def recovery():
    return posekit.recover(posekit.builtin_view("seq1"))


@pytest.fixture
def opened(monkeypatch, tmp_path):
    """Take the place of the browser, and of the system's temporary folder."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    asked: list[str] = []

    def open_page(url: str) -> bool:
        asked.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", open_page)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    return asked


def test_without_a_screen_the_place_of_the_page_is_said(recovery, opened, tmp_path):
    shown = recovery.frames[0].show(tmp_path / "frame.html")
    assert opened == []
    assert repr(shown).startswith(str(tmp_path / "frame.html")) and "open it in a browser" in repr(shown)
    assert "frame 0" in shown.path.read_text(encoding="utf-8")


def test_with_a_screen_the_browser_opens_it(recovery, opened, monkeypatch, tmp_path):
    monkeypatch.setenv("DISPLAY", ":0")
    shown = recovery.show(path=tmp_path / "all.html")
    assert opened == [shown.path.as_uri()] and shown.opened


def test_a_notebook_has_it_in_a_frame_and_opens_nothing(recovery, opened, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":0")
    shell = types.SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    shown = recovery.show(posekit.builtin_view("seq1"))
    assert opened == []
    frame = shown._repr_html_()
    assert frame.startswith('<iframe srcdoc="&lt;!DOCTYPE html') and 'sandbox="allow-scripts"' in frame
    assert frame.count('"') == 2 * 5


def test_all_pages_share_one_folder_that_does_not_grow(opened, monkeypatch, tmp_path):
    monkeypatch.setattr("posekit.viewer.showing.MOST_PAGES", 3)
    shown = [show_page(f"<p>{k}</p>") for k in range(5)]
    (folder,) = tmp_path.iterdir()
    assert sorted(folder.iterdir()) == [page.path for page in shown[2:]]
    assert folder.stat().st_mode & 0o077 == 0


def test_a_folder_of_somebody_else_is_not_written_to(opened, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    folder = shown_folder()
    folder.rmdir()
    folder.symlink_to(tmp_path / "elsewhere")
    assert show_page("<p></p>").path.parent not in (folder, tmp_path / "elsewhere")
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_frame_without_postures_says_why(recovery):
    empty = posekit.Recovery(figure=recovery.figure, fit=recovery.fit, frames=[], settings=recovery.settings)
    assert repr(empty).startswith("Recovery(0 frames")
    frame = type(recovery.frames[0])(time=0.0, batch=None, index=0, reason="the neck is not seen")
    with pytest.raises(InputError, match="frame 0: no posture to show: the neck is not seen"):
        frame.show()


def test_what_is_saved_is_read_again(recovery, tmp_path):
    recovery.save(tmp_path / "found.npz")
    assert len(posekit.read_result(tmp_path / "found.npz").frames) == 5
