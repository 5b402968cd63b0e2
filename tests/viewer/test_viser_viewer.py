"""Viser's viewer: served to this machine alone, the figure where the survivor is, sliders and playing."""

import socket
import sys
import urllib.request

import numpy as np
import pinocchio as pin
import pytest

import posekit
from posekit.errors import InputError, ViewerError
from posekit.formats.own.frame_answer import likeliest_order
from posekit.viewer.scene.drawn_subject import subject_of
from posekit.viewer.viser_viewer import ViserViewer


@pytest.fixture(scope="module")
def subject():
    return subject_of(posekit.result_of(posekit.recover(posekit.builtin_view("seq1"))))


@pytest.fixture(scope="module")
def viewer(subject):
    with ViserViewer(subject) as viewer:
        yield viewer


def elbow(viewer) -> np.ndarray:
    """Return where the right forearm's frame is in the viewer's own model, as it was drawn last."""
    body = viewer._body
    name = next(one.name for one in body.visual_model.geometryObjects if one.name.startswith("right_forearm"))
    return np.array(body.frames[f"figure/visual/{name}"].position)


def drawn_at(subject, frame: int, row: int) -> np.ndarray:
    figure = subject.figure
    q = figure.configurations(subject.frames[frame].aligned_points[row : row + 1]).q[0]
    data, geometry = figure.model.createData(), figure.geometry
    placed = pin.GeometryData(geometry)
    pin.updateGeometryPlacements(figure.model, data, geometry, placed, np.where(np.isnan(q), 0, q))
    index = next(k for k, one in enumerate(geometry.geometryObjects) if one.name.startswith("right_forearm"))
    return np.asarray(placed.oMg[index].translation)


def test_it_is_served_to_this_machine_alone(viewer) -> None:
    assert viewer.url.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(viewer.url, timeout=10) as page:
        assert page.status == 200
    # Whoever listens on every address of the machine answers here, too.
    with pytest.raises(OSError), socket.create_connection(("127.0.0.2", viewer.port), timeout=2):
        pass


def test_the_likeliest_is_drawn_first_and_sliders_choose(viewer, subject) -> None:
    first = subject.frames[0].answer.representatives[0]
    np.testing.assert_allclose(elbow(viewer), drawn_at(subject, 0, int(first)), rtol=0, atol=1e-9)
    viewer.frame.value, viewer.posture.value = 2, 3
    viewer.draw()
    order = likeliest_order(subject.frames[2].probability, subject.frames[2].answer)
    np.testing.assert_allclose(elbow(viewer), drawn_at(subject, 2, int(order[3])), rtol=0, atol=1e-9)
    assert viewer.says.content.startswith("frame 2, 0.4 s: posture 3 of ")


def test_it_plays_round_and_round(viewer, subject) -> None:
    viewer.frame.value, viewer.playing.value = 3, False
    viewer.step()
    assert viewer.frame.value == 3
    viewer.playing.value = True
    viewer.step()
    viewer.step()
    assert viewer.frame.value == 0


def test_a_taken_port_is_refused(viewer, subject) -> None:
    with pytest.raises(ViewerError, match=f"port {viewer.port} of 127.0.0.1: .*give another one"):
        ViserViewer(subject, viewer.port)


def test_a_missing_extra_is_one_line(subject, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(InputError, match=r"posekit view --viser needs viser.*pip install 'posekit\[viser\]'"):
        ViserViewer(subject)


def test_the_command_serves_it_until_it_is_interrupted(command, tmp_path, monkeypatch) -> None:
    posekit.recover(posekit.builtin_view("seq1")).save(tmp_path / "found.npz")

    def interrupted(self) -> None:
        with urllib.request.urlopen(self.url, timeout=10) as page:
            assert page.status == 200
        self.others.value = False
        self.draw()
        raise KeyboardInterrupt

    monkeypatch.setattr(ViserViewer, "serve_forever", interrupted)
    outcome = command("view", tmp_path / "found.npz", "--viser", "--no-open", "--frames", "1-2")
    assert outcome.code == 0 and outcome.err == ""
    assert outcome.out.startswith("http://127.0.0.1:") and outcome.out.endswith("stopped\n")
    refused = command("view", tmp_path / "found.npz", "--viser", "--frames", "1-9")
    assert refused.code == 2 and "expected numbers from 0 to 4" in refused.err
