"""
Motion that no body can do
==========================

A walk in which an elbow bends backward, and which jumps by 30 cm: the timeline of what is found.
"""

import os
from tempfile import mkdtemp

import posekit
from posekit.samples import write_samples
from posekit.viewer.plots.timeline_plot import plot_timelines

os.chdir(mkdtemp())
write_samples("samples")
report = posekit.validate("samples/jump.bvh")
clips = report.clips or ()
print(report.summary)
for span in clips[0].spans:
    print(f"{span.check} of {span.where}, frames {span.first} to {span.last}: {span.value:.2f} {span.unit}")

# %%
# A row a check, red where it rejects; blue is the longest good span.
timeline = plot_timelines(clips)
