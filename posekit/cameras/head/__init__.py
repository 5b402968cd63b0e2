"""The head and the camera: six or more points of known geometry determine both (Lee & Chen 1985, §2.1).

The head's frame is the paper's: x forward, y up, z to the person's right; the camera's is OpenCV's.
"""

from posekit.cameras.head.dlt import Projection as Projection
from posekit.cameras.head.dlt import dlt as dlt
from posekit.cameras.head.points import TABLE_A2 as TABLE_A2
from posekit.cameras.head.points import HeadPoints as HeadPoints
from posekit.cameras.head.points import head_points_cam as head_points_cam
from posekit.cameras.head.pose import HeadPose as HeadPose
from posekit.cameras.head.pose import HeadWarning as HeadWarning
from posekit.cameras.head.pose import calibrate as calibrate
from posekit.cameras.head.pose import solve_pose as solve_pose
