"""
Postures behind one view
========================

Every posture behind one view of a walker: how many of 8192 survive, what the others died of, and four that are left.
"""

import posekit
from posekit.viewer.plots import plot_projections, plot_tree

view = posekit.builtin_view("seq2")
recovery = posekit.recover(view, group=0.05)
frame = recovery.frames[0]
print(
    f"{len(frame)} of 8192 postures survive; q is {frame.q.shape}, off by {frame.fk_distance.max():.0e} m at most"
)
for reason, leaves in sorted(frame.rejected.items(), key=lambda item: -item[1])[:4]:
    print(f"{leaves:6}  {reason}")

# %%
# The tree, level by level: the paths that survive, and where and why the others end.
result = posekit.result_of(recovery, explain=True)
tree = plot_tree(result.frames[0])

# %%
# One survivor of each group from the side. They all give the same image.
assert frame.groups is not None
groups = frame.groups.tolist()
firsts = [groups.index(group) for group in sorted(set(groups))]
side_views = plot_projections(frame.joints[firsts])
