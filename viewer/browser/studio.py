"""Draws scenes: one browser, one page, picture after picture; only what changes is sent."""

from __future__ import annotations

import base64
import io
from types import TracebackType

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from posekit.errors import ViewerError
from posekit.viewer.browser.browser import STEP_TIMEOUT_SECONDS, Browser
from posekit.viewer.scene.eye import CameraEye, Eye
from posekit.viewer.scene.scene import Scene
from posekit.viewer.standalone import meshcat_script, player, script_json

Pixels = NDArray[np.uint8]

MAX_SIDE_PIXELS = 8192
"""Pixels of a picture's side before supersampling is taken off: what WebGL draws everywhere."""

PLAIN_CONTEXT = """
const made = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, options) {
  return made.call(this, kind, options && { ...options, antialias: false });
};
0
"""
"""Supersampling smooths edges already; multisampling on top of it would double the time."""

MIN_CHANNEL_DIFFERENCE, MIN_DRAWN_SHARE, N_SAMPLED_PIXELS = 8, 2e-4, 10_000
"""A pixel is drawn on where a channel is further than this from the background; a picture needs this share."""


class Studio:
    """A place where scenes are drawn.

    Parameters
    ----------
    browser : str, optional
        The program; default see `posekit.viewer.browser.find_browser`.
    timeout : float
        Seconds that one picture may take.

    Examples
    --------
    ::

        with Studio() as studio:
            pixels = studio.draw(scene, eye, size=(1280, 720))
    """

    def __init__(self, browser: str | None = None, *, timeout: float = STEP_TIMEOUT_SECONDS) -> None:
        self._browser = Browser(browser, timeout=timeout, size=(64, 64))
        self._drawn = Scene()
        self._known: set[str] = set()
        try:
            self._load()
        except BaseException:
            self._browser.close()
            raise

    def __enter__(self) -> Studio:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the browser."""
        self._browser.close()

    @property
    def pid(self) -> int:
        """The id of the browser's process."""
        return self._browser.pid

    def draw(
        self, scene: Scene, eye: Eye | CameraEye, *, size: tuple[int, int] = (1280, 720), supersample: int = 2
    ) -> Pixels:
        """Draw a scene.

        Parameters
        ----------
        scene : Scene
            What is drawn.
        eye : Eye, ViewEye or ParallelEye
            Where it is looked at from.
        size : (int, int)
            Width and height, pixels.
        supersample : int
            How many times larger, in both directions, it is drawn before it is scaled down.

        Returns
        -------
        uint8 array (height, width, 4)
            Red, green, blue, opacity.

        Raises
        ------
        ViewerError
            Where the browser fails, or where nothing is to be seen in the picture.
        """
        pixels = self._shoot(scene, eye, size, supersample)
        check_drawn(pixels)
        return pixels

    def _shoot(self, scene: Scene, eye: Eye | CameraEye, size: tuple[int, int], supersample: int) -> Pixels:
        width, height = size
        check_size(size, supersample)
        world, projection = eye.matrices(width, height)
        document = scene.document(self._drawn, self._known)
        shot = {
            "width": width,
            "height": height,
            "supersample": supersample,
            "world": world.T.ravel().tolist(),
            "projection": projection.T.ravel().tolist(),
        }
        url = self._browser.evaluate(
            f"posekit.apply({script_json(document)}); posekit.picture({script_json(shot)})"
        )
        self._drawn = scene.copy()
        data = base64.b64decode(url.partition(",")[2])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))

    def _load(self) -> None:
        self._browser.evaluate(
            "document.body.innerHTML = '<div><div id=\"meshcat-pane\"></div></div>'; document.body.style.margin = 0"
        )
        self._browser.evaluate(PLAIN_CONTEXT)
        self._browser.evaluate(meshcat_script() + "\n;0")
        self._browser.evaluate(player() + "\n;0")
        try:
            self._browser.evaluate(
                'const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"), false); 0'
            )
        except ViewerError as error:
            raise ViewerError(
                f"the browser has no WebGL to draw with ({error}); use another browser"
            ) from None


def check_size(size: tuple[int, int], supersample: int) -> None:
    """Refuse a picture that cannot be drawn."""
    width, height = size
    if min(width, height, supersample) < 1 or max(size) * supersample > MAX_SIDE_PIXELS:
        raise ViewerError(
            f"a picture of {width}x{height} pixels drawn {supersample} times larger; expected sides from 1 to "
            f"{MAX_SIDE_PIXELS} pixels, supersampling included; draw it smaller"
        )


def _channels(packed: NDArray[np.uint32]) -> NDArray[np.int16]:
    return packed.view(np.uint8).reshape(-1, 4).astype(np.int16)


def check_drawn(pixels: Pixels) -> None:
    """Refuse a picture (H, W, 4) of one colour: WebGL failed, or one looked elsewhere.

    Raises
    ------
    ViewerError
        Where fewer than 0.02 % of the pixels differ from the most common colour.
    """
    packed = np.ascontiguousarray(pixels).view(np.uint32).ravel()
    values, counts = np.unique(packed[:: max(packed.size // N_SAMPLED_PIXELS, 1)], return_counts=True)
    common = values[np.argmax(counts)]
    others = packed[packed != common]
    apart = np.abs(_channels(others) - _channels(common[None])).max(axis=1) > MIN_CHANNEL_DIFFERENCE
    share = np.count_nonzero(apart) / packed.size
    if share < MIN_DRAWN_SHARE:
        raise ViewerError(
            f"the picture is flat: {100 * share:.3g} % of its pixels differ from its background; the browser's "
            "WebGL failed, or the camera looks past the scene; check the camera's pose, or use another browser"
        )
