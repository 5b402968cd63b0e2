"""Survivors in viser's viewer: the figure by Pinocchio's own visualizer, sliders for frames and postures, playing."""

from __future__ import annotations

import io
import socket
import time
from contextlib import redirect_stdout
from types import TracebackType
from typing import Any, Final

import coal
import numpy as np
import pinocchio as pin

from posekit.errors import ViewerError
from posekit.formats.motion.glb_capsule import capsule_mesh
from posekit.formats.own.frame_answer import likeliest_order
from posekit.geometry import Array
from posekit.safe_io import extra
from posekit.skeleton import JOINTS, TREE_SEGMENTS
from posekit.viewer.page.server import LOCAL_HOST
from posekit.viewer.scene.colours import SIDE_RGB, side
from posekit.viewer.scene.drawn_subject import DrawnSubject

MAX_OTHERS: Final = 60
"""Postures of a frame that are drawn as lines beside the chosen one."""
OTHERS_METRES: Final = 0.004
"""How thick these lines are."""
FRAMES_A_SECOND: Final = 10.0
"""While it plays, where the file says no times."""
LEAST_STRENGTH: Final = 0.12
"""Of the lines of the least likely posture: 1 is the full colour, 0 white."""


class ViserViewer:
    """Serve a figure with sliders for frames and postures at ``http://127.0.0.1:PORT/``, to this machine alone.

    Parameters
    ----------
    subject : DrawnSubject
        Whose postures.
    port : int
        0 takes a free one.

    Raises
    ------
    InputError
        Where the extra ``viser`` is not installed.
    ViewerError
        Where there is no posture, or the port is taken.
    """

    def __init__(self, subject: DrawnSubject, port: int = 0) -> None:
        viser = extra("viser", "viser", "posekit view --viser")
        self.subject = subject
        if not any(len(frame) for frame in subject.frames):
            raise ViewerError(
                "there is no posture in these frames; nothing can be shown; choose another file"
            )
        self.port = _free_port(port)
        with redirect_stdout(io.StringIO()):  # it draws a box around its address
            self.server = viser.ViserServer(host=LOCAL_HOST, port=self.port, verbose=False)
        up = (0.0, -1.0, 0.0) if subject.R_cam_world is None else tuple(subject.R_cam_world[:, 2].tolist())
        self.server.scene.set_up_direction(up)
        self._body = _body(subject, self.server)
        likely = next(k for k, frame in enumerate(subject.frames) if len(frame))
        gui = self.server.gui
        last = max(len(subject.frames) - 1, 1)
        self.frame = gui.add_slider("frame", min=0, max=last, step=1, initial_value=likely)
        most = max(max(len(frame) for frame in subject.frames) - 1, 1)
        self.posture = gui.add_slider(
            "posture, the likeliest first", min=0, max=most, step=1, initial_value=0
        )
        self.playing = gui.add_checkbox("play", initial_value=False)
        self.others = gui.add_checkbox("others", initial_value=True)
        self.says = gui.add_markdown("")
        for control in (self.frame, self.posture, self.others):
            control.on_update(lambda _: self.draw())
        self.draw()

    @property
    def url(self) -> str:
        """The page's address."""
        return f"http://{LOCAL_HOST}:{self.port}/"

    def draw(self) -> None:
        """Draw the frame and the posture that the sliders say."""
        k = min(int(self.frame.value), len(self.subject.frames) - 1)
        frame = self.subject.frames[k]
        if not len(frame):
            self.says.content = f"frame {k}: no posture"
            self._body.displayVisuals(False)
            return
        p = frame.probability
        order = np.arange(len(frame)) if p is None else likeliest_order(p, frame.answer)
        place = min(int(self.posture.value), len(frame) - 1)
        row = int(order[place])
        q = self.subject.figure.configurations(frame.aligned_points[row : row + 1]).q[0]
        self._body.displayVisuals(True)
        self._body.display(np.where(np.isnan(q), 0.0, q))
        self._draw_others(frame.aligned_points[order], None if p is None else p[order], place)
        sure = "" if p is None else f", {p[row]:.0%}"
        self.says.content = f"frame {k}, {frame.time:g} s: posture {place} of {len(frame)}{sure}"

    def _draw_others(self, points: Array, p: Array | None, place: int) -> None:
        rows = [k for k in range(min(len(points), MAX_OTHERS)) if k != place]
        if not rows or not self.others.value:
            rows = []
        lines, colours = [], []
        for k in rows:
            strength = LEAST_STRENGTH if p is None else max(LEAST_STRENGTH, float(p[k] / max(p[0], 1e-12)))
            for start, end in TREE_SEGMENTS:
                pair = points[k, [start, end]]
                if np.isfinite(pair).all():
                    lines.append(pair)
                    colours.append(1 - strength * (1 - np.array(SIDE_RGB[side(JOINTS[end])])))
        if lines:
            tinted = np.repeat(np.array(colours)[:, None], 2, axis=1)
            self.server.scene.add_line_segments(
                "/others", np.array(lines), colors=tinted, thickness=OTHERS_METRES
            )
        else:
            self.server.scene.remove_by_name("/others")

    def step(self) -> None:
        """Go to the next frame where it plays."""
        if self.playing.value:
            self.frame.value = (int(self.frame.value) + 1) % len(self.subject.frames)

    def serve_forever(self) -> None:
        """Play until the process is interrupted."""
        times = [frame.time for frame in self.subject.frames]
        gaps = np.diff(times)
        pause = float(np.median(gaps)) if len(gaps) and (gaps > 0).all() else 1 / FRAMES_A_SECOND
        while True:
            time.sleep(pause)
            self.step()

    def close(self) -> None:
        """End the server."""
        with redirect_stdout(io.StringIO()):
            self.server.stop()

    def __enter__(self) -> ViserViewer:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the server."""
        self.close()


def _free_port(port: int) -> int:
    """Return the port, or a free one for 0; viser would take the next one without a word."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOCAL_HOST, port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise ViewerError(
                f"port {port} of {LOCAL_HOST}: {reason}; expected a free port; give another one, or none"
            ) from error
        return int(probe.getsockname()[1])


def _body(subject: DrawnSubject, server: Any) -> Any:
    """Load the figure's capsules into Pinocchio's visualizer, right limbs orange and left ones blue."""
    from pinocchio.visualize import ViserVisualizer

    class CapsuleVisualizer(ViserVisualizer):  # type: ignore[misc]
        """Draws capsules, too, which Pinocchio's own refuses."""

        def loadViewerGeometryObject(self, geometry_object: Any, prefix: str = "", color: Any = None) -> None:
            geom = geometry_object.geometry
            if not isinstance(geom, coal.Capsule):
                super().loadViewerGeometryObject(geometry_object, prefix, color)
                return
            half = np.array([0.0, 0.0, geom.halfLength])
            mesh = capsule_mesh(-half, half, geom.radius)
            name = f"{prefix}/{geometry_object.name}"
            tint = SIDE_RGB[side(geometry_object.name)]
            self.frames[name] = self.viewer.scene.add_mesh_simple(name, mesh.vertices, mesh.faces, color=tint)

    figure = subject.figure
    body = CapsuleVisualizer(figure.model, pin.GeometryModel(), figure.geometry)
    body.initViewer(viewer=server)
    body.loadViewerModel("figure")
    return body
