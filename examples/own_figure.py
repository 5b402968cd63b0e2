"""Make the figure of another person, draw random legal postures of it, and validate them.

python examples/own_figure.py
"""

import numpy as np

import posekit
from posekit.synthesis import random_postures

figure = posekit.load_figure().from_stature(1.82).scaled({"right_hip-right_knee": 0.45})
print(f"upper arm {figure.lengths['right_shoulder-right_elbow'] * 100:.1f} cm")

q = random_postures(figure, 100, np.random.default_rng(0))
joints = figure.forward_kinematics(q)[:, :14]
report = posekit.Validator(figure).check(joints)
print(f"{report.valid.sum()} of {len(joints)} postures are valid")

joints[0, 8] += [0.0, 0.0, 0.4]  # tear the right wrist away
report = posekit.Validator(figure).check(joints[:1])
worst = report.judgements[0]
where = worst.where[np.nanargmin(worst.margin[0])]
print(f"{report.verdicts[0]}: {where} is {-worst.worst[0]:.2f} m beyond the tolerance")
