"""Validate postures against a robot: joints are fitted to it, configurations are taken as they are.

python examples/validate_your_robot.py
"""

import numpy as np

import posekit
from posekit.synthesis import random_postures

# Joints of people, (N, 14, 3) metres, from wherever they come: here legal postures of the stick figure.
figure = posekit.load_figure()
joints = figure.forward_kinematics(random_postures(figure, 20, np.random.default_rng(1)))[:, :14]

# Could a person built like example-robot-data's `human` take them? The model gets their segment lengths first.
validator = posekit.Validator("human")
report = validator.check(joints)
print(f"human: {report.valid.sum()} of {len(joints)} valid, furthest joint {report.fk_distance.max():.1e} m")
for judgement in report.judgements:
    places = [judgement.where[k] for k in np.flatnonzero(judgement.violated.any(axis=0))]
    print(f"  {judgement.check:12} {judgement.violated.any(axis=1).sum():2} rejected  {', '.join(places)}")

# Configurations of a humanoid: limits by the joints' names, and which links touch.
g1 = posekit.Validator("g1", checks=("joint-range", "collision"), bodies="capsules")
robot = g1.robot
assert robot is not None
q = np.zeros((3, robot.model.nq))
q[:, 6] = 1.0  # the root's quaternion: upright
q[1, robot.configuration_names.index("left_elbow_joint")] = 3.0
q[2, robot.configuration_names.index("left_shoulder_roll_joint")] = -0.9
report = g1.check(q=q)
contacts = report.contacts()
print(f"g1: {report.verdicts}, worst margins {np.round(report.worst, 1)} deg (a centimetre counts as one)")
for posture, pair, distance in zip(contacts.posture, contacts.pair, contacts.distance, strict=True):
    print(f"  posture {posture}: {contacts.names[pair]} {distance:.3f} m")
