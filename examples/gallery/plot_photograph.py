"""
A photograph's points
=====================

Fourteen points and no camera: what the postures project to, and the three that are likeliest.
"""

import os
from tempfile import mkdtemp

import posekit
from posekit.samples import write_samples
from posekit.viewer.plots import plot_image, plot_projections

os.chdir(mkdtemp())
write_samples("samples")
view = posekit.open("samples/photo.json")
recovery = posekit.recover(view)
answer = recovery.answers[0]
print(f"likeliest: {answer.sure:.0%} sure; {len(answer.probability)} distinct postures hold 95 %")

# %%
# The points, and rings where the survivors are projected again.
points = plot_image(view, result=posekit.result_of(recovery))

# %%
# The likeliest three from the side: near and far is what a picture does not tell.
likeliest = plot_projections(answer.joints[:3])
