"""Show a robot's configurations in the browser with Pinocchio's viewer for viser (``pip install viser``).

Run: ``python examples/viser_viewer.py g1 samples/robot.npz``
"""

from __future__ import annotations

import sys
import time

import numpy as np
from pinocchio.visualize import ViserVisualizer

import posekit


def main(urdf: str, path: str) -> None:
    """Show the frames of a file, one after the other."""
    robot = posekit.load_robot(urdf)
    motion = posekit.open(path, urdf=urdf)
    viewer = ViserVisualizer(robot.model, robot.geometry, robot.visuals)
    viewer.initViewer(open=True)
    viewer.loadViewerModel()
    rate = motion.rate or 10.0
    for q in np.asarray(motion.q):
        viewer.display(q)
        time.sleep(1 / rate)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
