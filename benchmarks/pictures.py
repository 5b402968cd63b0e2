"""Pictures a second with one browser for all, against a browser for each; and an animation of 100 frames.

Run: python benchmarks/pictures.py
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

import posekit
from posekit.viewer.browser.studio import Studio
from posekit.viewer.pictures import Shot, write_picture
from posekit.viewer.scene.compose import Style, compose
from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown, subject_of
from posekit.viewer.scene.framing import fitted_eye
from posekit.viewer.scene.world import upright_world

PICTURE_SIZE = (640, 480)
N_PICTURES, N_STARTS, N_FRAMES = 40, 3, 100


def main() -> None:
    view = posekit.builtin_view("seq1")
    subject = subject_of(posekit.result_of(posekit.recover(view)), view)
    world = upright_world(subject.points())
    chosen = [frame.chosen([k % len(frame)]) for k in range(N_PICTURES // 5) for frame in subject.frames]
    made = [compose(shown, figure=subject.figure, world=world, style=Style()) for shown in chosen]
    eye = fitted_eye(made[0].points, world, azimuth=55, elevation=14)

    start = time.perf_counter()
    for composition in made[:N_STARTS]:
        with Studio() as studio:
            studio.draw(composition.scene, eye, size=PICTURE_SIZE)
    alone = (time.perf_counter() - start) / N_STARTS

    with Studio() as studio:
        studio.draw(made[0].scene, eye, size=PICTURE_SIZE)
        start = time.perf_counter()
        for composition in made:
            studio.draw(composition.scene, eye, size=PICTURE_SIZE)
        together = (time.perf_counter() - start) / len(made)
    print(f"{PICTURE_SIZE[0]}x{PICTURE_SIZE[1]} pixels, drawn twice as large, camera and rays included")
    print(f"a browser for each picture: {alone:6.3f} s a picture")
    print(f"one browser for all:        {together:6.3f} s a picture, {1 / together:.1f} a second")
    print(f"ratio:                      {alone / together:6.1f}")

    frames = morph(subject, N_FRAMES)
    with tempfile.TemporaryDirectory() as folder:
        for size in (PICTURE_SIZE, (1280, 720)):
            start = time.perf_counter()
            count = write_picture(
                Path(folder) / "walk.gif",
                subject,
                frames,
                shot=Shot(size=size),
                style=Style(layout="superposed"),
            )
            seconds = time.perf_counter() - start
            print(
                f"GIF of {count} frames, {size[0]}x{size[1]}, the browser's start included: {seconds:.1f} s"
            )


def morph(subject: DrawnSubject, count: int) -> list[Shown]:
    """Go from one survivor of each frame to the next: as many different postures as are asked for."""
    keys = np.stack([frame.points[0] for frame in subject.frames])
    places = np.linspace(0, len(keys) - 1, count)
    before = np.minimum(places.astype(int), len(keys) - 2)
    part = (places - before)[:, None, None]
    points = (1 - part) * keys[before] + part * keys[before + 1]
    return [Shown(points=each[None], sight=subject.frames[0].sight) for each in points]


if __name__ == "__main__":
    main()
