"""
Survivors and the camera that sees them
=======================================

A picture without a screen: the survivors of one frame in one place, with the camera, its image and the rays.
"""

from pathlib import Path
from tempfile import mkdtemp

import posekit
from posekit.viewer import Shot, Style, subject_of, write_picture

view = posekit.builtin_view("seq2")
subject = subject_of(posekit.result_of(posekit.recover(view)), view)

# %%
# Right limbs are orange, left ones blue.
scene = Path(mkdtemp()) / "scene.png"
write_picture(
    scene,
    subject,
    [subject.frames[0]],
    style=Style(layout="superposed"),
    shot=Shot(size=(900, 560), azimuth=60),
)
