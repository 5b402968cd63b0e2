"""What is around the postures: light, background, the ground with its grid."""

from __future__ import annotations

import meshcat.geometry as mg
import numpy as np

from posekit.errors import ViewerError
from posekit.geometry import Array, cross
from posekit.viewer.scene.colours import Rgb, rgb
from posekit.viewer.scene.framing import FLESH_METRES
from posekit.viewer.scene.scene import Json, Scene
from posekit.viewer.scene.shapes import UNIT_BALL, glow

BACKGROUND_RGB: dict[str, Rgb] = {"white": rgb("#ffffff"), "grey": rgb("#e8ebee"), "black": rgb("#101418")}

GRID_RGB, GRID_SQUARE_METRES = rgb("#b8bec6"), 0.5
"""Colour of the ground's grid and the side of its squares, metres."""

SCENE_LIGHTS = (
    ("key", (-5.0, -4.0, 5.0), 0.34),
    ("fill", (-3.0, 6.0, 3.0), 0.16),
    ("back", (6.0, 1.0, 4.0), 0.14),
)
"""Name, direction and strength of the lights: from the view's camera and the right, from the left, from behind."""

MAT_RADIUS_METRES = 0.24
"""Radius of the mat below a body, metres."""

GROUND_MARGIN_METRES = 0.75
"""Metres of ground around what stands on it, at least."""


def background_colour(text: str) -> Rgb | None:
    """Read ``white``, ``grey``, ``black``, ``#rrggbb`` or ``transparent`` (None)."""
    if text == "transparent":
        return None
    if text in BACKGROUND_RGB:
        return BACKGROUND_RGB[text]
    if len(text) == 7 and text[0] == "#" and all(letter in "0123456789abcdefABCDEF" for letter in text[1:]):
        return rgb(text)
    raise ViewerError(
        f"background: {text!r}; expected {', '.join(BACKGROUND_RGB)}, transparent, or a colour as #e8ebee"
    )


def add_stage(scene: Scene, points: Array, *, background: str = "white", ground: bool = True) -> None:
    """Set the light and the background, and lay the ground's grid below `points`.

    Parameters
    ----------
    points : array (..., 3)
        All that stands on the ground, world, metres; NaN where unknown.
    background : str
        See `background_colour`.
    ground : bool
        Whether the grid is drawn.
    """
    colour = background_colour(background)
    for path in ("/Grid", "/Axes", "/Lights/PointLightNegativeX", "/Lights/PointLightPositiveX"):
        scene.show(path, False)
    scene.show("/Lights/FillLight", False)
    scene.show("/Lights/AmbientLight", False)
    sky = {"type": "HemisphereLight", "color": 0xFFFFFF, "groundColor": 0x8C8680, "intensity": 0.66}
    _add_light(scene, "sky", sky)
    for name, position, intensity in SCENE_LIGHTS:
        light = {"type": "DirectionalLight", "color": 0xFFFFFF, "intensity": intensity}
        _add_light(scene, name, light, position)
    if colour is None:
        scene.show("/Background", False)
    else:
        for name in ("top_color", "bottom_color"):
            scene.send(_Property("/Background", name, list(colour)))
    if ground:
        _add_grid(scene, points)


def add_mat(scene: Scene, name: str, points: Array, colour: Rgb) -> Array:
    """Lay a round mat on the ground below a body's points (K, 3), world, metres; return its outermost points."""
    known = points[np.isfinite(points).all(axis=1)]
    middle = np.median(known, axis=0)
    scene.meshcat[name].set_object(mg.Mesh(UNIT_BALL, glow(colour, 0.8)))
    matrix = np.diag([MAT_RADIUS_METRES, MAT_RADIUS_METRES, 0.003, 1.0])
    matrix[:2, 3] = middle[:2]
    scene.transform(f"/meshcat/{name}", matrix)
    reach = MAT_RADIUS_METRES - FLESH_METRES
    return np.asarray(
        matrix[:3, 3]
        + reach * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    )


def _add_light(
    scene: Scene, name: str, light: Json, position: tuple[float, float, float] = (0.0, 0.0, 1.0)
) -> None:
    scene.nodes.pop(f"/Lights/{name}", None)
    scene.send(_Object(f"/Lights/{name}", light))
    matrix = np.eye(4)
    matrix[:3, 3] = position
    scene.transform(f"/Lights/{name}", matrix)


def _add_grid(scene: Scene, points: Array) -> None:
    known = points[np.isfinite(points).all(axis=-1)].reshape(-1, 3)
    low = (
        np.floor((known[:, :2].min(axis=0) - GROUND_MARGIN_METRES) / GRID_SQUARE_METRES) * GRID_SQUARE_METRES
    )
    high = (
        np.ceil((known[:, :2].max(axis=0) + GROUND_MARGIN_METRES) / GRID_SQUARE_METRES) * GRID_SQUARE_METRES
    )
    lines = []
    for k in range(2):
        for at in np.arange(low[k], high[k] + GRID_SQUARE_METRES / 2, GRID_SQUARE_METRES):
            start, end = np.array([*low, 0.0]), np.array([*high, 0.0])
            start[k] = end[k] = at
            lines.append((start, end))
    starts, ends = np.array([line[0] for line in lines]), np.array([line[1] for line in lines])
    # Flat strips: a tube of this width would be lost between two pixels from afar.
    along = (ends - starts) / np.linalg.norm(ends - starts, axis=1, keepdims=True)
    half = 0.006 * cross(along, np.array([0.0, 0.0, 1.0]))
    vertices = np.stack([starts - half, ends - half, ends + half, starts + half], axis=1).reshape(-1, 3)
    faces = (4 * np.arange(len(lines))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    scene.meshcat["ground"].set_object(mg.TriangularMeshGeometry(vertices, faces), glow(GRID_RGB))


class _Object:
    """A set_object command with what meshcat-python has no class for."""

    def __init__(self, path: str, value: Json) -> None:
        self.path, self.value = path, value

    def lower(self) -> Json:
        return {"type": "set_object", "path": self.path, "object": {"object": self.value}}


class _Property:
    """A set_property command outside of ``/meshcat``."""

    def __init__(self, path: str, name: str, value: list[float]) -> None:
        self.path, self.name, self.value = path, name, value

    def lower(self) -> Json:
        return {"type": "set_property", "path": self.path, "property": self.name, "value": self.value}
