"""
The scale of a closed chain
===========================

Four bars in one picture without a camera: the scale at which their loop closes (Taylor 2000, Fig. 7).
"""

import numpy as np

from posekit.linkages import LinkageFamily, load_linkage, search
from posekit.viewer.plots import plot_curve

# An object of your own is a TOML file like urdf/linkages/four_bar.toml.
linkage = load_linkage("four_bar")
image = np.array([[212.0, 388.0], [287.0, 512.0], [541.0, 296.0], [335.0, 239.0]])
family = LinkageFamily(linkage=linkage, image=image)
print(f"s is at least {family.minimum_scale:.3f} pixels a millimetre: {family.bounding_segment} needs it")

found = search(family, {"closure": 1.0})
for s, residual, flips in zip(found.s, found.residual, found.flips, strict=True):
    print(f"s = {s:.4f}, residual {residual:.1e}, flips {flips.tolist()}")

# %%
# The loop's gap over the scale for one way to point, and its minima.
curve = plot_curve(found.curve_s, found.curve_residual, minima=(found.s, found.residual), title="four bars")
