"""One HTML page that holds all it needs: meshcat's viewer, the player, a scene. It loads nothing."""

from __future__ import annotations

import html
import json
from functools import lru_cache
from importlib import resources
from pathlib import Path

import meshcat

from posekit.viewer.scene.eye import Eye
from posekit.viewer.scene.scene import Json, Scene

CONTENT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "connect-src data: blob:"
)
"""The browser itself refuses to load anything from outside."""

PAGE_TEMPLATE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
html, body {{ margin: 0; height: 100%; }}
#meshcat-pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
{style}
</style>
</head>
<body>
<div id="stage"><div id="meshcat-pane"></div></div>
{body}
<!--
{licence}
-->
<script>
{meshcat}
</script>
<script>
{player}
</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"), {animate});
posekit.apply({document});
posekit.look({eye});
{script}
</script>
</body>
</html>
"""


def standalone_page(
    scene: Scene,
    *,
    eye: Eye,
    title: str = "posekit",
    body: str = "",
    style: str = "",
    script: str = "",
    animate: bool = True,
) -> str:
    """Make a page that shows a scene, offline, to be turned and zoomed by hand.

    Parameters
    ----------
    scene : Scene
        What the page shows.
    eye : Eye
        Where one looks from at first.
    title : str
        Plain text.
    body, style, script : str
        HTML beside the picture's pane (``#stage`` > ``#meshcat-pane``), CSS, and JavaScript that runs once the
        scene is drawn; it finds ``posekit`` (``apply``, ``show``, ``look``, ``picture``) and meshcat's ``viewer``.
        They are put in as they are: escape in them what others wrote.
    animate : bool
        Whether the page draws by itself; a page for pictures draws when it is asked.

    Returns
    -------
    str
        The page, about 0.9 MB and the scene.
    """
    return PAGE_TEMPLATE.format(
        policy=CONTENT_POLICY,
        title=html.escape(title),
        style=style,
        body=body,
        licence=_dist("main.min.js.LICENSE.txt").replace("--", "- -"),
        meshcat=meshcat_script(),
        player=player(),
        animate="true" if animate else "false",
        document=script_json(scene.document()),
        eye=script_json(eye.json()),
        script=script,
    )


def script_json(value: Json | list[Json]) -> str:
    """Spell a value as JSON that may stand inside a script element."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


@lru_cache(maxsize=1)
def player() -> str:
    """Return the text of ``player.js``."""
    return (resources.files("posekit.viewer") / "player.js").read_text(encoding="utf-8")


def meshcat_script() -> str:
    """Return meshcat's viewer, JavaScript."""
    return _dist("main.min.js")


@lru_cache(maxsize=2)
def _dist(name: str) -> str:
    """Read a file of meshcat's own viewer."""
    return (Path(meshcat.__file__).parent / "viewer" / "dist" / name).read_text(encoding="utf-8")
