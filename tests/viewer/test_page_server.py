"""`posekit view` and its server: one page, to this machine alone."""

import http.client
import os
import signal
import socket
import subprocess
import sys
import threading

import pytest

from posekit.cli import view
from posekit.conversion import given as given_files
from posekit.errors import InputError, ViewerError
from posekit.formats.own import Postures, Result, View, write_postures, write_result, write_view
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.viewer.page.server import PageServer
from posekit.views.builtin import builtin_view
from tests.viewer.driving import wait_until

COMMAND = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from posekit.cli import main; main()"
)


@pytest.fixture
def served():
    with PageServer("<p>Guten Tag, Grüße</p>") as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(server, path="/", method="GET", host=None):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=5)
    try:
        connection.request(method, path, headers={"Host": host or f"127.0.0.1:{server.server_port}"})
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


def test_the_page_is_served_and_nothing_else_is(served):
    assert ask(served) == (200, "<p>Guten Tag, Grüße</p>".encode())
    assert ask(served, method="HEAD") == (200, b"")
    for path in ("/index.html", "/../etc/passwd", "/?x=1", "/%2e%2e/"):
        assert ask(served, path)[0] == 404
    assert ask(served, method="POST")[0] == 501


def test_another_name_for_this_machine_is_refused(served):
    assert ask(served, host="evil.example")[0] == 403
    assert ask(served, host=f"evil.example:{served.server_port}")[0] == 403
    assert ask(served, host=f"localhost:{served.server_port}")[0] == 200


def test_it_listens_on_the_loopback_address_only(served):
    assert served.socket.getsockname()[0] == "127.0.0.1"
    # 127.0.0.2 is this machine too: a server on all addresses would answer there.
    for family, address in ((socket.AF_INET, "127.0.0.2"), (socket.AF_INET6, "::1")):
        try:
            probe = socket.socket(family)
        except OSError:
            continue  # no IPv6 here
        with probe:
            probe.settimeout(1)
            assert probe.connect_ex((address, served.server_port)) != 0


def test_a_taken_port_is_said_in_one_line(served):
    with pytest.raises(ViewerError, match=f"port {served.server_port}") as caught:
        PageServer("", served.server_port)
    assert "\n" not in str(caught.value)
    with pytest.raises(ViewerError, match="port 70000"):
        PageServer("", 70000)


def test_the_command_serves_a_view_until_it_is_interrupted(tmp_path):
    path = tmp_path / "walk.json"
    write_view(path, builtin_view("seq1"))
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND, "view", str(path), "--no-open"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("http://127.0.0.1:"), process.communicate(timeout=10)
        port = int(line.split("/")[2].split(":")[1])
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        connection.request("GET", "/")
        page = connection.getresponse().read().decode()
        connection.close()
        assert "walk.json" in page
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=10)
    assert (process.returncode, out, err) == (0, "stopped\n", "")


def test_the_kinds_of_files_are_told_apart(tmp_path):
    joints = builtin_view("seq1").truth
    for name in ("postures.json", "postures.npz"):
        write_postures(tmp_path / name, Postures(joints=joints))
        given, behind = given_files.read_given(tmp_path / name, None)
        assert isinstance(given, Postures)
        assert behind is None
    write_view(tmp_path / "view.json", builtin_view("seq1"))
    given, behind = given_files.read_given(tmp_path / "view.json", None)
    assert isinstance(given, Result)
    assert isinstance(behind, View)
    assert len(given.frames) == len(behind) == 5
    for name in ("postures.json", "view.json"):
        with pytest.raises(InputError, match="--view"):
            given_files.read_given(tmp_path / name, tmp_path / "view.json")


def test_a_detectors_files_are_no_view_and_what_makes_one_of_them_is_said(tmp_path):
    write_result(tmp_path / "result.npz", result_of(recover(builtin_view("seq1"))))
    (tmp_path / "keypoints").mkdir()
    with pytest.raises(InputError, match=r"posekit convert .*keypoints view\.json"):
        given_files.read_given(tmp_path / "result.npz", tmp_path / "keypoints")


@pytest.mark.parametrize("text", ["3-2", "a", "1-", "-1", "1-2-3", "²"])
def test_frames_that_are_no_range_are_refused(text):
    with pytest.raises(InputError, match="--frames"):
        view._frames(text)


def test_frames_count_from_zero():
    assert view._frames("") is None
    assert view._frames("7") == range(7, 8)
    assert view._frames("0-2") == range(3)


def test_what_does_not_fit_is_loaded_frame_by_frame(chromium, monkeypatch):
    """The page holds few postures of each frame; a click leads to all of one, another back."""
    monkeypatch.setattr("posekit.viewer.page.shown_survivors.PAGE_BYTES", 20_000)
    result = result_of(recover(builtin_view("seq1")))
    counts = [len(frame.joints) for frame in result.frames]
    server = view._as_page(result, None, None, 0, title="walk")
    with server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            for path in ("/frame/99", "/frame/-1", "/frame/", "/frame/1/", "/frame/1?x=1"):
                assert ask(server, path)[0] == 404
            tab = chromium.new_page()
            tab.goto(server.url)
            wait_until(tab, "page.state.drawn === true")
            tab.evaluate("play.go(1)")
            assert tab.evaluate("page.frame().held") < counts[1]
            monkeypatch.undo()
            tab.click("#rest a")
            wait_until(tab, "typeof page === 'object' && page.state.drawn === true")
            assert tab.url == f"{server.url}frame/1"
            assert tab.evaluate("DATA.frames.map((one) => [one.number, one.held])") == [[1, counts[1]]]
            tab.click("#rest a")
            wait_until(
                tab, "typeof page === 'object' && page.state.drawn === true && DATA.frames.length === 5"
            )
            tab.close()
        finally:
            server.shutdown()
            thread.join()
