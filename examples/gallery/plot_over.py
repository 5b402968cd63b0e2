"""
On the photograph
=================

A photograph is drawn of a posture that nobody had, the posture is recovered from the points in it, and drawn over it.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import posekit
from posekit.synthesis import CameraSphere, random_views
from posekit.viewer.overlay import frame_pictures, overlaid_person, write_overlay, write_photographs
from posekit.views import view_of

folder = Path(mkdtemp())
scene = random_views(posekit.load_figure(), 1, np.random.default_rng(6), CameraSphere(distance=(2.5, 2.5)))
view = view_of(scene)
write_photographs(folder / "photographs", view)
photograph = folder / "photographs" / "000000.png"

# %%
# The likeliest posture as a body, others as faint bones, and rings around the points that it was recovered from.
result = posekit.result_of(posekit.recover(view))
over = folder / "over.png"
write_overlay(over, [overlaid_person(result, view)], frame_pictures(folder / "photographs"))
print(f"{len(result.frames[0].joints)} postures have these points")
