"""Recover a closed chain of four bars from one uncalibrated picture: its scale follows from its loop.

python examples/linkage.py
"""

import numpy as np

from posekit.cameras import ScaledOrthographicCamera
from posekit.linkages import LinkageFamily, load_linkage, search, span
from posekit.validators.linkage import closure, nearer

# An object of your own is a TOML file like urdf/linkages/four_bar.toml.
linkage = load_linkage("four_bar")
image = np.array([[212.0, 388.0], [287.0, 512.0], [541.0, 296.0], [335.0, 239.0]])

family = LinkageFamily(linkage=linkage, image=image)
print(f"s is at least {family.minimum_scale:.3f} pixels a millimetre: {family.bounding_segment} needs it")

found = search(family, {"closure": 1.0})
print(f"{found.n_flips} flips, {len(found)} minima:")
for s, residual, flips in zip(found.s, found.residual, found.flips, strict=True):
    print(f"  s = {s:.4f}, residual {residual:.1e}, flips {flips.tolist()}")

# All postures at the best scale in which a is nearer than b; each with its mirror image left out by that.
camera = ScaledOrthographicCamera(scale=float(found.s[0]))
spanned = span(linkage)
checks = closure(spanned) + nearer({"a-b": "a"}, joints=spanned.tree.joints, segments=linkage.segment_names)
leaves = spanned.grow(camera, image[None], checks)
for points in spanned.points(leaves.postures()):
    print(np.round(points, 1).tolist())
