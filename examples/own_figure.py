"""Make the figure of another person, draw random valid postures of it, and judge them.

python examples/own_figure.py
"""

import numpy as np

import posekit
from posekit.synthesis import random_postures


def main() -> None:
    """Judge valid postures, and a posture with a displaced wrist."""
    figure = posekit.load_figure().scaled({"right_hip-right_knee": 0.45}, stature=1.82)
    print(f"upper arm {figure.lengths['right_shoulder-right_elbow'] * 100:.1f} cm")

    q = random_postures(figure, 20, np.random.default_rng(0))
    joints = figure.points(q)
    validator = posekit.Validator(figure, strict=True)  # as the model itself: no tolerance
    report = validator.check(joints)
    print(f"{report.ok.sum()} of {len(joints)} postures are valid")

    torn = joints[:1].copy()
    torn[0, 8] += [0.0, 0.0, 0.4]  # the right wrist, metres
    report = validator.check(torn)
    print(report.verdicts[0], *map(str, report.spans), sep="\n  ")


if __name__ == "__main__":
    main()
