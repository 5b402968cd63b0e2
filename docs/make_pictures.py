"""Make the pictures of README and documentation from the samples: ``python docs/make_pictures.py``.

It needs Chromium or Chrome, and the extra ``pictures``.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
import time
from pathlib import Path

from PIL import Image

import posekit
from posekit.samples import samples
from posekit.viewer.browser import Browser

PICTURES = Path(__file__).resolve().parent / "pictures"
SIZE = (1200, 640)
WIDTH = 900
SHOW_FINDING = """
[...document.querySelectorAll('button')].find(one => one.textContent.includes('joint-range right_elbow')).click()
"""


def write(name: str, picture: bytes) -> None:
    """Write a picture with few colours, to keep the repository small."""
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
    image.quantize(256, Image.Quantize.FASTOCTREE).save(PICTURES / name, optimize=True)


def main() -> None:
    """Draw four postures recovered from one view, and the page of a motion with a selected finding."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        samples("samples")
        posekit.recover("samples/walk.json").save("postures.npz")
        posekit.render(
            "postures.npz", "survivors.png", view="samples/walk.json", frame=1, which="0,1,2,3", size=SIZE
        )
        write("survivors.png", Path("survivors.png").read_bytes())
        posekit.render("samples/jump.bvh", "jump.html")
        with Browser(size=SIZE) as browser:
            browser.open(Path("jump.html").resolve())
            browser.evaluate(SHOW_FINDING)
            time.sleep(0.5)
            write("report.png", browser.screenshot())


if __name__ == "__main__":
    main()
