"""Draw pictures of bodies: Pinocchio's MeshcatVisualizer without its server, rendered in a headless browser."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Final

import coal
import meshcat
import numpy as np
import pinocchio as pin
import umsgpack
from pinocchio.visualize import MeshcatVisualizer

from posekit.body import Figure
from posekit.cameras import View
from posekit.errors import ViewerError, refusal
from posekit.geometry import Array, rotation_between
from posekit.progress import watched
from posekit.skeleton import HEAD, POINT, POINTS, SEGMENTS, TREE_SEGMENTS
from posekit.viewer.browser import Browser
from posekit.viewer.files import Pixels, pillow
from posekit.viewer.subjects import COLOURS, Subject, side

#: Supersampling factor along both axes.
SUPERSAMPLE: Final = 2

#: Largest width and height of a supersampled picture, pixels: the limit of WebGL.
MOST_PIXELS: Final = 8192

FOV_DEGREES: Final = 20.0
USUAL_ELEVATION: Final = 8.0
#: Ratio of the shown extent to the extent of the bodies.
FRAME_MARGIN: Final = 1.03

#: Distance that bodies extend beyond the origins of their links, metres.
BODY_RADIUS: Final = 0.12

#: Number of frames over which the path of the virtual camera is smoothed.
SMOOTH_FRAMES: Final = 31

GRID_METRES: Final = 0.5
MOST_GRID_LINES: Final = 120

#: Height of the strip with captions under a picture, pixels.
STRIP: Final = 44

#: Number of commands in one message to the browser.
BATCH: Final = 40

#: Distance of the drawn image plane from the camera, metres.
IMAGE_DEPTH: Final = 0.6

#: Minimum share of pixels that differ from the background: WebGL can fail with an empty picture.
LEAST_DRAWN: Final = 2e-4


class Recorder:
    """Record meshcat commands instead of sending them to a server, in the encoding that meshcat's page reads.

    Attributes
    ----------
    twin : (str, str) or None
        Source node and target node of copied objects, so that each mesh is sent only once.
    """

    def __init__(self) -> None:
        self.commands: list[str | tuple[str, str]] = []
        self.twin: tuple[str, str] | None = None

    def send(self, command: Any) -> None:
        """Record a command."""
        lowered = command.lower()
        if self.twin is not None and lowered["type"] == "set_object":
            path = str(lowered["path"])
            self.commands.append((path.replace(f"/{self.twin[1]}/", f"/{self.twin[0]}/"), path))
        else:
            self.commands.append(base64.b64encode(umsgpack.packb(lowered)).decode())

    def taken(self) -> list[str | tuple[str, str]]:
        """Return the commands since the last call: each as base64, or as the paths of an object and of its copy."""
        taken, self.commands = self.commands, []
        return taken


class Stage:
    """Draw bodies frame by frame with Pinocchio's visualizer into a `Recorder`.

    Parameters
    ----------
    subjects : sequence of Subject
        Bodies with equal numbers of frames.
    camera : (array (K, 2, 3), array (K, 3)), optional
        Lines that show a camera and its image, world frame, metres, and their colours; see `camera_lines`.
    """

    def __init__(self, subjects: Sequence[Subject], camera: tuple[Array, Array] | None = None) -> None:
        self.subjects = subjects
        self.recorder = Recorder()
        self._viewer = meshcat.Visualizer(window=self.recorder)
        points = np.concatenate([one.points for one in subjects], axis=1)
        if not np.isfinite(points).any():
            raise ViewerError("render: got no posture whose joints are all known; expected at least one")
        low, high = np.nanmin(points, axis=(0, 1)), np.nanmax(points, axis=(0, 1))
        self.middles = self._follow(points)
        seen = (points - self.middles[:, None]).reshape(-1, 3)
        lines = np.empty((0, 3)) if camera is None else camera[0].reshape(-1, 3) - self.middles[0]
        self.around = np.concatenate([seen[np.isfinite(seen).all(axis=1)], lines])
        for name in ("/Grid", "/Axes"):
            self._viewer[name].set_property("visible", False)
        for name in ("top_color", "bottom_color"):
            self._viewer["/Background"].set_property(name, [1, 1, 1])
        self._bodies = [self._loaded(k, one) for k, one in enumerate(subjects)]
        self._draw_ground(low, high)
        if camera is not None:
            self._draw_lines("camera", *camera)

    def _follow(self, points: Array) -> Array:
        """Return the point (T, 3) at which the camera looks in each frame: the smoothed centre of the bodies."""
        known = np.asarray(np.isfinite(points).all(axis=2))
        whole = np.asarray(known.any(axis=1))
        middles = (np.nanmin(points[whole], axis=1) + np.nanmax(points[whole], axis=1)) / 2
        every = np.arange(len(points))
        filled = np.stack([np.interp(every, np.flatnonzero(whole), one) for one in middles.T], axis=1)
        padded = np.pad(filled, ((SMOOTH_FRAMES // 2,) * 2, (0, 0)), mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, SMOOTH_FRAMES, axis=0)
        return np.asarray(windows.mean(axis=-1))

    def _loaded(self, k: int, subject: Subject) -> MeshcatVisualizer:
        """Load the geometries of one subject under its own scene node."""
        robot = subject.robot
        bodies = robot.visuals if robot.visuals.ngeoms else robot.geometry
        coloured = _coloured(robot) if isinstance(robot, Figure) else pin.GeometryModel(bodies)
        visualizer = MeshcatVisualizer(robot.model, pin.GeometryModel(), coloured)
        visualizer.initViewer(viewer=self._viewer)
        first = next(j for j, one in enumerate(self.subjects) if one.robot is robot)
        self.recorder.twin = (f"body{first}", f"body{k}") if first < k else None
        visualizer.loadViewerModel(rootNodeName=f"body{k}")
        self.recorder.twin = None
        transform = np.eye(4)
        transform[:3, :3] = subject.R_world_data
        transform[:3, 3] = subject.offset
        self._viewer[f"body{k}"].set_transform(transform)
        return visualizer

    def _draw_ground(self, low: Array, high: Array) -> None:
        """Draw a ground grid with a spacing of 0.5 m under the lowest link; the spacing is wider for a long path."""
        wide = GRID_METRES * max(1, np.ceil(((high - low)[:2].max() + 4) / MOST_GRID_LINES / GRID_METRES))
        self.grid = float(wide)
        first, last = np.floor(low[:2] / wide - 2) * wide, np.ceil(high[:2] / wide + 2) * wide
        xs, ys = (np.arange(first[k], last[k] + wide / 2, wide) for k in range(2))
        ends = [[(x, first[1]), (x, last[1])] for x in xs] + [[(first[0], y), (last[0], y)] for y in ys]
        flat = np.array(ends)
        lines = np.concatenate([flat, np.full((*flat.shape[:2], 1), low[2] - BODY_RADIUS / 2)], axis=-1)
        self._draw_lines("ground", lines, np.full((len(lines), 3), 0.72))

    def _draw_lines(self, name: str, lines: Array, colours: Array) -> None:
        """Draw lines (K, 2, 3) in colours (K, 3)."""
        vertices = lines.reshape(-1, 3).T.astype(np.float32)
        shades = np.repeat(colours, 2, axis=0).T.astype(np.float32)
        made = meshcat.geometry.LineSegments(
            meshcat.geometry.PointsGeometry(vertices, shades),
            meshcat.geometry.LineBasicMaterial(vertexColors=True),
        )
        self._viewer[name].set_object(made)

    def show(self, frame: int) -> list[str | tuple[str, str]]:
        """Set all bodies to their posture in one frame and return the recorded commands."""
        for k, (subject, visualizer) in enumerate(zip(self.subjects, self._bodies, strict=True)):
            q = subject.q[frame]
            known = bool(np.isfinite(q).all())
            self._viewer[f"body{k}"].set_property("visible", known)
            if known:
                visualizer.display(np.ascontiguousarray(q))
        return self.recorder.taken()

    def eyes(self, size: tuple[int, int], elevation: float | None) -> tuple[Array, Array]:
        """Return poses (T, 4, 4) of a camera at -y that shows all bodies, and its projection matrix (4, 4)."""
        e = np.radians(USUAL_ELEVATION if elevation is None else elevation)
        back, right = np.array([0.0, -np.cos(e), np.sin(e)]), np.array([1.0, 0.0, 0.0])
        up = np.cross(back, right)
        tangent = np.tan(np.radians(FOV_DEGREES) / 2)
        wide = tangent * size[0] / size[1]
        across, high, near = (self.around @ axis for axis in (right, up, back))
        shift = [(one.min() + one.max()) / 2 for one in (across, high)]
        sides = [
            (np.abs(one - middle) + BODY_RADIUS) / slope
            for one, middle, slope in zip((across, high), shift, (wide, tangent), strict=True)
        ]
        away = FRAME_MARGIN * float((np.maximum(*sides) + near).max())
        worlds = np.tile(np.eye(4), (len(self.middles), 1, 1))
        worlds[:, :3, :3] = np.stack([right, up, back], axis=1)
        worlds[:, :3, 3] = self.middles + shift[0] * right + shift[1] * up + away * back
        first, last = 0.01, 1000.0
        clip = np.zeros((4, 4))
        clip[0, 0], clip[1, 1] = 1 / wide, 1 / tangent
        clip[2, 2:] = -(last + first) / (last - first), -2 * last * first / (last - first)
        clip[3, 2] = -1.0
        return worlds, clip


def _coloured(figure: Figure) -> pin.GeometryModel:
    """Return the figure's capsules, coloured by side, with additional capsules of shoulders, hips and neck."""
    bodies = pin.GeometryModel(figure.geometry)
    points, data = figure.neutral_points, figure.model.createData()
    pin.forwardKinematics(figure.model, data, figure.neutral)
    joints = {figure.model.frames[one.parentFrame].name: one.parentJoint for one in bodies.geometryObjects}
    hips = points[[POINT["right_hip"], POINT["left_hip"]]].mean(axis=0)
    for name, link, start, end, radius in (
        ("girdle", "torso", points[POINT["right_shoulder"]], points[POINT["left_shoulder"]], 0.035),
        ("throat", "torso", points[POINT["neck"]], points[list(HEAD)].mean(axis=0), 0.045),
        ("spine", "torso", points[POINT["neck"]], points[POINT["pelvis"]], 0.05),
        ("loins", "hips", points[POINT["pelvis"]], hips, 0.05),
    ):
        length = float(np.linalg.norm(end - start))
        if length < radius / 2:  # a pelvis between the hips
            continue
        turn = rotation_between(np.array([0.0, 0.0, 1.0]), (end - start) / length)
        placement = data.oMi[joints[link]].actInv(pin.SE3(turn, (start + end) / 2))
        shape = coal.Capsule(radius, length)
        frame = figure.model.getFrameId(link)
        bodies.addGeometryObject(pin.GeometryObject(name, joints[link], frame, placement, shape))
    for body in bodies.geometryObjects:
        body.meshColor = np.array([*(part / 255 for part in COLOURS[side(body.name)]), 1.0])
    return bodies


def camera_lines(
    view: View, frame: int, joints: Array, R_world_cam: Array, offset: Array
) -> tuple[Array, Array]:
    """Return the lines (K, 2, 3) of a camera, its rays and its image, world frame, metres; and their colours (K, 3).

    Parameters
    ----------
    view : View
    frame : int
        Frame to draw.
    joints : array (14, 3)
        Joints at the ends of the rays, camera frame, metres.
    R_world_cam : array (3, 3)
    offset : array (3,)
        Rotation and displacement from the camera frame to the world frame.
    """
    seen = np.isfinite(view.image[frame]).all(axis=1) & np.isfinite(joints).all(axis=1)
    parallel = not view.camera.perspective
    depth = float(joints[seen, 2].min()) - IMAGE_DEPTH if parallel else IMAGE_DEPTH
    flat = joints.copy()
    flat[:, 2] = depth
    if not parallel:
        flat[:, :2] = joints[:, :2] / joints[:, 2:] * depth
    (west, north, _), (east, south, _) = flat[seen].min(axis=0) - 0.04, flat[seen].max(axis=0) + 0.04
    corners = np.array([[west, north], [east, north], [east, south], [west, south]])
    corners = np.column_stack([corners, np.full(4, depth)])
    rays = [(flat[k] if parallel else np.zeros(3), joints[k]) for k in np.flatnonzero(seen)]
    image = [(flat[a], flat[b]) for a, b in SEGMENTS if seen[a] and seen[b]]
    frame_of = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    if not parallel:
        frame_of += [(np.zeros(3), corner) for corner in corners]
    lines = np.array([*rays, *image, *frame_of])
    greys = [0.82] * len(rays) + [0.2] * (len(image) + len(frame_of))
    return lines @ R_world_cam.T + offset, np.repeat(np.array(greys)[:, None], 3, axis=1)


def pictures(
    subjects: Sequence[Subject],
    *,
    captions: Sequence[str] = (),
    size: tuple[int, int] = (1280, 720),
    elevation: float | None = None,
    camera: tuple[Array, Array] | None = None,
    image: Array | None = None,
    seen_from: str = "",
    step: int = 1,
) -> Iterator[Pixels]:
    """Draw bodies frame by frame.

    Parameters
    ----------
    subjects : sequence of Subject
    captions : sequence of str
        Text under each picture. The labels of the bodies are printed under the bodies.
    size : (int, int)
        Width and height, pixels.
    elevation : float, optional
        Elevation of the virtual camera above the horizontal plane, degrees.
    camera : (array (K, 2, 3), array (K, 3)), optional
        Lines that show a camera, and their colours; see `camera_lines`.
    image : array (P, 2), optional
        Image points, drawn in the upper left corner.
    seen_from : str
        Description of the viewing direction, for the last line under the picture.
    step : int
        Draw every frame whose number is a multiple of `step`.

    Yields
    ------
    uint8 array (height, width, 3)

    Raises
    ------
    InputError
        If the size cannot be drawn.
    ViewerError
        If no browser is found, the browser fails, or a picture has a single colour.
    """
    Image = pillow()
    width, height = size
    if min(size) < 2 * STRIP or max(size) * SUPERSAMPLE > MOST_PIXELS:
        expected = f"sides from {2 * STRIP} to {MOST_PIXELS // SUPERSAMPLE}"
        raise refusal("render", "--size", f"{width}x{height}", expected, "choose another")
    inset = 0 if image is None else height // 4
    stage, drawn = Stage(subjects, camera), (width - inset, height - STRIP)
    worlds, clip = stage.eyes(drawn, elevation)
    shot: dict[str, Any] = {"width": drawn[0], "height": drawn[1], "supersample": SUPERSAMPLE}
    with Browser(size=(64, 64)) as browser:
        browser.evaluate("document.body.innerHTML = '<div id=\"meshcat-pane\"></div>'; 0")
        browser.evaluate(meshcat_script() + "\n;0")
        player = (resources.files("posekit.viewer") / "player.js").read_text(encoding="utf-8")
        browser.evaluate(player + "\n;0")
        browser.evaluate(
            "const viewer = new MeshCat.Viewer(document.getElementById('meshcat-pane'), false); 0"
        )
        for frame in watched(range(0, len(subjects[0].q), step), "drawing"):
            commands = stage.show(frame)
            for start in range(0, len(commands), BATCH):
                browser.evaluate(f"posekit.apply({json.dumps(commands[start : start + BATCH])})")
            world = worlds[frame]
            shot |= {"world": world.T.ravel().tolist(), "projection": clip.T.ravel().tolist()}
            url = browser.evaluate(f"posekit.picture({json.dumps(shot)})")
            picture = Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGB")
            if frame == 0 or np.isfinite(subjects[0].q[frame]).all():
                _check_drawn(np.asarray(picture))
            line = captions[frame] if frame < len(captions) else ""
            yield _captioned(picture, stage, clip @ np.linalg.inv(world), line, seen_from, image, inset)


def _captioned(
    picture: Any, stage: Stage, projection: Array, line: str, seen_from: str, image: Array | None, inset: int
) -> Pixels:
    """Add the caption and the labels of the bodies below the picture, and the image points in a column on the left."""
    from PIL import Image, ImageDraw, ImageFont

    width, height = picture.size
    whole = Image.new("RGB", (inset + width, height + STRIP), "white")
    whole.paste(picture, (inset, 0))
    pen = ImageDraw.Draw(whole)
    labels, room = [one.label for one in stage.subjects], 0.92 * width / len(stage.subjects)
    fonts = [ImageFont.load_default(points) for points in (16, 14, 12, 11)]
    fitting = (one for one in fonts if max(pen.textlength(label, font=one) for label in labels) < room)
    large, small = next(fitting, fonts[-1]), fonts[2]
    middle: dict[str, Any] = {"anchor": "mm", "fill": (40, 40, 40)}
    for subject, label in zip(stage.subjects, labels, strict=True):
        known = subject.points[np.isfinite(subject.points).all(axis=-1)]
        x, _, _, w = projection @ np.array([*(known.min(axis=0) + known.max(axis=0)) / 2, 1.0])
        place = inset + np.clip((x / w + 1) / 2 * width, 0, width)
        pen.text((place, height + 12), label, font=large, **middle)
    pen.text((inset + width / 2, height + 12), line, font=large, **middle)
    key = "right side orange, left side blue; " if isinstance(stage.subjects[0].robot, Figure) else ""
    key += f"grid of {stage.grid:g} m" + (f"; seen from {seen_from}" if seen_from else "")
    pen.text((inset + width / 2, height + 33), key, font=small, **{**middle, "fill": (110, 110, 110)})
    if image is not None:
        _draw_image(pen, image, (8, 8, inset - 4, 8 + height // 3), small)
    return np.asarray(whole)


def _draw_image(pen: Any, image: Array, box: tuple[int, int, int, int], font: Any) -> None:
    """Draw image points (P, 2) as a stick figure into a box."""
    known = np.asarray(np.isfinite(image).all(axis=1))
    low, high = image[known].min(axis=0), image[known].max(axis=0)
    extent = np.array([box[2] - box[0] - 16, box[3] - box[1] - 36])
    scale = float((extent / np.maximum(high - low, 1e-12)).min())
    places = (image - (low + high) / 2) * scale + [(box[0] + box[2]) / 2, (box[1] + box[3] - 20) / 2]
    pen.rectangle(box, fill="white", outline=(200, 205, 210))
    for a, b in TREE_SEGMENTS:
        if known[a] and known[b]:
            pen.line([tuple(places[a]), tuple(places[b])], fill=COLOURS[side(POINTS[b])], width=3)
    pen.text(((box[0] + box[2]) / 2, box[3] - 10), "image points", fill=(90, 90, 90), font=font, anchor="mm")


def meshcat_script() -> str:
    """Return meshcat's viewer, JavaScript."""
    return (Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")


def _check_drawn(pixels: Pixels) -> None:
    """Raise an error if a picture has a single colour."""
    background = pixels[0, 0].astype(int)
    share = float((np.abs(pixels.astype(int) - background).max(axis=-1) > 8).mean())
    if share < LEAST_DRAWN:
        raise ViewerError(
            "the picture has a single colour: WebGL failed in the browser, or no body is visible; use another browser"
        )
