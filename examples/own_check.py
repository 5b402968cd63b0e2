"""Write your own check and use it for files, arrays, robots, recoveries, and on the command line.

In this folder: ``posekit validate jump.bvh --checks joint-range,own_check:FeetAboveGround``.
"""

import numpy as np

import posekit
from posekit.validators import Body, Judgement


class FeetAboveGround:
    """A foot is below the ground."""

    name = "feet-above-ground"
    unit = "m"
    reads = ("joints", "up")
    points = ("right_ankle", "left_ankle")

    def __init__(self, ground: float = 0.0) -> None:
        self.ground = ground

    def judge(self, body: Body) -> Judgement:
        """Measure the height of both ankles; an unknown ankle is NaN, and the check is undecided."""
        height = body.joints[:, [12, 13]] @ np.asarray(body.up) - self.ground
        return Judgement(self.points, height, lower=0.0, tolerance=0.01)


def main() -> None:
    """Judge postures, and recover a view, with the check."""
    standing = posekit.load_figure().neutral_points[:14] + np.array([0.0, 0.0, 1.5])
    sunk = standing - [0.0, 0.0, 1.0]
    frames = np.concatenate([np.repeat(standing[None], 20, axis=0), np.repeat(sunk[None], 10, axis=0)])
    report = posekit.validate(frames, rate=30, up="+z", checks=["joint-range", FeetAboveGround()])
    print(report.decision)

    view = posekit.builtin_view("seq1")
    physical = ["rigid-parts", "joint-range", "collision"]
    # The origin is the camera. If the camera is level, the ground is below the origin by the camera's height.
    for checks in (physical, [*physical, FeetAboveGround(ground=-0.78)]):
        print([len(frame.joints) for frame in posekit.recover(view, checks=checks)])


if __name__ == "__main__":
    main()
