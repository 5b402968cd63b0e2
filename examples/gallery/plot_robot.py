"""
A robot's motion
================

Configurations of a Unitree G1: limits by the joints' names, which meshes touch, and feet in the ground.
"""

import os
from tempfile import mkdtemp

import numpy as np

import posekit
from posekit.samples import write_samples
from posekit.viewer.plots.timeline_plot import plot_timelines

os.chdir(mkdtemp())
write_samples("samples")
report = posekit.validate("samples/robot.npz", urdf="g1")
print(report.summary)
timeline = plot_timelines(report.clips or ())

# %%
# Single configurations, and joints of people, which are fitted to the robot: could somebody built like it take them?
g1 = posekit.Validator("g1", checks=("joint-range", "collision"), bodies="capsules")
assert g1.robot is not None
q = np.zeros((2, g1.robot.model.nq))
q[:, 6] = 1.0  # the root's quaternion: upright
q[1, g1.robot.configuration_names.index("left_shoulder_roll_joint")] = -0.9
checked = g1.check(q=q)
contacts = checked.contacts()
print(checked.verdicts)
for posture, pair, distance in zip(contacts.posture, contacts.pair, contacts.distance, strict=True):
    print(f"posture {posture}: {contacts.names[pair]} {distance:.3f} m")
