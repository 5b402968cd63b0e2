"""Recover every posture behind one view, look at the survivors, and ask why the others are gone.

python examples/recover_a_view.py
"""

import posekit

view = posekit.builtin_view("seq2")
recovery = posekit.recover(view, checks=("rigid-parts", "joint-range", "collision"), group=0.05)

frame = recovery.frames[0]
assert frame.groups is not None  # `group` asked for them
print(f"{len(frame)} of 8192 postures survive, in {len(set(frame.groups))} groups")
print(f"joints {frame.joints.shape}, configurations {frame.q.shape}")
print(f"configuration and posture agree to {frame.fk_distance.max():.1e} m")
print(f"nearest collision {min(frame.margins['collision']) * 100:.1f} cm away")

print("\nWhat killed the others:")
for reason, leaves in sorted(frame.rejected.items(), key=lambda item: -item[1])[:5]:
    print(f"{leaves:6}  {reason}")

branch = frame.pruned()[-1]
print(
    f"\nFor example branch {branch.branch}, pruned at {branch.joint}: {branch.reason} is "
    f"{branch.value:.1f} {branch.unit}, allowed are {branch.lower:.1f} to {branch.upper:.1f}"
)
