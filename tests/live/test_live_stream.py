"""JSON lines in, JSON lines out: every line is answered before the next is read, and what is no line is said."""

import io
import json
import os
import runpy
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.live.lines import MAX_LINE_BYTES, line_of
from posekit.live.stream import LiveRequest, answers
from posekit.skeleton import JOINT, JOINTS
from posekit.views.source import Source
from tests.live.conftest import PIXELS, SETTINGS

ROOT = Path(__file__).resolve().parents[2]


def line_at(seen, k: int, **more: object) -> str:
    one = {"time": seen.time[k], "points": seen.image[k].tolist(), "root": seen.root[k].tolist()}
    return json.dumps(one | more) + "\n"


@pytest.fixture
def header(seen) -> str:
    camera = {"model": "opencv", "K": seen.camera.K.tolist()}
    return json.dumps({"camera": camera, "lengths": dict(seen.lengths), "deviation": PIXELS}) + "\n"


def answered(text: str, tracker, **asked: Any) -> list[dict]:
    return list(answers(io.BytesIO(text.encode()), lambda header: tracker, **asked))


def test_a_header_says_what_options_leave_open(seen, header, tracker) -> None:
    request = LiveRequest(settings=SETTINGS, source=Source(), lag=0)
    text = header + line_at(seen, 0) + "\n" + line_at(seen, 1)
    told = list(answers(io.BytesIO(text.encode()), request.tracker))
    expected = [tracker.update(seen.image[k], seen.time[k], root=seen.root[k]) for k in range(2)]
    for one, same in zip(told, expected, strict=True):
        assert (one["frame"], one["time"], one["survivors"]) == (same.frame, same.time, same.survivors)
        assert one["probability"] == pytest.approx(same.probability, abs=1e-6)
        for name, place in one["joints"].items():
            np.testing.assert_allclose(place, same.joints[JOINT[name]], atol=1e-6)
        assert set(one["joints"]) == set(JOINTS) and one["path"]["frame"] == one["frame"]
        assert one == json.loads(line_of(one)) and line_of(one).count("\n") == 1


def test_points_by_name_are_points_in_order(seen, tracker) -> None:
    named = dict(zip(JOINTS, seen.image[0].tolist(), strict=True))
    (by_name,) = answered(line_at(seen, 0, points=named), tracker)
    (by_number,) = answered(line_at(seen, 0, time=1), tracker)
    assert by_name["joints"] == by_number["joints"]


def test_points_that_are_missing_or_unsure_are_not_seen(seen, tracker) -> None:
    points: list = [[*point, 0.9] for point in seen.image[0].tolist()]
    points[0][2] = 0.1
    assert "the neck" in answered(line_at(seen, 0, points=points), tracker, least=0.5)[0]["reason"]
    points[0] = None
    assert "the neck" in answered(line_at(seen, 1, points=points), tracker)[0]["reason"]


def test_each_line_is_answered_before_the_next_is_read(seen, tracker) -> None:
    read = []

    class Watched(io.BytesIO):
        def readline(self, size: int | None = -1, /) -> bytes:
            read.append(size)
            return super().readline(size)

    told = answers(Watched((line_at(seen, 0) + line_at(seen, 1)).encode()), lambda header: tracker)
    next(told)
    assert len(read) == 1


MALFORMED = {
    "no JSON": ("{bad\n", "line 2: column 2"),
    "no object": ("[1, 2]\n", "line 2: got"),
    "no points": ('{"time": 1}\n', "line 2: points: got nothing"),
    "no time": ('{"points": []}\n', "line 2: time: got nothing"),
    "a header": ('{"stature": 1.7}\n', "line 2: got no points"),
    "too few points": ('{"time": 1, "points": [[1, 2]]}\n', "line 2: points: got shape"),
    "a point of four": ('{"time": 1, "points": [[1, 2, 3, 4]]}\n', r"line 2: points\[0\]"),
    "a joint unknown": ('{"time": 1, "points": {"left_wirst": [1, 2]}}\n', "left_wrist"),
    "not a number": ('{"time": NaN, "points": []}\n', "line 2"),
    "time that stands": ('{"time": 0, "points": {}}\n', "line 2: frame 1 is at 0 s"),
    "another field": ('{"time": 1, "points": {}, "image": 3}\n', "line 2: image"),
    "no text": ("\udcff\n", "line 2"),
    "too long": ('"' + "x" * MAX_LINE_BYTES + '"\n', "line 2: got a longer line"),
}


@pytest.mark.parametrize("bad", MALFORMED)
def test_a_line_that_cannot_be_read_is_named_or_answered(seen, tracker, bad) -> None:
    line, says = MALFORMED[bad]
    text = (line_at(seen, 0) + line + line_at(seen, 1)).encode(errors="surrogateescape")
    told = answers(io.BytesIO(text), lambda header: tracker)
    assert next(told)["frame"] == 0
    with pytest.raises(InputError, match=says):
        next(told)
    again = posekit.Tracker(SETTINGS, camera=seen.camera, lengths=seen.lengths, deviation=PIXELS)
    first, error, last = answers(io.BytesIO(text), lambda header: again, keep_going=True)
    assert first["frame"] == 0 and last["frame"] == 1 and list(error) == ["error"]
    assert "line 2" in error["error"] and "\n" not in error["error"]


def test_the_command_answers_and_ends_with_2_at_a_bad_line(command, seen, header, monkeypatch) -> None:
    text = header + line_at(seen, 0) + "{bad\n" + line_at(seen, 1)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    done = command("follow", "--stdin", "--ranges", "urdf", "--length-deviation", "0")
    assert done.code == 2 and json.loads(done.out)["frame"] == 0
    assert done.err.startswith("posekit: error: line 3: column 2") and done.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "text", "says"),
    [
        ((), "", "give --stdin"),
        (("--stdin",), '{"time": 0, "points": {}}\n', "--size"),
        (("--stdin", "--size", "640x480", "--layout", "no_such"), '{"time": 0, "points": {}}\n', "no_such"),
        (("--stdin", "--keep-going"), '{"stature": 1.7}\n', "--size"),
    ],
)
def test_what_cannot_be_followed_is_one_line(command, monkeypatch, arguments, text, says) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    done = command("follow", *arguments)
    assert done.code == 2 and not done.out and says in done.err and done.err.count("\n") == 1


def test_ctrl_c_and_a_reader_that_is_gone_end_it_quietly(seen, header) -> None:
    # Whoever runs the tests in the background has SIGINT ignored, which a process passes on.
    heed = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    start = f"{heed}; from posekit.cli import main; main()"
    options = ("--ranges", "urdf", "--length-deviation", "0")
    command = [sys.executable, "-c", start, "follow", "--stdin", *options]
    text = header + line_at(seen, 0)
    for gone in (False, True):
        with subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        ) as process:
            assert process.stdin is not None and process.stdout is not None and process.stderr is not None
            process.stdin.write(text)
            process.stdin.flush()
            assert json.loads(process.stdout.readline())["frame"] == 0  # though the input has not ended
            if gone:
                process.stdout.close()
                process.stdin.write(line_at(seen, 1))
                process.stdin.close()
            else:
                os.kill(process.pid, signal.SIGINT)
            code = process.wait(timeout=60)
            assert process.stderr.read() == ""
            assert code == (1 if gone else 0)


def test_the_example_replays_what_a_camera_saw(tmp_path, seen, monkeypatch, capsys) -> None:
    layout = load_skeleton_map("mediapipe_33")
    width, height = 1280, 720
    lines = []
    for k in range(2):
        points = [[*seen.image[k, JOINT[n]], 0.9] if n in JOINT else None for n in layout.points]
        lines.append(
            json.dumps({"time": k / 30, "size": [width, height], "points": points if k else [None] * 33})
        )
    (tmp_path / "seen.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    again = tmp_path / "again.jsonl"
    monkeypatch.setattr(
        sys, "argv", ["live_camera.py", "--replay", str(tmp_path / "seen.jsonl"), "--record", str(again)]
    )
    runpy.run_path(str(ROOT / "examples" / "live_camera.py"), run_name="__main__")
    first, second = capsys.readouterr().out.splitlines()
    assert "the neck" in first and ("right hand" in second or "no posture" in second)
    assert len(again.read_text(encoding="utf-8").splitlines()) == 2


def test_the_example_says_what_is_missing_for_a_camera(monkeypatch) -> None:
    monkeypatch.setattr(sys, "argv", ["live_camera.py"])
    monkeypatch.setitem(sys.modules, "mediapipe", None)
    with pytest.raises(SystemExit, match="pip install opencv-python mediapipe, or give --replay FILE"):
        runpy.run_path(str(ROOT / "examples" / "live_camera.py"), run_name="__main__")
